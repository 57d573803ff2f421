/* `palpate bench calibrate`: the calibrations of paper B section 3 on our own gear, cube and bar (deploy/problems), one
 * thread: the twist of the gear by gradient, and by annealing until its error is within 1.2 times that of the gradient
 * or 2000 evaluations are spent; and one constant of each kind against a grid of constants on all three bodies. Truths
 * are finite elements, neo-Hookean; every search starts at the default constants. Searches below a few seconds are
 * repeated, the median counts. */
#include "server/bench/bench.h"

#include "server/calibrate/calibrate_cases.h"
#include "server/num/median.h"

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
    pal_calibration_info info; /* its pointers are valid during the job only */
    pal_fit_result fit;
    int n_repeat;
    double manual_percent, percent, verify_percent; /* verify: NaN: no such case */
    double search_s;
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
    const pal_calibration_info *info = &out->info;
    pal_calibration_workspace *workspace = NULL;
    pal_calibration_value v = {0};
    double seconds[REPEATS];
    pal_calibration_info_of(c, &out->info);
    double *theta = malloc(sizeof *theta * (size_t)info->n_parameter);
    pal_err err = theta ? pal_calibration_workspace_create(c, &workspace) : PAL_ERR_MEMORY;
    if (!err) pal_calibration_manual_start(c, theta);
    if (!err) err = pal_calibration_evaluate(c, workspace, theta, ALL, &v, NULL, diag);
    out->manual_percent = mean_of(set, &v, true);
    while (!err && out->n_repeat < REPEATS) {
        memcpy(theta, info->start, sizeof *theta * (size_t)info->n_parameter);
        const pal_fit_options o = {.max_evaluation = j->annealing ? MAX_EVALUATION : 0,
                                   .target_percent = j->annealing ? target_percent : 0,
                                   .seed = 1,
                                   .n_worker = 1};
        err = j->annealing ? pal_fit_anneal(c, &o, theta, &out->fit, diag)
                           : pal_fit_adjoint(c, &o, theta, &out->fit, diag);
        seconds[out->n_repeat++] = out->fit.seconds;
        if (out->fit.seconds > short_s) break;
    }
    if (!err) out->search_s = pal_median(seconds, out->n_repeat);
    out->percent = mean_of(set, &out->fit.value, true);
    out->verify_percent = mean_of(set, &out->fit.value, false);
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
    *out = (result){.n_repeat = 0};
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

static void add_job(pal_table *r, const job *j, const result *c)
{
    char grid[40] = "one";
    if (j->grid[0] > 0) snprintf(grid, sizeof grid, "%dx%dx%d", j->grid[0], j->grid[1], j->grid[2]);
    TABLE_ROW(
        r, TEXT("body", "body", -5, j->name), TEXT("fitted", "fitted", -16, j->fit),
        TEXT("grid", "constants", -9, grid), NUMBER("parameters", "", 6, 0, c->info.n_parameter),
        TEXT("method", "method", -9, j->annealing ? "annealing" : "adjoint"),
        NUMBER("nodes", "nodes", 6, 0, c->info.n_node), NUMBER("start_percent", "start %", 8, 2, c->fit.start_percent),
        NUMBER("manual_percent", "manual %", 8, 2, c->manual_percent), NUMBER("percent", "found %", 8, 3, c->percent),
        NUMBER("verify_percent", "verify %", 9, 2, c->verify_percent),
        NUMBER("evaluations", "evaluations", 12, 0, (double)c->fit.n_evaluation),
        VALUE("rejected", (double)c->fit.n_rejected), TEXT("ended", NULL, 0, c->fit.ended), VALUE("runs", c->n_repeat),
        VALUE("prepare_s", c->info.prepare_s), NUMBER("truth_s", "truth s", 8, 2, c->info.truth_s),
        NUMBER("search_s", "search s", 9, 2, c->search_s));
}

pal_err bench_calibrate(pal_table *r, pal_diagnostic *diag)
{
    static const char *const key[N_JOB / 2] = {"annealing_over_adjoint", "gear_grid_over_one", "cube_grid_over_one",
                                               "bar_grid_over_one"};
    result all[N_JOB];
    double ratio[N_JOB / 2];
    pal_table_note(r, "springs calibrated on finite elements, RMS in %% of the largest displacement, one thread");
    pal_table_list(r, "cases");
    for (int k = 0; k < N_JOB; k++) {
        double enough = k > 0 ? near_enough * all[k - 1].percent : 0;
        pal_err err = run_job(&jobs[k], r->argument ? r->argument : "deploy/problems", enough, &all[k], diag);
        pal_diagnostic reason = *diag;
        if (err == PAL_ERR_IO && !r->argument)
            pal_diagnostic_set(diag, err, "%.300s (palpate bench calibrate FOLDER names the folder of the problems)",
                               reason.text);
        if (err) return err;
        add_job(r, &jobs[k], &all[k]);
    }
    pal_table_list(r, NULL);
    for (int k = 0; k < N_JOB / 2; k++) {
        ratio[k] = all[2 * k + 1].percent / all[2 * k].percent;
        TABLE_ROW(r, VALUE(key[k], ratio[k]));
    }
    pal_table_note(r, "annealing ended by %s at %.2f times the error of adjoint, after %.1f times its seconds",
                   all[1].fit.ended, ratio[0], all[1].search_s / all[0].search_s);
    pal_table_note(r, "error of the grid over that of one constant of each kind: gear %.2f, cube %.2f, bar %.2f",
                   ratio[1], ratio[2], ratio[3]);
    return PAL_ERR_OK;
}
