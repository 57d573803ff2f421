/* `palpate solve`: a load case of a problem -> displacements, the error against a reference, files for other tools. */
#include "server/base/clock.h"
#include "server/cli/flags.h"
#include "server/commands/commands.h"
#include "server/commands/convergence_report.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/problem_file.h"
#include "server/scene/scene_file.h"
#include "server/solve/solve.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1200 };

static const char about[] =
    "Solves a load case with finite elements on the voxels of a surface and compares displacements with a reference.\n"
    "PROBLEM.json has the format palpate-reference-1: surface, materials, supports, load cases, references (every "
    "key:\n"
    "server/scene/problem_file.h). --case names a load case, which is compared with the reference of the same\n"
    "kinematics, E and nu if there is one; or a reference, which determines load case, law, E and nu.\n"
    "\n"
    "Several resolutions or elements, separated by commas, give a table: error, observed order of convergence from "
    "one\n"
    "resolution to the next, change of displacement between them, order and error estimated from the changes\n"
    "(Richardson extrapolation), seconds.\n";

typedef struct arguments {
    const char *problem, *load_case, *kinematics, *law, *element, *resolution, *samples, *fill, *align, *linear, *free,
        *folder, *vtk, *csv, *plot;
    pal_study_list list;
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

/* ---- choice of the load case ---- */

static pal_err no_case(const study *s, const char *id, pal_diagnostic *diag)
{
    char list[320] = "";
    size_t n = 0;
    const pal_problem *p = s->problem;
    for (int k = 0; k < p->n_case + p->n_reference && n < sizeof list; k++)
        n += (size_t)snprintf(list + n, sizeof list - n, "%s%s", k ? ", " : "",
                              k < p->n_case ? p->load_case[k].id : p->reference[k - p->n_case].id);
    if (!id) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: --case is missing; known are %s", p->path, list);
    return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: there is no load case or reference \"%.40s\"; known are %s",
                              p->path, id, list);
}

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
    if (!s->load_case) return no_case(s, id, diag);
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

/* ---- work ---- */

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

static pal_err write_one(study *s, const char *path, bool vtk, pal_diagnostic *diag)
{
    PAL_TRY(vtk ? pal_solution_vtk(s->solution, path, diag) : pal_solution_csv(s->solution, path, diag));
    if (s->n_file < 2) snprintf(s->file[s->n_file++], PATH, "%s", path);
    return PAL_ERR_OK;
}

static pal_err write_files(study *s, const arguments *args, pal_diagnostic *diag)
{
    char csv[PATH], vtk[PATH];
    if (args->folder) {
        PAL_TRY(pal_scene_make_folder(args->folder, diag));
        snprintf(csv, sizeof csv, "%s/solution.csv", args->folder);
        snprintf(vtk, sizeof vtk, "%s/solution.vtk", args->folder);
        PAL_TRY(write_one(s, args->csv ? args->csv : csv, false, diag));
        return write_one(s, args->vtk ? args->vtk : vtk, true, diag);
    }
    if (args->csv) PAL_TRY(write_one(s, args->csv, false, diag));
    return args->vtk ? write_one(s, args->vtk, true, diag) : PAL_ERR_OK;
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
    pal_diagnostic reason = {""};
    pal_err err = pal_solve(s->problem, s->load_case, &s->surface, &args->solve, &s->solution, &s->result, &reason);
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", args->problem, reason.text);
    PAL_TRY(compare(s, diag));
    return write_files(s, args, diag);
}

/* ---- report ---- */

static void add_seconds(cJSON *object, const study *s)
{
    const pal_solve_result *r = &s->result;
    cJSON *seconds = cJSON_AddObjectToObject(object, "seconds");
    cJSON_AddNumberToObject(seconds, "prepare", r->prepare_s);
    cJSON_AddNumberToObject(seconds, "assemble", r->assemble_s);
    cJSON_AddNumberToObject(seconds, "factor", r->factor_s);
    cJSON_AddNumberToObject(seconds, "solve", r->solve_s);
    cJSON_AddNumberToObject(seconds, "total", s->total_s);
}

