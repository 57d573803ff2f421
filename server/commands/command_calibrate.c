/* `palpate calibrate`: spring constants whose equilibrium is that of finite elements -> a scene for serve that states
 * its error (paper B section 3). */
#include "server/base/clock.h"
#include "server/calibrate/calibrate_run.h"
#include "server/cli/flags.h"
#include "server/commands/commands.h"

#include <errno.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char about[] =
    "Finds spring constants (edges, faces, volumes) whose equilibrium matches finite elements or measured\n"
    "displacements, and writes a scene for palpate serve. PROBLEM.json is that of palpate solve. A name of --case is\n"
    "a load case, whose truth is computed by finite elements, or a reference, whose CSV is the truth. The error is "
    "the\n"
    "RMS distance in per cent of the largest displacement of the truth, averaged over the fitted cases.\n"
    "Ctrl-C ends the search and writes the best result; a second Ctrl-C ends the process.\n";

static const double LIVE_WORK_1_S = 7.5e7; /* sub-steps times tetrahedra per second of one core of a 2020s server */
enum { MAX_GRID = 16000 };                 /* three numbers of 20 characters each fit into the 1 MiB of a scene file */

typedef struct arguments {
    const char *problem, *grid, *method, *weights, *area;
    double budget_s;
    int evaluations, seed;
} arguments;

/* ---- progress ---- */

static void show_fit(pal_calibrate_run *run, const pal_fit_step *step)
{
    static double shown_s;
    char text[160], best[32] = "none yet", left[48] = "";
    double now = pal_clock_s(), end = INFINITY;
    if (now - shown_s < 0.1) return;
    shown_s = now;
    if (step->best_percent < DBL_MAX) snprintf(best, sizeof best, "%.4g %%", step->best_percent);
    if (run->fit.budget_s > 0) end = run->fit.budget_s;
    if (run->fit.max_evaluation > 0 && step->evaluation > 0)
        end = fmin(end, step->seconds * (double)run->fit.max_evaluation / (double)(step->evaluation + 1));
    if (isfinite(end)) snprintf(left, sizeof left, ", at most %.0f s left", fmax(0, end - step->seconds));
    snprintf(text, sizeof text, "%s: best error %s, %lld evaluations, %.0f s%s", pal_calibrate_method(run), best,
             (long long)step->evaluation + 1, step->seconds, left);
    pal_report_progress(text, 0, &run->common);
}

/* keeps the errors for the plot; without memory for them the search continues */
static bool record_step(void *user, const pal_fit_step *step)
{
    pal_calibrate_run *run = user;
    if (run->n_trail == run->max_trail) {
        int more = run->max_trail > 0 ? 2 * run->max_trail : 256;
        double *error = realloc(run->error, (size_t)more * sizeof *error);
        if (error) run->error = error;
        double *best = error ? realloc(run->best, (size_t)more * sizeof *best) : NULL;
        if (best) run->best = best;
        if (best) run->max_trail = more;
    }
    if (run->n_trail < run->max_trail) {
        run->error[run->n_trail] = step->error_percent;
        run->best[run->n_trail++] = step->best_percent;
    }
    show_fit(run, step);
    return !pal_stop_asked();
}

/* "5x3x5"; false: text is not that */
static bool read_grid(const char *text, int grid[3])
{
    const char *at = text;
    for (int a = 0; a < 3; a++) {
        char *end;
        if (*at < '0' || *at > '9') return false;
        long n = strtol(at, &end, 10);
        if (n < 1 || n > 1024 || *end != (a < 2 ? 'x' : 0)) return false;
        grid[a] = (int)n;
        at = end + 1;
    }
    return true;
}

/* NULL: the flags fit together, else the sentence */
static const char *read_arguments(pal_calibrate_run *run, const arguments *args)
{
    if (!run->input.fit || !*run->input.fit) return "--case ID is missing";
    if (!run->scene || !*run->scene) return "-o SCENE.json is missing";
    if (args->grid && !read_grid(args->grid, run->options.grid))
        return "--grid: is not NXxNYxNZ, three numbers of nodes from 1 to 1024, as 5x3x5";
    run->annealing = args->method && !strcmp(args->method, "annealing");
    run->options.equal = args->weights && !strcmp(args->weights, "equal");
    if (args->area) run->options.without_area = !strcmp(args->area, "off");
    run->fit.budget_s = args->budget_s;
    run->fit.max_evaluation = args->evaluations;
    run->fit.seed = (uint64_t)args->seed;
    return NULL;
}

