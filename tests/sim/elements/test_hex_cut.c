/* Cut voxels of hex_elastic: weights at the Gauss points, against the same integral by num/shape_functions. */
#include "tests/fixtures/hex_bodies.h"

#include "server/base/vec3.h"
#include "server/num/shape_functions.h"
#include "server/sim/elements/elastic_hex_single.h"
#include "server/sim/elements/tuning.h"

static const char *const elements[2] = {"hex8_bbar", "hex8"};
static const char *const laws[3] = {"corotational", "linear", "neo_hookean"};
static double softer; /* twist of the bodies that may have one */

static void begin(hex_body *b, int nx, int ny, int nz, const char *element, const char *law, uint64_t seed)
{
    const int n[3] = {nx, ny, nz};
    hex_body_begin(b, n, NULL, 0.01);
    pal_entry_put_text(&b->item, "element", element, NULL);
    pal_entry_put_text(&b->item, "law", law, NULL);
    pal_entry_put_bool(&b->item, "moment_fitting", true, NULL);
    if (element == elements[0] && law != laws[2]) pal_entry_put_number(&b->item, "twist", softer, NULL);
    b->def->material.poisson = 0.4;
    hex_cut_at_random(b, seed);
}

/* weights of the points over those of a whole voxel; returns their sum over 8 */
static double weights(const hex_body *b, int e, double weight[8])
{
    double sum = 0, inside[8];
    pal_hexes_weights(&b->hexes, e, PAL_FILL_MIN, inside);
    for (int q = 0; q < 8; q++) {
        weight[q] = (1 - PAL_VOID_STIFFNESS) * inside[q] + PAL_VOID_STIFFNESS / 8;
        sum += weight[q];
    }
    return sum;
}

/* u with the components that grow along two other axes, or along all three, times sqrt(twist) */
static void soften(double twist, const double u[24], double out[24])
{
    memcpy(out, u, 24 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int mode = 7 ^ 1 << i; mode; mode = mode == 7 ? 0 : 7) {
            double size = 0;
            for (int c = 0; c < 8; c++) size += u[3 * c + i] * (__builtin_popcount(mode & ~c) % 2 ? -1 : 1) / 8;
            for (int c = 0; c < 8; c++)
                out[3 * c + i] += (sqrt(twist) - 1) * size * (__builtin_popcount(mode & ~c) % 2 ? -1 : 1);
        }
}

/* u'K v of element e: displacements of its corners [8][3] */
static double product(const hex_body *b, int bbar, int e, const double *u, const double *v)
{
    const double *of[2] = {u, v}, h = b->tets.edge_m;
    double soft[2][24], shift[2][9] = {{0}};
    double mu, lambda, weight[8], grad[8][8][3], g[2][8][9] = {{{0}}}, mean[2][9] = {{0}}, trace[2] = {0, 0}, sum = 0;
    pal_lame(b->def->material.young_Pa, b->def->material.poisson, &mu, &lambda);
    const double all = weights(b, e, weight), kappa = lambda + 2 * mu / 3;
    for (int q = 0; q < 8; q++) pal_hex_shape(pal_hex_gauss[q], NULL, grad[q]);
    for (int k = 0; k < 2; k++)
        for (int q = 0; q < 8; q++)
            for (int i = 0; i < 9; i++) {
                for (int c = 0; c < 8; c++) g[k][q][i] += 2 / h * of[k][3 * c + i / 3] * grad[q][c][i % 3];
                mean[k][i] += weight[q] / all * g[k][q][i];
            }
    /* the rest about the mean is that of the softer field */
    for (int k = 0; k < 2; k++) {
        soften(b->row->twist, of[k], soft[k]);
        for (int q = 0; q < 8; q++)
            for (int i = 0; i < 9; i++) {
                g[k][q][i] = 0;
                for (int c = 0; c < 8; c++) g[k][q][i] += 2 / h * soft[k][3 * c + i / 3] * grad[q][c][i % 3];
                shift[k][i] += weight[q] / all * g[k][q][i];
            }
        for (int i = 0; i < 72; i++) g[k][i / 9][i % 9] += mean[k][i % 9] - shift[k][i % 9];
    }
    for (int k = 0; k < 2; k++) trace[k] = mean[k][0] + mean[k][4] + mean[k][8];
    if (bbar) sum += all * kappa * trace[0] * trace[1];
    for (int q = 0; q < 8; q++) {
        const double *a = g[0][q], *c = g[1][q], tr = (a[0] + a[4] + a[8]) * (c[0] + c[4] + c[8]);
        double shear = 0;
        for (int i = 0; i < 9; i++) shear += 0.5 * a[i] * (c[i] + c[3 * (i % 3) + i / 3]);
        sum += weight[q] * (2 * mu * shear + (bbar ? -2 * mu / 3 : lambda) * tr);
    }
    return h * h * h * sum;
}

