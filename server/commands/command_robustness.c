/* `palpate robustness SCENE...`: the cases of server/robustness on scenes, what happened and whether that meets the
 * criterion. Exit code 1 when a case failed or could not be judged. Several scenes run in parallel, one on a core. */
#include "server/base/hash.h"
#include "server/base/team.h"
#include "server/cli/report.h"
#include "server/cli/result_lines.h"
#include "server/commands/commands.h"
#include "server/commands/robustness_table.h"
#include "server/commands/scene_input.h"
#include "server/figure/svg.h"
#include "server/mesh/geometry/organ_family.h"
#include "server/robustness/robustness.h"
#include "server/scene/scene_import.h"

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- reports ---- */

static cJSON *answer_json(pal_answer answer)
{
    return answer == PAL_UNKNOWN ? cJSON_CreateNull() : JSON_BOOL(answer == PAL_YES);
}

static cJSON *result_json(const pal_robustness_result *r)
{
    const pal_safeguards *s = &r->safeguards;
    cJSON *safeguards =
        PAL_JSON({"capped", JSON_NUMBER(s->n_capped)}, {"clamped", JSON_NUMBER(s->n_clamped)},
                 {"mass_scaled", JSON_NUMBER(s->n_mass_scaled)}, {"inverted", JSON_NUMBER(s->n_inversion)},
                 {"search", JSON_NUMBER(s->n_search)}, {"tool_reset", JSON_NUMBER(s->n_tool_reset)},
                 {"stopped", JSON_NUMBER(s->n_stopped)}, {"ns", JSON_NUMBER(s->ns)});
    return PAL_JSON(
        {"name", JSON_TEXT(r->name)}, {"what", JSON_TEXT(r->what)}, {"criterion", JSON_TEXT(r->criterion)},
        {"verdict", JSON_TEXT(pal_verdict_name(r->verdict))}, {"safe", answer_json(r->safe)},
        {"recovered", answer_json(r->recovered)}, {"returns_s", pal_json_or_null(r->return_s)},
        {"cause", JSON_TEXT(pal_cause_name(r->cause))}, {"happened", JSON_TEXT(r->diag)},
        {"finite", JSON_BOOL(r->finite)}, {"stopped", JSON_BOOL(r->frozen)},
        {"energy_excess", pal_json_finite(r->energy)}, {"energy_limit", pal_json_finite(r->limit)},
        {"energy_excluded", pal_json_finite(r->excluded_rise)}, {"peak_contact_N", pal_json_finite(r->peak_contact_N)},
        {"contact_cap_N", pal_json_finite(r->contact_cap_N)}, {"deviation_S", pal_json_finite(r->deviation_S)},
        {"simulated_s", pal_json_finite(r->simulated_s)}, {"cpu_s", pal_json_finite(r->took_s)},
        {"needs_s", r->needs_s > 0 ? pal_json_finite(r->needs_s) : NULL}, {"safeguards", safeguards});
}

static cJSON *job_json(const pal_robustness_job *job, const pal_robustness_options *options)
{
    const pal_robustness_report *report = job->report;
    const int *count = report->count;
    if (job->err)
        return PAL_JSON({"ok", JSON_BOOL(false)}, {"name", JSON_TEXT(job->word)}, {"error", JSON_TEXT(job->diag.text)});
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < report->n; k++) cJSON_AddItemToArray(list, result_json(&report->result[k]));
    return PAL_JSON(
        {"ok", JSON_BOOL(pal_robustness_job_good(job))}, {"name", JSON_TEXT(job->model[0] ? job->word : job->name)},
        {"model", JSON_TEXT(job->model)}, {"seed", JSON_NUMBER(options->seed)}, {"rests", JSON_BOOL(report->rests)},
        {"rest_inverted", JSON_NUMBER(report->rest_inverted)}, {"settle_s", pal_json_finite(report->settle_s)},
        {"lowest_1_s", pal_json_finite(report->lowest_1_s)}, {"tau_s", pal_json_finite(report->tau_s)},
        {"cpu_s", pal_json_finite(report->took_s)}, {"passed", JSON_NUMBER(count[PAL_VERDICT_PASSED])},
        {"slow", JSON_NUMBER(count[PAL_VERDICT_SLOW])}, {"collapsed", JSON_NUMBER(count[PAL_VERDICT_COLLAPSED])},
        {"failed", JSON_NUMBER(count[PAL_VERDICT_FAILED])}, {"undecided", JSON_NUMBER(count[PAL_VERDICT_UNDECIDED])},
        {"skipped", JSON_NUMBER(count[PAL_VERDICT_SKIPPED])}, {"cases", list});
}

