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

#ifndef HEX_VECTOR
#define HEX_VECTOR double
#define HEX_REAL   double
#endif

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

/* K in modes: u [3][8] becomes K u; mu, lambda, beta are the elements' times h / 16 */
PAL_INLINE void hex_stress(HEX_VECTOR mu, HEX_VECTOR lambda, HEX_VECTOR beta, HEX_VECTOR u[3][8])
{
    const HEX_VECTOR mu3 = mu * (HEX_REAL)(1.0 / 3), beta3 = beta * (HEX_REAL)(1.0 / 3),
                     top = (4 * mu + beta) * (HEX_REAL)(1.0 / 9);
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
    HEX_VECTOR twist = u[0][6] + u[1][5] + u[2][3];
    u[0][6] = mu3 * (u[0][6] + twist), u[1][5] = mu3 * (u[1][5] + twist), u[2][3] = mu3 * (u[2][3] + twist);
    u[0][7] = top * u[0][7], u[1][7] = top * u[1][7], u[2][7] = top * u[2][7];
}
#endif
