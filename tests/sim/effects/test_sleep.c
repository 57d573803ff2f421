/* Bodies that sleep: at rest nothing of them is run, positions stay to the bit, a tool wakes them before it touches,
 * and so does all that the world does to them; runs repeat; a scene without the row knows nothing of it. */
#include "server/base/vec3.h"
#include "server/sim/surface/adaptive_surface.h"
#include "tests/fixtures/model_scenes.h"
#include "tests/heap_calls.h"

static pal_diagnostic diag;

/* runs of every row of the world so far */
static uint64_t runs(const model_scene *m)
{
    uint64_t sum = 0;
    pal_component_info row;
    for (int i = 0; i < pal_world_component_count(m->world); i++) {
        pal_world_component_info(m->world, i, &row);
        sum += row.n_run;
    }
    return sum;
}

static void sleepy(model_scene *m, int kind, double damping_1_s)
{
    model_scene_make(m, (model_kind)kind);
    model_scene_defaults(m);
    model_scene_effect(m, "sleep");
    m->def->material.damping_1_s = damping_1_s;
}

/* until it sleeps; -1: it does not */
static int steps_to_sleep(model_scene *m, int max)
{
    for (int i = 0; i < max; i++) {
        if (m->body->asleep) return i;
        if (pal_world_step(m->world, m->scene->step_s)) return -1;
    }
    return -1;
}

static void falls_asleep_where_it_rests_and_costs_nothing(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m, awake;
        sleepy(&m, k, 12);
        sleepy(&awake, k, 12);
        awake.def->n_effect--;
        REQUIRE(model_scene_open(&m) && model_scene_open(&awake));
        int n = steps_to_sleep(&m, 1200);
        CHECK(n > 30);
        REQUIRE(n > 0);
        double *x = malloc(3 * sizeof(double) * (size_t)m.body->n_dof), far = 0;
        REQUIRE(x);
        memcpy(x, m.body->x, 3 * sizeof(double) * (size_t)m.body->n_dof);
        CHECK_NEAR(pal_body_kinetic_J(m.body), 0, 0);
        uint64_t before = runs(&m), hash = pal_world_hash(m.world), ticks = 0;
        n_heap_call = 0;
        counting = true;
        /* an hour would be as long: nothing is run */
        for (int i = 0; i < 3600; i++) ticks += pal_world_step(m.world, m.scene->step_s) == PAL_ERR_OK;
        counting = false;
        CHECK_INT(n_heap_call, 0);
        CHECK_INT(ticks, 3600);
        CHECK_INT(runs(&m), before);
        CHECK(pal_world_hash(m.world) != hash); /* the tick */
        CHECK(!memcmp(x, m.body->x, 3 * sizeof(double) * (size_t)m.body->n_dof));
        CHECK(m.body->asleep);
        /* where the one that never sleeps comes to rest */
        CHECK(model_scene_steps(&awake, 1500));
        for (int i = 0; i < m.body->n_dof; i++)
            far = fmax(far, pal_dist3(x + 3 * (size_t)i, awake.body->x + 3 * (size_t)i));
        printf("  %s: asleep after %.2f s, %.2g S from where it would come to rest\n", model_kind_name[k],
               n * m.scene->step_s, far / m.body->length_scale_m);
        CHECK_LE(far, 2e-5 * m.body->length_scale_m);
        free(x);
        model_scene_close(&m), model_scene_close(&awake);
    }
}

