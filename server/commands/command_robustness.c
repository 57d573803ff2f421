/* `palpate robustness SCENE`: the cases of server/robustness on a scene, what happened and whether that meets the
 * criterion. Exit code 1 when a case failed or could not be judged. */
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/scene_input.h"
#include "server/figure/svg.h"
#include "server/robustness/robustness.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static cJSON *result_json(const pal_robustness_result *r)
{
    static const char *const verdict[] = {"passed", "failed", "undecided", "skipped", "collapsed"};
    const pal_safeguards *s = &r->safeguards;
    cJSON *safeguards =
        PAL_JSON({"capped", JSON_NUMBER(s->n_capped)}, {"clamped", JSON_NUMBER(s->n_clamped)},
                 {"mass_scaled", JSON_NUMBER(s->n_mass_scaled)}, {"inverted", JSON_NUMBER(s->n_inversion)},
                 {"search", JSON_NUMBER(s->n_search)}, {"tool_reset", JSON_NUMBER(s->n_tool_reset)},
                 {"stopped", JSON_NUMBER(s->n_stopped)}, {"ns", JSON_NUMBER(s->ns)});
    return PAL_JSON({"name", JSON_TEXT(r->name)}, {"what", JSON_TEXT(r->what)}, {"criterion", JSON_TEXT(r->criterion)},
                    {"verdict", JSON_TEXT(verdict[r->verdict])}, {"happened", JSON_TEXT(r->diag)},
                    {"finite", JSON_BOOL(r->finite)}, {"stopped", JSON_BOOL(r->frozen)},
                    {"energy_excess", pal_json_finite(r->energy)}, {"energy_limit", pal_json_finite(r->limit)},
                    {"energy_excluded", pal_json_finite(r->excluded_rise)},
                    {"deviation_S", pal_json_finite(r->deviation_S)}, {"return_s", pal_json_finite(r->return_s)},
                    {"simulated_s", pal_json_finite(r->simulated_s)}, {"cpu_s", pal_json_finite(r->took_s)},
                    {"safeguards", safeguards});
}

static cJSON *as_json(const pal_scene *scene, const pal_robustness_options *options,
                      const pal_robustness_report *report)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < report->n; k++) cJSON_AddItemToArray(list, result_json(&report->result[k]));
    return PAL_JSON({"ok", JSON_BOOL(report->n_failed + report->n_undecided == 0)}, {"name", JSON_TEXT(scene->name)},
                    {"seed", JSON_NUMBER(options->seed)}, {"rests", JSON_BOOL(report->rests)},
                    {"settle_s", pal_json_finite(report->settle_s)}, {"cpu_s", pal_json_finite(report->took_s)},
                    {"passed", JSON_NUMBER(report->n_passed)}, {"collapsed", JSON_NUMBER(report->n_collapsed)},
                    {"failed", JSON_NUMBER(report->n_failed)}, {"undecided", JSON_NUMBER(report->n_undecided)},
                    {"skipped", JSON_NUMBER(report->n_skipped)}, {"cases", list});
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

/* ---- picture: x: simulated seconds; y: energy above that at rest as a share of its largest value ---- */

enum { COLUMNS = 4, WIDE = 250, HIGH = 170, LEFT = 46, TOP = 40, HEAD = 44, PLOT_WIDE = 180, PLOT_HIGH = 92 };

static const char *colour_of(pal_verdict verdict)
{
    static const char *const colour[] = {"#009e73", "#d55e00", "#e69f00", "#999999", "#cc79a7"};
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

int command_robustness(int argc, char **argv)
{
    static char about[4096];
    const char *picture = NULL, *only = NULL, *name, *of_case;
    double seed = 1, seconds = 0;
    const pal_flag flag[] = {
        {"--only", "NAME", PAL_FLAG_TEXT, &only, 0, 0, "run this case alone"},
        {"--seed", "N", PAL_FLAG_NUMBER, &seed, 0, 1e15, "seed of the random numbers (1)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 1e6,
         "processor time of all cases together (60, more where a step is expensive)"},
        {"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0, "plot the energy over time, one plot for each case"}};
    int used =
        snprintf(about, sizeof about,
                 "Runs the cases that are known to break simulations on a scene, one after another, and reports what\n"
                 "happened. Each case has a criterion: finite numbers, bounded energy, return to rest after release.\n"
                 "Exit code 1 when a case fails its criterion or cannot be judged in the time.\n\nCASES\n");
    for (int k = 0; (name = pal_robustness_case_name(k, &of_case)) && used < (int)sizeof about; k++)
        used += snprintf(about + used, sizeof about - (size_t)used, "  %-11s %s\n", name, of_case);
    const pal_flag_table table = {.usage = "robustness SCENE [flags]",
                                  .about = about,
                                  .example = "palpate prepare --shape sphere --resolution 6 --model fem -o ball\n"
                                             "palpate robustness ball/scene.json --only meganewton --seconds 20\n",
                                  PAL_FLAGS(flag),
                                  .operands = {1, 1}};
    pal_flag_common common;
    const char *word[1];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool known = !only;
    for (int k = 0; (name = pal_robustness_case_name(k, NULL)) && !known; k++) known = !strcmp(only, name);
    if (!known) return pal_flags_wrong(&common, "there is no case \"%.60s\"", only);
    pal_robustness_options options;
    pal_robustness_default(&options);
    options.seed = (uint64_t)seed, options.max_cpu_s = seconds, options.only = only;
    options.progress = pal_report_continue, options.user = &common;
    pal_scene_input input = {0};
    pal_diagnostic diag = {""};
    pal_robustness_report *report = calloc(1, sizeof *report);
    pal_err err = report ? pal_scene_input_open(word[0], &input, &diag) : PAL_ERR_MEMORY;
    const pal_scene *scene = input.studied.scene;
    if (!err) err = pal_diagnostic_prefix(&diag, pal_robustness_run(scene, &options, report, &diag), word[0]);
    if (!err && picture) err = draw(report, scene->title, picture, &diag);
    code = pal_report_end(&common, err, &diag, err || !common.json ? NULL : as_json(scene, &options, report));
    bool prints = !err && !common.json && !common.quiet;
    if (prints && input.studied.summary[0]) printf("%s\n", input.studied.summary);
    if (prints) print(scene, report);
    if (code == 0 && report->n_failed + report->n_undecided > 0) code = 1;
    pal_scene_input_close(&input);
    free(report);
    return code;
}
