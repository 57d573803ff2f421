/* Model fem at rest: static_newton against beam theory, its balance of forces, inertia relief, refusals, the ways of
 * its linear solves, and the static compliance against static_newton itself. */
#include "server/base/vec3.h"
#include "tests/fixtures/fem_beam.h"

static pal_diagnostic diag;

static pal_solve_report report_of(const fem_beam *b)
{
    pal_solve_report report;
    CHECK(pal_world_solve_report(b->world, 0, &report));
    return report;
}

static pal_err rest(fem_beam *b)
{
    return pal_world_step(b->world, 1.0 / 60);
}

static void sum_forces(const fem_beam *b, double load[3], double reaction[3])
{
    for (int c = 0; c < 3; c++) load[c] = reaction[c] = 0;
    for (int i = 0; i < b->body->n_node; i++)
        for (int c = 0; c < 3; c++) {
            load[c] += b->body->external_force ? b->body->external_force[3 * i + c] : 0;
            if (b->body->support[i])
                reaction[c] +=
                    b->body->f[3 * i + c] - (b->body->external_force ? b->body->external_force[3 * i + c] : 0);
        }
}

/* nu 0, so that the clamped end is as beam theory has it: P L^3 / (3 E I) + P L / (5/6 G A) */
static void a_slender_beam_bends_as_timoshenko_says(void)
{
    static const struct {
        const char *element;
        int n;
        double within;
    } row[] = {{"hex8_bbar", 4, 0.02}, {"hex8", 4, 0.05}, {"tet10", 2, 0.01}};
    for (int k = 0; k < 3; k++) {
        fem_beam b;
        int n = row[k].n;
        beam_make(&b, 8 * n, n, n, 0.05 / n, true);
        beam_element(&b, row[k].element, "linear");
        beam_solver(&b, "static_newton");
        b.def->material.poisson = 0;
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 1);
        REQUIRE(!rest(&b));
        double end[3], a = 0.05, L = b.length_m, E = 1e5, P = a * a, I = a * a * a * a / 12;
        double expect = P * L * L * L / (3 * E * I) + P * L / (5.0 / 6 * (E / 2) * a * a);
        beam_end(&b, end);
        printf("  %s: %.6g m, theory %.6g m\n", row[k].element, end[2], expect);
        CHECK_NEAR(end[2] / expect, 1, row[k].within);
        CHECK(report_of(&b).converged);
        beam_free(&b);
    }
}

static void supports_bear_the_load(void)
{
    static const char *const laws[] = {"linear", "corotational", "neo_hookean"}, *const ways[] = {"auto", "direct",
                                                                                                  "pcg", "incomplete"};
    static const char *const elements[] = {"hex8_bbar", "tet4"};
    double tip[4][3];
    for (int e = 0; e < 2; e++)
        for (int l = 0; l < 3; l++) {
            for (int w = 0; w < 4; w++) {
                fem_beam b;
                beam_reference(&b, 2);
                beam_element(&b, elements[e], laws[l]);
                beam_solver(&b, "static_newton");
                pal_entry_put_text(&b.def->solver, "linear", ways[w], NULL);
                beam_key(&b, "tolerance", 1e-10);
                REQUIRE(!beam_open(&b, &diag));
                beam_load_end(&b, 800);
                REQUIRE(!rest(&b));
                pal_solve_report report = report_of(&b);
                CHECK(report.converged);
                CHECK_LE(report.residual, 1e-10);
                double load[3], reaction[3];
                sum_forces(&b, load, reaction);
                CHECK_NEAR(load[2], 2, 1e-12);
                for (int c = 0; c < 3; c++) CHECK_NEAR(reaction[c], load[c], 1e-8 * load[2]);
                beam_end(&b, tip[w]);
                if (w % 3 == 0 && e == 0)
                    printf("  %s, %s: %d iterations, %d of conjugate gradients\n", laws[l], ways[w], report.n_newton,
                           report.n_cg);
                beam_free(&b);
            }
            for (int w = 1; w < 4; w++)
                for (int c = 0; c < 3; c++) CHECK_NEAR(tip[w][c], tip[0][c], 1e-7 * fabs(tip[0][2]));
        }
}

