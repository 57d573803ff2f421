/* Model fem under implicit_euler and sdirk2: what is conserved, what may only fall, the order of both methods, the
 * beam's own frequency, long steps, and that a step neither touches the heap nor depends on the clock. */
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/random.h"
#include "tests/heap_calls.h"

static pal_diagnostic diag;

static const char *const solvers[] = {"implicit_euler", "sdirk2"};
static const char *const elements[] = {"hex8_bbar", "hex8", "tet4", "tet10"};

/* a numbers in [-1, 1] that is the same everywhere */
static double load_work(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_node && body->external_force; i++)
        sum += body->external_force[i] * (body->x[i] - body->x_rest[i]);
    return sum;
}

/* with rows of contact too, as long as nothing touches */
static void a_free_body_keeps_its_momentum(void)
{
    for (int s = 0; s < 4; s++)
        for (int e = 0; e < 4; e++) {
            fem_beam b;
            beam_make(&b, 4, 2, 2, 0.01, false);
            beam_element(&b, elements[e], "corotational");
            beam_solver(&b, solvers[s % 2]);
            if (s >= 2) {
                pal_tools_default(b.scene, 2);
                pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "tool_push");
                pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[1]", "tool_grasp");
            }
            REQUIRE(!beam_open(&b, &diag));
            pal_pose pose = {.quat = {1, 0, 0, 0}, .position_m = {-1, 0, 0}, .buttons = 1};
            for (int t = 0; t < 2 && s >= 2; t++) CHECK_INT(pal_world_pose(b.world, t, &pose), 0);
            uint64_t seed = 1;
            double before[3], now[3], size = 0;
            for (int i = 0; i < 3 * b.body->n_node; i++)
                b.body->v[i] = 0.02 * random_signed(&seed) + (i % 3 == 0 ? 0.03 : 0);
            for (int i = 0; i < 3 * b.body->n_node; i++) size += b.body->mass_kg[i / 3] * fabs(b.body->v[i]);
            body_momentum(b.body, before);
            for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            body_momentum(b.body, now);
            for (int c = 0; c < 3; c++) CHECK_NEAR(now[c], before[c], 1e-11 * size);
            beam_free(&b);
        }
}

/* with a constant load, energy less the load's work */
static void energy_never_rises_in_an_euler_step(void)
{
    for (int newton = 1; newton <= 30; newton += 29)
        for (int e = 0; e < 4; e++)
            for (int law = 0; law < 2; law++) {
                fem_beam b;
                beam_make(&b, 6, 2, 2, 0.02, true);
                beam_element(&b, elements[e], law ? "neo_hookean" : "corotational");
                beam_key(&b, "newton", newton);
                beam_key(&b, "tolerance", newton > 1 ? 1e-9 : 1e-2);
                REQUIRE(!beam_open(&b, &diag));
                beam_load_end(&b, 1500);
                double before = 0, max = 0, lowest = 0, rise = 0;
                for (int i = 0; i < CHECK_REPEATS(90, 15); i++) {
                    REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                    double now = pal_world_energy_J(b.world) - load_work(b.body);
                    rise = fmax(rise, now - before);
                    before = now, lowest = fmin(lowest, now);
                    max = fmax(max, pal_body_kinetic_J(b.body));
                }
                /* a single linearised step promises it for the corotational law only */
                if (newton > 1 || law == 0) CHECK_LE(rise, 1e-6 * -lowest);
                CHECK(max > 1e-3 * -lowest);
                beam_free(&b);
            }
}

/* position of the end after 40 ms of swinging, in n steps */
static void swing(const char *solver, int n, double end[3])
{
    fem_beam b;
    beam_make(&b, 5, 2, 2, 0.025, true);
    beam_element(&b, "hex8_bbar", "corotational");
    b.def->material.poisson = 0.3;
    beam_solver(&b, solver);
    beam_key(&b, "newton", 60);
    beam_key(&b, "tolerance", 1e-11);
    b.scene->step_s = fmax(1e-4, 0.04 / n);
    if (beam_open(&b, &diag)) return;
    for (int i = 0; i < b.body->n_node; i++) {
        double at = b.body->x_rest[3 * i] / b.length_m;
        b.body->v[3 * i + 2] = at * at * (6 - 4 * at + at * at) / 3;
    }
    for (int i = 0; i < n; i++) pal_world_step(b.world, 0.04 / n);
    beam_end(&b, end);
    beam_free(&b);
}