/* ---- results of a shard: what --json prints of a scene, and what only the text says ---- */

static cJSON *stored_json(const pal_robustness_job *job, const pal_robustness_options *options)
{
    if (job->err) return PAL_JSON({"err", JSON_NUMBER(job->err)}, {"error", JSON_TEXT(job->diag.text)});
    return PAL_JSON({"title", JSON_TEXT(job->title)}, {"scene", JSON_TEXT(job->name)},
                    {"summary", JSON_TEXT(job->summary)}, {"driven", JSON_BOOL(job->report->driven)},
                    {"late", JSON_BOOL(job->report->late)}, {"report", job_json(job, options)});
}

static int count_of(const cJSON *o, const char *key)
{
    const double value = pal_result_number(o, key);
    return value >= 0 && value <= INT_MAX ? (int)value : 0;
}

static bool is_true(const cJSON *o, const char *key)
{
    return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(o, key));
}

/* "" where there is none; borrowed */
static const char *text_of(const cJSON *o, const char *key)
{
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(o, key));
    return text ? text : "";
}

static pal_answer answer_of(const cJSON *o, const char *key)
{
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(o, key);
    return cJSON_IsBool(value) ? (cJSON_IsTrue(value) ? PAL_YES : PAL_NO) : PAL_UNKNOWN;
}

/* the inverse of result_json, without the samples of the energy; borrows the texts. False: an unknown word */
static bool result_read(const cJSON *o, pal_robustness_result *r)
{
    const cJSON *s = cJSON_GetObjectItemCaseSensitive(o, "safeguards");
    const double needs_s = pal_result_number(o, "needs_s");
    int verdict = 0, cause = 0;
    while (verdict < PAL_VERDICT_COUNT && strcmp(pal_verdict_name((pal_verdict)verdict), text_of(o, "verdict")))
        verdict++;
    while (cause < PAL_CAUSE_NONE && strcmp(pal_cause_name((pal_cause)cause), text_of(o, "cause"))) cause++;
    *r = (pal_robustness_result){.name = text_of(o, "name"),
                                 .what = text_of(o, "what"),
                                 .criterion = text_of(o, "criterion"),
                                 .verdict = (pal_verdict)verdict,
                                 .cause = (pal_cause)cause,
                                 .safe = answer_of(o, "safe"),
                                 .recovered = answer_of(o, "recovered"),
                                 .finite = is_true(o, "finite"),
                                 .frozen = is_true(o, "stopped"),
                                 .energy = pal_result_number(o, "energy_excess"),
                                 .limit = pal_result_number(o, "energy_limit"),
                                 .excluded_rise = pal_result_number(o, "energy_excluded"),
                                 .peak_contact_N = pal_result_number(o, "peak_contact_N"),
                                 .contact_cap_N = pal_result_number(o, "contact_cap_N"),
                                 .deviation_S = pal_result_number(o, "deviation_S"),
                                 .return_s = pal_result_number(o, "returns_s"),
                                 .simulated_s = pal_result_number(o, "simulated_s"),
                                 .took_s = pal_result_number(o, "cpu_s"),
                                 .needs_s = needs_s > 0 ? needs_s : 0,
                                 .safeguards = {.n_capped = (uint64_t)count_of(s, "capped"),
                                                .n_clamped = (uint64_t)count_of(s, "clamped"),
                                                .n_mass_scaled = (uint64_t)count_of(s, "mass_scaled"),
                                                .n_inversion = (uint64_t)count_of(s, "inverted"),
                                                .n_search = (uint64_t)count_of(s, "search"),
                                                .n_tool_reset = (uint64_t)count_of(s, "tool_reset"),
                                                .n_stopped = (uint64_t)count_of(s, "stopped"),
                                                .ns = (uint64_t)fmax(0, pal_result_number(s, "ns"))}};
    snprintf(r->diag, sizeof r->diag, "%s", text_of(o, "happened"));
    return verdict < PAL_VERDICT_COUNT;
}

