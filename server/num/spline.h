/* Shape functions of subdivided solids on the unit cube (paper A section 3.4): u, v, w in [0, 1]. By number of nodes:
 *   64  uniform tricubic B-splines: node m = 16 j + 4 k + l has B_j(u) B_k(v) B_l(w)
 *    8  trilinear: node c at bits 0, 1, 2 of u, v, w
 *    5  a pyramid: the same hexahedron with corners 0, 1, 3, 2 = nodes 0, 1, 2, 3 and corners 4 to 7 in node 4
 * Gauss points of 4 x 4 x 4: point p = 16 a + 4 b + c at u = at[a], v = at[b], w = at[c] (exact to degree 7 in each).
 * Thread: any. */
#ifndef PAL_NUM_SPLINE_H
#define PAL_NUM_SPLINE_H

enum { PAL_CELL_GAUSS_POINTS = 64, PAL_CELL_MAX_NODES = 64 };
extern const double pal_gauss4_at[4], pal_gauss4_weight[4]; /* on [0, 1], weights sum to 1 */

/* the four cubic B-splines of a span and their derivatives (either may be NULL) */
void pal_spline(double u, double b[4], double slope[4]);
/* values n [n_node] and gradients g [n_node][3] with respect to u, v, w at x [3]; n_node 64, 8 or 5; either may be NULL
 */
void pal_cell_shape(int n_node, const double x[3], double *n, double (*g)[3]);
/* u, v, w and weight (sum 1) of Gauss point p of 64 */
double pal_cell_gauss_point(int p, double x[3]);
#endif
