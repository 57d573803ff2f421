/* Vector kernels of the voxel hexahedra, inlined into elastic_hex_*.c; include nowhere else.
 *
 * A cube's corners c stand at the signs s_j(c) of the axes j = x, y, z. Its trilinear field is best force_cache as the
 * coefficients of the eight monomials (modes) m = a set of axes, numbered like corners (x = 1, y = 2, z = 4),
 *     u(xi) = 1/8 sum_m U_m prod_{j in m} xi_j,   U_m = sum_c u_c prod_{j in m} s_j(c),
 * a Walsh transform: 24 additions per component, its own inverse but for the factor 8. The cube's mirror symmetries
 * leave K with blocks of at most three modes then, so that K u takes about fifty operations instead of 24 x 24 products
 * (stress below; the same K as pal_hex_stiffness, tested). Rotations act on the components of each mode alike.
 *
 * With e the strain of the field and <> the mean over the cube of volume V, twice the energy is
 *     V (2 mu <e:e> + lambda <tr e>^2 + beta (<(tr e)^2> - <tr e>^2)),
 * beta = lambda for full integration, -2/3 mu for B-bar (Hughes 1980).
 *
 * Lanes: 8 elements lie side by side in memory, a kernel takes PAL_WIDE of them at once (as many as the processor's
 * vectors hold without splitting; every operation is lane by lane, so the bits are the same for any width).
 * Thread: [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_SIMD_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_SIMD_H
#include "server/num/polar.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/simd_wide.h"
#include "server/sim/elements/elastic_hex.h"

#include <math.h>
#include <string.h>

PAL_INLINE pal_wide wide_of(double a)
{
    return a - (pal_wide){0};
}
PAL_INLINE bool wide_any(pal_wide_mask mask)
{
    int64_t any = 0;
    for (int l = 0; l < PAL_WIDE; l++) any |= mask[l];
    return any != 0;
}
PAL_INLINE pal_wide wide_root(pal_wide q)
{
    for (int l = 0; l < PAL_WIDE; l++) q[l] = sqrt(q[l]);
    return q;
}
/* 1 / sqrt(q) of positive normal numbers, as pal_inverse_sqrt8 (simd.h) */
PAL_INLINE pal_wide wide_inverse_root(pal_wide q)
{
    pal_wide half = 0.5 * q, r = (pal_wide)(0x5fe6eb50c7b537a9 - ((pal_wide_mask)q >> 1));
    r = r * (1.5 - half * r * r);
    r = r * (1.5 - half * r * r);
    r = r * (1.5 - half * r * r);
    return r * (1.5 - half * r * r);
}

/* pointers to the corners of 8 elements: in a strip to the slots, in a loose block to copies */
typedef struct hex_view {
    const double *x[8][3]; /* coordinates, 8 lanes each   */
    double *f[8][3];       /* to be added to, 8 lanes each */
    const int32_t *node;   /* loose: slots [8][8]          */
    double at[8][3][PAL_LANES], to[8][3][PAL_LANES];
} hex_view;

PAL_INLINE void hex_open(const pal_elastic_hexes *cubes, const pal_node_order *node_order, int block, hex_view *v)
{
    const int n_slot = node_order->n_slot, n_strip = cubes->simd_blocks.n_strip;
    if (block < n_strip) {
        const int32_t *base = cubes->simd_blocks.base + 8 * block;
        for (int c = 0; c < 8; c++)
            for (int d = 0; d < 3; d++) {
                v->x[c][d] = node_order->x + d * n_slot + base[c];
                v->f[c][d] = node_order->f + d * n_slot + base[c];
            }
        return;
    }
    v->node = cubes->simd_blocks.node + 8 * PAL_LANES * (block - n_strip);
    memset(v->to, 0, sizeof v->to);
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 3; d++) {
            for (int l = 0; l < PAL_LANES; l++) v->at[c][d][l] = node_order->x[d * n_slot + v->node[c * PAL_LANES + l]];
            v->x[c][d] = v->at[c][d];
            v->f[c][d] = v->to[c][d];
        }
}
/* adds the copies of a loose block to the slots */
PAL_INLINE void hex_close(const pal_elastic_hexes *cubes, pal_node_order *node_order, int block, const hex_view *v)
{
    if (block < cubes->simd_blocks.n_strip) return;
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 3; d++)
            for (int l = 0; l < PAL_LANES; l++)
                node_order->f[d * node_order->n_slot + v->node[c * PAL_LANES + l]] += v->to[c][d][l];
}

