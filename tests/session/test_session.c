/* The session: pacing, commands, poses, leases, frames between threads, no heap call after open. Everything waits for a
 * condition that the wake callback signals; what depends on the clock is compared with the clock, never with a guess of
 * how fast this machine is. */
#include "server/base/clock.h"
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/heap_calls.h"
#include "tests/session/session_scene.h"

#include <pthread.h>
#include <stdatomic.h>

static pal_scene scene;
static pal_prepared mesh;

/* ---- a reader that waits for frames ---- */

typedef struct watch {
    pthread_mutex_t lock;
    pthread_cond_t came;
    uint64_t n_wake;
} watch;

static void wake(void *user)
{
    watch *w = user;
    pthread_mutex_lock(&w->lock);
    w->n_wake++;
    pthread_cond_signal(&w->came);
    pthread_mutex_unlock(&w->lock);
}

/* the next frame that was not seen yet; gives up after 20 s */
static const pal_frame *next_frame(pal_session *s, watch *w)
{
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += 20;
    for (;;) {
        pthread_mutex_lock(&w->lock);
        uint64_t seen = w->n_wake;
        pthread_mutex_unlock(&w->lock);
        const pal_frame *frame = pal_session_take_frame(s);
        if (frame) return frame;
        pthread_mutex_lock(&w->lock);
        int late = 0;
        while (w->n_wake == seen && !late) late = pthread_cond_timedwait(&w->came, &w->lock, &until);
        pthread_mutex_unlock(&w->lock);
        if (late) return NULL;
    }
}

typedef bool (*frame_test)(const pal_frame *frame, uint64_t number);
static const pal_frame *frame_where(pal_session *s, watch *w, frame_test test, uint64_t number)
{
    const pal_frame *frame;
    while ((frame = next_frame(s, w)) && !test(frame, number)) {
    }
    return frame;
}
static bool tick_at_least(const pal_frame *f, uint64_t n)
{
    return f->tick >= n;
}
static bool is_paused(const pal_frame *f, uint64_t yes)
{
    return f->paused == (yes != 0);
}
static bool tick_is(const pal_frame *f, uint64_t n)
{
    return f->tick == n;
}
static bool used_seq(const pal_frame *f, uint64_t seq)
{
    return f->tool[0].present && f->tool[0].pose.seq >= seq;
}
static bool tool_gone(const pal_frame *f, uint64_t tool)
{
    return !f->tool[tool].present;
}
static bool shows_displacement(const pal_frame *f, uint64_t yes)
{
    return (f->part[0].field[PAL_FIELD_DISPLACEMENT_M].value != NULL) == (yes != 0);
}
static bool refused_at_least(const pal_frame *f, uint64_t n)
{
    return f->n_refused >= n;
}

static watch *make_watch(void)
{
    static watch w;
    w = (watch){.n_wake = 0};
    pthread_mutex_init(&w.lock, NULL);
    pthread_cond_init(&w.came, NULL);
    return &w;
}

static pal_session *open_with(pal_session_options options, watch *w)
{
    pal_session *session = NULL;
    pal_diagnostic diag = {""};
    options.wake = wake;
    options.user = w;
    if (pal_session_open(&scene, &options, &diag, &session)) CHECK_FAIL("open: %s", diag.text);
    return session;
}

static pal_err order(pal_session *s, pal_command_kind kind)
{
    return pal_session_command(s, &(pal_command){.kind = kind});
}

static pal_pose pose_at(double x, double z, uint32_t seq)
{
    return (pal_pose){.position_m = {x, 0, z}, .quat = {1, 0, 0, 0}, .seq = seq, .stamp_us = 1000 + seq};
}

/* ---- tests ---- */

static void steps_follow_the_clock_and_time_is_ticks_times_step(void)
{
    watch *w = make_watch();
    uint64_t start = pal_clock_ns();
    pal_session *s = open_with((pal_session_options){0}, w);
    REQUIRE(s != NULL);
    const pal_frame *f = frame_where(s, w, tick_at_least, 40);
    REQUIRE(f != NULL);
    double real_s = 1e-9 * (double)(f->end_ns - start);
    CHECK_NEAR(f->time_s, (double)f->tick * scene.step_s, 1e-9);
    /* never ahead of the clock: the first step is due one step after the start */
    CHECK_LE(f->time_s, real_s + 1e-6);
    CHECK(!f->paused);
    CHECK(f->n_substep >= 1);
    CHECK(f->slowdown > 0.5);
    CHECK(pal_session_is_alive(s));
    pal_session_close(s);
}

