/* Modes of the voxel hexahedra, for vectors HEX_VECTOR of numbers HEX_REAL: included by elastic_hex_simd.h (double) and
 * elastic_hex_single.c (float), and nowhere else; alone it is the version for one element.
 *
 * A cube's corners c are at the signs s_j(c) of the axes j = x, y, z. Its trilinear field is kept as the
 * coefficients of the eight monomials (modes) m = a set of axes, numbered like corners (x = 1, y = 2, z = 4),
 *     u(xi) = 1/8 sum_m U_m prod_{j in m} xi_j,   U_m = sum_c u_c prod_{j in m} s_j(c),
 * a Walsh transform: 24 additions per component, its own inverse but for the factor 8. The cube's mirror symmetries
 * leave K with blocks of at most three modes then, so that K u takes about fifty operations instead of 24 x 24 products
 * (stress below; the same K as by Gauss points, tested). Rotations act on the components of each mode alike.
 *
 * With e the strain of the field and <> the mean over the cube of volume V, twice the energy is
 *     V (2 mu <e:e> + lambda <tr e>^2 + beta (<(tr e)^2> - <tr e>^2)),
 * beta = lambda for full integration, -2/3 mu for B-bar (Hughes 1980).
 *
 * Thread: [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_MODES_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_MODES_H
#include "server/sim/core/simd_blocks.h"

#include <math.h>

#ifndef HEX_VECTOR
#define HEX_VECTOR double
#define HEX_REAL   double
#endif
/* 1 / sqrt 3: the Gauss points */
#define HEX_GAUSS 0.57735026918962576451

PAL_INLINE void walsh_pair(HEX_VECTOR *low, HEX_VECTOR *high)
{
    HEX_VECTOR sum = *high + *low;
    *high = *high - *low;
    *low = sum;
}
/* corners to modes */
PAL_INLINE void walsh(HEX_VECTOR u[8])
{
    walsh_pair(u + 0, u + 1), walsh_pair(u + 2, u + 3), walsh_pair(u + 4, u + 5), walsh_pair(u + 6, u + 7);
    walsh_pair(u + 0, u + 2), walsh_pair(u + 1, u + 3), walsh_pair(u + 4, u + 6), walsh_pair(u + 5, u + 7);
    walsh_pair(u + 0, u + 4), walsh_pair(u + 1, u + 5), walsh_pair(u + 2, u + 6), walsh_pair(u + 3, u + 7);
}
PAL_INLINE void unwalsh_pair(HEX_VECTOR *low, HEX_VECTOR *high)
{
    HEX_VECTOR sum = *low + *high;
    *low = *low - *high;
    *high = sum;
}
/* modes to corners, the transposed transform; mode 0 (a force on the whole) is none */
PAL_INLINE void unwalsh(HEX_VECTOR u[8])
{
    u[0] = -u[1];
    unwalsh_pair(u + 2, u + 3), unwalsh_pair(u + 4, u + 5), unwalsh_pair(u + 6, u + 7);
    unwalsh_pair(u + 0, u + 2), unwalsh_pair(u + 1, u + 3), unwalsh_pair(u + 4, u + 6), unwalsh_pair(u + 5, u + 7);
    unwalsh_pair(u + 0, u + 4), unwalsh_pair(u + 1, u + 5), unwalsh_pair(u + 2, u + 6), unwalsh_pair(u + 3, u + 7);
}

