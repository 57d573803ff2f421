/* tool_grasp: holding, pulling and letting go of tissue. */
#include "tests/fixtures/tool_scene.h"

static bool grasp_ball(tool_scene *s, int n_tool, bool fixed, double cap_N)
{
    if (!ball_scene(s, 8, fixed, n_tool, 0.008, cap_N)) return false;
    return tool_scene_open(s);
}

static void begins_without_a_jump_and_pulls_tissue_along(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    move_tool(&s, 0, 0, 0, 0.059, false);
    REQUIRE(step_world(&s, 12));
    int top = 0;
    for (int i = 0; i < s.body->display.n_shown; i++)
        if (s.body->display.shown[3 * i + 2] > s.body->display.shown[3 * top + 2]) top = i;
    double before = (double)s.body->display.shown[3 * top + 2];
    move_tool(&s, 0, 0, 0, 0.059, true);
    REQUIRE(step_world(&s, 1));
    CHECK(tool_of(&s, 0)->holding);
    CHECK_LE(pal_norm3(tool_of(&s, 0)->mean_force_N), 1e-9);
    for (int i = 1; i <= 60; i++) {
        move_tool(&s, 0, 0, 0, 0.059 + 0.0002 * i, true);
        REQUIRE(step_world(&s, 1));
        double load[3];
        sum_loads(s.body, load);
        for (int c = 0; c < 3; c++) CHECK_NEAR(load[c], -tool_of(&s, 0)->force_N[c], 1e-9);
    }
    double moved = (double)s.body->display.shown[3 * top + 2] - before;
    const double *f = tool_of(&s, 0)->mean_force_N;
    printf("  tool 12 mm up, tissue %.3g mm, %.3g N\n", 1e3 * moved, pal_norm3(f));
    CHECK(moved > 0.006 && moved < 0.014);
    CHECK(f[2] < -0.3 && -f[2] > 0.95 * pal_norm3(f));
    tool_scene_close(&s);
}

/* a single tetrahedron, free, no damping in tissue: its mean follows one mass on the spring */
static void moves_a_free_body_as_a_mass_on_a_spring(void)
{
    tool_scene s;
    memset(&s, 0, sizeof s);
    REQUIRE(!box_one_tet(0.02, &s.mesh));
    tool_scene_fill(&s, "surface_output", false, 1, 0.004, 15);
    pal_body_def *def = &s.scene->body[0];
    def->material.damping_1_s = 0;
    def->n_effect = 0;
    pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "tool_grasp");
    REQUIRE(!pal_entry_put_number(&def->effect[0], "stiffness_N_m", 0.5, NULL));
    REQUIRE(!pal_entry_put_number(&def->effect[0], "damping_s", 0, NULL));
    REQUIRE(!pal_entry_put_number(&def->effect[0], "reach_m", 10, NULL));
    REQUIRE(tool_scene_open(&s));
    double mass = 0;
    for (int i = 0; i < 4; i++) mass += s.body->mass_kg[i];
    double at = 0.005, far = 0.003;
    move_tool(&s, 0, at, at, at, false);
    REQUIRE(step_world(&s, 12));
    move_tool(&s, 0, at, at, at, true);
    REQUIRE(step_world(&s, 1));
    REQUIRE(tool_of(&s, 0)->holding);
    double y0 = mean_move(s.body, 0), t0 = s.scene->step_s, worst = 0;
    /* a reach of 10 m weighs all four nodes alike, so only the mean moves: m y'' = k (far - y), and the tool gets there
     * evenly within the first step: y = far (1 - sin(w t) - sin(w (t - t0)) over w t0) */
    double w = sqrt(0.5 / mass);
    move_tool(&s, 0, at + far, at, at, true);
    for (int i = 1; i <= 60; i++) {
        REQUIRE(step_world(&s, 1));
        double t = i * t0, y = far * (1 - (sin(w * t) - sin(w * (t - t0))) / (w * t0));
        worst = fmax(worst, fabs(mean_move(s.body, 0) - y0 - y));
    }
    printf("  mass %.3g g, period %.3g s, off by %.2g of the way\n", 1e3 * mass, 2 * M_PI / w, worst / far);
    CHECK_LE(worst, 0.03 * far);
    tool_scene_close(&s);
}