PAL_INLINE void walsh_pair(pal_wide *low, pal_wide *high)
{
    pal_wide sum = *high + *low;
    *high = *high - *low;
    *low = sum;
}
/* corners to modes */
PAL_INLINE void walsh(pal_wide u[8])
{
    walsh_pair(u + 0, u + 1), walsh_pair(u + 2, u + 3), walsh_pair(u + 4, u + 5), walsh_pair(u + 6, u + 7);
    walsh_pair(u + 0, u + 2), walsh_pair(u + 1, u + 3), walsh_pair(u + 4, u + 6), walsh_pair(u + 5, u + 7);
    walsh_pair(u + 0, u + 4), walsh_pair(u + 1, u + 5), walsh_pair(u + 2, u + 6), walsh_pair(u + 3, u + 7);
}
PAL_INLINE void unwalsh_pair(pal_wide *low, pal_wide *high)
{
    pal_wide sum = *low + *high;
    *low = *low - *high;
    *high = sum;
}
/* modes to corners, the transposed transform; mode 0 (a force on the whole) is none */
PAL_INLINE void unwalsh(pal_wide u[8])
{
    u[0] = -u[1];
    unwalsh_pair(u + 2, u + 3), unwalsh_pair(u + 4, u + 5), unwalsh_pair(u + 6, u + 7);
    unwalsh_pair(u + 0, u + 2), unwalsh_pair(u + 1, u + 3), unwalsh_pair(u + 4, u + 6), unwalsh_pair(u + 5, u + 7);
    unwalsh_pair(u + 0, u + 4), unwalsh_pair(u + 1, u + 5), unwalsh_pair(u + 2, u + 6), unwalsh_pair(u + 3, u + 7);
}

/* modes 1..7 of the corners' coordinates */
PAL_INLINE void hex_modes(const hex_view *v, int l, pal_wide u[3][8])
{
    for (int d = 0; d < 3; d++) {
        for (int c = 0; c < 8; c++) u[d][c] = pal_wide_load(v->x[c][d] + l);
        walsh(u[d]);
    }
}
PAL_INLINE void hex_add(hex_view *v, int l, pal_wide u[3][8])
{
    for (int d = 0; d < 3; d++) {
        unwalsh(u[d]);
        for (int c = 0; c < 8; c++) pal_wide_add(v->f[c][d] + l, u[d][c]);
    }
}

/* K in modes: u [3][8] becomes K u; mu, lambda, beta are the elements' times h / 16 */
PAL_INLINE void hex_stress(pal_wide mu, pal_wide lambda, pal_wide beta, pal_wide u[3][8])
{
    const pal_wide mu3 = mu * (1.0 / 3), beta3 = beta * (1.0 / 3), top = (4 * mu + beta) * (1.0 / 9);
    /* stretches */
    pal_wide trace = lambda * (u[0][1] + u[1][2] + u[2][4]), mu2 = mu + mu;
    u[0][1] = mu2 * u[0][1] + trace, u[1][2] = mu2 * u[1][2] + trace, u[2][4] = mu2 * u[2][4] + trace;
    /* shears */
    u[0][2] = u[1][1] = mu * (u[0][2] + u[1][1]);
    u[1][4] = u[2][2] = mu * (u[1][4] + u[2][2]);
    u[2][1] = u[0][4] = mu * (u[2][1] + u[0][4]);
    /* bending: axis i grows along i and j */
    pal_wide dx = beta3 * (u[1][3] + u[2][5]), dy = beta3 * (u[0][3] + u[2][6]), dz = beta3 * (u[0][5] + u[1][6]);
    u[1][3] = mu * u[1][3] + dx, u[2][5] = mu * u[2][5] + dx;
    u[0][3] = mu * u[0][3] + dy, u[2][6] = mu * u[2][6] + dy;
    u[0][5] = mu * u[0][5] + dz, u[1][6] = mu * u[1][6] + dz;
    /* twists */
    pal_wide twist = u[0][6] + u[1][5] + u[2][3];
    u[0][6] = mu3 * (u[0][6] + twist), u[1][5] = mu3 * (u[1][5] + twist), u[2][3] = mu3 * (u[2][3] + twist);
    u[0][7] = top * u[0][7], u[1][7] = top * u[1][7], u[2][7] = top * u[2][7];
}

