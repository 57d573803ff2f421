/* `palpate calibrate`: spring constants whose equilibrium is that of finite elements -> a scene for serve that states
 * its error (paper B section 3). Loads come from a problem or from a recorded hand (recorded_input.h). */
#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/calibrate/calibrate_run.h"
#include "server/calibrate/tuning.h"
#include "server/cli/report.h"
#include "server/commands/calibrate_starts.h"
#include "server/commands/calibrate_targets.h"
#include "server/commands/commands.h"
#include "server/commands/recorded_input.h"
#include "server/commands/tuning.h"
#include "server/num/median.h"
#include "server/scene/json_reader.h"
#include "server/scene/scene_file.h"
#include "server/study/tuning.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>

static const char about[] =
    "Finds spring constants (edges, faces, volumes) whose equilibrium matches finite elements or measured\n"
    "displacements, and writes a scene for palpate serve. PROBLEM.json is that of palpate solve. A name of --case\n"
    "is a load case, whose truth is computed by finite elements, or a reference, whose CSV is the truth. The\n"
    "error is the RMS distance in per cent of the largest displacement of the truth, averaged over the fitted\n"
    "cases. With --from, the loads are those of a hand: the operand is the scene that was served, RECORDING its log\n"
    "(palpate serve --record). The touches become load cases, press-1, pull-2 ... in order of time, each in its\n"
    "stillest moment under a large force, and the damping is that with which the springs return as the recorded body\n"
    "did after a touch. Ctrl-C ends the search and writes the best result; a second Ctrl-C ends the process.\n";

enum { MANY_SUBSTEPS = 200 };

typedef struct arguments {
    const char *grid, *method, *weights, *area;
    double budget_s;
    int evaluations, seed;
    pal_calibrate_starts starts;
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
    if (PAL_GROW(run->trail, run->n_trail)) {
        run->trail[run->n_trail][0] = step->error_percent;
        run->trail[run->n_trail++][1] = step->best_percent;
    }
    show_fit(run, step);
    return !pal_stop_asked();
}

/* NULL: the flags fit together, else the sentence */
static const char *read_arguments(pal_calibrate_run *run, const arguments *args)
{
    if (!run->from && (!run->input.fit || !*run->input.fit)) return "--case ID is missing";
    const pal_calibrate_starts *starts = &args->starts;
    const char *scene = run->path[PAL_CALIBRATE_SCENE];
    if (starts->shard.shard) {
        for (int k = 0; k < PAL_CALIBRATE_FILES; k++)
            if (run->path[k]) return "--shard: does not go with files to write, --merge writes them";
    } else if (!scene || !*scene) {
        return "-o SCENE.json is missing";
    }
    const char *wrong = args->grid ? pal_calibrate_grid(args->grid, run->options.grid) : NULL;
    if (wrong) return wrong;
    run->annealing = args->method && !strcmp(args->method, "annealing");
    if (!run->annealing && (starts->n > 1 || starts->shard.shard || starts->shard.merge))
        return "--starts, --shard and --merge go with --method annealing: adjoint is one search without a seed";
    run->options.equal = args->weights && !strcmp(args->weights, "equal");
    if (args->area) run->options.without_area = !strcmp(args->area, "off");
    run->fit.budget_s = args->budget_s;
    run->fit.max_evaluation = args->evaluations;
    run->fit.seed = (uint64_t)args->seed;
    return NULL;
}

/* springs, truths and their errors at the start */
static pal_err prepare(pal_calibrate_run *run, pal_diagnostic *diag)
{
    enum { ALL = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY };
    PAL_TRY(pal_calibrate_cases_make(&run->set, &run->options, &run->calibration, &run->info, diag));
    if (pal_calibration_workspace_create(run->calibration, &run->workspace))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d constants", run->info.n_parameter);
    return pal_calibration_evaluate(run->calibration, run->workspace, run->info.start, ALL, &run->start, NULL, diag);
}

/* The forces of a moving hand may be more than tissue bears in equilibrium, since inertia and damping bore a part: all
 * are halved until there is one */
