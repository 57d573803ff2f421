/* A recording goes on through what its members do to the scene: edits of cells, paint, cuts, undo, another rest shape,
 * switches of configuration, components and materials. A replay makes the same worlds from it, with the same hashes. */
#include "server/session/replay.h"
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

static void through_switches(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 1);
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
}

int main(void)
{
    const int fd = mkstemp(path);
    if (fd < 0 || close(fd)) return 1;
    clay_make(&clay, 2, 0.1);
    order_point(&point[0], "subdivision_fem", "", 1);
    order_point(&point[1], "fem", "hex8_bbar", 8);
    order_point(&point[2], "subdivision_fem", "", 2);
    RUN(through_edits);
    RUN(through_switches);
    clay_free(&clay);
    unlink(path);
    return check_report();
}
