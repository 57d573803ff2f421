#include "server/num/median.h"

#include <stdlib.h>

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double pal_median(double *value, int n)
{
    qsort(value, (size_t)n, sizeof *value, by_size);
    return value[n / 2];
}
