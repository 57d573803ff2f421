/* `palpate bench calibrate`: the calibrations of paper B section 3 on our own gear, cube and bar (deploy/problems), one
 * thread: the twist of the gear by gradient, and by annealing until its error is within 1.2 times that of the gradient
 * or 2000 evaluations are spent; and one constant of each kind against a grid of constants on all three bodies. Truths
 * are finite elements, neo-Hookean; every search starts at the default constants. Searches below a few seconds are
 * repeated, the median counts. */
#include "server/bench/bench.h"
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/calibrate/calibrate_cases.h"
#include "server/cli/median.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 3, MAX_EVALUATION = 2000 };
static const double near_enough = 1.2, short_s = 5;

typedef struct job {
    const char *name, *problem, *fit, *verify;
    int resolution, grid[3];
    bool annealing; /* until its error is near that of the job before it */
} job;

static const job jobs[] = {
    {"gear", "gear.json", "twist", "push", 16, {0}, false},
    {"gear", "gear.json", "twist", "push", 16, {0}, true},
    {"gear", "gear.json", "twist,push", NULL, 16, {0}, false},
    {"gear", "gear.json", "twist,push", NULL, 16, {5, 3, 5}, false},
    {"cube", "cube.json", "push", NULL, 8, {0}, false},
    {"cube", "cube.json", "push", NULL, 8, {3, 3, 5}, false},
    {"bar", "bar.json", "bend,twist_pull", NULL, 20, {0}, false},
    {"bar", "bar.json", "bend,twist_pull", NULL, 20, {9, 3, 3}, false},
};
enum { N_JOB = sizeof jobs / sizeof jobs[0] };

typedef struct result {
    int n_node, n_parameter, n_repeat;
    double start_percent, hand_percent, percent, verify_percent; /* verify: NaN: no such case */
    double make_s, truth_s, fit_s;
    long long n_evaluation, n_rejected;
    const char *ended;
} result;

/* mean over the fitted load cases, or over the others; NaN: none */
static double mean_of(const pal_calibrate_cases *set, const pal_calibration_value *v, bool fit)
{
    double sum = 0;
    int n = 0;
    for (int k = 0; k < set->n; k++)
        if (set->list[k].fit == fit) sum += v->case_percent[k] < DBL_MAX ? v->case_percent[k] : INFINITY, n++;
    return n > 0 ? sum / n : NAN;
}

/* target_percent: annealing ends at this error */
static pal_err search(const job *j, const pal_calibrate_cases *set, const pal_calibration *c, double target_percent,
                      result *out, pal_diagnostic *diag)
{
    enum { ALL = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY };
    pal_calibration_info info;
    pal_calibration_workspace *workspace = NULL;
    pal_calibration_value v = {0};
    pal_fit_result r = {0};
    double seconds[REPEATS];
    pal_calibration_info_of(c, &info);
    double *theta = malloc(sizeof *theta * (size_t)info.n_parameter);
    pal_err err = theta ? pal_calibration_workspace_create(c, &workspace) : PAL_ERR_MEMORY;
    if (!err) pal_calibration_manual_start(c, theta);
    if (!err) err = pal_calibration_evaluate(c, workspace, theta, ALL, &v, NULL, diag);
    out->hand_percent = mean_of(set, &v, true);
    while (!err && out->n_repeat < REPEATS) {
        memcpy(theta, info.start, sizeof *theta * (size_t)info.n_parameter);
        const pal_fit_options o = {.max_evaluation = j->annealing ? MAX_EVALUATION : 0,
                                   .target_percent = j->annealing ? target_percent : 0,
                                   .seed = 1,
                                   .n_worker = 1};
        err = j->annealing ? pal_fit_anneal(c, &o, theta, &r, diag) : pal_fit_adjoint(c, &o, theta, &r, diag);
        seconds[out->n_repeat++] = r.seconds;
        if (r.seconds > short_s) break;
    }
    if (!err) out->fit_s = pal_median(seconds, out->n_repeat);
    out->start_percent = r.start_percent;
    out->percent = mean_of(set, &r.value, true);
    out->verify_percent = mean_of(set, &r.value, false);
    out->n_evaluation = (long long)r.n_evaluation, out->n_rejected = (long long)r.n_rejected;
    out->ended = r.ended;
    out->n_node = info.n_node, out->n_parameter = info.n_parameter;
    out->make_s = info.prepare_s, out->truth_s = info.truth_s;
    pal_calibration_workspace_destroy(workspace);
    free(theta);
    return err;
}

