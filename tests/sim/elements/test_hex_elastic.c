/* Component hex_elastic: laws, tangents, patch tests, invariance. */
#include "tests/fixtures/hex_bodies.h"
#include "tests/fixtures/hex_stiffness.h"
#include "tests/fixtures/neo_hessian.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape_functions.h"

static const char *const elements[2] = {"hex8_bbar", "hex8"};
static const char *const laws[3] = {"corotational", "linear", "neo_hookean"};

static void begin(hex_body *b, int nx, int ny, int nz, bool (*keep)(int, int, int), const char *element,
                  const char *law)
{
    const int n[3] = {nx, ny, nz};
    hex_body_begin(b, n, keep, 0.01);
    pal_entry_put_text(&b->item, "element", element, NULL);
    pal_entry_put_text(&b->item, "law", law, NULL);
}

/* K of one voxel by num/shape, times E, nu, h and share */
static void dense(int bbar, double young_Pa, double poisson, double edge_m, double share, double k[576])
{
    double shear[576], volume[576], mu, lambda;
    pal_lame(young_Pa, poisson, &mu, &lambda);
    hex_stiffness(bbar, shear, volume);
    for (int i = 0; i < 576; i++)
        k[i] = share * edge_m * (mu * shear[i] + (bbar ? lambda + 2 * mu / 3 : lambda) * volume[i]);
}

static void product_is_that_of_the_integrated_stiffness(void)
{
    for (int bbar = 0; bbar < 2; bbar++)
        for (int odd = 0; odd < 2; odd++) {
            hex_body b;
            begin(&b, odd ? 5 : 9, 4, 3, odd ? hex_irregular : NULL, elements[!bbar], "linear");
            uint64_t seed = 3;
            for (int e = 0; e < b.hexes.n_hex; e++) b.hexes.fill[e] = (float)(0.5 + 0.5 * hex_random(&seed));
            b.def->material.poisson = odd ? 0.2 : 0.49;
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = 3 * b.body.n_node;
            double *p = hex_zeros(n), *out = hex_zeros(n);
            double *want = hex_zeros(n), k[576];
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed), want[i] = out[i] = hex_random(&seed);
            hex_effect->tangent->linearise(b.row, &b.body);
            hex_effect->tangent->multiply(b.row, &b.body, 0.7, p, out);
            for (int e = 0; e < b.hexes.n_hex; e++) {
                dense(bbar, 5000, b.def->material.poisson, 0.01, fmax(0.02, (double)b.hexes.fill[e]), k);
                const int32_t *node = b.hexes.node + 8 * e;
                for (int i = 0; i < 24; i++)
                    for (int j = 0; j < 24; j++)
                        want[3 * node[i / 3] + i % 3] += 0.7 * k[24 * i + j] * p[3 * node[j / 3] + j % 3];
            }
            CHECK_LE(hex_farthest(out, want, n), 1e-12 * hex_largest(want, n));
            free(p), free(out), free(want);
            hex_body_free(&b);
        }
}

/* -R K (R'x - X), one voxel after the other, without the turning rotation's part; returns the energy */
static double plain_force(const hex_body *b, int bbar, const double *x, double *f)
{
    double k[576], turn[9], energy = 0;
    for (int e = 0; e < b->hexes.n_hex; e++) {
        const int32_t *node = b->hexes.node + 8 * e;
        double deform[9] = {0}, q[4] = {1, 0, 0, 0}, u[24];
        dense(bbar, b->def->material.young_Pa, b->def->material.poisson, b->tets.edge_m, b->hexes.fill[e], k);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++)
                deform[i] += x[3 * node[c] + i / 3] * (c >> i % 3 & 1 ? 0.25 : -0.25) / b->tets.edge_m;
        pal_polar_rotation(deform, q, 100);
        pal_quat_matrix(q, turn);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 3; i++) {
                u[3 * c + i] = -b->body.x_rest[3 * node[c] + i];
                for (int j = 0; j < 3; j++) u[3 * c + i] += turn[3 * j + i] * x[3 * node[c] + j];
            }
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 24; j++) {
                energy += 0.5 * u[i] * k[24 * i + j] * u[j];
                for (int r = 0; r < 3; r++) f[3 * node[i / 3] + r] -= turn[3 * r + i % 3] * k[24 * i + j] * u[j];
            }
    }
    return energy;
}