static cJSON *as_json(const study *s, const arguments *args)
{
    const pal_solve_result *r = &s->result;
    cJSON *o = cJSON_CreateObject();
    bool compared = s->samples_file != NULL;
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddStringToObject(o, "problem", s->problem->name);
    cJSON_AddStringToObject(o, "case", s->load_case->id);
    if (s->reference)
        cJSON_AddStringToObject(o, "reference", s->reference->id);
    else
        cJSON_AddNullToObject(o, "reference");
    cJSON_AddStringToObject(o, "element", args->solve.element);
    cJSON_AddStringToObject(o, "law", args->solve.law);
    cJSON_AddNumberToObject(o, "resolution", args->solve.resolution);
    cJSON_AddBoolToObject(o, "fill", args->solve.fill);
    pal_json_add_or_null(o, "rms_percent", compared ? s->rms_percent : NAN);
    pal_json_add_or_null(o, "max_percent", compared ? s->max_percent : NAN);
    pal_json_add_or_null(o, "reference_rms_percent", s->reference ? 100 * s->reference->estimated_rms : NAN);
    cJSON_AddNumberToObject(o, "samples", s->samples.n);
    cJSON_AddNumberToObject(o, "nodes", r->n_node);
    cJSON_AddNumberToObject(o, "elements", r->n_element);
    cJSON_AddNumberToObject(o, "dof", r->n_dof);
    cJSON_AddNumberToObject(o, "held_nodes", r->n_fixed);
    cJSON_AddNumberToObject(o, "iterations", r->n_newton);
    cJSON_AddNumberToObject(o, "cg_iterations", r->n_cg);
    cJSON_AddNumberToObject(o, "residual", r->residual);
    cJSON_AddNumberToObject(o, "voxel_m", r->edge_m);
    cJSON_AddNumberToObject(o, "volume_m3", r->volume_m3);
    cJSON_AddItemToObject(o, "load_area_m2", cJSON_CreateDoubleArray(r->area_m2, s->load_case->n_load));
    cJSON_AddItemToObject(o, "load_N", cJSON_CreateDoubleArray(r->load_N, 3));
    cJSON_AddItemToObject(o, "reaction_N", cJSON_CreateDoubleArray(r->reaction_N, 3));
    cJSON_AddNumberToObject(o, "work_J", r->work_J);
    cJSON_AddNumberToObject(o, "energy_J", r->energy_J);
    cJSON_AddNumberToObject(o, "max_displacement_m", r->max_m);
    cJSON_AddBoolToObject(o, "poisson_clamped", r->clamped);
    cJSON *files = cJSON_AddArrayToObject(o, "files");
    for (int k = 0; k < s->n_file; k++) cJSON_AddItemToArray(files, cJSON_CreateString(s->file[k]));
    add_seconds(o, s);
    return o;
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

/* ---- the command ---- */

/* a table: several elements or resolutions, or a plot of them */
static bool is_table(const arguments *args)
{
    return args->list.n_element * args->list.n_resolution > 1 || args->plot;
}

static int run_table(const pal_flag_common *common, const study *s, const arguments *args)
{
    const pal_solve_study what = {.problem = s->problem,
                                  .load_case = s->load_case,
                                  .reference = s->reference,
                                  .samples_file = s->samples_file,
                                  .samples = s->samples_file ? &s->samples : NULL,
                                  .surface = &s->surface,
                                  .options = &args->solve,
                                  .plot = args->plot};
    return pal_solve_study_run(common, &what, &args->list);
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
    pal_report_progress(NULL, 0, common);
    int code = err            ? pal_report_refusal(common, err, &diag)
               : table        ? run_table(common, &s, args)
               : common->json ? pal_report_json(common, as_json(&s, args))
                              : 0;
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
         "on: a voxel that the surface cuts has its filled share of stiffness; off: voxels at least half filled count\n"
         "whole (on)"},
        {"--least-fill", "SHARE", PAL_FLAG_NUMBER, &o->min_fill, 1e-6, 1,
         "cut voxels with a smaller share inside are dropped (0.25 with fill, or 0.02 where that would lose 2.5 %\n"
         "of the volume; 0.5 without)"},
        {"--align", "on|off", PAL_FLAG_WORD, &args.align, 0, 0,
         "on: voxels are shifted so that their faces lie where a support, else a material, ends inside the body;\n"
         "off: they begin at the bounding box of the surface (on)"},
        {"--split", "K", PAL_FLAG_COUNT, &o->split, 1, 16,
         "every voxel is solved as K x K x K elements of its fill: the remaining error is that of the voxel border "
         "(1)"},
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
        {"--vtk", "FILE", PAL_FLAG_TEXT, &args.vtk, 0, 0, "write a legacy VTK file with displacement and stress"},
        {"--plot", "FILE.svg", PAL_FLAG_TEXT, &args.plot, 0, 0,
         "plot error over nodes, and in FILE_seconds.svg error over seconds"},
    };
    const pal_flag_table flags = {.usage = "solve PROBLEM.json --case ID [flags]",
                                  .about = about,
                                  .example = "palpate solve deploy/problems/beam.json --case tip --vtk tip.vtk\n"
                                             "palpate solve deploy/problems/beam.json --case tip --resolution 8,16 "
                                             "--element hex8_bbar,tet4 --plot error.svg\n",
                                  .flag = flag,
                                  .n_flag = sizeof flag / sizeof flag[0],
                                  .min_operand = 1,
                                  .max_operand = 1};
    pal_flag_common common;
    int n = 0, code = pal_flags_parse(&flags, argc, argv, &common, &args.problem, &n);
    if (code >= 0) return code;
    pal_diagnostic diag = {""};
    if (!pal_solve_study_parse(args.element, args.resolution, &args.list, &diag))
        return pal_flags_wrong(&common, "%s", diag.text);
    const char *sentence = check_flags(&args);
    if (sentence) return pal_flags_wrong(&common, "%s", sentence);
    o->element = args.list.element[0];
    o->resolution = args.list.resolution[0];
    o->fill = !args.fill || !strcmp(args.fill, "on");
    o->align = !args.align || !strcmp(args.align, "on");
    o->linear = args.linear;
    o->inertia_relief = args.free && !strcmp(args.free, "inertia_relief");
    return run(&common, &args);
}
