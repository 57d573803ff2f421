/* Tools on a body with an implicit solver: a sub-step is the whole step of 1/60 s. */
#include "tests/fixtures/fem_tools.h"

/* the loads on the body through its own static compliance, against where its nodes are; relative to the largest move */
static double static_error(const tool_scene *s)
{
    const pal_body *body = s->body;
    double worst = 0, max_N = 0, *move = calloc(3 * (size_t)body->n_node, sizeof *move);
    bool known = move && body->compliance && body->compliance->solve(body->compliance->self, body, body->load, move);
    for (int i = 0; i < 3 * body->n_node && known; i++) {
        worst = fmax(worst, fabs(body->x[i] - body->x_rest[i] - move[i]));
        max_N = fmax(max_N, fabs(body->x[i] - body->x_rest[i]));
    }
    free(move);
    return known ? worst / max_N : INFINITY;
}

static void rests_where_the_static_answer_is(void)
{
    fem_scene f;
    REQUIRE(fem_slab(&f, 10, 10, 5, 0.01, 1, 0.015, 15) && tool_scene_open(&f.s));
    CHECK(f.s.body->implicit && f.s.body->compliance);
    for (int i = 0; i <= 20; i++) {
        move_tool(&f.s, 0, 0.052, 0.048, 0.065 - 0.0001 * i, false);
        REQUIRE(step_world(&f.s, 1));
    }
    CHECK_INT(pal_world_substeps(f.s.world), 1);
    REQUIRE(step_world(&f.s, 240));
    double still = tremble(&f.s, 60), load[3], error = static_error(&f.s);
    const pal_tool *tool = tool_of(&f.s, 0);
    sum_loads(f.s.body, load);
    pal_add3(load, load, tool->force_N);
    printf("  %.4g N, kinetic %.2g of elastic, %.2g off the static answer\n", tool->mean_force_N[2], still, error);
    CHECK(tool->mean_force_N[2] > 0.03);
    CHECK_LE(still, 1e-6);
    CHECK_LE(error, 0.05);
    CHECK_LE(pal_norm3(load), 1e-3 * tool->mean_force_N[2]);
    fem_close(&f);
}

/* slow press of a ball of hexahedra and of tetrahedra by 5.6 mm, half a tool's radius: k1 of the patch against the
 * slope of the force. (Deeper, voxels of 1 cm under a tool of 1.2 cm fold.) */
static void publishes_the_slope_of_slow_pressing(void)
{
    for (int tets = 0; tets < 2; tets++) {
        fem_scene f;
        REQUIRE(fem_ball(&f, 10, 1, 0.012, 15));
        CHECK_INT(pal_entry_put_text(&f.s.scene->body[0].model, "element", tets ? "tet4" : "hex8_bbar", NULL), 0);
        f.s.scene->body[0].material.damping_1_s = 25;
        REQUIRE(tool_scene_open(&f.s));
        enum { N = 18, BEFORE = 3, FROM = 8, HALF = 1 };
        double force[N], haptic_stiffness[N], step_m = 0.0004, last = 0, first = 0, worst = 0, mean = 0;
        for (int i = 0; i < N; i++) {
            move_tool(&f.s, 0, 0.002, 0.002, 0.062 - step_m * (i - BEFORE), false);
            REQUIRE(step_world(&f.s, 10));
            force[i] = pal_norm3(tool_of(&f.s, 0)->mean_force_N);
            REQUIRE(tool_of(&f.s, 0)->n_patch > 0);
            haptic_stiffness[i] = tool_of(&f.s, 0)->patch[0].k1_N_m;
            if (i == BEFORE) first = haptic_stiffness[i];
            CHECK(force[i] >= last);
            last = force[i];
        }
        for (int i = FROM; i < N - HALF; i++) {
            double slope = (force[i + HALF] - force[i - HALF]) / (2 * HALF * step_m);
            worst = fmax(worst, fabs(haptic_stiffness[i] / slope - 1));
            mean += (haptic_stiffness[i] / slope - 1) / (N - HALF - FROM);
        }
        printf("  %s: %.3g N at %.3g mm, k1 before touch %.4g, at last %.4g N/m, %.2g off the slope, worst %.2g\n",
               tets ? "tets" : "hexahedra", last, 1e3 * step_m * (N - 1 - BEFORE), first, haptic_stiffness[N - 1], mean,
               worst);
        CHECK(last > 0.25);
        CHECK_LE(fabs(mean), 0.03);
        CHECK_LE(worst, 0.05);
        /* before the touch: what it will be half a millimetre deep and deeper, within a factor of two */
        CHECK(first > 0.5 * haptic_stiffness[N - 1] && first < 2 * haptic_stiffness[N - 1]);
        fem_close(&f);
    }
}