/* forces of an affine state, which have no turning part; the energy of any state */
static void corotational_force_is_that_of_one_voxel_at_a_time(void)
{
    for (int bbar = 0; bbar < 2; bbar++) {
        hex_body b;
        begin(&b, 9, 3, 2, NULL, elements[!bbar], "corotational");
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        int n = 3 * b.body.n_node;
        double *want = hex_zeros(n);
        static const double affine[9] = {0.3, -1.1, 0.2, 0.9, 0.4, -0.3, 0.1, 0.3, 1.2};
        for (int i = 0; i < n; i++) {
            b.body.x[i] = 0.1;
            for (int j = 0; j < 3; j++) b.body.x[i] += affine[3 * (i % 3) + j] * b.body.x_rest[i / 3 * 3 + j];
        }
        plain_force(&b, bbar, b.body.x, want);
        const double *f = hex_force(&b);
        CHECK_LE(hex_farthest(f, want, n), 1e-12 * hex_largest(want, n));
        for (int i = 0; i < 3; i++) {
            hex_shake(&b, 0.1 + 0.1 * i, 40);
            double energy = plain_force(&b, bbar, b.body.x, want);
            CHECK_NEAR(hex_energy(&b), energy, 1e-12 * energy);
        }
        free(want);
        hex_body_free(&b);
    }
}

static void rotated_tangent_is_that_of_one_voxel_at_a_time(void)
{
    hex_body b;
    begin(&b, 2, 1, 1, NULL, "hex8_bbar", "corotational");
    REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
    hex_shake(&b, 0.2, 8);
    double p[36], got[36] = {0}, want[36] = {0}, k[576];
    uint64_t seed = 4;
    for (int i = 0; i < 36; i++) p[i] = hex_random(&seed);
    hex_effect->tangent->linearise(b.row, &b.body);
    hex_effect->tangent->multiply(b.row, &b.body, 1, p, got);
    dense(1, 5000, 0.45, 0.01, 1, k);
    for (int e = 0; e < 2; e++) {
        const int32_t *node = b.hexes.node + 8 * e;
        double deform[9] = {0}, q[4] = {1, 0, 0, 0}, r[9], u[24] = {0}, g[24] = {0};
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++) deform[i] += b.body.x[3 * node[c] + i / 3] * (c >> i % 3 & 1 ? 25 : -25);
        pal_polar_rotation(deform, q, 100);
        pal_quat_matrix(q, r);
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 3; j++) u[i] += r[3 * j + i % 3] * p[3 * node[i / 3] + j];
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 24; j++) g[i] += k[24 * i + j] * u[j];
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 3; j++) want[3 * node[i / 3] + i % 3] += r[3 * (i % 3) + j] * g[i / 3 * 3 + j];
    }
    CHECK_LE(hex_farthest(got, want, 36), 1e-11 * hex_largest(want, 36));
    hex_body_free(&b);
}

static void force_is_minus_the_gradient_of_the_energy(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 3, 2, 2, hex_irregular, elements[element], laws[law]);
            b.def->material.poisson = 0.4;
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_shake(&b, 0.15, 5);
            int n = 3 * b.body.n_node;
            double *f = hex_zeros(n);
            memcpy(f, hex_force(&b), sizeof *f * (size_t)n);
            double max = hex_largest(f, n), worst = 0;
            for (int i = 0; i < n; i++) {
                double x = b.body.x[i], step = 1e-7, e[2];
                for (int s = 0; s < 2; s++) {
                    b.body.x[i] = s ? x + step : x - step;
                    e[s] = hex_energy(&b);
                }
                b.body.x[i] = x;
                worst = fmax(worst, fabs((e[1] - e[0]) / (2 * step) + f[i]));
            }
            CHECK_LE(worst, 1e-6 * max);
            free(f);
            hex_body_free(&b);
        }
}