static void a_session_that_starts_paused_shows_rest_and_steps_one_by_one(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.start_paused = true}, w);
    REQUIRE(s != NULL);
    const pal_frame *f = next_frame(s, w);
    REQUIRE(f != NULL);
    CHECK_INT(f->tick, 0);
    CHECK(f->paused);
    for (uint64_t n = 1; n <= 3; n++) {
        CHECK_INT(order(s, PAL_COMMAND_STEP), 0);
        f = frame_where(s, w, tick_is, n);
        REQUIRE(f != NULL);
        CHECK(f->paused);
    }
    CHECK_INT(order(s, PAL_COMMAND_RESUME), 0);
    REQUIRE(frame_where(s, w, tick_at_least, 6));
    CHECK_INT(order(s, PAL_COMMAND_PAUSE), 0);
    f = frame_where(s, w, is_paused, 1);
    REQUIRE(f != NULL);
    uint64_t fixed = f->tick;
    CHECK_INT(order(s, PAL_COMMAND_RESET), 0);
    f = frame_where(s, w, tick_is, 0);
    REQUIRE(f != NULL);
    CHECK(fixed >= 6 && f->paused);
    CHECK_NEAR(f->time_s, 0, 0);
    pal_session_close(s);
}

static void reset_brings_the_rest_shape_back(void)
{
    watch *w = make_watch();
    pal_shown shown;
    pal_session *s = open_with((pal_session_options){.unpaced = true}, w);
    REQUIRE(s != NULL);
    pal_session_shown(s, 0, &shown);
    const pal_frame *f = frame_where(s, w, tick_at_least, 100);
    REQUIRE(f != NULL);
    double sag = 0, back = 0;
    for (int k = 0; k < 3 * shown.n_vertex; k++)
        sag = fmax(sag, fabs((double)f->part[0].position_m[k] - (double)shown.rest_m[k]));
    CHECK(sag > 1e-5);
    CHECK_INT(order(s, PAL_COMMAND_PAUSE), 0);
    CHECK_INT(order(s, PAL_COMMAND_RESET), 0);
    f = frame_where(s, w, tick_is, 0);
    REQUIRE(f != NULL);
    for (int k = 0; k < 3 * shown.n_vertex; k++)
        back = fmax(back, fabs((double)f->part[0].position_m[k] - (double)shown.rest_m[k]));
    CHECK_LE(back, 1e-6);
    pal_session_close(s);
}

static void the_newest_pose_wins_and_is_echoed_with_its_arrival_time(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.lease_s = 30}, w);
    REQUIRE(s != NULL);
    uint64_t before = pal_clock_ns();
    for (uint32_t seq = 1; seq <= 50; seq++) {
        pal_pose pose = pose_at(0.2, 0.001 * seq, seq);
        CHECK_INT(pal_session_put_pose(s, 0, &pose), 0);
    }
    uint64_t after = pal_clock_ns();
    const pal_frame *f = frame_where(s, w, used_seq, 50);
    REQUIRE(f != NULL);
    CHECK_INT(f->tool[0].pose.seq, 50);
    CHECK_INT(f->tool[0].pose.stamp_us, 1050);
    CHECK(f->tool[0].pose_ns >= before && f->tool[0].pose_ns <= after);
    CHECK_NEAR(f->tool[0].pose.position_m[2], 0.05, 1e-12);
    CHECK(!f->tool[1].present);
    CHECK_INT(pal_session_put_pose(s, 0, NULL), 0);
    CHECK(frame_where(s, w, tool_gone, 0) != NULL);
    pal_session_close(s);
}

static void a_silent_holder_loses_the_tool_after_its_lease(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.lease_s = 0.25}, w);
    REQUIRE(s != NULL);
    pal_pose pose = pose_at(0.2, 0, 1);
    CHECK_INT(pal_session_put_pose(s, 0, &pose), 0);
    const pal_frame *f = frame_where(s, w, used_seq, 1);
    REQUIRE(f != NULL);
    uint64_t arrived = f->tool[0].pose_ns;
    f = frame_where(s, w, tool_gone, 0);
    REQUIRE(f != NULL);
    CHECK(f->end_ns - arrived >= 250000000u);
    pal_session_close(s);
}

