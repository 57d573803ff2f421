/* The session: pacing, commands, poses, leases, frames between threads, no heap call after open. The clock is the
 * test's own, so that numbers are exact. Sessions without pacing run at their own speed: tests of them wait for the
 * frames that they publish. */
#include "server/session/session.h"
#include "server/sim/core/blend.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/heap_calls.h"
#include "tests/session/session_scene.h"
#include "tests/session/stepped_session.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

enum { STEP_NS = 5000000 };

static pal_scene scene;
static pal_prepared mesh;

static bool shows_displacement(const pal_frame *f)
{
    return f->part[0].field[PAL_FIELD_DISPLACEMENT_M].value != NULL;
}

static pal_session *open_with(pal_session_options options)
{
    return stepped_open(&scene, options);
}

static pal_pose pose_at(double x, double z, uint32_t seq)
{
    return (pal_pose){.position_m = {x, 0, z}, .quat = {1, 0, 0, 0}, .seq = seq, .stamp_us = 1000 + seq};
}

/* ---- frames of a session without pacing ---- */

typedef struct published {
    pthread_mutex_t lock;
    pthread_cond_t came;
    uint64_t n_frame;
} published;

static void count_frame(void *user)
{
    published *p = user;
    pthread_mutex_lock(&p->lock);
    p->n_frame++;
    pthread_cond_broadcast(&p->came);
    pthread_mutex_unlock(&p->lock);
}

/* waits for n more frames */
static void wait_frames(published *p, uint64_t n)
{
    pthread_mutex_lock(&p->lock);
    for (uint64_t until = p->n_frame + n; p->n_frame < until;) pthread_cond_wait(&p->came, &p->lock);
    pthread_mutex_unlock(&p->lock);
}

/* the next frame that was not taken yet */
static const pal_frame *next_frame(pal_session *s, published *p)
{
    const pal_frame *frame;
    pthread_mutex_lock(&p->lock);
    while (!(frame = pal_session_take_frame(s))) pthread_cond_wait(&p->came, &p->lock);
    pthread_mutex_unlock(&p->lock);
    return frame;
}

static pal_session *open_unpaced(double lease_s, published *p)
{
    pal_session *session = NULL;
    *p = (published){.n_frame = 0};
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->came, NULL);
    pal_session_options options = {.unpaced = true, .lease_s = lease_s, .wake = count_frame, .user = p};
    CHECK_INT(pal_session_open(&scene, &options, NULL, &session), 0);
    return session;
}

/* ---- tests ---- */

static void steps_follow_the_clock_and_time_is_ticks_times_step(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    uint64_t start = stepped_clock.now_ns;
    CHECK_INT(stepped_newest(s)->tick, 0);
    const pal_frame *f = stepped_steps(s, 300);
    CHECK_INT(f->tick, 300);
    CHECK_INT(f->end_ns - start, 300ull * STEP_NS);
    CHECK_NEAR(f->time_s, 300 * scene.step_s, 1e-9);
    CHECK(!f->paused && f->n_substep >= 1);
    CHECK_NEAR(f->slowdown, 1, 1e-12);
    CHECK_INT(f->n_late, 0);
    CHECK(pal_session_is_alive(s));
    /* never ahead of the clock */
    manual_clock_advance(&stepped_clock, STEP_NS - 1);
    manual_clock_settle(&stepped_clock, 1);
    CHECK(pal_session_take_frame(s) == NULL);
    manual_clock_advance(&stepped_clock, 1);
    manual_clock_settle(&stepped_clock, 1);
    CHECK_INT(stepped_newest(s)->tick, 301);
    pal_session_close(s);
}

/* half a step goes by, then a command ends the rest, then the other half */
static void order_between_steps(pal_session *s, pal_command_kind kind)
{
    manual_clock_advance(&stepped_clock, STEP_NS / 2);
    CHECK_INT(stepped_order(s, kind), 0);
    manual_clock_settle(&stepped_clock, 1);
    manual_clock_advance(&stepped_clock, STEP_NS / 2);
    manual_clock_settle(&stepped_clock, 1);
}

/* of a sleeping body that nobody sees, the steps of a tenth of a second are taken together: no time is lost, no step
 * is late, and who looks or gives a command is answered with the next step */
