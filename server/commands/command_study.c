/* `palpate study`: what accuracy costs. Configurations of a body are measured one after another against a converged
 * reference and stored after each, so that an interrupted run can be continued; then the cheapest within an error, or
 * the most accurate in a time, is reported and written as a scene. */
#include "server/base/clock.h"
#include "server/base/machine.h"
#include "server/calibrate/journal.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/rendered_force.h"
#include "server/commands/study_lines.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/study/studied_scene.h"
#include "server/study/study_input.h"
#include "server/study/study_page.h"
#include "server/study/tuning.h"

#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char about[] =
    "Measures one body under the same loads in many configurations (method, element, law, resolution, step,\n"
    "tolerance), each with its error against a converged reference and the milliseconds of a live step, and marks\n"
    "the Pareto front: those that no other one beats in both. SCENE is a scene.json, its folder, control cells, a\n"
    "surface or a scan, which is pressed in three places and pulled at one; PROBLEM.json is that of palpate solve\n"
    "with its own loads.\n"
    "\n"
    "Beside scene.json, or in --out, it keeps study.json (beside NAME.json NAME_study.json), a table .csv, a plot\n"
    ".svg and a page .html, and the solutions of the reference in study.reference. Ctrl-C ends it; the same\n"
    "command continues after the last stored result.\n"
    "\n"
    "--within and --budget pick a configuration, --pick the one of a row of the table; with -o they write its\n"
    "scene. Nothing is measured again when the study is complete. A scene with \"accuracy\": {\"max_error_mm\": 1} or\n"
    "\"budget\": {\"step_ms\": 4} is served and planned in the configuration that the study beside it gives.\n";

enum { MAX_PATH = PAL_STUDY_PATH + 8, FILES = 5 };

typedef struct study_run {
    pal_flag_common common;
    pal_study_request request;
    pal_accuracy_target target;
    const char *methods, *folder, *scene;             /* scene: -o */
    char load_case[PAL_NAME];                         /* of the stored study */
    char words[sizeof((pal_study_file *)0)->methods]; /* --methods, cut into ... */
    const char *method[PAL_STUDY_METHODS];
    int n_method;
    bool again;
    bool uses_stored; /* a configuration of the stored study is asked for, whatever its loads */
    int row;          /* of the table, from 1; 0: none                                        */
    pal_study_input input;
    char stem[PAL_STUDY_PATH], path[MAX_PATH]; /* of the study's files; study.json */
    pal_study_file *file;                      /* the contents of study.json       */
    pal_study_file *old;                       /* as it was stored; NULL: none     */
    const pal_study *before;                   /* old's results, to be continued; NULL: none */
    pal_journal *journal;                      /* stored solutions of the reference; NULL: nothing is measured */
    int n_before, n_new;
    double begin_s, first_s; /* clock at the begin of all, of the first new configuration */
    pal_err store_err;       /* of the last write */
    pal_diagnostic store_diag;
    int picked; /* -1: none */
    pal_shard_flags shard;
    pal_result_lines *lines; /* of --shard or --merge; NULL: neither */
    int index;               /* of the configuration that is being measured, with --shard */
    char written[MAX_PATH];
} study_run;

/* ---- arguments ---- */

typedef struct unit_scale {
    const char *name;
    double in_base; /* how many make one m or ms */
} unit_scale;
static const unit_scale length_unit[] = {{"mm", 1e3}, {"um", 1e6}, {"\xc2\xb5m", 1e6},
                                         {"cm", 1e2}, {"m", 1},    {NULL, 0}};
static const unit_scale time_unit[] = {{"ms", 1}, {"us", 1e3}, {"\xc2\xb5s", 1e3}, {"s", 1e-3}, {NULL, 0}};

/* "1mm", "4 ms": a number above 0 and its unit; false: text is not that */
static bool read_amount(const char *text, const unit_scale *unit, double *out)
{
    char *end;
    double number = strtod(text, &end);
    if (end == text || !isfinite(number) || number <= 0) return false;
    while (*end == ' ') end++;
    while (unit->name && strcmp(end, unit->name) != 0) unit++;
    if (unit->name) *out = number / unit->in_base;
    return unit->name && *out > 0 && isfinite(*out);
}