/* ---- output files ---- */

static const char *const target_flag[PAL_CALIBRATE_FILES] = {"-o", "--trajectory", "--picture", "--vtk"};

/* do two paths name one file, whether it exists or not? */
static bool is_same_file(const char *a, const char *b)
{
    char real[2][PATH_MAX], folder[PATH_MAX];
    const char *path[2] = {a, b}, *name[2];
    for (int k = 0; k < 2; k++) {
        const char *slash = strrchr(path[k], '/');
        int n = slash ? (int)(slash - path[k]) + 1 : 0;
        name[k] = path[k] + n;
        if (n >= PATH_MAX) return false;
        snprintf(folder, sizeof folder, "%.*s", n > 0 ? n : 1, n > 0 ? path[k] : ".");
        if (!realpath(folder, real[k])) return false;
    }
    return !strcmp(real[0], real[1]) && !strcmp(name[0], name[1]);
}

/* can a file of this name be written? Refused before the search, not after it */
static pal_err check_target(const char *flag, const char *path, pal_diagnostic *diag)
{
    char folder[PAL_CALIBRATE_PATH];
    struct stat facts;
    if (!path) return PAL_ERR_OK;
    const char *slash = strrchr(path, '/');
    int n = slash == path ? snprintf(folder, sizeof folder, "/")
            : slash       ? snprintf(folder, sizeof folder, "%.*s", (int)(slash - path), path)
                          : snprintf(folder, sizeof folder, ".");
    if (n < 0 || (size_t)n + 64 >= sizeof folder || !path[0] || (slash && !slash[1]))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: \"%.80s\" is not the name of a file", flag, path);
    if (stat(folder, &facts) || !S_ISDIR(facts.st_mode))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.200s: there is no folder %.200s", flag, path, folder);
    snprintf(folder + n, sizeof folder - (size_t)n, "/.palpate_XXXXXX");
    int file = mkstemp(folder);
    if (file < 0)
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %.200s: cannot be written: %s", flag, path, strerror(errno));
    close(file);
    unlink(folder);
    if (!stat(path, &facts) && S_ISDIR(facts.st_mode))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.200s is a folder, wanted a file in it", flag, path);
    if (!stat(path, &facts) && !S_ISREG(facts.st_mode))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.200s exists and is not a file", flag, path);
    return PAL_ERR_OK;
}

/* refuses an output that is also an input */
static pal_err check_source(const char *flag, const char *path, const char *source, const char *what,
                            pal_diagnostic *diag)
{
    char own[PATH_MAX], other[PATH_MAX];
    if (path && source && realpath(path, own) && realpath(source, other) && !strcmp(own, other))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.200s is the %s itself", flag, path, what);
    return PAL_ERR_OK;
}

static pal_err check_targets(const pal_calibrate_run *run, pal_diagnostic *diag)
{
    const int *grid = run->options.grid;
    if ((int64_t)grid[0] * grid[1] * grid[2] > MAX_GRID)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "--grid: %d x %d x %d nodes, more than the %d that a scene file holds", grid[0],
                                  grid[1], grid[2], MAX_GRID);
    const char *const path[PAL_CALIBRATE_FILES] = {run->scene, run->trajectory, run->picture, run->vtk};
    for (int a = 0; a < PAL_CALIBRATE_FILES; a++) {
        PAL_TRY(check_target(target_flag[a], path[a], diag));
        PAL_TRY(check_source(target_flag[a], path[a], run->input.problem, "problem", diag));
        PAL_TRY(check_source(target_flag[a], path[a], run->input.truth, "truth", diag));
        for (int b = 0; b < a && path[a]; b++)
            if (path[b] && is_same_file(path[a], path[b]))
                return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.200s is the file of %s as well", target_flag[a],
                                          path[a], target_flag[b]);
    }
    return PAL_ERR_OK;
}