static void a_session_at_rest_wakes_ten_times_a_second(void)
{
    pal_scene sleeps = scene;
    pal_body_def *def = &sleeps.body[0];
    /* in place of gravity, so that it is at rest from the start */
    pal_entry_init(&def->effect[0], "effects[0]", "sleep");
    pal_session *s = stepped_open(&sleeps, (pal_session_options){.only_observed = true});
    REQUIRE(s != NULL);
    (void)stepped_steps(s, 400);
    for (int turn = 0; turn < 2; turn++) {
        const uint64_t before = stepped_clock.n_sleep, began = stepped_newest(s)->tick;
        const pal_frame *f = stepped_steps(s, 100);
        /* rests of 20 steps */
        CHECK_INT(stepped_clock.n_sleep - before, turn == 0 ? 5 : 100);
        CHECK_INT(f->tick - began, 100);
        CHECK_NEAR(f->slowdown, 1, turn == 0 ? 1e-9 : 0.02); /* after a pause from the begin of a step on */
        CHECK_INT(f->n_late, 0);
        if (turn == 1) break;
        /* seven and a half steps into a rest somebody gives a command, and then into another comes */
        f = stepped_steps(s, 7);
        CHECK_INT(f->tick - began, 100);
        order_between_steps(s, PAL_COMMAND_PAUSE);
        f = stepped_newest(s);
        CHECK(f->paused);
        CHECK_INT(f->tick - began, 107);
        CHECK_INT(stepped_order(s, PAL_COMMAND_RESUME), 0);
        (void)pal_session_observe(s, true);
        f = stepped_steps(s, 1);
        CHECK_INT(f->n_late, 0);
    }
    pal_session_close(s);
}

/* paused, with a body that is not at rest: the same rests, without steps */
static void a_paused_session_that_nobody_sees_wakes_ten_times_a_second(void)
{
    pal_session *s = open_with((pal_session_options){.only_observed = true});
    REQUIRE(s != NULL);
    (void)stepped_steps(s, 10);
    CHECK_INT(stepped_order(s, PAL_COMMAND_PAUSE), 0);
    (void)stepped_steps(s, 1);
    const uint64_t before = stepped_clock.n_sleep, began = stepped_newest(s)->tick;
    (void)stepped_steps(s, 100);
    CHECK_INT(stepped_clock.n_sleep - before, 5);
    CHECK(pal_session_is_alive(s));
    /* half a step into a rest somebody orders a step, and half a step into another that the session goes on */
    order_between_steps(s, PAL_COMMAND_STEP);
    CHECK(stepped_newest(s)->paused);
    CHECK_INT(stepped_newest(s)->tick - began, 1);
    (void)stepped_steps(s, 30);
    order_between_steps(s, PAL_COMMAND_RESUME);
    const pal_frame *f = stepped_steps(s, 9);
    CHECK_INT(f->tick - began, 11);
    CHECK_NEAR(f->slowdown, 1, 1e-9);
    CHECK_INT(f->n_late, 0);
    pal_session_close(s);
}

static void a_session_that_starts_paused_shows_rest_and_steps_one_by_one(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    const pal_frame *f = stepped_newest(s);
    CHECK_INT(f->tick, 0);
    CHECK(f->paused);
    for (uint64_t n = 1; n <= 3; n++) {
        CHECK_INT(stepped_order(s, PAL_COMMAND_STEP), 0);
        f = stepped_steps(s, 2);
        CHECK_INT(f->tick, n);
        CHECK(f->paused);
    }
    CHECK_INT(stepped_order(s, PAL_COMMAND_RESUME), 0);
    CHECK_INT(stepped_steps(s, 3)->tick, 6);
    CHECK_INT(stepped_order(s, PAL_COMMAND_PAUSE), 0);
    f = stepped_steps(s, 2);
    CHECK(f->paused);
    CHECK_INT(f->tick, 6);
    CHECK_INT(stepped_order(s, PAL_COMMAND_RESET), 0);
    f = stepped_steps(s, 1);
    CHECK(f->paused);
    CHECK_INT(f->tick, 0);
    CHECK_NEAR(f->time_s, 0, 0);
    pal_session_close(s);
}