/* gradients at the Gauss points from the modes; point p at the signs of its bits */
PAL_INLINE void hex_gradients(HEX_REAL scale, HEX_VECTOR u[3][8], HEX_VECTOR f[8][9])
{
    const HEX_REAL gauss = (HEX_REAL)HEX_GAUSS;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int self = 1 << j, a = 1 << (j + 1) % 3, b = 1 << (j + 2) % 3;
            HEX_VECTOR c0 = scale * u[i][self], ca = (gauss * scale) * u[i][self | a];
            HEX_VECTOR cb = (gauss * scale) * u[i][self | b], cab = (gauss * gauss * scale) * u[i][7];
            HEX_VECTOR low = c0 - ca, high = c0 + ca, low_b = cb - cab, high_b = cb + cab;
            f[0][3 * i + j] = f[self][3 * i + j] = low - low_b;
            f[a][3 * i + j] = f[a | self][3 * i + j] = high - high_b;
            f[b][3 * i + j] = f[b | self][3 * i + j] = low + low_b;
            f[a | b][3 * i + j] = f[7][3 * i + j] = high + high_b;
        }
}
/* the transposed: sums over the points of p_ij times the modes' gradients, modes 1..7 */
PAL_INLINE void hex_sums(HEX_REAL scale, HEX_VECTOR p[8][9], HEX_VECTOR u[3][8])
{
    const HEX_REAL gauss = (HEX_REAL)HEX_GAUSS;
    for (int i = 0; i < 3; i++) {
        for (int m = 0; m < 8; m++) u[i][m] = (HEX_VECTOR){0};
        for (int j = 0; j < 3; j++) {
            const int self = 1 << j, a = 1 << (j + 1) % 3, b = 1 << (j + 2) % 3, ij = 3 * i + j;
            HEX_VECTOR s0 = p[0][ij] + p[self][ij], sa = p[a][ij] + p[a | self][ij];
            HEX_VECTOR sb = p[b][ij] + p[b | self][ij], sab = p[a | b][ij] + p[7][ij];
            HEX_VECTOR low = s0 + sa, high = sb + sab, low_a = sa - s0, high_a = sab - sb;
            u[i][self] += scale * (low + high);
            u[i][self | a] += (gauss * scale) * (low_a + high_a);
            u[i][self | b] += (gauss * scale) * (high - low);
            u[i][7] += (gauss * gauss * scale) * (high_a - low_a);
        }
    }
}

/* K in modes: u [3][8] becomes K u; mu, lambda, beta are the elements' times h / 16; twist: factor on the stiffness of
 * the modes in which the cube twists about an axis or an axis bends two ways (elastic_hex.h) */
PAL_INLINE void hex_stress(HEX_VECTOR mu, HEX_VECTOR lambda, HEX_VECTOR beta, HEX_REAL twist, HEX_VECTOR u[3][8])
{
    const HEX_VECTOR mu3 = twist * mu * (HEX_REAL)(1.0 / 3), beta3 = beta * (HEX_REAL)(1.0 / 3),
                     top = twist * (4 * mu + beta) * (HEX_REAL)(1.0 / 9);
    /* stretches */
    HEX_VECTOR trace = lambda * (u[0][1] + u[1][2] + u[2][4]), mu2 = mu + mu;
    u[0][1] = mu2 * u[0][1] + trace, u[1][2] = mu2 * u[1][2] + trace, u[2][4] = mu2 * u[2][4] + trace;
    /* shears */
    u[0][2] = u[1][1] = mu * (u[0][2] + u[1][1]);
    u[1][4] = u[2][2] = mu * (u[1][4] + u[2][2]);
    u[2][1] = u[0][4] = mu * (u[2][1] + u[0][4]);
    /* bending: axis i grows along i and j */
    HEX_VECTOR dx = beta3 * (u[1][3] + u[2][5]), dy = beta3 * (u[0][3] + u[2][6]), dz = beta3 * (u[0][5] + u[1][6]);
    u[1][3] = mu * u[1][3] + dx, u[2][5] = mu * u[2][5] + dx;
    u[0][3] = mu * u[0][3] + dy, u[2][6] = mu * u[2][6] + dy;
    u[0][5] = mu * u[0][5] + dz, u[1][6] = mu * u[1][6] + dz;
    /* twists */
    HEX_VECTOR turn = u[0][6] + u[1][5] + u[2][3];
    u[0][6] = mu3 * (u[0][6] + turn), u[1][5] = mu3 * (u[1][5] + turn), u[2][3] = mu3 * (u[2][3] + turn);
    u[0][7] = top * u[0][7], u[1][7] = top * u[1][7], u[2][7] = top * u[2][7];
}