/* the same for the files that the problem names */
static pal_err check_sources(const pal_calibrate_run *run, pal_diagnostic *diag)
{
    const char *const path[PAL_CALIBRATE_FILES] = {run->scene, run->trajectory, run->picture, run->vtk};
    const pal_problem *p = run->set.problem;
    for (int a = 0; a < PAL_CALIBRATE_FILES; a++) {
        PAL_TRY(check_source(target_flag[a], path[a], p->surface, "problem's surface", diag));
        for (int k = 0; k < p->n_reference; k++)
            PAL_TRY(check_source(target_flag[a], path[a], p->reference[k].file, "problem's reference", diag));
    }
    return PAL_ERR_OK;
}

/* ---- work ---- */

static pal_err make(pal_calibrate_run *run, pal_diagnostic *diag)
{
    pal_diagnostic reason = {""};
    pal_case_voxel_options *voxel = &run->options.voxel;
    run->options.progress = pal_report_continue;
    run->options.user = &run->common;
    pal_err err = PAL_ERR_OK;
    if (voxel->resolution == 0) err = pal_calibrate_cases_resolution(&run->set, voxel, &voxel->resolution, &reason);
    if (!err)
        err = pal_calibration_create(run->set.problem, &run->set.surface, run->set.list, run->set.n, &run->options,
                                     &run->calibration, &reason);
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", run->input.problem, reason.text);
    pal_calibration_info_of(run->calibration, &run->info);
    run->theta = malloc(sizeof *run->theta * (size_t)run->info.n_parameter);
    if (!run->theta || pal_calibration_workspace_create(run->calibration, &run->workspace))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d constants", run->info.n_parameter);
    return pal_calibrate_cases_check(&run->set, run->info.mesh, diag);
}

static pal_err search(pal_calibrate_run *run, pal_diagnostic *diag)
{
    enum { ALL = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY };
    const pal_calibration *c = run->calibration;
    size_t n = sizeof *run->theta * (size_t)run->info.n_parameter;
    pal_calibration_manual_start(c, run->theta);
    PAL_TRY(pal_calibration_evaluate(c, run->workspace, run->theta, ALL, &run->hand, NULL, diag));
    memcpy(run->theta, run->info.start, n);
    PAL_TRY(pal_calibration_evaluate(c, run->workspace, run->theta, ALL, &run->start, NULL, diag));
    run->fit.step = record_step;
    run->fit.user = run;
    pal_diagnostic reason = {""};
    pal_err err = run->annealing ? pal_fit_anneal(c, &run->fit, run->theta, &run->result, &reason)
                                 : pal_fit_adjoint(c, &run->fit, run->theta, &run->result, &reason);
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", run->input.problem, reason.text);
    return pal_calibration_evaluate(c, run->workspace, run->theta, ALL, &run->last, NULL, diag);
}

/* runs the springs live: does the body come to rest where the search says, with which damping? */
static pal_err settle(pal_calibrate_run *run, pal_loaded_scene *scene, pal_diagnostic *diag)
{
    pal_settle_load load[PAL_CALIBRATE_CASES];
    size_t n = 3 * (size_t)run->info.n_node;
    double begin = pal_clock_s(), *u = malloc(n * (size_t)run->set.n * sizeof *u);
    pal_settle_options options;
    pal_settle_default(&options);
    options.progress = pal_report_continue;
    options.user = &run->common;
    /* as long as the search at most; counted in sub-steps, so that the scene does not depend on the clock */
    if (run->fit.budget_s > 0) options.max_work = fmin(options.max_work, LIVE_WORK_1_S * fmax(run->fit.budget_s, 1));
    if (!u) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d loads", run->set.n);
    for (int k = 0; k < run->set.n; k++) {
        bool rests = pal_calibration_displacement(run->calibration, run->workspace, k, u + n * (size_t)k);
        load[k] = (pal_settle_load){.force_N = pal_calibration_forces(run->calibration, k),
                                    .u = rests ? u + n * (size_t)k : NULL};
    }
    pal_err err = pal_stop_asked() ? PAL_ERR_STATE
                                   : pal_settle_damping(&scene->scene, load, run->set.n, &options, &run->live, diag);
    run->settled = !err;
    run->settle_s = pal_clock_s() - begin;
    free(u);
    if (run->settled) scene->scene.body[0].material.damping_1_s = run->live.damping_1_s;
    run->damping_1_s = scene->scene.body[0].material.damping_1_s;
    return err == PAL_ERR_STATE ? PAL_ERR_OK : err; /* stopped: the scene keeps its own damping */
}

