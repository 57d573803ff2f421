/* The middle of repeated measurements. Thread: [any]. */
#ifndef PAL_NUM_MEDIAN_H
#define PAL_NUM_MEDIAN_H

/* sorts value [n], n > 0, and gives its middle, the upper one of an even number */
double pal_median(double *value, int n);
#endif