static void product_and_assembled_matrix_agree(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 5, 4, 3, hex_irregular, elements[element], laws[law]);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_check_product(&b);
            hex_body_free(&b);
        }
}

/* p'K p >= 0 and K symmetric, also far from rest */
static void tangent_is_symmetric_and_semi_definite(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 3, 2, 2, NULL, elements[element], laws[law]);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = 3 * b.body.n_node;
            double *p = hex_zeros(n), *q = hex_zeros(n);
            double *kp = hex_zeros(n), *kq = hex_zeros(n);
            for (int state = 0; state < 4; state++) {
                hex_shake(&b, state < 3 ? 0.3 * state : 5, 7 + (uint64_t)state);
                hex_effect->tangent->linearise(b.row, &b.body);
                uint64_t seed = 11;
                for (int t = 0; t < 30; t++) {
                    double pkp = 0, pkq = 0, qkp = 0, size = 0;
                    for (int i = 0; i < n; i++) p[i] = hex_random(&seed), q[i] = hex_random(&seed), kp[i] = kq[i] = 0;
                    /* towards the least eigenvalue as well */
                    for (int s = 0; s < 20 && t < 5; s++) {
                        memset(kp, 0, sizeof *kp * (size_t)n);
                        hex_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
                        double max = hex_largest(kp, n) / hex_largest(p, n);
                        for (int i = 0; i < n; i++) p[i] -= kp[i] / (3 * max + 1e-300);
                    }
                    memset(kp, 0, sizeof *kp * (size_t)n);
                    hex_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
                    hex_effect->tangent->multiply(b.row, &b.body, 1, q, kq);
                    for (int i = 0; i < n; i++) {
                        pkp += p[i] * kp[i], pkq += p[i] * kq[i], qkp += q[i] * kp[i];
                        size += fabs(p[i] * kq[i]) + fabs(q[i] * kp[i]);
                    }
                    CHECK(pkp >= -1e-12 * size);
                    CHECK_NEAR(pkq, qkp, 1e-12 * size);
                }
            }
            free(p), free(q), free(kp), free(kq);
            hex_body_free(&b);
        }
}

/* pulled on all sides a little: nothing is projected there, so that the tangent is the force's derivative */
static void neo_hookean_tangent_is_the_derivative_of_the_force(void)
{
    for (int element = 0; element < 2; element++) {
        hex_body b;
        begin(&b, 3, 2, 2, NULL, elements[element], "neo_hookean");
        b.def->material.poisson = 0.3;
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        int n = 3 * b.body.n_node;
        hex_shake(&b, 0.01, 12);
        for (int i = 0; i < n; i++) b.body.x[i] *= 1.06;
        double *p = hex_zeros(n), *x = hex_zeros(n);
        double *kp = hex_zeros(n), *diff = hex_zeros(n);
        uint64_t seed = 2;
        for (int i = 0; i < n; i++) p[i] = hex_random(&seed), x[i] = b.body.x[i];
        hex_effect->tangent->linearise(b.row, &b.body);
        hex_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
        for (int s = -1; s <= 1; s += 2) {
            for (int i = 0; i < n; i++) b.body.x[i] = x[i] + s * 1e-8 * p[i];
            const double *f = hex_force(&b);
            for (int i = 0; i < n; i++) diff[i] -= s * f[i] / 2e-8;
        }
        CHECK_LE(hex_farthest(kp, diff, n), 1e-6 * hex_largest(kp, n));
        free(p), free(x), free(kp), free(diff);
        hex_body_free(&b);
    }
}

