/* Elastic tetrahedra: the neo-Hookean tangent, 8 elements at a time. F = R S with the warm-started rotation, S = v
 * diag(s) v' by Jacobi's method, u = R v; the rest is pal_neo_modes_compute, which takes the
 * elements whose rotation vectors could not settle. */
#include "server/sim/elements/elastic_tet_block.h"

enum { SWEEPS = 5 };

/* 1 / sqrt(q), q > 0 (simd.h) */
PAL_INLINE pal_wide inverse_root(pal_wide q)
{
    pal_wide half = 0.5 * q, r = (pal_wide)(0x5fe6eb50c7b537a9 - ((pal_wide_mask)q >> 1));
    for (int k = 0; k < 4; k++) r = r * (1.5 - half * r * r);
    return r;
}

/* one rotation of Jacobi's method in the plane of axes p and q: a symmetric, diagonal d[3], off-diagonals a_pq, and
 * a_pr, a_qr with the third axis; rows p and q of v'. Off-diagonals below `least` in square are taken as 0, before they
 * become denormal */
PAL_INLINE void jacobi_turn(pal_wide min, pal_wide *dp, pal_wide *dq, pal_wide *apq, pal_wide *apr, pal_wide *aqr,
                            pal_wide vp[3], pal_wide vq[3])
{
    const pal_wide zero = {0};
    pal_wide_mask flat = ~(*apq * *apq > min);
    *apq = pal_wide_select(flat, zero, *apq);
    pal_wide d = *dq - *dp, h = 2 * *apq, square = pal_wide_select(flat, 1 + zero, d * d + h * h);
    pal_wide root = square * inverse_root(square);
    pal_wide t = h / (d + pal_wide_select(d < 0, -root, root));
    pal_wide c = inverse_root(1 + t * t), s = c * t;
    *dp -= t * *apq, *dq += t * *apq, *apq = zero;
    pal_wide x = *apr, y = *aqr;
    *apr = c * x - s * y, *aqr = s * x + c * y;
    for (int k = 0; k < 3; k++) {
        x = vp[k], y = vq[k];
        vp[k] = c * x - s * y, vq[k] = s * x + c * y;
    }
}

/* eigenvalues w and eigenvectors (rows of v) of the symmetric xx yy zz yz zx xy */
PAL_INLINE void jacobi(const pal_wide a[6], pal_wide w[3], pal_wide v[9])
{
    const pal_wide zero = {0};
    pal_wide yz = a[3], zx = a[4], xy = a[5];
    for (int i = 0; i < 9; i++) v[i] = zero + (i % 4 == 0 ? 1.0 : 0.0);
    for (int i = 0; i < 3; i++) w[i] = a[i];
    pal_wide min = 1e-36 * (a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + yz * yz + zx * zx + xy * xy);
    for (int k = 0; k < SWEEPS; k++) {
        jacobi_turn(min, &w[0], &w[1], &xy, &zx, &yz, v, v + 3);
        jacobi_turn(min, &w[0], &w[2], &zx, &xy, &yz, v, v + 6);
        jacobi_turn(min, &w[1], &w[2], &yz, &xy, &zx, v + 3, v + 6);
        /* what is left turns the vectors by 1e-12 of the largest eigenvalue over their distance */
        if (pal_wide_all(yz * yz + zx * zx + xy * xy <= 1e12 * min)) break;
    }
}

PAL_INLINE pal_wide at_least_0(pal_wide a)
{
    const pal_wide zero = {0};
    return pal_wide_select(a > 0, a, zero);
}

/* the Hessian in the frame of the stretches w, projected: stretch 6, same 3, cross 3 */
PAL_INLINE void project(pal_wide mu, pal_wide k1, const pal_wide w[3], pal_wide out[12])
{
    pal_wide g[3] = {w[1] * w[2], w[2] * w[0], w[0] * w[1]}, c = k1 * (w[0] * g[0] - 1) - mu, a[6];
    for (int k = 0; k < 3; k++) {
        pal_wide twist = at_least_0(mu + c * w[k]), flip = at_least_0(mu - c * w[k]);
        out[6 + k] = 0.5 * (flip + twist);
        out[9 + k] = 0.5 * (flip - twist);
        a[k] = mu + k1 * g[k] * g[k];
        a[3 + k] = k1 * g[(k + 1) % 3] * g[(k + 2) % 3] + c * w[k];
    }
    /* positive definite as it is, by its minors */
    pal_wide two = a[0] * a[1] - a[5] * a[5];
    pal_wide det = a[2] * two - a[3] * (a[0] * a[3] - a[4] * a[5]) + a[4] * (a[5] * a[3] - a[1] * a[4]);
    pal_wide_mask whole = (a[0] > 0) & (two > 0) & (det > 0);
    memcpy(out, a, sizeof a);
    if (pal_wide_all(whole)) return;
    pal_wide e[3], v[9];
    jacobi(a, e, v);
    for (int i = 0; i < 6; i++) {
        static const int row[6] = {0, 1, 2, 1, 2, 0}, column[6] = {0, 1, 2, 2, 0, 1};
        pal_wide sum = {0};
        for (int m = 0; m < 3; m++) sum += at_least_0(e[m]) * v[3 * m + row[i]] * v[3 * m + column[i]];
        out[i] = pal_wide_select(whole, a[i], sum);
    }
}

