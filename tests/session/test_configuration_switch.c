/* Live switches of a session: other methods, resolutions and steps take over from one that runs, and what cannot be
 * leaves it as it is. */
#include "server/base/clock.h"
#include "server/session/configuration_switch.h"
#include "server/session/session.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

#include <string.h>
#include <time.h>

static pal_scene scene;
static pal_prepared mesh;

static const pal_frame *wait_tick(pal_session *s, uint64_t tick)
{
    const pal_frame *f = NULL;
    for (int i = 0; i < 120000; i++) {
        const pal_frame *next = pal_session_take_frame(s);
        if (next) f = next;
        if (f && f->tick >= tick) return f;
        nanosleep(&(struct timespec){0, 500000}, NULL);
    }
    CHECK_FAIL("tick %llu does not come", (unsigned long long)tick);
    return f;
}

/* paused: steps come one by one, so that what is seen does not depend on the clock */
static pal_session *begin(bool paused)
{
    pal_diagnostic diag = {""};
    pal_session *s = NULL;
    pal_session_options options = {.lease_s = 60, .start_paused = paused};
    if (pal_session_open(&scene, &options, &diag, &s)) CHECK_FAIL("%s", diag.text);
    return s;
}

/* the session that takes over, *change kept; NULL: an error was sent */
static pal_session *change_to(pal_session *s, const pal_configuration *to, pal_configuration_switch **change)
{
    pal_diagnostic diag = {""};
    pal_session *next = NULL;
    if (pal_configuration_switch_prepare(pal_session_scene(s), &scene.body[0], 0, to, &diag, change) ||
        pal_session_open_after(s, pal_configuration_switch_scene(*change), &diag, &next) ||
        pal_session_transfer(next, s, pal_configuration_switch_transfer, *change, &diag)) {
        CHECK_FAIL("%s", diag.text);
        return NULL;
    }
    return next;
}

/* the frame after n more steps; paused: exactly so many */
static const pal_frame *take_steps(pal_session *s, bool paused, uint64_t tick, int n)
{
    for (int i = 0; i < n && paused; i++) CHECK(!pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_STEP}));
    const pal_frame *f = wait_tick(s, tick + (uint64_t)n);
    if (paused) CHECK_INT(f->tick, tick + (uint64_t)n);
    return f;
}

static void a_session_changes_its_method_and_comes_back(bool paused)
{
    const pal_configuration list[] = {{.model = "fem", .element = "hex8_bbar", .size = 8},
                                      {.model = "fem", .element = "tet4", .size = 6, .step_s = 0.01, .tolerance = 1e-3},
                                      {.model = "tet_springs", .size = 0, .step_s = 0.005, .k_area_J = -1}};
    pal_session *s = begin(paused);
    pal_configuration_switch *old = NULL;
    pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    CHECK(!pal_session_put_pose(s, 0, &pose));
    uint64_t tick = take_steps(s, paused, 0, 20)->tick;
    for (int i = 0; i < 3; i++) {
        pal_configuration_switch *change = NULL;
        pal_configuration_switch_report r;
        pal_session *next = change_to(s, &list[i], &change);
        REQUIRE(next);
        pal_configuration_switch_get_report(change, &r);
        /* the springs' own voxels are full to their border: another mass, and held farther out */
        CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
        CHECK_LE(fmax(r.scale, 1 / r.scale), PAL_TRANSFER_MAX_SCALE * (1 + 1e-9));
        CHECK(r.energy_before_J > 0 && isfinite(r.energy_after_J));
        CHECK_LE(r.max_move_m, 0.005); /* of a ball of 100 mm that a tool presses */
        pal_session_close(s);
        pal_configuration_switch_free(old);
        s = next, old = change;
        const pal_frame *f = take_steps(s, paused, tick, 10);
        CHECK(f->tick >= tick + 10); /* counts on */
        CHECK(f->tool[0].present);
        tick = f->tick;
        pal_configuration now;
        pal_configuration_of(pal_session_scene(s), 0, &now);
        CHECK_TEXT(now.model, list[i].model);
        CHECK_NEAR(pal_session_scene(s)->step_s, list[i].step_s > 0 ? list[i].step_s : 0.005, 1e-12);
    }
    /* back at what it came with: the very mesh */
    CHECK(pal_session_scene(s)->body[0].mesh == &mesh);
    pal_session_close(s);
    pal_configuration_switch_free(old);
}

