/* The middle of repeated measurements. Thread: [load]. */
#ifndef PAL_CLI_MEDIAN_H
#define PAL_CLI_MEDIAN_H

/* sorts value [n], n > 0, and gives its middle, the upper one of an even number */
double pal_median(double *value, int n);
#endif
