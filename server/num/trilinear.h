/* Trilinear interpolation on a regular grid of nodes (paper B section 3.5): the eight weights of a point, and the
 * sparse matrix of many points with the nodes that no point uses dropped. Beyond the grid the values of its border hold
 * (erratum B12: server/mesh/README.md). Nodes are numbered x fastest. Thread: [load]. */
#ifndef PAL_NUM_TRILINEAR_H
#define PAL_NUM_TRILINEAR_H
#include "server/base/err.h"

#include <stdint.h>

typedef struct pal_grid {
    int n[3]; /* nodes along each axis, at least 1; one: constant along it */
    double low[3], high[3];
} pal_grid;

/* the nodes around x and their weights, which sum to 1; a point within 1e-10 of a cell of a plane of nodes stands on
 * it; weights of nodes that do not exist (n = 1) are 0 and their node is one that exists */
void pal_trilinear(const pal_grid *grid, const double x[3], int64_t node[8], double weight[8]);
/* value at x of a field given at the nodes [n[2]][n[1]][n[0]] */
double pal_trilinear_at(const pal_grid *grid, const double *value, const double x[3]);

/* the matrix W: value at point i = sum over its entries of weight * value of a used node */
typedef struct pal_grid_weights {
    int n_point, n_used;
    int32_t *start; /* first entry of each point            [n_point + 1]  */
    int32_t *node;  /* used node of each entry              [start[n_point]] */
    double *weight; /*                                      [start[n_point]] */
    int64_t *used;  /* grid node of each used node, ascending [n_used]     */
} pal_grid_weights;

/* x [n_point][3]; weights of exactly 0 are left out; MEMORY. Heap */
pal_err pal_grid_weights_make(const pal_grid *grid, const double *x, int n_point, pal_grid_weights *out);
void pal_grid_weights_free(pal_grid_weights *w);
/* to [n_used] += W' value [n_point] */
void pal_grid_weights_apply_transpose(const pal_grid_weights *w, const double *value, double *to);
#endif
