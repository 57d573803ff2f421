/* What is shown of voxel hexahedra: von Mises stress, energy density, strain, distortion and modulus at the Gauss point
 * nearest to each corner, which represents its weight of the cube, an eighth of a whole one; and the stress there, for
 * error estimates. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape_functions.h"
#include "server/sim/elements/elastic_hex.h"

#include <string.h>

/* one cube: its constants and the gradients at its points; out: stress at its points (corotational, linear: of the
 * small strain in the frame of the cube; neo-Hookean: Kirchhoff) and energy density */
typedef struct cube {
    bool bbar;
    double volume_m3;  /* by its share */
    double mu, lambda; /* Pa */
    double weight[8];  /* of the points, sum 1 */
    double f[8][9], r[9];
    double stress[8][9], density[8];
} cube;

/* stress (symmetric) and energy density of the small strain in the frame of the cube */
static double small_strain(const cube *q, double mean, const double e[9], double stress[9])
{
    double trace = e[0] + e[4] + e[8], square = 0;
    /* B-bar: the deviator of the point, the dilatation of the cube */
    double kappa = q->lambda + 2 * q->mu / 3, volume = q->bbar ? mean : trace;
    for (int i = 0; i < 9; i++) {
        double deviator = e[i] - (i % 4 == 0 ? trace / 3 : 0);
        square += deviator * deviator;
        stress[i] = 2 * q->mu * deviator + (i % 4 == 0 ? kappa * volume : 0);
    }
    return q->mu * square + 0.5 * kappa * volume * volume;
}

static void corot_points(cube *q)
{
    double e[8][9], mean = 0;
    for (int p = 0; p < 8; p++) {
        double m[9];
        pal_elastic_mul(m, q->r, true, q->f[p]);
        for (int i = 0; i < 9; i++) e[p][i] = 0.5 * (m[i] + m[3 * (i % 3) + i / 3]) - (i % 4 == 0);
        mean += q->weight[p] * (e[p][0] + e[p][4] + e[p][8]);
    }
    for (int p = 0; p < 8; p++) q->density[p] = small_strain(q, mean, e[p], q->stress[p]);
}

static void neo_points(cube *q)
{
    double mean = 0, kappa = q->bbar ? q->lambda + 2 * q->mu / 3 : 0, k1 = q->bbar ? q->mu / 3 : q->lambda + q->mu;
    for (int p = 0; p < 8; p++) mean += q->weight[p] * pal_det3(q->f[p]);
    for (int p = 0; p < 8; p++) {
        double stress[9];
        pal_neo_stress(q->mu, k1, kappa * (mean - 1), q->f[p], stress);
        pal_elastic_mult(q->stress[p], stress, q->f[p]);
        q->density[p] = pal_neo_energy(q->mu, k1, q->f[p]) + 0.5 * kappa * (mean - 1) * (mean - 1);
    }
}

/* sign of a corner in a mode, a set of axes */
static int sign_of(int mode, int corner)
{
    return __builtin_popcount((unsigned)(mode & ~corner)) % 2 ? -1 : 1;
}

/* the gradients at the points as the energy has them: with their weighted mean, and the rest of softer twists, which
 * are those in the frame of the cube */
static void soften(const pal_elastic_hexes *cubes, const int32_t *node, const double *d, const double grad[8][8][3],
                   cube *at)
{
    const double less = (1 - sqrt(cubes->twist)) / 8, scale = 2 / cubes->edge_m;
    double off[8][9] = {{0}}, mean[9] = {0}, turned[9];
    for (int i = 0; i < 3; i++)
        for (int kind = 0; kind < 2; kind++) {
            const int mode = kind ? 7 : 7 ^ 1 << i;
            double size = 0;
            for (int c = 0; c < 24; c++)
                size += at->r[c % 3 * 3 + i] * d[3 * node[c / 3] + c % 3] * sign_of(mode, c / 3);
            for (int k = 0; k < 192; k++) {
                const int p = k / 24, c = k / 3 % 8, j = k % 3;
                off[p][3 * i + j] += less * size * sign_of(mode, c) * scale * grad[p][c][j];
            }
        }
    for (int p = 0; p < 8; p++)
        for (int i = 0; i < 9; i++) mean[i] += at->weight[p] * off[p][i];
    for (int p = 0; p < 8; p++) {
        for (int i = 0; i < 9; i++) off[p][i] = mean[i] - off[p][i];
        pal_elastic_mul(turned, at->r, false, off[p]);
        for (int i = 0; i < 9; i++) at->f[p][i] += turned[i];
    }
}