static void pulls_what_it_grasps_and_rests(void)
{
    fem_scene f;
    REQUIRE(fem_slab(&f, 10, 10, 5, 0.01, 1, 0.01, 15) && tool_scene_open(&f.s));
    move_tool(&f.s, 0, 0.05, 0.05, 0.0605, false);
    REQUIRE(step_world(&f.s, 12));
    for (int i = 0; i <= 40; i++) {
        move_tool(&f.s, 0, 0.05, 0.05, 0.0605 + 0.00004 * i, true);
        REQUIRE(step_world(&f.s, 1));
    }
    REQUIRE(step_world(&f.s, 240));
    double still = tremble(&f.s, 60), error = static_error(&f.s);
    const pal_tool *tool = tool_of(&f.s, 0);
    double force = -tool->mean_force_N[2];
    printf("  %.4g N, felt %.4g %.4g %.4g N/m, F/d %.4g, kinetic %.2g of elastic, %.2g off the static answer\n", force,
           tool->grasp_k_N_m[0], tool->grasp_k_N_m[3], tool->grasp_k_N_m[5], force / 0.0016, still, error);
    CHECK(tool->holding && tool->has_grasp);
    CHECK_LE(still, 1e-6);
    CHECK_LE(error, 0.05);
    CHECK_NEAR(tool->grasp_k_N_m[5], force / 0.0016, 0.05 * force / 0.0016);
    /* sideways it is as stiff in both directions, and couples little */
    CHECK_NEAR(tool->grasp_k_N_m[0], tool->grasp_k_N_m[3], 0.05 * tool->grasp_k_N_m[0]);
    CHECK(tool->grasp_k_N_m[0] > 10 && tool->grasp_k_N_m[0] < tool->grasp_k_N_m[5]);
    move_tool(&f.s, 0, 0.05, 0.05, 0.08, false);
    REQUIRE(step_world(&f.s, 300));
    CHECK_LE(rms_displacement(f.s.body), 1e-3 * f.s.body->length_scale_m);
    fem_close(&f);
}

static void two_tools_share_a_place(void)
{
    fem_scene f;
    REQUIRE(fem_slab(&f, 10, 10, 5, 0.01, 2, 0.015, 15) && tool_scene_open(&f.s));
    for (int i = 0; i <= 60; i++) {
        move_tool(&f.s, 0, 0.045, 0.05, 0.065 - 0.0001 * i, false);
        move_tool(&f.s, 1, 0.055, 0.05, 0.065 - 0.0001 * i, false);
        REQUIRE(step_world(&f.s, 1));
    }
    REQUIRE(step_world(&f.s, 240));
    double still = tremble(&f.s, 30), load[3];
    sum_loads(f.s.body, load);
    double a = tool_of(&f.s, 0)->force_N[2], b = tool_of(&f.s, 1)->force_N[2];
    printf("  %.4g N and %.4g N, kinetic %.2g of elastic\n", a, b, still);
    CHECK_NEAR(a, b, 0.02 * a);
    CHECK_NEAR(-load[2], a + b, 1e-3 * a);
    CHECK_LE(still, 1e-6);
    fem_close(&f);
}

/* the body's compliance, of which each answer is counted */
static const pal_compliance *counted;
static int n_answer;
static bool count_answer(void *self, const pal_body *body, const double *force_N, double *move_m)
{
    (void)self;
    n_answer++;
    return counted->solve(counted->self, body, force_N, move_m);
}

/* a tool that somebody feels has its stiffness found again several times as often as caps alone need it */
static void keeps_to_its_cap(void)
{
    int n_haptic[2];
    for (int run = 0; run < 4; run++) {
        const bool grasp = run & 1, mouse = run >= 2;
        const pal_compliance counting = {.solve = count_answer};
        fem_scene f;
        REQUIRE(fem_slab(&f, 10, 10, 5, 0.01, 1, 0.015, 0.3) && tool_scene_open(&f.s));
        counted = f.s.body->compliance, f.s.body->compliance = &counting, n_answer = 0, f.s.no_haptics = mouse;
        double max_N = 0, load[3];
        for (int i = 0; i <= 400; i++) {
            double z = 0.066 + (grasp ? 0.0003 : -0.0002) * fmin(i, 100);
            move_tool(&f.s, 0, 0.05, 0.05, z, grasp && i > 0);
            REQUIRE(step_world(&f.s, 1));
            max_N = fmax(max_N, fmax(pal_norm3(tool_of(&f.s, 0)->force_N), pal_norm3(tool_of(&f.s, 0)->mean_force_N)));
        }
        sum_loads(f.s.body, load);
        const int n_found = n_answer;
        if (!mouse) n_haptic[grasp] = n_found;
        CHECK(n_found > 0 && (!mouse || 3 * n_found <= n_haptic[grasp]));
        double still = tremble(&f.s, 30), error = static_error(&f.s);
        f.s.body->compliance = counted;
        printf("  %s, %s, %d answers: at most %.9g N, on tissue %.4g N, kinetic %.2g of elastic, %.2g off the static "
               "answer\n",
               grasp ? "grasp" : "push", mouse ? "mouse" : "haptic device", n_found, max_N, pal_norm3(load), still,
               error);
        CHECK_LE(max_N, 0.3 * (1 + 1e-9));
        CHECK(max_N > 0.29);
        /* contact itself keeps 2 % below it: the proxy is held back, the spring not stretched farther */
        CHECK_NEAR(pal_norm3(load), 0.98 * 0.3, 1e-4);
        CHECK_LE(still, 1e-5);
        CHECK_LE(error, grasp ? 0.05 : 0.1);
        fem_close(&f);
    }
}