static pal_err run_job(const job *j, const char *folder, double target_percent, result *out, pal_diagnostic *diag)
{
    char path[1200];
    pal_calibrate_options o;
    pal_calibration *c = NULL;
    pal_calibrate_cases *set = calloc(1, sizeof *set);
    *out = (result){.ended = ""};
    if (!set) return PAL_ERR_MEMORY;
    snprintf(path, sizeof path, "%s/%s", folder, j->problem);
    const pal_calibrate_input input = {.problem = path, .fit = j->fit, .verify = j->verify};
    pal_calibrate_default(&o);
    o.voxel.resolution = j->resolution;
    memcpy(o.grid, j->grid, sizeof o.grid);
    pal_err err = pal_calibrate_cases_read(&input, set, diag);
    if (!err) err = pal_calibration_create(set->problem, &set->surface, set->list, set->n, &o, &c, diag);
    if (!err) err = search(j, set, c, target_percent, out, diag);
    pal_calibration_destroy(c);
    pal_calibrate_cases_free(set);
    free(set);
    return err;
}

/* "5x3x5", or "one" */
static const char *grid_text(const job *j, char out[32])
{
    if (j->grid[0] > 0)
        snprintf(out, 32, "%dx%dx%d", j->grid[0], j->grid[1], j->grid[2]);
    else
        snprintf(out, 32, "one");
    return out;
}

static void add_job(bench_report *r, const job *j, const result *c)
{
    char grid[32];
    bench_record(r);
    bench_text(r, "body", "body", -5, j->name);
    bench_text(r, "fitted", "fitted", -16, j->fit);
    bench_text(r, "grid", "constants", -9, grid_text(j, grid));
    bench_number(r, "parameters", "", 6, 0, c->n_parameter);
    bench_text(r, "method", "method", -9, j->annealing ? "annealing" : "adjoint");
    bench_number(r, "nodes", "nodes", 6, 0, c->n_node);
    bench_number(r, "start_percent", "start %", 8, 2, c->start_percent);
    bench_number(r, "manual_percent", "manual %", 8, 2, c->hand_percent);
    bench_number(r, "percent", "found %", 8, 3, c->percent);
    bench_number(r, "verify_percent", "verify %", 9, 2, c->verify_percent);
    bench_number(r, "evaluations", "evaluations", 12, 0, (double)c->n_evaluation);
    bench_number(r, "rejected", NULL, 0, 0, (double)c->n_rejected);
    bench_text(r, "ended", NULL, 0, c->ended);
    bench_number(r, "runs", NULL, 0, 0, c->n_repeat);
    bench_number(r, "prepare_s", NULL, 0, 0, c->make_s);
    bench_number(r, "truth_s", "truth s", 8, 2, c->truth_s);
    bench_number(r, "search_s", "search s", 9, 2, c->fit_s);
}

int bench_calibrate(const char *folder_or_null, bool json)
{
    result all[N_JOB];
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_JOB && !err; k++) {
        double enough = k > 0 ? near_enough * all[k - 1].percent : 0;
        err = run_job(&jobs[k], folder_or_null ? folder_or_null : "deploy/problems", enough, &all[k], &diag);
    }
    if (err == PAL_ERR_IO && !folder_or_null) {
        pal_diagnostic reason = diag;
        pal_diagnostic_set(&diag, err, "%.300s (palpate bench calibrate FOLDER names the folder of the problems)",
                           reason.text);
    }
    bench_report r;
    bench_begin(&r, "calibrate", json);
    bench_note(&r, "springs calibrated on finite elements, RMS in %% of the largest displacement, one thread");
    bench_list(&r, "cases");
    for (int k = 0; k < N_JOB && !err; k++) add_job(&r, &jobs[k], &all[k]);
    if (!err) {
        bench_list(&r, NULL);
        bench_number(&r, "annealing_over_adjoint", NULL, 0, 0, all[1].percent / all[0].percent);
        bench_number(&r, "gear_grid_over_one", NULL, 0, 0, all[3].percent / all[2].percent);
        bench_number(&r, "cube_grid_over_one", NULL, 0, 0, all[5].percent / all[4].percent);
        bench_number(&r, "bar_grid_over_one", NULL, 0, 0, all[7].percent / all[6].percent);
        bench_note(&r, "annealing ended by %s at %.2f times the error of adjoint, after %.1f times its seconds",
                   all[1].ended, all[1].percent / all[0].percent, all[1].fit_s / all[0].fit_s);
        bench_note(&r, "error of the grid over that of one constant of each kind: gear %.2f, cube %.2f, bar %.2f",
                   all[3].percent / all[2].percent, all[5].percent / all[4].percent, all[7].percent / all[6].percent);
    }
    return bench_end(&r, err, &diag);
}