/* K p of one voxel from the points' projected Hessians one at a time (elastic_law) and the mean's rank one */
static void plain_neo_product(const hex_body *b, int bbar, const int32_t *node, const double *p, double *out)
{
    const double h = b->tets.edge_m, volume = h * h * h;
    double mu, lambda, grad[8][8][3], f[8][9] = {{0}}, df[9], dp[9], mean[24] = {0}, ratio = 0, along = 0;
    pal_lame(b->def->material.young_Pa, b->def->material.poisson, &mu, &lambda);
    double k1 = bbar ? mu / 3 : lambda + mu, kappa = bbar ? lambda + 2 * mu / 3 : 0;
    for (int g = 0; g < 8; g++) {
        double cof[9];
        pal_hex_shape(pal_hex_gauss[g], NULL, grad[g]);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++) f[g][i] += 2 / h * b->body.x[3 * node[c] + i / 3] * grad[g][c][i % 3];
        pal_cofactor3(f[g], cof);
        ratio += pal_det3(f[g]) / 8;
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++) mean[3 * c + i / 3] += cof[i] * 2 / h * grad[g][c][i % 3] / 8;
    }
    for (int i = 0; i < 24; i++) along += mean[i] * p[3 * node[i / 3] + i % 3];
    for (int i = 0; i < 24; i++) out[3 * node[i / 3] + i % 3] += kappa * volume * along * mean[i];
    for (int g = 0; g < 8; g++) {
        neo_modes modes;
        memset(df, 0, sizeof df);
        neo_modes_compute(mu, k1, kappa * (ratio - 1), f[g], &modes);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++) df[i] += 2 / h * p[3 * node[c] + i / 3] * grad[g][c][i % 3];
        neo_modes_apply(&modes, df, dp);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 9; i++) out[3 * node[c] + i / 3] += volume / 8 * dp[i] * 2 / h * grad[g][c][i % 3];
    }
}

/* states near rest, with many eigenvalues projected, with inverted points */
static void neo_hookean_tangent_is_that_of_one_point_at_a_time(void)
{
    static const double noise[4] = {0.001, 0.05, 0.3, 2};
    for (int element = 0; element < 2; element++)
        for (int state = 0; state < 4; state++) {
            hex_body b;
            begin(&b, 5, 3, 2, NULL, elements[element], "neo_hookean");
            b.def->material.poisson = 0.4;
            /* points of inverted voxels are asked for as well */
            pal_entry_put_bool(&b.item, "recover", false, NULL);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = 3 * b.body.n_node;
            double *p = hex_zeros(n), *got = hex_zeros(n), *want = hex_zeros(n);
            uint64_t seed = 21;
            hex_shake(&b, noise[state], 60);
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed);
            hex_effect->tangent->linearise(b.row, &b.body);
            hex_effect->tangent->multiply(b.row, &b.body, 1, p, got);
            for (int e = 0; e < b.hexes.n_hex; e++) plain_neo_product(&b, !element, b.hexes.node + 8 * e, p, want);
            CHECK_LE(hex_farthest(got, want, n), 1e-10 * hex_largest(want, n));
            free(p), free(got), free(want);
            hex_body_free(&b);
        }
}

static void neo_hookean_at_rest_is_the_linear_element(void)
{
    for (int element = 0; element < 2; element++) {
        hex_body b[2];
        double *kp[2], *p = NULL;
        int n = 0;
        for (int law = 0; law < 2; law++) {
            begin(&b[law], 3, 2, 2, NULL, elements[element], law ? "neo_hookean" : "linear");
            b[law].def->material.poisson = 0.47;
            REQUIRE(hex_body_make(&b[law]) == PAL_ERR_OK);
            n = 3 * b[law].body.n_node;
            uint64_t seed = 31;
            if (!p) p = hex_zeros(n);
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed);
            kp[law] = hex_zeros(n);
            hex_effect->tangent->linearise(b[law].row, &b[law].body);
            hex_effect->tangent->multiply(b[law].row, &b[law].body, 1, p, kp[law]);
        }
        CHECK_LE(hex_farthest(kp[0], kp[1], n), 1e-9 * hex_largest(kp[0], n));
        free(p), free(kp[0]), free(kp[1]);
        hex_body_free(&b[0]), hex_body_free(&b[1]);
    }
}