static void lets_go_when_the_button_goes_up(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    for (int i = 0; i < 40; i++) {
        move_tool(&s, 0, 0, 0, 0.059 + (i > 14 ? 0.0003 * (i - 14) : 0), i >= 13);
        REQUIRE(step_world(&s, 1));
    }
    CHECK(tool_of(&s, 0)->holding && tool_of(&s, 0)->has_grasp);
    move_tool(&s, 0, 0, 0, 0.07, false);
    REQUIRE(step_world(&s, 1));
    CHECK(!tool_of(&s, 0)->holding && !tool_of(&s, 0)->has_grasp);
    CHECK(pal_norm3(tool_of(&s, 0)->mean_force_N) == 0);
    REQUIRE(step_world(&s, 300));
    CHECK_LE(rms_displacement(s.body), 1e-3 * s.body->length_scale_m);
    tool_scene_close(&s);
}

/* the ball of a tool that holds stays inside the tissue it holds: no push may work against the grip */
static void a_tool_that_holds_does_not_push_as_well(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    move_tool(&s, 0, 0, 0, 0.052, false);
    REQUIRE(step_world(&s, 12));
    move_tool(&s, 0, 0, 0, 0.052, true);
    REQUIRE(step_world(&s, 2));
    for (int i = 1; i <= 40; i++) {
        move_tool(&s, 0, 0.0003 * i, 0, 0.052, true);
        REQUIRE(step_world(&s, 1));
        CHECK(tool_of(&s, 0)->holding && !tool_of(&s, 0)->touching);
    }
    /* let go, it pushes again */
    move_tool(&s, 0, 0, 0, 0.044, false);
    REQUIRE(step_world(&s, 20));
    CHECK(!tool_of(&s, 0)->holding && tool_of(&s, 0)->touching);
    tool_scene_close(&s);
}

static void fades_when_its_user_is_gone(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    for (int i = 0; i < 40; i++) {
        move_tool(&s, 0, 0, 0, 0.059 + (i > 14 ? 0.0003 * (i - 14) : 0), i >= 13);
        REQUIRE(step_world(&s, 1));
    }
    double last = pal_norm3(tool_of(&s, 0)->mean_force_N), first = last;
    pal_world_pose(s.world, 0, NULL);
    for (int i = 0; i < 11; i++) {
        REQUIRE(step_world(&s, 1));
        double now = pal_norm3(tool_of(&s, 0)->mean_force_N);
        /* tissue that was pulled until now swings on for a step, by 1.4 % of the force */
        CHECK(now <= last * 1.02 + 1e-12);
        CHECK_LE(last - now, 0.4 * first);
        last = now;
    }
    CHECK(last == 0);
    CHECK(!tool_of(&s, 0)->holding);
    tool_scene_close(&s);
}

static void takes_nothing_out_of_reach_and_the_nearest_just_beyond(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    move_tool(&s, 0, 0, 0, 0.05 + 0.025, false);
    REQUIRE(step_world(&s, 1));
    move_tool(&s, 0, 0, 0, 0.05 + 0.025, true);
    REQUIRE(step_world(&s, 1));
    CHECK(!tool_of(&s, 0)->holding);
    /* reach is 16 mm; 20 mm is within 1.5 reach */
    move_tool(&s, 0, 0, 0, 0.05 + 0.02, false);
    REQUIRE(step_world(&s, 2));
    move_tool(&s, 0, 0, 0, 0.05 + 0.02, true);
    REQUIRE(step_world(&s, 1));
    CHECK(tool_of(&s, 0)->holding);
    tool_scene_close(&s);
}

static void never_exceeds_its_cap(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 0.5));
    double max_N = 0;
    for (int i = 0; i < 60; i++) {
        move_tool(&s, 0, 0, 0, 0.059 + (i > 14 ? 0.002 * (i - 14) : 0), i >= 13);
        REQUIRE(step_world(&s, 1));
        max_N = fmax(max_N, pal_norm3(tool_of(&s, 0)->force_N));
    }
    CHECK(max_N > 0.499);
    CHECK_LE(max_N, 0.5 + 1e-12);
    tool_scene_close(&s);
}