/* the inverse of stored_json; false: not what this command writes */
static bool stored_read(const cJSON *o, pal_robustness_job *job)
{
    const cJSON *r = cJSON_GetObjectItemCaseSensitive(o, "report"), *one;
    pal_robustness_report *report = job->report;
    job->done = true;
    job->err = (pal_err)count_of(o, "err");
    if (job->err) return pal_diagnostic_set(&job->diag, job->err, "%s", text_of(o, "error")) != PAL_ERR_OK;
    snprintf(job->title, sizeof job->title, "%s", text_of(o, "title"));
    snprintf(job->name, sizeof job->name, "%s", text_of(o, "scene"));
    snprintf(job->summary, sizeof job->summary, "%s", text_of(o, "summary"));
    report->driven = is_true(o, "driven"), report->late = is_true(o, "late"), report->rests = is_true(r, "rests");
    report->rest_inverted = count_of(r, "rest_inverted");
    report->settle_s = pal_result_number(r, "settle_s"), report->lowest_1_s = pal_result_number(r, "lowest_1_s");
    report->tau_s = pal_result_number(r, "tau_s"), report->took_s = pal_result_number(r, "cpu_s");
    cJSON_ArrayForEach(one, cJSON_GetObjectItemCaseSensitive(r, "cases"))
    {
        if (report->n == PAL_ROBUSTNESS_CASES_MAX || !result_read(one, &report->result[report->n])) return false;
        report->count[report->result[report->n++].verdict]++;
    }
    return report->n > 0;
}

/* "-" where there is no number */
typedef struct number_text {
    char text[24];
} number_text;

static number_text format(const char *format, double value, bool known)
{
    number_text out = {"-"};
    if (known && isfinite(value)) snprintf(out.text, sizeof out.text, format, value);
    return out;
}

static void print_result(const pal_robustness_result *r)
{
    static const char *const answer[] = {"-", "no", "yes"};
    char safeguards[64] = "";
    const number_text returns = format("%.3g", r->return_s, true),
                      contact = format("%.2g", r->peak_contact_N / r->contact_cap_N, r->peak_contact_N > 0),
                      energy = format("%.1g", r->energy, true), excluded = format("%.1g", r->excluded_rise, true),
                      left = format("%.2g", 100 * r->deviation_S, true);
    uint64_t n = pal_safeguards_sum(&r->safeguards);
    if (n > 0)
        snprintf(safeguards, sizeof safeguards, " (%llu safeguards, %.3g ms)", (unsigned long long)n,
                 1e-6 * (double)r->safeguards.ns);
    printf("%-11s %-10s %-4s %-9s %9s %8s %9s %9s %8s %8.1f %7.2f  %s%s\n", r->name, pal_verdict_name(r->verdict),
           answer[r->safe], answer[r->recovered], returns.text, contact.text, energy.text, excluded.text, left.text,
           r->simulated_s, r->took_s, r->diag, safeguards);
    if (r->verdict == PAL_VERDICT_FAILED) printf("%12s%s\n%12scriterion: %s\n", "", r->what, "", r->criterion);
}

