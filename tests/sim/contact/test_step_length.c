/* The same press at 60, 120, 240 and 1,000 steps a second: nothing in contact may depend on the number of steps. */
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"
#include "tests/fixtures/fem_tools.h"

enum { RATES = 4 };
static const int rate_hz[RATES] = {60, 120, 240, 1000};
static const double speed_m_s = 0.01, depth_m = 0.005, radius_m = 0.015, top_m = 0.04;

typedef struct history {
    double pressing_N, held_N, fading_N; /* half way down; held; half of the fade of a tool that has left */
    double pressing_N_m, held_N_m;       /* stiffness that is published for a haptic bridge */
    double rest_m;                       /* after the fade */
} history;

static bool run_s(tool_scene *s, double dt_s, double *time_s, double until_s, double from_m, double speed)
{
    while (*time_s < until_s - 0.5 * dt_s) {
        *time_s += dt_s;
        move_tool(s, 0, 0.04, 0.04, top_m + radius_m + from_m - speed * *time_s, false);
        if (pal_world_step(s->world, dt_s)) return false;
    }
    return true;
}

static double force_N(const tool_scene *s)
{
    return tool_of(s, 0)->mean_force_N[2];
}

/* down at a constant speed, held for a second, then the client leaves and its forces fade within 1/6 s */
static bool press(tool_scene *s, int hz, history *out)
{
    const double dt_s = 1.0 / hz, down_s = depth_m / speed_m_s;
    double time_s = 0;
    if (!run_s(s, dt_s, &time_s, 0.5 * down_s, 0, speed_m_s)) return false;
    out->pressing_N = force_N(s);
    out->pressing_N_m = tool_of(s, 0)->patch[0].k1_N_m;
    if (!run_s(s, dt_s, &time_s, down_s, 0, speed_m_s)) return false;
    time_s = 0;
    if (!run_s(s, dt_s, &time_s, 1, -depth_m, 0)) return false;
    out->held_N = force_N(s);
    out->held_N_m = tool_of(s, 0)->patch[0].k1_N_m;
    pal_world_pose(s->world, 0, NULL);
    for (int i = 0; i < hz / 10; i++)
        if (pal_world_step(s->world, dt_s)) return false;
    out->fading_N = force_N(s);
    for (int i = 0; i < 2 * hz; i++)
        if (pal_world_step(s->world, dt_s)) return false;
    out->rest_m = rms_displacement(s->body);
    return true;
}

/* Bounds against 1,000 steps a second. Held: 1 %, the tolerance of an implicit solver; explicit contact has the same
 * stiffness whatever the sub-step. Pressing: a tool is as far as at the end of its step, so that the tissue is up to
 * two steps of its way behind, 2 v dt of the depth, and as held. Fading: the share of the force is that of the end of
 * the step, off by one step of the fade at most. The published stiffness follows the force, within 2 % more; of
 * springs it is continued from step to step while the press goes on, within 8 %. */
static void compare(bool fem)
{
    const double held_share = 0.01;
    history of[RATES];
    for (int k = 0; k < RATES; k++) {
        fem_scene f;
        REQUIRE(fem_slab(&f, 8, 8, 4, 0.01, 1, radius_m, 15));
        if (!fem) {
            pal_entry_init(&f.s.scene->body[0].model, "model", "tet_springs");
            pal_entry_init(&f.s.scene->body[0].solver, "solver", "verlet");
        }
        f.s.scene->step_s = 1.0 / rate_hz[k];
        REQUIRE(tool_scene_open(&f.s) && press(&f.s, rate_hz[k], &of[k]));
        printf("  %4d Hz: %.4f N, %.4g N/m pressing, %.4f N, %.4g N/m held, %.4f N fading, %.2g m rest\n", rate_hz[k],
               of[k].pressing_N, of[k].pressing_N_m, of[k].held_N, of[k].held_N_m, of[k].fading_N, of[k].rest_m);
        fem_close(&f);
    }
    const history *exact = &of[RATES - 1];
    for (int k = 0; k < RATES - 1; k++) {
        double dt_s = 1.0 / rate_hz[k], held = exact->held_N;
        CHECK_NEAR(of[k].held_N, held, held_share * held);
        CHECK_NEAR(of[k].pressing_N, exact->pressing_N,
                   exact->pressing_N * (held_share + 2 * speed_m_s * dt_s / (0.5 * depth_m)));
        CHECK_NEAR(of[k].fading_N, exact->fading_N, held * (held_share + dt_s / (1.0 / 6)));
        CHECK_NEAR(of[k].pressing_N_m, exact->pressing_N_m, (fem ? 0.03 : 0.08) * exact->pressing_N_m);
        CHECK_NEAR(of[k].held_N_m, exact->held_N_m, (held_share + 0.02) * exact->held_N_m);
        CHECK_LE(of[k].rest_m, 1e-4 * 0.1);
    }
}