/* u := R u or R' u, modes 1..7; r cubes-major */
PAL_INLINE void hex_rotate(const pal_wide r[9], pal_wide u[3][8])
{
    for (int m = 1; m < 8; m++) {
        pal_wide x = u[0][m], y = u[1][m], z = u[2][m];
        u[0][m] = r[0] * x + r[1] * y + r[2] * z;
        u[1][m] = r[3] * x + r[4] * y + r[5] * z;
        u[2][m] = r[6] * x + r[7] * y + r[8] * z;
    }
}
PAL_INLINE void hex_unrotate(const pal_wide r[9], pal_wide u[3][8])
{
    for (int m = 1; m < 8; m++) {
        pal_wide x = u[0][m], y = u[1][m], z = u[2][m];
        u[0][m] = r[0] * x + r[3] * y + r[6] * z;
        u[1][m] = r[1] * x + r[4] * y + r[7] * z;
        u[2][m] = r[2] * x + r[5] * y + r[8] * z;
    }
}

PAL_INLINE void wide_quat_matrix(const pal_wide q[4], pal_wide r[9])
{
    pal_wide x2 = q[1] + q[1], y2 = q[2] + q[2], z2 = q[3] + q[3];
    pal_wide wx = q[0] * x2, wy = q[0] * y2, wz = q[0] * z2, xx = q[1] * x2, xy = q[1] * y2, xz = q[1] * z2;
    pal_wide yy = q[2] * y2, yz = q[2] * z2, zz_estimator = q[3] * z2;
    r[0] = 1 - (yy + zz_estimator), r[1] = xy - wz, r[2] = xz + wy;
    r[3] = xy + wz, r[4] = 1 - (xx + zz_estimator), r[5] = yz - wx;
    r[6] = xz - wy, r[7] = yz + wx, r[8] = 1 - (xx + yy);
}

/* One Newton step for the rotation R that maximises R : F. With M = R'F and S its symmetric part, the step w (in the
 * frame of R) solves (tr M I - S) w = axial(M - M'); the matrix is positive definite at the maximum and near it. The
 * turn is Cayley's, q := q (1, w/2), which makes the iteration cubic. Lanes where the matrix is not safely positive
 * definite or the turn is large do not move and are set in `stuck`. Returns |w|^2. */
