/* finite_guard: a body that diverges is frozen in its last good state, and reset brings it back. */
#include "server/sim/core/effect.h"
#include "server/sim/core/sums.h"
#include "tests/fixtures/tool_scene.h"

static bool open_two(tool_scene *s)
{
    return slab_scene(s, 4, 4, 3, 0.01, 1, 0.01, 15) && tool_scene_open(s);
}

static void check_frozen_and_back(tool_scene *s, const double *good)
{
    CHECK(s->body->frozen);
    CHECK(pal_body_finite(s->body));
    CHECK(memcmp(s->body->x, good, 3 * sizeof(double) * (size_t)s->body->n_dof) == 0);
    CHECK(pal_body_kinetic_J(s->body) == 0);
    for (int i = 0; i < s->body->display.n_shown; i++)
        for (int c = 0; c < 3; c++) CHECK(isfinite(s->body->display.shown[3 * i + c]));
    /* it stays, says so once only, and steps go on */
    CHECK_INT(pal_world_step(s->world, s->scene->step_s), 0);
    CHECK(s->body->frozen);
    CHECK(memcmp(s->body->x, good, 3 * sizeof(double) * (size_t)s->body->n_dof) == 0);
    pal_world_reset(s->world);
    CHECK(!s->body->frozen);
    CHECK(rms_displacement(s->body) == 0);
    CHECK(step_world(s, 3));
    CHECK(!s->body->frozen);
}

typedef enum trial_case { NOT_A_NUMBER_X, NOT_A_NUMBER_V, INFINITE_V, FAR_AWAY, TOO_FAST } trial_case;

/* the row alone: in a step the solver's own clamp comes first and tissue may well find its way back */
static void run_guard(tool_scene *s)
{
    for (int i = 0; i < pal_world_component_count(s->world); i++) {
        const pal_component *row = pal_world_component(s->world, i);
        pal_step step = {.body = s->body, .dt_s = s->scene->step_s, .n_sub = 1};
        if (!strcmp(row->effect->name, "finite_guard")) CHECK_INT(row->effect->run(row->self, &step), 0);
    }
}

static void hurt(tool_scene *s, trial_case how)
{
    double good[3 * 5 * 5 * 4];
    for (int i = 0; i < 5; i++) {
        move_tool(s, 0, 0.02, 0.02, 0.04 - 0.0004 * i, false);
        REQUIRE(step_world(s, 1));
    }
    REQUIRE(s->body->n_dof * 3 == (int)(sizeof good / sizeof good[0]));
    memcpy(good, s->body->x, sizeof good);
    int node = s->body->n_dof - 7;
    if (how == NOT_A_NUMBER_X) s->body->x[3 * node + 1] = NAN;
    if (how == NOT_A_NUMBER_V) s->body->v[3 * node + 2] = NAN;
    if (how == INFINITE_V) s->body->v[3 * node] = INFINITY;
    if (how == FAR_AWAY) s->body->x[3 * node] += 11 * s->body->length_scale_m;
    for (int i = 0; how == TOO_FAST && i < s->body->n_dof; i++) s->body->v[3 * i] = 1e6;
    if (how >= FAR_AWAY)
        run_guard(s);
    else
        CHECK_INT(pal_world_step(s->world, s->scene->step_s), PAL_ERR_FROZEN);
    const char *const want[] = {"is not finite", "is not finite", "is not finite", "m allowed", "RMS allowed"};
    char name[24];
    snprintf(name, sizeof name, "node %d of tetrahedron ", node);
    CHECK(strstr(s->body->reason, want[how]) != NULL);
    /* numbers that are none have spread in that step */
    if (how == FAR_AWAY) CHECK(strncmp(s->body->reason, name, strlen(name)) == 0);
    CHECK(strstr(s->body->reason, ") mm: ") != NULL && strlen(s->body->reason) < PAL_REASON_TEXT - 1);
    CHECK_INT(s->body->safeguards.n_stopped, 1);
    check_frozen_and_back(s, good);
    CHECK_TEXT(s->body->reason, "");
    CHECK_INT(s->body->safeguards.n_stopped, 0);
    for (int c = 0; c < 3; c++) CHECK(isfinite(tool_of(s, 0)->force_N[c]));
}

