/* Recovery of stress (zz_estimator.h): nothing of a field that elements have exactly, second order for a smooth one,
 * and no mean across two materials. */
#include "server/sim/world/zz_estimator.h"
#include "tests/fixtures/fem_beam.h"

typedef void field(const double X[3], double x[3]);

static void put(fem_beam *b, field *f)
{
    for (int i = 0; i < b->body->n_dof; i++) f(b->body->x_rest + 3 * i, b->body->x + 3 * i);
    pal_world_invalidate_limits(b->world, 0);
}

static void stretched(const double X[3], double x[3])
{
    static const double F[9] = {1.02, 0.01, -0.005, 0.003, 0.99, 0.02, 0.004, -0.01, 1.005};
    for (int i = 0; i < 3; i++) x[i] = F[3 * i] * X[0] + F[3 * i + 1] * X[1] + F[3 * i + 2] * X[2] + 0.3;
}
/* the same turned by a third of a turn */
static void turned(const double X[3], double x[3])
{
    double at[3];
    stretched(X, at);
    x[0] = at[2], x[1] = at[0], x[2] = at[1];
}
/* pure bending and a twist, small */
static void smooth(const double X[3], double x[3])
{
    double k = 1e-3, a = X[0] - 0.1;
    x[0] = X[0] - k * X[0] * X[2];
    x[1] = X[1] + k * sin(20 * X[0]) * X[2];
    x[2] = X[2] + 0.5 * k * a * a - k * sin(20 * X[0]) * X[1];
}

static pal_zz_estimator_error estimate(fem_beam *b)
{
    pal_zz_estimator_error zz_estimator;
    pal_diagnostic diag = {""};
    CHECK(!pal_zz_estimator_estimate(b->world, 0, NULL, &zz_estimator, &diag));
    return zz_estimator;
}

static const char *const elements[] = {"hex8_bbar", "hex8", "tet4", "tet10"};
static const char *const laws[] = {"linear", "corotational", "neo_hookean"};

static void linear_fields_have_no_error(void)
{
    for (int e = 0; e < 4; e++)
        for (int l = 0; l < 3; l++) {
            fem_beam b;
            beam_make(&b, 5, 3, 2, 0.01, true);
            beam_element(&b, elements[e], laws[l]);
            REQUIRE(!beam_open(&b, &(pal_diagnostic){""}));
            for (int t = 0; t < (l == 0 ? 1 : 2); t++) {
                put(&b, t == 0 ? stretched : turned);
                pal_zz_estimator_error zz_estimator = estimate(&b);
                CHECK(zz_estimator.solution > 0);
                CHECK_LE(zz_estimator.error, (l == 0 || e < 3 ? 1e-12 : 1e-10) * zz_estimator.solution);
                CHECK_INT(zz_estimator.n_material, 1);
                /* |u_h|^2 is twice the energy where stress goes with strain */
                if (l < 2)
                    CHECK_NEAR(zz_estimator.solution * zz_estimator.solution / (2 * pal_world_energy_J(b.world)), 1,
                               1e-9);
            }
            beam_free(&b);
        }
}

static void at_rest_there_is_neither_error_nor_solution(void)
{
    fem_beam b;
    beam_make(&b, 4, 2, 2, 0.01, true);
    REQUIRE(!beam_open(&b, &(pal_diagnostic){""}));
    pal_zz_estimator_error zz_estimator = estimate(&b);
    CHECK_LE(zz_estimator.solution, 1e-12);
    CHECK_LE(zz_estimator.error, 1e-12);
    beam_free(&b);
}

static void smooth_fields_lose_error_with_the_square_of_the_edge(void)
{
    for (int e = 0; e < 3; e++) {
        double error2[3];
        for (int k = 0; k < 3; k++) {
            fem_beam b;
            beam_reference(&b, 2 << k);
            beam_element(&b, elements[e], "linear");
            REQUIRE(!beam_open(&b, &(pal_diagnostic){""}));
            put(&b, smooth);
            double *share = calloc((size_t)b.body->n_element, sizeof *share), sum = 0;
            pal_zz_estimator_error zz_estimator;
            REQUIRE(share && !pal_zz_estimator_estimate(b.world, 0, share, &zz_estimator, NULL));
            for (int i = 0; i < b.body->n_element; i++) sum += share[i];
            error2[k] = zz_estimator.error * zz_estimator.error;
            CHECK_NEAR(sum / error2[k], 1, 1e-12);
            CHECK(zz_estimator.percent > 0 && zz_estimator.percent < 100);
            free(share);
            beam_free(&b);
        }
        double order = log2(error2[1] / error2[2]);
        printf("  %-9s eta^2 %.3g %.3g %.3g J: order %.2f\n", elements[e], error2[0], error2[1], error2[2], order);
        /* the share of the elements at the border, whose nodes have neighbours on one side only, falls faster */
        CHECK(order > 1.9 && order < 2.7);
    }
}

/* halves of 1 and 10 times the stiffness, pulled: one stress, two strains */
static void in_series(const double X[3], double x[3])
{
    double soft = fmin(X[0], 0.05), stiff = fmax(X[0] - 0.05, 0);
    x[0] = X[0] + 0.01 * soft + 0.001 * stiff;
    x[1] = X[1], x[2] = X[2];
}

static void materials_are_not_mixed(void)
{
    for (int e = 0; e < 3; e++) {
        fem_beam b;
        beam_make(&b, 10, 2, 2, 0.01, true);
        beam_element(&b, elements[e], "linear");
        b.def->material.poisson = 0;
        b.def->n_region = 1;
        b.def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                        .young_Pa = 1e6,
                                        .poisson = NAN,
                                        .density_kg_m3 = NAN,
                                        .low_m = {0.05, -1, -1},
                                        .high_m = {1, 1, 1}};
        REQUIRE(!beam_open(&b, &(pal_diagnostic){""}));
        put(&b, in_series);
        pal_zz_estimator_error zz_estimator = estimate(&b);
        CHECK_INT(zz_estimator.n_material, 2);
        CHECK_LE(zz_estimator.error, 1e-9 * zz_estimator.solution);
        /* strains that are the same have stresses that are not: no error within either half */
        put(&b, stretched);
        zz_estimator = estimate(&b);
        CHECK_LE(zz_estimator.error, 1e-12 * zz_estimator.solution);
        beam_free(&b);
    }
}

static void springs_have_no_stress(void)
{
    fem_beam b;
    pal_zz_estimator_error zz_estimator;
    pal_diagnostic diag = {""};
    beam_make(&b, 3, 2, 2, 0.01, true);
    pal_entry_init(&b.def->model, "model", "tet_springs");
    pal_entry_init(&b.def->solver, "solver", "verlet");
    REQUIRE(!beam_open(&b, &diag));
    CHECK_INT(pal_zz_estimator_estimate(b.world, 0, NULL, &zz_estimator, &diag), PAL_ERR_REFUSED);
    CHECK(isnan(zz_estimator.percent) && strstr(diag.text, "stress"));
    beam_free(&b);
}

int main(void)
{
    RUN(linear_fields_have_no_error);
    RUN(at_rest_there_is_neither_error_nor_solution);
    RUN(smooth_fields_lose_error_with_the_square_of_the_edge);
    RUN(materials_are_not_mixed);
    RUN(springs_have_no_stress);
    return check_report();
}
