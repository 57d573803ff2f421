/* `palpate solve`: a load case of a problem -> displacements, the error against a reference, files for other tools. */
#include "server/base/clock.h"
#include "server/base/hash.h"
#include "server/cli/report.h"
#include "server/cli/result_lines.h"
#include "server/cli/table.h"
#include "server/commands/commands.h"
#include "server/figure/plot.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/scene/problem_file.h"
#include "server/scene/scene_file.h"
#include "server/solve/convergence.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1200, WORDS = 400, ELEMENTS = 4 };

static const char about[] =
    "Solves a load case with finite elements on the voxels of a surface and compares displacements with a\n"
    "reference. PROBLEM.json has the format palpate-reference-1: surface, materials, supports, load cases,\n"
    "references (every key: server/scene/problem_file.h). --case names a load case, which is compared with the\n"
    "reference of the same kinematics, E and nu if there is one; or a reference, which determines load case, law,\n"
    "E and nu.\n"
    "\n"
    "Several resolutions or elements, separated by commas, give a table: error, observed order of convergence\n"
    "from one resolution to the next, change of displacement between them, order and error estimated from the\n"
    "changes (Richardson extrapolation), seconds.\n";

/* the values of --element and --resolution */
typedef struct lists {
    int n_element, n_resolution;
    const char *element[ELEMENTS];
    int max_resolution[ELEMENTS]; /* of the element */
    int resolution[PAL_CONVERGENCE_MAX];
} lists;

typedef struct arguments {
    const char *problem, *load_case, *kinematics, *law, *element, *resolution, *samples, *fill, *align, *cut, *support,
        *linear, *free, *folder, *vtk, *csv, *plot;
    lists list;
    pal_shard_flags shard;
    pal_solve_options solve;
} arguments;

/* what is solved, and what it is compared with */
typedef struct study {
    pal_problem *problem;
    const pal_problem_case *load_case;
    const pal_problem_reference *reference; /* NULL: none */
    const char *samples_file;               /* NULL: none */
    pal_samples samples;
    pal_surface surface;
    pal_solution *solution;
    pal_solve_result result;
    double rms_percent, max_percent, total_s;
    char file[2][PATH];
    int n_file;
} study;

/* ---- lists of elements and resolutions ---- */

static const char *const known[ELEMENTS] = {"hex8_bbar", "hex8", "tet4", "tet10"};

