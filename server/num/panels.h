/* Storage of a supernodal Cholesky factor for fast triangular solves: its columns in panels of 3 to 12 columns, in the
 * order in which the forward solve reads them.
 *
 * A panel of k columns holds the inverse of its k x k triangle by columns (forward solve), the same by rows (backward
 * solve), and the rectangle below in chunks of one vector of rows: [chunk][column][lane], so that both solves stream
 * through memory once with all k unknowns in registers. Rows and columns come in threes (points). Thread: the pattern
 * is read-only after making; values belong to one thread at a time. */
#ifndef PAL_NUM_PANELS_H
#define PAL_NUM_PANELS_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

/* the pattern; a supernode is a run of columns with the same rows below. pal_panels_free frees its arrays */
typedef struct pal_panels {
    int n_point; /* unknowns / 3                                                                     */
    int n_super;
    int32_t *first; /* first point of each supernode                                 [n_super + 1]    */
    int64_t *start; /* first of its rows (points, its own columns first) in row      [n_super + 1]    */
    int32_t *row;   /* point of each row triple, ascending                           [start[n_super]] */
    uint8_t *width; /* points in each panel, supernode by supernode                  [n_panel]        */
    int n_panel;
    int max_row;        /* longest column of a supernode, numbers                                         */
    int64_t n_value[2]; /* numbers a factor takes, padding too: double, single                            */
} pal_panels;

enum { PAL_PANEL_PADDING = 16 }; /* numbers behind the working vector of a solve that chunks may touch */

/* vectors of so many lanes in a panel of k columns over r rows */
static inline int64_t pal_panel_vectors(int k, int r, int lanes)
{
    return (int64_t)k * (2 * ((k + lanes - 1) / lanes) + (r + lanes - 1) / lanes);
}

/* from supernodes of scalar columns: super [n_super + 1] first columns, pi [n_super + 1] first rows in s, whose entries
 * come in threes. INTERNAL: they do not; MEMORY */
pal_err pal_panels_make(int n_super, const int *super, const int *pi, const int *s, pal_panels *out);
void pal_panels_free(pal_panels *p);

/* values from supernodes by columns, px [n_super] first value of each; into n_value[single] numbers */
void pal_panels_fill_double(const pal_panels *p, const int *px, const double *x, double *value);
void pal_panels_fill_single(const pal_panels *p, const int *px, const double *x, float *value);
/* x = t L^-T L^-1 s b for the n points of b and x [n][3], of which point i is point place[i] of the factor, or 0 where
 * that is negative. y [3 n_point] and work, max_row + PAL_PANEL_PADDING finite numbers, are scratch. value at a
 * multiple of 32 bytes */
void pal_panels_solve_double(const pal_panels *p, const double *value, int n, const int32_t *place, double s,
                             const double *b, double t, double *x, double *y, double *work);
void pal_panels_solve_single(const pal_panels *p, const float *value, int n, const int32_t *place, double s,
                             const double *b, double t, double *x, float *y, float *work);
#endif