static pal_err prepare_touches(pal_calibrate_run *run, pal_recorded_loads *loads, pal_diagnostic *diag)
{
    run->load_share = 1;
    for (;; run->load_share /= 2) {
        pal_err err = prepare(run, diag);
        bool none = err == PAL_ERR_NUMERIC || (!err && !(run->start.error_percent < DBL_MAX));
        if (!none || (run->input.truth && !strcmp(run->input.truth, "recording")) ||
            run->load_share < PAL_MIN_LOAD_SHARE)
            return err;
        pal_calibration_workspace_destroy(run->workspace);
        pal_calibration_destroy(run->calibration);
        run->workspace = NULL, run->calibration = NULL;
        pal_recorded_loads_scale(loads, 0.5);
    }
}

static pal_err search(pal_calibrate_run *run, pal_calibrate_starts *starts, pal_recorded_input *recorded,
                      pal_diagnostic *diag)
{
    enum { ALL = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY };
    run->options.progress = pal_report_continue;
    run->options.user = &run->common;
    PAL_TRY(run->from ? prepare_touches(run, &recorded->loads, diag) : prepare(run, diag));
    const pal_calibration *c = run->calibration;
    size_t n = sizeof *run->theta * (size_t)run->info.n_parameter;
    run->theta = malloc(n);
    if (!run->theta) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the constants");
    pal_calibration_manual_start(c, run->theta);
    PAL_TRY(pal_calibration_evaluate(c, run->workspace, run->theta, ALL, &run->hand, NULL, diag));
    memcpy(run->theta, run->info.start, n);
    run->fit.step = record_step;
    run->fit.user = run;
    pal_err err = run->annealing ? pal_calibrate_starts_run(starts, run, diag)
                                 : pal_fit_adjoint(c, &run->fit, run->theta, &run->result, diag);
    if (err == PAL_ERR_NUMERIC || err == PAL_ERR_MEMORY) return pal_diagnostic_prefix(diag, err, run->input.problem);
    if (err || starts->shard.shard) return err;
    return pal_calibration_evaluate(c, run->workspace, run->theta, ALL, &run->last, NULL, diag);
}

/* runs the springs live: does the body come to rest at the equilibrium of the search, with which damping? */
static pal_err settle(pal_calibrate_run *run, pal_loaded_scene *scene, pal_diagnostic *diag)
{
    const pal_recorded_loads *recorded = run->input.recorded;
    pal_settle_load load[PAL_CALIBRATE_CASES];
    size_t n = 3 * (size_t)run->info.n_node;
    double begin = pal_clock_s(), *u = malloc(n * (size_t)run->set.n * sizeof *u);
    pal_settle_options options;
    pal_settle_default(&options);
    options.progress = pal_report_continue;
    options.user = &run->common;
    /* as long as the search at most; counted in sub-steps, so that the scene does not depend on the clock */
    if (run->fit.budget_s > 0)
        options.max_work = fmin(options.max_work, PAL_LIVE_WORK_1_S * fmax(run->fit.budget_s, 1));
    if (!u) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d loads", run->set.n);
    for (int k = 0; k < run->set.n; k++) {
        bool rests = pal_calibration_displacement(run->calibration, run->workspace, k, u + n * (size_t)k);
        load[k] = (pal_settle_load){.force_N = run->info.force_N[k], .u = rests ? u + n * (size_t)k : NULL};
    }
    pal_err err = pal_stop_asked() ? PAL_ERR_STATE : PAL_ERR_OK;
    if (!err && recorded && recorded->has_release)
        err = pal_release_damping(&scene->scene, &recorded->release, &options, &run->release, diag);
    if (run->release.fitted) options.damping_1_s = run->release.damping_1_s;
    if (!err) err = pal_settle_damping(&scene->scene, load, run->set.n, &options, &run->live, diag);
    run->settled = !err;
    run->settle_s = pal_clock_s() - begin;
    free(u);
    if (run->settled) scene->scene.body[0].material.damping_1_s = run->live.damping_1_s;
    /* unsettled, it is derived when the scene is served */
    run->damping_1_s = run->settled ? run->live.damping_1_s : (double)NAN;
    return err == PAL_ERR_STATE ? PAL_ERR_OK : err; /* stopped: the scene keeps its own damping */
}

