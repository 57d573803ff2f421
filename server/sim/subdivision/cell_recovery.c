/* What recovery (recovery/recovery.h) asks of elements of a subdivision solid. An element's edges are those of its
 * cell: of a cubic one, between the control points of its own corners. The ratio of volume is that of the cell at its 2
 * x 2 x 2 Gauss points; that at the middle is det F of the element where its rotation is taken. */
#include "server/base/vec3.h"
#include "server/sim/subdivision/cell_simd.h"

#include <math.h>

/* ---- ratios of volume ---- */

/* 8 corners of the cells of half a block, in the order of num/shape_functions.h */
PAL_INLINE void cell_corners(const int32_t *node, int n_node, const double *d, pal_wide (*x)[8])
{
    static const int own[8] = {21, 37, 25, 41, 22, 38, 26, 42}, base[8] = {0, 1, 3, 2, 4, 4, 4, 4};
    for (int k = 0; k < 8; k++) {
        const int m = n_node == PAL_CUBIC_NODES ? own[k] : n_node == PAL_PYRAMID_NODES ? base[k] : k;
        for (int l = 0; l < PAL_WIDE; l++) {
            const double *at = d + 3 * (size_t)node[m * PAL_LANES + l];
            for (int i = 0; i < 3; i++) ((double *)&x[i][k])[l] = at[i];
        }
    }
}

/* det d(x, y, z)/d(u, v, w) at the 2 x 2 x 2 Gauss points: edges along each direction, mixed in the other two */
PAL_INLINE void corner_volumes(pal_wide (*x)[8], pal_wide *det)
{
    const double near = 0.5 + sqrt(1.0 / 12), far = 1 - near;
    pal_wide j[3][3][4]; /* direction, component, point in the other two */
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++) {
            const int s = 1 << a, b = 1 << (a + 1) % 3, c = 1 << (a + 2) % 3;
            pal_wide e0 = x[i][s] - x[i][0], e1 = x[i][s | b] - x[i][b], e2 = x[i][s | c] - x[i][c],
                     e3 = x[i][7] - x[i][b | c];
            pal_wide f0 = near * e0 + far * e1, f1 = far * e0 + near * e1, f2 = near * e2 + far * e3,
                     f3 = far * e2 + near * e3;
            j[a][i][0] = near * f0 + far * f2, j[a][i][1] = near * f1 + far * f3;
            j[a][i][2] = far * f0 + near * f2, j[a][i][3] = far * f1 + near * f3;
        }
    for (int p = 0; p < 8; p++) {
        const int u = p & 1, v = p >> 1 & 1, w = p >> 2;
        const int at[3] = {v + 2 * w, w + 2 * u, u + 2 * v};
        pal_wide a[3], b[3], e[3];
        for (int i = 0; i < 3; i++) a[i] = j[0][i][at[0]], b[i] = j[1][i][at[1]], e[i] = j[2][i][at[2]];
        det[p] = a[0] * (b[1] * e[2] - b[2] * e[1]) + a[1] * (b[2] * e[0] - b[0] * e[2]) +
                 a[2] * (b[0] * e[1] - b[1] * e[0]);
    }
}

/* 1 / volumes at rest; 0 at a point that is flat or inverted at rest, which is not examined */
void pal_cells_corners_make(pal_cells_elastic *c)
{
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const pal_cell_group *g = &c->group[kind];
        for (int b = 0; b < g->n_block; b++)
            for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
                pal_wide x[3][8], det[8], mean = {0};
                cell_corners(g->node + (size_t)b * (size_t)g->n_node * PAL_LANES + l, g->n_node, c->solid->node_rest,
                             x);
                corner_volumes(x, det);
                for (int p = 0; p < 8; p++) mean += 0.125 * det[p];
                for (int p = 0; p < 8; p++)
                    pal_wide_store(g->corner + ((size_t)b * 8 + (size_t)p) * PAL_LANES + l,
                                   pal_wide_select(det[p] > 0.01 * mean, 1 / det[p], 0 * mean));
            }
    }
}

/* det F in the middle of half a block */
static pal_wide det_of_middle(const pal_cell_group *g, int n_node, int block, int lane, const double *d)
{
    pal_wide y[3][PAL_CELL_MAX_NODES], f[9];
    cell_gather(g->node + (size_t)block * (size_t)n_node * PAL_LANES + lane, n_node, d, y);
    cell_middle(g, block, lane, y, n_node, f);
    return pal_wide_det(f);
}

/* of the elements of a kind: the least and the largest to out, and each to low, high and middle unless they are NULL */
PAL_INLINE void find_ratios(const pal_cells_elastic *c, pal_cell_kind kind, int n_node, const double *d, double out[2],
                            float *low, float *high, float *middle)
{
    const pal_cell_group *g = &c->group[kind];
    const pal_wide one = 1 - (pal_wide){0};
    for (int b = 0; b < g->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            const int n_live = cell_live(g, b, l);
            pal_wide x[3][8], det[8], min = one, max = one;
            if (n_live == 0) continue;
            cell_corners(g->node + (size_t)b * (size_t)n_node * PAL_LANES + l, n_node, d, x);
            corner_volumes(x, det);
            for (int p = 0; p < 8; p++) {
                pal_wide inverse = pal_wide_load(g->corner + ((size_t)b * 8 + (size_t)p) * PAL_LANES + l);
                pal_wide ratio = pal_wide_select(inverse > 0, det[p] * inverse, one);
                min = pal_wide_select(ratio < min, ratio, min), max = pal_wide_select(ratio > max, ratio, max);
            }
            for (int k = 0; k < n_live; k++) out[0] = fmin(out[0], min[k]), out[1] = fmax(out[1], max[k]);
            if (!low) continue;
            const pal_wide centre = det_of_middle(g, n_node, b, l, d);
            for (int k = 0; k < n_live; k++) {
                const int e = c->first[kind] + b * PAL_LANES + l + k;
                low[e] = (float)min[k], high[e] = (float)max[k], middle[e] = (float)centre[k];
            }
        }
}

