/* Elements of subdivision solids in their own frames: arrays, rest shapes and constants. */
#include "server/sim/subdivision/cell_kernel.h"

#include "server/num/polar.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/subdivision/cell_simd.h"

#include <math.h>
#include <string.h>

/* ---- tables ---- */

static void make_line(pal_cell_line *line)
{
    const double *t = pal_gauss4_at;
    double b[4][4], d[4][4];
    for (int p = 0; p < 4; p++) pal_spline(t[p], b[p], NULL);
    /* slopes at t[p] of the cubic that is 1 at t[q] and 0 at the others (Lagrange) */
    for (int p = 0; p < 4; p++)
        for (int q = 0; q < 4; q++) {
            double up = 1, down = 1;
            for (int r = 0; r < 4; r++) {
                if (r != q) down *= t[q] - t[r];
                if (r != q && r != p) up *= t[p] - t[r];
            }
            d[p][q] = up / down;
        }
    for (int p = 0; p < 4; p++) {
        d[p][p] = 0;
        for (int r = 0; r < 4; r++)
            if (r != p) d[p][p] += 1 / (t[p] - t[r]);
    }
    for (int p = 0; p < 2; p++) {
        for (int q = 0; q < 2; q++) {
            line->even[p][q] = 0.5 * (b[p][q] + b[p][3 - q]);
            line->odd[p][q] = 0.5 * (b[p][q] - b[p][3 - q]);
            line->slope_odd[p][q] = 0.5 * (d[p][q] - d[p][3 - q]);
        }
        line->bow[p] = 0.5 * (d[p][0] + d[p][3]);
    }
}

/* inverse by cofactors; returns the determinant */
static double invert3(const double a[9], double inverse[9])
{
    double cofactor[9], det = pal_det3(a);
    pal_cofactor3(a, cofactor);
    for (int i = 0; i < 9; i++) inverse[i] = cofactor[i % 3 * 3 + i / 3] / det;
    return det;
}

/* ---- arrays ---- */

static pal_err allocate(pal_cell_group *g, pal_arena *arena)
{
    const size_t n_block = (size_t)g->n_block, n_lane = n_block * PAL_LANES, n_node = (size_t)g->n_node;
    g->node = PAL_NEW(arena, int32_t, n_lane * n_node);
    g->rest = PAL_NEW(arena, double, n_lane *n_node * 3);
    g->frame = PAL_NEW(arena, double, n_lane * 9);
    g->q = PAL_NEW(arena, double, n_lane * 4);
    g->rotation = PAL_NEW(arena, double, n_lane * 9);
    g->volume = PAL_NEW(arena, double, n_lane);
    g->corner = PAL_NEW(arena, double, n_lane * 8);
    g->here = PAL_NEW(arena, double, n_lane);
    g->middle = (double(*)[3])PAL_NEW(arena, double, 3 * n_node);
    bool all = g->node && g->rest && g->frame && g->q && g->rotation && g->volume && g->middle && g->corner && g->here;
    if (g->n_node == PAL_CUBIC_NODES) {
        g->scale = PAL_NEW(arena, float, n_lane *PAL_CELL_GAUSS_POINTS * 9);
        g->stiff = PAL_NEW(arena, float, n_lane *PAL_CELL_GAUSS_POINTS * 2);
        return all && g->scale && g->stiff ? PAL_ERR_OK : PAL_ERR_MEMORY;
    }
    g->k = PAL_NEW(arena, float, n_lane * 9 * (size_t)pal_cell_pairs(g->n_node));
    return all && g->k ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* element of each lane: those behind the last repeat it */
static int element_of(const pal_cell_group *g, int block, int lane)
{
    int e = block * PAL_LANES + lane;
    return e < g->n ? e : g->n - 1;
}

/* volume of an element; scale: sqrt(dV) J^-1 at the points of a cubic one */
static double take_points(const double *x, const int32_t *node, int n_node, pal_cell_shapes *shapes, float *scale)
{
    double volume = 0;
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double J[9], inverse[9];
        double dv = shapes->weight[p] * pal_subdivision_solid_jacobian(x, node, n_node, shapes->g[p], J);
        volume += dv;
        if (!scale) continue;
        invert3(J, inverse);
        double root = sqrt(dv);
        for (int i = 0; i < 9; i++) scale[(size_t)(9 * p + i) * PAL_LANES] = (float)(root * inverse[i]);
    }
    return volume;
}

