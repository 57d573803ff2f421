/* A recording as members of a debrief use it: played with its edits and switches, sought, at other speeds, and gone on
 * from live. */
#include "server/net/tuning.h"
#include "server/session/recording.h"
#include "server/session/replay.h"
#include "server/session/tuning.h"
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

#include <unistd.h>

#define TOP "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05"

static clay_scene clay;
static pal_recording *recording;
static char path[] = "/tmp/palpate_playback_XXXXXX", branch_path[64];

/* both members move their tools for some steps */
static void play(mem_client *a, mem_client *b, int n)
{
    static uint32_t seq;
    for (int i = 0; i < n; i++) {
        const double phase = 0.02 * ++seq;
        mem_pose(a, 0, seq, (const double[3]){0.03 * sin(phase), 0.02, 0.055 - 0.01 * cos(phase)});
        mem_pose(b, 1, seq, (const double[3]){0.055 + 0.008 * cos(phase), 0, 0.02 * sin(phase)});
        served_turn(FRAME_NS, a, b);
    }
}

/* what is played below: 90 steps, then four changes with 60 steps after each */
static void record(void)
{
    mem_client a, b;
    unlink(path);
    served_begin(&clay.scene, (pal_session_options){.record_path = path}, (pal_server_options){0});
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    play(&a, &b, 90);
    CHECK(order(&a, "extrude", TOP ",\"distance_m\":0.03"));
    until_frame(&a);
    play(&a, &b, 60);
    send(&a, "material", "\"young_Pa\":9000");
    play(&a, &b, 1);
    CHECK(order(&a, "undo", ""));
    until_frame(&a);
    play(&a, &b, 60);
    /* a step for each turn of the clock is fast enough for the watch of the pace, however long the jobs take */
    CHECK(order(&a, "configure", "\"step_ms\":9"));
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "divide", TOP));
    until_frame(&a);
    play(&a, &b, 60);
    mem_end(&a), mem_end(&b);
    end();
}

static void its_marks_and_times(void)
{
    static const char *const expected[] = {"edit", "material", "undo", "configuration", "edit"};
    int n;
    const pal_recording_mark *mark = pal_recording_marks(recording, &n);
    CHECK_INT(n, 5);
    for (int k = 0; k < n && k < 5; k++) CHECK_TEXT(mark[k].text, expected[k]);
    for (int k = 1; k < n; k++) CHECK(mark[k].time_s >= mark[k - 1].time_s);
    /* steps of the scene until the switch, of 9 ms after it */
    const double switch_s = n > 3 ? mark[3].time_s : 0, length_s = pal_recording_length_s(recording);
    const uint64_t switch_step = pal_recording_step(recording, switch_s), end = pal_recording_step(recording, 1e9);
    CHECK_NEAR(switch_s, (double)switch_step * clay.scene.step_s, 1e-9);
    CHECK_NEAR(length_s - switch_s, 0.009 * (double)(end - switch_step), 1e-9);
    CHECK(end - switch_step >= 120);
    for (uint64_t step = 0; step <= end; step += 7)
        CHECK_INT(pal_recording_step(recording, pal_recording_time_s(recording, step)), step);
    CHECK_INT(pal_recording_step(recording, -1), 0);
}

/* positions of body 0 when a replay has taken some steps */
typedef struct state_at {
    uint64_t step, taken;
    double x[3 * 4096], size_m;
    int n;
} state_at;
static bool keep_state(void *user, const pal_world *world, double fraction)
{
    state_at *to = user;
    (void)fraction;
    if (++to->taken != to->step) return true;
    const pal_body *body = pal_world_view_body(world, 0);
    to->n = body->n_dof < 4096 ? body->n_dof : 4096;
    to->size_m = body->length_scale_m;
    memcpy(to->x, body->x, 3 * sizeof(double) * (size_t)to->n);
    return false; /* enough */
}

