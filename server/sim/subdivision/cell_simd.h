/* Vector kernels of subdivided solids' elements, inlined into cell_*.c; include nowhere else. As simd_wide.h: only
 * for files compiled with the room's options.
 *
 * A line of four spline coefficients gives its cubic at the four Gauss points of a span. Points and coefficients are
 * mirror images, so even and odd parts do not mix: x -> (x0 + x3, x1 + x2), (x0 - x3, x1 - x2), two products of 2 x 2,
 * and back, 20 operations instead of 28. Derivatives are taken from the values at the points, which determine the
 * cubic: that needs 3 + 3 transforms of 16 lines for all three, instead of 8. Thread: [sim]. */
#ifndef PAL_SIM_SUBDIVISION_CELL_SIMD_H
#define PAL_SIM_SUBDIVISION_CELL_SIMD_H
#include "server/num/polar.h"
#include "server/sim/core/simd_wide.h"
#include "server/sim/subdivision/cell_kernel.h"

typedef float cell_floats __attribute__((vector_size(sizeof(float) * PAL_WIDE), aligned(4), may_alias));

PAL_INLINE pal_wide cell_load_float(const float *at)
{
    return __builtin_convertvector(*(const cell_floats *)at, pal_wide);
}
PAL_INLINE void cell_store_float(float *at, pal_wide a)
{
    *(cell_floats *)at = __builtin_convertvector(a, cell_floats);
}

/* nodes from the one that X is measured from */
PAL_INLINE int cell_reference(int n_node)
{
    return n_node == PAL_CUBIC_NODES ? 21 : 0;
}

/* y = x - x_0 of half a block from lane l on, [3][n_node]. Never inlined: it becomes hundreds of moves in one block
 * with what follows, over which gcc sits ten times as long as over the rest of the file */
static __attribute__((noinline, unused)) void cell_gather(const int32_t *node, int n_node, const double *x,
                                                          pal_wide (*y)[PAL_CELL_MAX_NODES])
{
    for (int m = 0; m < n_node; m++)
        for (int l = 0; l < PAL_WIDE; l++) {
            const double *at = x + 3 * (size_t)node[m * PAL_LANES + l];
            for (int i = 0; i < 3; i++) ((double *)&y[i][m])[l] = at[i];
        }
    for (int i = 0; i < 3; i++) {
        pal_wide from = y[i][cell_reference(n_node)];
        for (int m = 0; m < n_node; m++) y[i][m] -= from;
    }
}
/* f += forces of the first n_live lanes */
PAL_INLINE void cell_scatter(const int32_t *node, int n_node, int n_live, pal_wide (*g)[PAL_CELL_MAX_NODES], double *f)
{
    for (int m = 0; m < n_node; m++)
        for (int l = 0; l < n_live; l++) {
            double *at = f + 3 * (size_t)node[m * PAL_LANES + l];
            for (int i = 0; i < 3; i++) at[i] += ((const double *)&g[i][m])[l];
        }
}

/* u = R y (transposed: u = R' y); u may be y */
PAL_INLINE void cell_rotate(const pal_wide r[9], bool transposed, int n_node, pal_wide (*y)[PAL_CELL_MAX_NODES],
                            pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    pal_wide_rotate(r, transposed, 0, n_node, PAL_CELL_MAX_NODES, y[0], u[0]);
}
PAL_INLINE void cell_minus_rest(const double *rest, int n_node, pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) u[i][m] -= pal_wide_load(rest + (3 * m + i) * PAL_LANES);
}

/* ---- rotation ---- */