static void gather(const hex_body *b, int e, const double *x, double u[24])
{
    for (int i = 0; i < 24; i++) u[i] = x[3 * b->hexes.node[8 * e + i / 3] + i % 3];
}

static void product_is_that_of_the_weighted_points(void)
{
    for (int element = 0; element < 2; element++) {
        hex_body b;
        begin(&b, 9, 3, 2, elements[element], "linear", 3);
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        const int n = 3 * b.body.n_node;
        double *p = hex_zeros(n), *out = hex_zeros(n), *want = hex_zeros(n);
        uint64_t seed = 5;
        for (int i = 0; i < n; i++) p[i] = hex_random(&seed);
        hex_effect->tangent->linearise(b.row, &b.body);
        hex_effect->tangent->multiply(b.row, &b.body, 0.7, p, out);
        for (int e = 0; e < b.hexes.n_hex; e++)
            for (int i = 0; i < 24; i++) {
                double u[24], unit[24] = {0};
                gather(&b, e, p, u), unit[i] = 1;
                want[3 * b.hexes.node[8 * e + i / 3] + i % 3] += 0.7 * product(&b, !element, e, unit, u);
            }
        CHECK_LE(hex_farthest(out, want, n), 1e-12 * hex_largest(want, n));
        /* in single precision */
        pal_elastic_hexes_single single;
        REQUIRE(pal_hex_single_make(b.row, &b.body, b.arena, &single) == PAL_ERR_OK);
        pal_hex_single_stiffen(&single);
        float *from = calloc(3 * (size_t)single.n_slot, sizeof *from),
              *to = calloc(3 * (size_t)single.n_slot, sizeof *to);
        REQUIRE(from && to);
        for (int i = 0; i < n; i++) from[i % 3 * single.n_slot + b.body.node_order->slot[i / 3]] = (float)p[i];
        pal_hex_single_multiply(&single, NULL, 0.7F, from, to);
        double worst = 0;
        for (int i = 0; i < n; i++)
            worst = fmax(worst, fabs((double)to[i % 3 * single.n_slot + b.body.node_order->slot[i / 3]] - want[i]));
        CHECK_LE(worst, 1e-5 * hex_largest(want, n));
        for (int e = 0; e < 4; e++) {
            double k[24][24], error = 0, size = 0;
            pal_hex_single_element(&single, NULL, e, 1, k);
            for (int i = 0; i < 576; i++) {
                double u[24] = {0}, v[24] = {0};
                u[i / 24] = v[i % 24] = 1;
                const double value = product(&b, !element, e, u, v);
                error = fmax(error, fabs(k[i / 24][i % 24] - value)), size = fmax(size, fabs(value));
            }
            CHECK_LE(error, 1e-6 * size);
        }
        free(p), free(out), free(want), free(from), free(to);
        hex_body_free(&b);
    }
}

static void forces_are_minus_the_gradient_of_the_energy(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 3, 2, 2, elements[element], laws[law], 11);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_shake(&b, 0.15, 5);
            const int n = 3 * b.body.n_node;
            double *f = hex_zeros(n), worst = 0;
            memcpy(f, hex_force(&b), sizeof *f * (size_t)n);
            for (int i = 0; i < n; i++) {
                const double x = b.body.x[i], step = 1e-7;
                double e[2];
                for (int s = 0; s < 2; s++) {
                    b.body.x[i] = s ? x + step : x - step;
                    e[s] = hex_energy(&b);
                }
                b.body.x[i] = x;
                worst = fmax(worst, fabs((e[1] - e[0]) / (2 * step) + f[i]));
            }
            CHECK_LE(worst, 1e-6 * hex_largest(f, n));
            free(f);
            hex_body_free(&b);
        }
}