static void a_running_session_changes_its_method_and_comes_back(void)
{
    a_session_changes_its_method_and_comes_back(false);
}

/* the same at known steps */
static void step_by_step_the_energy_is_kept(void)
{
    a_session_changes_its_method_and_comes_back(true);
}

/* One step after the tool has come, by springs whose constants make them several times as stiff as the tissue: elements
 * would have to lie more than eight tenths as far again from rest. They go to the bound, and the velocity makes up for
 * the remainder */
static void beyond_the_bound_of_displacements_the_velocity_makes_up(void)
{
    pal_config_entry *model = &scene.body[0].model, was = *model;
    CHECK(!pal_entry_put_text(model, "weights", "volume", NULL));
    CHECK(!pal_entry_put_number(model, "k_distance_J", 0.25, NULL) &&
          !pal_entry_put_number(model, "k_volume_J", 1, NULL));
    pal_session *s = begin(true);
    pal_configuration_switch *change = NULL;
    pal_configuration_switch_report r;
    pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    uint64_t tick = take_steps(s, true, 0, 8)->tick;
    CHECK(!pal_session_put_pose(s, 0, &pose));
    take_steps(s, true, tick, 1);
    pal_session *next = change_to(s, &(pal_configuration){.model = "fem", .element = "hex8_bbar", .size = 7}, &change);
    REQUIRE(next);
    pal_configuration_switch_get_report(change, &r);
    CHECK_NEAR(r.scale, PAL_TRANSFER_MAX_SCALE, 1e-9);
    CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
    pal_session_close(s);
    pal_session_close(next);
    pal_configuration_switch_free(change);
    *model = was;
}

static void carry_slowly(void *change, pal_world *next, const pal_world *before)
{
    nanosleep(&(struct timespec){0, 400000000}, NULL);
    pal_configuration_switch_transfer(change, next, before);
}

static _Atomic(pal_session *) looked;
static _Atomic int n_shown, n_without;

static void count_tools(void *user)
{
    /* the simulation thread is the one that takes frames here */
    (void)user;
    pal_session *s = looked;
    const pal_frame *f = s ? pal_session_take_frame(s) : NULL;
    if (!f) return;
    n_shown++;
    if (!f->tool[0].present) n_without++;
}

/* with the lease of every day, and a carry that takes longer */
static void a_tool_is_held_on_however_long_it_takes(void)
{
    const pal_configuration to = {.model = "fem", .element = "hex8_bbar", .size = 8};
    const pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    bool starved = true;
    for (int round = 0; round < CHECK_REPEATS(10, 2) && starved; round++) {
        pal_session *s = NULL, *next = NULL;
        pal_configuration_switch *change = NULL;
        pal_diagnostic diag = {""};
        pal_session_options options = {.wake = count_tools};
        looked = NULL;
        REQUIRE(!pal_session_open(&scene, &options, &diag, &s));
        REQUIRE(!pal_configuration_switch_prepare(&scene, NULL, 0, &to, &diag, &change));
        REQUIRE(!pal_session_open_after(s, pal_configuration_switch_scene(change), &diag, &next));
        /* pressed for a while, so that it is taken */
        for (const pal_frame *f = NULL; !f || !f->tool[0].present;) {
            CHECK(!pal_session_put_pose(s, 0, &pose));
            nanosleep(&(struct timespec){0, 500000}, NULL);
            const pal_frame *now = pal_session_take_frame(s);
            if (now) f = now;
        }
        uint64_t sent_ns = pal_clock_ns();
        CHECK(!pal_session_put_pose(s, 0, &pose));
        looked = next;
        n_shown = n_without = 0;
        uint64_t began_ns = pal_clock_ns();
        CHECK(!pal_session_transfer(next, s, carry_slowly, change, &diag));
        began_ns = pal_clock_ns() - began_ns;
        while (n_shown < 3) nanosleep(&(struct timespec){0, 500000}, NULL);
        /* the machine itself was too slow for the lease: again */
        starved = pal_clock_ns() - sent_ns - began_ns > 200000000;
        CHECK(starved || n_without == 0);
        pal_session_close(s);
        pal_session_close(next);
        pal_configuration_switch_free(change);
    }
    if (starved) printf("  the machine is too slow for a lease of 0.25 s\n");
}

static _Atomic uint64_t stepped;

