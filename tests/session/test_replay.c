/* Input logs: what a live session recorded gives the same hashes again, of a log that was cut or damaged up to the last
 * whole record; one that is foreign or lost records is refused with one sentence. A file is never written over. */
#include "server/session/input_log.h"
#include "server/session/replay.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/session/session_scene.h"
#include "tests/session/stepped_session.h"

#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <sys/resource.h>
#include <sys/stat.h>

static pal_scene scene;
static pal_prepared mesh;
static char path[] = "/tmp/palpate_replay_XXXXXX";
static uint8_t whole[1 << 20]; /* the log of the live session */
static size_t n_whole;
enum { STEPS = 300 };

static size_t slurp(const char *name, uint8_t *bytes, size_t cap)
{
    FILE *file = fopen(name, "rb");
    size_t n = file ? fread(bytes, 1, cap, file) : 0;
    if (file) fclose(file);
    return n;
}

/* 300 steps with presses, grasps, some of which move on before the step that takes their beginning, a material edit,
 * resets, a tool that falls silent, brushes: one of a tool that is let go without ever having been there, one of the
 * tool that falls silent, one that ends by itself */
static bool record(void)
{
    const pal_brush blow = {.kind = PAL_BRUSH_INFLATE, .at_m = {0, 0, 0.05}, .radius_m = 0.03, .pressure_Pa = 400};
    const pal_brush lift = {.kind = PAL_BRUSH_CURVE,
                            .at_m = {-0.02, 0, 0.045},
                            .to_m = {0.02, 0, 0.045},
                            .radius_m = 0.02,
                            .softness = 0.5,
                            .lift_m = {0, 0, 0.005},
                            .stiffness_N_m = 20};
    const struct {
        int step;
        pal_command command;
    } order[] = {{20, {.kind = PAL_COMMAND_RESET_BODY, .body = 0}},
                 {40, {.kind = PAL_COMMAND_MATERIAL, .material = {3000, 0.4, 900, 2}}},
                 {70, {.kind = PAL_COMMAND_RESET}},
                 {82, {.kind = PAL_COMMAND_BRUSH, .slot = 1, .brush = blow}},
                 {90, {.kind = PAL_COMMAND_BRUSH, .slot = 0, .brush = lift}},
                 {100, {.kind = PAL_COMMAND_COMPONENT, .component = "gravity"}},
                 {120, {.kind = PAL_COMMAND_COMPONENT, .component = "gravity", .wanted = true}},
                 {130, {.kind = PAL_COMMAND_BRUSH, .slot = 1, .brush = lift}},
                 {140, {.kind = PAL_COMMAND_BRUSH, .slot = 1}}};
    pal_session *s = stepped_open(&scene, (pal_session_options){.record_path = path, .lease_s = 0.1});
    if (!s) return false;
    for (int step = 1; step <= STEPS; step++) {
        pal_pose pose = {.position_m = {0.001 * (step % 40), 0, 0.055 - 0.0005 * (step % 30)},
                         .quat = {1, 0, 0, 0},
                         .buttons = step % 50 > 20,
                         .seq = (uint32_t)step};
        if (step % 60 < 38)
            CHECK(!pal_session_request_pose(s, 0, &pose)); /* 22 steps of silence: longer than the lease */
        pose.position_m[1] += 0.004;
        if (step % 60 < 38 && step % 50 == 21) CHECK(!pal_session_request_pose(s, 0, &pose));
        if (step == 96) CHECK(!pal_session_request_pose(s, 1, NULL));
        for (size_t k = 0; k < sizeof order / sizeof *order; k++)
            if (order[k].step == step) CHECK(!pal_session_command(s, &order[k].command));
        stepped_steps(s, 1);
    }
    pal_session_close(s);
    return true;
}

