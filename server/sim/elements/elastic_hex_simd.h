/* Vector kernels of the voxel hexahedra, inlined into elastic_hex_*.c; include nowhere else. Thread: [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_SIMD_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_SIMD_H
#include "server/num/polar.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/simd_wide.h"
#include "server/sim/elements/elastic_hex.h"

#include <math.h>
#include <string.h>

#define HEX_VECTOR pal_wide
#define HEX_REAL   double
#include "server/sim/elements/elastic_hex_modes.h"

/* modes 1..7 of the corners' coordinates */
PAL_INLINE void hex_modes(const pal_block_view *v, int l, pal_wide u[3][8])
{
    for (int d = 0; d < 3; d++) {
        for (int c = 0; c < 8; c++) u[d][c] = pal_wide_load(v->x[c][d] + l);
        walsh(u[d]);
    }
}
PAL_INLINE void hex_add(pal_block_view *v, int l, pal_wide u[3][8])
{
    for (int d = 0; d < 3; d++) {
        unwalsh(u[d]);
        for (int c = 0; c < 8; c++) pal_wide_add(v->f[c][d] + l, u[d][c]);
    }
}

/* F at the centre from the modes, the rotations from it, cached in cubes->q */
PAL_INLINE void hex_turn_block(pal_elastic_hexes *cubes, int block, int l, pal_wide u[3][8], pal_wide r[9])
{
    const double scale = 1 / (4 * cubes->edge_m);
    pal_wide_mask live = pal_wide_load(cubes->share + PAL_LANES * block + l) > 0;
    pal_wide f[9], m[9];
    /* lanes without an element may read numbers that are not finite */
    for (int i = 0; i < 9; i++) f[i] = pal_wide_select(live, scale * u[i / 3][1 << i % 3], pal_wide_of(i % 4 == 0));
    pal_wide_take_rotation(cubes->q + 4 * PAL_LANES * block + l, live, f, r, m);
}
#endif
