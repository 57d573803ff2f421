/* The middle of repeated measurements. Thread: [any]. */
#ifndef PAL_NUM_MEDIAN_H
#define PAL_NUM_MEDIAN_H
#include "server/num/sort.h"

/* sorts value [n], n > 0, and gives its middle, the upper one of an even number */
static inline double pal_median(double *value, int n)
{
    qsort(value, (size_t)n, sizeof *value, pal_compare_double);
    return value[n / 2];
}
#endif