static void take_cube(const pal_elastic_hexes *cubes, const pal_body *body, int e, const double grad[8][8][3], cube *at)
{
    const double h = cubes->edge_m;
    const int32_t *node = cubes->hexes->node + 8 * e;
    int lane = cubes->simd_blocks.place[e], block = lane / PAL_LANES, l = lane % PAL_LANES;
    double share = cubes->share[lane], centre[9] = {0}, q[4];
    *at = (cube){.bbar = cubes->element == PAL_HEX_BBAR,
                 .volume_m3 = share * h * h * h,
                 .mu = (cubes->recovery ? cubes->whole[0] : cubes->mu)[lane] * 16 / (h * share),
                 .lambda = (cubes->recovery ? cubes->whole[1] : cubes->lambda)[lane] * 16 / (h * share)};
    pal_hex_weights(cubes, lane, at->weight);
    for (int p = 0; p < 8; p++)
        for (int i = 0; i < 9; i++) {
            for (int c = 0; c < 8; c++) at->f[p][i] += 2 / h * body->d[3 * node[c] + i / 3] * grad[p][c][i % 3];
            centre[i] += at->f[p][i] / 8;
        }
    for (int i = 0; i < 4; i++)
        q[i] = cubes->law == PAL_LAW_LINEAR ? i == 0 : cubes->q[(4 * block + i) * PAL_LANES + l];
    if (cubes->law == PAL_LAW_COROTATIONAL) pal_polar_rotation(centre, q, 50);
    pal_quat_matrix(q, at->r);
    if (cubes->twist < 1) soften(cubes, node, body->d, grad, at);
    if (cubes->law == PAL_LAW_NEO_HOOKEAN)
        neo_points(at);
    else
        corot_points(at);
}

static double von_mises(const pal_elastic_hexes *cubes, const cube *at, int p)
{
    if (cubes->law != PAL_LAW_NEO_HOOKEAN) return pal_von_mises(at->stress[p]);
    double det = fmax(fabs(pal_det3(at->f[p])), 1e-3), cauchy[9];
    for (int i = 0; i < 9; i++) cauchy[i] = at->stress[p][i] / det;
    return pal_von_mises(cauchy);
}

void pal_hex_measure(pal_elastic_hexes *cubes, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    double grad[8][8][3];
    if (!(PAL_ELASTIC_FIELDS >> field & 1)) return;
    for (int p = 0; p < 8; p++) pal_hex_shape(pal_hex_gauss[p], NULL, grad[p]);
    for (int e = 0; e < cubes->n_hex; e++) {
        const int32_t *node = cubes->hexes->node + 8 * e;
        cube at;
        take_cube(cubes, body, e, (const double(*)[8][3])grad, &at);
        for (int c = 0; c < 8; c++) {
            const double volume = at.weight[c] * at.volume_m3;
            sum[node[c]] += volume * (field == PAL_FIELD_VON_MISES_PA  ? von_mises(cubes, &at, c)
                                      : field == PAL_FIELD_ENERGY_J_M3 ? at.density[c]
                                      : field == PAL_FIELD_YOUNG_PA    ? pal_lame_young_Pa(at.mu, at.lambda)
                                      : field == PAL_FIELD_STRAIN      ? pal_largest_strain(at.f[c])
                                                                       : pal_det3(at.f[c]) - 1);
            volume_m3[node[c]] += volume;
        }
    }
}

void pal_hex_stress(pal_elastic_hexes *cubes, const pal_body *body, pal_stress_take *take, void *user)
{
    double grad[8][8][3], shape[8][8];
    for (int p = 0; p < 8; p++) pal_hex_shape(pal_hex_gauss[p], shape[p], grad[p]);
    for (int e = 0; e < cubes->n_hex; e++) {
        cube at;
        take_cube(cubes, body, e, (const double(*)[8][3])grad, &at);
        pal_stress_point to = {
            .element = e, .n_corner = 8, .node = cubes->hexes->node + 8 * e, .mu_Pa = at.mu, .lambda_Pa = at.lambda};
        for (int p = 0; p < 8; p++) {
            double half[9];
            to.volume_m3 = at.weight[p] * at.volume_m3;
            to.shape = shape[p];
            memcpy(to.stress, at.stress[p], sizeof to.stress);
            pal_elastic_mul(half, at.r, false, at.stress[p]);
            if (cubes->law != PAL_LAW_NEO_HOOKEAN) pal_elastic_mult(to.stress, half, at.r);
            take(user, &to);
        }
    }
}
