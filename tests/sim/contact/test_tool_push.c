/* tool_push: what a sphere that presses tissue does to it, what it feels, and what a haptic bridge is told. */
#include "tests/fixtures/tool_scene.h"

/* x before the last sub-step moved it: what contact saw */
static void torque_of_loads(const pal_world *world, const pal_body *body, double dt_s, double torque[3])
{
    (void)world;
    pal_set3(torque, 0, 0, 0);
    for (size_t i = 0; i < (size_t)body->n_node; i++) {
        double x[3], m[3];
        pal_copy3(x, body->x + 3 * i);
        pal_axpy3(x, -dt_s, body->v + 3 * i);
        pal_cross3(m, x, body->load + 3 * i);
        pal_add3(torque, torque, m);
    }
}

static void gives_tissue_exactly_the_opposite_force_and_its_torque(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 2, 0.008, 15) && tool_scene_open(&s));
    double worst_force = 0, worst_torque = 0, max_N = 0, own = 0;
    for (int i = 0, n_sub = 0; i < 60; i++) {
        double down = 0.0003 * i, z = 0.058 - down;
        move_tool(&s, 0, 0.006, -0.003, z, false);
        CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
        const pal_tool *tool = tool_of(&s, 0);
        double load[3], torque[3], wanted[3], size = pal_norm3(tool->force_N);
        sum_loads(s.body, load);
        torque_of_loads(s.world, s.body, s.scene->step_s / pal_world_substeps(s.world), torque);
        /* about the origin; without friction only what row sums take has a torque about the sphere's centre */
        pal_cross3(wanted, tool->force_N, tool->here_m);
        pal_sub3(wanted, wanted, tool->torque_Nm);
        own = fmax(own, pal_norm3(tool->torque_Nm) / (0.05 * size));
        for (int c = 0; c < 3; c++) worst_force = fmax(worst_force, fabs(load[c] + tool->force_N[c]));
        /* where the number of sub-steps changes they are not equally long; deeper than that some fans are folded, and
         * their turning is left out */
        const bool equal = pal_world_substeps(s.world) == n_sub;
        n_sub = pal_world_substeps(s.world);
        if (size > 0 && equal && down < 0.013)
            worst_torque = fmax(worst_torque, pal_dist3(torque, wanted) / (size * 0.05));
        max_N = fmax(max_N, size);
    }
    printf("  force up to %.3g N, off by %.2g N, torque off by %.2g of F R, about the centre %.2g\n", max_N,
           worst_force, worst_torque, own);
    CHECK(max_N > 0.5);
    CHECK_LE(worst_force, 1e-9 * max_N);
    CHECK_LE(worst_torque, 1e-8);
    tool_scene_close(&s);
}

static void gives_no_force_without_contact(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.008, 15) && tool_scene_open(&s));
    for (int i = 0; i < 30; i++) {
        move_tool(&s, 0, 0.002 * i - 0.03, 0, 0.0585, false);
        CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
        CHECK(!tool_of(&s, 0)->touching);
        CHECK(pal_norm3(tool_of(&s, 0)->mean_force_N) == 0);
    }
    CHECK(rms_displacement(s.body) < 1e-12);
    tool_scene_close(&s);
}

/* slow press of a slab; the slope of the last millimetre against the published stiffness */
static void grows_with_depth_and_publishes_its_slope(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 10, 10, 5, 0.01, 1, 0.015, 15));
    s.scene->body[0].material.damping_1_s = 25;
    REQUIRE(tool_scene_open(&s));
    double force[120], last = 0, depth_step = 0.0001;
    bool monotonic = true;
    int16_t id = 0;
    int changed = 0;
    for (int i = 0; i < 120; i++) {
        double z = 0.05 + 0.015 - depth_step * (i - 20);
        move_tool(&s, 0, 0.05, 0.05, z, false);
        CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
        const pal_tool *tool = tool_of(&s, 0);
        force[i] = tool->mean_force_N[2];
        monotonic = monotonic && force[i] >= last - 1e-4;
        last = force[i];
        REQUIRE(tool->n_patch > 0);
        changed += i > 0 && tool->patch[0].id != id;
        id = tool->patch[0].id;
    }
    const pal_contact_patch *patch = &tool_of(&s, 0)->patch[0];
    double slope = (force[119] - force[109]) / (10 * depth_step), z = 0.065 - depth_step * 99;
    double plane =
        pal_dot3(patch->point_m, patch->normal) - z * patch->normal[2] - 0.05 * (patch->normal[0] + patch->normal[1]);
    printf("  %.3g N at %.3g mm, slope %.4g N/m, k1 %.4g N/m, plane %.3g mm away\n", last, 1e3 * depth_step * 99, slope,
           patch->k1_N_m, 1e3 * plane);
    CHECK(monotonic);
    CHECK(last > 0.3);
    CHECK_NEAR(patch->k1_N_m, slope, 0.05 * slope);
    CHECK_INT(changed, 0);
    CHECK_NEAR(patch->k1_N_m * plane, pal_norm3(tool_of(&s, 0)->force_N), 0.02 * last);
    CHECK(patch->normal[2] > 0.999);
    tool_scene_close(&s);
}

