/* Linear and corotational voxel hexahedra: forces, energy, rotations, products with the tangent R K R'. The rest cube
 * is known (modes x, y, z of 4 h along their own axes), so that no rest positions are read.
 *
 * R is the polar part of F at the centre, which does not make the energy E = 1/2 (R'x - X) K (R'x - X) stationary when
 * the cube bends: -R K (R'x - X) alone is not its gradient and has a net torque of second order in the bending. What
 * is missing is added (turn_force): with dE = t.w for a turn w of R, t = -sum x_m cross g_m over the bending modes,
 * and (tr S I - S) w = axial(R' dF - dF' R), S = sym(R'F), it is a skew pair of forces on the modes x, y, z. The forces
 * are the gradient of E then and no body turns itself. The tangent leaves it out. */
#include "server/sim/elements/elastic_hex_simd.h"

/* coefficients of 8 lanes from l on */
PAL_INLINE void load_stiff(const pal_elastic_hexes *cubes, int block, int l, double k, pal_wide stiff[3])
{
    stiff[0] = k * pal_wide_load(cubes->mu + PAL_LANES * block + l);
    stiff[1] = k * pal_wide_load(cubes->lambda + PAL_LANES * block + l);
    stiff[2] = cubes->beta[0] * stiff[0] + cubes->beta[1] * stiff[1];
}

/* modes that are not in F at the centre */
static const int bent[4] = {3, 5, 6, 7};

/* g += the forces of the rotation's own change; x: coordinates in the frame of the cube, all but translation */
PAL_INLINE void turn_force(pal_wide x[3][8], pal_wide g[3][8])
{
    pal_wide tx = wide_of(0), ty = wide_of(0), tz = wide_of(0);
    for (int n = 0; n < 4; n++) {
        const int m = bent[n];
        tx += g[1][m] * x[2][m] - g[2][m] * x[1][m];
        ty += g[2][m] * x[0][m] - g[0][m] * x[2][m];
        tz += g[0][m] * x[1][m] - g[1][m] * x[0][m];
    }
    pal_wide xx = x[1][2] + x[2][4], yy = x[0][1] + x[2][4], zz_estimator = x[0][1] + x[1][2];
    pal_wide yz = -0.5 * (x[1][4] + x[2][2]), xz = -0.5 * (x[0][4] + x[2][1]), xy = -0.5 * (x[0][2] + x[1][1]);
    pal_wide cxx = yy * zz_estimator - yz * yz, cyy = xx * zz_estimator - xz * xz, czz = xx * yy - xy * xy;
    pal_wide cxy = xz * yz - xy * zz_estimator, cxz = xy * yz - xz * yy, cyz = xy * xz - yz * xx;
    pal_wide det = xx * cxx + xy * cxy + xz * cxz, t = xx + yy + zz_estimator;
    /* omitted where the rotation is nearly undefined: collapsed and inverted cubes */
    pal_wide_mask good = (det > 1e-3 * (t * t * t)) & (t > 0);
    pal_wide inverse = pal_wide_select(good, wide_of(1), wide_of(0)) / pal_wide_select(good, det, wide_of(1));
    pal_wide wx = inverse * (cxx * tx + cxy * ty + cxz * tz), wy = inverse * (cxy * tx + cyy * ty + cyz * tz);
    pal_wide wz = inverse * (cxz * tx + cyz * ty + czz * tz);
    g[2][2] += wx, g[1][4] -= wx;
    g[0][4] += wy, g[2][1] -= wy;
    g[1][1] += wz, g[0][2] -= wz;
}

enum { FORCE = 1, ENERGY = 2 };

/* forces are added, the energy is returned */
PAL_INLINE double all_blocks(pal_elastic_hexes *cubes, pal_node_order *node_order, bool turned, int what)
{
    pal_wide sum = {0};
    cubes->n_slow = 0;
    for (int b = 0; b < cubes->n_block; b++) {
        hex_view v;
        hex_open(cubes, node_order, b, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide u[3][8], x[3][8], r[9], stiff[3], e = {0};
            hex_modes(&v, l, u);
            if (turned) {
                cubes->n_slow += hex_turn_block(cubes, b, l, u, r);
                hex_unrotate(r, u);
            }
            memcpy(x, u, sizeof x);
            for (int i = 0; i < 3; i++) u[i][1 << i] -= 4 * cubes->edge_m;
            load_stiff(cubes, b, l, -1, stiff);
            hex_stress(stiff[0], stiff[1], stiff[2], u);
            for (int i = 0; i < 3 && (what & ENERGY); i++) {
                for (int m = 1; m < 8; m++)
                    e += m == 1 << i ? (x[i][m] - 4 * cubes->edge_m) * u[i][m] : x[i][m] * u[i][m];
            }
            /* lanes without an element may read numbers that are not finite */
            if (what & ENERGY) sum += pal_wide_select(stiff[0] < 0, e, wide_of(0));
            if (!(what & FORCE)) continue;
            if (turned) {
                turn_force(x, u);
                hex_rotate(r, u);
            }
            hex_add(&v, l, u);
        }
        if (what & FORCE) hex_close(cubes, node_order, b, &v);
    }
    double all = 0;
    for (int l = 0; l < PAL_WIDE; l++) all += sum[l];
    return -0.5 * all;
}