static void reset_brings_the_rest_shape_back(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    const pal_shown shown = pal_session_view_outline(s)->part[0];
    const pal_frame *f = stepped_steps(s, 100);
    double sag = 0, back = 0;
    for (int k = 0; k < 3 * shown.n_vertex; k++)
        sag = fmax(sag, fabs((double)f->part[0].position_m[k] - (double)shown.rest_m[k]));
    CHECK(sag > 1e-5);
    CHECK_INT(stepped_order(s, PAL_COMMAND_PAUSE), 0);
    CHECK_INT(stepped_order(s, PAL_COMMAND_RESET), 0);
    f = stepped_steps(s, 1);
    CHECK_INT(f->tick, 0);
    for (int k = 0; k < 3 * shown.n_vertex; k++)
        back = fmax(back, fabs((double)f->part[0].position_m[k] - (double)shown.rest_m[k]));
    CHECK_LE(back, 1e-6);
    pal_session_close(s);
}

static void bad_poses_and_commands_are_refused_and_counted(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    pal_pose good = pose_at(0.2, 0, 1), nan = pose_at(NAN, 0, 1), far = pose_at(1e6, 0, 1), quat = good;
    quat.quat[0] = 0;
    CHECK_INT(pal_session_request_pose(s, 0, &nan), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_request_pose(s, 0, &far), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_request_pose(s, 0, &quat), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_request_pose(s, 2, &good), PAL_ERR_REFUSED);
    CHECK_INT(pal_session_request_pose(s, -1, &good), PAL_ERR_REFUSED);
    CHECK_INT(stepped_order(s, PAL_COMMAND_COUNT), PAL_ERR_REFUSED);
    CHECK_INT(stepped_order(s, (pal_command_kind)-1), PAL_ERR_REFUSED);
    pal_command material = {.kind = PAL_COMMAND_MATERIAL, .body = 1, .material = scene.body[0].material};
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    material.body = 0;
    material.material.young_Pa = NAN;
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    material.material = (pal_material){5000, 0.6, 1000, 4, 0};
    CHECK_INT(pal_session_command(s, &material), PAL_ERR_REFUSED);
    CHECK_INT(stepped_steps(s, 1)->n_refused, 10);
    pal_session_close(s);
}

static void a_material_beyond_the_budget_is_refused_with_a_sentence(void)
{
    pal_diagnostic diag;
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    pal_session_last_diagnostic(s, &diag);
    CHECK_TEXT(diag.text, "");
    pal_command stiff = {.kind = PAL_COMMAND_MATERIAL, .material = {1e12, 0.45, 1000, 4}};
    CHECK_INT(pal_session_command(s, &stiff), 0);
    CHECK_INT(stepped_steps(s, 1)->n_refused, 1);
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "sub-steps") != NULL);
    pal_command softer = {.kind = PAL_COMMAND_MATERIAL, .material = {2500, 0.45, 1000, 4}};
    CHECK_INT(pal_session_command(s, &softer), 0);
    CHECK_INT(stepped_steps(s, 1)->n_refused, 1);
    pal_session_last_diagnostic(s, &diag);
    CHECK_TEXT(diag.text, "");
    pal_session_close(s);
}

static void a_flood_of_commands_is_refused_at_64_and_nothing_is_lost_before(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    for (int k = 0; k < 64; k++) CHECK_INT(stepped_order(s, PAL_COMMAND_STEP), 0);
    CHECK_INT(stepped_order(s, PAL_COMMAND_STEP), PAL_ERR_FULL);
    CHECK_INT(stepped_steps(s, 63)->tick, 63);
    CHECK_INT(stepped_steps(s, 10)->tick, 64);
    pal_session_close(s);
}

/* a thread that comes to every third step only: the two between are dropped */
static void a_slow_step_slows_simulated_time_and_is_reported(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    manual_clock_steps(&stepped_clock, 100, 3 * STEP_NS, 1);
    const pal_frame *f = stepped_newest(s);
    CHECK_INT(f->tick, 100);
    CHECK_NEAR(f->time_s, 100 * scene.step_s, 1e-9);
    CHECK_INT(f->n_late, 100);
    CHECK_NEAR(f->slowdown, 3, 1e-12);
    /* late by no more than a tenth of a step is not late */
    uint64_t n_late = f->n_late;
    manual_clock_advance(&stepped_clock, STEP_NS + STEP_NS / 10);
    manual_clock_settle(&stepped_clock, 1);
    CHECK_INT(stepped_newest(s)->n_late, n_late);
    pal_session_close(s);
}