static void while_paused_tools_are_shown_where_they_are_held(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.start_paused = true, .lease_s = 30}, w);
    REQUIRE(s != NULL);
    REQUIRE(next_frame(s, w) != NULL);
    for (uint32_t seq = 1; seq < 4; seq++) {
        pal_pose pose = pose_at(0.2, 0.01 * seq, seq);
        CHECK_INT(pal_session_put_pose(s, 0, &pose), 0);
        const pal_frame *f = frame_where(s, w, used_seq, seq);
        REQUIRE(f != NULL);
        CHECK_INT(f->tick, 0);
        CHECK_NEAR(f->tool[0].pose.position_m[2], 0.01 * seq, 1e-12);
    }
    pal_session_close(s);
}

static void bad_poses_and_commands_are_refused_and_counted(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){0}, w);
    REQUIRE(s != NULL);
    pal_pose good = pose_at(0.2, 0, 1), nan = pose_at(NAN, 0, 1), far = pose_at(1e6, 0, 1), quat = good;
    quat.quat[0] = 0;
    CHECK_INT(pal_session_put_pose(s, 0, &nan), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_put_pose(s, 0, &far), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_put_pose(s, 0, &quat), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_put_pose(s, 2, &good), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_put_pose(s, -1, &good), PAL_ERR_REFUSED);
    CHECK_INT(order(s, PAL_COMMAND_COUNT), PAL_ERR_REFUSED);
    CHECK_INT(order(s, (pal_command_kind)-1), PAL_ERR_REFUSED);
    pal_command material = {.kind = PAL_COMMAND_MATERIAL, .body = 1, .material = scene.body[0].material};
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    material.body = 0;
    material.material.young_Pa = NAN;
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    material.material = (pal_material){5000, 0.6, 1000, 4};
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    const pal_frame *f = frame_where(s, w, refused_at_least, 10);
    CHECK(f != NULL);
    pal_session_close(s);
}

static void a_material_beyond_the_budget_is_refused_with_a_sentence(void)
{
    watch *w = make_watch();
    pal_diagnostic diag;
    pal_session *s = open_with((pal_session_options){0}, w);
    REQUIRE(s != NULL);
    pal_session_last_diagnostic(s, &diag);
    CHECK_TEXT(diag.text, "");
    pal_command stiff = {.kind = PAL_COMMAND_MATERIAL, .material = {1e12, 0.45, 1000, 4}};
    CHECK_INT(pal_session_command(s, &stiff), 0);
    REQUIRE(frame_where(s, w, refused_at_least, 1) != NULL);
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "sub-steps") != NULL);
    pal_command softer = {.kind = PAL_COMMAND_MATERIAL, .material = {2500, 0.45, 1000, 4}};
    CHECK_INT(pal_session_command(s, &softer), 0);
    const pal_frame *f = next_frame(s, w);
    REQUIRE(f != NULL);
    REQUIRE(frame_where(s, w, tick_at_least, f->tick + 2) != NULL);
    pal_session_last_diagnostic(s, &diag);
    CHECK_TEXT(diag.text, "");
    pal_session_close(s);
}

static void a_flood_of_commands_is_refused_at_64_and_nothing_is_lost_before(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.start_paused = true}, w);
    REQUIRE(s != NULL);
    REQUIRE(next_frame(s, w) != NULL);
    uint64_t taken = 0;
    bool full = false;
    for (int k = 0; k < 200000 && !full; k++) {
        pal_err err = order(s, PAL_COMMAND_STEP);
        taken += err == 0;
        full = err == PAL_ERR_FULL;
    }
    CHECK(full);
    CHECK(taken >= 64);
    CHECK(frame_where(s, w, tick_is, taken) != NULL);
    pal_session_close(s);
}

/* a scene that cannot keep up: the step asked for is far shorter than what it costs */
static void a_slow_step_slows_simulated_time_and_says_by_how_much(void)
{
    watch *w = make_watch();
    double step_s = scene.step_s;
    pal_prepared big;
    pal_scene slow;
    REQUIRE(small_scene(&slow, &big, CHECK_REPEATS(26, 18)));
    slow.step_s = 1e-4;
    pal_scene kept = scene;
    scene = slow;
    pal_session *s = open_with((pal_session_options){0}, w);
    REQUIRE(s != NULL);
    uint64_t start = pal_clock_ns();
    const pal_frame *f;
    while ((f = next_frame(s, w)) && (f->tick < 3 || f->end_ns - start < 400000000u)) {
    }
    REQUIRE(f != NULL);
    double real_s = 1e-9 * (double)(f->end_ns - start), ratio = real_s / f->time_s;
    CHECK(f->slowdown > 1.5);
    CHECK_NEAR(f->slowdown / ratio, 1, 0.5);
    CHECK(f->n_late > 0 && f->n_late <= f->tick + 1);
    pal_session_close(s);
    scene = kept;
    pal_prepared_free(&big);
    CHECK_NEAR(scene.step_s, step_s, 0);
}