static void friction_drags_and_slides(void)
{
    fem_scene f;
    REQUIRE(fem_slab(&f, 10, 10, 5, 0.01, 1, 0.03, 15));
    pal_body_def *def = &f.s.scene->body[0];
    for (int i = 0; i < def->n_effect; i++)
        if (!strcmp(def->effect[i].name, "tool_push"))
            CHECK_INT(pal_entry_put_number(&def->effect[i], "friction", 0.3, NULL), 0);
    REQUIRE(tool_scene_open(&f.s));
    for (int i = 0; i <= 40; i++) {
        move_tool(&f.s, 0, 0.03, 0.05, 0.08 - 0.0001 * i, false);
        REQUIRE(step_world(&f.s, 1));
    }
    REQUIRE(step_world(&f.s, 60));
    /* a little way: tissue sticks and comes along; a long one over the corners of the slab's facets: it slides */
    double stuck = 0, slid = 0, max_N = 0;
    for (int i = 0; i <= 80; i++) {
        move_tool(&f.s, 0, 0.03 + 0.0004 * i, 0.05, 0.076, false);
        REQUIRE(step_world(&f.s, 3));
        const double *force = tool_of(&f.s, 0)->mean_force_N;
        if (i == 1) stuck = -force[0] / force[2];
        if (i > 4) max_N = fmax(max_N, -force[0] / force[2]), slid += -force[0] / force[2] / 76;
    }
    REQUIRE(step_world(&f.s, 100));
    double still = tremble(&f.s, 30);
    printf("  F_t / F_n %.3g stuck, %.3g sliding (at most %.3g), kinetic %.2g of elastic after\n", stuck, slid, max_N,
           still);
    CHECK(stuck > 0.05 && stuck < 0.25);
    CHECK(slid > 0.1);
    /* facets tilt the normal force by up to 0.05 */
    CHECK_LE(max_N, 0.35);
    CHECK_LE(still, 1e-6);
    fem_close(&f);
}

/* a tower of 400 kPa, soft as a whole, is led 30 mm aside in half a second: the spring of a grasp, 16 E reach, reaches
 * its cap at a tenth of a millimetre, but the tower bears next to nothing of it and comes along */
static void leads_what_is_stiff_but_bends(bool no_haptics)
{
    fem_scene f;
    REQUIRE(fem_slab(&f, 3, 3, 16, 0.01, 1, 0.01, 15));
    f.s.scene->body[0].material.young_Pa = 4e5;
    REQUIRE(tool_scene_open(&f.s));
    f.s.no_haptics = no_haptics;
    int top = 0;
    const pal_body *b = f.s.body;
    for (int i = 0; i < b->n_node; i++)
        if (b->x_rest[3 * i + 2] > b->x_rest[3 * top + 2]) top = i;
    const double *rest = b->x_rest + 3 * top, *x = b->x + 3 * top;
    double late = 0, max_N = 0;
    for (int i = 0; i <= 40; i++) {
        double way = 0.03 * fmin(1, fmax(0, i - 3) / 30.0);
        move_tool(&f.s, 0, rest[0] + way, rest[1], rest[2] + 0.0005, true);
        REQUIRE(step_world(&f.s, 1));
        late = fmax(late, way - (x[0] - rest[0]));
        max_N = fmax(max_N, pal_norm3(tool_of(&f.s, 0)->force_N));
    }
    CHECK_LE(late, 0.003);
    CHECK_LE(max_N, 3);
    /* jerked away, along itself, where it is stiff: never beyond the cap, and at last just below it */
    for (int i = 0; i < 150; i++) {
        move_tool(&f.s, 0, rest[0], rest[1], rest[2] + 0.3, true);
        REQUIRE(step_world(&f.s, 1));
        max_N = fmax(max_N, pal_norm3(tool_of(&f.s, 0)->force_N));
    }
    double still = tremble(&f.s, 30), last = pal_norm3(tool_of(&f.s, 0)->force_N);
    printf("  late by %.3g mm, then %.6g N at most, %.6g N at last, kinetic %.2g of elastic\n", 1e3 * late, max_N, last,
           still);
    CHECK_LE(max_N, 15 * (1 + 1e-9));
    CHECK_NEAR(last, 0.98 * 15, 0.01);
    CHECK_LE(still, 1e-5);
    CHECK(tool_of(&f.s, 0)->holding);
    fem_close(&f);
}

static void leads_with_a_haptic_device(void)
{
    leads_what_is_stiff_but_bends(false);
}

static void leads_with_a_mouse(void)
{
    leads_what_is_stiff_but_bends(true);
}

int main(void)
{
    RUN(rests_where_the_static_answer_is);
    RUN_LONG(publishes_the_slope_of_slow_pressing);
    RUN(pulls_what_it_grasps_and_rests);
    RUN(two_tools_share_a_place);
    RUN_LONG(keeps_to_its_cap);
    RUN(leads_with_a_haptic_device);
    RUN(leads_with_a_mouse);
    RUN_LONG(friction_drags_and_slides);
    return check_report();
}