static pal_err write_files(pal_calibrate_run *run, const pal_loaded_scene *scene, pal_diagnostic *diag)
{
    const char *const path[PAL_CALIBRATE_FILES] = {run->scene, run->trajectory, run->picture, run->vtk};
    pal_err err = pal_scene_save_file(scene, run->scene, diag);
    if (!err && run->trajectory) err = pal_calibrate_draw_trajectory(run, run->trajectory, diag);
    if (!err && run->picture) err = pal_calibrate_draw_body(run, run->picture, diag);
    if (!err && run->vtk) err = pal_calibrate_write_vtk(run, run->vtk, diag);
    for (int k = 0; k < PAL_CALIBRATE_FILES && !err; k++)
        if (path[k]) snprintf(run->file[run->n_file++], PAL_CALIBRATE_PATH, "%s", path[k]);
    return err;
}

static pal_err work(pal_calibrate_run *run, pal_diagnostic *diag)
{
    pal_loaded_scene *scene = NULL;
    PAL_TRY(check_targets(run, diag));
    PAL_TRY(pal_calibrate_cases_read(&run->input, &run->set, diag));
    PAL_TRY(check_sources(run, diag));
    PAL_TRY(make(run, diag));
    PAL_TRY(search(run, diag));
    PAL_TRY(pal_calibrate_scene(run, &scene, diag));
    pal_err err = settle(run, scene, diag);
    if (!err) {
        pal_calibrate_accuracy(run, scene->scene.accuracy, sizeof scene->scene.accuracy);
        err = write_files(run, scene, diag);
    }
    pal_scene_free(scene);
    return err;
}

static int start(pal_calibrate_run *run)
{
    pal_diagnostic diag = {""};
    double begin = pal_clock_s();
    pal_stop_watch();
    pal_err err = work(run, &diag);
    run->total_s = pal_clock_s() - begin;
    pal_report_progress(NULL, 0, &run->common);
    int code = err                ? pal_report_refusal(&run->common, err, &diag)
               : run->common.json ? pal_report_json(&run->common, pal_calibrate_json(run))
                                  : 0;
    if (!err && !run->common.json && !run->common.quiet) pal_calibrate_print(run);
    pal_calibration_workspace_destroy(run->workspace);
    pal_calibration_destroy(run->calibration);
    pal_calibrate_cases_free(&run->set);
    free(run->theta);
    free(run->error);
    free(run->best);
    return code;
}

