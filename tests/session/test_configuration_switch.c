/* Live switches of a session: other methods, resolutions and steps take over from one that runs, and what cannot be
 * leaves it as it is. */
#include "server/session/configuration_switch.h"
#include "server/session/session.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"
#include "tests/session/stepped_session.h"

#include <string.h>

static pal_scene scene;
static pal_prepared mesh;

/* paused: steps come one by one, by command */
static pal_session *begin(bool paused)
{
    return stepped_open(&scene, (pal_session_options){.lease_s = 60, .start_paused = paused});
}

/* the session that replaces s, *change kept; NULL: an error was reported */
static pal_session *change_to(pal_session *s, const pal_configuration *to, pal_configuration_switch **change)
{
    pal_diagnostic diag = {""};
    pal_session *next = NULL;
    if (pal_configuration_switch_prepare(pal_session_scene(s), &scene.body[0], 0, to, &diag, change) ||
        pal_session_open_after(s, &(*change)->set->scene, &diag, &next)) {
        CHECK_FAIL("%s", diag.text);
        return NULL;
    }
    return stepped_transfer(next, s, pal_configuration_switch_transfer, *change) ? next : NULL;
}

/* the frame after n more steps */
static const pal_frame *take_steps(pal_session *s, bool paused, uint64_t tick, int n)
{
    for (int i = 0; i < n && paused; i++) CHECK(!stepped_order(s, PAL_COMMAND_STEP));
    const pal_frame *f = stepped_steps(s, n);
    CHECK_INT(f->tick, tick + (uint64_t)n);
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
    CHECK(!pal_session_request_pose(s, 0, &pose));
    uint64_t tick = take_steps(s, paused, 0, 20)->tick;
    for (int i = 0; i < 3; i++) {
        pal_configuration_switch *change = NULL;
        pal_transfer_report r;
        pal_session *next = change_to(s, &list[i], &change);
        REQUIRE(next);
        r = change->report;
        /* the springs' own voxels are full to their border: another mass, and held farther out */
        CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
        CHECK_LE(fmax(r.scale, 1 / r.scale), PAL_TRANSFER_MAX_SCALE * (1 + 1e-9));
        CHECK(r.energy_before_J > 0 && isfinite(r.energy_after_J));
        CHECK_LE(r.max_move_m, 0.005); /* of a ball of 100 mm that a tool presses */
        pal_session_close(s);
        pal_configuration_switch_free(old);
        s = next, old = change;
        const pal_frame *f = take_steps(s, paused, tick, 10);
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
    pal_transfer_report r;
    pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    uint64_t tick = take_steps(s, true, 0, 8)->tick;
    CHECK(!pal_session_request_pose(s, 0, &pose));
    take_steps(s, true, tick, 1);
    pal_session *next = change_to(s, &(pal_configuration){.model = "fem", .element = "hex8_bbar", .size = 7}, &change);
    REQUIRE(next);
    r = change->report;
    CHECK_NEAR(r.scale, PAL_TRANSFER_MAX_SCALE, 1e-9);
    CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
    pal_session_close(s);
    pal_session_close(next);
    pal_configuration_switch_free(change);
    *model = was;
}

enum { SLOW_NS = 400000000 };

static void transfer_slowly(void *change, pal_world *next, const pal_world *before)
{
    manual_clock_advance(&stepped_clock, SLOW_NS);
    pal_configuration_switch_transfer(change, next, before);
}

/* With the lease of every day, and a transfer that takes longer: the pose of before has been on its way for 5 ms of the
 * 250 ms, and the time that no thread ran does not count. Steps are of 5 ms */
static void a_tool_is_held_on_however_long_it_takes(void)
{
    const pal_configuration to = {.model = "fem", .element = "hex8_bbar", .size = 8};
    const pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    int n_rehearsed = 0;
    pal_session *s = stepped_open(&scene, (pal_session_options){0}), *next = NULL;
    pal_configuration_switch *change = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(s && !pal_configuration_switch_prepare(&scene, NULL, 0, &to, &diag, &change));
    REQUIRE(!pal_session_open_after(s, &change->set->scene, &diag, &next));
    CHECK(!pal_session_request_pose(s, 0, &pose));
    CHECK(stepped_steps(s, 1)->tool[0].present);
    REQUIRE(stepped_transfer(next, s, transfer_slowly, change));
    CHECK_NEAR(pal_session_pause_s(next, &n_rehearsed), 1e-9 * SLOW_NS, 1e-12);
    CHECK_INT(n_rehearsed, 0);
    CHECK(stepped_steps(next, 49)->tool[0].present);
    CHECK(!stepped_steps(next, 1)->tool[0].present);
    pal_session_close(s);
    pal_session_close(next);
    pal_configuration_switch_free(change);
}

/* the session runs on meanwhile */
static pal_session *rehearsed;
static int n_rehearsal;
static void rehearse_slowly(void *change, pal_world *next)
{
    manual_clock_settle(&stepped_clock, 1);
    uint64_t from = stepped_newest(rehearsed)->tick;
    CHECK_INT(stepped_steps(rehearsed, 10)->tick, from + 10);
    n_rehearsal++;
    pal_configuration_switch_rehearse(change, next);
}

static void a_switch_is_rehearsed_while_the_session_runs_on(void)
{
    const pal_configuration to = {.model = "fem", .element = "hex8_bbar", .size = 8};
    const pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}};
    pal_session *s = begin(false), *next = NULL;
    pal_configuration_switch *change = NULL;
    pal_transfer_report r;
    pal_diagnostic diag = {""};
    int n_rehearsed = 0;
    REQUIRE(s);
    CHECK(!pal_session_request_pose(s, 0, &pose));
    stepped_steps(s, 20);
    REQUIRE(!pal_configuration_switch_prepare(&scene, NULL, 0, &to, &diag, &change));
    REQUIRE(!pal_session_open_after(s, &change->set->scene, &diag, &next));
    rehearsed = s;
    pal_session_rehearse(next, s, NULL, pal_configuration_switch_snapshot, rehearse_slowly, change);
    pal_session_transfer_begin(next, s, NULL, pal_configuration_switch_transfer, change);
    CHECK(!pal_session_transfer_end(next, s, &diag));
    CHECK_NEAR(pal_session_pause_s(next, &n_rehearsed), 0, 0); /* no time passes in a transfer of this test */
    CHECK_INT(n_rehearsed, n_rehearsal);
    CHECK(n_rehearsed >= 1 && n_rehearsed <= PAL_SESSION_REHEARSALS_MAX);
    r = change->report;
    CHECK_NEAR(r.energy_after_J / r.energy_before_J, 1, 0.02);
    manual_clock_settle(&stepped_clock, 1);
    const pal_frame *f = stepped_steps(next, 15);
    CHECK_INT(f->tick, 20 + 10 * n_rehearsed + 15);
    CHECK(f->tool[0].present);
    pal_session_close(s);
    pal_session_close(next);
    pal_configuration_switch_free(change);
}