static void print_job(const pal_robustness_job *job)
{
    const pal_robustness_report *report = job->report;
    char collapsed[40] = "", slow[40] = "";
    double max_s = 0;
    if (job->summary[0]) printf("%s\n", job->summary);
    printf("%s: %s", job->title,
           report->rests    ? "comes to rest by itself"
           : report->driven ? "has a prescribed motion without end: compared with an unloaded run"
           : report->late   ? "does not come to rest by itself in the time"
                            : "does not come to rest by itself");
    if (report->rest_inverted) printf(": its weight inverts %d elements", report->rest_inverted);
    printf("\n\n");
    printf("%-11s %-10s %-4s %-9s %9s %8s %9s %9s %8s %8s %7s  %s\n", "case", "verdict", "safe", "recovered",
           "returns s", "force/cap", "energy +", "excluded", "% S left", "sim s", "cpu s", "what happened");
    for (int k = 0; k < report->n; k++)
        print_result(&report->result[k]), max_s = fmax(max_s, report->result[k].needs_s);
    const int *count = report->count;
    if (count[PAL_VERDICT_COLLAPSED] > 0)
        snprintf(collapsed, sizeof collapsed, " %d collapsed,", count[PAL_VERDICT_COLLAPSED]);
    if (count[PAL_VERDICT_SLOW] > 0) snprintf(slow, sizeof slow, " %d slow,", count[PAL_VERDICT_SLOW]);
    printf("\n%d passed,%s%s %d failed, %d undecided, %d do not apply; %.1f s of processor time\n",
           count[PAL_VERDICT_PASSED], slow, collapsed, count[PAL_VERDICT_FAILED], count[PAL_VERDICT_UNDECIDED],
           count[PAL_VERDICT_SKIPPED], report->took_s);
    /* a case gets three times its part of the time */
    if (max_s > 0)
        printf("to judge what is undecided give about --seconds %.0f\n",
               ceil(fmax(report->took_s, report->n > 3 ? max_s * report->n / 3 : max_s)));
}

/* ---- picture: x: simulated seconds; y: energy above that at rest as a share of its largest value ---- */

enum { COLUMNS = 4, WIDE = 250, HIGH = 170, LEFT = 46, TOP = 40, HEAD = 44, PLOT_WIDE = 180, PLOT_HIGH = 92 };

static const char *colour_of(pal_verdict verdict)
{
    static const char *const colour[] = {"#009e73", "#d55e00", "#e69f00", "#999999", "#cc79a7", "#0072b2"};
    return colour[verdict];
}

/* the range of the samples; false: nothing moved */
static bool range(const pal_robustness_result *r, double *seconds, double *low, double *high)
{
    *seconds = *low = *high = 0;
    for (int i = 0; i < r->n_sample; i++) {
        if (!isfinite(r->energy_J[i])) continue;
        *seconds = fmax(*seconds, r->time_s[i]);
        *low = fmin(*low, r->energy_J[i]), *high = fmax(*high, r->energy_J[i]);
    }
    /* a rounding error is no motion */
    if (*low > -1e-9 * *high) *low = 0;
    return *seconds > 0 && *high > 1e-20;
}

static void curve(FILE *to, const pal_robustness_result *r, double x, double y)
{
    double seconds, low, high;
    char text[40];
    fprintf(to, "<rect x=\"%g\" y=\"%g\" width=\"%d\" height=\"%d\" fill=\"none\" stroke=\"#999\"/>\n", x, y, PLOT_WIDE,
            PLOT_HIGH);
    if (!range(r, &seconds, &low, &high)) {
        pal_svg_text(to, x + 0.5 * PLOT_WIDE, y + 0.5 * PLOT_HIGH, "middle", " font-size=\"11\" fill=\"#777\"",
                     r->verdict == PAL_VERDICT_SKIPPED ? "does not apply"
                     : r->frozen                       ? "stopped"
                                                       : "nothing moved",
                     0);
        return;
    }
    fprintf(to, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.4\" points=\"", colour_of(r->verdict));
    for (int i = 0; i < r->n_sample; i++)
        if (isfinite(r->energy_J[i]))
            fprintf(to, "%.1f,%.1f ", x + PLOT_WIDE * r->time_s[i] / seconds,
                    y + PLOT_HIGH * (high - r->energy_J[i]) / (high - low));
    fprintf(to, "\"/>\n");
    snprintf(text, sizeof text, "%.2g", high);
    pal_svg_text(to, x - 4, y + 9, "end", " font-size=\"10\"", text, 0);
    snprintf(text, sizeof text, "%.2g", low);
    pal_svg_text(to, x - 4, y + PLOT_HIGH, "end", " font-size=\"10\"", text, 0);
    snprintf(text, sizeof text, "%.3g s", seconds);
    pal_svg_text(to, x + PLOT_WIDE, y + PLOT_HIGH + 13, "end", " font-size=\"10\"", text, 0);
}