static bool whole_inside(const hex_body *b, int node)
{
    int n = 0;
    for (int i = 0; i < 8 * b->hexes.n_hex; i++) n += b->hexes.node[i] == node;
    return n == 8;
}

static bool holes(int i, int j, int k)
{
    return (i != 2 || j != 2 || k > 1) && i + j + k < 11 && !(i == 0 && j == 0);
}

/* boundary nodes on a linear field, the others solved for: they are on it too. Regions name the same material again */
static void linear_field_is_exact_on_voxels_with_holes(void)
{
    static const double field[9] = {0.011, 0.007, -0.004, 0.003, -0.013, 0.008, -0.006, 0.002, 0.009};
    for (int element = 0; element < 2; element++) {
        hex_body b;
        begin(&b, 5, 5, 5, holes, elements[element], "linear");
        b.def->material.poisson = 0.3;
        b.def->n_region = 1;
        b.def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                        .young_Pa = 5000,
                                        .poisson = 0.3,
                                        .density_kg_m3 = NAN,
                                        .high_m = {0.025, 0.05, 0.05}};
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        int n = 3 * b.body.n_node, n_free = 0;
        uint8_t *loose = calloc((size_t)b.body.n_node, 1);
        double *u = hex_zeros(n), *want = hex_zeros(n);
        double *zero = hex_zeros(n);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < 3; j++) want[i] += field[3 * (i % 3) + j] * b.body.x_rest[i / 3 * 3 + j];
        for (int i = 0; i < b.body.n_node; i++) n_free += loose[i] = whole_inside(&b, i);
        CHECK_LE(20, n_free);
        for (int i = 0; i < n; i++) u[i] = loose[i / 3] ? 0 : want[i];
        hex_effect->tangent->linearise(b.row, &b.body);
        hex_solve(&b, loose, 0, zero, u);
        CHECK_LE(hex_farthest(u, want, n), 1e-9 * hex_largest(want, n));
        free(loose), free(u), free(want), free(zero);
        hex_body_free(&b);
    }
}

/* any affine state, rotated and stretched by half: no forces within */
static void affine_state_has_no_force_within(void)
{
    static const double affine[9] = {0.3, -1.3, 0.2, 0.9, 0.4, -0.3, 0.1, 0.3, 1.2};
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 5, 5, 5, holes, elements[element], laws[law]);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = 3 * b.body.n_node;
            for (int i = 0; i < n; i++) {
                b.body.x[i] = 0;
                for (int j = 0; j < 3; j++) b.body.x[i] += affine[3 * (i % 3) + j] * b.body.x_rest[i / 3 * 3 + j];
            }
            const double *f = hex_force(&b);
            double max = hex_largest(f, n), inner = 0;
            for (int i = 0; i < b.body.n_node; i++)
                if (whole_inside(&b, i)) inner = fmax(inner, hex_largest(f + 3 * i, 3));
            CHECK_LE(inner, 1e-12 * max);
            hex_body_free(&b);
        }
}