/* the session runs on meanwhile: a rehearsal that waits for it to take ten steps comes to its end */
static void rehearse_slowly(void *change, pal_world *next)
{
    uint64_t from = stepped;
    for (int i = 0; i < 120000 && stepped < from + 10; i++) nanosleep(&(struct timespec){0, 500000}, NULL);
    CHECK(stepped >= from + 10);
    pal_configuration_switch_rehearse(change, next);
}

static void count_steps(void *user)
{
    (void)user;
    stepped++;
}

static void a_switch_is_rehearsed_while_the_session_runs_on(void)
{
    const pal_configuration to = {.model = "fem", .element = "hex8_bbar", .size = 8};
    const pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    pal_session *s = NULL, *next = NULL;
    pal_configuration_switch *change = NULL;
    pal_configuration_switch_report r;
    pal_diagnostic diag = {""};
    int n_rehearsed = 0;
    pal_session_options options = {.lease_s = 60, .wake = count_steps};
    REQUIRE(!pal_session_open(&scene, &options, &diag, &s));
    CHECK(!pal_session_put_pose(s, 0, &pose));
    wait_tick(s, 20);
    REQUIRE(!pal_configuration_switch_prepare(&scene, NULL, 0, &to, &diag, &change));
    REQUIRE(!pal_session_open_after(s, pal_configuration_switch_scene(change), &diag, &next));
    pal_session_rehearse(next, s, pal_configuration_switch_snapshot, rehearse_slowly, change);
    pal_session_transfer_begin(next, s, pal_configuration_switch_transfer, change);
    CHECK(!pal_session_transfer_end(next, s, &diag));
    double stood_s = pal_session_pause_s(next, &n_rehearsed);
    CHECK(stood_s > 0 && n_rehearsed >= 1 && n_rehearsed <= PAL_SESSION_REHEARSALS_MAX);
    pal_configuration_switch_get_report(change, &r);
    CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
    CHECK(wait_tick(next, 35)->tool[0].present);
    printf("  %d rehearsals, stood still for %.1f ms\n", n_rehearsed, 1e3 * stood_s);
    pal_session_close(s);
    pal_session_close(next);
    pal_configuration_switch_free(change);
}

static bool has_row(const pal_frame *f, const char *name)
{
    for (int i = 0; i < f->n_row; i++)
        if (!strcmp(f->component_name[i], name)) return true;
    return false;
}

static void a_row_that_is_off_stays_off_through_a_method_without_it(void)
{
    const pal_configuration list[] = {{.model = "fem", .element = "hex8_bbar", .size = 6},
                                      {.model = "fem", .element = "tet4", .size = 6},
                                      {.model = "tet_springs", .k_area_J = -1}};
    const char *const off[] = {"face_area", "gravity"};
    pal_session *s = begin(true);
    pal_configuration_switch *old = NULL;
    const pal_frame *f = take_steps(s, true, 0, 1);
    for (int k = 0; k < 2; k++) {
        pal_command command = {.kind = PAL_COMMAND_COMPONENT, .wanted = false};
        CHECK(has_row(f, off[k]));
        snprintf(command.row, sizeof command.row, "%s", off[k]);
        CHECK(!pal_session_command(s, &command));
        f = take_steps(s, true, f->tick, 1);
        CHECK(!has_row(f, off[k]));
    }
    for (int i = 0; i < 3; i++) {
        pal_configuration_switch *change = NULL;
        uint64_t tick = f->tick;
        pal_session *next = change_to(s, &list[i], &change);
        REQUIRE(next);
        pal_session_close(s);
        pal_configuration_switch_free(old);
        s = next, old = change;
        f = take_steps(s, true, tick, 1);
        for (int k = 0; k < 2; k++) CHECK(!has_row(f, off[k]));
    }
    /* on again, and so it stays */
    pal_command command = {.kind = PAL_COMMAND_COMPONENT, .row = "face_area", .wanted = true};
    pal_configuration_switch *change = NULL;
    CHECK(!pal_session_command(s, &command));
    f = take_steps(s, true, f->tick, 1);
    CHECK(has_row(f, "face_area"));
    uint64_t tick = f->tick;
    pal_session *next =
        change_to(s, &(pal_configuration){.model = "tet_springs", .k_area_J = -1, .step_s = 0.004}, &change);
    REQUIRE(next);
    pal_session_close(s);
    pal_configuration_switch_free(old);
    f = take_steps(next, true, tick, 1);
    CHECK(has_row(f, "face_area") && !has_row(f, "gravity"));
    pal_session_close(next);
    pal_configuration_switch_free(change);
}