/* a seek leads to what an exact replay shows there: friction begins anew at the last state, hence 2 % of the size */
static void a_seek_shows_what_was(void)
{
    static state_at exact;
    const uint64_t end = pal_recording_step(recording, 1e9);
    uint32_t seed = 7;
    for (int k = 0; k < 12; k++) {
        pal_diagnostic diag = {""};
        pal_replay_report report;
        pal_resume *resume = NULL;
        seed = seed * 1664525u + 1013904223u;
        exact = (state_at){.step = 1 + seed % (uint32_t)end};
        (void)pal_replay_run(path, &clay.scene, &(pal_replay_watch){keep_state, &exact, NULL}, &report, &diag);
        if (pal_recording_seek(recording, exact.step, k % 2, &diag, &resume)) CHECK_FAIL("seek: %s", diag.text);
        if (!resume) continue;
        pal_world *world = pal_resume_take_world(resume);
        const pal_body *body = pal_world_view_body(world, 0);
        double farthest = 0;
        const bool same = body->n_dof == exact.n;
        /* an edit of this very step: the exact replay was stopped before it */
        if (!same) CHECK(pal_recording_behind(recording, exact.step) != exact.step);
        for (int i = 0; same && i < 3 * exact.n; i++) farthest = fmax(farthest, fabs(body->x[i] - exact.x[i]));
        CHECK_LE(farthest, 0.02 * exact.size_m);
        pal_world_destroy(world);
        pal_resume_free(resume);
    }
}

static pal_session_recording replayed;
static pal_resume *beginning;
static pal_session *first; /* until a change in the recording or a seek replaces it */

static void begin(void)
{
    pal_diagnostic diag = {""};
    replayed = (pal_session_recording){recording, branch_path};
    REQUIRE(!pal_recording_seek(recording, 0, false, &diag, &beginning));
    served_session(pal_resume_scene(beginning),
                   (pal_session_options){.resume = beginning, .plays = true, .start_paused = true});
    first = session;
    served_open((pal_server_options){.resume = &beginning, .recording = &replayed});
}

static void finish(mem_client *a, mem_client *b)
{
    mem_end(a);
    if (b) mem_end(b);
    end();
    pal_resume_free(beginning);
}

static bool is_there(const mem_client *c, int tool)
{
    return !(c->tools.tool[tool].flags & (PAL_WIRE_TOOL_AWAY | PAL_WIRE_TOOL_STALE));
}

static const pal_wire_playback *playback(const mem_client *c)
{
    static const pal_wire_playback none;
    const pal_wire_status *status = &c->last[PAL_CONTROL_STATUS].status;
    return c->n_text[PAL_CONTROL_STATUS] && status->n_playback ? &status->playback[0] : &none;
}

static void it_plays_to_its_end_through_changes(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    CHECK_INT(a.last[PAL_CONTROL_HELLO].hello.n_mark, 5);
    for (int k = 0; k < 60; k++) served_turn(FRAME_NS, &a, &b);
    CHECK(playback(&a)->plays && playback(&a)->time_s == 0); /* until somebody lets it play */
    send(&a, "resume", "");
    for (int k = 0; k < 80; k++) served_turn(FRAME_NS, &a, &b);
    /* before the first change: exactly what was recorded */
    pal_playing playing;
    pal_session_playing(first, &playing);
    CHECK_INT(playing.state, PAL_PLAYS);
    CHECK(playing.step >= 78 && playing.n_hash >= 1);
    CHECK_INT(playing.n_hash_equal, playing.n_hash);
    CHECK(is_there(&b, 0) && is_there(&b, 1)); /* the recorded ones, which are nobody's */
    CHECK(b.tools.tool[0].flags & PAL_WIRE_TOOL_HELD);
    CHECK_INT(b.tools.tool[0].holder, 0);
    CHECK_INT(b.tools.tool[0].colour, PAL_RECORDED_COLOUR);
    CHECK_INT(a.n_haptic + b.n_haptic, 0); /* nobody feels them */
    WAIT_UNTIL(a.n_text[PAL_CONTROL_TOPOLOGY] == 4 && a.frame.epoch == a.epoch, &a, &b);
    for (int k = 0; k < 120; k++) served_turn(FRAME_NS, &a, &b);
    CHECK(playback(&a)->ended && playback(&b)->ended);
    CHECK_NEAR(playback(&a)->time_s, pal_recording_length_s(recording), 1e-9);
    CHECK_NEAR(playback(&a)->length_s, pal_recording_length_s(recording), 1e-9);
    CHECK_INT(a.n_text[PAL_CONTROL_TOPOLOGY], 4);
    CHECK_INT(a.n_bad + b.n_bad, 0);
    CHECK_INT(a.n_text[PAL_CONTROL_ERROR] + b.n_text[PAL_CONTROL_ERROR], 0);
    finish(&a, &b);
}

