/* A session that nobody watches: steps go on, frames come, nothing is skinned; who comes sees the present at once,
 * while it runs and while it is paused; the last who goes ends it. */
#include "server/base/clock.h"
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

static pal_scene scene;
static pal_prepared mesh;

/* newest frame after `tick` steps more, within a minute */
static const pal_frame *later(pal_session *s, uint64_t tick)
{
    const pal_frame *frame = NULL;
    uint64_t end = pal_clock_ns() + 60000000000u;
    while (pal_clock_ns() < end) {
        const pal_frame *next = pal_session_take_frame(s);
        if (next) frame = next;
        if (next && next->tick >= tick) return next;
        usleep(300);
    }
    return frame;
}

static void computes_nothing_to_show_until_somebody_comes(void)
{
    pal_session *s;
    pal_diagnostic diag = {""};
    const pal_session_options options = {.only_observed = true};
    REQUIRE(!pal_session_open(&scene, &options, &diag, &s));
    const pal_frame *f = later(s, 40);
    REQUIRE(f && f->tick >= 40);
    CHECK(!f->watched);
    CHECK_INT(f->part[0].n_output, 1);
    /* two come: from then on every step */
    pal_session_observe(s, true), pal_session_observe(s, true);
    f = later(s, f->tick + 3);
    REQUIRE(f && f->watched);
    uint64_t tick = f->tick, n = f->part[0].n_output;
    f = later(s, tick + 30);
    REQUIRE(f);
    CHECK_INT(f->part[0].n_output - n, f->tick - tick);
    /* one goes: still; both: no more */
    pal_session_observe(s, false);
    f = later(s, f->tick + 10);
    REQUIRE(f && f->watched);
    pal_session_observe(s, false);
    f = later(s, f->tick + 3);
    REQUIRE(f && !f->watched);
    tick = f->tick, n = f->part[0].n_output;
    f = later(s, tick + 30);
    REQUIRE(f);
    CHECK_INT(f->part[0].n_output, n);
    pal_session_close(s);
}

static void who_comes_to_a_paused_session_sees_it(void)
{
    pal_session *s;
    pal_diagnostic diag = {""};
    const pal_session_options options = {.only_observed = true};
    REQUIRE(!pal_session_open(&scene, &options, &diag, &s));
    REQUIRE(later(s, 30));
    pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_PAUSE});
    const pal_frame *f = NULL;
    for (int i = 0; i < 100000 && !(f && f->paused); i++, usleep(300)) {
        const pal_frame *next = pal_session_take_frame(s);
        if (next) f = next;
    }
    REQUIRE(f && f->paused && !f->watched);
    CHECK_INT(f->part[0].n_output, 1);
    uint64_t tick = f->tick;
    pal_session_observe(s, true);
    for (int i = 0; i < 100000 && !f->watched; i++, usleep(300)) {
        const pal_frame *next = pal_session_take_frame(s);
        if (next) f = next;
    }
    CHECK(f->watched && f->paused);
    CHECK_INT(f->tick, tick);
    CHECK_INT(f->part[0].n_output, 2);
    pal_session_close(s);
}

/* without the option nobody is asked */
static void a_session_as_before_shows_every_step(void)
{
    pal_session *s;
    pal_diagnostic diag = {""};
    REQUIRE(!pal_session_open(&scene, NULL, &diag, &s));
    const pal_frame *f = later(s, 20);
    REQUIRE(f && f->watched);
    CHECK_INT(f->part[0].n_output, f->tick + 1);
    pal_session_close(s);
}

/* off, its cost gone from the frames, on again; a row that must stay is refused with a sentence */
static void rows_are_switched_by_command(void)
{
    pal_session *s;
    pal_diagnostic diag = {""};
    REQUIRE(!pal_session_open(&scene, NULL, &diag, &s));
    const pal_frame *f = later(s, 3);
    REQUIRE(f);
    int n_row = f->n_row;
    CHECK_INT(n_row, pal_session_component_count(s));
    pal_component_info row;
    pal_session_component_info(s, 0, &row);
    CHECK(row.reason && row.reason[0]);
    CHECK_INT(pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .row = "gravity"}), 0);
    f = later(s, f->tick + 5);
    REQUIRE(f);
    CHECK_INT(f->n_row, n_row - 1);
    for (int r = 0; r < f->n_row; r++) CHECK(strcmp(f->component_name[r], "gravity") != 0);
    CHECK_INT(pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .row = "verlet"}), 0);
    f = later(s, f->tick + 5);
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "cannot be switched off") != NULL);
    CHECK(f->n_refused == 1 && f->n_row == n_row - 1);
    CHECK_INT(pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .row = "gravity", .wanted = true}),
              0);
    f = later(s, f->tick + 5);
    CHECK_INT(f->n_row, n_row);
    CHECK_INT(pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .row = "gravity", .body = 1}),
              PAL_ERR_REFUSED);
    pal_command endless = {.kind = PAL_COMMAND_COMPONENT};
    memset(endless.row, 'x', sizeof endless.row);
    CHECK_INT(pal_session_command(s, &endless), PAL_ERR_REFUSED);
    pal_session_close(s);
}

static void carry_nothing(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_transfer(next, before, -1, NULL, NULL);
}

/* a session that follows keeps rows off and who watches */
static void a_session_that_follows_keeps_them(void)
{
    pal_session *s, *next;
    pal_diagnostic diag = {""};
    const pal_session_options options = {.only_observed = true};
    REQUIRE(!pal_session_open(&scene, &options, &diag, &s));
    pal_session_observe(s, true);
    pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_COMPONENT, .row = "tool_grasp"});
    const pal_frame *f = later(s, 20);
    REQUIRE(f);
    int n_row = f->n_row;
    REQUIRE(!pal_session_open_after(s, &scene, &diag, &next));
    REQUIRE(!pal_session_transfer(next, s, carry_nothing, NULL, &diag));
    pal_session_close(s);
    f = later(next, 30);
    REQUIRE(f && f->tick >= 30);
    CHECK(f->watched);
    CHECK_INT(f->n_row, n_row);
    for (int r = 0; r < f->n_row; r++) CHECK(strcmp(f->component_name[r], "tool_grasp") != 0);
    pal_session_close(next);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 5)) return 1;
    RUN(computes_nothing_to_show_until_somebody_comes);
    RUN(who_comes_to_a_paused_session_sees_it);
    RUN(a_session_as_before_shows_every_step);
    RUN(rows_are_switched_by_command);
    RUN(a_session_that_follows_keeps_them);
    pal_prepared_free(&mesh);
    return check_report();
}
