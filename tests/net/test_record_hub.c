/* A recording goes on through what its members do to the scene: edits of cells, paint, cuts, undo, another rest shape,
 * switches of configuration, components and materials. A replay makes the same worlds from it, with the same hashes. */
#include "server/session/replay.h"
#include "server/session/resume.h"
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

#include <unistd.h>

#define TOP "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05"

static clay_scene clay;
static pal_measured_configuration point[3];
static char path[] = "/tmp/palpate_record_XXXXXX";

static void begin(void)
{
    static pal_session_study study;
    study = (pal_session_study){.configuration = point, .n = 3, .reference_m = NAN};
    unlink(path);
    served_begin(&clay.scene, (pal_session_options){.record_path = path}, (pal_server_options){.study = &study});
}

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

static void replays_equal(int n_change)
{
    pal_replay_report report;
    pal_diagnostic diag = {""};
    pal_err err = pal_replay_run(path, &clay.scene, NULL, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    if (err) return;
    CHECK_TEXT(report.cut, "");
    CHECK_INT(report.n_change, n_change);
    CHECK(report.n_hash > 5);
    CHECK_INT(report.n_hash_equal, report.n_hash);
    if (report.first_difference != UINT64_MAX)
        printf("  differs from step %llu of %llu on\n", (unsigned long long)report.first_difference,
               (unsigned long long)report.n_tick);
}

static void through_edits(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    play(&a, &b, 60);
    CHECK(order(&a, "extrude", TOP ",\"distance_m\":0.03"));
    until_frame(&a);
    play(&a, &b, 60);
    send(&b, "material", "\"young_Pa\":9000");
    if (!order(&b, "paint",
               "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.08"
               ",\"radius_m\":0.03,\"young_factor\":3"))
        CHECK_FAIL("%s", trouble(&b));
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&b, "undo", ""));
    until_frame(&a);
    play(&a, &b, 30);
    CHECK(order(&a, "set_rest_shape", ""));
    until_frame(&a);
    play(&a, &b, 30);
    CHECK(order(&a, "cut", "\"nx\":1,\"ny\":0,\"nz\":0,\"offset_m\":0.03"));
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "sharpen",
                "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.08"
                ",\"sharpness\":1,\"entity\":1"));
    until_frame(&a);
    play(&a, &b, 60);
    mem_end(&a), mem_end(&b);
    end();
    replays_equal(6);
}

static size_t slurp(const char *name, uint8_t *bytes, size_t cap)
{
    FILE *file = fopen(name, "rb");
    size_t n = file ? fread(bytes, 1, cap, file) : 0;
    if (file) fclose(file);
    return n;
}

/* a pose that names no haptic model is of a hand that feels nothing */
static void names_tools_without_haptics(int tool_without)
{
    static uint8_t bytes[1 << 20];
    const size_t n = slurp(path, bytes, sizeof bytes);
    size_t at = 0;
    int n_pose[2] = {0, 0};
    pal_input_header header;
    pal_input_record r;
    REQUIRE(!pal_input_get_header("log", bytes, n, &header, &at, NULL));
    while (!pal_input_get_record("log", bytes, n, &at, &r, NULL)) {
        if (r.kind != PAL_INPUT_POSE) continue;
        n_pose[r.index]++;
        CHECK_INT(r.pose.buttons, r.index == tool_without ? PAL_POSE_NO_HAPTICS : 0);
    }
    CHECK(n_pose[0] > 100 && n_pose[1] > 100);
}

static void through_switches(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    b.model_seq = 1;
    play(&a, &b, 60);
    CHECK(order(&a, "study_point", "\"index\":1"));
    until_frame(&a);
    play(&a, &b, 60);
    send(&a, "material", "\"young_Pa\":7000");
    play(&a, &b, 30);
    CHECK(order(&a, "configure", "\"size\":10,\"tolerance\":0.001"));
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "study_point", "\"index\":2"));
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "divide", TOP)); /* an edit of what a switch has brought back */
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "configure", "\"step_ms\":20"));
    until_frame(&a);
    play(&a, &b, 60);
    mem_end(&a), mem_end(&b);
    end();
    replays_equal(5);
    names_tools_without_haptics(0);
}

/* positions of body 0 when a replay has taken its last step */
typedef struct last_state {
    double x[3 * 4096], size_m;
    int n;
} last_state;
static void keep_state(void *user, const pal_world *world)
{
    last_state *to = user;
    const pal_body *body = pal_world_view_body(world, 0);
    to->n = body->n_dof < 4096 ? body->n_dof : 4096;
    to->size_m = body->length_scale_m;
    memcpy(to->x, body->x, 3 * sizeof(double) * (size_t)to->n);
}

static bool step_on(void *user, const pal_world *world, double fraction)
{
    (void)user, (void)world, (void)fraction;
    return true;
}

/* kill -9 at ten moments of the session that was recorded last, twenty of both: what goes on has the shape, the paint,
 * the material and the place that everything had when the last record reached the disk; grasps and friction begin anew,
 * hence 2 % of the body's size */
