/* Blocks of 8 tetrahedra for the kernels of elastic_tet.h: coordinates in, forces out, gradients in local coordinates.
 * Only for files compiled with the room's options. Thread: [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_TET_BLOCK_H
#define PAL_SIM_ELEMENTS_ELASTIC_TET_BLOCK_H
#include "server/num/shape_functions.h"
#include "server/sim/core/simd_wide.h"
#include "server/sim/elements/elastic_tet.h"

#include <string.h>

enum { PAL_TET_ROTATION_STEPS = 8 }; /* Newton steps for a rotation before pal_polar_rotation */

/* 8 elements: pointers to the coordinates of their corners and to their forces */
typedef struct pal_tet_block {
    const double *x[PAL_TET10_CORNERS][3];
    double *f[PAL_TET10_CORNERS][3];
    double x_loose[PAL_TET10_CORNERS][3][PAL_LANES], f_loose[PAL_TET10_CORNERS][3][PAL_LANES];
} pal_tet_block;

/* tet4: from slots, strips in place, loose blocks gathered */
PAL_INLINE void pal_tet_load_block(const pal_elastic_tets *t, int b, pal_tet_block *to)
{
    const pal_node_order *s = t->node_order;
    bool strip = b < t->simd_blocks.n_strip;
    const int32_t *node = t->simd_blocks.node + (size_t)(b - t->simd_blocks.n_strip) * 4 * PAL_LANES;
    for (int c = 0; c < 4; c++)
        for (int d = 0; d < 3; d++) {
            const double *x = s->x + (size_t)d * (size_t)s->n_slot;
            if (strip) {
                to->x[c][d] = x + t->simd_blocks.base[4 * b + c];
                to->f[c][d] = s->f + (size_t)d * (size_t)s->n_slot + t->simd_blocks.base[4 * b + c];
                continue;
            }
            for (int l = 0; l < PAL_LANES; l++) to->x_loose[c][d][l] = x[node[c * PAL_LANES + l]];
            memset(to->f_loose[c][d], 0, sizeof to->f_loose[c][d]);
            to->x[c][d] = to->x_loose[c][d];
            to->f[c][d] = to->f_loose[c][d];
        }
}
PAL_INLINE void pal_tet_store_block(const pal_elastic_tets *t, int b, const pal_tet_block *from)
{
    if (b < t->simd_blocks.n_strip) return;
    const int32_t *node = t->simd_blocks.node + (size_t)(b - t->simd_blocks.n_strip) * 4 * PAL_LANES;
    for (int c = 0; c < 4; c++)
        for (int l = 0; l < PAL_LANES; l++)
            for (int d = 0; d < 3; d++)
                t->node_order->f[(size_t)d * (size_t)t->node_order->n_slot + (size_t)node[c * PAL_LANES + l]] +=
                    from->f_loose[c][d][l];
}

/* tet10: from nodes [n_node][3]; lanes without an element repeat the first one's nodes */
PAL_INLINE void pal_tet10_load_block(const pal_elastic_tets *t, int b, const double *x, pal_tet_block *to)
{
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
PAL_INLINE void pal_tet10_store_block(const pal_elastic_tets *t, int b, const pal_tet_block *from, double *f)
{
    for (int l = 0; l < PAL_LANES; l++) {
        int e = t->owner[PAL_LANES * b + l];
        if (e < 0) continue;
        const int32_t *node = t->corner + (size_t)PAL_TET10_CORNERS * (size_t)e;
        for (int c = 0; c < PAL_TET10_CORNERS; c++)
            for (int d = 0; d < 3; d++) f[3 * node[c] + d] += from->f_loose[c][d][l];
    }
}

/* h = sum of x_a (dN_a/dl)' at a point */
PAL_INLINE void pal_tet_local_gradient(const pal_elastic_tets *t, int n_corner, int point, const pal_tet_block *at,
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
PAL_INLINE void pal_tet_add_force(const pal_elastic_tets *t, int n_corner, int point, pal_tet_block *at, int lane,
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

PAL_INLINE void pal_tet_load9(const double *at, int n, pal_wide *r)
{
    for (int i = 0; i < n; i++) r[i] = pal_wide_load(at + (size_t)i * PAL_LANES);
}

/* number k of `width` of the element at `place` */
static inline double pal_lane_get(const double *array, int width, int place, int k)
{
    return array[(size_t)(place / PAL_LANES) * (size_t)width * PAL_LANES + (size_t)k * PAL_LANES +
                 (size_t)(place % PAL_LANES)];
}
static inline void pal_lane_set(double *array, int width, int place, int k, double value)
{
    array[(size_t)(place / PAL_LANES) * (size_t)width * PAL_LANES + (size_t)k * PAL_LANES +
          (size_t)(place % PAL_LANES)] = value;
}

/* neo_hookean: the tangent at d. [sim] */
void pal_elastic_tets_modes(pal_elastic_tets *t, const double *d);
/* one element of a corotational law with the rotation it holds: returns its energy; force (NULL: none) [n_node][3] and
 * torque about the origin are added to */
double pal_tet_add_element(const pal_elastic_tets *t, int e, const double *d, double *force, double *torque);
/* f -= forces without resultant that have this torque: balances averaged rotations */
void pal_tet_balance_torque(const pal_elastic_tets *t, const double *d, const double torque[3], double *f);
/* energy and forces of a body with a single rotation */
double pal_tet_single_rotation_force(const pal_elastic_tets *t, const double *d, double *f);
void pal_tet_fit_single_rotation(pal_elastic_tets *t, const double *d);
#endif