static void what_cannot_be_made_is_refused_with_a_sentence(void)
{
    const struct {
        pal_configuration to;
        const char *expected;
    } bad[] = {{{.model = "adaptive_springs", .size = 2}, "does not take model"},
               {{.model = "marble"}, "no model"},
               {{.model = "fem", .element = "hex9", .size = 8}, "no element"},
               {{.model = "fem", .size = 100000}, "size"},
               {{.model = "fem", .size = 400}, "a live switch takes 100000 at most"},
               {{.model = "fem", .element = "tet10", .size = 32}, "a live switch takes 100000 at most"},
               {{.model = "fem", .size = 8, .step_s = 3}, "step_s"},
               {{.model = "tet_springs", .k_area_J = -1}, "already"}};
    pal_session *s = begin(false);
    wait_tick(s, 3);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        pal_diagnostic diag = {""};
        pal_configuration_switch *change = NULL;
        CHECK_INT(pal_configuration_switch_prepare(pal_session_scene(s), &scene.body[0], 0, &bad[i].to, &diag, &change),
                  PAL_ERR_REFUSED);
        CHECK(!change && strstr(diag.text, bad[i].expected));
        if (!strstr(diag.text, bad[i].expected)) printf("  %s\n", diag.text);
    }
    pal_diagnostic diag = {""};
    pal_configuration_switch *change = NULL;
    CHECK_INT(pal_configuration_switch_prepare(pal_session_scene(s), NULL, 3, &bad[0].to, &diag, &change),
              PAL_ERR_REFUSED);
    uint64_t tick = wait_tick(s, 5)->tick;
    wait_tick(s, tick + 5); /* it runs on */
    CHECK(pal_session_is_alive(s));
    pal_session_close(s);
}

/* refused or made and not taken: the world of before has the same bits */
static void what_is_not_taken_changes_nothing(void)
{
    pal_world *w = NULL, *next = NULL;
    pal_diagnostic diag = {""};
    pal_configuration_switch *change = NULL;
    REQUIRE(!pal_world_create(&scene, &diag, &w));
    for (int k = 0; k < 5; k++) CHECK(!pal_world_step(w, scene.step_s));
    uint64_t hash = pal_world_hash(w);
    const pal_configuration good = {.model = "fem", .size = 6}, bad = {.model = "fem", .element = "tet5", .size = 6};
    CHECK_INT(pal_configuration_switch_prepare(&scene, NULL, 0, &bad, &diag, &change), PAL_ERR_REFUSED);
    REQUIRE(!pal_configuration_switch_prepare(&scene, NULL, 0, &good, &diag, &change));
    REQUIRE(!pal_world_create(pal_configuration_switch_scene(change), &diag, &next));
    pal_configuration_switch_transfer(change, next, w);
    CHECK(pal_world_hash(w) == hash);
    for (int k = 0; k < 5; k++) CHECK(!pal_world_step(w, scene.step_s));
    /* as one that nobody ever wanted to switch */
    pal_world *other = NULL;
    REQUIRE(!pal_world_create(&scene, &diag, &other));
    for (int k = 0; k < 10; k++) CHECK(!pal_world_step(other, scene.step_s));
    CHECK(pal_world_hash(w) == pal_world_hash(other));
    pal_world_destroy(other);
    pal_world_destroy(next);
    pal_world_destroy(w);
    pal_configuration_switch_free(change);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 8)) return 1;
    scene.body[0].material.damping_1_s = 10;
    scene.body[0].material.young_Pa = 5e4;
    scene.body[0].support[0].fraction = 0.2; /* so that every mesh is held by as much */
    RUN(a_running_session_changes_its_method_and_comes_back);
    RUN_SERIAL(step_by_step_the_energy_is_kept);
    RUN_SERIAL(beyond_the_bound_of_displacements_the_velocity_makes_up);
    RUN_SERIAL(a_tool_is_held_on_however_long_it_takes);
    RUN(a_switch_is_rehearsed_while_the_session_runs_on);
    RUN_SERIAL(a_row_that_is_off_stays_off_through_a_method_without_it);
    RUN(what_cannot_be_made_is_refused_with_a_sentence);
    RUN_SERIAL(what_is_not_taken_changes_nothing);
    pal_prepared_free(&mesh);
    return check_report();
}