/* nodes, rest shape and frame of one lane; false: folded over in its middle */
static bool take_lane(const pal_subdivision_solid *solid, pal_cell_kind kind, pal_cell_group *g, int block, int lane)
{
    const int32_t *node = pal_subdivision_solid_nodes(solid, kind, element_of(g, block, lane));
    const double *from = solid->node_rest + 3 * (size_t)node[cell_reference(g->n_node)];
    const size_t b = (size_t)block, n_node = (size_t)g->n_node, l = (size_t)lane;
    double J[9], inverse[9];
    for (size_t m = 0; m < n_node; m++) {
        g->node[(b * n_node + m) * PAL_LANES + l] = node[m];
        for (size_t i = 0; i < 3; i++)
            g->rest[((b * n_node + m) * 3 + i) * PAL_LANES + l] = solid->node_rest[3 * (size_t)node[m] + i] - from[i];
    }
    pal_subdivision_solid_jacobian(solid->node_rest, node, g->n_node, g->middle, J);
    if (!(invert3(J, inverse) > 0)) return false;
    for (size_t i = 0; i < 9; i++) g->frame[(b * 9 + i) * PAL_LANES + l] = inverse[i];
    return true;
}

static pal_err make_group(const pal_subdivision_solid *solid, pal_cell_kind kind, pal_arena *arena, pal_cell_group *g,
                          pal_diagnostic *diag)
{
    double middle[3] = {0.5, 0.5, 0.5};
    pal_cell_shapes shapes;
    g->n_node = pal_cell_kind_nodes(kind), g->n = solid->elements.n[kind];
    g->n_block = (g->n + PAL_LANES - 1) / PAL_LANES;
    if (g->n == 0) return PAL_ERR_OK;
    PAL_TRY(allocate(g, arena));
    pal_cell_shape(g->n_node, middle, NULL, g->middle);
    pal_cell_shapes_fill(kind, &shapes);
    for (int i = 0; i < g->n_block * PAL_LANES; i++) {
        const int b = i / PAL_LANES, l = i % PAL_LANES, e = element_of(g, b, l);
        if (!take_lane(solid, kind, g, b, l))
            return PAL_REFUSE(diag, "cell %d of the subdivided solid is folded over in its middle",
                              solid->elements.cell[kind][e]);
        g->volume[i] = take_points(solid->node_rest, pal_subdivision_solid_nodes(solid, kind, e), g->n_node, &shapes,
                                   g->scale ? g->scale + (size_t)b * 64 * 9 * PAL_LANES + l : NULL);
    }
    return PAL_ERR_OK;
}

/* ---- constants ---- */

/* Lame constants of the lanes of half a block at a point; of what is not shared with the control cell (cell_volume.c)
 */
static void lame_lanes(const pal_subdivision_solid *solid, pal_cell_kind kind, const pal_cell_group *g, bool shared,
                       int block, int lane, int point, pal_wide *mu, pal_wide *lambda)
{
    for (int l = 0; l < PAL_WIDE; l++) {
        double m, la;
        pal_cell_lame(solid, kind, element_of(g, block, lane + l), point, &m, &la);
        (*mu)[l] = m, (*lambda)[l] = shared ? pal_cell_own_lambda(m, la) : la;
    }
}

static void fill_cubic(const pal_subdivision_solid *solid, bool shared, pal_cell_group *g)
{
    for (int b = 0; b < g->n_block; b++)
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++)
            for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
                float *to = g->stiff + ((size_t)b * PAL_CELL_GAUSS_POINTS + (size_t)p) * 2 * PAL_LANES + l;
                pal_wide mu, lambda;
                lame_lanes(solid, PAL_CELL_CUBIC, g, shared, b, l, p, &mu, &lambda);
                cell_store_float(to, mu), cell_store_float(to + PAL_LANES, lambda);
            }
}

/* gradients by x of nodes 1.. at a point and its volume */
static inline pal_wide rest_gradients(const double *rest, int n_node, double (*dn)[3], double weight, pal_wide g[8][3])
{
    pal_wide J[9], c[9];
    for (int i = 0; i < 9; i++) J[i] = (pal_wide){0};
    for (int m = 1; m < n_node; m++)
        for (int i = 0; i < 3; i++) {
            pal_wide x = pal_wide_load(rest + (3 * m + i) * PAL_LANES);
            for (int j = 0; j < 3; j++) J[3 * i + j] += x * dn[m][j];
        }
    pal_wide det = pal_wide_cofactors(J, c); /* J^-T = c / det */
    for (int m = 1; m < n_node; m++)
        for (int i = 0; i < 3; i++)
            g[m][i] = (c[3 * i] * dn[m][0] + c[3 * i + 1] * dn[m][1] + c[3 * i + 2] * dn[m][2]) / det;
    return weight * det;
}

/* K_ab = int mu (g_b g_a' + g_a.g_b I - 2/3 g_a g_b') dV + k_a k_b' / int kappa dV, k_a = int kappa g_a dV, kappa =
 * lambda + 2/3 mu, of half a block: the mean dilatation (B-bar; Hughes 1980), which locks less as nu goes to 1/2. Not
 * `mean`: K of paper A section 3.2, int B' C B dV */
