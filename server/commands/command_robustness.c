/* `palpate robustness SCENE`: the cases of server/robustness on a scene, what happened and whether that meets the
 * criterion. Exit code 1 when a case failed or could not be judged. */
#include "server/cli/flags.h"
#include "server/commands/commands.h"
#include "server/commands/robustness_picture.h"
#include "server/commands/scene_input.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static cJSON *result_json(const pal_robustness_result *r)
{
    static const char *const verdict[] = {"passed", "failed", "undecided", "skipped", "collapsed"};
    cJSON *o = cJSON_CreateObject(), *safeguards = cJSON_AddObjectToObject(o, "safeguards");
    const struct {
        const char *key;
        uint64_t n;
    } count[] = {{"capped", r->safeguards.n_capped},           {"clamped", r->safeguards.n_clamped},
                 {"mass_scaled", r->safeguards.n_mass_scaled}, {"inverted", r->safeguards.n_inversion},
                 {"search", r->safeguards.n_search},           {"tool_reset", r->safeguards.n_tool_reset},
                 {"stopped", r->safeguards.n_stopped},         {"ns", r->safeguards.ns}};
    cJSON_AddStringToObject(o, "name", r->name);
    cJSON_AddStringToObject(o, "what", r->what);
    cJSON_AddStringToObject(o, "criterion", r->criterion);
    cJSON_AddStringToObject(o, "verdict", verdict[r->verdict]);
    cJSON_AddStringToObject(o, "happened", r->diag);
    cJSON_AddBoolToObject(o, "finite", r->finite);
    cJSON_AddBoolToObject(o, "stopped", r->frozen);
    pal_json_add_finite(o, "energy_excess", r->energy);
    pal_json_add_finite(o, "energy_limit", r->limit);
    pal_json_add_finite(o, "energy_excluded", r->excluded_rise);
    pal_json_add_finite(o, "deviation_S", r->deviation_S);
    pal_json_add_finite(o, "return_s", r->return_s);
    pal_json_add_finite(o, "simulated_s", r->simulated_s);
    pal_json_add_finite(o, "cpu_s", r->took_s);
    for (size_t k = 0; k < sizeof count / sizeof count[0]; k++)
        cJSON_AddNumberToObject(safeguards, count[k].key, (double)count[k].n);
    return o;
}

static cJSON *as_json(const pal_scene *scene, const pal_robustness_options *options,
                      const pal_robustness_report *report)
{
    cJSON *o = cJSON_CreateObject();
    cJSON_AddBoolToObject(o, "ok", report->n_failed + report->n_undecided == 0);
    cJSON_AddStringToObject(o, "name", scene->name);
    cJSON_AddNumberToObject(o, "seed", (double)options->seed);
    cJSON_AddBoolToObject(o, "rests", report->rests);
    pal_json_add_finite(o, "settle_s", report->settle_s);
    pal_json_add_finite(o, "cpu_s", report->took_s);
    cJSON_AddNumberToObject(o, "passed", report->n_passed);
    cJSON_AddNumberToObject(o, "collapsed", report->n_collapsed);
    cJSON_AddNumberToObject(o, "failed", report->n_failed);
    cJSON_AddNumberToObject(o, "undecided", report->n_undecided);
    cJSON_AddNumberToObject(o, "skipped", report->n_skipped);
    cJSON *list = cJSON_AddArrayToObject(o, "cases");
    for (int k = 0; k < report->n; k++) cJSON_AddItemToArray(list, result_json(&report->result[k]));
    return o;
}

static void print_result(const pal_robustness_result *r)
{
    char energy[24] = "-", excluded[24] = "-", left[24] = "-", safeguards[64] = "";
    if (isfinite(r->excluded_rise)) snprintf(excluded, sizeof excluded, "%.1g", r->excluded_rise);
    if (isfinite(r->energy)) snprintf(energy, sizeof energy, "%.1g", r->energy);
    if (isfinite(r->deviation_S)) snprintf(left, sizeof left, "%.2g", 100 * r->deviation_S);
    uint64_t n = pal_safeguards_sum(&r->safeguards);
    if (n > 0)
        snprintf(safeguards, sizeof safeguards, " (%llu safeguards, %.3g ms)", (unsigned long long)n,
                 1e-6 * (double)r->safeguards.ns);
    printf("%-11s %-14s %9s %9s %9s %8.1f %7.2f  %s%s\n", r->name, pal_verdict_name(r->verdict), energy, excluded, left,
           r->simulated_s, r->took_s, r->diag, safeguards);
    if (r->verdict != PAL_VERDICT_FAILED) return;
    printf("%26s%s\n%26scriterion: %s\n", "", r->what, "", r->criterion);
}