/* the tool comes at 0.3 m/s from above; awake in the step in which it comes within reach, before any force */
static void a_tool_wakes_it_before_it_touches(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m;
        sleepy(&m, k, 12);
        REQUIRE(model_scene_open(&m));
        REQUIRE(steps_to_sleep(&m, 1200) > 0);
        double top = -1, woke_m = NAN, touched_m = NAN, force = 0;
        const float *high = m.body->display.shown;
        for (int i = 0; i < m.body->display.n_shown; i++)
            if ((double)m.body->display.shown[3 * i + 2] > top)
                high = m.body->display.shown + 3 * (size_t)i, top = (double)high[2];
        const double at[3] = {(double)high[0], (double)high[1], top};
        for (int i = 0; i < 80; i++) {
            pal_pose pose = {.position_m = {at[0], at[1], at[2] + 0.2 - 0.005 * i}, .quat = {1, 0, 0, 0}};
            CHECK_INT(pal_world_pose(m.world, 0, &pose), 0);
            REQUIRE(!pal_world_step(m.world, m.scene->step_s));
            const pal_tool *tool = &pal_world_tools(m.world)->tool[0];
            if (isnan(woke_m) && !m.body->asleep) woke_m = pose.position_m[2] - top;
            if (isnan(touched_m) && tool->touching) touched_m = pose.position_m[2] - top;
            force = fmax(force, pal_norm3(tool->mean_force_N));
            if (m.body->asleep) CHECK(!tool->touching && pal_norm3(tool->mean_force_N) == 0);
            if (force > 0.05) break;
        }
        printf("  %s: awake %.1f mm above, touched at %.1f mm\n", model_kind_name[k], 1e3 * woke_m, 1e3 * touched_m);
        CHECK(woke_m > 0.008 + 0.005 && woke_m < 0.1);
        CHECK(touched_m < 0.009 && force > 0.001);
        model_scene_close(&m);
    }
}

/* a tool that crosses the body in one step is seen on its way */
static void a_tool_that_sweeps_through_in_one_step_wakes_it(void)
{
    model_scene m;
    sleepy(&m, SPRINGS, 12);
    REQUIRE(model_scene_open(&m));
    REQUIRE(steps_to_sleep(&m, 1200) > 0);
    pal_pose pose = {.position_m = {0.04, 0.03, 0.4}, .quat = {1, 0, 0, 0}};
    CHECK_INT(pal_world_pose(m.world, 0, &pose), 0);
    CHECK(model_scene_steps(&m, 12));
    CHECK(m.body->asleep);
    pose.position_m[2] = -0.4;
    CHECK_INT(pal_world_pose(m.world, 0, &pose), 0);
    CHECK(model_scene_steps(&m, 1));
    CHECK(!m.body->asleep);
    CHECK(pal_world_tools(m.world)->tool[0].touching);
    model_scene_close(&m);
}

typedef pal_err (*nudge)(model_scene *m);
static pal_err by_load(model_scene *m)
{
    return pal_world_load(m->world, 0, pal_body_point(m->body, 5), (const double[3]){0, 0, 0.01});
}
static pal_err by_material(model_scene *m)
{
    const pal_material to = {.young_Pa = 8e3, .poisson = 0.4, .density_kg_m3 = 1000, .damping_1_s = 12};
    return pal_world_material(m->world, 0, &to, &diag);
}
static pal_err by_row(model_scene *m)
{
    return pal_world_switch_component(m->world, m->scene, 0, "gravity", false, &diag);
}
static pal_err by_reset(model_scene *m)
{
    pal_world_reset(m->world);
    return PAL_ERR_OK;
}
static pal_err by_reset_body(model_scene *m)
{
    return pal_world_reset_body(m->world, 0);
}
static pal_err by_moving(model_scene *m)
{
    pal_world_invalidate_limits(m->world, 0);
    return PAL_ERR_OK;
}

static void what_the_world_does_to_it_wakes_it(void)
{
    static const nudge list[] = {by_load, by_material, by_row, by_reset, by_reset_body, by_moving};
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m;
        sleepy(&m, k, 12);
        REQUIRE(model_scene_open(&m));
        for (int i = 0; i < 6; i++) {
            REQUIRE(steps_to_sleep(&m, 1500) >= 0);
            CHECK_INT(list[i](&m), 0);
            CHECK(!m.body->asleep);
            uint64_t before = runs(&m);
            CHECK(model_scene_steps(&m, 1));
            CHECK(runs(&m) > before);
        }
        model_scene_close(&m);
    }
}

/* values are there, and nothing has moved: fields are no input */
static void a_field_is_shown_without_waking_it(void)
{
    model_scene m;
    sleepy(&m, FEM, 12);
    REQUIRE(model_scene_open(&m));
    REQUIRE(steps_to_sleep(&m, 1500) >= 0);
    CHECK_INT(pal_world_field(m.world, 0, PAL_FIELD_DISPLACEMENT_M, true, &diag), 0);
    double max = 0;
    for (int i = 0; i < m.body->display.n_shown; i++)
        max = fmax(max, (double)m.body->display.field[PAL_FIELD_DISPLACEMENT_M]->value[i]);
    CHECK(max > 1e-4);
    CHECK(model_scene_steps(&m, 5));
    CHECK(m.body->asleep);
    CHECK_INT(pal_world_field(m.world, 0, PAL_FIELD_DISPLACEMENT_M, false, &diag), 0);
    model_scene_close(&m);
}

