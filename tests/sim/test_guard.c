/* finite_guard: a body that diverges is frozen in its last good state, and reset brings it back. */
#include "server/sim/effect.h"
#include "tests/sim/tool_scene.h"

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
    for (int i = 0; i < s->body->n_shown; i++)
        for (int c = 0; c < 3; c++) CHECK(isfinite(s->body->shown[3 * i + c]));
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

typedef enum insult { NOT_A_NUMBER_X, NOT_A_NUMBER_V, INFINITE_V, FAR_AWAY, TOO_FAST } insult;

/* the row alone: in a step the solver's own clamp comes first and tissue may well find its way back */
static void run_guard(tool_scene *s)
{
    for (int i = 0; i < pal_world_rows(s->world); i++) {
        const pal_row *row = pal_world_effect(s->world, i);
        pal_step step = {.body = s->body, .dt_s = s->scene->step_s, .n_sub = 1};
        if (!strcmp(row->effect->name, "finite_guard")) CHECK_INT(row->effect->run(row->self, &step), 0);
    }
}

static void hurt(tool_scene *s, insult how)
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
    if (how == FAR_AWAY) s->body->x[3 * node] += 11 * s->body->size_m;
    for (int i = 0; how == TOO_FAST && i < s->body->n_dof; i++) s->body->v[3 * i] = 1e6;
    if (how >= FAR_AWAY)
        run_guard(s);
    else
        CHECK_INT(pal_world_step(s->world, s->scene->step_s), PAL_ERR_FROZEN);
    check_frozen_and_back(s, good);
    for (int c = 0; c < 3; c++) CHECK(isfinite(tool_of(s, 0)->force_N[c]));
}

static void freezes_what_is_no_number_too_far_or_too_fast(void)
{
    tool_scene s;
    REQUIRE(open_two(&s));
    for (insult how = NOT_A_NUMBER_X; how <= TOO_FAST; how++) hurt(&s, how);
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

int main(void)
{
    RUN(freezes_what_is_no_number_too_far_or_too_fast);
    RUN(leaves_a_body_alone_that_is_only_pressed_hard);
    return check_report();
}