/* few iterations per world step, the load in parts: the same rest */
static void may_be_followed_step_by_step(void)
{
    double tip[3][3];
    for (int k = 0; k < 3; k++) {
        fem_beam b;
        beam_reference(&b, 2);
        beam_element(&b, "hex8_bbar", "neo_hookean");
        beam_solver(&b, "static_newton");
        if (k == 1) beam_key(&b, "newton", 2);
        if (k == 2) beam_key(&b, "load_steps", 4);
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 800);
        int n_step = 0;
        do REQUIRE(!rest(&b));
        while (!report_of(&b).converged && ++n_step < 60);
        CHECK(report_of(&b).converged);
        CHECK(k != 1 || n_step > 2);
        beam_end(&b, tip[k]);
        for (int c = 0; c < 3; c++) CHECK_NEAR(tip[k][c], tip[0][c], 1e-6 * fabs(tip[0][2]));
        beam_free(&b);
    }
}

/* gravity along the beam, nu 0: the end moves by rho g L^2 / (2 E) */
static void gravity_stretches_a_hanging_bar(void)
{
    fem_beam b;
    beam_reference(&b, 2);
    beam_element(&b, "hex8", "linear");
    beam_solver(&b, "static_newton");
    b.def->material.poisson = 0;
    b.scene->up[0] = -1, b.scene->up[2] = 0;
    pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "gravity");
    REQUIRE(!beam_open(&b, &diag));
    REQUIRE(!rest(&b));
    double end[3];
    beam_end(&b, end);
    CHECK_NEAR(end[0], 1000 * 9.81 * 0.04 / 2e5, 1e-9);
    beam_free(&b);
}

/* a free bar pulled at one end flies off; seen from itself it is stretched by F L / (2 E A) */
static void inertia_relief_balances_what_nothing_holds(void)
{
    static const char *const laws[] = {"linear", "corotational", "neo_hookean"};
    for (int l = 0; l < 3; l++) {
        fem_beam b;
        beam_make(&b, 16, 2, 2, 0.0125, false);
        beam_element(&b, "hex8", laws[l]);
        beam_solver(&b, "static_newton");
        pal_entry_put_text(&b.def->solver, "free", "inertia_relief", NULL);
        b.def->material.poisson = 0;
        REQUIRE(!beam_open(&b, &diag));
        double pull = 10; /* Pa */
        beam_load_end(&b, pull);
        for (int i = 0; i < b.body->n_node; i++) {
            double *f = b.body->external_force + 3 * i;
            f[0] = f[2], f[2] = 0;
        }
        REQUIRE(!rest(&b));
        CHECK(report_of(&b).converged);
        double end[3], start = 0, mean[3] = {0, 0, 0};
        beam_end(&b, end);
        for (int i = 0; i < b.body->n_node; i++)
            for (int c = 0; c < 3; c++) {
                double u = b.body->x[3 * i + c] - b.body->x_rest[3 * i + c];
                if (c == 0 && b.body->x_rest[3 * i] < 1e-9) start += u / 9;
                mean[c] += b.body->mass_kg[i] * u;
            }
        CHECK_NEAR((end[0] - start) / (pull * 0.2 / (2 * 1e5)), 1, 2e-3);
        for (int c = 0; c < 3; c++) CHECK_NEAR(mean[c], 0, 1e-9 * end[0]);
        beam_free(&b);
    }
}