static void tells_the_bridge_where_the_surface_is_before_it_touches(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.008, 15) && tool_scene_open(&s));
    move_tool(&s, 0, 0, 0.063, 0, false);
    REQUIRE(step_world(&s, 2));
    const pal_tool *tool = tool_of(&s, 0);
    REQUIRE(tool->n_patch == 1);
    const pal_contact_patch *patch = &tool->patch[0];
    CHECK(pal_norm3(tool->mean_force_N) == 0);
    /* the shown ball has flat triangles, 0.2 mm within the sphere */
    CHECK_NEAR(pal_norm3(patch->point_m), 0.058, 4e-4);
    CHECK(patch->normal[1] > 0.995);
    CHECK_NEAR(patch->k1_N_m, 2 * 5000 * 0.008 / (1 - 0.45 * 0.45), 1e-6);
    /* 10 mm away although that is more than the radius, and not farther */
    move_tool(&s, 0, 0, 0.067, 0, false);
    REQUIRE(step_world(&s, 1));
    CHECK_INT(tool_of(&s, 0)->n_patch, 1);
    move_tool(&s, 0, 0, 0.07, 0, false);
    REQUIRE(step_world(&s, 1));
    CHECK_INT(tool_of(&s, 0)->n_patch, 0);
    tool_scene_close(&s);
}

static void keeps_plane_and_stiffness_still_while_the_tool_rests(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.008, 15) && tool_scene_open(&s));
    for (int i = 0; i < 60; i++) {
        move_tool(&s, 0, 0, 0.003, 0.058 - 0.0001 * i, false);
        REQUIRE(step_world(&s, 1));
    }
    /* the ball rocks for a while */
    REQUIRE(step_world(&s, 150));
    pal_contact_patch first = tool_of(&s, 0)->patch[0];
    double plane = 0, stiff = 0;
    for (int i = 0; i < 120; i++) {
        REQUIRE(step_world(&s, 1));
        const pal_contact_patch *now = &tool_of(&s, 0)->patch[0];
        CHECK_INT(now->id, first.id);
        plane = fmax(plane, pal_dist3(now->point_m, first.point_m));
        stiff = fmax(stiff, fabs(now->k1_N_m / first.k1_N_m - 1));
    }
    printf("  plane moves %.2g mm, k1 %.2g %%\n", 1e3 * plane, 1e2 * stiff);
    CHECK_LE(plane, 1e-4);
    CHECK_LE(stiff, 0.05);
    tool_scene_close(&s);
}

static void lets_the_body_go_back_to_rest(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.008, 15) && tool_scene_open(&s));
    for (int i = 0; i < 60; i++) {
        move_tool(&s, 0, 0.02, 0, 0.055 - 0.0003 * i, false);
        REQUIRE(step_world(&s, 1));
    }
    CHECK(rms_displacement(s.body) > 1e-3 * s.body->length_scale_m);
    pal_world_pose(s.world, 0, NULL);
    /* within 5 s */
    REQUIRE(step_world(&s, 300));
    printf("  off by %.3g %% of S\n", 1e2 * rms_displacement(s.body) / s.body->length_scale_m);
    CHECK_LE(rms_displacement(s.body), 1e-3 * s.body->length_scale_m);
    CHECK(pal_norm3(tool_of(&s, 0)->mean_force_N) == 0);
    tool_scene_close(&s);
}