PAL_INLINE pal_wide hex_turn_step(const pal_wide f[9], const pal_wide r[9], pal_wide q[4], pal_wide_mask *stuck)
{
    pal_wide m[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) m[3 * i + j] = r[i] * f[j] + r[3 + i] * f[3 + j] + r[6 + i] * f[6 + j];
    pal_wide ax = m[7] - m[5], ay = m[2] - m[6], az = m[3] - m[1];
    pal_wide xx = m[4] + m[8], yy = m[0] + m[8], zz_estimator = m[0] + m[4];
    pal_wide yz = -0.5 * (m[5] + m[7]), xz = -0.5 * (m[2] + m[6]), xy = -0.5 * (m[1] + m[3]);
    pal_wide cxx = yy * zz_estimator - yz * yz, cyy = xx * zz_estimator - xz * xz, czz = xx * yy - xy * xy;
    pal_wide cxy = xz * yz - xy * zz_estimator, cxz = xy * yz - xz * yy, cyz = xy * xz - yz * xx;
    pal_wide det = xx * cxx + xy * cxy + xz * cxz, t = xx + yy + zz_estimator;
    pal_wide_mask good = (det > 1e-5 * (t * t * t)) & (t > 0) & (cxx + cyy + czz > 0) & (xx > 0) & (czz > 0);
    pal_wide half = 0.5 / pal_wide_select(good, det, wide_of(1));
    pal_wide wx = half * (cxx * ax + cxy * ay + cxz * az), wy = half * (cxy * ax + cyy * ay + cyz * az),
             wz = half * (cxz * ax + cyz * ay + czz * az);
    pal_wide w2 = wx * wx + wy * wy + wz * wz;
    good &= w2 < 0.25;
    *stuck |= ~good;
    wx = pal_wide_select(good, wx, wide_of(0)), wy = pal_wide_select(good, wy, wide_of(0)),
    wz = pal_wide_select(good, wz, wide_of(0));
    pal_wide a = q[0] - q[1] * wx - q[2] * wy - q[3] * wz, b = q[1] + q[0] * wx + q[2] * wz - q[3] * wy;
    pal_wide c = q[2] + q[0] * wy + q[3] * wx - q[1] * wz, d = q[3] + q[0] * wz + q[1] * wy - q[2] * wx;
    pal_wide n = wide_inverse_root(a * a + b * b + c * c + d * d);
    q[0] = a * n, q[1] = b * n, q[2] = c * n, q[3] = d * n;
    return pal_wide_select(good, w2, wide_of(0));
}

/* the rotations of f from q (warm start, in and out) into r; lanes of which `live` is not set have r = I. Returns the
 * number of lanes that vectors could not settle, which pal_polar_rotation has turned instead */
PAL_INLINE int hex_turn(const pal_wide f[9], pal_wide_mask live, pal_wide q[4], pal_wide r[9])
{
    /* a step of 6e-5 rad leaves 2e-13 of error: 0.65 times its cube, measured */
    const double settled = 1e-9;
    pal_wide_mask stuck = live & ~live;
    pal_wide g[9], w2;
    int n_slow = 0;
    for (int i = 0; i < 9; i++) g[i] = pal_wide_select(live, f[i], wide_of(i % 4 == 0));
    for (int n = 0; n < 8; n++) {
        wide_quat_matrix(q, r);
        w2 = hex_turn_step(g, r, q, &stuck);
        if (!wide_any(w2 > settled)) break;
    }
    stuck |= w2 > settled;
    if (wide_any(stuck)) {
        for (int l = 0; l < PAL_WIDE; l++) {
            if (!stuck[l]) continue;
            double fl[9], ql[4] = {q[0][l], q[1][l], q[2][l], q[3][l]};
            for (int i = 0; i < 9; i++) fl[i] = g[i][l];
            pal_polar_rotation(fl, ql, 200);
            for (int i = 0; i < 4; i++) q[i][l] = ql[i];
            n_slow++;
        }
    }
    wide_quat_matrix(q, r);
    return n_slow;
}

/* F at the centre from the modes, the rotations from it, force_cache in cubes->q */
PAL_INLINE int hex_turn_block(pal_elastic_hexes *cubes, int block, int l, pal_wide u[3][8], pal_wide r[9])
{
    const double scale = 1 / (4 * cubes->edge_m);
    double *at = cubes->q + 4 * PAL_LANES * block + l;
    pal_wide f[9], q[4];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) f[3 * i + j] = scale * u[i][1 << j];
    for (int i = 0; i < 4; i++) q[i] = pal_wide_load(at + i * PAL_LANES);
    pal_wide_mask live = pal_wide_load(cubes->share + PAL_LANES * block + l) > 0;
    int n_slow = hex_turn(f, live, q, r);
    for (int i = 0; i < 4; i++) pal_wide_store(at + i * PAL_LANES, q[i]);
    return n_slow;
}
#endif