static bool wrong(pal_diagnostic *diag, const char *flag, const char *word, const char *what)
{
    PAL_REFUSE(diag, "%s: %.40s %s", flag, word[0] ? word : "\"\"", what);
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

static bool add_element(char *word, lists *out, pal_diagnostic *diag)
{
    char *limit_text = strchr(word, ':');
    int limit = 1024;
    if (limit_text) *limit_text++ = 0;
    if (limit_text && !read_resolution("--element", limit_text, &limit, diag)) return false;
    for (int k = 0; k < ELEMENTS; k++) {
        if (strcmp(word, known[k])) continue;
        for (int j = 0; j < out->n_element; j++)
            if (out->element[j] == known[k]) return wrong(diag, "--element", word, "is given twice");
        out->element[out->n_element] = known[k];
        out->max_resolution[out->n_element++] = limit;
        return true;
    }
    return wrong(diag, "--element", word, "is not hex8_bbar, hex8, tet4 or tet10");
}

static bool add_resolution(const char *word, lists *out, pal_diagnostic *diag)
{
    static const char flag[] = "--resolution";
    int n = 0, before = out->n_resolution > 0 ? out->resolution[out->n_resolution - 1] : 0;
    if (!read_resolution(flag, word, &n, diag)) return false;
    if (out->n_resolution == PAL_CONVERGENCE_MAX) return wrong(diag, flag, word, "is the 17th, at most 16 are allowed");
    if (n <= before) return wrong(diag, flag, word, "is not above the one before, they must ascend");
    out->resolution[out->n_resolution++] = n;
    return true;
}

/* element: "hex8_bbar,tet10:8", resolution: "8,16,32"; false: diag names the fault */
static bool read_lists(const char *element, const char *resolution, lists *out, pal_diagnostic *diag)
{
    char word[WORDS];
    *out = (lists){0};
    if (strlen(element) >= WORDS) return wrong(diag, "--element", element, "... is too long");
    if (strlen(resolution) >= WORDS) return wrong(diag, "--resolution", resolution, "... is too long");
    while (pal_flag_next_word(&element, word, sizeof word))
        if (!add_element(word, out, diag)) return false;
    while (pal_flag_next_word(&resolution, word, sizeof word))
        if (!add_resolution(word, out, diag)) return false;
    return true;
}

/* ---- choice of the load case ---- */

/* --law, or the law that --kinematics or the reference implies */
static const char *law_of(const arguments *args, const pal_problem_reference *reference)
{
    bool finite = args->kinematics ? !strcmp(args->kinematics, "finite") : reference && reference->finite;
    if (args->law) return args->law;
    if (!finite) return "linear";
    bool neo = !reference || !reference->finite || !strcmp(reference->law, "neo-hookean");
    return neo ? "neo_hookean" : "corotational";
}

static bool same(double a, double b)
{
    return fabs(a - b) <= 1e-9 * fabs(b);
}

/* is the reference of this load case, kinematics, E and nu? */
static bool matches(const study *s, const arguments *args, const pal_problem_reference *r)
{
    const pal_problem_material *m = &s->problem->material[0];
    double young = isnan(r->young_Pa) ? m->young_Pa : r->young_Pa;
    double poisson = isnan(r->poisson) ? m->poisson : r->poisson;
    return !strcmp(r->load_case, s->load_case->id) && r->finite == (strcmp(args->solve.law, "linear") != 0) &&
           same(isnan(args->solve.young_Pa) ? m->young_Pa : args->solve.young_Pa, young) &&
           same(isnan(args->solve.poisson) ? m->poisson : args->solve.poisson, poisson);
}

/* --case -> load case, law, E, nu and reference */
static pal_err choose(study *s, arguments *args, pal_diagnostic *diag)
{
    const pal_problem *p = s->problem;
    const char *id = args->load_case ? args->load_case : p->n_case == 1 ? p->load_case[0].id : NULL;
    const pal_problem_reference *named = id ? pal_problem_reference_find(p, id) : NULL;
    s->load_case = named ? pal_problem_case_find(p, named->load_case) : id ? pal_problem_case_find(p, id) : NULL;
    if (!s->load_case) return pal_problem_refuse_case(s->problem, "--case", id, diag);
    args->solve.law = law_of(args, named);
    if (named && isnan(args->solve.young_Pa)) args->solve.young_Pa = named->young_Pa;
    if (named && isnan(args->solve.poisson)) args->solve.poisson = named->poisson;
    s->samples_file = args->samples;
    if (args->samples) return PAL_ERR_OK;
    s->reference = named;
    for (int k = 0; k < p->n_reference && !named; k++) {
        const pal_problem_reference *r = &p->reference[k];
        if (!matches(s, args, r)) continue;
        if (!s->reference || !strcmp(r->law, "neo-hookean")) s->reference = r;
    }
    if (s->reference) s->samples_file = s->reference->file;
    return PAL_ERR_OK;
}

static pal_err compare(study *s, pal_diagnostic *diag)
{
    if (!s->samples_file) return PAL_ERR_OK;
    double *u = malloc(3 * (size_t)s->samples.n * sizeof *u);
    if (!u) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d samples", s->samples.n);
    for (int k = 0; k < s->samples.n; k++) pal_solution_at(s->solution, s->samples.x + 3 * k, u + 3 * k);
    pal_samples_error(&s->samples, u, &s->rms_percent, &s->max_percent);
    free(u);
    return PAL_ERR_OK;
}

static pal_err write_files(study *s, const arguments *args, pal_diagnostic *diag)
{
    if (args->folder) PAL_TRY(pal_scene_make_folder(args->folder, diag));
    for (int vtk = 0; vtk < 2; vtk++) {
        const char *given = vtk ? args->vtk : args->csv, *path = given ? given : s->file[s->n_file];
        if (!given && !args->folder) continue;
        if (given)
            snprintf(s->file[s->n_file], PATH, "%s", given);
        else
            snprintf(s->file[s->n_file], PATH, "%s/solution.%s", args->folder, vtk ? "vtk" : "csv");
        PAL_TRY(vtk ? pal_solution_vtk(s->solution, path, diag) : pal_solution_csv(s->solution, path, diag));
        s->n_file++;
    }
    return PAL_ERR_OK;
}

static pal_err read_all(study *s, arguments *args, pal_diagnostic *diag)
{
    PAL_TRY(pal_problem_read(args->problem, &s->problem, diag));
    PAL_TRY(choose(s, args, diag));
    if (s->samples_file) PAL_TRY(pal_samples_read(s->samples_file, &s->samples, diag));
    pal_mesh_file_options file = {.unit_m = s->problem->unit_m, .weld = PAL_MESH_WELD};
    pal_surface_report report = {0};
    return pal_mesh_file_read(s->problem->surface, &file, &s->surface, &report, NULL, NULL, diag);
}

static pal_err work(study *s, const arguments *args, pal_diagnostic *diag)
{
    pal_err err = pal_solve(s->problem, s->load_case, &s->surface, &args->solve, &s->solution, &s->result, diag);
    if (err) return pal_diagnostic_prefix(diag, err, args->problem);
    PAL_TRY(compare(s, diag));
    return write_files(s, args, diag);
}

/* ---- report ---- */

static cJSON *seconds_json(const pal_solve_result *r, double total_s)
{
    return PAL_JSON({"prepare", JSON_NUMBER(r->prepare_s)}, {"assemble", JSON_NUMBER(r->assemble_s)},
                    {"factor", JSON_NUMBER(r->factor_s)}, {"solve", JSON_NUMBER(r->solve_s)},
                    {"total", JSON_NUMBER(total_s)});
}

static cJSON *as_json(const study *s, const arguments *args)
{
    const pal_solve_result *r = &s->result;
    const pal_problem_reference *reference = s->reference;
    bool compared = s->samples_file != NULL;
    return PAL_JSON(
        {"ok", JSON_BOOL(true)}, {"problem", JSON_TEXT(s->problem->name)}, {"case", JSON_TEXT(s->load_case->id)},
        {"reference", reference ? JSON_TEXT(reference->id) : cJSON_CreateNull()},
        {"element", JSON_TEXT(args->solve.element)}, {"law", JSON_TEXT(args->solve.law)},
        {"resolution", JSON_NUMBER(args->solve.voxel.resolution)}, {"fill", JSON_BOOL(args->solve.voxel.fill)},
        {"rms_percent", pal_json_or_null(compared ? s->rms_percent : NAN)},
        {"max_percent", pal_json_or_null(compared ? s->max_percent : NAN)},
        {"reference_rms_percent", pal_json_or_null(reference ? 100 * reference->estimated_rms : NAN)},
        {"samples", JSON_NUMBER(s->samples.n)}, {"nodes", JSON_NUMBER(r->n_node)},
        {"elements", JSON_NUMBER(r->n_element)}, {"dof", JSON_NUMBER(r->n_dof)},
        {"held_nodes", JSON_NUMBER(r->n_fixed)}, {"iterations", JSON_NUMBER(r->n_newton)},
        {"cg_iterations", JSON_NUMBER(r->n_cg)}, {"residual", JSON_NUMBER(r->residual)},
        {"voxel_m", JSON_NUMBER(r->edge_m)}, {"volume_m3", JSON_NUMBER(r->volume_m3)},
        {"load_area_m2", cJSON_CreateDoubleArray(r->area_m2, s->load_case->n_load)},
        {"load_N", cJSON_CreateDoubleArray(r->load_N, 3)}, {"reaction_N", cJSON_CreateDoubleArray(r->reaction_N, 3)},
        {"work_J", JSON_NUMBER(r->work_J)}, {"energy_J", JSON_NUMBER(r->energy_J)},
        {"max_displacement_m", JSON_NUMBER(r->max_m)}, {"poisson_clamped", JSON_BOOL(r->clamped)},
        {"files", pal_json_texts(s->file[0], PATH, s->n_file)}, {"seconds", seconds_json(r, s->total_s)});
}

static void print(const study *s, const arguments *args)
{
    const pal_solve_result *r = &s->result;
    printf("%s, load case %s: %s, %s, %d nodes, %d elements of %g m, %d unknowns\n", s->problem->name, s->load_case->id,
           args->solve.element, args->solve.law, r->n_node, r->n_element, r->edge_m, r->n_dof);
    if (r->clamped) printf("a Poisson ratio above 0.4999 was taken as 0.4999\n");
    printf("%d Newton iteration%s", r->n_newton, r->n_newton == 1 ? "" : "s");
    if (r->n_cg > 0) printf(" with %d conjugate gradients", r->n_cg);
    printf(", residual %.1e; largest displacement %.6g m, work of the loads %.6g J, elastic energy %.6g J\n",
           r->residual, r->max_m, r->work_J, r->energy_J);
    printf("loads (%.4g, %.4g, %.4g) N, supports (%.4g, %.4g, %.4g) N\n", r->load_N[0], r->load_N[1], r->load_N[2],
           r->reaction_N[0], r->reaction_N[1], r->reaction_N[2]);
    if (s->samples_file)
        printf("against %s (%d points): RMS %.3f %%, largest %.3f %% of the largest displacement\n",
               s->reference ? s->reference->id : s->samples_file, s->samples.n, s->rms_percent, s->max_percent);
    printf("seconds: prepare %.3f, assemble %.3f, factor %.3f, solve %.3f, total %.3f\n", r->prepare_s, r->assemble_s,
           r->factor_s, r->solve_s, s->total_s);
    for (int k = 0; k < s->n_file; k++) printf("wrote %s\n", s->file[k]);
}

/* ---- a table ---- */

/* One convergence series for each element (solve/convergence.h). Plots: the error over nodes and, in a second file,
 * over seconds; the error is against the reference, or the Richardson estimate where there is none. */
typedef struct series {
    pal_convergence_point point[PAL_CONVERGENCE_MAX];
    int n;
} series;

static pal_err solve_all(const study *s, const arguments *args, series *out, pal_diagnostic *diag)
{
    for (int e = 0; e < args->list.n_element; e++) {
        pal_solve_options options = args->solve;
        int n = 0;
        options.element = args->list.element[e];
        while (n < args->list.n_resolution && args->list.resolution[n] <= args->list.max_resolution[e]) n++;
        if (n == 0) continue;
        pal_diagnostic reason = {""};
        pal_err err =
            pal_convergence(s->problem, s->load_case, &s->surface, &options, s->samples_file ? &s->samples : NULL,
                            args->list.resolution, n, out[e].point, &out[e].n, &reason);
        if (err)
            return pal_diagnostic_set(diag, err, "%s: %s at resolution %d: %s", s->problem->path, args->list.element[e],
                                      args->list.resolution[out[e].n], reason.text);
    }
    return PAL_ERR_OK;
}

/* ---- shards: a result is one resolution of one element. Its change of displacement needs the resolution before, which
 * is solved as well, at about an eighth of the cost where resolutions double ---- */

static cJSON *point_json(const pal_convergence_point *p)
{
    const pal_solve_result *r = &p->result;
    return PAL_JSON({"resolution", JSON_NUMBER(p->resolution)}, {"rms_percent", pal_json_exact(p->rms_percent)},
                    {"max_percent", pal_json_exact(p->max_percent)},
                    {"change_percent", pal_json_exact(p->change_percent)}, {"nodes", JSON_NUMBER(r->n_node)},
                    {"elements", JSON_NUMBER(r->n_element)}, {"dof", JSON_NUMBER(r->n_dof)},
                    {"iterations", JSON_NUMBER(r->n_newton)}, {"cg_iterations", JSON_NUMBER(r->n_cg)},
                    {"voxel_m", pal_json_exact(r->edge_m)}, {"seconds", seconds_json(r, r->total_s)});
}

static int count_of(const cJSON *o, const char *key)
{
    const double value = pal_result_number(o, key);
    return value >= 0 && value <= INT_MAX ? (int)value : 0;
}

/* the inverse of point_json */
static pal_convergence_point point_read(const cJSON *o)
{
    const cJSON *seconds = cJSON_GetObjectItemCaseSensitive(o, "seconds");
    return (pal_convergence_point){.resolution = count_of(o, "resolution"),
                                   .rms_percent = pal_result_number(o, "rms_percent"),
                                   .max_percent = pal_result_number(o, "max_percent"),
                                   .change_percent = pal_result_number(o, "change_percent"),
                                   .result = {.n_node = count_of(o, "nodes"),
                                              .n_element = count_of(o, "elements"),
                                              .n_dof = count_of(o, "dof"),
                                              .n_newton = count_of(o, "iterations"),
                                              .n_cg = count_of(o, "cg_iterations"),
                                              .edge_m = pal_result_number(o, "voxel_m"),
                                              .prepare_s = pal_result_number(seconds, "prepare"),
                                              .assemble_s = pal_result_number(seconds, "assemble"),
                                              .factor_s = pal_result_number(seconds, "factor"),
                                              .solve_s = pal_result_number(seconds, "solve"),
                                              .total_s = pal_result_number(seconds, "total")}};
}

/* hash of the files and of every option that a number depends on */
static uint64_t input_of(const study *s, const arguments *args)
{
    const pal_solve_options *o = &args->solve;
    const char *word[] = {s->load_case->id, o->law,    args->element, args->resolution, args->fill,
                          args->align,      args->cut, args->linear,  args->free,       args->support};
    char text[300];
    uint64_t hash = pal_result_input_file(PAL_HASH_START, args->problem);
    hash = pal_result_input_file(hash, s->problem->surface);
    if (s->samples_file) hash = pal_result_input_file(hash, s->samples_file);
    for (size_t k = 0; k < sizeof word / sizeof *word; k++)
        hash = pal_hash_bytes(hash, word[k] ? word[k] : "", strlen(word[k] ? word[k] : "") + 1);
    int n = snprintf(text, sizeof text, "%a %a %a %a %a %d", o->young_Pa, o->poisson, o->tolerance, o->twist,
                     o->voxel.min_fill, o->split);
    return pal_hash_bytes(hash, text, (size_t)n);
}

/* result `index`, resolution k of an element: from the lines, or solved and put there */
static pal_err take_point(const study *s, const arguments *args, pal_result_lines *lines, int index, int e, int k,
                          pal_convergence_point *out, pal_diagnostic *diag)
{
    const cJSON *stored = pal_result_lines_find(lines, index);
    pal_convergence_point two[2];
    pal_solve_options options = args->solve;
    pal_diagnostic reason = {""};
    const int first = k > 0 ? k - 1 : 0;
    if (stored) *out = point_read(stored);
    if (stored || !pal_result_lines_own(lines, index)) return PAL_ERR_OK;
    options.element = args->list.element[e];
    pal_err err = pal_convergence(s->problem, s->load_case, &s->surface, &options, s->samples_file ? &s->samples : NULL,
                                  args->list.resolution + first, k - first + 1, two, NULL, &reason);
    if (err)
        return pal_diagnostic_set(diag, err, "%s: %s at resolution %d: %s", s->problem->path, options.element,
                                  args->list.resolution[k], reason.text);
    *out = two[k - first];
    return pal_result_lines_put(lines, index, point_json(out), diag);
}

static pal_err solve_lines(const study *s, const arguments *args, series *out, pal_diagnostic *diag)
{
    const pal_shard_flags *flags = &args->shard;
    pal_result_lines *lines = NULL;
    int n = 0;
    for (int e = 0; e < args->list.n_element; e++) {
        int *n_point = &out[e].n;
        while (*n_point < args->list.n_resolution && args->list.resolution[*n_point] <= args->list.max_resolution[e])
            ++*n_point;
        n += *n_point;
    }
    const pal_result_list list = {"solve", input_of(s, args), n};
    pal_err err = flags->merge ? pal_result_lines_merge(flags->merge, &list, &lines, diag)
                               : pal_result_lines_open(flags->folder, &list, flags->index, flags->n, &lines, diag);
    if (!err && flags->merge) err = pal_result_lines_complete(lines, n, diag);
    for (int e = 0, index = 0; e < args->list.n_element && !err; e++) {
        for (int k = 0; k < out[e].n && !err; k++)
            err = take_point(s, args, lines, index++, e, k, &out[e].point[k], diag);
        if (!err && flags->merge) pal_convergence_orders(out[e].point, out[e].n);
    }
    pal_result_lines_close(lines);
    return err;
}

/* over nodes, or over seconds */
static pal_err draw(const study *s, const arguments *args, const series *all, bool seconds, const char *path,
                    pal_diagnostic *diag)
{
    double x[ELEMENTS][PAL_CONVERGENCE_MAX], y[ELEMENTS][PAL_CONVERGENCE_MAX], guide_x[2] = {0}, guide_y[2] = {0};
    char title[220];
    const char *id = s->reference ? s->reference->id : s->load_case->id, *law = args->solve.law;
    bool named = strstr(id, law) != NULL; /* the reference names the law */
    snprintf(title, sizeof title, "%s: %s%s%s", s->problem->name, id, named ? "" : ", ", named ? "" : law);
    pal_plot plot = {.title = title,
                     .x_label = seconds ? "seconds, from surface to displacements" : "nodes",
                     .y_label = s->samples_file ? "RMS error, % of the largest displacement" : "estimated RMS error, %",
                     .log_x = true,
                     .log_y = true};
    for (int e = 0; e < args->list.n_element; e++) {
        const series *one = &all[e];
        for (int k = 0; k < one->n; k++) {
            x[e][k] = seconds ? one->point[k].result.total_s : one->point[k].result.n_node;
            y[e][k] = s->samples_file ? one->point[k].rms_percent : one->point[k].estimate_percent;
        }
        plot.curve[plot.n_curve++] = (pal_curve){.name = args->list.element[e], .n = one->n, .x = x[e], .y = y[e]};
    }
    /* a guide of order 2 in h, below the first curve */
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

/* the rows on stdout or in the object of --json */
static cJSON *show_table(pal_flag_common *common, const study *s, const arguments *args, const series *all,
                         const char *const file[2])
{
    const char *name = s->reference ? s->reference->id : NULL;
    pal_table t = {.silent = common->json || common->quiet};
    pal_report_progress(NULL, 0, common);
    t.root = PAL_JSON({"ok", JSON_BOOL(true)}, {"problem", JSON_TEXT(s->problem->name)},
                      {"case", JSON_TEXT(s->load_case->id)}, {"reference", name ? JSON_TEXT(name) : cJSON_CreateNull()},
                      {"law", JSON_TEXT(args->solve.law)}, {"fill", JSON_BOOL(args->solve.voxel.fill)});
    if (s->samples_file)
        pal_table_note(&t, "%s, load case %s, %s, against %s (%d points)", s->problem->name, s->load_case->id,
                       args->solve.law, name ? name : s->samples_file, s->samples.n);
    else
        pal_table_note(&t, "%s, load case %s, %s, without a reference", s->problem->name, s->load_case->id,
                       args->solve.law);
    pal_table_list(&t, "table");
    for (int e = 0; e < args->list.n_element; e++)
        for (int k = 0; k < all[e].n; k++) {
            const pal_convergence_point *p = &all[e].point[k];
            const pal_solve_result *r = &p->result;
            TABLE_ROW(&t, TEXT("element", "element", -10, args->list.element[e]),
                      NUMBER("resolution", "resolution", 10, 0, p->resolution), VALUE("voxel_m", r->edge_m),
                      NUMBER("nodes", "nodes", 8, 0, r->n_node), VALUE("elements", r->n_element),
                      VALUE("dof", r->n_dof), NUMBER("rms_percent", "RMS %", 8, 3, p->rms_percent),
                      NUMBER("max_percent", "max %", 8, 3, p->max_percent), NUMBER("order", "order", 6, 2, p->order),
                      NUMBER("change_percent", "change %", 9, 3, p->change_percent),
                      NUMBER("change_order", "order", 6, 2, p->change_order),
                      NUMBER("estimate_percent", "estimate %", 10, 3, p->estimate_percent),
                      VALUE("iterations", r->n_newton), VALUE("cg_iterations", r->n_cg),
                      NUMBER(NULL, "factor s", 9, 3, r->factor_s), NUMBER(NULL, "total s", 9, 3, r->total_s),
                      TREE("seconds", seconds_json(r, r->total_s)));
        }
    for (int k = 0; k < 2 && file[k]; k++) pal_table_note(&t, "wrote %s", file[k]);
    return PAL_JSON_ADD(t.root, {"files", cJSON_CreateStringArray(file, file[0] ? 2 : 0)});
}

static int run_table(pal_flag_common *common, const study *s, const arguments *args)
{
    series *all = calloc(ELEMENTS, sizeof *all);
    pal_diagnostic diag = {""};
    char second[PATH];
    const char *file[2] = {NULL, NULL};
    pal_err err = !all                                     ? PAL_ERR_MEMORY
                  : args->shard.shard || args->shard.merge ? solve_lines(s, args, all, &diag)
                                                           : solve_all(s, args, all, &diag);
    if (args->shard.shard) {
        int code = pal_report_end(common, err, &diag, err || !common->json ? NULL : PAL_JSON({"ok", JSON_BOOL(true)}));
        if (!err && !common->json && !common->quiet)
            printf("shard %d of %d: its results are in %s\n", args->shard.index, args->shard.n, args->shard.folder);
        free(all);
        return code;
    }
    if (args->plot && !err) {
        /* "_seconds" before ".svg" */
        size_t n = strlen(args->plot), stem = n > 4 && !strcmp(args->plot + n - 4, ".svg") ? n - 4 : n;
        snprintf(second, PATH, "%.*s_seconds%s", (int)stem, args->plot, args->plot + stem);
        err = draw(s, args, all, false, args->plot, &diag);
        if (!err) err = draw(s, args, all, true, second, &diag);
        file[0] = args->plot, file[1] = second;
    }
    int code = pal_report_end(common, err, &diag, err ? NULL : show_table(common, s, args, all, file));
    free(all);
    return code;
}

/* a table: several elements or resolutions, or a plot of them */
static bool is_table(const arguments *args)
{
    return args->list.n_element * args->list.n_resolution > 1 || args->plot || args->shard.shard || args->shard.merge;
}

static int run(pal_flag_common *common, arguments *args)
{
    study s = {0};
    pal_diagnostic diag = {""};
    double start = pal_clock_s();
    args->solve.progress = pal_report_continue;
    args->solve.user = common;
    pal_err err = read_all(&s, args, &diag);
    bool table = !err && is_table(args);
    if (!err && !table) err = work(&s, args, &diag);
    s.total_s = pal_clock_s() - start;
    int code = table ? run_table(common, &s, args)
                     : pal_report_end(common, err, &diag, err || !common->json ? NULL : as_json(&s, args));
    if (!err && !table && !common->json && !common->quiet) print(&s, args);
    pal_solution_free(s.solution);
    pal_surface_free(&s.surface);
    pal_samples_free(&s.samples);
    free(s.problem);
    return code;
}

/* flags that exclude each other; NULL: none */
static const char *check_flags(const arguments *args)
{
    if (args->kinematics && args->law && !strcmp(args->kinematics, "linear") != !strcmp(args->law, "linear"))
        return "--kinematics and --law: linear goes with linear only";
    if (is_table(args) && (args->folder || args->csv || args->vtk))
        return "-o, --csv and --vtk: are for one element and one resolution";
    if (args->plot && args->shard.shard) return "--plot: goes with --merge, not with --shard";
    return NULL;
}

int command_solve(int argc, char **argv)
{
    arguments args = {.element = "hex8_bbar", .resolution = "32", .solve = {.young_Pa = NAN, .poisson = NAN}};
    pal_solve_options *o = &args.solve;
    const pal_flag flag[] = {
        {"--case", "ID", PAL_FLAG_TEXT, &args.load_case, 0, 0, "load case or reference (the only load case)"},
        {"--kinematics", "linear|finite", PAL_FLAG_WORD, &args.kinematics, 0, 0,
         "strain measure (the reference's, or linear)"},
        {"--law", "linear|corotational|neo_hookean", PAL_FLAG_WORD, &args.law, 0, 0,
         "material law (linear, or neo_hookean when finite)"},
        {"--element", "LIST", PAL_FLAG_TEXT, &args.element, 0, 0,
         "hex8_bbar, hex8, tet4 or tet10, or several separated by commas; tet10:16 stops at resolution 16 (hex8_bbar)"},
        {"--resolution", "LIST", PAL_FLAG_TEXT, &args.resolution, 0, 0,
         "voxels along the longest axis, 1 to 1024, or several in ascending order, separated by commas (32)"},
        {"--fill", "on|off", PAL_FLAG_WORD, &args.fill, 0, 0,
         "on: a voxel that the surface cuts has the stiffness of what is inside; off: voxels at least half filled "
         "count\n"
         "whole (on)"},
        {"--least-fill", "SHARE", PAL_FLAG_NUMBER, &o->voxel.min_fill, 1e-6, 1,
         "cut voxels with a smaller share inside are dropped (0.02 of hexahedra by moments;\n"
         "else 0.25 with fill, or 0.02 where that would lose 2.5 % of the volume; 0.5 without)"},
        {"--align", "on|off", PAL_FLAG_WORD, &args.align, 0, 0,
         "on: voxels are shifted so that their faces lie where a support, else a material, ends inside the body;\n"
         "off: they begin at the bounding box of the surface (on)"},
        {"--cut", "moments|share", PAL_FLAG_WORD, &args.cut, 0, 0,
         "hexahedra that the surface cuts are integrated over their inside (moment fitting), or it is spread over them "
         "as in a live body (moments)"},
        {"--support", "surface|nodes", PAL_FLAG_WORD, &args.support, 0, 0,
         "surface: hexahedra stick to the surface that a support's region cuts out of the body, which voxels need not\n"
         "fit; nodes: the nodes in the region are held (surface)"},
        {"--twist", "FACTOR", PAL_FLAG_NUMBER, &o->twist, 0.01, 1,
         "of the stiffness against twists of hex8_bbar, linear or corotational (0.1; 1: as integrated)"},
        {"--split", "K", PAL_FLAG_COUNT, &o->split, 1, 16,
         "every voxel is solved as K x K x K elements of its fill: what error remains is that of the voxel border (1)"},
        {"--samples", "U.csv", PAL_FLAG_TEXT, &args.samples, 0, 0,
         "compare at these points: CSV x,y,z,ux,uy,uz in m (the reference's)"},
        {"--nu", "NU", PAL_FLAG_NUMBER, &o->poisson, -1e300, 1e300, "Poisson's ratio (the problem's)"},
        {"--young", "PA", PAL_FLAG_NUMBER, &o->young_Pa, -1e300, 1e300, "Young's modulus (the problem's)"},
        {"--tolerance", "T", PAL_FLAG_NUMBER, &o->tolerance, 1e-14, 0.1, "residual relative to the loads (1e-8)"},
        {"--linear", "direct|pcg", PAL_FLAG_WORD, &args.linear, 0, 0, "solver of the linear systems (chosen by size)"},
        {"--free", "refuse|inertia_relief", PAL_FLAG_WORD, &args.free, 0, 0,
         "a body without supports: refuse it, or balance the loads by its inertia (refuse)"},
        {"-o", "DIR", PAL_FLAG_TEXT, &args.folder, 0, 0, "write DIR/solution.csv and DIR/solution.vtk"},
        {"--csv", "FILE", PAL_FLAG_TEXT, &args.csv, 0, 0, "write x,y,z,ux,uy,uz of all nodes, m"},
        {"--vtk", "FILE", PAL_FLAG_TEXT, &args.vtk, 0, 0,
         "write displacement and stress as a legacy VTK file, or XML where it ends with .vtu"},
        {"--plot", "FILE.svg", PAL_FLAG_TEXT, &args.plot, 0, 0,
         "plot error over nodes, and in FILE_seconds.svg error over seconds"},
        PAL_SHARD_FLAGS(args.shard, "row of the table"),
    };
    const pal_flag_table flags = {.usage = "solve PROBLEM.json --case ID [flags]",
                                  .about = about,
                                  .example = "palpate solve deploy/problems/beam.json --case tip --vtk tip.vtk\n"
                                             "palpate solve deploy/problems/beam.json --case tip --resolution 8,16 "
                                             "--element hex8_bbar,tet4 --plot error.svg\n",
                                  PAL_FLAGS(flag),
                                  .operands = {1, 1}};
    pal_flag_common common;
    int n = 0, code = pal_flags_parse(&flags, argc, argv, &common, &args.problem, &n);
    if (code >= 0) return code;
    pal_diagnostic diag = {""};
    if (!read_lists(args.element, args.resolution, &args.list, &diag)) return pal_flags_wrong(&common, "%s", diag.text);
    if (pal_shard_flags_check(&args.shard, &diag)) return pal_flags_wrong(&common, "%s", diag.text);
    const char *sentence = check_flags(&args);
    if (sentence) return pal_flags_wrong(&common, "%s", sentence);
    o->element = args.list.element[0];
    o->voxel.resolution = args.list.resolution[0];
    o->voxel.fill = !args.fill || !strcmp(args.fill, "on");
    o->voxel.align = !args.align || !strcmp(args.align, "on");
    o->shares = args.cut && !strcmp(args.cut, "share");
    o->hold_nodes = args.support && !strcmp(args.support, "nodes");
    o->linear = args.linear;
    o->inertia_relief = args.free && !strcmp(args.free, "inertia_relief");
    return run(&common, &args);
}
