/* Component refine: where levels switch, by force, speed and curvature, and where they do not. */
#include "tests/fixtures/refined_bodies.h"

/* farthest place at rest, from `at`, of a node that is not of level 0 */
static double farthest_new(const shell_scene *s, const double at[3])
{
    double max = 0;
    for (int k = 0; k < s->body->n_active; k++) {
        int i = pal_body_point(s->body, k);
        if (i >= s->body->model.adaptive->levels.n_vertex[0]) max = fmax(max, pal_dist3(s->body->x_rest + 3 * i, at));
    }
    return max;
}

/* ---- where ---- */

static void refines_where_pressed_and_only_there(void)
{
    shell_scene s;
    take_sphere(&s);
    thresholds(&s, 0.02, 0, 0);
    REQUIRE(shell_scene_start(&s));
    const pal_adaptive_surface *adaptive = s.body->model.adaptive;
    for (int i = 0; i < 60; i++) {
        load_all(&s, pole, 0.03, (double[3]){0, 0, -0.3});
        steps(&s, 1.0 / 60);
    }
    CHECK_INT(adaptive->finest, 2);
    CHECK(s.body->n_active > 114 && s.body->n_active < 250);
    /* a face reaches 2 cm beyond the pressed nodes, its like and coarser neighbours as far again */
    CHECK_LE(farthest_new(&s, pole), 0.08);
    /* all faces around pressed nodes are of the finest level */
    for (int k = 0; k < adaptive->n_leaf; k++) {
        const int32_t *c = adaptive->levels.face + 3 * adaptive->leaf[k];
        bool pressed = false;
        for (int j = 0; j < 3; j++) pressed |= pal_dist3(s.body->x_rest + 3 * c[j], pole) < 0.03;
        if (pressed) CHECK_INT(adaptive->levels.face_level[adaptive->leaf[k]], 2);
    }
    shell_scene_close(&s);
}

static void thresholds_of_0_switch_criteria_off(void)
{
    shell_scene s;
    take_sphere(&s);
    thresholds(&s, 0, 0, 0);
    REQUIRE(shell_scene_start(&s));
    load_all(&s, pole, 0.03, (double[3]){0, 0, -1});
    steps(&s, 0.5);
    CHECK(shell_scene_rms(&s) > 1e-3);
    CHECK_INT(report_of(&s)->n_switch, 0);
    CHECK_INT(s.body->n_active, 114);
    shell_scene_close(&s);
}

static void never_has_more_than_max_node(void)
{
    shell_scene s;
    take_sphere(&s);
    pal_entry_put_number(thresholds(&s, 0.001, 0, 0), "most_node", 150, NULL);
    REQUIRE(shell_scene_start(&s));
    int max = 0;
    for (int i = 0; i < 60; i++) {
        load_all(&s, pole, 0.08, (double[3]){0, 0, -1});
        steps(&s, 1.0 / 60);
        if (s.body->n_active > max) max = s.body->n_active;
    }
    CHECK(max > 140 && max <= 150);
    shell_scene_close(&s);
}

/* ---- speed and curvature ---- */

static void a_wave_refines_by_speed_alone(void)
{
    shell_scene s;
    take_sphere(&s);
    thresholds(&s, 0, 0.05, 0);
    REQUIRE(shell_scene_start(&s));
    int top = shell_scene_nearest(&s, pole);
    pal_set3(s.body->v + 3 * top, 0, 0, -1);
    steps(&s, 1.0 / 60);
    CHECK(report_of(&s)->n_split >= 6);
    CHECK_LE(farthest_new(&s, pole), 0.11);
    shell_scene_close(&s);
}

static void rigid_motion_refines_nothing(void)
{
    shell_scene s;
    take_sphere(&s);
    thresholds(&s, -1, 0.02, 1);
    REQUIRE(shell_scene_start(&s));
    /* speeds far above the threshold; slow enough to turn that the surface hardly widens */
    set_motion(&s, (double[3]){1, -2, 0.5}, (double[3]){0.6, 0.5, -0.7});
    steps(&s, 0.5);
    CHECK_INT(report_of(&s)->n_switch, 0);
    CHECK_LE(0.5, pal_dist3(s.body->x, s.body->x_rest));
    shell_scene_close(&s);
}

static void take_sheet(shell_scene *s)
{
    pal_surface surface;
    pal_diagnostic diag;
    if (pal_sheet_make(13, 13, 0.24, 0.24, &surface, &diag)) abort();
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", 2);
    shell_scene_number(s, "k_shape_N_m", 0);
}

/* rolls the middle of the sheet, |x| < half, up to a cylinder of that curvature; the wings go on straight */
static void roll(shell_scene *s, double curvature, double half)
{
    for (int i = 0; i < s->body->n_node; i++) {
        double *x = s->body->x + 3 * i;
        const double *r = s->body->x_rest + 3 * i;
        double arc = fmax(-half, fmin(half, r[0])), turn = curvature * arc, over = r[0] - arc;
        x[0] = sin(turn) / curvature + over * cos(turn);
        x[1] = r[1];
        x[2] = (1 - cos(turn)) / curvature + over * sin(turn);
    }
}

