/* What recovery (recovery/recovery.h) asks of voxel hexahedra: the ratio of volume of a cube is the determinant of the
 * three edges at each of its corners over h^3. */
#include "server/sim/elements/elastic_hex_simd.h"

/* smallest and largest determinant of the three edges at a corner */
PAL_INLINE void range_of_corners(const pal_block_view *v, int l, pal_wide *low, pal_wide *high)
{
    pal_wide x[8][3], min = pal_wide_of(INFINITY), max = pal_wide_of(-INFINITY);
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 3; d++) x[c][d] = pal_wide_load(v->x[c][d] + l);
    for (int c = 0; c < 8; c++) {
        pal_wide a[3], b[3], e[3];
        for (int d = 0; d < 3; d++) {
            a[d] = x[c | 1][d] - x[c & 6][d];
            b[d] = x[c | 2][d] - x[c & 5][d];
            e[d] = x[c | 4][d] - x[c & 3][d];
        }
        pal_wide det = a[0] * (b[1] * e[2] - b[2] * e[1]) + a[1] * (b[2] * e[0] - b[0] * e[2]) +
                       a[2] * (b[0] * e[1] - b[1] * e[0]);
        min = pal_wide_select(det < min, det, min);
        max = pal_wide_select(det > max, det, max);
    }
    *low = min, *high = max;
}

/* the determinant of the mean edges, that of F at the centre times h^3 */
PAL_INLINE pal_wide det_of_middle(const pal_block_view *v, int l)
{
    pal_wide u[3][8], f[9];
    hex_modes(v, l, u);
    for (int i = 0; i < 9; i++) f[i] = 0.25 * u[i / 3][1 << i % 3];
    return pal_wide_det(f);
}

/* the ratios of all cubes: the least and the largest, and each to low, high [n_hex] and `middle` unless they are NULL
 */
static void find_ratios(const pal_elastic_hexes *cubes, const pal_body *body, double out[2], float *low, float *high,
                        float *middle)
{
    const double inverse = 1 / (cubes->edge_m * cubes->edge_m * cubes->edge_m);
    pal_wide min = pal_wide_of(INFINITY), max = pal_wide_of(-INFINITY);
    pal_node_order_load(body->node_order, body->d);
    for (int b = 0; b < cubes->n_block; b++) {
        pal_block_view v;
        pal_block_open(&cubes->simd_blocks, body->node_order, b, 8, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide small, large;
            range_of_corners(&v, l, &small, &large);
            pal_wide_mask live = pal_wide_load(cubes->share + PAL_LANES * b + l) > 0;
            min = pal_wide_select(live & (small < min), small, min);
            max = pal_wide_select(live & (large > max), large, max);
            if (!low) continue;
            const pal_wide centre = det_of_middle(&v, l);
            for (int i = 0; i < PAL_WIDE; i++) {
                const int e = cubes->hex[PAL_LANES * b + l + i];
                if (e < 0) continue;
                low[e] = (float)(inverse * small[i]), high[e] = (float)(inverse * large[i]);
                middle[e] = (float)(inverse * centre[i]);
            }
        }
    }
    out[0] = INFINITY, out[1] = -INFINITY;
    for (int l = 0; l < PAL_WIDE; l++) out[0] = fmin(out[0], inverse * min[l]), out[1] = fmax(out[1], inverse * max[l]);
}

double pal_hex_min_corner(const pal_elastic_hexes *cubes, const pal_body *body)
{
    double ratio[2];
    find_ratios(cubes, body, ratio, NULL, NULL, NULL);
    return ratio[0];
}

static void range(void *self, const pal_body *body, double out[2])
{
    find_ratios(self, body, out, NULL, NULL, NULL);
}

static void ratios(void *self, const pal_body *body, float *low, float *high, float *middle)
{
    double all[2];
    find_ratios(self, body, all, low, high, middle);
}

static int edges(const void *self, int e, int32_t out[][2])
{
    const int32_t *node = ((const pal_elastic_hexes *)self)->hexes->node + 8 * (size_t)e;
    int n = 0;
    for (int c = 0; c < 8; c++)
        for (int axis = 1; axis < 8; axis *= 2)
            if (!(c & axis)) out[n][0] = node[c], out[n++][1] = node[c | axis];
    return n;
}

/* mu here is that of the material times share and h / 16, and mu V = 16 h^2 of it; so is lambda */
static double stiffness(const void *self, int e)
{
    const pal_elastic_hexes *cubes = self;
    const int lane = cubes->simd_blocks.place[e];
    return pal_recovery_stiffness_N_m(16 * cubes->whole[0][lane], 16 * cubes->whole[1][lane], 12, 1);
}

static void act(void *self, const uint8_t *on)
{
    pal_elastic_hexes *cubes = self;
    for (int e = 0; e < cubes->n_hex; e++) {
        const int lane = cubes->simd_blocks.place[e];
        cubes->mu[lane] = on[e] ? cubes->whole[0][lane] : 0;
        cubes->lambda[lane] = on[e] ? cubes->whole[1][lane] : 0;
    }
    pal_force_cache_invalidate(&cubes->force_cache);
}

static double energy(void *self, const pal_body *body)
{
    pal_elastic_hexes *cubes = self;
    pal_node_order_load(body->node_order, body->d);
    return (cubes->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_run : pal_hex_corot_run)(cubes, body->node_order,
                                                                                     PAL_RUN_ENERGY);
}

pal_err pal_hex_recovery_make(pal_elastic_hexes *cubes, pal_build *build)
{
    const pal_recovery_model model = {.self = cubes,
                                      .n_element = cubes->n_hex,
                                      .edges = edges,
                                      .stiffness_N_m = stiffness,
                                      .range = range,
                                      .ratios = ratios,
                                      .act = act,
                                      .energy = energy};
    const size_t n = (size_t)cubes->n_block * PAL_LANES;
    if (!PAL_NEW_DOUBLES(build->arena, n, &cubes->whole[0], &cubes->whole[1])) return PAL_ERR_MEMORY;
    return pal_recovery_make(&model, build->body->n_node, build->body->node_rest, build->arena, &cubes->recovery);
}