static void fill_half(const pal_subdivision_solid *solid, pal_cell_kind kind, pal_cell_group *group,
                      pal_cell_shapes *shapes, bool mean, bool shared, int block, int lane)
{
    const int n_node = group->n_node, n_pair = pal_cell_pairs(n_node);
    const double *rest = group->rest + (size_t)block * (size_t)n_node * 3 * PAL_LANES + lane;
    float *to = group->k + (size_t)block * 9 * (size_t)n_pair * PAL_LANES + lane;
    pal_wide k[28][9], g[8][3], swell[8][3], mu, lambda, all = {0};
    for (int i = 0; i < 9 * n_pair; i++) k[i / 9][i % 9] = (pal_wide){0};
    for (int i = 0; i < 3 * n_node; i++) swell[i / 3][i % 3] = (pal_wide){0};
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        pal_wide volume = rest_gradients(rest, n_node, shapes->g[p], shapes->weight[p], g);
        lame_lanes(solid, kind, group, shared, block, lane, p, &mu, &lambda);
        mu *= volume;
        pal_wide kappa = lambda * volume + mu * (2.0 / 3), outer = mean ? mu * (-2.0 / 3) : lambda * volume;
        all += kappa;
        for (int a = 1, pair = 0; a < n_node; a++) {
            pal_wide m[3], la[3];
            for (int i = 0; i < 3; i++) m[i] = mu * g[a][i], la[i] = outer * g[a][i], swell[a][i] += kappa * g[a][i];
            for (int b = 1; b <= a; b++, pair++) {
                pal_wide dot = m[0] * g[b][0] + m[1] * g[b][1] + m[2] * g[b][2];
                for (int i = 0; i < 3; i++)
                    for (int j = 0; j < 3; j++) k[pair][3 * i + j] += la[i] * g[b][j] + g[b][i] * m[j];
                for (int i = 0; i < 3; i++) k[pair][4 * i] += dot;
            }
        }
    }
    for (int a = 1, pair = 0; a < n_node && mean; a++)
        for (int b = 1; b <= a; b++, pair++)
            for (int i = 0; i < 9; i++) k[pair][i] += swell[a][i / 3] * swell[b][i % 3] / all;
    for (int a = 1, pair = 0; a < n_node; pair += a++) /* the same bits on both sides of the diagonal */
        k[pair + a - 1][3] = k[pair + a - 1][1], k[pair + a - 1][6] = k[pair + a - 1][2],
                     k[pair + a - 1][7] = k[pair + a - 1][5];
    for (int i = 0; i < 9 * n_pair; i++) cell_store_float(to + (size_t)i * PAL_LANES, k[i / 9][i % 9]);
}

static void fill_stored(const pal_subdivision_solid *solid, pal_cell_kind kind, pal_cell_group *group, bool mean,
                        bool shared)
{
    pal_cell_shapes shapes;
    pal_cell_shapes_fill(kind, &shapes);
    for (int b = 0; b < group->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) fill_half(solid, kind, group, &shapes, mean, shared, b, l);
}

void pal_cells_elastic_refresh(pal_cells_elastic *c)
{
    if (c->sampled == c->solid->sampled) return;
    c->sampled = c->solid->sampled;
    pal_force_cache_invalidate(&c->force_cache);
    const bool shared = c->volume.n > 0, mean = c->op == PAL_CELL_POLAR;
    fill_cubic(c->solid, shared, &c->group[PAL_CELL_CUBIC]);
    fill_stored(c->solid, PAL_CELL_HEX, &c->group[PAL_CELL_HEX], mean, shared);
    fill_stored(c->solid, PAL_CELL_PYRAMID, &c->group[PAL_CELL_PYRAMID], mean, shared);
    pal_cell_volume_refresh(c);
    pal_cell_recovery_refresh(c);
}

void pal_cells_elastic_reset(pal_cells_elastic *c)
{
    pal_force_cache_invalidate(&c->force_cache);
    pal_recovery_reset(c->recovery);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const pal_cell_group *g = &c->group[kind];
        for (int i = 0; i < 4 * PAL_LANES * g->n_block; i++) g->q[i] = i / PAL_LANES % 4 == 0;
        for (int i = 0; i < 9 * PAL_LANES * g->n_block; i++) g->rotation[i] = i / PAL_LANES % 9 % 4 == 0;
    }
}

pal_err pal_cells_elastic_make(const pal_subdivision_solid *solid, pal_cell_operator op, pal_arena *arena,
                               pal_cells_elastic *out, pal_diagnostic *diag)
{
    memset(out, 0, sizeof *out);
    out->solid = solid, out->op = op;
    make_line(&out->line);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        PAL_TRY(make_group(solid, kind, arena, &out->group[kind], diag));
        out->first[kind] = out->n_cell, out->n_cell += out->group[kind].n;
    }
    pal_cells_corners_make(out);
    PAL_TRY(pal_cell_volume_make(out, arena));
    PAL_TRY(pal_cell_recovery_make(out, arena));
    pal_cells_elastic_reset(out);
    pal_cells_elastic_refresh(out);
    return PAL_ERR_OK;
}