static pal_err write_files(const pal_calibrate_run *run, const pal_loaded_scene *scene, pal_diagnostic *diag)
{
    static pal_err (*const draw[])(const pal_calibrate_run *, const char *, pal_diagnostic *) = {
        NULL, pal_calibrate_draw_trajectory, pal_calibrate_draw_body, pal_calibrate_write_vtk};
    PAL_TRY(pal_scene_save_file(scene, run->path[PAL_CALIBRATE_SCENE], diag));
    for (int k = PAL_CALIBRATE_TRAJECTORY; k < PAL_CALIBRATE_FILES; k++)
        if (run->path[k]) PAL_TRY(draw[k](run, run->path[k], diag));
    return PAL_ERR_OK;
}

/* the scene that was recorded, its touches; unless the user says otherwise with the voxels that it has */
static pal_err open_recording(pal_calibrate_run *run, pal_recorded_input *recorded, pal_diagnostic *diag)
{
    pal_configuration served;
    if (!run->from) return PAL_ERR_OK;
    PAL_TRY(pal_recorded_input_open(run->input.problem, run->from, &run->common, recorded, diag));
    run->input.recorded = &recorded->loads;
    run->replay_equal = recorded->replay.n_hash == recorded->replay.n_hash_equal;
    run->input.scene = recorded->scene.studied.scene;
    pal_configuration_of(run->input.scene, recorded->loads.body, &served);
    if (run->options.voxel.resolution == 0) run->options.voxel.resolution = served.size;
    /* forces on few nodes would be followed best without volume springs, and the body would not bear the next hand */
    run->options.min_volume_ratio = PAL_MIN_VOLUME_RATIO;
    return PAL_ERR_OK;
}

static pal_err work(pal_calibrate_run *run, pal_calibrate_starts *starts, pal_recorded_input *recorded,
                    pal_diagnostic *diag)
{
    pal_loaded_scene *scene = NULL;
    PAL_TRY(pal_calibrate_targets_check(run, diag));
    PAL_TRY(open_recording(run, recorded, diag));
    PAL_TRY(pal_calibrate_cases_read(&run->input, &run->set, diag));
    PAL_TRY(pal_calibrate_targets_check_named(run, diag));
    PAL_TRY(search(run, starts, recorded, diag));
    if (starts->shard.shard) return PAL_ERR_OK;
    PAL_TRY(pal_calibrate_scene(run, &scene, diag));
    pal_err err = settle(run, scene, diag);
    if (!err) {
        pal_calibrate_accuracy(run, scene->scene.accuracy, sizeof scene->scene.accuracy);
        err = write_files(run, scene, diag);
    }
    pal_scene_free(scene);
    return err;
}

static const char *truth_of(const pal_calibrate_run *run, int index)
{
    const char *name = run->set.list[index].truth_name;
    return name ? name : "finite elements";
}

/* ---- report: constants ---- */

/* minimum, median and maximum of a kind on the grid */
typedef struct spread {
    double min, middle, max;
} spread;

static spread spread_of(const pal_calibrate_run *run, int k)
{
    int n = run->info.n_used;
    const double *theta = run->theta + (size_t)k * (size_t)n;
    double *sorted = malloc((size_t)n * sizeof *sorted);
    if (!sorted) return (spread){NAN, NAN, NAN};
    memcpy(sorted, theta, (size_t)n * sizeof *sorted);
    double middle = 0.5 * (pal_median(sorted, n) + sorted[(n - 1) / 2]);
    spread out = {exp(sorted[0]), exp(middle), exp(sorted[n - 1])};
    free(sorted);
    return out;
}

static double ratio_of(const pal_calibrate_run *run, int k)
{
    return exp(run->theta[k * run->info.n_used] - run->info.start[k * run->info.n_used]);
}

/* Number of constants of kind k at a bound: displacements alone do not determine them. */
static int count_bound(const pal_calibrate_run *run, int k)
{
    const pal_calibration_info *i = &run->info;
    int n = 0;
    for (int p = k * i->n_used; p < (k + 1) * i->n_used; p++)
        n += run->theta[p] <= i->low[p] + 1e-6 || run->theta[p] >= i->high[p] - 1e-6;
    return n;
}