static pal_err draw(const pal_robustness_report *report, const char *title, const char *path, pal_diagnostic *diag)
{
    pal_svg svg;
    char text[80];
    int rows = (report->n + COLUMNS - 1) / COLUMNS;
    PAL_TRY(pal_svg_begin(&svg, COLUMNS * WIDE, HEAD + rows * HIGH, diag));
    pal_svg_text(svg.to, 16, 26, "start", " font-size=\"15\" font-weight=\"bold\"", title, 60);
    pal_svg_text(svg.to, COLUMNS * WIDE - 16, 26, "end", " font-size=\"12\"",
                 "energy above that at rest, J, over simulated time", 0);
    for (int k = 0; k < report->n; k++) {
        const pal_robustness_result *r = &report->result[k];
        double x = LEFT + k % COLUMNS * WIDE, y = HEAD + k / COLUMNS * HIGH + TOP - 14;
        snprintf(text, sizeof text, "%s: %s", r->name, pal_verdict_name(r->verdict));
        pal_svg_text(svg.to, x, y - 7, "start", " font-size=\"12\" font-weight=\"bold\"", text, 0);
        curve(svg.to, r, x, y);
    }
    return pal_svg_end(&svg, path, diag);
}

/* ---- the command ---- */

typedef struct run_all {
    pal_robustness_job *job;
    int n;
    const pal_robustness_options *options;
    const char *table;       /* rewritten after each scene, so that a long run may be read, or ended, at any time */
    pal_result_lines *lines; /* of a shard or a merge; NULL: neither */
    pthread_mutex_t one_at_a_time;
    pal_err write_err; /* of the table or the lines, or of a scene whose result is not final */
    pal_diagnostic *diag;
} run_all;

static pal_err write_table(const char *path, const pal_robustness_job *job, int n, pal_diagnostic *diag)
{
    FILE *to = fopen(path, "w");
    if (to) pal_robustness_table(to, job, n);
    const bool good = to && !ferror(to);
    if ((to && fclose(to)) || !good) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: cannot be written", path);
    return PAL_ERR_OK;
}

static pal_err open_generated(const pal_robustness_job *job, pal_loaded_scene **out, pal_diagnostic *diag)
{
    const pal_surface_scene options = {.label = -1,
                                       .fem = !strcmp(job->model, "fem"),
                                       .cells = !strcmp(job->model, "cells"),
                                       .adaptive = !strcmp(job->model, "adaptive")};
    return pal_scene_generated(job->word, &options, out, diag);
}

/* a result, or an error that the same input gives again: a shard keeps it. A missing file or memory may be there next
 * time */
static bool is_final(pal_err err)
{
    return !err || err == PAL_ERR_REFUSED || err == PAL_ERR_BUDGET || err == PAL_ERR_NUMERIC || err == PAL_ERR_FROZEN;
}

/* one scene, on one worker */
static void run_job(void *user, int worker, int index)
{
    run_all *all = user;
    pal_robustness_job *job = &all->job[index];
    pal_scene_input input = {0};
    pal_diagnostic reason = {""};
    (void)worker;
    if (job->done || (all->lines && !pal_result_lines_own(all->lines, index))) return;
    job->err = job->model[0] ? open_generated(job, &input.loaded, &job->diag)
                             : pal_scene_input_open(job->word, &input, &job->diag);
    const pal_scene *scene = job->model[0] ? (input.loaded ? &input.loaded->scene : NULL) : input.studied.scene;
    if (!job->err && (job->err = pal_robustness_run(scene, all->options, job->report, &reason)))
        pal_diagnostic_set(&job->diag, job->err, "%s: %s", job->word, reason.text);
    if (!job->err) {
        snprintf(job->title, sizeof job->title, "%s", scene->title);
        snprintf(job->name, sizeof job->name, "%s", scene->name);
        snprintf(job->summary, sizeof job->summary, "%s", input.studied.summary);
    }
    if (job->model[0])
        pal_scene_free(input.loaded);
    else
        pal_scene_input_close(&input);
    pthread_mutex_lock(&all->one_at_a_time);
    job->done = true;
    if (all->lines && !all->write_err)
        all->write_err = is_final(job->err)
                             ? pal_result_lines_put(all->lines, index, stored_json(job, all->options), all->diag)
                             : pal_diagnostic_set(all->diag, job->err, "%s", job->diag.text);
    if (all->table && !all->write_err) all->write_err = write_table(all->table, all->job, all->n, all->diag);
    pthread_mutex_unlock(&all->one_at_a_time);
}