static void frames_say_so_and_keep_their_positions(void)
{
    model_scene m;
    sleepy(&m, SPRINGS, 12);
    REQUIRE(model_scene_open(&m));
    pal_frame *frame = pal_frame_create(m.world);
    REQUIRE(frame);
    REQUIRE(steps_to_sleep(&m, 1500) >= 0);
    pal_world_frame(m.world, frame);
    uint64_t n_output = frame->part[0].n_output;
    CHECK(frame->part[0].asleep && n_output > 30);
    for (int i = 0; i < m.body->display.n_shown; i++)
        for (int c = 0; c < 3; c++)
            if (frame->part[0].position_m[3 * i + c] != (float)m.body->x[3 * m.body->display.shown_node[i] + c]) {
                CHECK_FAIL("vertex %d is not shown where it lies", i);
                i = m.body->display.n_shown;
                break;
            }
    CHECK(model_scene_steps(&m, 10));
    pal_world_frame(m.world, frame);
    CHECK_INT(frame->part[0].n_output, n_output);
    pal_frame_destroy(frame);
    model_scene_close(&m);
}

/* sleeps, is pressed, sleeps again: twice the same hash */
static void sleeping_runs_repeat(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        uint64_t hash[2];
        for (int run = 0; run < 2; run++) {
            model_scene m;
            sleepy(&m, k, 12);
            REQUIRE(model_scene_open(&m));
            REQUIRE(steps_to_sleep(&m, 1500) > 0);
            CHECK(model_scene_steps(&m, 20));
            CHECK(model_scene_touch(&m, 0, 30));
            CHECK(!m.body->asleep);
            pal_world_pose(m.world, 0, NULL), pal_world_pose(m.world, 1, NULL);
            CHECK(steps_to_sleep(&m, 1500) > 20);
            CHECK(model_scene_steps(&m, 20));
            hash[run] = pal_world_hash(m.world);
            model_scene_close(&m);
        }
        CHECK(hash[0] == hash[1]);
    }
}

/* awake as long as something goes on: a support that breathes, pressure that comes in, a tool that lies on it */
static void does_not_sleep_while_something_goes_on(void)
{
    model_scene m;
    sleepy(&m, SPRINGS, 12);
    pal_config_entry *breath = model_scene_effect(&m, "moving_support");
    const double shift[3] = {0, 0, 1e-7};
    pal_entry_put_numbers(breath, "shift_m", shift, 3, NULL);
    pal_entry_put_number(breath, "period_s", 60, NULL);
    REQUIRE(model_scene_open(&m));
    CHECK_INT(steps_to_sleep(&m, 600), -1);
    model_scene_close(&m);

    sleepy(&m, SPRINGS, 12);
    REQUIRE(model_scene_open(&m));
    pal_pose pose = {.position_m = {0.04, 0.03, 0.07}, .quat = {1, 0, 0, 0}};
    CHECK_INT(pal_world_pose(m.world, 0, &pose), 0);
    CHECK_INT(steps_to_sleep(&m, 600), -1);
    CHECK_INT(pal_world_pose(m.world, 0, NULL), 0);
    CHECK(steps_to_sleep(&m, 600) > 0);
    model_scene_close(&m);

    /* slow is not at rest: drag of 1e5 times the critical one */
    sleepy(&m, SPRINGS, 1e7);
    REQUIRE(model_scene_open(&m));
    CHECK_INT(steps_to_sleep(&m, 200), -1);
    double v = 0;
    for (int i = 0; i < m.body->n_dof; i++) v = fmax(v, pal_norm3(m.body->v + 3 * (size_t)i));
    CHECK_LE(v, 1e-4 * m.body->length_scale_m);
    model_scene_close(&m);
}

/* Tissue follows a tool no farther than its cap pulls or presses: the tool is then far from everything that is shown.
 * For a second nothing moves, then the hand is taken away: the body has been awake and comes back */
