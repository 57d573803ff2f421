/* Vectors of 8 lanes for the spring kernels. Where the processor has no such vectors, the compiler splits them and the
 * calling convention differs (hence -Wno-psabi), so that everything here is inlined. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SIMD_H
#define PAL_SIM_CORE_SIMD_H
#include "server/sim/core/simd_blocks.h"

/* 8 doubles side by side: GNU vectors, which gcc and clang turn into whatever the processor has. pal_v8_unaligned in
 * memory may stand at any multiple of 8 bytes */
typedef double pal_v8 __attribute__((vector_size(64)));
typedef int64_t pal_i8 __attribute__((vector_size(64)));
typedef double pal_v8_unaligned __attribute__((vector_size(64), aligned(8), may_alias));

/* x y z 0 of a node */
typedef double pal_quad __attribute__((vector_size(32)));

PAL_INLINE pal_quad pal_quad_load(const double a[3])
{
    return (pal_quad){a[0], a[1], a[2], 0};
}
PAL_INLINE void pal_quad_store(double a[3], pal_quad q)
{
    a[0] = q[0], a[1] = q[1], a[2] = q[2];
}
PAL_INLINE double pal_quad_dot(pal_quad a, pal_quad b)
{
    pal_quad p = a * b;
    return p[0] + p[1] + p[2];
}

PAL_INLINE pal_v8 pal_load8(const double *at)
{
    return *(const pal_v8_unaligned *)at;
}
PAL_INLINE void pal_add8(double *at, pal_v8 a)
{
    *(pal_v8_unaligned *)at += a;
}
/* lane by lane: a where the mask is set, else b */
PAL_INLINE pal_v8 pal_select8(pal_i8 mask, pal_v8 a, pal_v8 b)
{
    return (pal_v8)((mask & (pal_i8)a) | (~mask & (pal_i8)b));
}
/* 1 / sqrt(q) for positive normal q: a guess from the halved exponent and four Newton steps, within a few units of the
 * last place. The same bits on every IEEE machine, at a third of the cost of root and division */
PAL_INLINE pal_v8 pal_inverse_sqrt8(pal_v8 q)
{
    pal_v8 half = 0.5 * q, r = (pal_v8)(0x5fe6eb50c7b537a9 - ((pal_i8)q >> 1));
    r = r * (1.5 - half * r * r);
    r = r * (1.5 - half * r * r);
    r = r * (1.5 - half * r * r);
    return r * (1.5 - half * r * r);
}

/* sqrt(q) for q >= 0, to a few units of the last place */
PAL_INLINE pal_v8 pal_sqrt8(pal_v8 q)
{
    const pal_v8 floor = 1e-300 - (pal_v8){0};
    return q * pal_inverse_sqrt8(pal_select8(q < floor, floor, q));
}

/* slots of a loose block */
PAL_INLINE const int32_t *pal_block_nodes(const pal_simd_blocks *blocks, int b)
{
    return blocks->node + blocks->n_corner * PAL_LANES * (b - blocks->n_strip);
}
/* coordinates of a loose block's corners, slots node [n_corner][8] */
PAL_INLINE void pal_loose_load(const pal_node_order *order, const int32_t *node, int n_corner,
                               double at[][3][PAL_LANES])
{
    for (int c = 0; c < n_corner; c++)
        for (int d = 0; d < 3; d++)
            for (int l = 0; l < PAL_LANES; l++) at[c][d][l] = order->x[d * order->n_slot + node[c * PAL_LANES + l]];
}
/* pointers p [n_corner][3] to 8 lanes of the coordinates of a block's corners: in a strip the slots, in a loose block
 * copies in `loose`; true: loose */
PAL_INLINE bool pal_block_points(const pal_simd_blocks *blocks, const pal_node_order *order, int b, int n_corner,
                                 double loose[][3][PAL_LANES], const double *p[][3])
{
    const bool is_loose = b >= blocks->n_strip;
    const int32_t *base = blocks->base + n_corner * b;
    if (is_loose) pal_loose_load(order, pal_block_nodes(blocks, b), n_corner, loose);
    for (int c = 0; c < n_corner; c++)
        for (int d = 0; d < 3; d++) p[c][d] = is_loose ? loose[c][d] : order->x + d * order->n_slot + base[c];
    return is_loose;
}

/* 8 elements: pointers to the coordinates of their corners and to the forces on them, which a kernel adds to */
enum { PAL_VIEW_CORNERS = 10 };
typedef struct pal_block_view {
    const double *x[PAL_VIEW_CORNERS][3];
    double *f[PAL_VIEW_CORNERS][3];
    double x_loose[PAL_VIEW_CORNERS][3][PAL_LANES], f_loose[PAL_VIEW_CORNERS][3][PAL_LANES];
} pal_block_view;
PAL_INLINE void pal_block_open(const pal_simd_blocks *blocks, const pal_node_order *order, int b, int n_corner,
                               pal_block_view *v)
{
    const bool loose = pal_block_points(blocks, order, b, n_corner, v->x_loose, v->x);
    for (int c = 0; c < n_corner; c++)
        for (int d = 0; d < 3; d++) {
            v->f[c][d] = loose ? v->f_loose[c][d] : order->f + (v->x[c][d] - order->x);
            for (int l = 0; l < PAL_LANES && loose; l++) v->f_loose[c][d][l] = 0;
        }
}
/* adds the forces of a loose block to the slots */
PAL_INLINE void pal_block_close(const pal_simd_blocks *blocks, const pal_node_order *order, int b, int n_corner,
                                const pal_block_view *v)
{
    const int32_t *node = pal_block_nodes(blocks, b);
    for (int c = 0; c < n_corner && b >= blocks->n_strip; c++)
        for (int d = 0; d < 3; d++)
            for (int l = 0; l < PAL_LANES; l++)
                order->f[(size_t)d * (size_t)order->n_slot + (size_t)node[c * PAL_LANES + l]] += v->f_loose[c][d][l];
}

#endif