static void a_recorded_session_gives_the_same_hashes_again(void)
{
    pal_replay_report report;
    pal_diagnostic diag = {""};
    REQUIRE(record());
    n_whole = slurp(path, whole, sizeof whole);
    REQUIRE(n_whole > 1000 && n_whole < sizeof whole);
    pal_err err = pal_replay_run(path, &scene, NULL, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    CHECK_INT(report.n_tick, STEPS);
    CHECK_INT(report.n_pose, 5 * 38);
    CHECK_INT(report.n_command, 9);
    CHECK_INT(report.n_hash, STEPS / PAL_INPUT_HASH_STEPS + 1); /* one at the end */
    CHECK_INT(report.n_hash_equal, report.n_hash);
    CHECK(report.first_difference == UINT64_MAX);
    CHECK(report.last_hash != 0);
}

/* the pose that the step took, and not the newest one before it */
static void the_log_has_the_poses_that_steps_took(void)
{
    size_t at = 0;
    int n = 0;
    pal_input_header header;
    pal_input_record record_;
    REQUIRE(!pal_input_get_header("log", whole, n_whole, &header, &at, NULL));
    while (!pal_input_get_record("log", whole, n_whole, &at, &record_, NULL) && record_.kind != PAL_INPUT_END) {
        if (record_.kind != PAL_INPUT_POSE || record_.index != 0) continue;
        CHECK_INT(record_.pose.seq, record_.step + 1);
        CHECK_NEAR(record_.pose.position_m[1], 0, 0);
        n++;
    }
    CHECK_INT(n, 5 * 38);
}

/* gives a record of n bytes the CRC that it should have */
static void seal(uint8_t *record_, size_t n)
{
    const uint32_t crc = pal_input_crc(record_, n);
    memcpy(record_ + 4, &crc, sizeof crc);
}

/* changes one byte of the payload of every record of a kind; the step of the first one, 0: there is none */
static uint64_t change(uint8_t *bytes, pal_input_kind kind, size_t byte)
{
    size_t at = 0;
    uint64_t first = 0;
    pal_input_header header;
    pal_input_record record_;
    if (pal_input_get_header("log", bytes, n_whole, &header, &at, NULL)) return 0;
    for (size_t place = at; !pal_input_get_record("log", bytes, n_whole, &at, &record_, NULL); place = at) {
        if (record_.kind != kind) continue;
        bytes[place + PAL_INPUT_HEAD + byte] ^= 4;
        seal(bytes + place, at - place);
        if (!first) first = record_.step;
    }
    return first;
}

static void changed_poses_and_materials_are_found_at_the_next_hash(void)
{
    static uint8_t bytes[sizeof whole];
    const struct {
        pal_input_kind kind;
        size_t byte;
    } what[] = {{PAL_INPUT_POSE, 2 * 8 + 6}, {PAL_INPUT_MATERIAL, 0}, {PAL_INPUT_BRUSH, 8 + 8 * 8 + 6}};
    REQUIRE(n_whole > 0);
    for (int k = 0; k < 3; k++) {
        pal_replay_report report;
        pal_diagnostic diag = {""};
        memcpy(bytes, whole, n_whole);
        uint64_t when = change(bytes, what[k].kind, what[k].byte);
        REQUIRE(when > 0);
        REQUIRE(!pal_replay_parse("log", bytes, n_whole, &scene, NULL, &report, &diag));
        CHECK(report.n_hash_equal < report.n_hash);
        CHECK(report.first_difference > when);
        if (k == 1) CHECK_LE((double)report.first_difference, (double)when + PAL_INPUT_HASH_STEPS);
    }
}

static void every_cut_is_told_with_its_byte_and_the_rest_is_replayed(void)
{
    pal_replay_report report;
    pal_diagnostic diag;
    uint64_t last = 0;
    REQUIRE(n_whole > 0);
    CHECK_INT(pal_replay_parse("log", whole, n_whole, NULL, NULL, &report, &diag), 0);
    CHECK_TEXT(report.cut, "");
    for (size_t n = 0; n < n_whole; n += n < 300 ? 1 : 977) {
        diag.text[0] = 0;
        const pal_err err = pal_replay_parse("log", whole, n, NULL, NULL, &report, &diag);
        CHECK_INT(err, n < PAL_INPUT_HEADER ? PAL_ERR_REFUSED : PAL_ERR_OK);
        CHECK(!strncmp(err ? diag.text : report.cut, "log: byte ", 10));
    }
    for (size_t n = PAL_INPUT_HEADER; n < n_whole; n += n_whole / 7) {
        REQUIRE(!pal_replay_parse("log", whole, n, &scene, NULL, &report, &diag));
        CHECK_INT(report.n_hash_equal, report.n_hash);
        CHECK(report.n_tick >= last && report.n_tick <= STEPS);
        last = report.n_tick;
    }
    CHECK(last >= STEPS / 2);
}

/* any changed bit of a record is found, and what was before it is replayed */
static void a_damaged_record_ends_the_log(void)
{
    static uint8_t bytes[sizeof whole];
    uint64_t seed = 3;
    REQUIRE(n_whole > 0);
    for (int k = 0; k < 400; k++) {
        pal_replay_report report;
        pal_diagnostic diag = {""};
        unsigned long long at = 0;
        const size_t place = PAL_INPUT_HEADER + (size_t)random_below(&seed, n_whole - PAL_INPUT_HEADER);
        memcpy(bytes, whole, n_whole);
        bytes[place] ^= (uint8_t)(1u << random_below(&seed, 8));
        REQUIRE(!pal_replay_parse("log", bytes, n_whole, NULL, NULL, &report, &diag));
        CHECK_INT(sscanf(report.cut, "log: byte %llu", &at), 1);
        pal_input_record record_;
        size_t end = (size_t)at;
        CHECK(at <= place && !pal_input_get_record("log", whole, n_whole, &end, &record_, NULL) && place < end);
    }
}

static void refused(const uint8_t *bytes, size_t n, const char *part)
{
    pal_replay_report report;
    pal_diagnostic diag = {""};
    CHECK_INT(pal_replay_parse("log", bytes, n, &scene, NULL, &report, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, part)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, part);
}

static void broken_logs_are_refused_with_one_sentence(void)
{
    static uint8_t bytes[sizeof whole];
    REQUIRE(n_whole > 0);
    const struct {
        size_t place;
        uint8_t value;
        const char *part;
    } fault[] = {{0, 'x', "not an input log"},           {8, 4, "version 4"},
                 {13, 0xff, "steps between hashes"},     {24, (uint8_t)(whole[24] ^ 1), "another scene"},
                 {PAL_INPUT_HEADER + 1, 5, "no tool 5"}, {PAL_INPUT_HEADER + 20, 9, "does not follow"}};
    size_t first_end = 0;
    pal_input_header header;
    pal_input_record first;
    REQUIRE(!pal_input_get_header("log", whole, n_whole, &header, &first_end, NULL));
    REQUIRE(!pal_input_get_record("log", whole, n_whole, &first_end, &first, NULL));
    for (size_t k = 0; k < sizeof fault / sizeof fault[0]; k++) {
        memcpy(bytes, whole, n_whole);
        bytes[fault[k].place] = fault[k].value;
        seal(bytes + PAL_INPUT_HEADER, first_end - PAL_INPUT_HEADER);
        refused(bytes, n_whole, fault[k].part);
    }
    memcpy(bytes, whole, n_whole);
    bytes[n_whole - 1] = 1;
    seal(bytes + n_whole - PAL_INPUT_HEAD - 16, PAL_INPUT_HEAD + 16);
    refused(bytes, n_whole, "records were lost");
    memcpy(bytes, whole, n_whole);
    refused(bytes, n_whole + 1, "1 bytes after the end");
    refused(whole, 0, "not an input log");
}

static void a_log_of_another_material_is_refused_and_texts_do_not_matter(void)
{
    pal_replay_report report;
    pal_diagnostic diag = {""};
    pal_scene other = scene;
    REQUIRE(n_whole > 0);
    snprintf(other.title, sizeof other.title, "another title");
    CHECK_INT(pal_replay_parse("log", whole, n_whole, &other, NULL, &report, &diag), 0);
    other.body[0].material.young_Pa = nextafter(5000, 6000);
    CHECK_INT(pal_replay_parse("log", whole, n_whole, &other, NULL, &report, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "another scene") != NULL);
    CHECK_INT(pal_replay_run("/no/such/log", &scene, NULL, &report, &diag), PAL_ERR_IO);
}

/* far more than a ring of 1 KiB holds before the writer comes round */
static void what_does_not_fit_is_counted_and_makes_the_log_invalid(void)
{
    pal_input_log *log = NULL;
    pal_diagnostic diag = {""};
    pal_replay_report report;
    char name[] = "/tmp/palpate_small_XXXXXX";
    int file = mkstemp(name);
    REQUIRE(file >= 0);
    close(file);
    unlink(name);
    REQUIRE(!pal_input_log_open(name, &scene, 1024, &diag, &log));
    for (int k = 0; k < 20000; k++)
        pal_input_log_put(log, &(pal_input_record){.kind = PAL_INPUT_POSE, .pose = {.quat = {1, 0, 0, 0}}});
    uint64_t n = pal_input_log_dropped(log);
    CHECK(n > 0);
    CHECK_INT(pal_input_log_close(log, 0, 7), 0);
    CHECK_INT(pal_replay_run(name, &scene, NULL, &report, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "records were lost") != NULL);
    unlink(name);
}

static void a_full_disk_is_told_at_close(void)
{
    pal_input_log *log = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_input_log_open("/dev/full", &scene, 1024, &diag, &log);
    /* the header is written at once, so that a place that cannot be written is refused before the session starts */
    CHECK_INT(err, PAL_ERR_IO);
    CHECK(strstr(diag.text, "/dev/full") != NULL);
}

static void a_file_is_never_written_over(void)
{
    static const char *const names[] = {"run.log", "run.2.log", "run.3.log"};
    char folder[] = "/tmp/palpate_record_XXXXXX", first[64], name[64], kept[8] = {0};
    pal_diagnostic diag = {""};
    REQUIRE(mkdtemp(folder) != NULL);
    snprintf(first, sizeof first, "%s/%s", folder, names[0]);
    FILE *old = fopen(first, "w");
    REQUIRE(old != NULL);
    fputs("old", old), fclose(old);
    for (int k = 1; k < 3; k++) {
        pal_input_log *log = NULL;
        REQUIRE(!pal_input_log_open(first, &scene, 0, &diag, &log));
        snprintf(name, sizeof name, "%s/%s", folder, names[k]);
        CHECK_TEXT(pal_input_log_path(log), name);
        CHECK_INT(pal_input_log_close(log, 0, 0), 0);
    }
    CHECK_INT(slurp(first, (uint8_t *)kept, sizeof kept), 3);
    CHECK_TEXT(kept, "old");
    for (int k = 0; k < 3; k++) snprintf(name, sizeof name, "%s/%s", folder, names[k]), unlink(name);
    rmdir(folder);
}

/* of the first state in the log of the live session, which stands after its first step */
static rlim_t state_bytes(void)
{
    pal_input_header header;
    pal_input_record record_;
    size_t at = 0;
    if (pal_input_get_header("log", whole, n_whole, &header, &at, NULL)) return 0;
    for (size_t begin = at; !pal_input_get_record("log", whole, n_whole, &at, &record_, NULL); begin = at)
        if (record_.kind == PAL_INPUT_STATE) return at - begin;
    return 0;
}

/* a limit of the file's size, as a disk that fills up: the error is known before the end, and what was written is good
 */
static void a_disk_that_fills_up_is_told_while_it_records(void)
{
    struct rlimit before, small;
    REQUIRE(!getrlimit(RLIMIT_FSIZE, &before));
    small = before, small.rlim_cur = 4000 + state_bytes();
    signal(SIGXFSZ, SIG_IGN);
    unlink(path);
    REQUIRE(!setrlimit(RLIMIT_FSIZE, &small));
    pal_session *s = stepped_open(&scene, (pal_session_options){.record_path = path, .lease_s = 0.1});
    for (int step = 1; s && step <= STEPS; step++) {
        const pal_pose pose = {.position_m = {0, 0, 0.055}, .quat = {1, 0, 0, 0}, .seq = (uint32_t)step};
        CHECK(!pal_session_request_pose(s, 0, &pose));
        stepped_steps(s, 1);
    }
    /* the writer comes round every PAL_LOG_FLUSH_NS of real time */
    while (s && !pal_session_record_error(s)) sched_yield();
    CHECK_INT(s ? pal_session_record_error(s) : 0, EFBIG);
    pal_session_close(s);
    setrlimit(RLIMIT_FSIZE, &before);
    pal_replay_report report;
    pal_diagnostic diag = {""};
    REQUIRE(!pal_replay_run(path, &scene, NULL, &report, &diag));
    CHECK(report.n_tick > 10 && report.n_pose > 10);
    CHECK(strstr(report.cut, "the log is cut") != NULL);
    unlink(path);
}

static void records_survive_the_round_trip_bit_by_bit(void)
{
    pal_input_log *log = NULL;
    pal_diagnostic diag = {""};
    static uint8_t bytes[4096];
    unlink(path);
    REQUIRE(!pal_input_log_open(path, &scene, 0, &diag, &log));
    const pal_input_record in[] = {
        {.kind = PAL_INPUT_POSE,
         .index = 1,
         .step = 1ull << 40,
         .pose = {{0.1, -0.0, 5e-324}, {0.5, 0.5, -0.5, 0.5}, {1e300, -1, 3}, 0xdeadbeef, 77, 0}},
        {.kind = PAL_INPUT_RELEASE, .step = 1ull << 40},
        {.kind = PAL_INPUT_RESET, .step = 1ull << 41},
        {.kind = PAL_INPUT_MATERIAL, .step = 1ull << 41, .material = {1234.5, 0.3, 999, 0.25}},
        {.kind = PAL_INPUT_BRUSH,
         .index = 3,
         .step = 1ull << 42,
         .slot = 5,
         .brush = {PAL_BRUSH_CURVE, {1, 2, 3}, {4, 5, -0.0}, 0.1, 0.5, -7e200, {1e-300, 8, 9}, 10}},
        {.kind = PAL_INPUT_COMPONENT, .index = 2, .step = 1ull << 43, .wanted = true, .component = "tet_volume"},
        {.kind = PAL_INPUT_COMPONENT, .step = 1ull << 44, .component = "gravity"},
        {.kind = PAL_INPUT_HASH, .step = 1ull << 63, .hash = 0xfedcba9876543210u}};
    const int n_in = sizeof in / sizeof in[0];
    for (int k = 0; k < n_in; k++) pal_input_log_put(log, &in[k]);
    CHECK_INT(pal_input_log_close(log, 1ull << 63, 42), 0);
    size_t n = slurp(path, bytes, sizeof bytes), at = 0;
    pal_input_header header;
    pal_input_record out;
    REQUIRE(!pal_input_get_header("log", bytes, n, &header, &at, &diag));
    CHECK(header.fingerprint == pal_scene_fingerprint(&scene));
    CHECK_NEAR(header.step_s, scene.step_s, 0);
    for (int k = 0; k < n_in; k++) {
        REQUIRE(!pal_input_get_record("log", bytes, n, &at, &out, &diag));
        CHECK_INT(out.kind, in[k].kind);
        CHECK(out.index == in[k].index && out.step == in[k].step && out.hash == in[k].hash);
        CHECK(!memcmp(&out.pose, &in[k].pose, sizeof out.pose));
        CHECK(!memcmp(&out.material, &in[k].material, sizeof out.material));
        CHECK(out.wanted == in[k].wanted);
        CHECK_TEXT(out.component, in[k].component);
        CHECK(out.slot == in[k].slot && out.brush.kind == in[k].brush.kind);
        CHECK(!memcmp(out.brush.at_m, in[k].brush.at_m, sizeof(pal_brush) - offsetof(pal_brush, at_m)));
    }
    REQUIRE(!pal_input_get_record("log", bytes, n, &at, &out, &diag));
    CHECK(out.kind == PAL_INPUT_END && out.hash == 42 && out.n_dropped == 0 && at == n);
}

int main(void)
{
    int file = mkstemp(path);
    if (file < 0 || !small_scene(&scene, &mesh, CHECK_REPEATS(6, 4))) return 1;
    close(file);
    unlink(path);
    /* bodies with a skin have no brushes */
    pal_entry_init(&scene.body[0].output, "output", "surface_output");
    RUN(a_recorded_session_gives_the_same_hashes_again);
    RUN(the_log_has_the_poses_that_steps_took);
    RUN_SERIAL(changed_poses_and_materials_are_found_at_the_next_hash);
    RUN(every_cut_is_told_with_its_byte_and_the_rest_is_replayed);
    RUN(a_damaged_record_ends_the_log);
    RUN(a_file_is_never_written_over);
    RUN(a_disk_that_fills_up_is_told_while_it_records);
    RUN(broken_logs_are_refused_with_one_sentence);
    RUN_SERIAL(a_log_of_another_material_is_refused_and_texts_do_not_matter);
    RUN(what_does_not_fit_is_counted_and_makes_the_log_invalid);
    RUN(a_full_disk_is_told_at_close);
    RUN(records_survive_the_round_trip_bit_by_bit);
    unlink(path);
    pal_prepared_free(&mesh);
    return check_report();
}