static void never_exceeds_its_cap(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.012, 1) && tool_scene_open(&s));
    double max_N = 0;
    for (int i = 0; i < 90; i++) {
        move_tool(&s, 0, 0, 0, 0.06 - 0.001 * i, false);
        REQUIRE(step_world(&s, 1));
        double load[3];
        sum_loads(s.body, load);
        max_N = fmax(max_N, fmax(pal_norm3(tool_of(&s, 0)->force_N), pal_norm3(tool_of(&s, 0)->mean_force_N)));
        /* tissue that comes toward a tool at its cap receives a little more than the tool is told (push_explicit.c):
         * 1.5 % here */
        const double reported_N = pal_norm3(tool_of(&s, 0)->force_N), ramp = tool_of(&s, 0)->ramp;
        CHECK_LE(reported_N, pal_norm3(load) + 1e-9);
        CHECK_LE(pal_norm3(load), reported_N + (reported_N < (1 - 1e-9) * ramp ? 1e-9 : 0.02 * ramp));
    }
    CHECK(max_N > 0.99);
    CHECK_LE(max_N, 1 + 1e-12);
    tool_scene_close(&s);
}

static void leaves_all_as_it_was_for_a_pose_that_is_no_number(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.008, 15) && tool_scene_open(&s));
    move_tool(&s, 0, 0, 0, 0.052, false);
    REQUIRE(step_world(&s, 10));
    uint64_t hash = pal_world_hash(s.world);
    const double bad[] = {NAN, INFINITY, 1e300};
    for (int i = 0; i < 3; i++) {
        CHECK_INT(move_tool(&s, 0, 0, bad[i], 0, false), PAL_ERR_REFUSED);
        CHECK(pal_world_hash(s.world) == hash);
    }
    REQUIRE(step_world(&s, 1));
    CHECK_NEAR(tool_of(&s, 0)->here_m[2], 0.052, 0);
    tool_scene_close(&s);
}

static void presses_from_any_side(void)
{
    const double side[8][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                               {0, 0, 1}, {0, 0, -1}, {1, 1, 1}, {-1, 2, -1}};
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, false, 1, 0.01, 15) && tool_scene_open(&s));
    for (int k = 0; k < 8; k++) {
        double n[3] = {0};
        REQUIRE(pal_unit3(n, side[k], 0));
        pal_world_reset(s.world);
        for (int i = 0; i < 15; i++) {
            double away = 0.061 - 0.0004 * i;
            move_tool(&s, 0, away * n[0], away * n[1], away * n[2], false);
            REQUIRE(step_world(&s, 1));
        }
        const double *f = tool_of(&s, 0)->mean_force_N;
        CHECK(pal_dot3(f, n) > 0.98 * pal_norm3(f) && pal_norm3(f) > 0.05);
    }
    tool_scene_close(&s);
}

static void pushes_on_when_it_is_three_radii_deep(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 11, true, 1, 0.008, 15) && tool_scene_open(&s));
    double last = 0;
    for (int i = 0; i < 120; i++) {
        double depth = fmin(0.0003 * i, 0.024);
        move_tool(&s, 0, 0.001, 0.002, 0.058 - depth, false);
        REQUIRE(step_world(&s, 1));
        if (i % 10 == 0) {
            const double *f = tool_of(&s, 0)->mean_force_N;
            /* when the tool stops from 18 mm/s, the ball swings on by 6 % of the force */
            CHECK(f[2] >= 0.92 * last && f[2] >= 0.9 * pal_norm3(f));
            last = f[2];
        }
    }
    printf("  %.3g N at 24 mm\n", last);
    CHECK(last > 1);
    tool_scene_close(&s);
}