/* ---- report: text ---- */

/* "12.34 %", or "no rest" */
static const char *percent(char out[32], double value)
{
    if (isnan(value)) return "-";
    if (!(value < DBL_MAX)) return "no rest";
    snprintf(out, 32, value < 0.0995 ? "%.2g %%" : value < 9.95 ? "%.2f %%" : "%.1f %%", value);
    return out;
}

static void print_row(const pal_calibrate_run *run, const char *id, const char *role, const char *truth, double start,
                      double hand, double found, double live)
{
    char a[32], b[32], c[32], d[32];
    printf("  %-16s %-10s %-18s %10s %10s %10s", id, role, truth, percent(a, start), percent(b, hand),
           percent(c, found));
    if (run->settled) printf(" %12s", percent(d, live));
    printf("\n");
}

static void print_cases(const pal_calibrate_run *run)
{
    printf("\n  %-16s %-10s %-18s %10s %10s %10s%s\n", "load case", "", "truth", "start", "by hand", "calibrated",
           run->settled ? "  live differs" : "");
    int n_fit = 0;
    for (int k = 0; k < run->set.n; k++) {
        bool fit = run->set.list[k].fit;
        n_fit += fit;
        print_row(run, run->set.id[k], fit ? "fitted" : "not fitted", truth_of(run, k), run->start.case_percent[k],
                  run->hand.case_percent[k], run->last.case_percent[k], run->live.load[k].difference_percent);
    }
    if (n_fit > 1)
        print_row(run, "mean", "fitted", "", pal_calibrate_mean(run, &run->start, true),
                  pal_calibrate_mean(run, &run->hand, true), pal_calibrate_mean(run, &run->last, true), NAN);
    printf("\n");
}

/* the touch of a case; NULL: the case is of a problem */
static const pal_recorded_load *touch_of(const pal_calibrate_run *run, int index)
{
    const pal_recorded_loads *r = run->input.recorded;
    return r ? &r->load[run->set.list[index].load_case - run->set.problem->load_case] : NULL;
}

static void print_touches(const pal_calibrate_run *run)
{
    for (int k = 0; k < run->set.n; k++) {
        const pal_recorded_load *t = touch_of(run, k);
        if (!t) continue;
        printf("%s at %.2f s: %.3g N on %d nodes", t->id, t->time_s, pal_norm3(t->total_N), t->n_point);
        if (t->speed_1_s >= PAL_HELD_MAX_1_S)
            printf(", while the body moves by %.2g of its displacement a second", t->speed_1_s);
        printf("\n");
    }
    if (run->from && !run->replay_equal)
        printf("the replay differs from the recording, made by another build or machine: the loads are the replay's\n");
    if (run->from && run->load_share < 1)
        printf("these are %g of the forces of the hand, under which there is no equilibrium\n", run->load_share);
}

static void print_release(const pal_calibrate_run *run)
{
    const pal_recorded_loads *recorded = run->input.recorded;
    const pal_release_report *r = &run->release;
    if (!recorded) return;
    if (r->fitted)
        printf("release at %.2f s: with damping %.3g 1/s the springs return as recorded, %.2g %% RMS of %.2f s\n",
               recorded->release.time_s, r->damping_1_s, r->percent, r->seconds);
    else if (!recorded->has_release)
        printf("release: none to fit the damping to: %s\n", recorded->no_release);
    else if (run->settled && r->percent < DBL_MAX)
        printf("release at %.2f s: the springs return otherwise with any damping, at best %.2g %% RMS of %.2f s\n",
               recorded->release.time_s, r->percent, r->seconds);
    else if (run->settled)
        printf("release: no damping was found before the work allowed was used up\n");
}

static void print_constants(const pal_calibrate_run *run)
{
    for (int k = 0; k < run->info.n_kind; k++) {
        if (!run->info.grid) {
            const bool smallest =
                run->info.kind[k] == PAL_SPRING_VOLUME && run->options.min_volume_ratio > 0 && ratio_of(run, k) < 1;
            printf("%s %.6g J, %.3g times the start%s\n", pal_calibrate_key(run, k, true), exp(run->theta[k]),
                   ratio_of(run, k),
                   !count_bound(run, k) ? ""
                   : smallest           ? ", the smallest with which a body recovers from inversion"
                                        : ", as far as --decades lets it go");
            continue;
        }
        spread s = spread_of(run, k);
        printf("%s %.3g to %.3g J, median %.3g", pal_calibrate_key(run, k, true), s.min, s.max, s.middle);
        if (count_bound(run, k)) printf(", %d as far as --decades lets them go", count_bound(run, k));
        printf("\n");
    }
}