/* the jobs that the words name: every scene, and every organ as every model; how many, at most JOBS */
enum { JOBS = 256 };
static int add_organ(pal_robustness_job *job, int n, const char *name, const char *models)
{
    char model[16];
    while (pal_flag_next_word(&models, model, sizeof model) && n < JOBS) {
        snprintf(job[n].word, sizeof job[n].word, "%s", name);
        snprintf(job[n++].model, sizeof job[n].model, "%s", model);
    }
    return n;
}

static int list_organs(pal_robustness_job *job, int n, const char *names, const char *models)
{
    char word[64], name[80];
    const char *family;
    while (pal_flag_next_word(&names, word, sizeof word)) {
        bool known = false;
        for (int k = 0; (family = pal_organ_family_name(k)); k++) {
            if (strcmp(word, "all") != 0 && strcmp(word, family) != 0) continue;
            known = true;
            for (int seed = 1; seed <= PAL_FAMILY_SEEDS; seed++) {
                snprintf(name, sizeof name, "%s:%d", family, seed);
                n = add_organ(job, n, name, models);
            }
        }
        if (!known) n = add_organ(job, n, word, models);
    }
    return n;
}

static void list_cases(char *text, size_t n_byte)
{
    size_t used = 0;
    const char *name, *about;
    for (int k = 0; (name = pal_robustness_case_name(k, &about)) && used < n_byte; k++)
        used += (size_t)snprintf(text + used, n_byte - used, "  %-11s %s\n", name, about);
}

static bool known_models(const char *models)
{
    char word[16];
    bool known = true;
    while (pal_flag_next_word(&models, word, sizeof word))
        known = known && pal_flag_word("springs|fem|adaptive|cells", word) >= 0;
    return known;
}

/* hash of the jobs, the options, the files that the words name, and those that these name */
static uint64_t input_of(const pal_robustness_job *job, int n, const pal_robustness_options *options)
{
    char text[1400];
    const char *only = options->only ? options->only : "";
    int n_byte = snprintf(text, sizeof text, "%a %a", (double)options->seed, options->max_cpu_s);
    uint64_t hash = pal_hash_bytes(PAL_HASH_START, text, (size_t)n_byte + 1);
    hash = pal_hash_bytes(hash, only, strlen(only) + 1);
    for (int k = 0; k < n; k++) {
        hash = pal_hash_bytes(hash, job[k].model, strlen(job[k].model) + 1);
        hash = pal_hash_bytes(hash, job[k].word, strlen(job[k].word) + 1);
        if (!job[k].model[0]) hash = pal_result_input_tree(hash, job[k].word);
    }
    return hash;
}

/* takes the results that are there; the lines of a merge hold all of them */
static pal_err open_lines(run_all *all, const pal_shard_flags *flags, pal_diagnostic *diag)
{
    const pal_result_list list = {"robustness", input_of(all->job, all->n, all->options), all->n};
    if (flags->merge) PAL_TRY(pal_result_lines_merge(flags->merge, &list, &all->lines, diag));
    if (flags->merge) PAL_TRY(pal_result_lines_complete(all->lines, all->n, diag));
    if (flags->shard) PAL_TRY(pal_result_lines_open(flags->folder, &list, flags->index, flags->n, &all->lines, diag));
    for (int k = 0; k < all->n && all->lines; k++) {
        const cJSON *result = pal_result_lines_find(all->lines, k);
        if (result && !stored_read(result, &all->job[k]))
            return PAL_REFUSE(diag, "%s: result %d is damaged", flags->merge ? flags->merge : flags->folder, k);
    }
    return PAL_ERR_OK;
}