int command_calibrate(int argc, char **argv)
{
    static pal_calibrate_run run;
    arguments args = {0};
    run = (pal_calibrate_run){0};
    pal_calibrate_options *o = &run.options;
    pal_calibrate_default(o);
    o->voxel.resolution = 0;
    const pal_flag flag[] = {
        {"--case", "ID[,ID...]", PAL_FLAG_TEXT, &run.input.fit, 0, 0, "load cases or references to fit"},
        {"--verify", "ID[,ID...]", PAL_FLAG_TEXT, &run.input.verify, 0, 0, "others, whose error is only reported"},
        {"-o", "SCENE.json", PAL_FLAG_TEXT, &run.scene, 0, 0, "scene to write; its mesh is written beside it"},
        {"--grid", "NXxNYxNZ", PAL_FLAG_TEXT, &args.grid, 0, 0,
         "constants at the nodes of a grid over the body, trilinear between (one of each kind for the whole body)"},
        {"--method", "adjoint|annealing", PAL_FLAG_WORD, &args.method, 0, 0,
         "L-BFGS with exact gradients, or adaptive simulated annealing (adjoint)"},
        {"--budget", "SECONDS", PAL_FLAG_NUMBER, &args.budget_s, 0.01, 1e7,
         "time limit of the search; the live run after it takes about as long (no limit; 20 s)"},
        {"--evaluations", "N", PAL_FLAG_COUNT, &args.evaluations, 1, 1e9,
         "limit of evaluations (1000; annealing 4000)"},
        {"--enough", "PERCENT", PAL_FLAG_NUMBER, &run.fit.target_percent, 1e-9, 1e9, "end the search at this error"},
        {"--seed", "S", PAL_FLAG_COUNT, &args.seed, 0, INT_MAX, "annealing: the same seed gives the same result (0)"},
        {"--workers", "N", PAL_FLAG_COUNT, &run.fit.n_worker, 1, 256,
         "annealing: threads; the result is the same for any number (one per core)"},
        {"--resolution", "N", PAL_FLAG_COUNT, &o->voxel.resolution, 2, 200,
         "voxels along the longest axis (the least even number that gives more than 700 nodes)"},
        {"--split", "K", PAL_FLAG_COUNT, &o->split, 1, 8,
         "the finite elements of the truth are K x K x K to a voxel (2)"},
        {"--kinematics", "finite|linear", PAL_FLAG_WORD, &run.input.kinematics, 0, 0,
         "neo-Hookean truth and springs as they move; or both linearised (a reference's, or finite)"},
        {"--truth", "WORD", PAL_FLAG_TEXT, &run.input.truth, 0, 0,
         "fem, reference (the CSV of the reference that belongs to a load case), or a file U.csv of x,y,z,ux,uy,uz\n"
         "for the one case that is fitted"},
        {"--weights", "volume|equal", PAL_FLAG_WORD, &args.weights, 0, 0,
         "springs weighted by the volume around them, or all of a kind equal as in paper B (volume)"},
        {"--area-springs", "on|off", PAL_FLAG_WORD, &args.area, 0, 0,
         "off: springs along edges and in volumes only (on)"},
        {"--decades", "D", PAL_FLAG_NUMBER, &o->decades, 0.01, 20,
         "range of a constant around its start, powers of ten either way (3)"},
        {"--smooth", "W", PAL_FLAG_NUMBER, &o->smooth, 0, 1e9,
         "grid: weight of differences between neighbours, which smooths the map (0.1)"},
        {"--pull", "W", PAL_FLAG_NUMBER, &o->pull, 0, 1e9,
         "grid: weight of the deviation from the ratios of edges, faces and volumes at the start (0.1)"},
        {"--trajectory", "FILE.svg", PAL_FLAG_TEXT, &run.trajectory, 0, 0, "plot the error of every evaluation"},
        {"--picture", "FILE.svg", PAL_FLAG_TEXT, &run.picture, 0, 0,
         "draw the body at rest, its truth, and the distance of start and result from it; constants on a grid"},
        {"--vtk", "FILE", PAL_FLAG_TEXT, &run.vtk, 0, 0,
         "write a legacy VTK file with constants and the displacements of truth and springs"},
    };
    const pal_flag_table table = {.usage = "calibrate PROBLEM.json --case ID -o SCENE.json [flags]",
                                  .about = about,
                                  .example = "palpate calibrate deploy/problems/gear.json --case twist --verify push "
                                             "--resolution 10 --budget 5 -o gear.json\n"
                                             "palpate calibrate deploy/problems/cube.json --case push --grid 3x3x3 "
                                             "--resolution 6 --budget 5 --picture cube.svg -o cube.json\n",
                                  .flag = flag,
                                  .n_flag = sizeof flag / sizeof flag[0],
                                  .min_operand = 1,
                                  .max_operand = 1};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &run.common, &run.input.problem, &n);
    if (code >= 0) return code;
    const char *sentence = read_arguments(&run, &args);
    if (sentence) return pal_flags_wrong(&run.common, "%s", sentence);
    return start(&run);
}
