/* One convergence series per element (solve/convergence.h). Plots: error over nodes, and in a second file over
 * seconds; the error is against the reference, or the Richardson estimate where there is none. */
#include "server/commands/convergence_report.h"

#include "server/figure/plot.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1200, WORDS = 400 };

typedef struct series {
    pal_convergence_point point[PAL_CONVERGENCE_MAX];
    int n;
} series;

static const char *const known[PAL_SOLVE_STUDY_ELEMENTS] = {"hex8_bbar", "hex8", "tet4", "tet10"};

static bool wrong(pal_diagnostic *diag, const char *flag, const char *word, const char *what)
{
    pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.40s %s", flag, word[0] ? word : "\"\"", what);
    for (char *c = diag->text; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = ' ';
    return false;
}

/* a whole number of 1 to 1024 and nothing else */
static bool read_resolution(const char *flag, const char *word, int *out, pal_diagnostic *diag)
{
    char *end;
    long n = strtol(word, &end, 10);
    if (end == word || *end) return wrong(diag, flag, word, "is not a whole number");
    *out = (int)n;
    return (n >= 1 && n <= 1024) || wrong(diag, flag, word, "is outside 1 .. 1024");
}

static bool add_element(char *word, pal_study_list *out, pal_diagnostic *diag)
{
    char *limit_text = strchr(word, ':');
    int limit = 1024;
    if (limit_text) *limit_text++ = 0;
    if (limit_text && !read_resolution("--element", limit_text, &limit, diag)) return false;
    for (int k = 0; k < PAL_SOLVE_STUDY_ELEMENTS; k++) {
        if (strcmp(word, known[k])) continue;
        for (int j = 0; j < out->n_element; j++)
            if (out->element[j] == known[k]) return wrong(diag, "--element", word, "is given twice");
        out->element[out->n_element] = known[k];
        out->max_resolution[out->n_element++] = limit;
        return true;
    }
    return wrong(diag, "--element", word, "is not hex8_bbar, hex8, tet4 or tet10");
}

static bool add_resolution(const char *word, pal_study_list *out, pal_diagnostic *diag)
{
    static const char flag[] = "--resolution";
    int n = 0, before = out->n_resolution > 0 ? out->resolution[out->n_resolution - 1] : 0;
    if (!read_resolution(flag, word, &n, diag)) return false;
    if (out->n_resolution == PAL_CONVERGENCE_MAX) return wrong(diag, flag, word, "is the 17th, at most 16 are allowed");
    if (n <= before) return wrong(diag, flag, word, "is not above the one before, they must ascend");
    out->resolution[out->n_resolution++] = n;
    return true;
}

/* the next word of a list with commas; NULL: none is left. Empty words are words */
static char *next_word(char **rest)
{
    char *word = *rest, *comma = word ? strchr(word, ',') : NULL;
    if (comma) *comma = 0;
    *rest = comma ? comma + 1 : NULL;
    return word;
}

bool pal_solve_study_parse(const char *element, const char *resolution, pal_study_list *out, pal_diagnostic *diag)
{
    char text[WORDS], *rest = text, *word;
    *out = (pal_study_list){0};
    if (strlen(element) >= WORDS) return wrong(diag, "--element", element, "... is too long");
    if (strlen(resolution) >= WORDS) return wrong(diag, "--resolution", resolution, "... is too long");
    strcpy(text, element);
    while ((word = next_word(&rest)))
        if (!add_element(word, out, diag)) return false;
    strcpy(rest = text, resolution);
    while ((word = next_word(&rest)))
        if (!add_resolution(word, out, diag)) return false;
    return true;
}

/* ---- work ---- */

static pal_err solve_all(const pal_solve_study *study, const pal_study_list *list, series *out, pal_diagnostic *diag)
{
    for (int e = 0; e < list->n_element; e++) {
        pal_solve_options options = *study->options;
        int n = 0;
        options.element = list->element[e];
        while (n < list->n_resolution && list->resolution[n] <= list->max_resolution[e]) n++;
        if (n == 0) continue;
        pal_diagnostic reason = {""};
        pal_err err = pal_convergence(study->problem, study->load_case, study->surface, &options, study->samples,
                                      list->resolution, n, out[e].point, &out[e].n, &reason);
        if (err)
            return pal_diagnostic_set(diag, err, "%s: %s at resolution %d: %s", study->problem->path, list->element[e],
                                      list->resolution[out[e].n], reason.text);
    }
    return PAL_ERR_OK;
}

