/* Observed orders: those of series made by hand, in fixed ratios and others, and of a beam whose refinement is known to
 * converge. */
#include "server/solve/convergence.h"
#include "tests/check.h"

static void orders_of_a_series_made_by_hand_are_found(void)
{
    CHECK_NEAR(pal_observed_order(0.2, 0.04, 0.1, 0.01), 2, 1e-12);
    CHECK_NEAR(pal_observed_order(0.3, 3 * pow(0.3, 1.37), 0.07, 3 * pow(0.07, 1.37)), 1.37, 1e-12);
    CHECK_NEAR(pal_observed_order(0.2, 1, 0.1, 2), -1, 1e-12); /* errors that grow: the order says so */
    CHECK(isnan(pal_observed_order(0.2, 0, 0.1, 1)));
    CHECK(isnan(pal_observed_order(0.1, 2, 0.1, 1)));
    CHECK(isnan(pal_observed_order(0.2, NAN, 0.1, 1)));
    static const double mesh[3][3] = {{0.4, 0.2, 0.1}, {0.5, 0.3, 0.1}, {0.1, 0.09, 0.01}};
    for (int m = 0; m < 3; m++)
        for (double p = 0.3; p < 4.1; p += 0.2) {
            const double *h = mesh[m];
            double first = 7 * (pow(h[0], p) - pow(h[1], p)), second = 7 * (pow(h[1], p) - pow(h[2], p));
            CHECK_NEAR(pal_richardson_order(h, first, second), p, 1e-9);
        }
    const double *h = mesh[0];
    CHECK(isnan(pal_richardson_order(h, 1, 1)));    /* does not shrink: 0 */
    CHECK(isnan(pal_richardson_order(h, 1, 2)));    /* grows */
    CHECK(isnan(pal_richardson_order(h, 1, 1e-9))); /* faster than any order */
    CHECK(isnan(pal_richardson_order(h, 1, 0)));
    CHECK(isnan(pal_richardson_order((const double[3]){0.1, 0.2, 0.4}, 2, 1)));
}

/* u = 1 + C h^p at one point, reference u = 1 */
static void derived_numbers_follow_from_errors_and_changes(void)
{
    enum { N = 5 };
    pal_convergence_point point[N];
    double h[N] = {0.5, 0.25, 0.1, 0.05, 0.04}, p = 1.6, c = 0.2;
    for (int k = 0; k < N; k++) {
        point[k] = (pal_convergence_point){.rms_percent = 100 * c * pow(h[k], p), .change_percent = NAN};
        point[k].result.edge_m = h[k];
        if (k > 0) point[k].change_percent = 100 * c * (pow(h[k - 1], p) - pow(h[k], p));
    }
    pal_convergence_orders(point, N);
    CHECK(isnan(point[0].order) && isnan(point[0].change_order) && isnan(point[0].estimate_percent));
    CHECK(isnan(point[1].change_order));
    CHECK_NEAR(point[1].estimate_percent, point[1].change_percent, 1e-12); /* h halved, order 1 taken */
    for (int k = 1; k < N; k++) CHECK_NEAR(point[k].order, p, 1e-12);
    for (int k = 2; k < N; k++) {
        CHECK_NEAR(point[k].change_order, p, 1e-9);
        CHECK_NEAR(point[k].estimate_percent, point[k].rms_percent, 1e-8);
    }
    /* without samples: no order of errors, but the estimate stays */
    for (int k = 0; k < N; k++) point[k].rms_percent = NAN;
    pal_convergence_orders(point, N);
    CHECK(isnan(point[3].order));
    CHECK_NEAR(point[4].change_order, p, 1e-9);
}

