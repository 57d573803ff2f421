/* Hard cases (catalogue.txt) for model subdivision_fem: motion. Drag without end or none, momentum and energy,
 * nothing held. */
#include "tests/fixtures/body_sums.h"
#include "tests/stability/hard_case.h"
#include "tests/stability/subdivision_case.h"

static void drag_without_end_creeps(void)
{
    for (int k = 0; k < 2; k++) {
        solid_scene s;
        solid_make(&s, &solid_kinds[k], 2, 2, 2, true);
        s.def->material.damping_1_s = 1e8;
        REQUIRE(solid_scene_open(&s));
        for (int i = 0; i < s.body->n_dof; i++) s.body->x[3 * i] += 0.2 * s.body->x[3 * i + 2];
        pal_body_update_nodes(s.body);
        pal_world_invalidate_limits(s.world, 0);
        double before = solid_rms(s.body), first = before;
        for (int i = 0; i < 20; i++) {
            REQUIRE(solid_scene_step(&s, 1, solid_step_s));
            HARD_CASE("drag", "subdivision_fem", "distance from rest over that of the step before",
                      solid_rms(s.body) / before, 1 + 1e-12, "");
            before = solid_rms(s.body);
        }
        CHECK(before < first && before > 0.99 * first);
        solid_scene_close(&s);
    }
}

/* without drag: of leapfrog steps, whose v stands half a sub-step before x, the energy is that of x with v before and
 * after it, 1/2 v- M v+ + U(x). Steps of half the limit, each one sub-step */
static double ripple(int n_level, int n_step)
{
    solid_scene s;
    const int n = n_level > 0 ? 2 : 1;
    double first = NAN, max = 0;
    solid_make(&s, &solid_kinds[SOLID_EXPLICIT], 2, n, 2, true);
    pal_entry_put_number(&s.def->model, "levels", n_level, NULL);
    s.def->material.damping_1_s = 0;
    pal_entry_put_number(&s.def->solver, "safety", 0.6, NULL);
    if (!solid_scene_open(&s)) return INFINITY;
    const int n3 = 3 * s.body->n_dof;
    double *momentum = calloc((size_t)n3, sizeof *momentum);
    const double dt_s = pal_world_limit_s(s.world) * 5 / 6;
    for (int i = 0; i < s.body->n_dof; i++) s.body->x[3 * i] += 0.3 * s.body->x[3 * i + 2];
    pal_body_update_nodes(s.body);
    pal_world_invalidate_limits(s.world, 0);
    for (int i = 0; i < n_step; i++) {
        /* U where the body is, v before it; v after it comes with the next step */
        const double rest = pal_world_energy_J(s.world) - pal_body_kinetic_J(s.body);
        double kinetic = 0;
        pal_mass_operator_multiply(s.body->mass_operator, 1, 0, NULL, s.body->v, momentum);
        CHECK(solid_scene_step(&s, 1, dt_s) && pal_world_substeps(s.world) == 1);
        for (int k = 0; k < n3; k++) kinetic += 0.5 * momentum[k] * s.body->v[k];
        /* the first step is half of one, from standing still: it has no v before */
        if (i == 1) first = rest + kinetic;
        if (i > 1) max = fmax(max, fabs((rest + kinetic) / first - 1));
    }
    printf("  %d levels, %d sub-steps of half the limit: energy off by %.3g %% at most\n", n_level, n_step, 100 * max);
    free(momentum);
    solid_scene_close(&s);
    return 100 * max;
}

/* what the world tells of it takes v as it is, half a sub-step early: a ripple where much moves fast */
static void the_energy_that_is_shown_ripples(void)
{
    solid_scene s;
    solid_make(&s, &solid_kinds[SOLID_EXPLICIT], 2, 2, 2, true);
    s.def->material.damping_1_s = 0;
    pal_entry_put_number(&s.def->solver, "safety", 0.5, NULL);
    REQUIRE(solid_scene_open(&s));
    for (int i = 0; i < s.body->n_dof; i++) s.body->x[3 * i] += 0.3 * s.body->x[3 * i + 2];
    pal_body_update_nodes(s.body);
    pal_world_invalidate_limits(s.world, 0);
    const double first = pal_world_energy_J(s.world);
    double max = 0, min = INFINITY;
    for (int i = 0; i < CHECK_REPEATS(120, 20); i++) {
        REQUIRE(solid_scene_step(&s, 1, solid_step_s));
        max = fmax(max, pal_world_energy_J(s.world)), min = fmin(min, pal_world_energy_J(s.world));
    }
    printf("  shown: between %.4f and %.4f of the first\n", min / first, max / first);
    CHECK_LE(max, 1.06 * first);
    CHECK(min > 0.94 * first);
    solid_scene_close(&s);
}