static void steps_have_the_order_of_their_method(void)
{
    double exact[3], end[3], error[3];
    swing("sdirk2", 2048, exact);
    for (int s = 0; s < 2; s++) {
        for (int k = 0; k < 3; k++) {
            swing(solvers[s], (s ? 48 : 192) << k, end);
            error[k] = 0;
            for (int c = 0; c < 3; c++) error[k] += (end[c] - exact[c]) * (end[c] - exact[c]);
            error[k] = sqrt(error[k]);
        }
        double order[2] = {log2(error[0] / error[1]), log2(error[1] / error[2])};
        printf("  %s: errors %.3g %.3g %.3g mm, orders %.2f %.2f\n", solvers[s], 1e3 * error[0], 1e3 * error[1],
               1e3 * error[2], order[0], order[1]);
        CHECK_NEAR(order[1], s + 1, 0.25);
    }
}

/* clamped beam, first bending mode: reference 1.9477 Hz at nu 0.3 (shared/reference/beam) */
static void the_beam_swings_at_its_own_frequency(void)
{
    fem_beam b;
    const double dt = 4e-3;
    beam_reference(&b, 8);
    beam_element(&b, "hex8_bbar", "linear");
    b.def->material.poisson = 0.3;
    beam_solver(&b, "sdirk2");
    beam_key(&b, "tolerance", 1e-4);
    b.scene->step_s = dt;
    REQUIRE(!beam_open(&b, &diag));
    /* the shape of the first mode, nearly */
    for (int i = 0; i < b.body->n_node; i++) {
        double s = b.body->x_rest[3 * i] / b.length_m;
        b.body->v[3 * i + 2] = 0.01 * s * s * (6 - 4 * s + s * s) / 3;
    }
    double before = 0, crossing[8], end[3];
    int n = 0;
    for (int i = 0; i < 280 && n < 4; i++) {
        REQUIRE(!pal_world_step(b.world, dt));
        beam_end(&b, end);
        if (i > 3 && before * end[2] < 0) crossing[n++] = dt * (i + before / (before - end[2]));
        before = end[2];
    }
    REQUIRE(n == 4);
    double frequency = 1.5 / (crossing[3] - crossing[0]);
    printf("  %.4f Hz, reference 1.9477\n", frequency);
    CHECK_NEAR(frequency / 1.9477, 1, 0.02);
    beam_free(&b);
}

static void long_steps_stay_bounded_and_come_to_rest(void)
{
    static const double factor[] = {10, 100};
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 2; k++)
            for (int e = 0; e < 3; e += 2) {
                fem_beam b;
                beam_make(&b, 8, 2, 2, 0.02, true);
                beam_element(&b, elements[e], "corotational");
                beam_solver(&b, solvers[s]);
                b.def->material.damping_1_s = 1;
                REQUIRE(!beam_open(&b, &diag));
                beam_load_end(&b, 1000);
                double highest = -INFINITY, lowest = INFINITY, rest[3], end[3];
                for (int i = 0; i < 120; i++) {
                    REQUIRE(!pal_world_step(b.world, factor[k] / 60));
                    double now = pal_world_energy_J(b.world) - load_work(b.body);
                    highest = fmax(highest, now), lowest = fmin(lowest, now);
                    if (i == 100) beam_end(&b, rest);
                }
                beam_end(&b, end);
                CHECK(pal_body_finite(b.body));
                CHECK(!b.body->frozen);
                CHECK_LE(highest, 0.01 * -lowest);
                CHECK_NEAR(end[2], rest[2], 1e-3 * b.body->length_scale_m);
                CHECK(end[2] > 0.05 * b.length_m);
                beam_free(&b);
            }
}

static void a_step_calls_no_heap(void)
{
    for (int s = 0; s < 2; s++)
        for (int e = 0; e < 4; e++) {
            fem_beam b;
            beam_make(&b, 6, 2, 2, 0.02, true);
            beam_element(&b, elements[e], "corotational");
            beam_solver(&b, solvers[s]);
            beam_key(&b, "newton", 3);
            pal_entry_put_bool(&b.def->solver, "refresh", false, NULL);
            REQUIRE(!beam_open(&b, &diag));
            beam_load_end(&b, 1000);
            n_heap_call = 0;
            for (int i = 0; i < 20; i++) {
                counting = true;
                pal_err err = pal_world_step(b.world, 1.0 / 60);
                counting = false;
                CHECK_INT(err, 0);
            }
            CHECK_INT(n_heap_call, 0);
            beam_free(&b);
        }
}

/* without loads nothing is left to compare a residual with but rounding: a body that is as near to rest takes no
 * iteration, and no step looks as if it gained energy. Forces of PAL_UNLOADED_FLOOR move a node by 1e-11 of an edge
 * where a cube bears them, and a slender beam's end by (L/h)^3 times as much at most */