static void freezes_what_is_no_number_too_far_or_too_fast(void)
{
    tool_scene s;
    REQUIRE(open_two(&s));
    for (trial_case how = NOT_A_NUMBER_X; how <= TOO_FAST; how++) hurt(&s, how);
    tool_scene_close(&s);
}

static void leaves_a_body_alone_that_is_only_pressed_hard(void)
{
    tool_scene s;
    REQUIRE(open_two(&s));
    for (int i = 0; i < 60; i++) {
        move_tool(&s, 0, 0.02, 0.02, 0.045 - 0.001 * i, i & 8);
        REQUIRE(step_world(&s, 1));
    }
    CHECK(!s.body->frozen);
    tool_scene_close(&s);
}

/* two slabs beside each other; the second one as it moves alone is what it does beside one that stops */
static bool open_pair(tool_scene *s)
{
    if (!slab_scene(s, 4, 4, 3, 0.01, 1, 0.01, 15)) return false;
    s->scene->n_body = 2;
    s->scene->body[1] = s->scene->body[0];
    snprintf(s->scene->body[1].name, sizeof s->scene->body[1].name, "other");
    return tool_scene_open(s);
}

/* the second body is under load and falls into its rest; bad: in its way the first one is hurt and reset */
static bool run_pair(bool bad, double *x)
{
    tool_scene s;
    if (!open_pair(&s)) return false;
    pal_body *one = pal_world_body(s.world, 0), *two = pal_world_body(s.world, 1);
    const double force_N[3] = {0.05, 0, -0.1};
    CHECK_INT(pal_world_load(s.world, 1, two->n_node - 1, force_N), 0);
    for (int k = 0; k < 30; k++) {
        if (bad && k == 10) one->x[4] = NAN;
        pal_err err = pal_world_step(s.world, s.scene->step_s);
        CHECK_INT(err, bad && k == 10 ? PAL_ERR_FROZEN : 0);
        CHECK(one->frozen == (bad && k >= 10 && k <= 20) && !two->frozen);
        if (bad && k == 20) CHECK_INT(pal_world_reset_body(s.world, 0), 0);
        if (bad && k == 20) CHECK(!one->frozen && one->reason[0] == 0);
    }
    CHECK_LE(rms_displacement(one), 1e-12);
    CHECK(rms_displacement(two) > 1e-5);
    CHECK_INT(pal_world_reset_body(s.world, 2), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_reset_body(s.world, -1), PAL_ERR_REFUSED);
    memcpy(x, two->x, 3 * sizeof(double) * (size_t)two->n_dof);
    tool_scene_close(&s);
    return true;
}

static void one_of_two_bodies_stops_alone_and_is_reset_alone(void)
{
    static double x[2][3 * 5 * 5 * 4];
    REQUIRE(run_pair(false, x[0]) && run_pair(true, x[1]));
    CHECK(memcmp(x[0], x[1], sizeof x[0]) == 0);
}

static pal_err fail(void *self, pal_step *step)
{
    (void)self, (void)step;
    return PAL_ERR_NUMERIC;
}

static void a_row_that_fails_stops_its_body_alone(void)
{
    tool_scene s;
    REQUIRE(open_pair(&s));
    pal_body *one = pal_world_body(s.world, 0), *two = pal_world_body(s.world, 1);
    two->v[3 * (two->n_dof - 1)] = 0.1;
    pal_component *row = NULL;
    for (int i = 0; i < pal_world_component_count(s.world) && !row; i++) {
        const pal_component *r = pal_world_component(s.world, i);
        if (r->effect->stage == PAL_STAGE_SOLVE) row = (pal_component *)(uintptr_t)r;
    }
    REQUIRE(row != NULL);
    const pal_effect *was = row->effect;
    pal_effect bad = *was;
    bad.run = fail;
    row->effect = &bad;
    CHECK_INT(pal_world_step(s.world, s.scene->step_s), PAL_ERR_NUMERIC);
    CHECK(one->frozen && !two->frozen && rms_displacement(two) > 1e-6);
    CHECK(strstr(one->reason, "row verlet: no usable number") != NULL);
    CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
    row->effect = was;
    CHECK_INT(pal_world_reset_body(s.world, 0), 0);
    CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
    CHECK(!one->frozen);
    tool_scene_close(&s);
}