static void no_heap_call_after_open(void)
{
    watch *w = make_watch();
    char path[] = "/tmp/palpate_log_XXXXXX";
    int file = mkstemp(path);
    REQUIRE(file >= 0);
    close(file);
    pal_session *s = open_with((pal_session_options){.lease_s = 0.05, .record_path = path}, w);
    REQUIRE(s != NULL);
    REQUIRE(frame_where(s, w, tick_at_least, 2) != NULL);
    long before = atomic_load(&n_heap_call);
    for (uint32_t k = 1; k <= CHECK_REPEATS(200, 70); k++) {
        pal_pose pose = pose_at(0.05 - 0.0001 * k, 0, k);
        pal_session_put_pose(s, 0, &pose);
        if (k % 20 == 0) order(s, PAL_COMMAND_RESET);
        if (k % 30 == 0)
            pal_session_command(
                s, &(pal_command){.kind = PAL_COMMAND_MATERIAL, .material = {k % 60 ? 4000 : 1e12, 0.45, 1000, 4}});
        if (!next_frame(s, w)) break;
    }
    long after = atomic_load(&n_heap_call);
    CHECK_INT(after - before, 0);
    pal_session_close(s);
    unlink(path);
}

/* ---- many threads at once: meant for the thread sanitizer ---- */

typedef struct crowd {
    pal_session *session;
    _Atomic bool stop;
    int tool;
} crowd;

static void *put_poses(void *user)
{
    crowd *c = user;
    for (uint32_t k = 0; !atomic_load(&c->stop); k++) {
        pal_pose pose = pose_at(0.06 - 0.00001 * (k % 3000), 0.01 * c->tool, k);
        pal_session_put_pose(c->session, c->tool, k % 97 == 0 ? NULL : &pose);
        if (k % 16 == 0) usleep(200);
    }
    return NULL;
}

static void *give_orders(void *user)
{
    crowd *c = user;
    pal_diagnostic diag;
    for (int k = 0; !atomic_load(&c->stop); k++) {
        pal_command command = {.kind = (pal_command_kind)(k % PAL_COMMAND_MATERIAL)};
        if (k % 32 == 0) command.kind = PAL_COMMAND_MATERIAL, command.material = scene.body[0].material;
        while (pal_session_command(c->session, &command) == PAL_ERR_FULL && !atomic_load(&c->stop)) usleep(500);
        pal_session_last_diagnostic(c->session, &diag);
        pal_session_is_alive(c->session);
    }
    return NULL;
}

static void survives_poses_commands_and_frames_from_many_threads_and_a_close_in_the_middle(void)
{
    for (int round = 0; round < 3; round++) {
        watch *w = make_watch();
        pal_session *s = open_with((pal_session_options){.unpaced = round > 0, .lease_s = 0.02}, w);
        REQUIRE(s != NULL);
        crowd member[4] = {{s, false, 0}, {s, false, 1}, {s, false, 0}, {s, false, 0}};
        pthread_t thread[4];
        for (int k = 0; k < 4; k++) pthread_create(&thread[k], NULL, k < 2 ? put_poses : give_orders, &member[k]);
        double sum = 0;
        for (int k = 0; k < CHECK_REPEATS(60, 20); k++) {
            const pal_frame *f = next_frame(s, w);
            REQUIRE(f != NULL);
            for (int v = 0; v < 3 * f->part[0].n_vertex; v++) sum += f->part[0].position_m[v];
        }
        CHECK(isfinite(sum));
        for (int k = 0; k < 4; k++) atomic_store(&member[k].stop, true);
        for (int k = 0; k < 4; k++) pthread_join(thread[k], NULL);
        pal_session_close(s);
    }
    pal_session_close(NULL);
}