static void find_all(const pal_cells_elastic *c, const double *d, double out[2], float *low, float *high, float *middle)
{
    out[0] = INFINITY, out[1] = -INFINITY;
    find_ratios(c, PAL_CELL_CUBIC, 64, d, out, low, high, middle);
    find_ratios(c, PAL_CELL_HEX, 8, d, out, low, high, middle);
    find_ratios(c, PAL_CELL_PYRAMID, 5, d, out, low, high, middle);
}

static void range(void *self, const pal_body *body, double out[2])
{
    find_all(self, body->d, out, NULL, NULL, NULL);
}

static void ratios(void *self, const pal_body *body, float *low, float *high, float *middle)
{
    double all[2];
    find_all(self, body->d, all, low, high, middle);
}

/* ---- elements and their edges ---- */

static pal_cell_kind kind_of(const pal_cells_elastic *c, int cell, int *element)
{
    pal_cell_kind kind = cell >= c->first[PAL_CELL_PYRAMID] ? PAL_CELL_PYRAMID
                         : cell >= c->first[PAL_CELL_HEX]   ? PAL_CELL_HEX
                                                            : PAL_CELL_CUBIC;
    *element = cell - c->first[kind];
    return kind;
}

static int edges(const void *self, int cell, int32_t out[][2])
{
    static const int own[8] = {21, 22, 25, 26, 37, 38, 41, 42}; /* of the 64 of a cubic element */
    const pal_cells_elastic *c = self;
    int e, k = 0;
    const pal_cell_kind kind = kind_of(c, cell, &e);
    const int32_t *node = pal_subdivision_solid_nodes(c->solid, kind, e);
    const int n = kind == PAL_CELL_PYRAMID ? PAL_PYRAMID_NODES : 8;
    for (int a = 0; a < n; a++)
        for (int b = a + 1; b < n; b++) {
            const int apart = a ^ b;
            const bool edge = n == 8 ? apart == 1 || apart == 2 || apart == 4 : b == 4 || b == a + 1 || b == a + 3;
            if (!edge) continue;
            out[k][0] = node[kind == PAL_CELL_CUBIC ? own[a] : a];
            out[k++][1] = node[kind == PAL_CELL_CUBIC ? own[b] : b];
        }
    return k;
}

static double stiffness(const void *self, int cell)
{
    return ((const pal_cells_elastic *)self)->k_N_m[cell];
}

void pal_cell_recovery_refresh(pal_cells_elastic *c)
{
    const pal_subdivision_solid *solid = c->solid;
    for (int cell = 0; cell < c->n_cell; cell++) {
        int e;
        int32_t edge[PAL_RECOVERY_EDGES_MAX][2];
        const pal_cell_kind kind = kind_of(c, cell, &e);
        const int n = edges(c, cell, edge);
        double mu_J = 0, lambda_J = 0, square_m2 = 0;
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
            const double volume_m3 = solid->samples[kind].volume_m3[e * PAL_CELL_GAUSS_POINTS + p];
            double mu, lambda;
            pal_cell_lame(solid, kind, e, p, &mu, &lambda);
            mu_J += mu * volume_m3, lambda_J += lambda * volume_m3;
        }
        for (int i = 0; i < n; i++) {
            double x[3];
            pal_sub3(x, solid->node_rest + 3 * (size_t)edge[i][0], solid->node_rest + 3 * (size_t)edge[i][1]);
            square_m2 += pal_dot3(x, x) / n;
        }
        c->k_N_m[cell] = pal_recovery_stiffness_N_m(mu_J, lambda_J, n, square_m2);
    }
    pal_recovery_refresh(c->recovery);
}

/* ---- elements and regions ---- */

static void act(void *self, const uint8_t *on)
{
    pal_cells_elastic *c = self;
    c->n_off = 0;
    for (int cell = 0; cell < c->n_cell; cell++) {
        int e;
        const pal_cell_kind kind = kind_of(c, cell, &e);
        c->group[kind].here[e] = on[cell], c->n_off += !on[cell];
    }
    pal_force_cache_invalidate(&c->force_cache);
}

static double energy(void *self, const pal_body *body)
{
    return pal_cells_elastic_energy(self, body->d, NULL);
}

/* elements that share the volume of a control cell; those of operator edges are all one group, since only a body of
 * nothing but regions has forces with an energy then */
static int group(const void *self, int cell)
{
    const pal_cells_elastic *c = self;
    int e;
    const pal_cell_kind kind = kind_of(c, cell, &e);
    return c->op == PAL_CELL_EDGES ? 0 : c->group[kind].home[e];
}

pal_err pal_cell_recovery_make(pal_cells_elastic *c, pal_arena *arena)
{
    const bool edged = c->op == PAL_CELL_EDGES;
    const pal_recovery_model model = {.self = c,
                                      .n_element = c->n_cell,
                                      .edges = edges,
                                      .stiffness_N_m = stiffness,
                                      .range = range,
                                      .ratios = ratios,
                                      .act = act,
                                      .energy = energy,
                                      .no_gradient = edged,
                                      .n_group = edged ? 1 : c->volume.n,
                                      .group = group};
    if (!PAL_NEW_DOUBLES(arena, (size_t)c->n_cell, &c->k_N_m)) return PAL_ERR_MEMORY;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int e = 0; e < c->group[kind].n; e++) c->group[kind].here[e] = 1;
    return pal_recovery_make(&model, c->solid->rows.n_row, c->solid->node_rest, arena, &c->recovery);
}
