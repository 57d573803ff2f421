/* Blocks of 8 tetrahedra for the kernels of elastic_tet.h: coordinates in, forces out, gradients in local coordinates.
 * Only for files compiled with the room's options. Thread: [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_TET_BLOCK_H
#define PAL_SIM_ELEMENTS_ELASTIC_TET_BLOCK_H
#include "server/num/shape_functions.h"
#include "server/sim/core/simd_wide.h"
#include "server/sim/elements/elastic_tet.h"

#include <string.h>

/* tet4: from slots; tet10: from nodes x [n_node][3], where lanes without an element repeat the first one's nodes */
PAL_INLINE void pal_tet_open(const pal_elastic_tets *t, int n_corner, int b, const double *x, pal_block_view *to)
{
    if (n_corner == 4) {
        pal_block_open(&t->simd_blocks, t->node_order, b, 4, to);
        return;
    }
    for (int l = 0; l < PAL_LANES; l++) {
        int e = t->owner[PAL_LANES * b + l];
        const int32_t *node = t->corner + (size_t)PAL_TET10_CORNERS * (size_t)(e < 0 ? PAL_LANES * b : e);
        for (int c = 0; c < PAL_TET10_CORNERS; c++)
            for (int d = 0; d < 3; d++) to->x_loose[c][d][l] = x[3 * node[c] + d];
    }
    memset(to->f_loose, 0, sizeof to->f_loose);
    for (int c = 0; c < PAL_TET10_CORNERS; c++)
        for (int d = 0; d < 3; d++) to->x[c][d] = to->x_loose[c][d], to->f[c][d] = to->f_loose[c][d];
}
PAL_INLINE void pal_tet_close(const pal_elastic_tets *t, int n_corner, int b, const pal_block_view *from, double *f)
{
    if (n_corner == 4) pal_block_close(&t->simd_blocks, t->node_order, b, 4, from);
    for (int l = 0; l < PAL_LANES && n_corner != 4; l++) {
        int e = t->owner[PAL_LANES * b + l];
        const int32_t *node = t->corner + (size_t)PAL_TET10_CORNERS * (size_t)e;
        for (int c = 0; c < PAL_TET10_CORNERS && e >= 0; c++)
            for (int d = 0; d < 3; d++) f[3 * node[c] + d] += from->f_loose[c][d][l];
    }
}

/* h = sum of x_a (dN_a/dl)' at a point */
PAL_INLINE void pal_tet_local_gradient(const pal_elastic_tets *t, int n_corner, int point, const pal_block_view *at,
                                       int lane, pal_wide h[9])
{
    for (int d = 0; d < 3; d++) {
        if (n_corner == 4) {
            pal_wide x = pal_wide_load(at->x[0][d] + lane);
            for (int c = 0; c < 3; c++) h[3 * d + c] = pal_wide_load(at->x[c + 1][d] + lane) - x;
            continue;
        }
        const pal_wide zero = {0};
        h[3 * d] = h[3 * d + 1] = h[3 * d + 2] = zero;
        for (int a = 0; a < n_corner; a++) {
            pal_wide x = pal_wide_load(at->x[a][d] + lane);
            for (int c = 0; c < 3; c++) h[3 * d + c] += x * t->shape[point][a][c];
        }
    }
}

/* force of -s, s = stress times volume times dl/dX [3][3], on the corners */
PAL_INLINE void pal_tet_add_force(const pal_elastic_tets *t, int n_corner, int point, pal_block_view *at, int lane,
                                  const pal_wide s[9])
{
    for (int d = 0; d < 3; d++) {
        if (n_corner == 4) {
            for (int c = 0; c < 3; c++) pal_wide_add(at->f[c + 1][d] + lane, -s[3 * d + c]);
            pal_wide_add(at->f[0][d] + lane, s[3 * d] + s[3 * d + 1] + s[3 * d + 2]);
            continue;
        }
        for (int a = 0; a < n_corner; a++) {
            const double *g = t->shape[point][a];
            pal_wide_add(at->f[a][d] + lane, -(s[3 * d] * g[0] + s[3 * d + 1] * g[1] + s[3 * d + 2] * g[2]));
        }
    }
}

/* constants of half a block: dl/dX, mu and lambda at a Gauss point */
PAL_INLINE void pal_tet_constants(const pal_elastic_tets *t, int b, int lane, double share, pal_wide inverse[9],
                                  pal_wide stiff[2])
{
    pal_wide_load_n(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
    pal_wide_load_n(t->stiff + (size_t)b * 2 * PAL_LANES + lane, 2, stiff);
    stiff[0] *= share, stiff[1] *= share;
}

/* neo_hookean: the tangent at d. [sim] */
void pal_elastic_tets_modes(pal_elastic_tets *t, const double *d);
#endif