static void who_watches_changes_nothing(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK(!order(&a, "material", "\"young_Pa\":500"));
    CHECK_TEXT(a.last[PAL_CONTROL_ERROR].error.code, "recording");
    CHECK(!order(&a, "reset", ""));
    CHECK(!order(&a, "extrude", TOP ",\"distance_m\":0.03"));
    CHECK(!order(&b, "seek", "\"time_s\":1"));
    CHECK_TEXT(b.last[PAL_CONTROL_ERROR].error.code, "role");
    CHECK(!order(&a, "speed", "\"factor\":0"));
    CHECK(!order(&a, "speed", "\"factor\":11"));
    send(&a, "resume", "");
    for (uint32_t k = 1; k <= 80; k++) {
        mem_pose(&a, 0, k, (const double[3]){0, 0, -0.02}); /* deep in the body */
        served_turn(FRAME_NS, &a, &b);
    }
    pal_playing playing;
    pal_session_playing(first, &playing);
    CHECK(playing.n_hash >= 1);
    CHECK_INT(playing.n_hash_equal, playing.n_hash);
    finish(&a, &b);
}

static void it_plays_as_fast_as_wanted(void)
{
    mem_client a;
    pal_playing playing;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    send(&a, "resume", "");
    send(&a, "speed", "\"factor\":0.25");
    served_turn(FRAME_NS, &a, NULL);
    pal_session_playing(first, &playing);
    const uint64_t before = playing.step;
    for (int k = 0; k < 80; k++) served_turn(FRAME_NS, &a, NULL);
    pal_session_playing(first, &playing);
    const double expected = 0.25 * 80 * 1e-9 * FRAME_NS / clay.scene.step_s;
    CHECK(fabs((double)(playing.step - before) - expected) <= 2);
    CHECK_NEAR(playing.speed, 0.25, 0);
    finish(&a, NULL);
}

/* what if: live from a moment of the recording, recorded, and back */
static void it_becomes_live(void)
{
    mem_client a, b;
    pal_diagnostic diag = {""};
    pal_replay_report report;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    int n;
    char args[64];
    const double wanted_s = pal_recording_marks(recording, &n)[0].time_s + 0.3; /* behind the first edit */
    const double time_s = pal_recording_time_s(recording, pal_recording_step(recording, wanted_s));
    snprintf(args, sizeof args, "\"time_s\":%.6f", wanted_s);
    if (!order(&a, "seek", args)) CHECK_FAIL("%s", trouble(&a));
    CHECK_NEAR(reported(&a, "time_s"), time_s, 1e-9);
    until_frame(&a);
    CHECK(fabs(1e-6 * (double)a.tools.sim_time_us - time_s) < 1e-3);
    if (!order(&a, "branch", "")) CHECK_FAIL("%s", trouble(&a));
    until_frame(&a);
    send(&a, "resume", "");
    play(&a, &b, 60);
    WAIT_UNTIL(!playback(&a)->plays, &a, &b);
    CHECK_NEAR(playback(&a)->time_s, time_s, 1e-9);
    CHECK(is_there(&a, 0) && is_there(&a, 1)); /* theirs */
    CHECK(!order(&a, "branch", ""));
    if (!order(&a, "undo", "")) CHECK_FAIL("%s", trouble(&a)); /* of the edit in the recording */
    until_frame(&a);
    play(&a, &b, 60);
    if (!order(&a, "seek", "\"time_s\":0.5")) CHECK_FAIL("%s", trouble(&a));
    until_frame(&a);
    WAIT_UNTIL(playback(&a)->plays, &a, &b);
    finish(&a, &b);
    if (pal_replay_run(branch_path, &clay.scene, NULL, &report, &diag)) CHECK_FAIL("%s", diag.text);
    CHECK_INT(report.n_hash_equal, report.n_hash);
    CHECK_LE(2, report.n_hash);
    CHECK_INT(report.n_change, 2);
    unlink(branch_path);
}

