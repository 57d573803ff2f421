/* A session without observers: steps go on, frames come, nothing is skinned; an observer sees the present at once,
 * while it runs and while it is paused; the last one who goes ends it. */
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"
#include "tests/session/stepped_session.h"

static pal_scene scene;
static pal_prepared mesh;

static void computes_nothing_to_show_until_an_observer_comes(void)
{
    pal_session *s = stepped_open(&scene, (pal_session_options){.only_observed = true});
    REQUIRE(s);
    const pal_frame *f = stepped_steps(s, 40);
    CHECK_INT(f->tick, 40);
    CHECK(!f->watched);
    CHECK_INT(f->part[0].n_output, 1);
    /* two come: from then on every step; the coming itself is one output more */
    pal_session_observe(s, true), pal_session_observe(s, true);
    f = stepped_steps(s, 30);
    CHECK(f->watched);
    CHECK_INT(f->part[0].n_output, 1 + 1 + 30);
    /* one goes: still; both: no more */
    pal_session_observe(s, false);
    f = stepped_steps(s, 10);
    CHECK(f->watched);
    CHECK_INT(f->part[0].n_output, 1 + 1 + 40);
    pal_session_observe(s, false);
    f = stepped_steps(s, 30);
    CHECK(!f->watched);
    CHECK_INT(f->part[0].n_output, 1 + 1 + 40);
    pal_session_close(s);
}

static void an_observer_of_a_paused_session_sees_it(void)
{
    pal_session *s = stepped_open(&scene, (pal_session_options){.only_observed = true});
    REQUIRE(s);
    stepped_steps(s, 30);
    CHECK(!stepped_order(s, PAL_COMMAND_PAUSE));
    const pal_frame *f = stepped_steps(s, 5);
    CHECK(f->paused && !f->watched);
    CHECK_INT(f->part[0].n_output, 1);
    pal_session_observe(s, true);
    f = stepped_steps(s, 1);
    CHECK(f->watched && f->paused);
    CHECK_INT(f->tick, 30);
    CHECK_INT(f->part[0].n_output, 2);
    pal_session_close(s);
}

static void without_the_option_every_step_is_shown(void)
{
    pal_session *s = stepped_open(&scene, (pal_session_options){0});
    REQUIRE(s);
    const pal_frame *f = stepped_steps(s, 20);
    CHECK(f->watched);
    CHECK_INT(f->part[0].n_output, f->tick + 1);
    pal_session_close(s);
}

static bool has_component(const pal_frame *f, const char *name)
{
    for (int i = 0; i < f->n_row; i++)
        if (!strcmp(f->component_name[i], name)) return true;
    return false;
}

/* disabled, its cost gone from the frames, enabled again; one that must stay is refused with a sentence */
static void components_are_switched_by_command(void)
{
    pal_diagnostic diag = {""};
    pal_session *s = stepped_open(&scene, (pal_session_options){0});
    REQUIRE(s);
    const pal_frame *f = stepped_steps(s, 3);
    int n_component = f->n_row;
    CHECK_INT(n_component, pal_session_view_outline(s)->n_component);
    const char *reason = pal_session_view_outline(s)->component[0].reason;
    CHECK(reason && reason[0]);
    pal_command command = {.kind = PAL_COMMAND_COMPONENT, .component = "gravity"};
    CHECK_INT(pal_session_command(s, &command), 0);
    f = stepped_steps(s, 1);
    CHECK_INT(f->n_row, n_component - 1);
    CHECK(!has_component(f, "gravity"));
    CHECK_INT(pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .component = "verlet"}), 0);
    f = stepped_steps(s, 1);
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "cannot be switched off") != NULL);
    CHECK_INT(f->n_refused, 1);
    CHECK_INT(f->n_row, n_component - 1);
    command.wanted = true;
    CHECK_INT(pal_session_command(s, &command), 0);
    CHECK_INT(stepped_steps(s, 1)->n_row, n_component);
    command.body = 1;
    CHECK_INT(pal_session_command(s, &command), PAL_ERR_REFUSED);
    pal_command endless = {.kind = PAL_COMMAND_COMPONENT};
    memset(endless.component, 'x', sizeof endless.component);
    CHECK_INT(pal_session_command(s, &endless), PAL_ERR_REFUSED);
    pal_session_close(s);
}

static void transfer_world(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_transfer(next, before, -1, NULL, NULL);
}

static void a_session_that_follows_keeps_observers_and_disabled_components(void)
{
    pal_session *s = stepped_open(&scene, (pal_session_options){.only_observed = true}), *next;
    REQUIRE(s);
    pal_session_observe(s, true);
    CHECK(!pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .component = "tool_grasp"}));
    int n_component = stepped_steps(s, 20)->n_row;
    REQUIRE(!pal_session_open_after(s, &scene, NULL, &next));
    REQUIRE(stepped_transfer(next, s, transfer_world, NULL));
    pal_session_close(s);
    const pal_frame *f = stepped_steps(next, 10);
    CHECK_INT(f->tick, 30);
    CHECK(f->watched);
    CHECK_INT(f->n_row, n_component);
    CHECK(!has_component(f, "tool_grasp"));
    pal_session_close(next);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 5)) return 1;
    RUN(computes_nothing_to_show_until_an_observer_comes);
    RUN(an_observer_of_a_paused_session_sees_it);
    RUN(without_the_option_every_step_is_shown);
    RUN(components_are_switched_by_command);
    RUN(a_session_that_follows_keeps_observers_and_disabled_components);
    pal_prepared_free(&mesh);
    return check_report();
}