/* one element at one Gauss point */
static __attribute__((noinline)) void take_one(pal_elastic_tets *t, int e, int point, const double *d)
{
    int place = t->place[e], width = PAL_TET_MODES * t->n_point, first = PAL_TET_MODES * point;
    double mu = pal_lane_get(t->stiff, 2, place, 0) / t->n_point,
           lambda = pal_lane_get(t->stiff, 2, place, 1) / t->n_point;
    double f[9];
    pal_neo_modes m;
    pal_elastic_tets_gradient(t, e, point, d, f);
    pal_neo_modes_compute(mu, lambda + mu, 0, f, &m);
    for (int i = 0; i < 9; i++) {
        double dv = 0;
        for (int k = 0; k < 3; k++) dv += pal_lane_get(t->inverse, 9, place, 3 * (i / 3) + k) * m.v[3 * k + i % 3];
        pal_lane_set(t->tangent, width, place, first + i, m.u[i]);
        pal_lane_set(t->tangent, width, place, first + 9 + i, dv);
    }
    for (int i = 0; i < 6; i++) pal_lane_set(t->tangent, width, place, first + 18 + i, m.stretch[i]);
    for (int i = 0; i < 3; i++) {
        pal_lane_set(t->tangent, width, place, first + 24 + i, m.same[i]);
        pal_lane_set(t->tangent, width, place, first + 27 + i, m.cross[i]);
    }
}

/* returns the lanes that are left to take_one, as bits */
PAL_INLINE unsigned modes_half(pal_elastic_tets *t, int n_corner, int point, int b, int lane, const pal_tet_block *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    pal_wide h[9], f[9], r[9], m[9], q[4], inverse[9], w[3], v[9], out[12];
    pal_tet_load9(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
    pal_tet_load9(t->turn + (size_t)b * 4 * PAL_LANES + lane, 4, q);
    pal_wide mu = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + lane),
             lambda = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + PAL_LANES + lane);
    pal_wide_mask live = mu > 0;
    if (n_point > 1) mu *= 0.25, lambda *= 0.25;
    pal_tet_local_gradient(t, n_corner, point, at, lane, h);
    pal_wide_mul(f, h, inverse);
    unsigned left = pal_wide_polar(f, live, PAL_TET_ROTATION_STEPS, q, r, m);
    const pal_wide s[6] = {m[0], m[4], m[8], 0.5 * (m[5] + m[7]), 0.5 * (m[2] + m[6]), 0.5 * (m[1] + m[3])};
    jacobi(s, w, v);
    project(mu, mu + lambda, w, out);
    double *to = t->tangent + ((size_t)b * (size_t)n_point + (size_t)point) * PAL_TET_MODES * PAL_LANES + lane;
    pal_wide_mult(f, r, v);
    pal_wide_mult(h, inverse, v);
    for (int i = 0; i < 9; i++) {
        pal_wide_store(to + i * PAL_LANES, f[i]);
        pal_wide_store(to + (9 + i) * PAL_LANES, h[i]);
    }
    for (int i = 0; i < 12; i++) pal_wide_store(to + (18 + i) * PAL_LANES, out[i]);
    return left;
}

PAL_INLINE void all_modes(pal_elastic_tets *t, int n_corner, const double *d)
{
    pal_tet_block at;
    for (int b = 0; b < t->n_block; b++) {
        if (n_corner == 4)
            pal_tet_load_block(t, b, &at);
        else
            pal_tet10_load_block(t, b, d, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE)
            for (int point = 0; point < (n_corner == 4 ? 1 : 4); point++) {
                unsigned left = modes_half(t, n_corner, point, b, lane, &at);
                for (int l = 0; left >> l; l++)
                    if (left >> l & 1) take_one(t, t->owner[PAL_LANES * b + lane + l], point, d);
            }
    }
}

void pal_elastic_tets_modes(pal_elastic_tets *t, const double *d)
{
    if (t->options.n_corner == 4)
        all_modes(t, 4, d);
    else
        all_modes(t, 10, d);
}