/* a bar pulled by 1e-6: E e A at its end, nothing on its sides; von Mises E e, energy density E e^2 / 2 */
static void pulled_bar_has_its_modulus(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            const double e = 1e-6, nu = 0.42, young_Pa = 7000;
            hex_body b;
            begin(&b, 6, 2, 2, NULL, elements[element], laws[law]);
            b.def->material.young_Pa = young_Pa, b.def->material.poisson = nu;
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = b.body.n_node;
            for (int i = 0; i < 3 * n; i++) b.body.x[i] *= i % 3 ? 1 - nu * e : 1 + e;
            const double *f = hex_force(&b);
            double end = 0, side = 0;
            for (int i = 0; i < n; i++) {
                if (b.body.x_rest[3 * i] > 0.055) end -= f[3 * i];
                side = fmax(side, hex_largest(f + 3 * i + 1, 2));
            }
            double want = young_Pa * e * 0.02 * 0.02;
            CHECK_NEAR(end, want, 1e-5 * want);
            CHECK_LE(side, 1e-5 * want);
            double *sum = hex_zeros(n), *volume = hex_zeros(n), all = 0;
            hex_effect->inspect.measure(b.row, &b.body, PAL_FIELD_VON_MISES_PA, sum, volume);
            for (int i = 0; i < n; i++) CHECK_NEAR(sum[i] / volume[i], young_Pa * e, 1e-4 * young_Pa * e);
            memset(sum, 0, sizeof *sum * (size_t)n), memset(volume, 0, sizeof *sum * (size_t)n);
            hex_effect->inspect.measure(b.row, &b.body, PAL_FIELD_ENERGY_J_M3, sum, volume);
            for (int i = 0; i < n; i++) all += volume[i];
            CHECK_NEAR(all, 24e-6, 1e-15);
            /* the neo-Hookean energy is a difference of numbers of order 1 */
            for (int i = 0; i < n && law < 2; i++)
                CHECK_NEAR(sum[i] / volume[i], 0.5 * young_Pa * e * e, 1e-5 * young_Pa * e * e);
            free(sum), free(volume);
            hex_body_free(&b);
        }
}

static void measured_energy_is_the_energy(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 3, 3, 2, NULL, elements[element], laws[law]);
            for (int e = 0; e < b.hexes.n_hex; e++) b.hexes.fill[e] = e % 3 ? 1 : 0.3f;
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = b.body.n_node;
            hex_shake(&b, 0.15, 3);
            double *sum = hex_zeros(n), *volume = hex_zeros(n), all = 0;
            hex_effect->inspect.measure(b.row, &b.body, PAL_FIELD_ENERGY_J_M3, sum, volume);
            for (int i = 0; i < n; i++) all += sum[i];
            CHECK_NEAR(all, hex_energy(&b), 1e-10 * all);
            free(sum), free(volume);
            hex_body_free(&b);
        }
}

static void nearly_incompressible_stays_finite(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 4, 3, 2, NULL, elements[element], laws[law]);
            b.def->material.poisson = 0.4999;
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_shake(&b, 0.3, 4);
            double max = hex_largest(hex_force(&b), 3 * b.body.n_node);
            CHECK(max > 0 && max < 1e6);
            CHECK(isfinite(hex_energy(&b)));
            hex_body_free(&b);
        }
}

/* x = R (rest - middle) + far */
static void turn_body(hex_body *b, const double axis[3], double angle)
{
    double c = cos(angle / 2), s = sin(angle / 2), q[4] = {c, s * axis[0], s * axis[1], s * axis[2]}, r[9];
    pal_quat_matrix(q, r);
    for (int i = 0; i < 3 * b->body.n_node; i++) {
        const double *x = b->body.x_rest + i / 3 * 3;
        b->body.x[i] = 0.02;
        for (int j = 0; j < 3; j++) b->body.x[i] += r[3 * (i % 3) + j] * (x[j] - 0.01);
    }
}