static void an_implicit_press_is_the_same_at_every_step_length(void)
{
    compare(true);
}

static void an_explicit_press_is_the_same_at_every_step_length(void)
{
    compare(false);
}

/* A force that turns by 60 degrees: the side follows it within a time, by as much after 0.1 s in few steps as in many.
 * The blend of unit vectors is exact for a small turn; for this one the steps differ by 0.2 degrees (measured) */
static void a_proxys_side_turns_as_far_at_every_step_length(void)
{
    double angle[RATES];
    for (int k = 0; k < RATES; k++) {
        pal_tool_contact t = {.proxy.normal = {0, 0, 1}, .total = {sin(M_PI / 3), 0, cos(M_PI / 3)}};
        for (int i = 0; i < rate_hz[k] / 10; i++) pal_push_follow_side(&t, t.proxy.normal, 1.0 / rate_hz[k]);
        angle[k] = atan2(t.proxy.normal[0], t.proxy.normal[2]) * 180 / M_PI;
        printf("  %4d Hz: turned by %.3f degrees\n", rate_hz[k], angle[k]);
        CHECK_NEAR(angle[k], angle[0], 1);
    }
    CHECK_NEAR(angle[RATES - 1], 60 * (1 - exp(-0.1 / FOLLOW_S)), 5);
}

/* A stretched slab without damping that has no more sub-steps than at rest gets mass in their place: it keeps its
 * energy */
static void added_mass_gains_no_energy(void)
{
    for (int k = 0; k < 2; k++) {
        const double stretch = k ? 3 : 1.5;
        tool_scene s;
        REQUIRE(slab_scene(&s, 12, 3, 3, 0.01, 1, 0.015, 15));
        s.scene->body[0].material.damping_1_s = 0;
        REQUIRE(!pal_entry_put_bool(&s.scene->body[0].model, "recover", false, NULL));
        s.scene->body[0].n_effect = 0;
        s.scene->step_s = 1.0 / 60;
        REQUIRE(tool_scene_open(&s));
        s.scene->max_substep = (k ? 2 : 1) * pal_world_substeps(s.world);
        pal_world_destroy(s.world);
        REQUIRE(tool_scene_open(&s));
        for (int i = 0; i < s.body->n_dof; i++)
            if (!s.body->support[i]) s.body->x[3 * i] *= stretch;
        pal_world_invalidate_limits(s.world, 0);
        const double first = pal_world_energy_J(s.world);
        double largest = 0;
        for (int i = 0; i < 200 && step_world(&s, 1); i++) largest = fmax(largest, pal_world_energy_J(s.world));
        CHECK(s.body->safeguards.n_mass_scaled > 0);
        CHECK_INT(s.body->safeguards.n_clamped, 0);
        CHECK_LE(largest, first);
        tool_scene_close(&s);
    }
}

/* what a solver has learnt of a grasp is forgotten by a reset */
static void a_grasp_after_a_reset_repeats_the_first(void)
{
    fem_scene f;
    uint64_t hash[3];
    REQUIRE(fem_slab(&f, 8, 8, 4, 0.01, 1, 0.015, 15));
    f.s.scene->step_s = 1.0 / 60;
    REQUIRE(tool_scene_open(&f.s));
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 38; i++) {
            const double t = i / 60.0;
            move_tool(&f.s, 0, 0.04, 0.04 + 0.01 * t, 0.04 + 0.005 * (i > 5 ? t : 0), i > 3);
            REQUIRE(step_world(&f.s, 1));
        }
        CHECK(tool_of(&f.s, 0)->holding);
        hash[k] = pal_world_hash(f.s.world);
        pal_world_reset(f.s.world);
    }
    CHECK(hash[0] == hash[1] && hash[0] == hash[2]);
    fem_close(&f);
}

int main(void)
{
    RUN(a_proxys_side_turns_as_far_at_every_step_length);
    RUN(an_implicit_press_is_the_same_at_every_step_length);
    RUN(an_explicit_press_is_the_same_at_every_step_length);
    RUN(added_mass_gains_no_energy);
    RUN(a_grasp_after_a_reset_repeats_the_first);
    return check_report();
}