/* the plotted error, per cent */
static double error_of(const pal_solve_study *study, const pal_convergence_point *p)
{
    return study->samples ? p->rms_percent : p->estimate_percent;
}

/* the second file's name: "_seconds" before ".svg" */
static void seconds_path(const char *plot, char out[PATH])
{
    size_t n = strlen(plot), stem = n > 4 && !strcmp(plot + n - 4, ".svg") ? n - 4 : n;
    snprintf(out, PATH, "%.*s_seconds%s", (int)stem, plot, plot + stem);
}

/* over nodes, or over seconds */
static pal_err draw(const pal_solve_study *study, const pal_study_list *list, const series *all, bool seconds,
                    const char *path, pal_diagnostic *diag)
{
    double x[PAL_SOLVE_STUDY_ELEMENTS][PAL_CONVERGENCE_MAX], y[PAL_SOLVE_STUDY_ELEMENTS][PAL_CONVERGENCE_MAX],
        guide_x[2] = {0}, guide_y[2] = {0};
    char title[220];
    const char *id = study->reference ? study->reference->id : study->load_case->id, *law = study->options->law;
    bool named = strstr(id, law) != NULL; /* the reference names the law */
    snprintf(title, sizeof title, "%s: %s%s%s", study->problem->name, id, named ? "" : ", ", named ? "" : law);
    pal_plot plot = {.title = title,
                     .x_label = seconds ? "seconds, from surface to displacements" : "nodes",
                     .y_label = study->samples ? "RMS error, % of the largest displacement" : "estimated RMS error, %",
                     .log_x = true,
                     .log_y = true};
    for (int e = 0; e < list->n_element; e++) {
        const series *s = &all[e];
        for (int k = 0; k < s->n; k++) {
            x[e][k] = seconds ? s->point[k].result.total_s : s->point[k].result.n_node;
            y[e][k] = error_of(study, &s->point[k]);
        }
        plot.curve[plot.n_curve++] = (pal_curve){.name = list->element[e], .n = s->n, .x = x[e], .y = y[e]};
    }
    /* a guide of order 2 in h, beneath the first curve */
    int last = all[0].n - 1;
    if (!seconds && last > 0 && y[0][last] > 0) {
        guide_x[0] = x[0][0], guide_x[1] = x[0][last];
        guide_y[1] = 0.6 * y[0][last];
        guide_y[0] = guide_y[1] * pow(x[0][last] / x[0][0], 2.0 / 3);
        plot.curve[plot.n_curve++] =
            (pal_curve){.name = "order 2 in h", .n = 2, .x = guide_x, .y = guide_y, .dashed = true, .bare = true};
    }
    return pal_plot_write(&plot, path, diag);
}

/* ---- report ---- */

static void put_point(cJSON *table, const char *element, const pal_convergence_point *p)
{
    const pal_solve_result *r = &p->result;
    cJSON *o = cJSON_CreateObject(), *seconds;
    cJSON_AddStringToObject(o, "element", element);
    cJSON_AddNumberToObject(o, "resolution", p->resolution);
    cJSON_AddNumberToObject(o, "voxel_m", r->edge_m);
    cJSON_AddNumberToObject(o, "nodes", r->n_node);
    cJSON_AddNumberToObject(o, "elements", r->n_element);
    cJSON_AddNumberToObject(o, "dof", r->n_dof);
    pal_json_add_or_null(o, "rms_percent", p->rms_percent);
    pal_json_add_or_null(o, "max_percent", p->max_percent);
    pal_json_add_or_null(o, "order", p->order);
    pal_json_add_or_null(o, "change_percent", p->change_percent);
    pal_json_add_or_null(o, "change_order", p->change_order);
    pal_json_add_or_null(o, "estimate_percent", p->estimate_percent);
    cJSON_AddNumberToObject(o, "iterations", r->n_newton);
    cJSON_AddNumberToObject(o, "cg_iterations", r->n_cg);
    seconds = cJSON_AddObjectToObject(o, "seconds");
    cJSON_AddNumberToObject(seconds, "prepare", r->prepare_s);
    cJSON_AddNumberToObject(seconds, "assemble", r->assemble_s);
    cJSON_AddNumberToObject(seconds, "factor", r->factor_s);
    cJSON_AddNumberToObject(seconds, "solve", r->solve_s);
    cJSON_AddNumberToObject(seconds, "total", r->total_s);
    cJSON_AddItemToArray(table, o);
}