static void refuses_what_has_no_rest(void)
{
    static const char *const expect[] = {"has fewer than three held nodes off a line",
                                         "has fewer than three held nodes",
                                         "inertia_relief is for one part without held nodes",
                                         "free: \"fly\", wanted \"refuse\" or \"inertia_relief\"",
                                         "linear: \"lu\", wanted \"auto\", \"direct\", \"pcg\"",
                                         "newton: 0 is outside",
                                         "has no tangent, which its implicit solver needs"};
    for (int k = 0; k < 7; k++) {
        fem_beam b;
        beam_make(&b, 4, 2, 2, 0.02, k > 0);
        beam_element(&b, "hex8_bbar", "linear");
        beam_solver(&b, "static_newton");
        /* one edge of nodes is no support */
        if (k == 1 || k == 2) b.def->support[0].high_m[2] = 1e-9;
        if (k == 2) pal_entry_put_text(&b.def->solver, "free", "inertia_relief", NULL);
        if (k == 3) pal_entry_put_text(&b.def->solver, "free", "fly", NULL);
        if (k == 4) pal_entry_put_text(&b.def->solver, "linear", "lu", NULL);
        if (k == 5) beam_key(&b, "newton", 0);
        if (k == 6) pal_entry_init(&b.def->model, "model", "tet_springs");
        pal_world *world = NULL;
        CHECK_INT(pal_world_create(b.scene, &diag, &world), PAL_ERR_REFUSED);
        if (!strstr(diag.text, expect[k])) CHECK_TEXT(diag.text, expect[k]);
        if (world) pal_world_destroy(world);
        beam_free(&b);
    }
}

static void all_held_is_at_rest(void)
{
    fem_beam b;
    beam_make(&b, 2, 2, 2, 0.02, true);
    beam_element(&b, "hex8_bbar", "corotational");
    beam_solver(&b, "static_newton");
    b.def->support[0].high_m[0] = 1;
    REQUIRE(!beam_open(&b, &diag));
    beam_load_end(&b, 100);
    REQUIRE(!rest(&b));
    CHECK(report_of(&b).converged);
    for (int i = 0; i < 3 * b.body->n_node; i++) CHECK_NEAR(b.body->x[i], b.body->x_rest[i], 0);
    beam_free(&b);
}

/* pulled and pressed by loads of E / 2 and E / 5 on the end: Newton and its line search come to an end */
static void large_strain_converges(void)
{
    static const double nu[] = {0.3, 0.45, 0.499}, pull[] = {5e4, -2e4};
    for (int k = 0; k < 6; k++) {
        fem_beam b;
        beam_make(&b, 4, 4, 4, 0.0125, true);
        beam_element(&b, "hex8_bbar", "neo_hookean");
        beam_solver(&b, "static_newton");
        b.def->material.poisson = nu[k / 2];
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, pull[k % 2]);
        for (int i = 0; i < b.body->n_node; i++) {
            double *f = b.body->external_force + 3 * i;
            f[0] = f[2], f[2] = 0;
        }
        REQUIRE(!rest(&b));
        pal_solve_report report = report_of(&b);
        double end[3];
        beam_end(&b, end);
        printf("  nu %g: %d iterations (%d), residual %.2g, longer by %.1f %%\n", nu[k / 2], report.n_newton,
               report.n_cg, report.residual, 100 * end[0] / b.length_m);
        CHECK(report.converged);
        /* 5 to 12; where indefinite directions are followed, 35 to more than 50 as the rounding goes */
        CHECK_LE(report.n_newton, 20);
        CHECK(end[0] * pull[k % 2] > 0 && fabs(end[0]) > 0.1 * b.length_m && fabs(end[0]) < 2 * b.length_m);
        beam_free(&b);
    }
}

/* sheared by E / 4 corners turn over at the clamped edge, which the five-tetrahedra split would stand in for: the
 * answer is the law's own, and the supports bear the load */