static void print_live(const pal_calibrate_run *run)
{
    double damping = run->damping_1_s;
    bool linear = false;
    for (int k = 0; k < run->set.n; k++) linear |= run->set.list[k].linear;
    if (!run->settled)
        printf("live: stopped before its damping was looked for\n");
    else if (run->live.steady)
        printf(
            "live: steady after %.2f s with damping %g 1/s, as far from the rest that Newton finds as the table says\n",
            run->live.seconds, damping);
    else
        printf("live: no steady state within %.3g s of simulated time; damping %g 1/s\n", run->live.load[0].seconds,
               damping);
    if (run->settled && linear) printf("live: springs bend as they do, where a linear case is linearised\n");
    if (run->n_substep > MANY_SUBSTEPS)
        printf("live: stiff and light: a step of 1/60 s takes %d sub-steps (palpate plan says how long that is here)\n",
               run->n_substep);
}

/* what a shard did */
static void print_shard(const pal_calibrate_starts *s)
{
    printf("shard %d of %d: %d results are in %s, %d of them from before\n", s->shard.index, s->shard.n,
           s->n_before + s->n_new, s->shard.folder, s->n_before);
}

static void print(const pal_calibrate_run *run, const pal_calibrate_starts *starts)
{
    const pal_calibration_info *i = &run->info;
    const pal_fit_result *r = &run->result;
    printf("%s: %d nodes (%d free), %d tetrahedra, voxels of %.4g m, %d springs\n", run->set.problem->name, i->n_node,
           i->n_free, i->n_tet, i->edge_m, i->n_spring);
    if (i->clamped) printf("a Poisson ratio above 0.4999 was taken as 0.4999\n");
    if (i->grid)
        printf("grid %d x %d x %d, %d of its nodes touch the body: %d constants\n", i->grid->n[0], i->grid->n[1],
               i->grid->n[2], i->n_used, i->n_parameter);
    if (starts->n > 1)
        printf("the best of %d searches is that of seed %lld\n", starts->n, (long long)run->fit.seed + starts->chosen);
    printf("%s: %s after %lld evaluations", pal_calibrate_method(run), r->ended, (long long)r->n_evaluation);
    if (r->n_rejected > 0) printf(" (%lld without a rest)", (long long)r->n_rejected);
    printf(" and %.2f s\n", r->seconds);
    print_cases(run);
    print_touches(run);
    print_constants(run);
    print_release(run);
    print_live(run);
    printf("seconds: prepare %.2f, truth %.2f, search %.2f, live %.2f, total %.2f\n", i->prepare_s, i->truth_s,
           r->seconds, run->settle_s, run->total_s);
    for (int k = 0; k < PAL_CALIBRATE_FILES; k++)
        if (run->path[k]) printf("wrote %s\n", run->path[k]);
}

/* ---- report: JSON ---- */

static cJSON *cases_json(const pal_calibrate_run *run)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < run->set.n; k++) {
        const pal_settle_run *live = &run->live.load[k];
        const pal_recorded_load *touch = touch_of(run, k);
        cJSON *o = PAL_JSON(
            {"id", JSON_TEXT(run->set.id[k])}, {"fitted", JSON_BOOL(run->set.list[k].fit)},
            {"truth", JSON_TEXT(truth_of(run, k))},
            {"kinematics", JSON_TEXT(run->set.list[k].linear ? "linear" : "finite")},
            {"start_percent", pal_json_or_null(run->start.case_percent[k])},
            {"hand_percent", pal_json_or_null(run->hand.case_percent[k])},
            {"percent", pal_json_or_null(run->last.case_percent[k])}, {"most_m", pal_json_or_null(run->info.max_m[k])},
            {"points", pal_json_or_null(run->info.n_point[k])},
            {"live_s", pal_json_or_null(run->settled && live->steady ? live->seconds : NAN)},
            {"live_difference_percent", pal_json_or_null(run->settled ? live->difference_percent : NAN)});
        if (touch)
            PAL_JSON_ADD(o, {"time_s", JSON_NUMBER(touch->time_s)}, {"force_N", JSON_NUMBER(pal_norm3(touch->total_N))},
                         {"speed_1_s", pal_json_or_null(touch->speed_1_s)});
        cJSON_AddItemToArray(list, o);
    }
    return list;
}