static void no_heap_call_after_open(void)
{
    char path[] = "/tmp/palpate_log_XXXXXX";
    int file = mkstemp(path);
    REQUIRE(file >= 0);
    close(file);
    unlink(path); /* a file that is there is not written over */
    pal_session *s = open_with((pal_session_options){.lease_s = 0.05, .record_path = path});
    REQUIRE(s != NULL);
    stepped_steps(s, 2);
    long before = atomic_load(&n_heap_call);
    for (uint32_t k = 1; k <= CHECK_REPEATS(200, 70); k++) {
        pal_pose pose = pose_at(0.05 - 0.0001 * k, 0, k);
        pal_session_request_pose(s, 0, &pose);
        if (k % 20 == 0) stepped_order(s, PAL_COMMAND_RESET);
        if (k % 30 == 0)
            pal_session_command(
                s, &(pal_command){.kind = PAL_COMMAND_MATERIAL, .material = {k % 60 ? 4000 : 1e12, 0.45, 1000, 4}});
        stepped_steps(s, 1);
    }
    long after = atomic_load(&n_heap_call);
    CHECK_INT(after - before, 0);
    pal_session_close(s);
    unlink(path);
}

/* ---- many threads at once: meant for the thread sanitizer ---- */

typedef struct crowd {
    pal_session *session;
    int tool, n_error;
    _Atomic bool stop;
} crowd;

static void *put_poses(void *user)
{
    crowd *c = user;
    for (uint32_t k = 0; !atomic_load(&c->stop); k++) {
        pal_pose pose = pose_at(0.06 - 0.00001 * (k % 3000), 0.01 * c->tool, k);
        pal_session_request_pose(c->session, c->tool, k % 97 == 0 ? NULL : &pose);
        sched_yield();
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
        pal_err err = pal_session_command(c->session, &command);
        c->n_error += err && err != PAL_ERR_FULL;
        pal_session_last_diagnostic(c->session, &diag);
        pal_session_is_alive(c->session);
        sched_yield();
    }
    return NULL;
}

static void survives_poses_commands_and_frames_from_many_threads(void)
{
    for (int round = 0; round < 3; round++) {
        published p;
        pal_session *s = open_unpaced(0.02, &p);
        REQUIRE(s != NULL);
        crowd member[4] = {{.session = s}, {.session = s, .tool = 1}, {.session = s}, {.session = s}};
        pthread_t thread[4];
        for (int k = 0; k < 4; k++) pthread_create(&thread[k], NULL, k < 2 ? put_poses : give_orders, &member[k]);
        double sum = 0;
        for (int k = 0; k < CHECK_REPEATS(60, 20); k++) {
            const pal_frame *f = next_frame(s, &p);
            for (int v = 0; v < 3 * f->part[0].n_vertex; v++) sum += f->part[0].position_m[v];
        }
        CHECK(isfinite(sum));
        for (int k = 0; k < 4; k++) atomic_store(&member[k].stop, true);
        for (int k = 0; k < 4; k++) pthread_join(thread[k], NULL);
        for (int k = 0; k < 4; k++) CHECK_INT(member[k].n_error, 0);
        pal_session_close(s);
    }
    pal_session_close(NULL);
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

static void components_and_parts_are_known_to_every_thread(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    bool gravity = false;
    const pal_session_outline *outline = pal_session_view_outline(s);
    for (int k = 0; k < outline->n_component; k++) {
        gravity = gravity || !strcmp(outline->component[k].name, "gravity");
        CHECK_INT(outline->component[k].spent_ns, 0);
    }
    CHECK(gravity);
    CHECK_INT(outline->n_part, 1);
    CHECK_INT(outline->part[0].n_vertex, mesh.surface.n_vertex);
    CHECK(pal_session_scene(s) == &scene);
    pal_session_close(s);
}

static pal_err subscribe(pal_session *s, pal_field field, bool wanted)
{
    return pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_FIELD, .field = field, .wanted = wanted});
}