static void safeguards_are_counted_with_their_cost_and_only_then(void)
{
    tool_scene s;
    REQUIRE(open_two(&s));
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame != NULL);
    for (int i = 0; i < 20; i++) {
        move_tool(&s, 0, 0.02, 0.02, 0.04 - 0.0004 * i, false);
        REQUIRE(step_world(&s, 1));
    }
    pal_world_frame(s.world, frame);
    CHECK_INT(pal_safeguards_sum(&frame->part[0].safeguards), 0);
    CHECK_INT(frame->part[0].safeguards.ns, 0);
    const double force_N[3] = {0, 0, 1e6};
    CHECK_INT(pal_world_load(s.world, 0, s.body->n_node - 1, force_N), 0);
    REQUIRE(step_world(&s, 2));
    pal_world_frame(s.world, frame);
    const pal_frame_part *part = &frame->part[0];
    CHECK_INT(part->safeguards.n_capped, s.body->safeguards.n_capped);
    CHECK(part->safeguards.n_capped >= 2 && pal_safeguards_sum(&part->safeguards) >= part->safeguards.n_capped);
    CHECK(part->safeguards.ns > 0);
    s.body->x[0] = NAN;
    CHECK_INT(pal_world_step(s.world, s.scene->step_s), PAL_ERR_FROZEN);
    pal_world_frame(s.world, frame);
    CHECK(part->frozen && strstr(part->reason, "node 0 of tetrahedron 0 at (0, 0, 0) mm") == part->reason);
    CHECK_INT(part->safeguards.n_stopped, 1);
    pal_world_reset(s.world);
    pal_world_frame(s.world, frame);
    CHECK(!part->frozen && part->reason[0] == 0 && pal_safeguards_sum(&part->safeguards) == 0 &&
          part->safeguards.ns == 0);
    pal_frame_destroy(frame);
    tool_scene_close(&s);
}

/* sums of 8 at a time are what they say for any number of points, and no number that is none is lost in them */
static void sums_miss_no_number(void)
{
    enum { MAX_NODES = 35 };
    double mass[MAX_NODES], v[3 * MAX_NODES], x[3 * MAX_NODES], x0[3 * MAX_NODES], copy[3 * MAX_NODES + 1];
    for (int n = 0; n <= MAX_NODES; n++) {
        double motion = 0, way = 0;
        for (int i = 0; i < 3 * n; i++) {
            mass[i / 3] = 0.5 + i / 3, v[i] = sin(i), x[i] = cos(i), x0[i] = 0.1 * i;
            motion += mass[i / 3] * v[i] * v[i], way += v[i] * (x[i] - x0[i]);
        }
        copy[3 * n] = -7;
        CHECK_NEAR(pal_sum_mv2(n, mass, v), motion, 1e-12 * motion);
        CHECK_NEAR(pal_sum_work(3 * n, v, x, x0), way, 1e-12 * fabs(way));
        CHECK(pal_copy_finite(3 * n, x, copy) && !memcmp(copy, x, 3 * sizeof(double) * (size_t)n) && copy[3 * n] == -7);
        for (int i = 0; i < 3 * n; i++) {
            const double bad = i % 2 ? NAN : -INFINITY, v_i = v[i], x_i = x[i];
            x[i] = bad;
            CHECK(!pal_copy_finite(3 * n, x, copy));
            v[i] = 0; /* where nothing pulls, too */
            CHECK(!isfinite(pal_sum_work(3 * n, v, x, x0)));
            v[i] = bad, x[i] = x_i;
            CHECK(!isfinite(pal_sum_mv2(n, mass, v)));
            v[i] = v_i;
        }
    }
}

int main(void)
{
    RUN(sums_miss_no_number);
    RUN(freezes_what_is_no_number_too_far_or_too_fast);
    RUN(leaves_a_body_alone_that_is_only_pressed_hard);
    RUN(one_of_two_bodies_stops_alone_and_is_reset_alone);
    RUN(a_row_that_fails_stops_its_body_alone);
    RUN(safeguards_are_counted_with_their_cost_and_only_then);
    return check_report();
}
