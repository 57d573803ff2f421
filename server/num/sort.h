/* Sorting of many short arrays, by insertion and beyond 64 items by qsort, and comparisons for it. Thread: any. */
#ifndef PAL_NUM_SORT_H
#define PAL_NUM_SORT_H
#include <stdint.h>
#include <stdlib.h>

/* -1, 0 or 1 for two numbers */
#define PAL_COMPARE(a, b) (((a) > (b)) - ((a) < (b)))

static inline int pal_compare_int32(const void *a, const void *b)
{
    return PAL_COMPARE(*(const int32_t *)a, *(const int32_t *)b);
}

static inline int pal_compare_double(const void *a, const void *b)
{
    return PAL_COMPARE(*(const double *)a, *(const double *)b);
}

/* three numbers in ascending order */
static inline void pal_sort3(int32_t r[3], const int32_t c[3])
{
    int32_t low = c[0] < c[1] ? c[0] : c[1], high = c[0] < c[1] ? c[1] : c[0], last = c[2];
    r[0] = last < low ? last : low;
    r[1] = last < low ? low : last > high ? high : last;
    r[2] = last > high ? last : high;
}

/* defines static void name(type *item, size_t n) by a comparison as qsort takes it */
#define PAL_SORT(name, type, compare)                                                                                  \
    static void name(type *item, size_t n)                                                                             \
    {                                                                                                                  \
        if (n > 64) {                                                                                                  \
            qsort(item, n, sizeof *item, compare);                                                                     \
            return;                                                                                                    \
        }                                                                                                              \
        for (size_t i = 1; i < n; i++) {                                                                               \
            type moved = item[i];                                                                                      \
            size_t k = i;                                                                                              \
            for (; k > 0 && compare(&moved, &item[k - 1]) < 0; k--) item[k] = item[k - 1];                             \
            item[k] = moved;                                                                                           \
        }                                                                                                              \
    }
#endif