static cJSON *as_json(const pal_solve_study *study, const pal_study_list *list, const series *all,
                      const char *const file[2])
{
    cJSON *o = cJSON_CreateObject();
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddStringToObject(o, "problem", study->problem->name);
    cJSON_AddStringToObject(o, "case", study->load_case->id);
    if (study->reference)
        cJSON_AddStringToObject(o, "reference", study->reference->id);
    else
        cJSON_AddNullToObject(o, "reference");
    cJSON_AddStringToObject(o, "law", study->options->law);
    cJSON_AddBoolToObject(o, "fill", study->options->fill);
    cJSON *table = cJSON_AddArrayToObject(o, "table"), *files = cJSON_AddArrayToObject(o, "files");
    for (int e = 0; e < list->n_element; e++)
        for (int k = 0; k < all[e].n; k++) put_point(table, list->element[e], &all[e].point[k]);
    for (int k = 0; k < 2 && file[k]; k++) cJSON_AddItemToArray(files, cJSON_CreateString(file[k]));
    return o;
}

/* a cell of the table; "-" when the number is not known */
static void print_cell(int width, const char *format, double number)
{
    char text[32] = "-";
    if (isfinite(number)) snprintf(text, sizeof text, format, number);
    printf(" %*s", width, text);
}

static void print(const pal_solve_study *study, const pal_study_list *list, const series *all,
                  const char *const file[2])
{
    printf("%s, load case %s, %s", study->problem->name, study->load_case->id, study->options->law);
    if (study->samples)
        printf(", against %s (%d points)\n", study->reference ? study->reference->id : study->samples_file,
               study->samples->n);
    else
        printf(", without a reference\n");
    printf("%-10s %10s %8s %8s %8s %6s %9s %6s %10s %9s %9s\n", "element", "resolution", "nodes", "RMS %", "max %",
           "order", "change %", "order", "estimate %", "factor s", "total s");
    for (int e = 0; e < list->n_element; e++)
        for (int k = 0; k < all[e].n; k++) {
            const pal_convergence_point *p = &all[e].point[k];
            printf("%-10s %10d %8d", list->element[e], p->resolution, p->result.n_node);
            print_cell(8, "%.3f", p->rms_percent);
            print_cell(8, "%.3f", p->max_percent);
            print_cell(6, "%.2f", p->order);
            print_cell(9, "%.3f", p->change_percent);
            print_cell(6, "%.2f", p->change_order);
            print_cell(10, "%.3f", p->estimate_percent);
            print_cell(9, "%.3f", p->result.factor_s);
            print_cell(9, "%.3f", p->result.total_s);
            printf("\n");
        }
    for (int k = 0; k < 2 && file[k]; k++) printf("wrote %s\n", file[k]);
}

int pal_solve_study_run(const pal_flag_common *common, const pal_solve_study *study, const pal_study_list *list)
{
    series *all = calloc(PAL_SOLVE_STUDY_ELEMENTS, sizeof *all);
    pal_diagnostic diag = {""};
    char second[PATH];
    const char *file[2] = {NULL, NULL};
    pal_err err = all ? solve_all(study, list, all, &diag) : PAL_ERR_MEMORY;
    if (study->plot && !err) {
        seconds_path(study->plot, second);
        err = draw(study, list, all, false, study->plot, &diag);
        if (!err) err = draw(study, list, all, true, second, &diag);
        file[0] = study->plot, file[1] = second;
    }
    pal_report_progress(NULL, 0, (void *)(uintptr_t)common);
    int code = err            ? pal_report_refusal(common, err, &diag)
               : common->json ? pal_report_json(common, as_json(study, list, all, file))
                              : 0;
    if (!err && !common->json && !common->quiet) print(study, list, all, file);
    free(all);
    return code;
}
