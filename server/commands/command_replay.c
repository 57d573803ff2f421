/* `palpate replay`: runs an input log against its scene and compares the state hashes. */
#include "server/base/clock.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/scene_input.h"
#include "server/commands/shown_moment.h"
#include "server/commands/vtk_series.h"
#include "server/session/replay.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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

typedef struct arguments {
    bool strict;
    double rate_hz;
    const char *vtp; /* a file or a folder */
} arguments;

typedef struct replay_run {
    pal_flag_common common;
    pal_scene_input input;
    pal_vtk_series elements, surfaces; /* folder NULL: none is asked for */
    pal_shown_moment moment;
    uint64_t n_step; /* so far; a reset of the world does not set it back */
    pal_err write_err;
    pal_diagnostic write_diag;
} replay_run;

static double now_s(const replay_run *run)
{
    return (double)run->n_step * run->input.studied.scene->step_s;
}

static bool step(void *user, const pal_world *world, double fraction)
{
    replay_run *run = user;
    run->n_step++;
    pal_report_progress("replay", fraction, &run->common);
    if (run->elements.folder) run->write_err = pal_vtk_series_step(&run->elements, world, now_s(run), &run->write_diag);
    if (!run->write_err && run->surfaces.folder)
        run->write_err = pal_vtk_series_step(&run->surfaces, world, now_s(run), &run->write_diag);
    if (!run->write_err)
        run->write_err =
            pal_shown_moment_step(&run->moment, run->input.studied.scene, world, now_s(run), &run->write_diag);
    return !run->write_err;
}

static void end(void *user, const pal_world *world)
{
    replay_run *run = user;
    run->write_err = pal_shown_moment_end(&run->moment, run->input.studied.scene, world, now_s(run), &run->write_diag);
}

static pal_err replay(replay_run *run, const char *log, const char *scene, bool strict, pal_replay_report *report,
                      pal_diagnostic *diag)
{
    const pal_replay_watch watch = {.step = step, .user = run, .end = end};
    PAL_TRY(pal_scene_input_open(scene, &run->input, diag));
    run->surfaces.scene = run->input.studied.scene;
    if (strict) PAL_TRY(pal_replay_run(log, NULL, NULL, report, diag));
    if (strict && report->cut[0]) return PAL_REFUSE(diag, "%s", report->cut);
    pal_err err = pal_replay_run(log, run->input.studied.scene, &watch, report, diag);
    if (run->write_err) return *diag = run->write_diag, run->write_err;
    /* one folder gets its list although the other has nothing to list */
    if (!err && run->surfaces.folder) err = pal_vtk_series_end(&run->surfaces, diag);
    return !err && run->elements.folder ? pal_vtk_series_end(&run->elements, diag) : err;
}

static void print(const replay_run *run, const pal_replay_report *report)
{
    const pal_shown_moment *moment = &run->moment;
    if (report->n_hash == report->n_hash_equal)
        printf("%llu steps, %llu poses, %llu commands: all %llu hashes equal, the last is %016llx\n",
               (unsigned long long)report->n_tick, (unsigned long long)report->n_pose,
               (unsigned long long)report->n_command, (unsigned long long)report->n_hash,
               (unsigned long long)report->last_hash);
    if (run->elements.folder) printf("wrote %d moments, %s/series.pvd\n", run->elements.n_moment, run->elements.folder);
    if (run->surfaces.folder)
        printf("wrote %d moments, %s/surfaces.pvd\n", run->surfaces.n_moment, run->surfaces.folder);
    if (moment->glb) printf("wrote %s, the surfaces at %.9g s\n", moment->glb, moment->time_s);
    if (moment->vtp) printf("wrote %s, the surfaces at %.9g s\n", moment->vtp, moment->time_s);
}

/* the exit code, -1: go on */
static int parse(int argc, char **argv, arguments *args, replay_run *run, const char *word[2])
{
    int n = 0;
    const pal_flag flag[] = {
        {"--strict", NULL, PAL_FLAG_SWITCH, &args->strict, 0, 0, "refuse a log that is cut or damaged"},
        {"--vtu", "FOLDER", PAL_FLAG_TEXT, &run->elements.folder, 0, 0,
         "write the deformed elements with their fields for ParaView, which opens FOLDER/series.pvd"},
        {"--rate", "HZ", PAL_FLAG_NUMBER, &args->rate_hz, 0.01, 1000,
         "moments of --vtu and --vtp FOLDER in a simulated second (25)"},
        {"--gltf", "FILE.glb", PAL_FLAG_TEXT, &run->moment.glb, 0, 0,
         "write the surfaces at one moment as glTF: metres, y up, a material for each body and image"},
        {"--vtp", "PATH", PAL_FLAG_TEXT, &args->vtp, 0, 0,
         "write them for ParaView, in the frame of the scene, with their displacement: FILE.vtp, or all moments into a "
         "folder, FOLDER/surfaces.pvd"},
        {"--at", "SECONDS", PAL_FLAG_NUMBER, &run->moment.at_s, 0, 1e6,
         "the moment of --gltf and --vtp FILE.vtp, simulated time since the start of the log (its end)"},
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
                   "palpate replay organ.log organ/scene.json --vtu organ_vtu --gltf organ.glb --at 1\n",
        .operands = {2, 2}};
    const int code = pal_flags_parse(&table, argc, argv, &run->common, word, &n);
    if (code >= 0) return code;
    const size_t n_path = args->vtp ? strlen(args->vtp) : 0;
    if (n_path > 4 && !strcmp(args->vtp + n_path - 4, ".vtp"))
        run->moment.vtp = args->vtp;
    else
        run->surfaces.folder = args->vtp;
    if (isfinite(run->moment.at_s) && !run->moment.glb && !run->moment.vtp)
        return pal_flags_wrong(&run->common, "--at: goes with --gltf or --vtp FILE.vtp");
    run->elements.period_s = run->surfaces.period_s = 1 / args->rate_hz;
    return -1;
}

int command_replay(int argc, char **argv)
{
    arguments args = {.rate_hz = 25};
    replay_run run = {.moment.at_s = (double)NAN};
    const char *word[2];
    pal_diagnostic diag = {""};
    pal_replay_report report;
    int code = parse(argc, argv, &args, &run, word);
    if (code >= 0) return code;

    const double start = pal_clock_s();
    const pal_err err = replay(&run, word[0], word[1], args.strict, &report, &diag);
    pal_vtk_series_free(&run.elements);
    pal_vtk_series_free(&run.surfaces);
    pal_report_progress(NULL, 0, &run.common);
    pal_scene_input_close(&run.input);
    if (err) return pal_report_refusal(&run.common, err, &diag);
    if (report.cut[0]) fprintf(stderr, "palpate replay: %s; replayed up to there\n", report.cut);
    const bool equal = report.n_hash == report.n_hash_equal;
    if (!equal)
        fprintf(stderr, "palpate replay: %s: the world differs from step %llu on: %llu of %llu hashes are equal\n",
                word[0], (unsigned long long)report.first_difference, (unsigned long long)report.n_hash_equal,
                (unsigned long long)report.n_hash);
    if (run.common.json && (code = pal_report_json(&run.common, as_json(&report, pal_clock_s() - start))) > 0)
        return code;
    if (!run.common.json && !run.common.quiet) print(&run, &report);
    return equal ? 0 : 1;
}