static void carry_all(void *user, pal_world *next, const pal_world *before)
{
    *(uint64_t *)user = pal_world_hash(before);
    pal_world_transfer(next, before, -1, NULL, NULL);
    CHECK(pal_world_hash(next) == *(uint64_t *)user);
}

/* the tool stays in its holder's hand, time and steps go on, and the session that was left only closes */
static void another_session_goes_on_where_one_was(void)
{
    watch *w = make_watch();
    uint64_t hash = 0;
    pal_diagnostic diag = {""};
    pal_session *before = open_with((pal_session_options){.lease_s = 10}, w);
    pal_session *next = open_with((pal_session_options){.lease_s = 10, .hold = true}, w);
    REQUIRE(before && next);
    pal_pose pose = pose_at(0, 0.2, 5);
    CHECK_INT(pal_session_put_pose(before, 1, &pose), 0);
    pose = pose_at(0, 0.3, 7);
    CHECK_INT(pal_session_put_pose(before, 0, &pose), 0);
    const pal_frame *f = frame_where(before, w, used_seq, 7);
    REQUIRE(f != NULL);
    uint64_t tick = f->tick;
    CHECK(pal_session_take_frame(next) == NULL);
    CHECK_INT(pal_session_transfer(next, before, carry_all, &hash, &diag), 0);
    CHECK(hash != 0);
    f = frame_where(next, w, used_seq, 7);
    REQUIRE(f != NULL);
    CHECK(f->tick >= tick);
    CHECK_NEAR(f->time_s, (double)f->tick * scene.step_s, 1e-9);
    CHECK(f->tool[1].present);
    pose = pose_at(0, 0.25, 8);
    CHECK_INT(pal_session_put_pose(next, 0, &pose), 0);
    f = frame_where(next, w, used_seq, 8);
    REQUIRE(f != NULL);
    pal_session_close(before);
    CHECK_INT(order(next, PAL_COMMAND_PAUSE), 0);
    REQUIRE(frame_where(next, w, is_paused, 1));
    pal_session_close(next);
}

static void a_scene_that_cannot_run_opens_no_session(void)
{
    pal_scene bad = scene;
    pal_session *s = NULL;
    pal_diagnostic diag = {""};
    bad.step_s = 7;
    CHECK(pal_session_open(&bad, NULL, &diag, &s) == PAL_ERR_REFUSED);
    CHECK(s == NULL && diag.text[0]);
    pal_session_options options = {.record_path = "/no/such/folder/log"};
    diag.text[0] = 0;
    CHECK_INT(pal_session_open(&scene, &options, &diag, &s), PAL_ERR_IO);
    CHECK(s == NULL && strstr(diag.text, "/no/such/folder/log") != NULL);
}

static void rows_and_parts_are_known_to_every_thread(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.start_paused = true}, w);
    REQUIRE(s != NULL);
    pal_component_info row;
    pal_shown shown;
    bool gravity = false;
    for (int k = 0; k < pal_session_component_count(s); k++) {
        pal_session_component_info(s, k, &row);
        gravity = gravity || !strcmp(row.name, "gravity");
        CHECK_INT(row.spent_ns, 0);
    }
    CHECK(gravity);
    CHECK_INT(pal_session_part_count(s), 1);
    pal_session_shown(s, 0, &shown);
    CHECK_INT(shown.n_vertex, mesh.surface.n_vertex);
    pal_session_component_info(s, 1000, &row);
    CHECK_TEXT(row.name, "");
    pal_session_shown(s, -1, &shown);
    CHECK_INT(shown.n_vertex, 0);
    CHECK(pal_session_scene(s) == &scene);
    pal_session_close(s);
}

static pal_err look(pal_session *s, pal_field field, bool wanted)
{
    return pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_FIELD, .field = field, .wanted = wanted});
}