static void goes_on_after_a_kill_at_any_moment(void)
{
    static uint8_t bytes[1 << 22];
    static last_state exact, resumed;
    const size_t n = slurp(path, bytes, sizeof bytes);
    REQUIRE(n > 10000 && n < sizeof bytes);
    static uint32_t seed = 12345;
    for (int k = 0; k < 10; k++) {
        pal_diagnostic diag = {""};
        pal_replay_report report;
        pal_resume *resume = NULL;
        seed = seed * 1664525u + 1013904223u;
        const size_t cut = 2000 + (size_t)((double)seed / 4294967296.0 * (double)(n - 2000));
        FILE *file = fopen(path, "wb");
        fwrite(bytes, 1, cut, file);
        fclose(file);
        pal_err err =
            pal_replay_run(path, &clay.scene, &(pal_replay_watch){step_on, &exact, keep_state}, &report, &diag);
        if (!err) err = pal_resume_open(path, &clay.scene, &diag, &resume);
        if (err) CHECK_FAIL("cut at %zu: %s", cut, diag.text);
        if (err || !resume) continue;
        pal_world *world = pal_resume_take_world(resume);
        keep_state(&resumed, world);
        double farthest = 0;
        CHECK_INT(resumed.n, exact.n);
        for (int i = 0; i < 3 * exact.n; i++) farthest = fmax(farthest, fabs(resumed.x[i] - exact.x[i]));
        CHECK_LE(farthest, 0.02 * exact.size_m);
        pal_world_destroy(world);
        pal_resume_free(resume);
    }
}

/* a session that goes on is recorded, and its record replays equal from its beginning; edits can still be undone */
static void what_goes_on_is_recorded(void)
{
    pal_diagnostic diag = {""};
    pal_replay_report report;
    pal_resume *resume = NULL;
    mem_client a, b;
    char second[64];
    REQUIRE(!pal_resume_open(path, &clay.scene, &diag, &resume) && resume);
    served_session(pal_resume_scene(resume), (pal_session_options){.record_path = path, .resume = resume});
    served_open((pal_server_options){.resume = &resume});
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
    play(&a, &b, 60);
    CHECK(order(&a, "undo", "")); /* of an edit before the crash */
    until_frame(&a);
    play(&a, &b, 60);
    CHECK(order(&a, "configure", "\"step_ms\":15"));
    until_frame(&a);
    play(&a, &b, 60);
    mem_end(&a), mem_end(&b);
    end();
    pal_resume_free(resume);
    snprintf(second, sizeof second, "%s.2", path);
    pal_err err = pal_replay_run(second, &clay.scene, NULL, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    CHECK_INT(report.n_hash_equal, report.n_hash);
    CHECK_LE(3, report.n_hash);
    CHECK_TEXT(report.cut, "");
    unlink(second);
}

/* a component that was off when the server ended is off, and offered to be switched on */
static void what_is_off_can_be_switched_on_again(void)
{
    pal_diagnostic diag = {""};
    pal_resume *resume = NULL;
    mem_client a;
    const int n_effect = clay.scene.body[0].n_effect;
    pal_entry_init(&clay.scene.body[0].effect[clay.scene.body[0].n_effect++], "effects", "sleep");
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    mem_text(&a,
             "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"sleep\",\"args\":{\"part\":0,\"enabled\":0}}");
    const pal_wire_status *s = &a.last[PAL_CONTROL_STATUS].status;
    WAIT_UNTIL(s->n_disabled == 1, &a, NULL);
    mem_end(&a);
    end();
    REQUIRE(!pal_resume_open(path, &clay.scene, &diag, &resume) && resume);
    served_session(pal_resume_scene(resume), (pal_session_options){.resume = resume});
    served_open((pal_server_options){.resume = &resume});
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    WAIT_UNTIL(a.n_text[PAL_CONTROL_STATUS] > 0, &a, NULL);
    CHECK_INT(s->n_disabled, 1);
    CHECK_TEXT(s->disabled[0].component, "sleep");
    mem_text(&a,
             "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"sleep\",\"args\":{\"part\":0,\"enabled\":1}}");
    WAIT_UNTIL(s->n_disabled == 0, &a, NULL);
    mem_end(&a);
    end();
    pal_resume_free(resume);
    clay.scene.body[0].n_effect = n_effect;
}

int main(void)
{
    const int fd = mkstemp(path);
    if (fd < 0 || close(fd)) return 1;
    clay_make(&clay, 2, 0.1);
    order_point(&point[0], "subdivision_fem", "", 1);
    order_point(&point[1], "fem", "hex8_bbar", 8);
    order_point(&point[2], "subdivision_fem", "", 2);
    RUN(through_switches);
    RUN(goes_on_after_a_kill_at_any_moment);
    RUN(through_edits);
    RUN(what_goes_on_is_recorded);
    RUN(goes_on_after_a_kill_at_any_moment);
    RUN(what_is_off_can_be_switched_on_again);
    clay_free(&clay);
    unlink(path);
    return check_report();
}