/* F in the middle; at: block and lane */
PAL_INLINE void cell_middle(const pal_cell_group *group, int block, int lane, pal_wide (*y)[PAL_CELL_MAX_NODES],
                            int n_node, pal_wide f[9])
{
    const pal_wide zero = {0};
    pal_wide h[9] = {zero, zero, zero, zero, zero, zero, zero, zero, zero}, frame[9];
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) h[3 * i + j] += y[i][m] * group->middle[m][j];
    pal_wide_load_n(group->frame + (size_t)block * 9 * PAL_LANES + lane, 9, frame);
    pal_wide_mul(f, h, frame);
}
/* r = Q and s = Q'F of it */
PAL_INLINE void cell_rotation(pal_cell_group *group, int block, int lane, pal_wide (*y)[PAL_CELL_MAX_NODES], int n_node,
                              pal_wide r[9], pal_wide s[9])
{
    pal_wide f[9];
    cell_middle(group, block, lane, y, n_node, f);
    double *rotation = group->q + (size_t)block * 4 * PAL_LANES + lane;
    pal_wide_take_rotation(rotation, ~(pal_wide_mask){0}, f, r, s);
}

/* w = Q [z] J^-T, what node m bears times its grad N in the middle; s = Q'F, t as in cell_kernel.h */
PAL_INLINE void cell_rotation_stress(const pal_wide r[9], const pal_wide s[9], const pal_wide t[3],
                                     const pal_wide frame[9], pal_wide w[9])
{
    const pal_wide zero = {0};
    pal_wide c[6], sum, z[3], det = pal_wide_spin_cofactors(s, c, &sum), min = 1e-3 * sum * sum * sum;
    /* below `min` it fades with det, where the rotation is nearly undefined */
    pal_wide_mask some = (det > 0) & (sum > 1e-30);
    pal_wide weak = pal_wide_select(det < min, det / pal_wide_select(some, min, 1 + zero), 1 + zero);
    pal_wide one =
        pal_wide_select(some, weak, zero) / pal_wide_select(some, pal_wide_select(det < min, min, det), 1 + zero);
    pal_wide_spin_solve(c, one, t, z);
    pal_wide_spin_stress(r, z, frame, w);
}

/* ---- K of cubic elements ---- */

/* coefficients to values at the points along a line; at: 4 numbers, `step` apart */
PAL_INLINE void cell_values(const pal_cell_line *c, pal_wide *at, int step)
{
    pal_wide e0 = at[0] + at[3 * step], e1 = at[step] + at[2 * step];
    pal_wide o0 = at[0] - at[3 * step], o1 = at[step] - at[2 * step];
    for (int p = 0; p < 2; p++) {
        pal_wide e = c->even[p][0] * e0 + c->even[p][1] * e1, o = c->odd[p][0] * o0 + c->odd[p][1] * o1;
        at[p * step] = e + o, at[(3 - p) * step] = e - o;
    }
}
/* the transposed of it */
PAL_INLINE void cell_collect(const pal_cell_line *c, pal_wide *at, int step)
{
    pal_wide e0 = at[0] + at[3 * step], e1 = at[step] + at[2 * step];
    pal_wide o0 = at[0] - at[3 * step], o1 = at[step] - at[2 * step];
    for (int j = 0; j < 2; j++) {
        pal_wide e = c->even[0][j] * e0 + c->even[1][j] * e1, o = c->odd[0][j] * o0 + c->odd[1][j] * o1;
        at[j * step] = e + o, at[(3 - j) * step] = e - o;
    }
}
/* values at the points to slopes there */
PAL_INLINE void cell_slopes(const pal_cell_line *c, const pal_wide *at, pal_wide *to, int step)
{
    pal_wide bow = at[0] + at[3 * step] - (at[step] + at[2 * step]);
    pal_wide o0 = at[0] - at[3 * step], o1 = at[step] - at[2 * step];
    for (int p = 0; p < 2; p++) {
        pal_wide e = c->slope_odd[p][0] * o0 + c->slope_odd[p][1] * o1, o = c->bow[p] * bow;
        to[p * step] = e + o, to[(3 - p) * step] = e - o;
    }
}
/* the transposed of it, added to `to` or (fresh) put there */
PAL_INLINE void cell_slopes_back(const pal_cell_line *c, const pal_wide *at, pal_wide *to, int step, bool fresh)
{
    pal_wide e0 = at[0] + at[3 * step], e1 = at[step] + at[2 * step];
    pal_wide o0 = at[0] - at[3 * step], o1 = at[step] - at[2 * step];
    pal_wide bow = c->bow[0] * o0 + c->bow[1] * o1;
    for (int q = 0; q < 2; q++) {
        pal_wide odd = c->slope_odd[0][q] * e0 + c->slope_odd[1][q] * e1, even = q == 0 ? bow : -bow;
        to[q * step] = (even + odd) + (fresh ? (pal_wide){0} : to[q * step]);
        to[(3 - q) * step] = (even - odd) + (fresh ? (pal_wide){0} : to[(3 - q) * step]);
    }
}