static void turned_corners_keep_the_law(void)
{
    static const char *const elements[] = {"hex8_bbar", "tet10"};
    static const double nu[] = {0.3, 0.45};
    for (int k = 0; k < 4; k++) {
        fem_beam b;
        int n = k < 2 ? 6 : 4;
        beam_make(&b, n, n, n, 0.05 / n, true);
        beam_element(&b, elements[k / 2], "neo_hookean");
        beam_solver(&b, "static_newton");
        b.def->material.poisson = nu[k % 2];
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 2.5e4);
        REQUIRE(!rest(&b));
        pal_solve_report report = report_of(&b);
        double load[3], reaction[3], end[3];
        sum_forces(&b, load, reaction);
        beam_end(&b, end);
        printf("  %s, nu %g: %d iterations, residual %.2g, sheared by %.0f %%\n", elements[k / 2], nu[k % 2],
               report.n_newton, report.residual, 100 * end[2] / b.length_m);
        CHECK(report.converged);
        CHECK_LE(report.n_newton, 30);
        CHECK_INT((int)b.body->safeguards.n_inversion, 0);
        CHECK(end[2] > b.length_m);
        for (int c = 0; c < 3; c++) CHECK_NEAR(reaction[c], load[c], 1e-6 * load[2]);
        beam_free(&b);
    }
}

/* strains of 1e-9 and less: the energy is all rounding, the forces tell the way. The tip's displacement is linear in
 * the load */
static void rests_under_next_to_no_load(void)
{
    static const char *const laws[] = {"neo_hookean", "corotational"};
    static const double traction[] = {1, 1e-2, 1e-4};
    for (int l = 0; l < 2; l++) {
        double per_Pa[3];
        for (int k = 0; k < 3; k++) {
            fem_beam b;
            beam_make(&b, 4, 4, 4, 0.0125, true);
            beam_element(&b, "hex8_bbar", laws[l]);
            beam_solver(&b, "static_newton");
            beam_key(&b, "tolerance", 1e-5);
            REQUIRE(!beam_open(&b, &diag));
            beam_load_end(&b, traction[k]);
            REQUIRE(!rest(&b));
            pal_solve_report report = report_of(&b);
            CHECK(report.converged);
            CHECK_LE(report.n_newton, 4);
            double end[3];
            beam_end(&b, end);
            per_Pa[k] = end[2] / traction[k];
            beam_free(&b);
        }
        for (int k = 0; k < 3; k++) CHECK_NEAR(per_Pa[k] / per_Pa[0], 1, 1e-4);
    }
}

static void starts_again_after_a_reset(void)
{
    fem_beam b;
    beam_reference(&b, 2);
    beam_element(&b, "hex8_bbar", "corotational");
    beam_solver(&b, "static_newton");
    REQUIRE(!beam_open(&b, &diag));
    uint64_t hash[2];
    for (int k = 0; k < 2; k++) {
        beam_load_end(&b, 800);
        REQUIRE(!rest(&b));
        hash[k] = pal_world_hash(b.world);
        pal_world_reset(b.world);
    }
    CHECK(hash[0] == hash[1]);
    pal_material soft = b.def->material;
    soft.young_Pa /= 2;
    CHECK_INT(pal_world_material(b.world, 0, &soft, &diag), 0);
    beam_load_end(&b, 400);
    REQUIRE(!rest(&b));
    CHECK(report_of(&b).converged);
    double end[3];
    beam_end(&b, end);
    CHECK_NEAR(end[2], 0.085, 0.01);
    beam_free(&b);
}