/* processor time between two readings of the clock, whatever the machine does: quick steps */
static _Atomic uint64_t feigned_ns = 1000;
uint64_t __wrap_pal_clock_thread_ns(void);
uint64_t __wrap_pal_clock_thread_ns(void)
{
    static _Atomic uint64_t now_ns;
    return now_ns += feigned_ns;
}

/* where steps are slow, states are dense, so that a seek takes no longer: 50 ms or more each make one in twenty steps
 * or fewer */
static void slow_steps_have_more_states(void)
{
    pal_diagnostic diag = {""};
    pal_recording *slow = NULL;
    mem_client a;
    char slow_path[80];
    snprintf(slow_path, sizeof slow_path, "%s.slow", path);
    served_begin(&clay.scene, (pal_session_options){.record_path = slow_path}, (pal_server_options){0});
    feigned_ns = PAL_STATE_WORK_NS / 20;
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    for (int k = 0; k < 120; k++) served_turn(FRAME_NS, &a, NULL);
    mem_end(&a);
    end();
    feigned_ns = 1000;
    REQUIRE(!pal_recording_open(slow_path, &clay.scene, &diag, &slow));
    const uint64_t n_step = pal_recording_step(slow, 1e9);
    CHECK(n_step >= 120);
    CHECK_LE(n_step / 20, pal_recording_states(slow));
    /* of the quick steps: at the beginning, after each change, at the end, and each PAL_STATE_S, of which a slow job
     * lets some go by */
    const double quick_s = (double)pal_recording_step(recording, 1e9) * clay.scene.step_s;
    CHECK_LE(6, pal_recording_states(recording));
    CHECK_LE(pal_recording_states(recording), 6 + (uint64_t)(quick_s / PAL_STATE_S));
    pal_recording_close(slow);
    unlink(slow_path);
}

static void only_a_recording_of_the_scene(void)
{
    pal_diagnostic diag = {""};
    pal_recording *other = NULL;
    pal_scene scene = clay.scene;
    scene.step_s *= 2;
    CHECK_INT(pal_recording_open(path, &scene, &diag, &other), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "another scene"));
    CHECK_INT(pal_recording_open("/nowhere/run.log", &clay.scene, &diag, &other), PAL_ERR_IO);
    CHECK(!other);
    mem_client a;
    served_begin(&clay.scene, (pal_session_options){0}, (pal_server_options){0});
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    CHECK(!order(&a, "seek", "\"time_s\":1"));
    CHECK(!order(&a, "branch", ""));
    CHECK(!order(&a, "speed", "\"factor\":2"));
    CHECK(strstr(trouble(&a), "--replay"));
    mem_end(&a);
    end();
}

int main(void)
{
    pal_diagnostic diag = {""};
    const int fd = mkstemp(path);
    if (fd < 0 || close(fd)) return 1;
    snprintf(branch_path, sizeof branch_path, "%s.branch", path);
    clay_make(&clay, 2, 0.1);
    RUN(record);
    if (pal_recording_open(path, &clay.scene, &diag, &recording)) CHECK_FAIL("%s", diag.text);
    RUN(its_marks_and_times);
    RUN(a_seek_shows_what_was);
    RUN(it_plays_to_its_end_through_changes);
    RUN(who_watches_changes_nothing);
    RUN(it_plays_as_fast_as_wanted);
    RUN(it_becomes_live);
    RUN(slow_steps_have_more_states);
    RUN(only_a_recording_of_the_scene);
    pal_recording_close(recording);
    clay_free(&clay);
    unlink(path);
    return check_report();
}
