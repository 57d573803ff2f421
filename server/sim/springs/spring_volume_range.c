/* The pass over the volumes of a body of springs in which inversion is detected. */
#include "server/sim/springs/spring_set.h"

void pal_spring_volume_range(const pal_spring_set *set, pal_node_order *node_order, const double *d, double out[2])
{
    const pal_wide one = pal_wide_of(1);
    const pal_simd_blocks *blocks = &set->simd_blocks;
    pal_wide min = one, max = one;
    pal_node_order_load(node_order, d);
    for (int lane = 0; lane < blocks->n_lane; lane += PAL_WIDE) {
        double loose[PAL_CORNERS][3][PAL_LANES];
        const double *p[PAL_CORNERS][3];
        (void)pal_block_points(blocks, node_order, lane / PAL_LANES, 4, loose, p);
        pal_spring_shift(p, 4, lane % PAL_LANES);
        pal_wide e[3][3], w = pal_wide_load(set->w + lane);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) e[c][k] = pal_wide_load(p[c + 1][k]) - pal_wide_load(p[0][k]);
        pal_wide v =
            w * (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
                 e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]));
        v = pal_wide_select(w * w > 0, v, one);
        min = pal_wide_select(v < min, v, min), max = pal_wide_select(v > max, v, max);
    }
    for (int l = 1; l < PAL_WIDE; l++) {
        min[0] = min[l] < min[0] ? min[l] : min[0];
        max[0] = max[l] > max[0] ? max[l] : max[0];
    }
    out[0] = min[0], out[1] = max[0];
}