/* runs the jobs that have no result yet, in parallel where there are several */
static pal_err run(run_all *all, const pal_shard_flags *flags, pal_diagnostic *diag)
{
    pal_team *team = NULL;
    const int n = all->n;
    for (int k = 0; k < n; k++)
        if (!(all->job[k].report = calloc(1, sizeof *all->job[k].report)))
            return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d scenes", n);
    PAL_TRY(open_lines(all, flags, diag));
    if (n > 1 && pal_team_create(0, &team))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no workers for %d scenes", n);
    if (team)
        pal_team_run(team, n, run_job, all);
    else
        run_job(all, 0, 0);
    pal_team_destroy(team);
    if (!all->write_err && flags->merge && all->table) all->write_err = write_table(all->table, all->job, n, all->diag);
    if (n > 1 || all->lines || !all->job[0].err) return all->write_err;
    *diag = all->job[0].diag;
    return all->job[0].err;
}

/* what a shard did */
static int report_shard(const pal_flag_common *common, const run_all *all, const pal_shard_flags *flags)
{
    int own = 0, refused = 0;
    for (int k = 0; k < all->n; k++)
        if (pal_result_lines_own(all->lines, k)) own++, refused += all->job[k].err != PAL_ERR_OK;
    if (common->json)
        return pal_report_json(common, PAL_JSON({"ok", JSON_BOOL(true)}, {"shard", JSON_NUMBER(flags->index)},
                                                {"of", JSON_NUMBER(flags->n)}, {"results", JSON_NUMBER(own)},
                                                {"refused", JSON_NUMBER(refused)}));
    if (!common->quiet)
        printf("shard %d of %d: %d of %d results are in %s, %d of them refused\n", flags->index, flags->n, own, all->n,
               flags->folder, refused);
    return 0;
}

static void print_jobs(const pal_robustness_job *job, int n)
{
    for (int k = 0; k < n; k++) {
        if (n > 1) printf("%s%s%s%s\n", k ? "\n" : "", job[k].word, job[k].model[0] ? " as " : "", job[k].model);
        if (job[k].err)
            printf("%s\n", job[k].diag.text);
        else
            print_job(&job[k]);
    }
    if (n == 1) return;
    printf("\n");
    pal_robustness_table(stdout, job, n);
}

static int report(pal_flag_common *common, const pal_robustness_job *job, int n, const pal_robustness_options *options)
{
    bool good = true;
    for (int k = 0; k < n; k++) good = good && pal_robustness_job_good(&job[k]);
    if (!common->json && !common->quiet) print_jobs(job, n);
    if (common->json) {
        cJSON *list = cJSON_CreateArray();
        for (int k = 0; k < n && n > 1; k++) cJSON_AddItemToArray(list, job_json(&job[k], options));
        cJSON *all = n > 1 ? PAL_JSON({"ok", JSON_BOOL(good)}, {"scenes", list}) : job_json(&job[0], options);
        if (n == 1) cJSON_Delete(list);
        const int code = pal_report_json(common, all);
        if (code) return code;
    }
    return good ? 0 : 1;
}