/* against the difference of two rests, at the tip and at a node in the middle of the upper side */
static void compliance_is_that_of_the_bent_body(void)
{
    const double traction[] = {0, 800};
    for (int k = 0; k < 2; k++)
        for (int s = 0; s < 2; s++) {
            fem_beam b;
            beam_reference(&b, 4);
            beam_element(&b, "hex8_bbar", "corotational");
            beam_solver(&b, "static_newton");
            beam_key(&b, "tolerance", 1e-11);
            pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "tool_push");
            pal_tools_default(b.scene, 1);
            b.scene->tool[0].radius_m = 0.01;
            REQUIRE(!beam_open(&b, &diag));
            if (!b.body->compliance) {
                printf("  no row wants compliance\n");
                CHECK(!b.body->wants_compliance);
                beam_free(&b);
                continue;
            }
            beam_load_end(&b, traction[k]);
            REQUIRE(!rest(&b));
            int n3 = 3 * b.body->n_node, node = box_node((const int[3]){16, 4, 4}, s ? 8 : 16, 2, 4);
            double *x = malloc(sizeof *x * (size_t)n3), *f = calloc((size_t)n3, sizeof *f),
                   *u = malloc(sizeof *u * (size_t)n3);
            REQUIRE(x && f && u);
            double worst = 0;
            for (int c = 0; c < 3; c++) {
                memcpy(x, b.body->x, sizeof *x * (size_t)n3);
                memset(f, 0, sizeof *f * (size_t)n3);
                f[3 * node + c] = 1e-3;
                /* each call goes on from the one before */
                for (int call = 0; call < 5; call++)
                    CHECK(b.body->compliance->solve(b.body->compliance->self, b.body, f, u));
                double load[3] = {0}, more[3];
                if (b.body->external_force) pal_copy3(load, b.body->external_force + 3 * node);
                pal_add3(more, load, f + 3 * node);
                pal_world_load(b.world, 0, node, more);
                REQUIRE(!rest(&b));
                double error = 0, size = 0;
                for (int d = 0; d < 3; d++) {
                    double moved = b.body->x[3 * node + d] - x[3 * node + d];
                    error += (u[3 * node + d] - moved) * (u[3 * node + d] - moved), size += moved * moved;
                }
                worst = fmax(worst, sqrt(error / size));
                pal_world_load(b.world, 0, node, load);
                REQUIRE(!rest(&b));
            }
            printf("  %g Pa, node %d: compliance within %.2g %%\n", traction[k], node, 100 * worst);
            CHECK_LE(worst, k ? 0.05 : 1e-3);
            free(x), free(f), free(u);
            beam_free(&b);
        }
}

/* one call for the same force, at load and after the body was bent and reset */
static void a_reset_forgets_compliances(void)
{
    fem_beam b;
    beam_reference(&b, 4);
    beam_element(&b, "hex8_bbar", "corotational");
    beam_solver(&b, "static_newton");
    pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "tool_push");
    pal_tools_default(b.scene, 1);
    b.scene->tool[0].radius_m = 0.01;
    REQUIRE(!beam_open(&b, &diag));
    REQUIRE(b.body->compliance != NULL);
    const int n3 = 3 * b.body->n_node, node = box_node((const int[3]){16, 4, 4}, 16, 2, 4);
    double *f = calloc(3 * (size_t)n3, sizeof *f), *first = f + n3, *u = first + n3;
    REQUIRE(f != NULL);
    f[3 * node + 2] = 1e-3;
    CHECK(b.body->compliance->solve(b.body->compliance->self, b.body, f, first));
    beam_load_end(&b, 800);
    REQUIRE(!rest(&b));
    CHECK(b.body->compliance->solve(b.body->compliance->self, b.body, f, u));
    CHECK(fabs(u[3 * node + 2] - first[3 * node + 2]) > 1e-2 * fabs(first[3 * node + 2]));
    pal_world_reset(b.world);
    CHECK(b.body->compliance->solve(b.body->compliance->self, b.body, f, u));
    CHECK(memcmp(u, first, sizeof *u * (size_t)n3) == 0);
    free(f);
    beam_free(&b);
}

int main(void)
{
    RUN(a_slender_beam_bends_as_timoshenko_says);
    RUN(supports_bear_the_load);
    RUN(may_be_followed_step_by_step);
    RUN(gravity_stretches_a_hanging_bar);
    RUN(inertia_relief_balances_what_nothing_holds);
    RUN(refuses_what_has_no_rest);
    RUN(all_held_is_at_rest);
    RUN(large_strain_converges);
    RUN(turned_corners_keep_the_law);
    RUN(rests_under_next_to_no_load);
    RUN(starts_again_after_a_reset);
    RUN(compliance_is_that_of_the_bent_body);
    RUN(a_reset_forgets_compliances);
    return check_report();
}