static void ten_thousand_turns_leave_no_energy(void)
{
    static const double axis[3] = {0.48, -0.6, 0.64};
    for (int law = 0; law < 3; law += 2) {
        hex_body b;
        begin(&b, 3, 2, 2, NULL, "hex8_bbar", laws[law]);
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        for (int i = 0; i < 3 * b.body.n_node; i++) b.body.x[i] *= i % 3 ? 1 : 1.01;
        double strained = hex_energy(&b), worst = 0, max = 0;
        for (int t = 0; t < 9 * CHECK_REPEATS(10000, 1000); t++) {
            turn_body(&b, axis, t * (M_PI / 4.5));
            const double *f = hex_force(&b);
            if (t % 1000 < 9) worst = fmax(worst, fabs(hex_energy(&b)));
            max = fmax(max, hex_largest(f, 3 * b.body.n_node));
        }
        CHECK_LE(worst, 1e-6 * strained);
        CHECK_LE(max, 1e-9 * 5000 * 0.01 * 0.01);
        CHECK_INT(b.body.safeguards.n_inversion, 0);
        hex_body_free(&b);
    }
}

/* whatever the state, far from rest and turned */
static void internal_forces_have_no_sum_and_no_torque(void)
{
    static const double axis[3] = {0.48, -0.6, 0.64};
    for (int law = 0; law < 3; law += 2)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 5, 4, 3, hex_irregular, elements[element], laws[law]);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            uint64_t seed = 77;
            turn_body(&b, axis, 2);
            for (int i = 0; i < 3 * b.body.n_node; i++) b.body.x[i] += 0.002 * hex_random(&seed);
            const double *f = hex_force(&b), *x = b.body.x;
            double sum[3] = {0}, torque[3] = {0}, size = 0, arm = 0;
            for (int i = 0; i < b.body.n_node; i++) {
                for (int k = 0; k < 3; k++) {
                    int p = (k + 1) % 3, q = (k + 2) % 3;
                    sum[k] += f[3 * i + k];
                    torque[k] += x[3 * i + p] * f[3 * i + q] - x[3 * i + q] * f[3 * i + p];
                    size += fabs(f[3 * i + k]), arm += fabs(f[3 * i + k] * x[3 * i + k]);
                }
            }
            CHECK_LE(hex_largest(sum, 3), 1e-12 * size);
            CHECK_LE(hex_largest(torque, 3), 1e-12 * arm);
            hex_body_free(&b);
        }
}

static void share_of_material_scales_a_voxel(void)
{
    static const struct {
        bool key;
        float fill;
        double want;
    } row[] = {{true, 0.25f, 0.25}, {true, 0.001f, 0.02}, {true, 1, 1}, {false, 0.25f, 1}};
    double full = 0;
    for (int i = 3; i >= 0; i--) {
        hex_body b;
        begin(&b, 1, 1, 1, NULL, "hex8_bbar", "corotational");
        pal_entry_put_bool(&b.item, "fill", row[i].key, NULL);
        b.hexes.fill[0] = row[i].fill;
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        hex_shake(&b, 0.1, 5);
        double e = hex_energy(&b);
        if (i == 3) full = e;
        CHECK_NEAR(e, row[i].want * full, 1e-12 * full);
        hex_body_free(&b);
    }
}

/* a live edit of the body's material is a body made with it, but for the regions with their own */
static void edited_material_is_that_of_a_new_body(void)
{
    double e[2], bound[2][45];
    for (int edit = 0; edit < 2; edit++) {
        hex_body b;
        begin(&b, 4, 2, 2, NULL, "hex8_bbar", "corotational");
        b.def->n_region = 1;
        b.def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                        .young_Pa = 40000,
                                        .poisson = NAN,
                                        .density_kg_m3 = NAN,
                                        .high_m = {0.02, 0.02, 0.02}};
        pal_material to = b.def->material;
        to.young_Pa = 900, to.poisson = 0.2;
        if (!edit) b.def->material = to;
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        if (edit) CHECK(hex_effect->material(b.row, &b.body, &to, NULL) == PAL_ERR_OK);
        hex_shake(&b, 0.1, 2);
        e[edit] = hex_energy(&b);
        memset(bound[edit], 0, sizeof bound[edit]);
        hex_effect->bounds.stiffness(b.row, &b.body, bound[edit]);
        /* nodes of the first and of the last voxel */
        CHECK(bound[edit][0] > 20 * bound[edit][b.hexes.node[8 * 3 + 1]]);
        hex_body_free(&b);
    }
    CHECK_NEAR(e[0], e[1], 1e-14 * e[0]);
    CHECK_LE(hex_farthest(bound[0], bound[1], 45), 1e-12 * hex_largest(bound[0], 45));
}