int command_robustness(int argc, char **argv)
{
    static char about[4096];
    const char *picture = NULL, *only = NULL, *generate = NULL, *models = "springs,fem", *table_path = NULL;
    double seed = 1, seconds = 0;
    pal_shard_flags shard = {0};
    const pal_flag flag[] = {
        {"--only", "NAME", PAL_FLAG_TEXT, &only, 0, 0, "run this case alone"},
        {"--generate", "ORGAN,...", PAL_FLAG_TEXT, &generate, 0, 0,
         "run generated organs: FAMILY:SEED, FAMILY for its ten seeds, or all; families are\nslender, branched, "
         "thin-walled and lobed"},
        {"--model", "MODEL,...", PAL_FLAG_TEXT, &models, 0, 0,
         "models of generated organs: springs, fem, adaptive, cells (springs,fem)"},
        {"--table", "FILE.md", PAL_FLAG_TEXT, &table_path, 0, 0,
         "write the answers by family and model as a table, anew after each scene"},
        {"--seed", "N", PAL_FLAG_NUMBER, &seed, 0, 1e15, "seed of the random numbers (1)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 1e6,
         "processor time of all cases of a scene together (60, more where a step is expensive)"},
        {"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0,
         "one scene: plot the energy over time, one plot for each case"},
        PAL_SHARD_FLAGS(shard, "scene")};
    int head = snprintf(
        about, sizeof about,
        "Runs the cases that are known to break simulations on scenes, one after another, and reports what\n"
        "happened. Each case has three answers: is it safe (finite, bounded, energy and contact force within\n"
        "their limits), does it recover its shape after release, and in how many seconds. Several scenes run\n"
        "in parallel. Exit code 1 when a case fails its criterion or cannot be judged in the time.\n\nCASES\n");
    list_cases(about + head, sizeof about - (size_t)head);
    const pal_flag_table table = {
        .usage = "robustness [SCENE...] [flags]",
        .about = about,
        .example = "palpate prepare --shape sphere --resolution 6 --model fem -o ball\n"
                   "palpate robustness ball/scene.json --only meganewton --seconds 20\n"
                   "palpate robustness --generate branched:5,lobed:7 --model fem --only inside --table inside.md\n"
                   "palpate robustness --generate branched:5 --model fem --only inside --shard 1/1 --results shards\n"
                   "palpate robustness --generate branched:5 --model fem --only inside --merge shards\n",
        PAL_FLAGS(flag),
        .operands = {0, JOBS / 2}};
    pal_flag_common common;
    const char *word[JOBS / 2], *name;
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool known = !only;
    for (int k = 0; (name = pal_robustness_case_name(k, NULL)) && !known; k++) known = !strcmp(only, name);
    if (!known) return pal_flags_wrong(&common, "there is no case \"%.60s\"", only);
    if (!known_models(models)) return pal_flags_wrong(&common, "--model: known are springs, fem, adaptive and cells");
    if (n == 0 && !generate) return pal_flags_wrong(&common, "needs a SCENE or --generate");
    static pal_robustness_job job[JOBS];
    for (int k = 0; k < n; k++) snprintf(job[k].word, sizeof job[k].word, "%s", word[k]);
    const int n_scene = n;
    pal_diagnostic diag = {""};
    if (generate) n = list_organs(job, n, generate, models);
    for (int k = n_scene; k < n; k++) {
        int family;
        uint64_t number;
        if (pal_organ_name_read(job[k].word, &family, &number, &diag))
            return pal_flags_wrong(&common, "--generate: %s", diag.text);
    }
    if (pal_shard_flags_check(&shard, &diag)) return pal_flags_wrong(&common, "%s", diag.text);
    if (picture && (shard.shard || shard.merge))
        return pal_flags_wrong(&common, "--picture: does not go with --shard and --merge");
    if (picture && n > 1) return pal_flags_wrong(&common, "--picture: goes with one scene");
    pal_robustness_options options;
    pal_robustness_default(&options);
    options.seed = (uint64_t)seed, options.max_cpu_s = seconds, options.only = only;
    if (n == 1) options.progress = pal_report_continue, options.user = &common;
    run_all all = {.job = job,
                   .n = n,
                   .options = &options,
                   .table = shard.shard ? NULL : table_path,
                   .one_at_a_time = PTHREAD_MUTEX_INITIALIZER,
                   .diag = &diag};
    pal_err err = run(&all, &shard, &diag);
    pal_report_progress(NULL, 0, &common);
    if (!err && picture) err = draw(job[0].report, job[0].title, picture, &diag);
    code = err           ? pal_report_refusal(&common, err, &diag)
           : shard.shard ? report_shard(&common, &all, &shard)
                         : report(&common, job, n, &options);
    pal_result_lines_close(all.lines);
    for (int k = 0; k < n; k++) free(job[k].report);
    return code;
}