/* counted: the component comes with the first subscriber and goes with the last, even while paused */
static void a_field_exists_while_somebody_subscribes(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    const pal_frame *f = stepped_newest(s);
    int n_component = f->n_row;
    CHECK(!shows_displacement(f));
    CHECK_INT(n_component, pal_session_view_outline(s)->n_component);
    CHECK(pal_session_has_field(s, 0, PAL_FIELD_DISPLACEMENT_M) &&
          !pal_session_has_field(s, 0, PAL_FIELD_VON_MISES_PA));
    CHECK(!pal_session_has_field(s, 1, PAL_FIELD_DISPLACEMENT_M) &&
          !pal_session_has_field(s, -1, PAL_FIELD_DISPLACEMENT_M));
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    f = stepped_steps(s, 1);
    REQUIRE(shows_displacement(f));
    CHECK_INT(f->n_row, n_component + 1);
    CHECK_TEXT(f->component_name[n_component], "field_output");
    CHECK_INT(f->tick, 0);
    const pal_frame_field *field = &f->part[0].field[PAL_FIELD_DISPLACEMENT_M];
    CHECK(field->revision > 0);
    for (int i = 0; i < f->part[0].n_vertex; i++) CHECK_LE((double)field->value[i], 1e-7);
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, false), 0);
    CHECK_INT(stepped_order(s, PAL_COMMAND_STEP), 0);
    f = stepped_steps(s, 1);
    CHECK_INT(f->tick, 1);
    CHECK(shows_displacement(f)); /* one of two still subscribes */
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, false), 0);
    f = stepped_steps(s, 1);
    CHECK(!shows_displacement(f));
    CHECK_INT(f->n_row, n_component);
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, false), 0); /* one too many does no harm */
    CHECK_INT(subscribe(s, PAL_FIELD_DISPLACEMENT_M, true), 0);
    CHECK(shows_displacement(stepped_steps(s, 1)));
    /* what the model does not give, and what does not exist */
    CHECK_INT(subscribe(s, PAL_FIELD_VON_MISES_PA, true), PAL_ERR_REFUSED);
    CHECK_INT(subscribe(s, PAL_FIELD_NONE, true), PAL_ERR_REFUSED);
    CHECK_INT(subscribe(s, PAL_FIELD_COUNT, true), PAL_ERR_REFUSED);
    CHECK_INT(subscribe(s, (pal_field)-1, true), PAL_ERR_REFUSED);
    pal_command other = {.kind = PAL_COMMAND_FIELD, .body = 1, .field = PAL_FIELD_DISPLACEMENT_M, .wanted = true};
    CHECK_INT(pal_session_command(s, &other), PAL_ERR_REFUSED);
    pal_session_close(s);
}

static bool has_brush(const pal_frame *frame)
{
    bool found = false;
    for (int i = 0; i < frame->n_row; i++) found = found || !strcmp(frame->component_name[i], "brush");
    return found;
}

/* a tool without poses keeps its brush; one that falls silent loses it with its lease; a reset ends all. A brush that
 * is let go fades for PAL_BLEND_S, and its component is removed after the last step of the fade */
static void a_brush_lasts_until_its_tool_is_let_go(void)
{
    static pal_scene bare;
    const int fade_steps = (int)ceil(PAL_BLEND_S / scene.step_s), lease_steps = 50;
    pal_command brush = {
        .kind = PAL_COMMAND_BRUSH,
        .brush = {.kind = PAL_BRUSH_INFLATE, .at_m = {0, 0, 0.05}, .radius_m = 0.04, .pressure_Pa = 200}};
    bare = scene;
    pal_entry_init(&bare.body[0].output, "output", "surface_output");
    pal_session *s = stepped_open(&bare, (pal_session_options){.lease_s = 0.25});
    REQUIRE(s != NULL);
    for (int way = 0; way < 3; way++) {
        const pal_pose pose = pose_at(0.2, 0, 1);
        CHECK(!has_brush(stepped_newest(s)));
        if (way == 1) CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
        CHECK_INT(pal_session_command(s, &brush), 0);
        CHECK(has_brush(stepped_steps(s, 1)));
        if (way == 0) {
            CHECK(has_brush(stepped_steps(s, 100)));
            CHECK_INT(pal_session_request_pose(s, 0, NULL), 0);
        }
        if (way == 1) CHECK(has_brush(stepped_steps(s, lease_steps - 1)));
        if (way == 2) CHECK_INT(stepped_order(s, PAL_COMMAND_RESET), 0);
        if (way < 2) CHECK(has_brush(stepped_steps(s, fade_steps - 1)));
        CHECK(!has_brush(stepped_steps(s, 1)));
    }
    pal_session_close(s);
}