/* the largest eigenvalue of K with mass 1 is at most the largest row sum, and the bound is no more than so many times
 */
static void bounds_are_close_to_the_largest_eigenvalue(void)
{
    static const double slack[3] = {4.5, 4.5, 5};
    for (int law = 0; law < 3; law++)
        for (int state = 0; state < 2; state++) {
            hex_body b;
            begin(&b, 4, 3, 2, NULL, "hex8_bbar", laws[law]);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            int n = 3 * b.body.n_node;
            hex_shake(&b, 0.15 * state, 5);
            double *p = hex_zeros(n), *q = hex_zeros(n), value = 0;
            double *bound = hex_zeros(b.body.n_node);
            uint64_t seed = 3;
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed);
            hex_effect->tangent->linearise(b.row, &b.body);
            for (int t = 0; t < 300; t++) {
                memset(q, 0, sizeof *q * (size_t)n);
                hex_effect->tangent->multiply(b.row, &b.body, 1, p, q);
                value = hex_largest(q, n);
                for (int i = 0; i < n; i++) p[i] = q[i] / value;
            }
            hex_effect->bounds.stiffness(b.row, &b.body, bound);
            CHECK_LE(value, hex_largest(bound, b.body.n_node));
            CHECK_LE(hex_largest(bound, b.body.n_node), slack[law] * value);
            free(p), free(q), free(bound);
            hex_body_free(&b);
        }
}

static void bad_entries_are_refused(void)
{
    hex_body b;
    begin(&b, 2, 2, 2, NULL, "hex20", "linear");
    CHECK(hex_body_make(&b) == PAL_ERR_REFUSED);
    CHECK(strstr(b.diag.text, "hex20") != NULL);
    hex_body_free(&b);
    begin(&b, 2, 2, 2, NULL, "hex8", "rubber");
    CHECK(hex_body_make(&b) == PAL_ERR_REFUSED);
    hex_body_free(&b);
    begin(&b, 2, 2, 2, NULL, "hex8", "linear");
    pal_entry_put_number(&b.item, "gauss", 3, NULL);
    CHECK(hex_body_make(&b) == PAL_ERR_REFUSED);
    CHECK(strstr(b.diag.text, "gauss") != NULL);
    hex_body_free(&b);
}

int main(void)
{
    RUN(product_is_that_of_the_integrated_stiffness);
    RUN(corotational_force_is_that_of_one_voxel_at_a_time);
    RUN(rotated_tangent_is_that_of_one_voxel_at_a_time);
    RUN(force_is_minus_the_gradient_of_the_energy);
    RUN(product_and_assembled_matrix_agree);
    RUN(tangent_is_symmetric_and_semi_definite);
    RUN(neo_hookean_tangent_is_the_derivative_of_the_force);
    RUN(neo_hookean_tangent_is_that_of_one_point_at_a_time);
    RUN(neo_hookean_at_rest_is_the_linear_element);
    RUN(linear_field_is_exact_on_voxels_with_holes);
    RUN(affine_state_has_no_force_within);
    RUN(pulled_bar_has_its_modulus);
    RUN(measured_energy_is_the_energy);
    RUN(nearly_incompressible_stays_finite);
    RUN(ten_thousand_turns_leave_no_energy);
    RUN(internal_forces_have_no_sum_and_no_torque);
    RUN(share_of_material_scales_a_voxel);
    RUN(edited_material_is_that_of_a_new_body);
    RUN(bounds_are_close_to_the_largest_eigenvalue);
    RUN(bad_entries_are_refused);
    return check_report();
}