static bool has_component(const pal_frame *f, const char *name)
{
    for (int i = 0; i < f->n_row; i++)
        if (!strcmp(f->component_name[i], name)) return true;
    return false;
}

static void a_disabled_component_stays_disabled_through_a_method_without_it(void)
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
        CHECK(has_component(f, off[k]));
        snprintf(command.component, sizeof command.component, "%s", off[k]);
        CHECK(!pal_session_command(s, &command));
        f = take_steps(s, true, f->tick, 1);
        CHECK(!has_component(f, off[k]));
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
        for (int k = 0; k < 2; k++) CHECK(!has_component(f, off[k]));
    }
    /* on again, and so it stays */
    pal_command command = {.kind = PAL_COMMAND_COMPONENT, .component = "face_area", .wanted = true};
    pal_configuration_switch *change = NULL;
    CHECK(!pal_session_command(s, &command));
    f = take_steps(s, true, f->tick, 1);
    CHECK(has_component(f, "face_area"));
    uint64_t tick = f->tick;
    pal_session *next =
        change_to(s, &(pal_configuration){.model = "tet_springs", .k_area_J = -1, .step_s = 0.004}, &change);
    REQUIRE(next);
    pal_session_close(s);
    pal_configuration_switch_free(old);
    f = take_steps(next, true, tick, 1);
    CHECK(has_component(f, "face_area") && !has_component(f, "gravity"));
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
    stepped_steps(s, 3);
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
    CHECK_INT(stepped_steps(s, 5)->tick, 8); /* it runs on */
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
    REQUIRE(!pal_world_create(&change->set->scene, &diag, &next));
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
    RUN_SERIAL(a_disabled_component_stays_disabled_through_a_method_without_it);
    RUN(what_cannot_be_made_is_refused_with_a_sentence);
    RUN_SERIAL(what_is_not_taken_changes_nothing);
    pal_prepared_free(&mesh);
    return check_report();
}
