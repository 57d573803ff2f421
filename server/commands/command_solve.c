/* `palpate solve`: a load-case problem -> displacements, the error against a reference, files for other tools. */
#include "server/base/clock.h"
#include "server/cli/flags.h"
#include "server/commands/commands.h"
#include "server/commands/solve_study.h"
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
    "Solves a load case with finite elements on the voxels of a surface, and compares displacements with a reference.\n"
    "PROBLEM.json is of format palpate-reference-1: surface, materials, supports, load cases, references\n"
    "(server/scene/problem_file.h says every key). --case takes a load case, which is compared with the reference of\n"
    "the same kinematics, E and nu if there is one, or a reference, whose load case, law, E and nu are then taken.\n"
    "Example: palpate solve deploy/problems/beam.json --case tip --resolution 32 --vtk tip.vtk\n"
    "Several resolutions or elements, with commas between, give a table: error, observed order of convergence from "
    "one\n"
    "resolution to the next, the change of displacement between them, the order and the error that the changes speak\n"
    "for (Richardson), seconds. Example: --resolution 8,16,32 --element hex8_bbar,tet4,tet10:16 --plot error.svg\n";

typedef struct plan_requests {
    const char *problem, *load_case, *kinematics, *law, *element, *resolution, *samples, *fill, *align, *linear, *free,
        *folder, *vtk, *csv, *plot;
    pal_study_list list;
    pal_solve_options solve;
} plan_requests;

/* what is solved and what it is compared with */
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

static int usage(const pal_flag_common *common, const char *sentence)
{
    fprintf(stderr, "palpate %s: %s (see palpate %s --help)\n", common->command, sentence, common->command);
    return 2;
}

/* ---- what is meant ---- */

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

/* the law: --law, or what --kinematics, or the reference, asks for */
static const char *law_of(const plan_requests *request, const pal_problem_reference *reference)
{
    bool finite = request->kinematics ? !strcmp(request->kinematics, "finite") : reference && reference->finite;
    if (request->law) return request->law;
    if (!finite) return "linear";
    bool neo = !reference || !reference->finite || !strcmp(reference->law, "neo-hookean");
    return neo ? "neo_hookean" : "corotational";
}

static bool same(double a, double b)
{
    return fabs(a - b) <= 1e-9 * fabs(b);
}

/* does the reference answer what is asked? */
static bool answers(const study *s, const plan_requests *request, const pal_problem_reference *r)
{
    const pal_problem_material *m = &s->problem->material[0];
    double young = isnan(r->young_Pa) ? m->young_Pa : r->young_Pa;
    double poisson = isnan(r->poisson) ? m->poisson : r->poisson;
    return !strcmp(r->load_case, s->load_case->id) && r->finite == (strcmp(request->solve.law, "linear") != 0) &&
           same(isnan(request->solve.young_Pa) ? m->young_Pa : request->solve.young_Pa, young) &&
           same(isnan(request->solve.poisson) ? m->poisson : request->solve.poisson, poisson);
}