/* counted: the row comes with the first and goes with the last, even while paused */
static void a_field_is_there_while_anybody_looks(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.start_paused = true}, w);
    REQUIRE(s != NULL);
    const pal_frame *f = next_frame(s, w);
    REQUIRE(f != NULL);
    int rows = f->n_row;
    CHECK(shows_displacement(f, 0));
    CHECK_INT(rows, pal_session_component_count(s));
    CHECK(pal_session_has_field(s, 0, PAL_FIELD_DISPLACEMENT_M) && !pal_session_has_field(s, 0, PAL_FIELD_ENERGY_J_M3));
    CHECK(!pal_session_has_field(s, 1, PAL_FIELD_DISPLACEMENT_M) &&
          !pal_session_has_field(s, -1, PAL_FIELD_DISPLACEMENT_M));
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    f = frame_where(s, w, shows_displacement, 1);
    REQUIRE(f != NULL);
    CHECK_INT(f->n_row, rows + 1);
    CHECK_TEXT(f->component_name[rows], "field_output");
    CHECK_INT(f->tick, 0);
    const pal_frame_field *field = &f->part[0].field[PAL_FIELD_DISPLACEMENT_M];
    CHECK(field->revision > 0);
    for (int i = 0; i < f->part[0].n_vertex; i++) CHECK_LE((double)field->value[i], 1e-7);
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, false), 0);
    CHECK_INT(order(s, PAL_COMMAND_STEP), 0);
    f = frame_where(s, w, tick_is, 1);
    REQUIRE(f != NULL);
    CHECK(shows_displacement(f, 1)); /* one of two still looks */
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, false), 0);
    f = frame_where(s, w, shows_displacement, 0);
    REQUIRE(f != NULL);
    CHECK_INT(f->n_row, rows);
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, false), 0); /* one too many does no harm */
    CHECK_INT(look(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    CHECK(frame_where(s, w, shows_displacement, 1) != NULL);
    /* what the model does not give, and what does not exist */
    CHECK_INT(look(s, PAL_FIELD_VON_MISES_PA, true), PAL_ERR_REFUSED);
    CHECK_INT(look(s, PAL_FIELD_NONE, true), PAL_ERR_REFUSED);
    CHECK_INT(look(s, PAL_FIELD_COUNT, true), PAL_ERR_REFUSED);
    CHECK_INT(look(s, (pal_field)-1, true), PAL_ERR_REFUSED);
    pal_command other = {.kind = PAL_COMMAND_FIELD, .body = 1, .field = PAL_FIELD_DISPLACEMENT_M, .wanted = true};
    CHECK_INT(pal_session_command(s, &other), PAL_ERR_REFUSED);
    pal_session_close(s);
}

static bool has_brush(const pal_frame *frame, uint64_t wanted)
{
    bool found = false;
    for (int i = 0; i < frame->n_row; i++) found = found || !strcmp(frame->component_name[i], "brush");
    return found == (wanted != 0);
}

/* a tool without poses keeps its brush; one that falls silent loses it with its lease; a reset ends all */
static void a_brush_lasts_until_its_tool_is_let_go(void)
{
    static pal_scene bare;
    watch *w = make_watch();
    pal_session *s;
    pal_diagnostic diag = {""};
    pal_command brush = {
        .kind = PAL_COMMAND_BRUSH,
        .brush = {.kind = PAL_BRUSH_INFLATE, .at_m = {0, 0, 0.05}, .radius_m = 0.04, .pressure_Pa = 200}};
    bare = scene;
    pal_entry_init(&bare.body[0].output, "output", "surface_output");
    REQUIRE(!pal_session_open(&bare, &(pal_session_options){.lease_s = 0.25, .wake = wake, .user = w}, &diag, &s));
    for (int way = 0; way < 3; way++) {
        const pal_pose pose = pose_at(0.2, 0, 1);
        const pal_frame *f = frame_where(s, w, has_brush, 0);
        REQUIRE(f != NULL);
        if (way == 1) CHECK_INT(pal_session_put_pose(s, 0, &pose), 0);
        CHECK_INT(pal_session_command(s, &brush), 0);
        f = frame_where(s, w, has_brush, 1);
        REQUIRE(f != NULL);
        const uint64_t began = f->tick;
        if (way == 0) {
            while (f && f->tick < began + 100) f = next_frame(s, w);
            REQUIRE(f && has_brush(f, 1));
            CHECK_INT(pal_session_put_pose(s, 0, NULL), 0);
        }
        if (way == 2) CHECK_INT(order(s, PAL_COMMAND_RESET), 0);
        CHECK(frame_where(s, w, has_brush, 0) != NULL);
    }
    pal_session_close(s);
}

static void a_brush_that_cannot_be_is_refused_at_the_door_or_with_a_sentence(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){0}, w);
    REQUIRE(s != NULL);
    const pal_command good = {.kind = PAL_COMMAND_BRUSH,
                              .brush = {.kind = PAL_BRUSH_INFLATE, .radius_m = 1, .pressure_Pa = 1}};
    pal_command bad = good;
    bad.body = 1;
    CHECK_INT(pal_session_command(s, &bad), PAL_ERR_REFUSED);
    bad = good, bad.slot = 2;
    CHECK_INT(pal_session_command(s, &bad), PAL_ERR_REFUSED);
    bad = good, bad.slot = -1;
    CHECK_INT(pal_session_command(s, &bad), PAL_ERR_REFUSED);
    bad = good, bad.brush.radius_m = NAN;
    CHECK_INT(pal_session_command(s, &bad), PAL_ERR_REFUSED);
    bad = good, bad.brush.kind = PAL_BRUSH_COUNT;
    CHECK_INT(pal_session_command(s, &bad), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_command(s, &good), 0);
    const pal_frame *f = next_frame(s, w);
    while (f && f->n_refused < 6) f = next_frame(s, w);
    pal_diagnostic diag;
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "has no brushes: it is shown by a skin") != NULL);
    pal_session_close(s);
}