/* a cantilever of 0.2 x 0.05 x 0.05 m under a shear traction at its end */
static bool make_beam(pal_surface *out)
{
    static const int32_t tri[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    *out = (pal_surface){.n_vertex = 8, .n_tri = 12, .x = malloc(24 * sizeof(double)), .tri = malloc(sizeof tri)};
    if (!out->x || !out->tri) return false;
    for (int k = 0; k < 8; k++) {
        out->x[3 * k] = 0.2 * (k & 1);
        out->x[3 * k + 1] = 0.05 * (k >> 1 & 1);
        out->x[3 * k + 2] = 0.05 * (k >> 2);
    }
    memcpy(out->tri, tri, sizeof tri);
    pal_surface_recentre(out);
    return true;
}

static void beam_problem(pal_problem *p)
{
    *p = (pal_problem){.unit_m = 1, .n_material = 1, .n_support = 1, .n_case = 1};
    p->material[0] = (pal_problem_material){
        .id = "m", .region = {.all = true}, .young_Pa = 1e5, .poisson = 0.3, .density_kg_m3 = 1000};
    p->support[0].region = (pal_box){.low_m = {-1, -1, -1}, .high_m = {0, 1, 1}};
    p->load_case[0].n_load = 1;
    p->load_case[0].load[0] = (pal_problem_load){.kind = PAL_LOAD_TRACTION,
                                                 .region = {.low_m = {0.1999, -1, -1}, .high_m = {1, 1, 1}},
                                                 .has_normal = true,
                                                 .normal = {1, 0, 0},
                                                 .has_traction = true,
                                                 .traction_Pa = {0, 0, -100}};
    for (int c = 0; c < 3; c++) p->material[0].region.low_m[c] = -1e9, p->material[0].region.high_m[c] = 1e9;
}

static const pal_solve_options beam_options = {
    .element = "hex8_bbar", .law = "linear", .voxel.fill = true, .twist = 1, .young_Pa = NAN, .poisson = NAN};

static void a_beam_converges_and_richardson_knows_by_how_much(void)
{
    pal_surface beam;
    static pal_problem p;
    pal_diagnostic diag = {""};
    pal_convergence_point point[3];
    const int resolution[3] = {8, 16, 32};
    int done = 0;
    REQUIRE(make_beam(&beam));
    beam_problem(&p);
    REQUIRE(!pal_convergence(&p, &p.load_case[0], &beam, &beam_options, NULL, resolution, 3, point, &done, &diag));
    CHECK_INT(done, 3);
    for (int k = 0; k < 3; k++) {
        int n = resolution[k];
        CHECK_INT(point[k].resolution, n);
        CHECK_INT(point[k].result.n_node, (n + 1) * (n / 4 + 1) * (n / 4 + 1));
        CHECK(isnan(point[k].rms_percent) && isnan(point[k].order));
    }
    CHECK(point[2].change_percent < 0.5 * point[1].change_percent);
    CHECK(point[2].change_order > 1 && point[2].change_order < 2.2);
    CHECK(point[2].estimate_percent > 0.05 && point[2].estimate_percent < 0.6);

    /* the finest as the reference of the coarser ones: what they are off is what changed */
    pal_solve_options o = beam_options;
    pal_solution *s = NULL;
    pal_solve_result r;
    double x[24], u[24];
    pal_samples samples = {.n = 8, .x = x, .u = u};
    o.voxel.resolution = 32;
    REQUIRE(!pal_solve(&p, &p.load_case[0], &beam, &o, &s, &r, &diag));
    for (int i = 0; i < 24; i++) x[i] = beam.x[i] + beam.origin_m[i % 3];
    for (int i = 0; i < 8; i++) pal_solution_at(s, x + 3 * i, u + 3 * i);
    pal_solution_free(s);
    double change = point[2].change_percent;
    REQUIRE(
        !pal_convergence(&p, &p.load_case[0], &beam, &beam_options, &samples, resolution + 1, 2, point, &done, &diag));
    CHECK_NEAR(point[0].rms_percent, change, 1e-6);
    CHECK_NEAR(point[1].rms_percent, 0, 1e-9);
    CHECK_NEAR(point[1].change_percent, change, 1e-6);
    pal_surface_free(&beam);
}

static void what_cannot_be_a_series_is_refused(void)
{
    pal_surface beam;
    static pal_problem p;
    pal_diagnostic diag = {""};
    pal_convergence_point point[2];
    int done = 7;
    REQUIRE(make_beam(&beam));
    beam_problem(&p);
    const pal_problem_case *c = &p.load_case[0];
    CHECK_INT(pal_convergence(&p, c, &beam, &beam_options, NULL, (int[]){8, 8}, 2, point, &done, &diag),
              PAL_ERR_REFUSED);
    CHECK_INT(done, 0);
    CHECK(strstr(diag.text, "resolution 8 comes after 8") != NULL);
    CHECK_INT(pal_convergence(&p, c, &beam, &beam_options, NULL, (int[]){8}, 0, point, &done, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_convergence(&p, c, &beam, &beam_options, NULL, (int[]){8}, 17, point, &done, &diag), PAL_ERR_REFUSED);
    /* a fault of a solve is handed on, with what was whole before it */
    p.n_support = 0;
    CHECK_INT(pal_convergence(&p, c, &beam, &beam_options, NULL, (int[]){4, 8}, 2, point, &done, &diag),
              PAL_ERR_REFUSED);
    CHECK_INT(done, 0);
    CHECK(strstr(diag.text, "supports: none") != NULL);
    pal_surface_free(&beam);
}

int main(void)
{
    RUN(orders_of_a_series_made_by_hand_are_found);
    RUN(derived_numbers_follow_from_errors_and_changes);
    RUN(a_beam_converges_and_richardson_knows_by_how_much);
    RUN(what_cannot_be_a_series_is_refused);
    return check_report();
}