static void what_a_far_tool_holds_or_presses_stays_awake(void)
{
    for (int k = 0; k < 2 * MODEL_KINDS; k++) {
        model_scene m;
        const bool grasp = k < MODEL_KINDS;
        if (k % MODEL_KINDS == SOLID && !grasp) continue; /* fem presses implicitly as well */
        sleepy(&m, k % MODEL_KINDS, 12);
        m.scene->tool[0].force_cap_N = 0.05;
        pal_entry_put_number(&m.def->effect[1], "slip_S", 100, NULL); /* never through the body */
        REQUIRE(model_scene_open(&m));
        REQUIRE(steps_to_sleep(&m, 1200) > 0);
        double *x = malloc(3 * sizeof(double) * (size_t)m.body->n_dof), held_m = 0, left_m = 0;
        const int n_x = 3 * (m.body->model.adaptive ? m.body->model.adaptive->levels.n_vertex[0] : m.body->n_dof);
        const float *high = m.body->display.shown;
        REQUIRE(x);
        memcpy(x, m.body->x, 3 * sizeof(double) * (size_t)m.body->n_dof);
        for (int i = 0; i < m.body->display.n_shown; i++)
            if (m.body->display.shown[3 * i + 2] > high[2]) high = m.body->display.shown + 3 * (size_t)i;
        const bool box = m.kind == SPRINGS || m.kind == FEM;
        const double at[3] = {box ? 0.04 : (double)high[0], box ? 0.03 : (double)high[1],
                              (double)high[2] + (grasp ? 0.002 : 0.02)};
        int n_asleep = 0, n = (int)(1.6 / m.scene->step_s);
        for (int i = 0; i < n; i++) {
            /* up to 15 cm above it; or as far down, in half a second */
            const double way = 0.15 * fmin(1, fmax(0, i * m.scene->step_s - 0.1) / 0.4);
            const pal_pose pose = {.position_m = {at[0], at[1], at[2] + (grasp ? way : -way)},
                                   .quat = {1, 0, 0, 0},
                                   .buttons = grasp && i > 2};
            CHECK_INT(pal_world_pose(m.world, 0, &pose), 0);
            REQUIRE(!pal_world_step(m.world, m.scene->step_s));
            const pal_tool *tool = &pal_world_tools(m.world)->tool[0];
            n_asleep += i > 12 && m.body->asleep && (tool->holding || tool->touching);
        }
        for (int i = 0; i < n_x; i++) held_m = fmax(held_m, fabs(m.body->x[i] - x[i]));
        CHECK_INT(n_asleep, 0);
        CHECK_INT(pal_world_pose(m.world, 0, NULL), 0);
        CHECK(steps_to_sleep(&m, 1200) > 0);
        for (int i = 0; i < n_x; i++) left_m = fmax(left_m, fabs(m.body->x[i] - x[i]));
        printf("  %s: %s by %.2f mm, %.2g mm left\n", model_kind_name[m.kind], grasp ? "held" : "pressed", 1e3 * held_m,
               1e3 * left_m);
        CHECK(held_m > 1e-4);
        CHECK_LE(left_m, 5e-4 * m.body->length_scale_m);
        free(x);
        model_scene_close(&m);
    }
}

static void refuses_what_is_no_threshold(void)
{
    model_scene m;
    sleepy(&m, SPRINGS, 12);
    pal_entry_put_number(&m.def->effect[m.def->n_effect - 1], "rest_time_s", -1, NULL);
    CHECK_INT(pal_world_create(m.scene, &diag, &m.world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "rest_time_s") && strstr(diag.text, "effects[4]"));
    model_scene_close(&m);
}

int main(void)
{
    RUN(falls_asleep_where_it_rests_and_costs_nothing);
    RUN(a_tool_wakes_it_before_it_touches);
    RUN(a_tool_that_sweeps_through_in_one_step_wakes_it);
    RUN(what_the_world_does_to_it_wakes_it);
    RUN(a_field_is_shown_without_waking_it);
    RUN(frames_say_so_and_keep_their_positions);
    RUN_LONG(sleeping_runs_repeat);
    RUN(does_not_sleep_while_something_goes_on);
    RUN_LONG(what_a_far_tool_holds_or_presses_stays_awake);
    RUN(refuses_what_is_no_threshold);
    return check_report();
}
