/* Kernels of springs in single precision (spring_single.h): 8 springs at a time, a block each. */
#include "server/sim/springs/spring_single.h"

typedef float vec8 __attribute__((vector_size(32)));
typedef float vec8_memory __attribute__((vector_size(32), aligned(4), may_alias));
typedef int32_t mask8 __attribute__((vector_size(32)));

/* corners [n_corner], coordinates */
typedef struct corners {
    vec8 at[PAL_CORNERS][3];
} corners;

PAL_INLINE vec8 load(const float *at)
{
    return *(const vec8_memory *)at;
}
PAL_INLINE void add(float *at, vec8 a)
{
    *(vec8_memory *)at += a;
}
PAL_INLINE vec8 select8(mask8 mask, vec8 a, vec8 b)
{
    return (vec8)((mask & (mask8)a) | (~mask & (mask8)b));
}
PAL_INLINE vec8 root(vec8 q)
{
    for (int l = 0; l < PAL_LANES; l++) q[l] = sqrtf(q[l]);
    return q;
}

PAL_INLINE void cross(vec8 out[3], const vec8 a[3], const vec8 b[3])
{
    for (int c = 0; c < 3; c++) out[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}
PAL_INLINE vec8 dot(const vec8 a[3], const vec8 b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* ---- kernels: w of the set (of edges its square), k q; f [n_corner - 1]: forces on corners 1, 2, 3 ---- */

/* with r = l/l0 = sqrt(q): C (d/l)/l0 = (r - 1)/r d/l0^2 */
PAL_INLINE void edge_kernel(const corners *x, vec8 w2, vec8 kq, vec8 f[][3], vec8 *min)
{
    const vec8 one = 1 - (vec8){0}, floor = (float)(PAL_SPRING_SINGLE_SHORT * PAL_SPRING_SINGLE_SHORT) - (vec8){0};
    vec8 d[3];
    for (int c = 0; c < 3; c++) d[c] = x->at[1][c] - x->at[0][c];
    const vec8 q = dot(d, d) * w2, known = select8(w2 > 0, q, one);
    *min = select8(known < *min, known, *min);
    const vec8 r = root(select8(q < floor, floor, q)), s = kq * w2 * ((1 - r) / r);
    for (int c = 0; c < 3; c++) f[0][c] = s * d[c];
}

/* with r = A/A0 = sqrt(q): C n/|n| = (r - 1)/r n w, and the gradients are crosses of n with the edges */
PAL_INLINE void face_kernel(const corners *x, vec8 w, vec8 kq, vec8 f[][3])
{
    const vec8 floor = (float)(PAL_SPRING_SINGLE_SHORT * PAL_SPRING_SINGLE_SHORT) - (vec8){0}, w2 = w * w;
    vec8 a[3], b[3], n[3];
    for (int c = 0; c < 3; c++) a[c] = x->at[1][c] - x->at[0][c], b[c] = x->at[2][c] - x->at[0][c];
    cross(n, a, b);
    const vec8 q = dot(n, n) * w2, r = root(select8(q < floor, floor, q)), t = kq * w2 * ((1 - r) / r);
    for (int c = 0; c < 3; c++) n[c] *= t;
    cross(f[0], b, n);
    cross(f[1], n, a);
}

PAL_INLINE void volume_kernel(const corners *x, vec8 w, vec8 kq, vec8 f[][3])
{
    vec8 a[3], b[3], c[3], g[3];
    for (int k = 0; k < 3; k++) {
        a[k] = x->at[1][k] - x->at[0][k], b[k] = x->at[2][k] - x->at[0][k], c[k] = x->at[3][k] - x->at[0][k];
    }
    cross(g, b, c);
    const vec8 t = kq * w * (1 - dot(a, g) * w);
    cross(f[1], c, a);
    cross(f[2], a, b);
    for (int k = 0; k < 3; k++) f[0][k] = t * g[k], f[1][k] *= t, f[2][k] *= t;
}

PAL_INLINE void run_kernel(pal_spring_kind kind, const corners *x, vec8 w, vec8 kq, vec8 f[][3], vec8 *min)
{
    if (kind == PAL_SPRING_DISTANCE) edge_kernel(x, w, kq, f, min);
    if (kind == PAL_SPRING_AREA) face_kernel(x, w, kq, f);
    if (kind == PAL_SPRING_VOLUME) volume_kernel(x, w, kq, f);
}

/* ---- blocks ---- */

/* what the loops read: copies, which their stores cannot change */
typedef struct pass {
    const float *x, *w, *q;
    float *f, k;
    size_t n_slot;
    const pal_simd_blocks *blocks;
} pass;

PAL_INLINE void run_strip(pal_spring_kind kind, const pass *p, int b, vec8 *min)
{
    const int n_corner = pal_spring_corner_count(kind);
    size_t base[PAL_CORNERS]; /* read before the stores, which might change them for all that a compiler knows */
    corners x;
    vec8 f[PAL_CORNERS - 1][3], sum[3];
    for (int c = 0; c < n_corner; c++) base[c] = (size_t)p->blocks->base[n_corner * b + c];
    for (int c = 0; c < n_corner; c++)
        for (size_t d = 0; d < 3; d++) x.at[c][d] = load(p->x + d * p->n_slot + base[c]);
    run_kernel(kind, &x, load(p->w + PAL_LANES * b), p->k * load(p->q + PAL_LANES * b), f, min);
    for (int d = 0; d < 3; d++) sum[d] = f[0][d];
    for (int c = 2; c < n_corner; c++)
        for (int d = 0; d < 3; d++) sum[d] += f[c - 1][d];
    for (size_t d = 0; d < 3; d++) add(p->f + d * p->n_slot + base[0], -sum[d]);
    for (int c = 1; c < n_corner; c++)
        for (size_t d = 0; d < 3; d++) add(p->f + d * p->n_slot + base[c], f[c - 1][d]);
}

PAL_INLINE void run_loose(pal_spring_kind kind, const pass *p, int b, vec8 *min)
{
    const int n_corner = pal_spring_corner_count(kind);
    const int32_t *node = pal_block_nodes(p->blocks, b);
    corners x;
    vec8 f[PAL_CORNERS - 1][3];
    for (int c = 0; c < n_corner; c++)
        for (size_t d = 0; d < 3; d++)
            for (int l = 0; l < PAL_LANES; l++) x.at[c][d][l] = p->x[d * p->n_slot + node[c * PAL_LANES + l]];
    run_kernel(kind, &x, load(p->w + PAL_LANES * b), p->k * load(p->q + PAL_LANES * b), f, min);
    for (int c = 1; c < n_corner; c++)
        for (int l = 0; l < PAL_LANES; l++)
            for (size_t d = 0; d < 3; d++) {
                p->f[d * p->n_slot + node[c * PAL_LANES + l]] += f[c - 1][d][l];
                p->f[d * p->n_slot + node[l]] -= f[c - 1][d][l];
            }
}

PAL_INLINE double run_blocks(pal_spring_kind kind, const pass *p, const int32_t *block, int n)
{
    vec8 min = 1 - (vec8){0};
    int i = 0;
    for (; i < n && (block ? block[i] : i) < p->blocks->n_strip; i++) run_strip(kind, p, block ? block[i] : i, &min);
    for (; i < n; i++) run_loose(kind, p, block ? block[i] : i, &min);
    for (int l = 1; l < PAL_LANES; l++) min[0] = min[l] < min[0] ? min[l] : min[0];
    return (double)min[0];
}

double pal_spring_single_run(const pal_spring_set *set, const pal_node_order *order, const int32_t *block, int n)
{
    const pal_simd_blocks blocks = set->simd_blocks;
    const pass p = {.x = order->single_x,
                    .f = order->single_f,
                    .w = set->single_w,
                    .q = set->single_q,
                    .k = order->unit_N > 0 ? (float)(set->spring.k_J / (order->unit_m * order->unit_N)) : 0,
                    .n_slot = (size_t)order->n_slot,
                    .blocks = &blocks};
    switch (set->spring.kind) {
    case PAL_SPRING_DISTANCE:
        return run_blocks(PAL_SPRING_DISTANCE, &p, block, n);
    case PAL_SPRING_AREA:
        return run_blocks(PAL_SPRING_AREA, &p, block, n);
    default:
        return run_blocks(PAL_SPRING_VOLUME, &p, block, n);
    }
}