static void print(const pal_scene *scene, const pal_robustness_report *report)
{
    printf("%s: %s\n\n", scene->title,
           report->rests ? "comes to rest by itself"
           : report->led ? "has a prescribed motion without end: compared with an unloaded run"
                         : "DOES NOT COME TO REST by itself");
    printf("%-11s %-14s %9s %9s %9s %8s %7s  %s\n", "case", "verdict", "energy +", "excluded", "% S left", "sim s",
           "cpu s", "what happened");
    for (int k = 0; k < report->n; k++) print_result(&report->result[k]);
    char collapsed[40] = "";
    if (report->n_collapsed > 0) snprintf(collapsed, sizeof collapsed, " %d collapsed,", report->n_collapsed);
    printf("\n%d passed,%s %d failed, %d undecided, %d do not apply; %.1f s of processor time\n", report->n_passed,
           collapsed, report->n_failed, report->n_undecided, report->n_skipped, report->took_s);
}

static void list_cases(char *text, size_t n_byte)
{
    size_t used = 0;
    for (int k = 0; k < pal_robustness_case_count() && used < n_byte; k++)
        used += (size_t)snprintf(text + used, n_byte - used, "  %-11s %s\n", pal_robustness_case_name(k),
                                 pal_robustness_case_about(k));
}

int command_robustness(int argc, char **argv)
{
    static char about[4096];
    const char *picture = NULL, *only = NULL;
    double seed = 1, seconds = 0;
    const pal_flag flag[] = {
        {"--only", "NAME", PAL_FLAG_TEXT, &only, 0, 0, "run this case alone"},
        {"--seed", "N", PAL_FLAG_NUMBER, &seed, 0, 1e15, "seed of the random numbers (1)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 1e6,
         "processor time of all cases together (60, more where a step is expensive)"},
        {"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0, "plot the energy over time, one plot for each case"}};
    int head =
        snprintf(about, sizeof about,
                 "Runs the cases that are known to break simulations on a scene, one after another, and reports what\n"
                 "happened. Each case has a criterion: finite numbers, bounded energy, return to rest after release.\n"
                 "Exit code 1 when a case fails its criterion or cannot be judged in the time.\n\nCASES\n");
    list_cases(about + head, sizeof about - (size_t)head);
    const pal_flag_table table = {.usage = "robustness SCENE [flags]",
                                  .about = about,
                                  .example = "palpate prepare --shape sphere --resolution 6 --model fem -o ball\n"
                                             "palpate robustness ball/scene.json --only meganewton --seconds 20\n",
                                  .flag = flag,
                                  .n_flag = sizeof flag / sizeof flag[0],
                                  .min_operand = 1,
                                  .max_operand = 1};
    pal_flag_common common;
    const char *word[1];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool known = !only;
    for (int k = 0; k < pal_robustness_case_count() && !known; k++) known = !strcmp(only, pal_robustness_case_name(k));
    if (!known) return pal_flags_wrong(&common, "there is no case \"%.60s\"", only);
    pal_robustness_options options;
    pal_robustness_default(&options);
    options.seed = (uint64_t)seed, options.max_cpu_s = seconds, options.only = only;
    options.progress = pal_report_continue, options.user = &common;
    pal_scene_input input = {0};
    pal_diagnostic diag = {""}, reason = {""};
    pal_robustness_report *report = calloc(1, sizeof *report);
    pal_err err = report ? pal_scene_input_open(word[0], &input, &diag) : PAL_ERR_MEMORY;
    const pal_scene *scene = input.studied.scene;
    if (!err && (err = pal_robustness_run(scene, &options, report, &reason)))
        pal_diagnostic_set(&diag, err, "%s: %s", word[0], reason.text);
    pal_report_progress(NULL, 0, &common);
    if (!err && picture) err = pal_robustness_picture(report, scene->title, picture, &diag);
    if (err) {
        code = pal_report_refusal(&common, err, &diag);
    } else {
        code = common.json ? pal_report_json(&common, as_json(scene, &options, report)) : 0;
        if (!common.json && !common.quiet && input.studied.summary[0]) printf("%s\n", input.studied.summary);
        if (!common.json && !common.quiet) print(scene, report);
        if (code == 0 && report->n_failed + report->n_undecided > 0) code = 1;
    }
    pal_scene_input_close(&input);
    free(report);
    return code;
}
