/* Which bodies of voxel hexahedra run on their five-tetrahedra split (elastic_hex.h, "Recovery"). */
#include "server/sim/elements/elastic_hex_simd.h"

void pal_hex_recovery_reset(pal_elastic_hexes *cubes)
{
    cubes->has_inversion = false;
    cubes->n_whole = PAL_RETRY_UPDATES, cubes->needed = cubes->tried = PAL_RECOVERED_LOW;
}

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

/* the same over all voxels, h^3 */
static void corner_range(const pal_elastic_hexes *cubes, const pal_body *body, double *low, double *high)
{
    const double volume = cubes->edge_m * cubes->edge_m * cubes->edge_m;
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
        }
    }
    *low = INFINITY, *high = -INFINITY;
    for (int l = 0; l < PAL_WIDE; l++) *low = fmin(*low, min[l] / volume), *high = fmax(*high, max[l] / volume);
}

double pal_hex_min_corner(const pal_elastic_hexes *cubes, const pal_body *body)
{
    double low, high;
    corner_range(cubes, body, &low, &high);
    return low;
}

bool pal_hex_recover(pal_elastic_hexes *cubes, const pal_body *body)
{
    if (!cubes->split) return false;
    double low, high;
    corner_range(cubes, body, &low, &high);
    const bool before = cubes->has_inversion;
    if (before) {
        cubes->has_inversion = low < cubes->needed || high > PAL_RECOVERED_HIGH;
        if (!cubes->has_inversion) cubes->n_whole = 0, cubes->tried = low;
    } else {
        cubes->has_inversion = low < PAL_INVERTED_LOW || high > PAL_INVERTED_HIGH;
        if (cubes->n_whole < PAL_RETRY_UPDATES) cubes->n_whole++;
    }
    if (cubes->has_inversion && !before) {
        cubes->needed = cubes->n_whole < PAL_RETRY_UPDATES
                            ? fmin(fmax(cubes->needed, cubes->tried) + PAL_INVERTED_LOW, PAL_RETRY_MAX)
                            : PAL_RECOVERED_LOW;
        pal_elastic_tets_reset(cubes->split);
    }
    cubes->n_inversion += cubes->has_inversion;
    cubes->n_switch += cubes->has_inversion != before;
    return cubes->has_inversion != before;
}