static void does_not_pass_through_at_any_speed(void)
{
    /* 5 m/s is 83 mm a step, the ball 100 mm; 60 m/s crosses it in one step with room on both sides */
    const double speed[] = {0.5, 5, 60};
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, false, 1, 0.008, 15) && tool_scene_open(&s));
    for (int k = 0; k < 3; k++) {
        pal_world_reset(s.world);
        double z = speed[k] > 10 ? 0.5 : 0.07;
        move_tool(&s, 0, 0.001, 0, z, false);
        REQUIRE(step_world(&s, 12));
        double max_N = 0;
        for (int i = 0; i < 12; i++) {
            double end = speed[k] > 10 ? -0.5 : -0.01;
            z = fmax(end, z - speed[k] * s.scene->step_s);
            move_tool(&s, 0, 0.001, 0, z, false);
            REQUIRE(step_world(&s, 1));
            max_N = fmax(max_N, tool_of(&s, 0)->mean_force_N[2]);
            CHECK(tool_of(&s, 0)->mean_force_N[2] >= 0);
        }
        printf("  %g m/s: up to %.3g N, body moved %.3g mm\n", speed[k], max_N, 1e3 * mean_move(s.body, 2));
        CHECK(max_N > 0.1);
        CHECK(mean_move(s.body, 2) < -1e-4);
    }
    tool_scene_close(&s);
}

static void touches_between_the_vertices_of_a_coarse_surface(void)
{
    /* a cube of 12 shown triangles; the tool is smaller than a seventh of them */
    tool_scene s;
    memset(&s, 0, sizeof s);
    s.skinned = true;
    double x[24] = {0, 0, 0, 0.1, 0, 0, 0, 0.1, 0, 0.1, 0.1, 0, 0, 0, 0.1, 0.1, 0, 0.1, 0, 0.1, 0.1, 0.1, 0.1, 0.1};
    int32_t tri[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                       2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    pal_surface surface = {.n_vertex = 8, .n_tri = 12, .x = x, .tri = tri};
    pal_voxel_options options = {.resolution = 8, .border = true};
    pal_prepare_report report;
    pal_diagnostic diag = {""};
    REQUIRE(!pal_prepared_make(&surface, &options, &s.mesh, &report, &diag));
    tool_scene_fill(&s, "skin_output", true, 1, 0.006, 15);
    REQUIRE(tool_scene_open(&s));
    /* somewhere within the upper face, far from every vertex */
    for (int i = 0; i < 40; i++) {
        move_tool(&s, 0, 0.063, 0.041, 0.1 + 0.006 + 0.001 - 0.0002 * i, false);
        REQUIRE(step_world(&s, 1));
        if (i < 4) CHECK(!tool_of(&s, 0)->touching);
    }
    const double *f = tool_of(&s, 0)->mean_force_N;
    CHECK(f[2] > 0.05 && f[2] > 0.9 * pal_norm3(f));
    tool_scene_close(&s);
}

static void drags_tissue_only_with_friction(void)
{
    double side[2];
    for (int k = 0; k < 2; k++) {
        tool_scene s;
        REQUIRE(slab_scene(&s, 8, 8, 4, 0.01, 1, 0.012, 15));
        if (k) REQUIRE(!pal_entry_put_number(&s.scene->body[0].effect[0], "friction", 0.4, NULL));
        REQUIRE(tool_scene_open(&s));
        for (int i = 0; i < 60; i++) {
            move_tool(&s, 0, 0.03 + 0.0003 * i, 0.04, 0.04 + 0.012 - fmin(0.003, 0.0002 * i), false);
            REQUIRE(step_world(&s, 1));
        }
        const double *f = tool_of(&s, 0)->mean_force_N;
        side[k] = -f[0] / f[2];
        CHECK(tool_of(&s, 0)->patch[0].mu_static == (k ? 0.4 : 0));
        tool_scene_close(&s);
    }
    printf("  sideways over normal force: %.3g without, %.3g with friction 0.4\n", side[0], side[1]);
    CHECK(fabs(side[0]) < 0.15);
    CHECK(side[1] > side[0] + 0.15 && side[1] < 0.6);
}

enum { STRIKE_STEPS = 30 };

/* a tool at 0.3 m/s strikes a skinned ball and leaves; mean forces of its steps, N, with sub-steps of this part of the
 * limit */
static bool strike(double safety, double mean_N[STRIKE_STEPS][3])
{
    tool_scene s;
    if (!ball_scene(&s, 8, true, 1, 0.008, 15)) return false;
    pal_entry_init(&s.scene->body[0].solver, "solver", "verlet");
    pal_entry_put_number(&s.scene->body[0].solver, "safety", safety, NULL);
    s.scene->body[0].material.density_kg_m3 = 1000;
    s.scene->step_s = 1.0 / 120;
    bool ok = tool_scene_open(&s);
    move_tool(&s, 0, 0.01, 0, 0.062, false);
    ok = ok && step_world(&s, 24);
    for (int i = 0; i < STRIKE_STEPS && ok; i++) {
        move_tool(&s, 0, 0.01, 0, 0.062 - 0.0025 * (i < 8 ? i : i < 16 ? 8 : 24 - i), false);
        ok = step_world(&s, 1);
        pal_copy3(mean_N[i], tool_of(&s, 0)->mean_force_N);
    }
    tool_scene_close(&s);
    return ok;
}

/* What a hand is told is the momentum that light nodes receive, and hardly depends on the length of the sub-steps:
 * 0.052 off. The force at the begin of a sub-step, of nodes that are heavier by whole row sums, is 0.415 off and a
 * third too large */
static void tells_a_strike_as_hard_as_short_sub_steps_do(void)
{
    double exact[STRIKE_STEPS][3], reported[STRIKE_STEPS][3], off2 = 0, exact2 = 0, exact_N = 0, max_N = 0;
    REQUIRE(strike(0.05, exact) && strike(0.9, reported));
    for (int i = 0; i < STRIKE_STEPS; i++) {
        exact2 += pal_dot3(exact[i], exact[i]), off2 += pow(pal_dist3(exact[i], reported[i]), 2);
        exact_N = fmax(exact_N, pal_norm3(exact[i])), max_N = fmax(max_N, pal_norm3(reported[i]));
    }
    printf("  up to %.3g N for %.3g, off by %.3f\n", max_N, exact_N, sqrt(off2 / exact2));
    CHECK_LE(sqrt(off2 / exact2), 0.1);
    CHECK_LE(max_N, 1.1 * exact_N);
}

static void squeezes_with_two_tools(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 2, 0.012, 15) && tool_scene_open(&s));
    for (int i = 0; i < 120; i++) {
        double away = 0.062 - fmin(0.01, 0.0002 * i);
        move_tool(&s, 0, away, 0, 0, false);
        move_tool(&s, 1, -away, 0, 0, false);
        REQUIRE(step_world(&s, 1));
    }
    const double *f = tool_of(&s, 0)->mean_force_N, *g = tool_of(&s, 1)->mean_force_N;
    CHECK(f[0] > 0.3 && g[0] < -0.3);
    printf("  %.3g %.3g %.3g against %.3g %.3g %.3g N, moved %.3g mm\n", f[0], f[1], f[2], g[0], g[1], g[2],
           1e3 * mean_move(s.body, 0));
    CHECK_NEAR(f[0], -g[0], 0.15 * f[0]);
    CHECK_LE(fabs(mean_move(s.body, 0)), 1e-3);
    tool_scene_close(&s);
}