static void tells_the_bridge_a_force_and_a_stiffness_that_agree(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 1, true, 15));
    double force[90];
    for (int i = 0; i < 90; i++) {
        move_tool(&s, 0, 0, 0, 0.059 + (i > 14 ? 0.0001 * (i - 14) : 0), i >= 13);
        REQUIRE(step_world(&s, 1));
        force[i] = tool_of(&s, 0)->force_N[2];
    }
    const pal_tool *tool = tool_of(&s, 0);
    double slope = -(force[89] - force[84]) / (5 * 0.0001);
    const double *K = tool->grasp_k_N_m;
    printf("  k %.4g N/m along the pull, %.4g and %.4g across, slope %.4g N/m\n", K[5], K[0], K[3], slope);
    REQUIRE(tool->has_grasp);
    CHECK_NEAR(tool->grasp_x0_m[2], tool->here_m[2], 0);
    CHECK_NEAR(tool->grasp_f0_N[2], tool->force_N[2], 1e-12);
    CHECK_NEAR(K[5], slope, 0.1 * slope);
    /* a ball that stands on its lowest part gives way more to the sides */
    CHECK(K[0] > 0 && K[0] < K[5] && K[3] > 0 && K[3] < K[5] && tool->grasp_b_Ns_m >= 0);
    tool_scene_close(&s);
}

/* two tools on the same tissue, pulling apart: what they feel is opposite, and the tissue stays in the middle */
static void shares_tissue_between_tools(void)
{
    tool_scene s;
    REQUIRE(grasp_ball(&s, 2, true, 15));
    for (int i = 0; i < 120; i++) {
        double side = 0.001 + (i > 14 ? fmin(0.01, 0.0002 * (i - 14)) : 0);
        move_tool(&s, 0, side, 0, 0.059, i >= 13);
        move_tool(&s, 1, -side, 0, 0.059, i >= 13);
        REQUIRE(step_world(&s, 1));
    }
    const double *f = tool_of(&s, 0)->mean_force_N, *g = tool_of(&s, 1)->mean_force_N;
    printf("  %.3g and %.3g N\n", f[0], g[0]);
    CHECK(f[0] < -0.3 && g[0] > 0.3);
    CHECK_NEAR(f[0], -g[0], 0.1 * g[0]);
    CHECK_LE(pal_body_kinetic_J(s.body), 1e-6);
    tool_scene_close(&s);
}

/* a tool in the middle of a ball takes hold of what is around it: the force acts there and not on the surface */
static void takes_hold_within_the_volume(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.006, 15) && tool_scene_open(&s));
    move_tool(&s, 0, 0, 0, 0, true);
    REQUIRE(step_world(&s, 2));
    CHECK(tool_of(&s, 0)->holding);
    double at_rest[3];
    pal_copy3(at_rest, tool_of(&s, 0)->force_N);
    for (int i = 1; i <= 60; i++) {
        move_tool(&s, 0, 0.0001 * i, 0, 0, true);
        REQUIRE(step_world(&s, 1));
        double load[3];
        sum_loads(s.body, load);
        for (int c = 0; c < 3; c++) CHECK_NEAR(load[c], -tool_of(&s, 0)->force_N[c], 1e-9);
    }
    double inner = 0;
    for (int i = 0; i < s.body->n_node; i++) {
        const double *rest = s.body->node_rest + 3 * i, moved = s.body->d[3 * i] - rest[0];
        if (pal_norm3(rest) < 0.012) inner = fmax(inner, moved);
        if (pal_norm3(rest) > 0.045) CHECK(pal_norm3(s.body->load + 3 * i) == 0);
    }
    const double *f = tool_of(&s, 0)->mean_force_N;
    printf("  tool 6 mm aside: %.3g N (%.2g at first), the middle %.3g mm\n", f[0], pal_norm3(at_rest), 1e3 * inner);
    CHECK(f[0] < -0.1 && -f[0] > 0.95 * pal_norm3(f));
    CHECK(inner > 0.003);
    move_tool(&s, 0, 0.006, 0, 0, false);
    REQUIRE(step_world(&s, 2));
    CHECK(!tool_of(&s, 0)->holding);
    tool_scene_close(&s);
}

int main(void)
{
    RUN(begins_without_a_jump_and_pulls_tissue_along);
    RUN(moves_a_free_body_as_a_mass_on_a_spring);
    RUN(lets_go_when_the_button_goes_up);
    RUN(a_tool_that_holds_does_not_push_as_well);
    RUN(fades_when_its_user_is_gone);
    RUN(takes_nothing_out_of_reach_and_the_nearest_just_beyond);
    RUN(never_exceeds_its_cap);
    RUN(tells_the_bridge_a_force_and_a_stiffness_that_agree);
    RUN(shares_tissue_between_tools);
    RUN(takes_hold_within_the_volume);
    return check_report();
}