void pal_hex_corot_force(pal_elastic_hexes *cubes, pal_node_order *node_order)
{
    if (cubes->law == PAL_LAW_LINEAR)
        all_blocks(cubes, node_order, false, FORCE);
    else
        all_blocks(cubes, node_order, true, FORCE);
}

double pal_hex_corot_energy(pal_elastic_hexes *cubes, pal_node_order *node_order, bool forces)
{
    if (cubes->law == PAL_LAW_LINEAR)
        return forces ? all_blocks(cubes, node_order, false, FORCE | ENERGY)
                      : all_blocks(cubes, node_order, false, ENERGY);
    return forces ? all_blocks(cubes, node_order, true, FORCE | ENERGY) : all_blocks(cubes, node_order, true, ENERGY);
}

void pal_hex_corot_linearise(pal_elastic_hexes *cubes, pal_node_order *node_order)
{
    cubes->n_slow = 0;
    if (cubes->law == PAL_LAW_LINEAR) return;
    for (int b = 0; b < cubes->n_block; b++) {
        hex_view v;
        hex_open(cubes, node_order, b, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide u[3][8], r[9];
            hex_modes(&v, l, u);
            cubes->n_slow += hex_turn_block(cubes, b, l, u, r);
            for (int i = 0; i < 9; i++) pal_wide_store(cubes->turn + (9 * b + i) * PAL_LANES + l, r[i]);
        }
    }
}

PAL_INLINE void multiply_all(const pal_elastic_hexes *cubes, pal_node_order *node_order, double k, bool turned)
{
    for (int b = 0; b < cubes->n_block; b++) {
        hex_view v;
        hex_open(cubes, node_order, b, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide u[3][8], r[9], stiff[3];
            hex_modes(&v, l, u);
            for (int i = 0; i < 9 && turned; i++) r[i] = pal_wide_load(cubes->turn + (9 * b + i) * PAL_LANES + l);
            if (turned) hex_unrotate(r, u);
            load_stiff(cubes, b, l, k, stiff);
            hex_stress(stiff[0], stiff[1], stiff[2], u);
            if (turned) hex_rotate(r, u);
            hex_add(&v, l, u);
        }
        hex_close(cubes, node_order, b, &v);
    }
}

void pal_hex_corot_multiply(const pal_elastic_hexes *cubes, pal_node_order *node_order, double k)
{
    if (cubes->law == PAL_LAW_LINEAR)
        multiply_all(cubes, node_order, k, false);
    else
        multiply_all(cubes, node_order, k, true);
}

void pal_hex_corot_blocks(const pal_elastic_hexes *cubes, int block, double k, double *to)
{
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        pal_wide stiff[3], r[9];
        load_stiff(cubes, block, l, k, stiff);
        for (int i = 0; i < 9; i++) r[i] = pal_wide_load(cubes->turn + (9 * block + i) * PAL_LANES + l);
        for (int p = 0; p < 36; p++) {
            pal_wide a[9], t[9];
            for (int i = 0; i < 9; i++)
                a[i] = stiff[0] * cubes->reference[p][0][i] + stiff[1] * cubes->reference[p][1][i];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    t[3 * i + j] = r[3 * i] * a[j] + r[3 * i + 1] * a[3 + j] + r[3 * i + 2] * a[6 + j];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    pal_wide_store(to + (9 * p + 3 * i + j) * PAL_LANES + l,
                                   t[3 * i] * r[3 * j] + t[3 * i + 1] * r[3 * j + 1] + t[3 * i + 2] * r[3 * j + 2]);
        }
    }
}

/* K for mu = 1 and for lambda = 1, times 16 / h, in pairs of corners */
void pal_hex_fill_reference(pal_elastic_hexes *cubes)
{
    for (int part = 0; part < 2; part++)
        for (int d = 0; d < 8; d++)
            for (int j = 0; j < 3; j++) {
                pal_wide u[3][8] = {{{0}}};
                u[j][d] = wide_of(1);
                for (int i = 0; i < 3; i++) walsh(u[i]);
                hex_stress(wide_of(part == 0), wide_of(part == 1), wide_of(cubes->beta[part]), u);
                for (int i = 0; i < 3; i++) unwalsh(u[i]);
                for (int c = 0; c <= d; c++)
                    for (int i = 0; i < 3; i++) cubes->reference[pal_hex_pair(c, d)][part][3 * i + j] = u[i][c][0];
            }
}