static void a_brush_that_cannot_be_is_refused_at_the_door_or_with_a_sentence(void)
{
    pal_session *s = open_with((pal_session_options){0});
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
    CHECK_INT(stepped_steps(s, 1)->n_refused, 6);
    pal_diagnostic diag;
    pal_session_last_diagnostic(s, &diag);
    CHECK(strstr(diag.text, "has no brushes: it is shown by a skin") != NULL);
    pal_session_close(s);
}

/* readers of fields and subscribers are different threads, all while the world runs without pacing */
typedef struct subscriber {
    pal_session *session;
    published *published;
} subscriber;
static _Atomic bool enough;

static void *subscribe_and_leave(void *user)
{
    const subscriber *u = user;
    bool subscribed = false;
    /* uneven numbers of frames between, so that two of them do not fall into step */
    for (uint64_t k = 1; !atomic_load(&enough) || subscribed; k++) {
        if (subscribe(u->session, PAL_FIELD_DISPLACEMENT_M, !subscribed) == 0) subscribed = !subscribed;
        wait_frames(u->published, k * k % 11);
    }
    return NULL;
}

static void fields_come_and_go_under_a_reader(void)
{
    published p;
    pal_session *s = open_unpaced(0, &p);
    subscriber user = {s, &p};
    pthread_t other[2];
    REQUIRE(s != NULL);
    for (int t = 0; t < 2; t++) REQUIRE(!pthread_create(&other[t], NULL, subscribe_and_leave, &user));
    int with = 0, without = 0;
    double sum = 0;
    while (with < 20 || without < 20) {
        const pal_frame *f = next_frame(s, &p);
        const pal_frame_field *field = &f->part[0].field[PAL_FIELD_DISPLACEMENT_M];
        for (int i = 0; field->value && i < f->part[0].n_vertex; i++) sum += (double)field->value[i];
        with += field->value != NULL;
        without += field->value == NULL;
    }
    atomic_store(&enough, true);
    for (int t = 0; t < 2; t++) pthread_join(other[t], NULL);
    CHECK(isfinite(sum));
    while (shows_displacement(next_frame(s, &p))) continue;
    /* as many have left as had subscribed: it stays without */
    for (int k = 0; k < 20; k++) CHECK(!shows_displacement(next_frame(s, &p)));
    pal_session_close(s);
}

int main(void)
{
    counting = true;
    /* sanitizers look at where threads meet; the size of the ball is not their matter */
    if (!small_scene(&scene, &mesh, CHECK_REPEATS(6, 4))) return 1;
    RUN(steps_follow_the_clock_and_time_is_ticks_times_step);
    RUN(a_session_at_rest_wakes_ten_times_a_second);
    RUN(a_paused_session_that_nobody_sees_wakes_ten_times_a_second);
    RUN(a_session_that_starts_paused_shows_rest_and_steps_one_by_one);
    RUN(reset_brings_the_rest_shape_back);
    RUN(bad_poses_and_commands_are_refused_and_counted);
    RUN(a_material_beyond_the_budget_is_refused_with_a_sentence);
    RUN(a_flood_of_commands_is_refused_at_64_and_nothing_is_lost_before);
    RUN(a_slow_step_slows_simulated_time_and_is_reported);
    RUN(no_heap_call_after_open);
    RUN(survives_poses_commands_and_frames_from_many_threads);
    RUN(a_scene_that_cannot_run_opens_no_session);
    RUN(components_and_parts_are_known_to_every_thread);
    RUN(a_brush_lasts_until_its_tool_is_let_go);
    RUN(a_brush_that_cannot_be_is_refused_at_the_door_or_with_a_sentence);
    RUN(a_field_exists_while_somebody_subscribes);
    RUN(fields_come_and_go_under_a_reader);
    pal_prepared_free(&mesh);
    return check_report();
}