static void a_bent_sheet_refines_by_curvature_alone(void)
{
    shell_scene s;
    take_sheet(&s);
    thresholds(&s, 0, 0, 2);
    REQUIRE(shell_scene_start(&s));
    /* mean over the directions of springs, 0, 45 and 90 degrees to the roll: half of its curvature */
    roll(&s, 8, 0.05);
    pal_world_invalidate_limits(s.world, 0);
    steps(&s, 1e-4);
    const pal_adaptive_surface *adaptive = s.body->model.adaptive;
    CHECK(adaptive->n_leaf_of[1] > 0 && adaptive->n_leaf_of[0] > 0);
    for (int f = 0; f < adaptive->levels.first_face[1]; f++) {
        const int32_t *c = adaptive->levels.face + 3 * f;
        double x = 0;
        for (int j = 0; j < 3; j++) x = fmax(x, fabs(s.body->x_rest[3 * c[j]]));
        if (x < 0.045) CHECK_INT(adaptive->face_state[f], PAL_FACE_SPLIT);
        if (x > 0.105) CHECK_INT(adaptive->face_state[f], PAL_FACE_LEAF);
    }
    shell_scene_close(&s);
    /* the same less sharply, and straight but turned about */
    take_sheet(&s);
    thresholds(&s, 0, 0, 2);
    REQUIRE(shell_scene_start(&s));
    roll(&s, 3, 0.05);
    pal_world_invalidate_limits(s.world, 0);
    steps(&s, 1e-4);
    CHECK_INT(report_of(&s)->n_switch, 0);
    shell_scene_close(&s);
}

static void curvature_is_that_of_spheres_and_cylinders_and_no_rigid_motion_changes_it(void)
{
    shell_scene s;
    take_sphere(&s);
    REQUIRE(shell_scene_start(&s));
    const pal_adaptive_surface *adaptive = s.body->model.adaptive;
    int n = s.body->n_node;
    pal_arena *arena = pal_arena_create(1 << 20, true);
    double *out = malloc((size_t)n * sizeof *out), *x = malloc(3 * (size_t)n * sizeof *x);
    pal_refine_measure measure;
    REQUIRE(!pal_refine_measure_make(&measure, adaptive, arena));
    for (int f = 0; f < 100; f += 7) pal_adaptive_split((pal_adaptive_surface *)(void *)adaptive, s.body, f, 0);
    pal_adaptive_update((pal_adaptive_surface *)(void *)adaptive, s.body);
    pal_refine_curvature(&measure, adaptive, s.body->x_rest, out);
    double quat[4] = {0.5, -0.5, 0.1, 0.7}, worst = 0;
    for (int i = 0; i < 114; i++) CHECK_NEAR(out[i], -1 / radius_m, 0.25 / radius_m);
    for (int i = 0; i < n; i++) {
        pal_quat_rotate(x + 3 * i, quat, s.body->x_rest + 3 * i);
        pal_add3(x + 3 * i, x + 3 * i, (double[3]){3, -4, 5});
    }
    pal_refine_curvature(&measure, adaptive, x, measure.rest_curvature);
    for (int k = 0; k < adaptive->n_node; k++)
        worst = fmax(worst, fabs(measure.rest_curvature[adaptive->node[k]] - out[adaptive->node[k]]));
    CHECK_LE(worst, 1e-9 / radius_m);
    /* lengths twice as long, curvatures half as large */
    for (int i = 0; i < 3 * n; i++) x[i] = 2 * s.body->x_rest[i];
    pal_refine_curvature(&measure, adaptive, x, measure.rest_curvature);
    for (int k = 0; k < adaptive->n_node; k++)
        CHECK_NEAR(measure.rest_curvature[adaptive->node[k]], out[adaptive->node[k]] / 2, 1e-12 / radius_m);
    free(out), free(x), pal_arena_destroy(arena);
    shell_scene_close(&s);

    take_sheet(&s);
    REQUIRE(shell_scene_start(&s));
    arena = pal_arena_create(1 << 20, true);
    REQUIRE(!pal_refine_measure_make(&measure, s.body->model.adaptive, arena));
    roll(&s, 2, 1);
    pal_refine_curvature(&measure, s.body->model.adaptive, s.body->x, measure.rest_curvature);
    for (int i = 0; i < 169; i++)
        if (!pal_levels_on_boundary(&s.body->model.adaptive->levels, i))
            CHECK_NEAR(measure.rest_curvature[i], 1.0, 0.002);
    pal_arena_destroy(arena);
    shell_scene_close(&s);
}

int main(void)
{
    RUN(curvature_is_that_of_spheres_and_cylinders_and_no_rigid_motion_changes_it);
    RUN(refines_where_pressed_and_only_there);
    RUN(thresholds_of_0_switch_criteria_off);
    RUN(never_has_more_than_max_node);
    RUN(a_wave_refines_by_speed_alone);
    RUN(rigid_motion_refines_nothing);
    RUN(a_bent_sheet_refines_by_curvature_alone);
    return check_report();
}