/* gradients g [3][3] (component, direction) at one point to what their energy's derivatives are; adds the energy */
PAL_INLINE void cell_point_stress(const float *scale, const float *stiff, pal_wide g[3][3], pal_wide *energy)
{
    pal_wide a[9], h[9], s[6];
    for (int i = 0; i < 9; i++) a[i] = cell_load_float(scale + i * PAL_LANES);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++) h[3 * i + c] = g[i][0] * a[c] + g[i][1] * a[3 + c] + g[i][2] * a[6 + c];
    pal_wide mu = cell_load_float(stiff), lambda = cell_load_float(stiff + PAL_LANES), two = mu + mu;
    pal_wide trace = h[0] + h[4] + h[8], pressure = lambda * trace;
    pal_wide yz = h[5] + h[7], zx = h[2] + h[6], xy = h[1] + h[3];
    s[0] = two * h[0] + pressure, s[1] = two * h[4] + pressure, s[2] = two * h[8] + pressure;
    s[3] = mu * yz, s[4] = mu * zx, s[5] = mu * xy;
    if (energy) *energy += 0.5 * (s[0] * h[0] + s[1] * h[4] + s[2] * h[8] + (s[3] * yz + s[4] * zx + s[5] * xy));
    for (int b = 0; b < 3; b++) {
        const pal_wide *row = a + 3 * b;
        g[0][b] = s[0] * row[0] + s[5] * row[1] + s[4] * row[2];
        g[1][b] = s[5] * row[0] + s[1] * row[1] + s[3] * row[2];
        g[2][b] = s[4] * row[0] + s[3] * row[1] + s[2] * row[2];
    }
}

/* u := K u; scale, stiff at the block's first point and lane */
PAL_INLINE void cell_cubic_stiffness(const pal_cell_line *c, const float *scale, const float *stiff,
                                     pal_wide (*u)[PAL_CELL_MAX_NODES], pal_wide *energy)
{
    pal_wide du[3][64], dv[3][16], dw[3][16];
    for (int i = 0; i < 3; i++) {
        for (int n = 0; n < 16; n++) cell_values(c, u[i] + 4 * n, 1);
        for (int n = 0; n < 16; n++) cell_values(c, u[i] + 16 * (n / 4) + n % 4, 4);
        for (int n = 0; n < 16; n++) cell_values(c, u[i] + n, 16);
        for (int n = 0; n < 16; n++) cell_slopes(c, u[i] + n, du[i] + n, 16);
    }
    for (int a = 0; a < 4; a++) {
        for (int i = 0; i < 3; i++)
            for (int n = 0; n < 4; n++) {
                cell_slopes(c, u[i] + 16 * a + n, dv[i] + n, 4);
                cell_slopes(c, u[i] + 16 * a + 4 * n, dw[i] + 4 * n, 1);
            }
        for (int n = 0; n < 16; n++) {
            const size_t p = (size_t)(16 * a + n);
            pal_wide g[3][3];
            for (int i = 0; i < 3; i++) g[i][0] = du[i][p], g[i][1] = dv[i][n], g[i][2] = dw[i][n];
            cell_point_stress(scale + p * 9 * PAL_LANES, stiff + p * 2 * PAL_LANES, g, energy);
            for (int i = 0; i < 3; i++) du[i][p] = g[i][0], dv[i][n] = g[i][1], dw[i][n] = g[i][2];
        }
        for (int i = 0; i < 3; i++) {
            for (int n = 0; n < 4; n++) cell_slopes_back(c, dv[i] + n, u[i] + 16 * a + n, 4, true);
            for (int n = 0; n < 4; n++) cell_slopes_back(c, dw[i] + 4 * n, u[i] + 16 * a + 4 * n, 1, false);
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int n = 0; n < 16; n++) cell_slopes_back(c, du[i] + n, u[i] + n, 16, false);
        for (int n = 0; n < 16; n++) cell_collect(c, u[i] + n, 16);
        for (int n = 0; n < 16; n++) cell_collect(c, u[i] + 16 * (n / 4) + n % 4, 4);
        for (int n = 0; n < 16; n++) cell_collect(c, u[i] + 4 * n, 1);
    }
}