static void product_and_assembled_matrix_agree(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 5, 4, 3, elements[element], laws[law], 21);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_check_product(&b);
            hex_body_free(&b);
        }
}

/* K + shift has a Cholesky factor: no eigenvalue of K is below -shift. Weights from nothing in seven octants on */
static void stiffness_is_semi_definite_for_any_weights(void)
{
    for (int element = 0; element < 2; element++)
        for (int k = 0; k < 40; k++) {
            hex_body b;
            begin(&b, 1, 1, 1, elements[element], "linear", 100 + (uint64_t)k);
            if (k < 8)
                for (int q = 0; q < 8; q++) b.hexes.weight[q] = q == k ? 0.125F : 0;
            b.hexes.fill[0] = pal_weight_sum(b.hexes.weight);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            double m[36][9], a[24][24], max = 0, pivot = INFINITY;
            const int lane = b.row->simd_blocks.place[0];
            pal_hex_matrix(b.row, lane, b.row->mu[lane], b.row->lambda[lane], m);
            for (int i = 0; i < 24; i++)
                for (int j = 0; j <= i; j++) a[i][j] = m[pal_hex_pair(j / 3, i / 3)][j % 3 * 3 + i % 3];
            for (int i = 0; i < 24; i++) max = fmax(max, a[i][i]);
            for (int i = 0; i < 24; i++) {
                a[i][i] += 1e-12 * max;
                for (int j = 0; j <= i; j++) {
                    for (int c = 0; c < j; c++) a[i][j] -= a[i][c] * a[j][c];
                    if (i == j)
                        pivot = fmin(pivot, a[i][i]), a[i][i] = sqrt(fmax(a[i][i], 1e-300));
                    else
                        a[i][j] /= a[j][j];
                }
            }
            CHECK(pivot > 0);
            hex_body_free(&b);
        }
}

/* Energy, stress and reaction of constant strain are exact in voxels cut by an inclined plane: the energy of the
 * weighted volume, and on any node the stress times the weighted gradient of its shape function. */
static void constant_strain_is_exact_on_an_inclined_cut(void)
{
    static const double normal[3] = {0.6, -0.48, 0.64},
                        field[9] = {0.011, 0.007, -0.004, 0.003, -0.013, 0.008, -0.006, 0.002, 0.009};
    for (int law = 0; law < 2; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 4, 4, 4, elements[element], laws[law], 1);
            const double h = b.tets.edge_m;
            for (int i = 0; i < 8 * b.hexes.n_hex; i++) {
                const double *low = b.tets.x + 3 * b.hexes.node[i - i % 8];
                double s = -0.02 * normal[0] - 0.021 * normal[1] - 0.019 * normal[2];
                for (int k = 0; k < 3; k++) s += normal[k] * (low[k] + h * (i >> k & 1 ? 0.75 : 0.25));
                /* the plane at s = 0 as if it were level in each octant */
                b.hexes.weight[i] = (float)(fmin(1, fmax(0, 0.5 - s / h)) / 8);
                if (i % 8 == 7) b.hexes.fill[i / 8] = pal_weight_sum(b.hexes.weight + i - 7);
            }
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            const int n = b.body.n_node;
            double mu, lambda, stress[9], volume = 0, density = 0, *want = hex_zeros(3 * n), grad[8][8][3];
            pal_lame(b.def->material.young_Pa, b.def->material.poisson, &mu, &lambda);
            const double scale = law ? 1 : 1e-5, trace = scale * (field[0] + field[4] + field[8]);
            for (int i = 0; i < 9; i++) {
                const double strain = scale * 0.5 * (field[i] + field[3 * (i % 3) + i / 3]);
                stress[i] = 2 * mu * strain + (i % 4 == 0 ? lambda * trace : 0);
                density += 0.5 * stress[i] * strain;
            }
            for (int q = 0; q < 8; q++) pal_hex_shape(pal_hex_gauss[q], NULL, grad[q]);
            for (int e = 0; e < b.hexes.n_hex; e++) {
                double weight[8];
                volume += h * h * h * weights(&b, e, weight);
                for (int i = 0; i < 8 * 8 * 9; i++) {
                    const int q = i / 72, c = i / 9 % 8, ij = i % 9;
                    want[3 * b.hexes.node[8 * e + c] + ij / 3] -=
                        h * h * 2 * weight[q] * stress[ij] * grad[q][c][ij % 3];
                }
            }
            for (int i = 0; i < 3 * n; i++)
                for (int j = 0; j < 3; j++)
                    b.body.x[i] += scale * field[3 * (i % 3) + j] * b.body.x_rest[i / 3 * 3 + j];
            /* the corotational strain differs from the small one by the field squared */
            CHECK_NEAR(hex_energy(&b), volume * density, (law ? 1e-12 : 1e-5) * volume * density);
            CHECK_LE(hex_farthest(hex_force(&b), want, 3 * n), (law ? 1e-12 : 1e-5) * hex_largest(want, 3 * n));
            double *sum = hex_zeros(n), *part = hex_zeros(n), error = 0;
            hex_effect->inspect.measure(b.row, &b.body, PAL_FIELD_VON_MISES_PA, sum, part);
            for (int i = 0; i < n; i++)
                if (part[i] > 0) error = fmax(error, fabs(sum[i] / part[i] / pal_von_mises(stress) - 1));
            CHECK_LE(error, law ? 1e-10 : 1e-4);
            free(want), free(sum), free(part);
            hex_body_free(&b);
        }
}

