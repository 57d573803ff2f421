/* `palpate replay`: runs an input log against its scene and compares the state hashes. */
#include "server/base/clock.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/scene_input.h"
#include "server/commands/vtu_series.h"
#include "server/session/replay.h"

#include <stdio.h>

static cJSON *as_json(const pal_replay_report *r, double seconds)
{
    char hash[24];
    bool equal = r->n_hash == r->n_hash_equal;
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)r->last_hash);
    return PAL_JSON({"ok", JSON_BOOL(equal)}, {"steps", JSON_NUMBER(r->n_tick)}, {"poses", JSON_NUMBER(r->n_pose)},
                    {"commands", JSON_NUMBER(r->n_command)}, {"changes", JSON_NUMBER(r->n_change)},
                    {"hashes", JSON_NUMBER(r->n_hash)}, {"hashes_equal", JSON_NUMBER(r->n_hash_equal)},
                    {"first_difference", equal ? cJSON_CreateNull() : JSON_NUMBER(r->first_difference)},
                    {"last_hash", JSON_TEXT(hash)}, {"cut", r->cut[0] ? JSON_TEXT(r->cut) : cJSON_CreateNull()},
                    {"seconds", JSON_NUMBER(seconds)});
}

typedef struct replay_run {
    pal_flag_common common;
    pal_vtu_series series; /* folder NULL: none is asked for */
    pal_err series_err;
    pal_diagnostic series_diag;
} replay_run;

static bool show(void *user, const pal_world *world, double fraction)
{
    replay_run *run = user;
    pal_report_progress("replay", fraction, &run->common);
    if (run->series.folder) run->series_err = pal_vtu_series_step(&run->series, world, &run->series_diag);
    return !run->series_err;
}

int command_replay(int argc, char **argv)
{
    bool strict = false;
    double rate_hz = 25;
    replay_run run = {.series_err = PAL_ERR_OK};
    const pal_flag flag[] = {
        {"--strict", NULL, PAL_FLAG_SWITCH, &strict, 0, 0, "refuse a log that is cut or damaged"},
        {"--vtu", "FOLDER", PAL_FLAG_TEXT, &run.series.folder, 0, 0,
         "write the deformed elements with their fields for ParaView, which opens FOLDER/series.pvd"},
        {"--rate", "HZ", PAL_FLAG_NUMBER, &rate_hz, 0.01, 1000, "moments of --vtu in a simulated second (25)"},
    };
    const pal_flag_table table = {
        .usage = "replay LOG SCENE [flags]",
        .about =
            "Runs an input log (palpate serve --record LOG) again and compares the hash of the state after each step.\n"
            "SCENE is the scene that was served. A log that was cut by a crash is replayed up to its last whole\n"
            "record. Exit code 1 when a hash differs.\n",
        PAL_FLAGS(flag),
        .example = "palpate prepare --procedural -o organ\n"
                   "palpate serve organ/scene.json --record organ.log --port 0 --seconds 2\n"
                   "palpate replay organ.log organ/scene.json --vtu organ_vtu\n",
        .operands = {2, 2}};
    const char *word[2];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &run.common, word, &n);

    if (code >= 0) return code;
    pal_scene_input input = {0};
    pal_diagnostic diag = {""};
    pal_replay_report report;
    double start = pal_clock_s();
    run.series.period_s = 1 / rate_hz;
    const pal_replay_watch watch = {.step = show, .user = &run};
    pal_err err = pal_scene_input_open(word[1], &input, &diag);
    if (!err && strict) err = pal_replay_run(word[0], NULL, NULL, &report, &diag);
    if (!err && strict && report.cut[0]) err = PAL_REFUSE(&diag, "%s", report.cut);
    if (!err) err = pal_replay_run(word[0], input.studied.scene, &watch, &report, &diag);
    if (run.series_err) err = run.series_err, diag = run.series_diag;
    if (!err && run.series.folder) err = pal_vtu_series_end(&run.series, &diag);
    pal_vtu_series_free(&run.series);
    pal_report_progress(NULL, 0, &run.common);
    pal_scene_input_close(&input);
    if (err) return pal_report_refusal(&run.common, err, &diag);
    if (report.cut[0]) fprintf(stderr, "palpate replay: %s; replayed up to there\n", report.cut);
    bool equal = report.n_hash == report.n_hash_equal;
    if (!equal)
        fprintf(stderr, "palpate replay: %s: the world differs from step %llu on: %llu of %llu hashes are equal\n",
                word[0], (unsigned long long)report.first_difference, (unsigned long long)report.n_hash_equal,
                (unsigned long long)report.n_hash);
    if (run.common.json && (code = pal_report_json(&run.common, as_json(&report, pal_clock_s() - start))) > 0)
        return code;
    if (equal && !run.common.json && !run.common.quiet)
        printf("%llu steps, %llu poses, %llu commands: all %llu hashes equal, the last is %016llx\n",
               (unsigned long long)report.n_tick, (unsigned long long)report.n_pose,
               (unsigned long long)report.n_command, (unsigned long long)report.n_hash,
               (unsigned long long)report.last_hash);
    if (run.series.folder && !run.common.json && !run.common.quiet)
        printf("wrote %d moments, %s/series.pvd\n", run.series.n_moment, run.series.folder);
    return equal ? 0 : 1;
}