/* ---- K of the others ---- */

/* u := K u, u of node 0 being 0; k at the block's lane */
PAL_INLINE void cell_stored_stiffness(const float *k, int n_node, pal_wide (*u)[PAL_CELL_MAX_NODES], pal_wide *energy)
{
    const pal_wide zero = {0};
    pal_wide f[3][8];
    for (int m = 0; m < n_node; m++) f[0][m] = f[1][m] = f[2][m] = zero;
    for (int a = 1; a < n_node; a++) {
        pal_wide ua[3] = {u[0][a], u[1][a], u[2][a]};
        for (int b = 1; b <= a; b++, k += 9 * PAL_LANES) {
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    pal_wide kij = cell_load_float(k + (3 * i + j) * PAL_LANES);
                    f[i][a] += kij * u[j][b];
                    if (b < a) f[j][b] += kij * ua[i];
                }
        }
    }
    for (int m = 1; m < n_node; m++)
        for (int i = 0; i < 3; i++) {
            if (energy) *energy += 0.5 * (u[i][m] * f[i][m]);
            f[i][0] -= f[i][m];
        }
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) u[i][m] = f[i][m];
}

/* u := K u of half a block from lane l on */
PAL_INLINE void cell_stiffness(const pal_cell_line *line, const pal_cell_group *group, int block, int lane, int n_node,
                               pal_wide (*u)[PAL_CELL_MAX_NODES], pal_wide *energy)
{
    const size_t b = (size_t)block * PAL_LANES, l = (size_t)lane;
    if (n_node == PAL_CUBIC_NODES)
        cell_cubic_stiffness(line, group->scale + b * 64 * 9 + l, group->stiff + b * 64 * 2 + l, u, energy);
    else
        cell_stored_stiffness(group->k + b * 9 * (size_t)pal_cell_pairs(n_node) + l, n_node, u, energy);
}

/* u = d^ of operator PAL_CELL_EDGES in half a block (cell_operator.c): y nodes now, from one of them, overwritten */
void pal_cell_edges_displaced(const double *rest, int n_node, const pal_wide r[9], pal_wide (*y)[PAL_CELL_MAX_NODES],
                              pal_wide (*u)[PAL_CELL_MAX_NODES]);

/* elements of a block that are there, from lane on */
PAL_INLINE int cell_live(const pal_cell_group *group, int block, int lane)
{
    int n = group->n - block * PAL_LANES - lane;
    return n < 0 ? 0 : n < PAL_WIDE ? n : PAL_WIDE;
}
/* all of half a block are in regions */
PAL_INLINE bool cell_recovering(const pal_cells_elastic *c, const pal_cell_group *group, int block, int lane,
                                int n_live)
{
    double here = 0;
    if (c->n_off == 0) return false;
    for (int l = 0; l < n_live; l++) here += group->here[block * PAL_LANES + lane + l];
    return here == 0;
}
PAL_INLINE double cell_sum(pal_wide a, int n_live)
{
    double sum = 0;
    for (int l = 0; l < n_live; l++) sum += a[l];
    return sum;
}
#endif