static void refuses_keys_it_does_not_know(void)
{
    tool_scene s;
    pal_diagnostic diag = {""};
    REQUIRE(slab_scene(&s, 2, 2, 2, 0.01, 1, 0.01, 15));
    REQUIRE(!pal_entry_put_number(&s.scene->body[0].effect[0], "stiffnes", 1, NULL));
    CHECK_INT(pal_world_create(s.scene, &diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "stiffnes") != NULL);
    tool_scene_close(&s);
}

int main(void)
{
    RUN(gives_tissue_exactly_the_opposite_force_and_its_torque);
    RUN(gives_no_force_without_contact);
    RUN(grows_with_depth_and_publishes_its_slope);
    RUN(tells_the_bridge_where_the_surface_is_before_it_touches);
    RUN_LONG(keeps_plane_and_stiffness_still_while_the_tool_rests);
    RUN_LONG(lets_the_body_go_back_to_rest);
    RUN_LONG(never_exceeds_its_cap);
    RUN(leaves_all_as_it_was_for_a_pose_that_is_no_number);
    RUN(presses_from_any_side);
    RUN_LONG(pushes_on_when_it_is_three_radii_deep);
    RUN(does_not_pass_through_at_any_speed);
    RUN(touches_between_the_vertices_of_a_coarse_surface);
    RUN(drags_tissue_only_with_friction);
    RUN(tells_a_strike_as_hard_as_short_sub_steps_do);
    RUN_LONG(squeezes_with_two_tools);
    RUN(refuses_keys_it_does_not_know);
    return check_report();
}