/* readers of fields and those who ask for them are different threads, all while the world runs */
static _Atomic bool enough;
static void *look_in_and_out(void *user)
{
    pal_session *s = user;
    bool looks = false;
    /* uneven pauses, so that the two do not fall into step */
    for (uint64_t k = 1; !atomic_load(&enough) || looks; k++) {
        if (look(s, PAL_FIELD_DISPLACEMENT_M, !looks) == 0) looks = !looks;
        pal_clock_sleep_until_ns(pal_clock_ns() + 500000 * (k * k % 11));
    }
    return NULL;
}

static void fields_come_and_go_under_a_reader(void)
{
    watch *w = make_watch();
    pal_session *s = open_with((pal_session_options){.unpaced = true}, w);
    pthread_t other[2];
    REQUIRE(s != NULL);
    for (int t = 0; t < 2; t++) REQUIRE(!pthread_create(&other[t], NULL, look_in_and_out, s));
    int with = 0, without = 0;
    double sum = 0;
    for (int k = 0; k < 2000 && (with < 20 || without < 20); k++) {
        const pal_frame *f = next_frame(s, w);
        if (!f) break;
        const pal_frame_field *field = &f->part[0].field[PAL_FIELD_DISPLACEMENT_M];
        for (int i = 0; field->value && i < f->part[0].n_vertex; i++) sum += (double)field->value[i];
        with += field->value != NULL;
        without += field->value == NULL;
    }
    atomic_store(&enough, true);
    for (int t = 0; t < 2; t++) pthread_join(other[t], NULL);
    CHECK(with > 0 && without > 0);
    CHECK(isfinite(sum));
    REQUIRE(frame_where(s, w, shows_displacement, 0) != NULL); /* as many looked away as had looked */
    pal_session_close(s);
}

int main(void)
{
    counting = true;
    /* sanitizers look at where threads meet; the size of the ball is not their matter */
    if (!small_scene(&scene, &mesh, CHECK_REPEATS(6, 4))) return 1;
    RUN(steps_follow_the_clock_and_time_is_ticks_times_step);
    RUN(a_session_that_starts_paused_shows_rest_and_steps_one_by_one);
    RUN(reset_brings_the_rest_shape_back);
    RUN(the_newest_pose_wins_and_is_echoed_with_its_arrival_time);
    RUN(a_silent_holder_loses_the_tool_after_its_lease);
    RUN(while_paused_tools_are_shown_where_they_are_held);
    RUN(bad_poses_and_commands_are_refused_and_counted);
    RUN(a_material_beyond_the_budget_is_refused_with_a_sentence);
    RUN(a_flood_of_commands_is_refused_at_64_and_nothing_is_lost_before);
    RUN(a_slow_step_slows_simulated_time_and_says_by_how_much);
    RUN(no_heap_call_after_open);
    RUN(survives_poses_commands_and_frames_from_many_threads_and_a_close_in_the_middle);
    RUN(another_session_goes_on_where_one_was);
    RUN(a_scene_that_cannot_run_opens_no_session);
    RUN(rows_and_parts_are_known_to_every_thread);
    RUN(a_brush_lasts_until_its_tool_is_let_go);
    RUN(a_brush_that_cannot_be_is_refused_at_the_door_or_with_a_sentence);
    RUN(a_field_is_there_while_anybody_looks);
    RUN(fields_come_and_go_under_a_reader);
    pal_prepared_free(&mesh);
    return check_report();
}