static void a_body_at_rest_without_loads_takes_no_iteration(void)
{
    static const char *const solver[] = {"implicit_euler", "sdirk2"};
    for (int k = 0; k < 2; k++) {
        fem_beam b;
        beam_reference(&b, 3);
        b.def->material.damping_1_s = 8;
        beam_solver(&b, solver[k]);
        REQUIRE(!beam_open(&b, &diag));
        for (int i = 0; i < b.body->n_dof; i++) b.body->v[3 * i + 2] = b.body->support[i] ? 0 : b.body->x[3 * i];
        pal_world_invalidate_limits(b.world, 0);
        for (int i = 0; i < 600; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        int n_cg = 0;
        for (int i = 0; i < 60; i++) {
            pal_solve_report report;
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            pal_world_solve_report(b.world, 0, &report);
            n_cg += report.n_cg;
        }
        double off = 0;
        for (int i = 0; i < 3 * b.body->n_dof; i++) off = fmax(off, fabs(b.body->x[i] - b.body->x_rest[i]));
        printf("  %s: %d iterations in 60 steps, %d searches, %.1e of S off rest\n", solver[k], n_cg,
               (int)b.body->safeguards.n_search, off / b.body->length_scale_m);
        CHECK_INT(n_cg, 0);
        CHECK(off < 1e-9 * b.body->length_scale_m);
        CHECK_INT(b.body->safeguards.n_search, 0);
        beam_free(&b);
    }
}

/* refreshed factors come into use at steps that do not depend on the clock, and a reset forgets them */
static void a_run_with_refreshed_factors_repeats(void)
{
    uint64_t hash[3] = {0};
    int n_factor = 0;
    for (int k = 0; k < 2; k++) {
        fem_beam b;
        beam_make(&b, 16, 4, 4, 0.0125, true);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_key(&b, "refresh_iterations", 2);
        REQUIRE(!beam_open(&b, &diag));
        for (int turn = 0; turn <= k; turn++) {
            beam_load_end(&b, 1500);
            for (int i = 0; i < 90; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            hash[k + turn] = pal_world_hash(b.world);
            pal_solve_report report;
            CHECK(pal_world_solve_report(b.world, 0, &report));
            if (turn == 0) n_factor = report.n_factor;
            pal_world_reset(b.world);
        }
        beam_free(&b);
    }
    printf("  %d factors in 90 steps\n", n_factor);
    CHECK(n_factor > 2);
    CHECK(hash[0] == hash[1]);
    CHECK(hash[0] == hash[2]);
}

static void a_refreshed_factor_saves_iterations(void)
{
    int n_cg[2] = {0};
    for (int k = 0; k < 2; k++) {
        fem_beam b;
        beam_make(&b, 16, 4, 4, 0.0125, true);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_key(&b, "refresh_iterations", 4);
        pal_entry_put_bool(&b.def->solver, "refresh", k, NULL);
        b.def->material.damping_1_s = 10;
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 2500);
        for (int i = 0; i < 240; i++) {
            pal_solve_report report;
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            pal_world_solve_report(b.world, 0, &report);
            n_cg[k] += report.n_cg;
        }
        beam_free(&b);
    }
    printf("  iterations of 240 steps: %d, with refresh %d\n", n_cg[0], n_cg[1]);
    CHECK(n_cg[1] < n_cg[0]);
}

static void all_held_and_one_element_are_fine(void)
{
    for (int s = 0; s < 2; s++)
        for (int e = 0; e < 4; e++)
            for (int fixed = 0; fixed < 3; fixed++) {
                fem_beam b;
                beam_make(&b, 1, 1, 1, 1, fixed > 0);
                beam_element(&b, elements[e], "corotational");
                beam_solver(&b, solvers[s]);
                pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "gravity");
                if (fixed == 2) b.def->support[0].high_m[0] = 2;
                REQUIRE(!beam_open(&b, &diag));
                for (int i = 0; i < 30; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                double drop = b.body->x_rest[0] - b.body->x[0], fall = b.body->x_rest[2] - b.body->x[2];
                CHECK(pal_body_finite(b.body));
                CHECK_NEAR(drop, 0, fixed ? 0 : 1e-6);
                /* backward Euler falls g dt^2 n (n + 1) / 2 in n steps; sdirk2 falls right */
                if (!fixed) CHECK_NEAR(fall, s ? 9.81 * 0.125 : 9.81 / 3600 * 465, 1e-6);
                if (fixed == 2) CHECK_NEAR(fall, 0, 0);
                beam_free(&b);
            }
}

static void drag_is_implicit_however_strong(void)
{
    for (int s = 0; s < 2; s++) {
        fem_beam b;
        beam_make(&b, 2, 2, 2, 0.02, false);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_solver(&b, solvers[s]);
        b.def->material.damping_1_s = 6;
        REQUIRE(!beam_open(&b, &diag));
        for (int i = 0; i < b.body->n_node; i++) b.body->v[3 * i] = 0.1;
        for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        double expect = s ? 0.1 * exp(-6.0) : 0.1 * pow(1 + 6.0 / 60, -60);
        CHECK_NEAR(b.body->v[0] / expect, 1, s ? 0.02 : 1e-6);
        beam_free(&b);
        beam_make(&b, 2, 2, 2, 0.02, false);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_solver(&b, solvers[s]);
        b.def->material.damping_1_s = 1e9;
        REQUIRE(!beam_open(&b, &diag));
        for (int i = 0; i < b.body->n_node; i++) b.body->v[3 * i] = 0.1;
        for (int i = 0; i < 10; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK_LE(fabs(b.body->v[0]), 0.1);
        CHECK(pal_body_finite(b.body));
        beam_free(&b);
    }
}

static void a_state_that_is_no_number_freezes_the_body(void)
{
    fem_beam b;
    beam_make(&b, 2, 2, 2, 0.02, true);
    beam_element(&b, "hex8_bbar", "corotational");
    pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "finite_guard");
    REQUIRE(!beam_open(&b, &diag));
    REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    b.body->v[30] = NAN;
    CHECK_INT(pal_world_step(b.world, 1.0 / 60), PAL_ERR_FROZEN);
    CHECK(pal_body_finite(b.body));
    pal_world_reset(b.world);
    CHECK_INT(pal_world_step(b.world, 1.0 / 60), 0);
    beam_free(&b);
}

static void an_edited_material_is_that_of_a_world_made_with_it(void)
{
    uint64_t hash[2];
    for (int k = 0; k < 2; k++) {
        fem_beam b;
        beam_make(&b, 6, 2, 2, 0.02, true);
        beam_element(&b, "hex8_bbar", "corotational");
        pal_material to = b.def->material;
        to.young_Pa *= 3, to.poisson = 0.3, to.density_kg_m3 = 2000;
        if (k) b.def->material = to;
        REQUIRE(!beam_open(&b, &diag));
        if (!k) CHECK_INT(pal_world_material(b.world, 0, &to, &diag), 0);
        beam_load_end(&b, 1000);
        for (int i = 0; i < 30; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        hash[k] = pal_world_hash(b.world);
        beam_free(&b);
    }
    CHECK(hash[0] == hash[1]);
}

static void refuses_what_it_cannot_take(void)
{
    static const char *const expect[] = {"row \"edge_distance\" has no tangent, which its implicit solver needs",
                                         "needs a mesh of voxels and this one has no hexahedra",
                                         "\"hex9\", wanted \"hex8_bbar\", \"hex8\", \"tet4\" or \"tet10\"",
                                         "unknown key \"stiffer\"",
                                         "tolerance: 2 is outside",
                                         "\"jelly\""};
    for (int k = 0; k < 6; k++) {
        fem_beam b;
        beam_make(&b, 2, 2, 2, 0.02, true);
        if (k == 0) pal_entry_init(&b.def->model, "model", "tet_springs");
        if (k == 1) pal_hexes_free(&b.mesh.hexes), pal_entry_put_text(&b.def->model, "element", "hex8", NULL);
        if (k == 2) pal_entry_put_text(&b.def->model, "element", "hex9", NULL);
        if (k == 3) pal_entry_put_number(&b.def->model, "stiffer", 1, NULL);
        if (k == 4) beam_key(&b, "tolerance", 2);
        if (k == 5) pal_entry_put_text(&b.def->model, "law", "jelly", NULL);
        pal_world *world = NULL;
        CHECK_INT(pal_world_create(b.scene, &diag, &world), PAL_ERR_REFUSED);
        if (!strstr(diag.text, expect[k])) CHECK_TEXT(diag.text, expect[k]);
        if (world) pal_world_destroy(world);
        beam_free(&b);
    }
}

int main(void)
{
    RUN(a_free_body_keeps_its_momentum);
    RUN_LONG(energy_never_rises_in_an_euler_step);
    RUN_LONG(steps_have_the_order_of_their_method);
    RUN_LONG(the_beam_swings_at_its_own_frequency);
    RUN(long_steps_stay_bounded_and_come_to_rest);
    RUN(a_step_calls_no_heap);
    RUN(a_body_at_rest_without_loads_takes_no_iteration);
    RUN(a_run_with_refreshed_factors_repeats);
    RUN(a_refreshed_factor_saves_iterations);
    RUN(all_held_and_one_element_are_fine);
    RUN(drag_is_implicit_however_strong);
    RUN(a_state_that_is_no_number_freezes_the_body);
    RUN(an_edited_material_is_that_of_a_world_made_with_it);
    RUN(refuses_what_it_cannot_take);
    return check_report();
}