static void add_constants(const pal_calibrate_run *run, cJSON *o)
{
    const pal_calibration_info *i = &run->info;
    cJSON *constants = cJSON_CreateObject(), *ratio = i->grid ? NULL : cJSON_CreateObject();
    if (i->grid) PAL_JSON_ADD(constants, {"n", cJSON_CreateIntArray(i->grid->n, 3)}, {"used", JSON_NUMBER(i->n_used)});
    for (int k = 0; k < i->n_kind; k++) {
        const char *key = pal_calibrate_key(run, k, false);
        spread s = spread_of(run, k);
        PAL_JSON_ADD(constants,
                     {key, i->grid ? PAL_JSON({"min", pal_json_or_null(s.min)}, {"median", pal_json_or_null(s.middle)},
                                              {"max", pal_json_or_null(s.max)})
                                   : pal_json_or_null(exp(run->theta[k]))});
        if (!i->grid) PAL_JSON_ADD(ratio, {key, pal_json_or_null(ratio_of(run, k))});
    }
    PAL_JSON_ADD(o, {i->grid ? "grid" : "constants", constants}, {"ratio_to_start", ratio});
}

static cJSON *live_json(const pal_calibrate_run *run)
{
    double max = 0;
    cJSON *ladder = cJSON_CreateArray();
    for (int k = 0; k < run->set.n; k++) {
        double d = run->live.load[k].difference_percent;
        max = d <= max ? max : d; /* keeps NaN */
    }
    for (int k = 0; k < PAL_SETTLE_STEPS; k++)
        cJSON_AddItemToArray(ladder, PAL_JSON({"damping_1_s", pal_json_or_null(pal_settle_rates_1_s[k])},
                                              {"steady_s", pal_json_or_null(run->live.rate_seconds[k])}));
    return PAL_JSON({"steady", JSON_BOOL(run->live.steady)}, {"substeps", JSON_NUMBER(run->n_substep)},
                    {"difference_percent", pal_json_or_null(max)}, {"ladder", ladder});
}

static cJSON *release_json(const pal_calibrate_run *run)
{
    const pal_recorded_loads *recorded = run->input.recorded;
    const pal_release_report *r = &run->release;
    if (!recorded || !r->fitted) return cJSON_CreateNull();
    return PAL_JSON({"time_s", JSON_NUMBER(recorded->release.time_s)}, {"seconds", JSON_NUMBER(r->seconds)},
                    {"damping_1_s", JSON_NUMBER(r->damping_1_s)}, {"percent", JSON_NUMBER(r->percent)},
                    {"runs", JSON_NUMBER(r->n_run)});
}

static cJSON *shard_json(const pal_calibrate_starts *s)
{
    return PAL_JSON({"ok", JSON_BOOL(true)}, {"shard", JSON_NUMBER(s->shard.index)}, {"of", JSON_NUMBER(s->shard.n)},
                    {"results", JSON_NUMBER(s->n_before + s->n_new)}, {"before", JSON_NUMBER(s->n_before)});
}