static void without_drag_energy_stays(void)
{
    HARD_CASE("no_drag", "subdivision_fem", "explicit: energy off the first", ripple(1, CHECK_REPEATS(1500, 60)), 1,
              "%");
    HARD_CASE("no_drag", "subdivision_fem", "explicit, 100,000 sub-steps: energy off the first",
              ripple(0, CHECK_REPEATS(100000, 600)), 1, "%");
}

/* a free body of nx x 2 x 2 or nx x 1 x 1 cells that spins, bends and flies: momentum stays, angular momentum where
 * forces have an energy never grows. Returns the drift over the sum of what its parts have */
static double fly(int kind, int n_level, int n_step, double dt_s)
{
    solid_scene s;
    double p[2][3], l[2][3], of = 0, drift = 0, spin = 0;
    const int n = n_level > 0 ? 2 : 1;
    solid_make(&s, &solid_kinds[kind], 2, n, n, false);
    pal_entry_put_number(&s.def->model, "levels", n_level, NULL);
    s.def->material.damping_1_s = 0;
    if (!solid_scene_open(&s)) return INFINITY;
    solid_kick(&s, 0.2, 5);
    for (int i = 0; i < s.body->n_dof; i++) {
        s.body->v[3 * i] += 0.5 - 10 * (s.body->x[3 * i + 1] - 0.02);
        s.body->v[3 * i + 1] += 10 * (s.body->x[3 * i] - 0.02);
    }
    solid_momentum(s.body, p[0], l[0]);
    for (int i = 0; i < s.body->n_dof; i++) of += s.body->mass_kg[i] * pal_norm3(s.body->v + 3 * i);
    for (int i = 0; i < n_step; i++) {
        if (!solid_scene_step(&s, 1, dt_s)) drift = INFINITY;
        solid_momentum(s.body, p[1], l[1]);
        drift = fmax(drift, pal_dist3(p[1], p[0]));
        spin = fmax(spin, pal_norm3(l[1]));
    }
    printf("  %s, %d steps of %g ms: momentum drifts by %.2g, angular momentum ends at %.4f, at most %.4f\n",
           solid_kinds[kind].shown, n_step, 1e3 * dt_s, drift / of, pal_norm3(l[1]) / pal_norm3(l[0]),
           spin / pal_norm3(l[0]));
    if (solid_kinds[kind].energy) CHECK_LE(spin, 1.01 * pal_norm3(l[0]));
    solid_scene_close(&s);
    return drift / of;
}

static void momentum_of_a_free_body_stays(void)
{
    for (int k = 0; k < SOLID_KINDS; k++) {
        CHECK_LE(fly(k, 1, CHECK_REPEATS(120, 12), solid_step_s), 1e-9);
        HARD_CASE("momentum", "subdivision_fem", "drift of momentum", fly(k, 0, CHECK_REPEATS(10000, 60), 0.002), 1e-4,
                  "in 10,000 steps");
    }
}

static void nothing_held_falls_and_statics_refuse(void)
{
    for (int k = 0; k < 2; k++) {
        solid_scene s;
        solid_make(&s, &solid_kinds[k], 2, 2, 2, false);
        s.def->material.damping_1_s = 0;
        s.def->n_effect = 1;
        pal_entry_init(&s.def->effect[0], "effects[0]", "gravity");
        REQUIRE(solid_scene_open(&s));
        const double whole = solid_mass_kg(s.body->model.solid);
        double p[3], l[3];
        REQUIRE(solid_scene_step(&s, 30, solid_step_s));
        solid_momentum(s.body, p, l);
        CHECK_NEAR(p[2] / (-whole * 9.81 * 0.5), 1, 0.01);
        CHECK_LE(pal_world_energy_J(s.world), 1.01 * 0.5 * whole * 4.905 * 4.905);
        solid_scene_close(&s);
    }
    solid_scene s;
    solid_make(&s, &solid_kinds[0], 2, 2, 2, false);
    pal_entry_init(&s.def->solver, "solver", "static_newton");
    CHECK_INT(pal_world_create(s.scene, &s.diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strlen(s.diag.text) > 20);
    solid_scene_close(&s);
}

int main(void)
{
    RUN(drag_without_end_creeps);
    RUN(without_drag_energy_stays);
    RUN(the_energy_that_is_shown_ripples);
    RUN(momentum_of_a_free_body_stays);
    RUN(nothing_held_falls_and_statics_refuse);
    return check_report();
}