static void measured_energy_is_the_energy(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 3, 3, 2, elements[element], laws[law], 31);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            const int n = b.body.n_node;
            hex_shake(&b, 0.15, 3);
            double *sum = hex_zeros(n), *volume = hex_zeros(n), all = 0;
            hex_effect->inspect.measure(b.row, &b.body, PAL_FIELD_ENERGY_J_M3, sum, volume);
            for (int i = 0; i < n; i++) all += sum[i];
            CHECK_NEAR(all, hex_energy(&b), 1e-10 * all);
            free(sum), free(volume);
            hex_body_free(&b);
        }
}

/* v'K v <= sum of bounds v^2 for random and for the roughest vectors */
static void bounds_hold(void)
{
    for (int law = 0; law < 3; law++)
        for (int element = 0; element < 2; element++) {
            hex_body b;
            begin(&b, 4, 3, 2, elements[element], laws[law], 41);
            REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
            hex_shake(&b, 0.1, 2);
            const int n = 3 * b.body.n_node;
            double *p = hex_zeros(n), *q = hex_zeros(n), *bound = hex_zeros(n / 3), worst = 0;
            uint64_t seed = 8;
            hex_effect->tangent->linearise(b.row, &b.body);
            hex_effect->bounds.stiffness(b.row, &b.body, bound);
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed);
            /* power iteration of bound^-1 K */
            for (int k = 0; k < 60; k++) {
                double over = 0, under = 0;
                memset(q, 0, sizeof *q * (size_t)n);
                hex_effect->tangent->multiply(b.row, &b.body, 1, p, q);
                for (int i = 0; i < n; i++) over += p[i] * q[i], under += bound[i / 3] * p[i] * p[i];
                worst = fmax(worst, over / under);
                for (int i = 0; i < n; i++) p[i] = q[i] / bound[i / 3];
            }
            CHECK_LE(worst, 1);
            CHECK(worst > 0.1);
            free(p), free(q), free(bound);
            hex_body_free(&b);
        }
}

int main(void)
{
    softer = 1;
    RUN(product_is_that_of_the_weighted_points);
    softer = 0.2;
    RUN(product_is_that_of_the_weighted_points);
    RUN(forces_are_minus_the_gradient_of_the_energy);
    RUN(product_and_assembled_matrix_agree);
    RUN(stiffness_is_semi_definite_for_any_weights);
    RUN(constant_strain_is_exact_on_an_inclined_cut);
    RUN(measured_energy_is_the_energy);
    RUN(bounds_hold);
    return check_report();
}