static cJSON *as_json(const pal_calibrate_run *run, const pal_calibrate_starts *starts)
{
    const pal_calibration_info *i = &run->info;
    const pal_fit_result *r = &run->result;
    int n_bound = 0;
    cJSON *files = cJSON_CreateArray();
    for (int k = 0; k < i->n_kind; k++) n_bound += count_bound(run, k);
    for (int k = 0; k < PAL_CALIBRATE_FILES; k++)
        if (run->path[k]) cJSON_AddItemToArray(files, JSON_TEXT(run->path[k]));
    cJSON *seconds = PAL_JSON({"prepare", pal_json_or_null(i->prepare_s)}, {"truth", pal_json_or_null(i->truth_s)},
                              {"fit", pal_json_or_null(r->seconds)}, {"live", pal_json_or_null(run->settle_s)},
                              {"total", pal_json_or_null(run->total_s)});
    cJSON *o =
        PAL_JSON({"ok", JSON_BOOL(true)}, {"problem", JSON_TEXT(run->set.problem->name)}, {"cases", cases_json(run)},
                 {"error_percent", pal_json_or_null(pal_calibrate_mean(run, &run->last, true))},
                 {"start_percent", pal_json_or_null(pal_calibrate_mean(run, &run->start, true))},
                 {"hand_percent", pal_json_or_null(pal_calibrate_mean(run, &run->hand, true))},
                 {"verify_percent", pal_json_or_null(pal_calibrate_mean(run, &run->last, false))},
                 {"method", JSON_TEXT(pal_calibrate_method(run))}, {"evaluations", pal_json_or_null(r->n_evaluation)},
                 {"rejected", pal_json_or_null(r->n_rejected)},
                 {"spent", pal_json_or_null(r->n_spent > 0 ? r->n_spent : r->n_evaluation)},
                 {"ended", JSON_TEXT(r->ended)}, {"starts", run->annealing ? JSON_NUMBER(starts->n) : NULL},
                 {"seed", run->annealing ? JSON_NUMBER(run->fit.seed + (uint64_t)starts->chosen) : NULL});
    add_constants(run, o);
    return PAL_JSON_ADD(o, {"at_bound", pal_json_or_null(n_bound)}, {"nodes", pal_json_or_null(i->n_node)},
                        {"free_nodes", pal_json_or_null(i->n_free)}, {"tets", pal_json_or_null(i->n_tet)},
                        {"springs", pal_json_or_null(i->n_spring)}, {"voxel_m", pal_json_or_null(i->edge_m)},
                        {"weights", JSON_TEXT(run->options.equal ? "equal" : "volume")},
                        {"area_springs", JSON_BOOL(!run->options.without_area)},
                        {"poisson_clamped", JSON_BOOL(i->clamped)}, {"damping_1_s", pal_json_or_null(run->damping_1_s)},
                        {"steady_s", pal_json_or_null(run->settled && run->live.steady ? run->live.seconds : NAN)},
                        {"live", run->settled ? live_json(run) : cJSON_CreateNull()}, {"files", files},
                        {"seconds", seconds}, {"from", run->from ? JSON_TEXT(run->from) : cJSON_CreateNull()},
                        {"replay_equal", run->from ? JSON_BOOL(run->replay_equal) : cJSON_CreateNull()},
                        {"load_share", run->from ? JSON_NUMBER(run->load_share) : cJSON_CreateNull()},
                        {"release", release_json(run)});
}

static int start(pal_calibrate_run *run, pal_calibrate_starts *starts)
{
    pal_diagnostic diag = {""};
    double begin = pal_clock_s();
    pal_stop_watch();
    pal_recorded_input recorded = {0};
    pal_err err = work(run, starts, &recorded, &diag);
    run->total_s = pal_clock_s() - begin;
    const bool shard = starts->shard.shard != NULL;
    cJSON *object = err || !run->common.json ? NULL : shard ? shard_json(starts) : as_json(run, starts);
    int code = pal_report_end(&run->common, err, &diag, object);
    if (!err && !run->common.json && !run->common.quiet) {
        if (shard)
            print_shard(starts);
        else
            print(run, starts);
    }
    pal_calibration_workspace_destroy(run->workspace);
    pal_calibration_destroy(run->calibration);
    pal_calibrate_cases_free(&run->set);
    pal_recorded_input_close(&recorded);
    free(run->theta);
    free(run->trail);
    return code;
}