/* "fem,tet_springs" -> run->method; false: a word is no method */
static bool read_methods(study_run *run)
{
    static const char known[] = "fem|tet_springs|adaptive_springs|subdivision_fem";
    const char *rest = run->methods;
    for (char *to = run->words; pal_flag_next_word(&rest, to, sizeof run->words - (size_t)(to - run->words));
         to += strlen(to) + 1) {
        if (pal_flag_word(known, to) < 0) return false;
        if (run->n_method < PAL_STUDY_METHODS) run->method[run->n_method++] = to;
    }
    return true;
}

static pal_err read_arguments(study_run *run, const char *within, const char *budget, pal_diagnostic *diag)
{
    if (within && !read_amount(within, length_unit, &run->target.max_error_m))
        return PAL_REFUSE(diag, "--within: \"%.40s\" is not a length above 0 with its unit, mm, um, cm or m, as 1mm",
                          within);
    if (budget && !read_amount(budget, time_unit, &run->target.budget_ms))
        return PAL_REFUSE(diag, "--budget: \"%.40s\" is not a time above 0 with its unit, ms, us or s, as 4ms", budget);
    if (run->scene && !within && !budget && !run->row)
        return PAL_REFUSE(diag, "-o: needs --within, --budget or --pick, which name the configuration to write");
    const char *other = run->again ? "--again" : within ? "--within" : "--budget";
    if (run->row && (within || budget || run->again))
        return PAL_REFUSE(diag, "--pick: names the configuration of a row, %s does not go with it", other);
    if (run->methods && strlen(run->methods) >= sizeof run->words)
        return PAL_REFUSE(diag, "--methods: \"%.40s...\" is too long", run->methods);
    if (run->methods && !run->methods[0]) return PAL_REFUSE(diag, "--methods: \"\" is empty");
    if (run->methods && !read_methods(run))
        return PAL_REFUSE(diag,
                          "--methods: \"%.80s\" contains a name that is not fem, tet_springs, adaptive_springs or "
                          "subdivision_fem",
                          run->methods);
    if (!run->methods) run->methods = "";
    return PAL_ERR_OK;
}