/* s = 2 mu sym(g) + pressure tr(g) I */
PAL_INLINE void hex_small_stress(HEX_VECTOR mu, HEX_VECTOR pressure, const HEX_VECTOR g[9], HEX_VECTOR s[9])
{
    const HEX_VECTOR mean = pressure * (g[0] + g[4] + g[8]), mu2 = mu + mu;
    s[0] = mu2 * g[0] + mean, s[4] = mu2 * g[4] + mean, s[8] = mu2 * g[8] + mean;
    s[1] = s[3] = mu * (g[1] + g[3]);
    s[2] = s[6] = mu * (g[2] + g[6]);
    s[5] = s[7] = mu * (g[5] + g[7]);
}

/* the twisting modes times sqrt(twist) */
PAL_INLINE void hex_soften(HEX_REAL twist, HEX_VECTOR u[3][8])
{
    const HEX_REAL root = (HEX_REAL)sqrt((double)twist);
    for (int i = 0; i < 3; i++) {
        u[i][7 ^ 1 << i] *= root;
        u[i][7] *= root;
    }
}

/* The weighted means over the points of the gradients of u's modes but the linear ones; moment [8]: transformed weights
 */
PAL_INLINE void hex_bent_means(const HEX_VECTOR moment[8], HEX_VECTOR u[3][8], HEX_VECTOR mean[9])
{
    const HEX_REAL gauss = (HEX_REAL)HEX_GAUSS;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int self = 1 << j, a = 1 << (j + 1) % 3, b = 1 << (j + 2) % 3;
            mean[3 * i + j] = gauss * (moment[a] * u[i][self | a] + moment[b] * u[i][self | b]) +
                              (gauss * gauss) * (moment[a | b] * u[i][7]);
        }
}

/* The same K u of cut elements: the points have weights p (sum 1), with G_q the gradients at them, G = sum p_q G_q and
 * D_q = G_q - G twice the energy is
 *     V (2 mu e(G):e(G) + lambda (tr G)^2 + sum p_q (2 mu e(D_q):e(D_q) + beta (tr D_q)^2)).
 * D_q of the field with its twisting modes times sqrt(twist). p_q = 1/8 is hex_stress. Linear fields have D_q = 0
 * whatever the weights, so constant strain stays exact. */
PAL_INLINE void hex_cut_stress(HEX_VECTOR mu, HEX_VECTOR lambda, HEX_VECTOR beta, HEX_REAL twist, const HEX_VECTOR p[8],
                               HEX_VECTOR u[3][8])
{
    const HEX_REAL gauss = (HEX_REAL)HEX_GAUSS;
    HEX_VECTOR moment[8], mean[9], g[9], s[9], d[8][9];
    for (int q = 0; q < 8; q++) moment[q] = p[q];
    walsh(moment);
    hex_bent_means(moment, u, mean);
    for (int i = 0; i < 9; i++) g[i] = u[i / 3][1 << i % 3] + mean[i];
    if (twist < 1) {
        hex_soften(twist, u);
        hex_bent_means(moment, u, mean);
    }
    for (int i = 0; i < 9; i++) u[i / 3][1 << i % 3] = -mean[i];
    hex_gradients(1, u, d);
    for (int q = 0; q < 8; q++) hex_small_stress(p[q] * mu, p[q] * beta, d[q], d[q]);
    hex_sums(1, d, u);
    hex_soften(twist, u);
    hex_small_stress(mu, lambda, g, s);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int self = 1 << j, a = 1 << (j + 1) % 3, b = 1 << (j + 2) % 3;
            u[i][self] = s[3 * i + j]; /* the fluctuations have none */
            u[i][self | a] += gauss * moment[a] * s[3 * i + j];
            u[i][self | b] += gauss * moment[b] * s[3 * i + j];
            u[i][7] += (gauss * gauss) * moment[a | b] * s[3 * i + j];
        }
}
#endif
