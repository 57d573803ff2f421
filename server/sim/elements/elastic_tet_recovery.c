/* What recovery (recovery/recovery.h) asks of tetrahedra: the ratio of volume is det F at the Gauss points and the
 * centre. Slivers invert at any contact and say nothing about the body: they are never inverted. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape_functions.h"
#include "server/sim/elements/elastic_tet.h"

#include <math.h>
#include <string.h>

static bool is_sliver(const pal_elastic_tets *t, int e)
{
    const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
    return !(fabs(pal_tet_volume(t->x_rest, node)) > PAL_TET_SLIVER * t->edge_m * t->edge_m * t->edge_m);
}

/* of one element: those at its points, and of ten nodes of its eight parts, which may fold between the points */
static void element_ratios(const pal_elastic_tets *t, int e, const double *d, float out[3])
{
    static const int part[8][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3},
                                   {6, 8, 4, 5}, {6, 8, 5, 9}, {6, 8, 9, 7}, {6, 8, 7, 4}};
    const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
    double f[9], ratio;
    pal_elastic_tets_gradient(t, e, PAL_TET_CENTRE, d, f);
    out[0] = out[1] = out[2] = (float)pal_det3(f);
    for (int p = 0; p < 12 && t->n_point > 1; p++) {
        if (p < 4) {
            pal_elastic_tets_gradient(t, e, p, d, f);
            ratio = pal_det3(f);
        } else {
            int32_t c[4];
            for (int i = 0; i < 4; i++) c[i] = node[part[p - 4][i]];
            ratio = pal_tet_volume(d, c) / pal_tet_volume(t->x_rest, c);
        }
        out[0] = fminf(out[0], (float)ratio), out[1] = fmaxf(out[1], (float)ratio);
    }
    /* a folded element of ten nodes has a poor tangent, wherever it is folded */
    out[2] = out[0];
}

static void ratios(void *self, const pal_body *body, float *low, float *high, float *middle)
{
    const pal_elastic_tets *t = self;
    for (int e = 0; e < t->options.n_tet; e++) {
        float of[3] = {1, 1, 1};
        if (!is_sliver(t, e)) element_ratios(t, e, body->d, of);
        low[e] = of[0], high[e] = of[1], middle[e] = of[2];
    }
}

/* with four nodes the kernels count inverted elements on the way: no pass where they have just seen these positions */
static void range(void *self, const pal_body *body, double out[2])
{
    pal_elastic_tets *t = self;
    out[0] = out[1] = 1;
    for (int e = 0; e < t->options.n_tet && t->n_point > 1; e++) {
        float of[3];
        if (is_sliver(t, e)) continue;
        element_ratios(t, e, body->d, of);
        out[0] = fmin(out[0], (double)of[0]), out[1] = fmax(out[1], (double)of[1]);
    }
    if (t->n_point > 1) return;
    if (!t->counted || !pal_force_cache_matches(t->counted, body->d)) pal_elastic_tets_count(t, body->d);
    if (t->n_inverted > 0) out[0] = -1;
}

/* of ten nodes: the halves of the edges, and the edges between middles in the four faces */
static int edges(const void *self, int e, int32_t out[][2])
{
    const pal_elastic_tets *t = self;
    const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
    int n = 0;
    for (int a = 0; a < 4 && t->options.n_corner == 4; a++)
        for (int b = 0; b < a; b++) out[n][0] = node[a], out[n++][1] = node[b];
    for (int m = 0; m < 6 && t->options.n_corner == 10; m++) {
        const int *edge = pal_tet10_edge[m];
        for (int c = 0; c < 2; c++) out[n][0] = node[4 + m], out[n++][1] = node[edge[c]];
        for (int k = 0; k < m; k++) {
            const int *other = pal_tet10_edge[k];
            const bool meet = edge[0] == other[0] || edge[0] == other[1] || edge[1] == other[0] || edge[1] == other[1];
            if (meet) out[n][0] = node[4 + m], out[n++][1] = node[4 + k];
        }
    }
    return n;
}

static double stiffness(const void *self, int e)
{
    const pal_elastic_tets *t = self;
    int32_t pair[PAL_RECOVERY_EDGES_MAX][2];
    const int n = edges(t, e, pair);
    double mu, lambda, square = 0;
    pal_tet_whole_stiffness(t, e, &mu, &lambda);
    for (int i = 0; i < n; i++)
        square += pow(pal_dist3(t->x_rest + 3 * (size_t)pair[i][0], t->x_rest + 3 * (size_t)pair[i][1]), 2) / n;
    return mu > 0 ? pal_recovery_stiffness_N_m(mu, lambda, n, square) : 0;
}

static void act(void *self, const uint8_t *on)
{
    pal_elastic_tets *t = self;
    for (int e = 0; e < t->options.n_tet; e++)
        for (int k = 0; k < 2; k++)
            *pal_lane(t->stiff, 2, t->place[e], k) = on[e] ? *pal_lane(t->whole, 2, t->place[e], k) : 0;
    if (t->counted) pal_force_cache_invalidate(t->counted);
}

static double energy(void *self, const pal_body *body)
{
    return pal_elastic_tets_energy(self, body->d, NULL);
}

pal_err pal_tet_recovery_make(pal_elastic_tets *t, pal_build *build)
{
    const pal_recovery_model model = {.self = t,
                                      .n_element = t->options.n_tet,
                                      .edges = edges,
                                      .stiffness_N_m = stiffness,
                                      .range = range,
                                      .ratios = ratios,
                                      .act = act,
                                      .energy = energy};
    t->whole = PAL_NEW(build->arena, double, 2 * PAL_LANES * (size_t)t->n_block);
    if (!t->whole) return PAL_ERR_MEMORY;
    memcpy(t->whole, t->stiff, 2 * PAL_LANES * sizeof *t->whole * (size_t)t->n_block);
    return pal_recovery_make(&model, t->n_node, t->x_rest, build->arena, &t->recovery);
}
