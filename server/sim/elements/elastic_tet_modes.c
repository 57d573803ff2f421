/* Elastic tetrahedra: the neo-Hookean tangent, 8 elements at a time. F = R S with the warm-started rotation, S = v
 * diag(s) v' by Jacobi's method, u = R v. In the frame of u and v the Hessian is a 3x3 matrix on the diagonal
 * (stretches) and a 2x2 on each pair (twist and flip), whose eigenvalues are raised to 0 at least (Smith, de Goes, Kim
 * 2018, section 4.5): d2J/dF2 couples the stretches by the third one and each pair of shears by s_k. */
#include "server/sim/elements/elastic_tet_block.h"

PAL_INLINE pal_wide at_least_0(pal_wide a)
{
    const pal_wide zero = {0};
    return pal_wide_select(a > 0, a, zero);
}

/* the Hessian in the frame of the stretches w, projected: stretch 6 (xx yy zz yz zx xy); of the pair (i, j) without k
 * dP_ij = same[k] dF_ij + cross[k] dF_ji: same 3, cross 3 */
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
    pal_wide v[9];
    pal_wide_jacobi(a, v);
    for (int i = 0; i < 6; i++) {
        static const int row[6] = {0, 1, 2, 1, 2, 0}, column[6] = {0, 1, 2, 2, 0, 1};
        pal_wide sum = {0};
        for (int m = 0; m < 3; m++) sum += at_least_0(a[m]) * v[3 * row[i] + m] * v[3 * column[i] + m];
        out[i] = pal_wide_select(whole, out[i], sum);
    }
}

PAL_INLINE void modes_half(pal_elastic_tets *t, int n_corner, int point, int b, int lane, const pal_block_view *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    pal_wide h[9], f[9], r[9], m[9], q[4], inverse[9], v[9], out[12], stiff[2];
    pal_tet_constants(t, b, lane, 1.0 / n_point, inverse, stiff);
    pal_wide_load_n(t->rotation + (size_t)b * 4 * PAL_LANES + lane, 4, q);
    pal_tet_local_gradient(t, n_corner, point, at, lane, h);
    pal_wide_mul(f, h, inverse);
    pal_wide_polar(f, stiff[0] > 0, q, r, m);
    pal_wide s[6] = {m[0], m[4], m[8], 0.5 * (m[5] + m[7]), 0.5 * (m[2] + m[6]), 0.5 * (m[1] + m[3])};
    pal_wide_jacobi(s, v);
    project(stiff[0], stiff[0] + stiff[1], s, out);
    double *to = t->tangent + ((size_t)b * (size_t)n_point + (size_t)point) * PAL_TET_MODES * PAL_LANES + lane;
    pal_wide_mul(f, r, v);
    pal_wide_mul(h, inverse, v);
    pal_wide_store_n(to, 9, f), pal_wide_store_n(to + 9 * PAL_LANES, 9, h);
    pal_wide_store_n(to + 18 * PAL_LANES, 12, out);
}

PAL_INLINE void all_modes(pal_elastic_tets *t, int n_corner, const double *d)
{
    pal_block_view at;
    for (int b = 0; b < t->n_block; b++) {
        pal_tet_open(t, n_corner, b, d, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE)
            for (int point = 0; point < (n_corner == 4 ? 1 : 4); point++) modes_half(t, n_corner, point, b, lane, &at);
    }
}

void pal_elastic_tets_modes(pal_elastic_tets *t, const double *d)
{
    if (t->options.n_corner == 4)
        all_modes(t, 4, d);
    else
        all_modes(t, 10, d);
}