/* --case -> load case, law, E, nu and what to compare with */
static pal_err choose(study *s, plan_requests *request, pal_diagnostic *diag)
{
    const pal_problem *p = s->problem;
    const char *id = request->load_case ? request->load_case : p->n_case == 1 ? p->load_case[0].id : NULL;
    const pal_problem_reference *named = id ? pal_problem_reference_find(p, id) : NULL;
    s->load_case = named ? pal_problem_case_find(p, named->load_case) : id ? pal_problem_case_find(p, id) : NULL;
    if (!s->load_case) return no_case(s, id, diag);
    request->solve.law = law_of(request, named);
    if (named && isnan(request->solve.young_Pa)) request->solve.young_Pa = named->young_Pa;
    if (named && isnan(request->solve.poisson)) request->solve.poisson = named->poisson;
    s->samples_file = request->samples;
    if (request->samples) return PAL_ERR_OK;
    s->reference = named;
    for (int k = 0; k < p->n_reference && !named; k++) {
        const pal_problem_reference *r = &p->reference[k];
        if (!answers(s, request, r)) continue;
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

static pal_err write_files(study *s, const plan_requests *request, pal_diagnostic *diag)
{
    char csv[PATH], vtk[PATH];
    if (request->folder) {
        PAL_TRY(pal_scene_make_folder(request->folder, diag));
        snprintf(csv, sizeof csv, "%s/solution.csv", request->folder);
        snprintf(vtk, sizeof vtk, "%s/solution.vtk", request->folder);
        PAL_TRY(write_one(s, request->csv ? request->csv : csv, false, diag));
        return write_one(s, request->vtk ? request->vtk : vtk, true, diag);
    }
    if (request->csv) PAL_TRY(write_one(s, request->csv, false, diag));
    return request->vtk ? write_one(s, request->vtk, true, diag) : PAL_ERR_OK;
}

static pal_err read_all(study *s, plan_requests *request, pal_diagnostic *diag)
{
    PAL_TRY(pal_problem_read(request->problem, &s->problem, diag));
    PAL_TRY(choose(s, request, diag));
    if (s->samples_file) PAL_TRY(pal_samples_read(s->samples_file, &s->samples, diag));
    pal_mesh_file_options file = {.unit_m = s->problem->unit_m, .weld = PAL_MESH_WELD};
    pal_surface_report report = {0};
    return pal_mesh_file_read(s->problem->surface, &file, &s->surface, &report, NULL, NULL, diag);
}

static pal_err work(study *s, const plan_requests *request, pal_diagnostic *diag)
{
    pal_diagnostic reason = {""};
    pal_err err = pal_solve(s->problem, s->load_case, &s->surface, &request->solve, &s->solution, &s->result, &reason);
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", request->problem, reason.text);
    PAL_TRY(compare(s, diag));
    return write_files(s, request, diag);
}

/* ---- saying ---- */

static void add_vector(cJSON *object, const char *key, const double v[3])
{
    cJSON_AddItemToObject(object, key, cJSON_CreateDoubleArray(v, 3));
}

static void add_or_null(cJSON *object, const char *key, bool known, double number)
{
    if (known && isfinite(number))
        cJSON_AddNumberToObject(object, key, number);
    else
        cJSON_AddNullToObject(object, key);
}

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

static cJSON *as_json(const study *s, const plan_requests *request)
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
    cJSON_AddStringToObject(o, "element", request->solve.element);
    cJSON_AddStringToObject(o, "law", request->solve.law);
    cJSON_AddNumberToObject(o, "resolution", request->solve.resolution);
    cJSON_AddBoolToObject(o, "fill", request->solve.fill);
    add_or_null(o, "rms_percent", compared, s->rms_percent);
    add_or_null(o, "max_percent", compared, s->max_percent);
    add_or_null(o, "reference_rms_percent", s->reference != NULL, s->reference ? 100 * s->reference->estimated_rms : 0);
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
    add_vector(o, "load_N", r->load_N);
    add_vector(o, "reaction_N", r->reaction_N);
    cJSON_AddNumberToObject(o, "work_J", r->work_J);
    cJSON_AddNumberToObject(o, "energy_J", r->energy_J);
    cJSON_AddNumberToObject(o, "max_displacement_m", r->max_m);
    cJSON_AddBoolToObject(o, "poisson_clamped", r->clamped);
    cJSON *files = cJSON_AddArrayToObject(o, "files");
    for (int k = 0; k < s->n_file; k++) cJSON_AddItemToArray(files, cJSON_CreateString(s->file[k]));
    add_seconds(o, s);
    return o;
}

static void print(const study *s, const plan_requests *request)
{
    const pal_solve_result *r = &s->result;
    printf("%s, load case %s: %s, %s, %d nodes, %d elements of %g m, %d unknowns\n", s->problem->name, s->load_case->id,
           request->solve.element, request->solve.law, r->n_node, r->n_element, r->edge_m, r->n_dof);
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

static bool show_progress(const char *what, double fraction, void *user)
{
    pal_report_progress(what, fraction, user);
    return true;
}

/* several elements or resolutions, or a plot of them */
static bool is_many(const plan_requests *request)
{
    return request->list.n_element * request->list.n_resolution > 1 || request->plot;
}

static int run_many(const pal_flag_common *common, const study *s, const plan_requests *request)
{
    const pal_solve_study what = {.problem = s->problem,
                                  .load_case = s->load_case,
                                  .reference = s->reference,
                                  .samples_file = s->samples_file,
                                  .samples = s->samples_file ? &s->samples : NULL,
                                  .surface = &s->surface,
                                  .options = &request->solve,
                                  .plot = request->plot};
    return pal_solve_study_run(common, &what, &request->list);
}

static int run(pal_flag_common *common, plan_requests *request)
{
    study s = {0};
    pal_diagnostic diag = {""};
    double start = pal_clock_s();
    request->solve.progress = show_progress;
    request->solve.user = common;
    pal_err err = read_all(&s, request, &diag);
    bool many = !err && is_many(request);
    if (!err && !many) err = work(&s, request, &diag);
    s.total_s = pal_clock_s() - start;
    pal_report_progress(NULL, 0, common);
    int code = err            ? pal_report_refusal(common, err, &diag)
               : many         ? run_many(common, &s, request)
               : common->json ? pal_report_json(common, as_json(&s, request))
                              : 0;
    if (!err && !many && !common->json && !common->quiet) print(&s, request);
    pal_solution_free(s.solution);
    pal_surface_free(&s.surface);
    pal_samples_free(&s.samples);
    free(s.problem);
    return code;
}

/* is a word one of a NULL-terminated list, or not given? */
static bool is_one(const char *word, const char *const *list)
{
    for (int k = 0; word && list[k]; k++)
        if (!strcmp(word, list[k])) return true;
    return !word;
}

/* the words of flags; NULL: all fine, else the sentence */
static const char *check_words(const plan_requests *request)
{
    if (!is_one(request->kinematics, (const char *const[]){"linear", "finite", NULL}))
        return "--kinematics: is not linear or finite";
    if (!is_one(request->law, (const char *const[]){"linear", "corotational", "neo_hookean", NULL}))
        return "--law: is not linear, corotational or neo_hookean";
    if (!is_one(request->fill, (const char *const[]){"on", "off", NULL})) return "--fill: is not on or off";
    if (!is_one(request->align, (const char *const[]){"on", "off", NULL})) return "--align: is not on or off";
    if (!is_one(request->linear, (const char *const[]){"direct", "pcg", NULL})) return "--linear: is not direct or pcg";
    if (!is_one(request->free, (const char *const[]){"refuse", "inertia_relief", NULL}))
        return "--free: is not refuse or inertia_relief";
    if (request->kinematics && request->law &&
        !strcmp(request->kinematics, "linear") != !strcmp(request->law, "linear"))
        return "--kinematics and --law: linear goes with linear only";
    if (is_many(request) && (request->folder || request->csv || request->vtk))
        return "-o, --csv and --vtk: are for one element and one resolution";
    return NULL;
}

int command_solve(int argc, char **argv)
{
    plan_requests request = {.element = "hex8_bbar", .resolution = "32", .solve = {.young_Pa = NAN, .poisson = NAN}};
    pal_solve_options *o = &request.solve;
    const pal_flag flag[] = {
        {"--case", "ID", PAL_FLAG_TEXT, &request.load_case, 0, 0, "load case or reference (the only load case)"},
        {"--kinematics", "WORD", PAL_FLAG_TEXT, &request.kinematics, 0, 0,
         "linear or finite (the reference's, or linear)"},
        {"--law", "WORD", PAL_FLAG_TEXT, &request.law, 0, 0,
         "linear, corotational or neo_hookean (linear, or neo_hookean when finite)"},
        {"--element", "LIST", PAL_FLAG_TEXT, &request.element, 0, 0,
         "hex8_bbar, hex8, tet4 or tet10, or several with commas between; tet10:16 is not solved beyond resolution 16\n"
         "(hex8_bbar)"},
        {"--resolution", "LIST", PAL_FLAG_TEXT, &request.resolution, 0, 0,
         "voxels on the longest axis, 1 to 1024, or several with commas between, ascending (32)"},
        {"--fill", "WORD", PAL_FLAG_TEXT, &request.fill, 0, 0,
         "on: voxels that the surface cuts count by their filled share; off: those at least half filled, whole (on)"},
        {"--least-fill", "SHARE", PAL_FLAG_NUMBER, &o->min_fill, 1e-6, 1,
         "cut voxels with a smaller share inside are dropped (0.25 with fill, or 0.02 where that would lose 2.5 %\n"
         "of the volume; 0.5 without)"},
        {"--align", "WORD", PAL_FLAG_TEXT, &request.align, 0, 0,
         "on: voxels are shifted so that faces lie where a support, or else a material, ends inside the body; off: "
         "they\n"
         "begin at the box of the surface (on)"},
        {"--split", "K", PAL_FLAG_COUNT, &o->split, 1, 16,
         "every voxel is solved as K x K x K of its fill: what is left of the error is that of the jagged border (1)"},
        {"--samples", "U.csv", PAL_FLAG_TEXT, &request.samples, 0, 0,
         "compare at these points: CSV x,y,z,ux,uy,uz (the reference's)"},
        {"--nu", "NU", PAL_FLAG_NUMBER, &o->poisson, -1e300, 1e300, "Poisson ratio (the problem's)"},
        {"--young", "PA", PAL_FLAG_NUMBER, &o->young_Pa, -1e300, 1e300, "stiffness (the problem's)"},
        {"--tolerance", "T", PAL_FLAG_NUMBER, &o->tolerance, 1e-14, 0.1, "residual relative to the loads (1e-8)"},
        {"--linear", "WORD", PAL_FLAG_TEXT, &request.linear, 0, 0,
         "direct or pcg: how the linear systems are solved (whichever suits the size)"},
        {"--free", "WORD", PAL_FLAG_TEXT, &request.free, 0, 0,
         "a body without supports: refuse, or inertia_relief: its inertia balances the loads (refuse)"},
        {"-o", "DIR", PAL_FLAG_TEXT, &request.folder, 0, 0, "writes DIR/solution.csv and DIR/solution.vtk"},
        {"--csv", "FILE", PAL_FLAG_TEXT, &request.csv, 0, 0, "writes x,y,z,ux,uy,uz of all nodes, m"},
        {"--vtk", "FILE", PAL_FLAG_TEXT, &request.vtk, 0, 0, "writes a legacy VTK file with displacement and stress"},
        {"--plot", "FILE.svg", PAL_FLAG_TEXT, &request.plot, 0, 0,
         "draws error over nodes, and in FILE_seconds.svg error over seconds"},
    };
    const pal_flag_table table = {.usage = "solve PROBLEM.json --case ID [flags]",
                                  .about = about,
                                  .flag = flag,
                                  .n_flag = sizeof flag / sizeof flag[0],
                                  .min_operand = 1,
                                  .max_operand = 1};
    pal_flag_common common;
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, &request.problem, &n);
    if (code >= 0) return code;
    pal_diagnostic diag = {""};
    if (!pal_solve_study_parse(request.element, request.resolution, &request.list, &diag))
        return usage(&common, diag.text);
    const char *sentence = check_words(&request);
    if (sentence) return usage(&common, sentence);
    o->element = request.list.element[0];
    o->resolution = request.list.resolution[0];
    o->fill = !request.fill || !strcmp(request.fill, "on");
    o->align = !request.align || !strcmp(request.align, "on");
    o->linear = request.linear;
    o->inertia_relief = request.free && !strcmp(request.free, "inertia_relief");
    return run(&common, &request);
}