/* the command as it was typed, words with blanks in quotes */
static void take_command(pal_study_file *file, int argc, char **argv)
{
    size_t n = (size_t)snprintf(file->command, sizeof file->command, "palpate");
    for (int k = 0; k < argc && n < sizeof file->command; k++) {
        bool plain = argv[k][0] && strspn(argv[k], "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                                   "_-+=.,:/@%") == strlen(argv[k]);
        n += (size_t)snprintf(file->command + n, sizeof file->command - n, plain ? " %s" : " '%s'", argv[k]);
    }
    for (char *c = file->command; *c; c++)
        if ((unsigned char)*c < 0x20 || (unsigned char)*c > 0x7e) *c = '?';
}

/* ---- stored results ---- */

/* refuses a stored study of another body, other loads or another machine. A pick from a complete study (answers)
 * accepts any loads, a row of the table any machine */
static pal_err check_same(const study_run *run, const pal_study_file *old, bool answers, pal_diagnostic *diag)
{
    const pal_study_file *now = run->file;
    const char *what = NULL;
    char detail[300] = "";
    if (strcmp(old->shape, now->shape) != 0 || old->index != now->index)
        what = "another body", snprintf(detail, sizeof detail, "%s of %s", old->body, old->study.name);
    else if (!answers && strcmp(old->loads, now->loads) != 0)
        what = "other loads", snprintf(detail, sizeof detail, "%s", old->loads);
    else if (!answers && strcmp(old->digest, now->digest) != 0)
        what = "other loads, samples or steps", snprintf(detail, sizeof detail, "%s", old->loads);
    else if (!run->row && strcmp(old->study.machine, now->study.machine) != 0)
        what = "another machine", snprintf(detail, sizeof detail, "%s", old->study.machine);
    if (!what) return PAL_ERR_OK;
    char other[sizeof now->loads + 8];
    snprintf(other, sizeof other, "%s, quick", now->loads);
    if (!strcmp(other, old->loads))
        return PAL_REFUSE(
            diag, "%.200s: is of a quick study: --quick continues it, --again starts over, --out keeps it", run->path);
    return PAL_REFUSE(diag, "%.200s: is of %s (%.150s): --again starts over, --out keeps it", run->path, what, detail);
}

/* are all requested methods measured? */
static bool covers(const study_run *run)
{
    if (!run->old->whole || !run->old->methods[0]) return run->old->whole;
    bool all = run->n_method > 0;
    for (int k = 0; k < run->n_method; k++) all = all && pal_study_method_in(run->old->methods, run->method[k]);
    return all;
}

/* the stored study. A pick without load flags takes the loads from it */
static pal_err read_old(study_run *run, pal_diagnostic *diag)
{
    pal_study_request *q = &run->request;
    bool exists = !run->shard.shard && !run->shard.merge && !access(run->path, F_OK);
    bool asks = run->row > 0 || run->target.max_error_m > 0 || run->target.budget_ms > 0;
    bool given = q->quick || q->seconds > 0 || q->load_case || q->samples;
    pal_diagnostic reason = {""};
    if (run->shard.merge && !run->again && !access(run->path, F_OK))
        return PAL_REFUSE(diag, "%.200s: is there already: --again replaces it, --out keeps it", run->path);
    if (run->row && !exists)
        return PAL_REFUSE(diag, "--pick %d: there is no %.200s yet: run palpate study %.200s", run->row, run->path,
                          q->word);
    pal_err err = exists && !run->again ? pal_study_file_read(run->path, &run->old, &reason) : PAL_ERR_OK;
    if (err) return pal_diagnostic_set(diag, err, "%.400s: --again starts over", reason.text);
    if (run->old && asks && !given) {
        pal_study_loads_read(run->old->loads, &q->seconds, &q->quick, run->load_case);
        if (run->load_case[0]) q->load_case = run->load_case, q->keeps_case = true;
        run->uses_stored = true;
    }
    if (!(q->seconds > 0)) q->seconds = PAL_STUDY_SECONDS;
    return PAL_ERR_OK;
}

/* *whole: nothing is left to measure */
static pal_err use_old(study_run *run, bool *whole, pal_diagnostic *diag)
{
    *whole = false;
    if (!run->old) return PAL_ERR_OK;
    /* --pick reads the stored table, also of an interrupted study */
    bool complete = run->row || covers(run);
    PAL_TRY(check_same(run, run->old, complete && run->uses_stored, diag));
    run->n_before = run->old->study.n_point;
    *whole = complete;
    if (complete) {
        *run->file = *run->old;
        pal_study_mark_front(&run->file->study);
        return PAL_ERR_OK;
    }
    /* the study will have the stored methods and the requested ones */
    char both[2 * sizeof run->file->methods], *methods = run->file->methods;
    snprintf(both, sizeof both, "%s,%s", run->old->methods, methods);
    if (run->old->whole && methods[0] && strlen(both) < sizeof run->file->methods) strcpy(methods, both);
    run->before = &run->old->study;
    return PAL_ERR_OK;
}

/* ---- measuring ---- */

/* springs whose calibration failed have the configuration of uncalibrated ones: the error code distinguishes them */
static bool has_point(const pal_study *study, const pal_study_point *point)
{
    for (int k = 0; k < study->n_point; k++) {
        const pal_study_point *p = &study->point[k];
        if (p->err == point->err && pal_configuration_equal(&p->measured.configuration, &point->measured.configuration))
            return true;
    }
    return false;
}

/* the results of this run and the stored ones that it has not measured again */
static void merge_results(study_run *run, const pal_study *study)
{
    pal_study *to = &run->file->study;
    char name[PAL_NAME];
    memcpy(name, to->name, sizeof name);
    *to = *study;
    if (!to->name[0]) memcpy(to->name, name, sizeof name);
    pal_machine_name(to->machine);
    for (int k = 0; run->before && k < run->before->n_point && to->n_point < PAL_STUDY_POINTS; k++)
        if (!has_point(study, &run->before->point[k])) to->point[to->n_point++] = run->before->point[k];
    pal_study_mark_front(to);
}

/* writes the file after every result: a kill loses only the one in progress */
static bool store(const pal_study *study, int n_total, void *user)
{
    study_run *run = user;
    merge_results(run, study);
    bool is_new = study->n_point > 0 && !(run->before && has_point(run->before, &study->point[study->n_point - 1]));
    run->n_new += is_new;
    run->file->n_total = n_total > run->file->study.n_point ? n_total : run->file->study.n_point;
    run->file->whole = false;
    run->store_err = pal_study_file_write(run->file, run->path, &run->store_diag);
    /* a stop after the last result is none */
    return !run->store_err && (!pal_stop_asked() || study->n_point == n_total);
}

/* ---- shards ---- */

static bool own(int index, void *user)
{
    study_run *run = user;
    run->index = index;
    return pal_result_lines_own(run->lines, index);
}

/* appends the last point as a line */
static bool store_line(const pal_study *study, int n_total, void *user)
{
    study_run *run = user;
    if (pal_result_lines_find(run->lines, run->index)) return !pal_stop_asked();
    run->store_err = pal_study_lines_put(run->lines, run->index, run->file, study, n_total, &run->store_diag);
    run->n_new++;
    return !run->store_err && !pal_stop_asked();
}

/* a line of the journal: hash and length = error, nodes; numbers; sentence */
static void answer_key(uint64_t key, int n, char out[40])
{
    snprintf(out, 40, "%016" PRIx64 " %d", key, n);
}

static bool recall(uint64_t key, pal_study_answer *answer, double *value, int n, void *user)
{
    const study_run *run = user;
    char word[40];
    int err;
    answer_key(key, n, word);
    const char *text = pal_journal_find(run->journal, word), *number = text ? strchr(text, ';') : NULL;
    const char *reason = number ? strchr(number + 1, ';') : NULL;
    if (!reason || sscanf(text, "%d %d", &err, &answer->n_node) != 2 ||
        !pal_journal_numbers(number + 1, value, (size_t)n))
        return false;
    answer->err = (pal_err)err;
    snprintf(answer->reason, sizeof answer->reason, "%s", reason + 1);
    return true;
}

/* a solution that cannot be stored is computed again after an interruption */
static void remember(uint64_t key, const pal_study_answer *answer, const double *value, int n, void *user)
{
    study_run *run = user;
    char word[40], *text, *number = pal_journal_text(value, (size_t)n);
    answer_key(key, n, word);
    if (number && asprintf(&text, "%d %d; %s;%s", (int)answer->err, answer->n_node, number, answer->reason) >= 0) {
        (void)pal_journal_put(run->journal, word, text, NULL);
        free(text);
    }
    free(number);
}

static bool show(const char *what, double fraction, void *user)
{
    study_run *run = user;
    char text[240], left[48] = "", share[24] = "";
    double now = pal_clock_s();
    const pal_study_file *f = run->file;
    if (run->n_new == 0) run->first_s = now;
    if (run->begin_s == 0) run->begin_s = now;
    if (!strncmp(what, "reference", 9) && fraction > 0 && fraction < 1)
        snprintf(left, sizeof left, ", about %.0f s of it left", (now - run->begin_s) * (1 - fraction) / fraction);
    if (run->n_new > 0 && f->n_total > f->study.n_point) {
        double rest = (now - run->first_s) / run->n_new * (f->n_total - f->study.n_point);
        snprintf(left, sizeof left, rest < 90 ? ", about %.0f s left" : ", about %.0f min left",
                 rest < 90 ? rest : rest / 60);
    }
    if (fraction > 0) snprintf(share, sizeof share, " %.0f %%", 100 * fraction);
    if (run->n_new > 0)
        snprintf(text, sizeof text, "%d of %d, %s%s%s", f->study.n_point, f->n_total, what, share, left);
    else
        snprintf(text, sizeof text, "%s%s%s", what, share, left);
    pal_report_progress(text, 0, &run->common);
    return !pal_stop_asked();
}

static bool may_continue(void *user)
{
    (void)user;
    return !pal_stop_asked();
}

/* Opens STEM.reference for body, loads and machine; a file without solutions of these is started again. */
static pal_err open_journal(study_run *run, pal_diagnostic *diag)
{
    const pal_study_file *f = run->file;
    char path[MAX_PATH + 4];
    uint64_t of = pal_hash_bytes(PAL_HASH_START, f->shape, strlen(f->shape));
    of = pal_hash_bytes(pal_hash_bytes(of, f->digest, strlen(f->digest)), f->loads, strlen(f->loads));
    of = pal_hash_bytes(of, f->study.machine, strlen(f->study.machine));
    snprintf(path, sizeof path, "%.*s.reference", PAL_STUDY_PATH, run->stem);
    for (bool again = run->again;; again = true) {
        if (again) (void)remove(path);
        pal_err err = pal_journal_open(path, &run->journal, diag);
        if (!err) err = pal_journal_begin(run->journal, of, diag);
        bool useless = err == PAL_ERR_REFUSED || (!err && pal_journal_count(run->journal) == 0);
        if (again || !useless) return err;
        pal_journal_close(run->journal);
        run->journal = NULL;
    }
}

static pal_err measure(study_run *run, pal_diagnostic *diag)
{
    pal_study *out = calloc(1, sizeof *out);
    pal_study_options o = {.body = run->input.body,
                           .seconds = run->request.seconds,
                           .quick = run->request.quick,
                           .method = run->n_method ? run->method : NULL,
                           .n_method = run->n_method,
                           .samples = run->input.has_samples ? &run->input.samples : NULL,
                           .renderer = &pal_rendered_force,
                           .before = run->before,
                           .recall = recall,
                           .remember = remember,
                           .done = store,
                           .progress = show,
                           .may_continue = may_continue,
                           .user = run};
    if (run->shard.shard) o.own = own, o.done = store_line;
    if (run->shard.merge) o.recall = NULL, o.remember = NULL, o.done = NULL; /* nothing is left to measure */
    pal_err err = !out ? PAL_ERR_MEMORY : run->shard.merge ? PAL_ERR_OK : open_journal(run, diag);
    if (!out) pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the study");
    if (err) {
        free(out);
        return err;
    }
    const pal_study_input *in = &run->input;
    err = in->problem ? pal_study_problem(in->problem, in->load_case, &in->surface, &o, out, diag)
                      : pal_study_scene(in->scene, &o, out, diag);
    if (!err || out->n_point > 0) merge_results(run, out);
    if (run->store_err) {
        err = run->store_err;
        *diag = run->store_diag;
    } else {
        pal_diagnostic_prefix(diag, err, run->request.word);
    }
    run->file->n_total = err ? run->file->n_total : run->file->study.n_point;
    run->file->whole = !err;
    free(out);
    return err;
}

/* ---- the picked scene ---- */

/* the real path of the folder of a file; false: it does not exist */
static bool real_folder(const char *path, char out[PATH_MAX])
{
    char folder[MAX_PATH];
    return pal_json_folder(path, folder, sizeof folder) && realpath(folder, out) != NULL;
}

static bool is_json(const char *path)
{
    size_t n = strlen(path);
    return n > 5 && !strcmp(path + n - 5, ".json");
}

/* "out.json" or a folder -> the file of the scene */
static pal_err scene_path(study_run *run, pal_diagnostic *diag)
{
    const char *word = run->request.word;
    char own[PATH_MAX], other[PATH_MAX], source[MAX_PATH];
    int size = snprintf(run->written, sizeof run->written, is_json(run->scene) ? "%s" : "%s/scene.json", run->scene);
    if (size < 0 || (size_t)size >= PAL_STUDY_PATH - 16)
        return PAL_REFUSE(diag, "-o: %.80s...: the path is too long", run->scene);
    /* would its meshes replace those of the source? */
    snprintf(source, sizeof source, "%s/scene.json", word);
    bool folder = !access(source, F_OK);
    if ((folder || is_json(word)) && real_folder(run->written, own) && real_folder(folder ? source : word, other) &&
        !strcmp(own, other))
        return PAL_REFUSE(
            diag, "-o: %.300s is in the folder of the source, whose meshes it could replace: name another folder",
            run->written);
    return PAL_ERR_OK;
}

/* a copy of the study beside the new scene lets a session switch configurations */
static pal_err copy_study(const study_run *run, const pal_scene *scene, pal_diagnostic *diag)
{
    char stem[PAL_STUDY_PATH], path[MAX_PATH];
    pal_study_file *copy = malloc(sizeof *copy);
    if (!copy) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the study");
    *copy = *run->file;
    pal_study_shape(&scene->body[run->input.body], copy->shape);
    pal_err err = pal_study_stem(run->written, NULL, stem, diag);
    if (!err) snprintf(path, sizeof path, "%s.json", stem);
    if (!err) err = pal_study_file_write(copy, path, diag);
    free(copy);
    return err;
}

static pal_err write_scene(study_run *run, pal_diagnostic *diag)
{
    const pal_study *study = &run->file->study;
    const pal_measured_configuration *p = &study->point[run->picked].measured;
    pal_configuration configuration = p->configuration;
    pal_configured_scene *set = NULL;
    if (configuration.step_s == 0) configuration.step_s = study->step_s;
    pal_err err = pal_configuration_make(run->input.scene, run->input.body, &configuration, diag, &set);
    if (err) return pal_diagnostic_prefix(diag, err, "-o");
    pal_loaded_scene *loaded = calloc(1, sizeof *loaded);
    if (!loaded) {
        pal_configured_scene_free(set);
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a scene");
    }
    loaded->scene = set->scene;
    loaded->scene.max_error_m = loaded->scene.budget_ms = 0;
    pal_study_accuracy_text(study, p->error_m, loaded->scene.accuracy, sizeof loaded->scene.accuracy);
    err =
        is_json(run->scene) ? pal_scene_save_file(loaded, run->scene, diag) : pal_scene_save(loaded, run->scene, diag);
    if (!err) err = copy_study(run, &set->scene, diag);
    free(loaded);
    pal_configured_scene_free(set);
    return err;
}

/* the configuration of a row of the table, on the Pareto front or not */
static pal_err pick_row(study_run *run, pal_diagnostic *diag)
{
    char text[PAL_CONFIGURATION_TEXT];
    int order[PAL_STUDY_POINTS];
    const pal_study *study = &run->file->study;
    if (run->row > study->n_point)
        return PAL_REFUSE(diag, "--pick %d: the table of %.200s has rows 1 to %d", run->row, run->path, study->n_point);
    pal_study_order(study, order);
    const pal_study_point *p = &study->point[order[run->row - 1]];
    if (p->err || !isfinite(p->measured.ms) || !isfinite(p->measured.error_m))
        return PAL_REFUSE(diag, "--pick %d: %s was not measured: %s", run->row,
                          pal_configuration_text(&p->measured.configuration, text),
                          p->reason[0] ? p->reason : pal_err_text(p->err));
    run->picked = order[run->row - 1];
    return PAL_ERR_OK;
}

static pal_err answer(study_run *run, pal_diagnostic *diag)
{
    char text[400];
    const pal_study *study = &run->file->study;
    if (run->row) return pick_row(run, diag);
    if (!(run->target.max_error_m > 0) && !(run->target.budget_ms > 0)) return PAL_ERR_OK;
    run->picked = pal_study_pick_target(study, run->methods, &run->target);
    if (run->picked >= 0) return PAL_ERR_OK;
    pal_study_describe_miss(study, run->methods, &run->target, text, sizeof text);
    return PAL_REFUSE(diag, "%s: %s", run->request.word, text);
}

/* ---- report ---- */

static int n_files(const study_run *run, char file[FILES][MAX_PATH])
{
    static const char *const ending[] = {"json", "csv", "svg", "html"};
    int n = 0;
    for (int k = 0; k < 4; k++) {
        snprintf(file[n], MAX_PATH, "%.*s.%s", PAL_STUDY_PATH, run->stem, ending[k]);
        if (!access(file[n], F_OK)) n++;
    }
    if (run->scene && run->picked >= 0) memcpy(file[n++], run->written, MAX_PATH);
    return n;
}

static void print(const study_run *run)
{
    char text[PAL_CONFIGURATION_TEXT], asked[80], off[PAL_STUDY_ERROR_TEXT], file[FILES][MAX_PATH];
    const pal_study *study = &run->file->study;
    if (run->n_before > 0) printf("%d of %d measured before\n", run->n_before, run->file->n_total);
    /* of a complete study only the pick is new */
    if (run->picked < 0 || run->n_new > 0) pal_study_print(run->file, stdout);
    if (run->picked >= 0) {
        const pal_study_point *point = &study->point[run->picked];
        const pal_measured_configuration *p = &point->measured;
        pal_accuracy_target_text(&run->target, asked);
        if (run->row) snprintf(asked, sizeof asked, "row %d", run->row);
        printf("%s: %s, %s in %.3g ms%s%s\n", asked, pal_configuration_text(&p->configuration, text),
               pal_study_error_text(run->file, p->error_m, off), p->ms, point->reason[0] ? "; " : "", point->reason);
    }
    int n = n_files(run, file);
    for (int k = 0; k < n; k++)
        printf("%s %s\n", run->n_new > 0 || !strcmp(file[k], run->written) ? "wrote" : "stored in", file[k]);
    if (run->scene && run->picked >= 0) printf("palpate serve %s\n", run->scene);
}

static void print_shard(const study_run *run)
{
    printf("shard %d of %d: %d results are in %s, %d of them from before\n", run->shard.index, run->shard.n,
           run->n_before + run->n_new, run->shard.folder, run->n_before);
}

static cJSON *as_json(const study_run *run)
{
    char text[PAL_CONFIGURATION_TEXT], file[FILES][MAX_PATH];
    int n = n_files(run, file);
    cJSON *o = pal_study_file_tree(run->file);
    if (!o) return NULL;
    PAL_JSON_ADD(o, {"ok", JSON_BOOL(true)}, {"measured_before", JSON_NUMBER(run->n_before)},
                 {"measured", JSON_NUMBER(run->n_new)}, {"files", pal_json_texts(file[0], MAX_PATH, n)});
    if (run->picked < 0) return o;
    const pal_measured_configuration *p = &run->file->study.point[run->picked].measured;
    return PAL_JSON_ADD(
        o, {"picked", PAL_JSON({"point", JSON_NUMBER(run->picked)}, {"row", run->row ? JSON_NUMBER(run->row) : NULL},
                               {"configuration", JSON_TEXT(pal_configuration_text(&p->configuration, text))},
                               {"ms", JSON_NUMBER(p->ms)}, {"error_m", JSON_NUMBER(p->error_m)})});
}

static pal_err work(study_run *run, int argc, char **argv, pal_diagnostic *diag)
{
    bool whole;
    if (run->scene) PAL_TRY(scene_path(run, diag));
    PAL_TRY(pal_study_stem(run->request.word, run->folder, run->stem, diag));
    snprintf(run->path, sizeof run->path, "%s.json", run->stem);
    if (run->shard.shard)
        snprintf(run->stem, sizeof run->stem, "%.1000s/study-%d-of-%d", run->shard.folder, run->shard.index,
                 run->shard.n);
    PAL_TRY(read_old(run, diag));
    PAL_TRY(pal_study_input_open(&run->request, &run->input, diag));
    pal_study_input_describe(&run->input, &run->request, run->file);
    snprintf(run->file->methods, sizeof run->file->methods, "%s", run->methods);
    pal_machine_name(run->file->study.machine);
    run->file->study.step_s = run->input.scene->step_s;
    take_command(run->file, argc, argv);
    PAL_TRY(use_old(run, &whole, diag));
    if (run->shard.shard || run->shard.merge)
        PAL_TRY(pal_study_lines_open(&run->shard, run->file, &run->lines, &run->old, diag));
    if (run->lines && run->old) run->n_before = run->old->study.n_point, run->before = &run->old->study;
    if (run->shard.shard) return measure(run, diag);
    if (!whole) {
        if (run->folder) PAL_TRY(pal_scene_make_folder(run->folder, diag));
        pal_err err = measure(run, diag);
        /* an interrupted study is published as well */
        pal_diagnostic reason = {""};
        pal_err kept = run->file->study.n_point > 0 || !err ? pal_study_file_write(run->file, run->path, &reason) : 0;
        if (!kept && run->file->study.n_point > 0) kept = pal_study_publish(run->file, run->stem, &reason);
        int n = run->file->study.n_point > run->n_before ? run->file->study.n_point : run->n_before;
        if (err && pal_stop_asked() && n == 0)
            return pal_diagnostic_set(
                diag, PAL_ERR_STATE,
                "stopped before the first configuration was measured; %d solutions of the reference are stored "
                "in %.200s.reference; the same command continues",
                run->journal ? pal_journal_count(run->journal) : 0, run->stem);
        if (err && pal_stop_asked())
            return pal_diagnostic_set(
                diag, PAL_ERR_STATE,
                "stopped with %d configurations of %d stored in %.200s; the same command continues", n,
                run->file->n_total > n ? run->file->n_total : n, run->path);
        if (err) return err;
        if (kept) return pal_diagnostic_set(diag, kept, "%s", reason.text);
    } else {
        /* draws the plot again when its file is gone */
        char path[PAL_STUDY_PATH + 8];
        snprintf(path, sizeof path, "%s.svg", run->stem);
        if (access(path, F_OK)) PAL_TRY(pal_study_publish(run->file, run->stem, diag));
    }
    PAL_TRY(answer(run, diag));
    return run->scene ? write_scene(run, diag) : PAL_ERR_OK;
}

static int start(study_run *run, int argc, char **argv)
{
    pal_diagnostic diag = {""};
    run->file = calloc(1, sizeof *run->file);
    run->picked = -1;
    pal_stop_watch();
    pal_err err = run->file ? work(run, argc, argv, &diag) : PAL_ERR_MEMORY;
    int code = pal_report_end(&run->common, err, &diag, err || !run->common.json ? NULL : as_json(run));
    if (!err && !run->common.json && !run->common.quiet) (run->shard.shard ? print_shard : print)(run);
    pal_study_input_close(&run->input);
    pal_journal_close(run->journal);
    pal_result_lines_close(run->lines);
    free(run->file);
    free(run->old);
    return code;
}

int command_study(int argc, char **argv)
{
    static study_run run;
    const char *within = NULL, *budget = NULL, *unit = NULL;
    pal_surface_scene surface = {.label = -1};
    run = (study_run){.request = {.options = &surface}};
    const pal_flag flag[] = {
        {"--within", "LENGTH", PAL_FLAG_TEXT, &within, 0, 0,
         "pick the cheapest configuration whose error, with that of the reference, is at most this: 1mm, 300um"},
        {"--budget", "TIME", PAL_FLAG_TEXT, &budget, 0, 0,
         "pick the most accurate configuration whose step takes at most this: 4ms; with --within the cheapest that\n"
         "meets both"},
        {"--pick", "ROW", PAL_FLAG_COUNT, &run.row, 1, PAL_STUDY_POINTS,
         "pick that row of the table of a stored study"},
        {"-o", "SCENE", PAL_FLAG_TEXT, &run.scene, 0, 0,
         "write the picked configuration as a scene, a folder or FILE.json, with the study beside it"},
        {"--methods", "WORD[,WORD...]", PAL_FLAG_TEXT, &run.methods, 0, 0,
         "fem, tet_springs, adaptive_springs, subdivision_fem (all that suit the body)"},
        {"--case", "ID", PAL_FLAG_TEXT, &run.request.load_case, 0, 0,
         "load case of a problem, or one of its references, whose CSV is then the truth at rest (the first load case)"},
        {"--body", "NAME", PAL_FLAG_TEXT, &run.request.body, 0, 0, "body of a scene (the first)"},
        {"--reference", "FILE.csv", PAL_FLAG_TEXT, &run.request.samples, 0, 0,
         "x,y,z,ux,uy,uz of the first load at rest, instead of our own finite elements"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &run.request.seconds, 0.01, 60, "simulated time of the first load (0.5)"},
        {"--quick", NULL, PAL_FLAG_SWITCH, &run.request.quick, 0, 0, "few configurations and a coarser reference"},
        {"--out", "FOLDER", PAL_FLAG_TEXT, &run.folder, 0, 0, "folder of the study's files (beside the scene)"},
        PAL_SHARD_FLAGS(run.shard, "configuration"),
        {"--again", NULL, PAL_FLAG_SWITCH, &run.again, 0, 0,
         "start over instead of continuing; with --merge, replace a study that is there"},
        {"--units", "UNIT", PAL_FLAG_TEXT, &unit, 0, 0, "unit of a surface file: m, cm, mm, um, in (guessed)"},
    };
    const pal_flag_table table = {.usage = "study SCENE|PROBLEM.json [flags]",
                                  .about = about,
                                  .example = "palpate study deploy/problems/beam.json --case tip --quick --methods fem "
                                             "--seconds 0.1 --out beam_study\n"
                                             "palpate study deploy/problems/beam.json --case tip --quick --methods fem "
                                             "--seconds 0.1 --out beam_study --pick 1 -o beam_fast\n"
                                             "palpate plan beam_fast/scene.json\n",
                                  PAL_FLAGS(flag),
                                  .operands = {1, 1}};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &run.common, &run.request.word, &n);
    if (code >= 0) return code;
    pal_diagnostic diag = {""};
    if (read_arguments(&run, within, budget, &diag)) return pal_flags_wrong(&run.common, "%s", diag.text);
    if (pal_shard_flags_check(&run.shard, &diag)) return pal_flags_wrong(&run.common, "%s", diag.text);
    if (run.shard.shard && (within || budget || run.row || run.folder || run.again))
        return pal_flags_wrong(&run.common, "--shard: does not go with --within, --budget, --pick, --out and --again");
    if (run.shard.merge && run.row) return pal_flags_wrong(&run.common, "--merge: does not go with --pick");
    surface.unit_m = unit ? pal_mesh_unit_named(unit) : 0;
    if (unit && surface.unit_m == 0)
        return pal_flags_wrong(&run.common, "--units: \"%.40s\" is not m, cm, mm, um or in", unit);
    return start(&run, argc, argv);
}