int command_calibrate(int argc, char **argv)
{
    static pal_calibrate_run run;
    arguments args = {.starts.n = 1};
    run = (pal_calibrate_run){0};
    pal_calibrate_options *o = &run.options;
    pal_calibrate_default(o);
    o->voxel.resolution = 0;
    const pal_flag flag[] = {
        {"--case", "ID[,ID...]", PAL_FLAG_TEXT, &run.input.fit, 0, 0,
         "load cases or references to fit (with --from all touches but those of --verify)"},
        {"--from", "RECORDING", PAL_FLAG_TEXT, &run.from, 0, 0,
         "log of a session (palpate serve --record) of the scene, whose touches are the load cases"},
        {"--verify", "ID[,ID...]", PAL_FLAG_TEXT, &run.input.verify, 0, 0, "others, whose error is only reported"},
        {"-o", "SCENE.json", PAL_FLAG_TEXT, &run.path[PAL_CALIBRATE_SCENE], 0, 0,
         "scene to write; its mesh is written beside it"},
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
        {"--starts", "N", PAL_FLAG_COUNT, &args.starts.n, 1, PAL_CALIBRATE_STARTS_MAX,
         "annealing: N searches with seeds from S on, of which the one with the smallest error is taken (1)"},
        PAL_SHARD_FLAGS(args.starts.shard, "search of --starts"),
        {"--workers", "N", PAL_FLAG_COUNT, &run.fit.n_worker, 1, 256,
         "annealing: threads; the result is the same for any number (one per core)"},
        {"--resolution", "N", PAL_FLAG_COUNT, &o->voxel.resolution, 2, 200,
         "voxels along the longest axis (the least even number that gives more than 700 nodes; with --from the "
         "scene's)"},
        {"--split", "K", PAL_FLAG_COUNT, &o->split, 1, 8,
         "the finite elements of the truth are K x K x K to a voxel (2)"},
        {"--kinematics", "finite|linear", PAL_FLAG_WORD, &run.input.kinematics, 0, 0,
         "neo-Hookean truth and springs as they move; or both linearised (a reference's, or finite)"},
        {"--truth", "WORD", PAL_FLAG_TEXT, &run.input.truth, 0, 0,
         "fem, reference (the CSV of the reference that belongs to a load case), or a file U.csv of x,y,z,ux,uy,uz\n"
         "for the one case that is fitted; with --from fem or recording, the displacement that was recorded (fem)"},
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
        {"--trajectory", "FILE.svg", PAL_FLAG_TEXT, &run.path[PAL_CALIBRATE_TRAJECTORY], 0, 0,
         "plot the error of every evaluation"},
        {"--picture", "FILE.svg", PAL_FLAG_TEXT, &run.path[PAL_CALIBRATE_PICTURE], 0, 0,
         "draw the body at rest, its truth, and the distance of start and result from it; constants on a grid"},
        {"--vtk", "FILE", PAL_FLAG_TEXT, &run.path[PAL_CALIBRATE_VTK], 0, 0,
         "write a legacy VTK file with constants and the displacements of truth and springs"},
    };
    const pal_flag_table table = {
        .usage = "calibrate PROBLEM.json --case ID | SCENE --from RECORDING  -o SCENE.json [flags]",
        .about = about,
        .example = "palpate calibrate deploy/problems/gear.json --case twist --verify push "
                   "--resolution 10 --budget 5 -o gear.json\n"
                   "palpate calibrate deploy/problems/cube.json --case push --grid 3x3x3 "
                   "--resolution 6 --budget 5 --picture cube.svg -o cube.json\n"
                   "palpate prepare --procedural -o organ\n"
                   "palpate serve organ/scene.json --open --record pull.log --port 8390 & "
                   "until palpate-client ws://127.0.0.1:8390/ws --script pull --seconds 60 "
                   "--until moved_mm=10; do sleep 0.2; done; kill $!; wait\n"
                   "palpate calibrate organ/scene.json --from pull.log --resolution 12 --split 1 "
                   "--budget 10 -o fitted.json\n",
        PAL_FLAGS(flag),
        .operands = {1, 1}};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &run.common, &run.input.problem, &n);
    if (code >= 0) return code;
    pal_diagnostic diag;
    if (pal_shard_flags_check(&args.starts.shard, &diag)) return pal_flags_wrong(&run.common, "%s", diag.text);
    const char *sentence = read_arguments(&run, &args);
    if (sentence) return pal_flags_wrong(&run.common, "%s", sentence);
    return start(&run, &args.starts);
}
