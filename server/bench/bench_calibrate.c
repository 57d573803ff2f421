/* palpate bench calibrate: the calibrations of paper B section 3 on our own gear, cube and bar (deploy/problems), one
 * thread: the gear's twist by gradient and by annealing, which goes on until its error is within 1.2 times the
 * gradient's or 2000 evaluations are spent, and one constant of each kind against a grid of them on all three bodies.
 * Truths are finite elements, neo-Hookean; everything starts at the default constants. Searches below a few seconds are
 * repeated, the median counts. */
#include "server/bench/bench.h"

#include "server/base/clock.h"
#include "server/calibrate/calibrate_cases.h"
#include "server/cli/median.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 3, MOST_EVALUATION = 2000 };
static const double near_enough = 1.2, short_s = 5;

typedef struct job {
    const char *name, *problem, *fit, *verify;
    int resolution, grid[3];
    bool annealing; /* until it is near the job before it */
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

/* mean over the cases that are fitted, or over the others; NaN: none */
static double mean_of(const pal_calibrate_cases *set, const pal_calibration_value *v, bool fit)
{
    double sum = 0;
    int n = 0;
    for (int k = 0; k < set->n; k++)
        if (set->list[k].fit == fit) sum += v->case_percent[k] < DBL_MAX ? v->case_percent[k] : INFINITY, n++;
    return n > 0 ? sum / n : NAN;
}

/* target_percent: where annealing may end */
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
        const pal_fit_options o = {.max_evaluation = j->annealing ? MOST_EVALUATION : 0,
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

static void print_table(const result *r)
{
    char grid[32];
    printf("calibration of springs on finite elements, RMS in %% of the largest displacement, one thread\n");
    printf("body  fitted           constants        method     nodes  start %%   hand %%  found %%  unseen %%  "
           "evaluations  truth s  search s\n");
    for (int k = 0; k < N_JOB; k++) {
        const job *j = &jobs[k];
        char unseen[16] = "";
        if (!isnan(r[k].verify_percent)) snprintf(unseen, sizeof unseen, "%.2f", r[k].verify_percent);
        printf("%-5s %-16s %-9s %6d  %-9s %6d %8.2f %8.2f %8.3f %9s %12lld %8.2f %9.2f\n", j->name, j->fit,
               grid_text(j, grid), r[k].n_parameter, j->annealing ? "annealing" : "adjoint", r[k].n_node,
               r[k].start_percent, r[k].hand_percent, r[k].percent, unseen, r[k].n_evaluation, r[k].truth_s,
               r[k].fit_s);
    }
    printf("annealing ended by %s at %.2f times the error of adjoint, after %.1f times its seconds\n", r[1].ended,
           r[1].percent / r[0].percent, r[1].fit_s / r[0].fit_s);
    printf("error of the grid over that of one constant of each kind: gear %.2f, cube %.2f, bar %.2f\n",
           r[3].percent / r[2].percent, r[5].percent / r[4].percent, r[7].percent / r[6].percent);
}

static void print_number(const char *key, double number)
{
    if (isfinite(number))
        printf(",\"%s\":%.6g", key, number);
    else
        printf(",\"%s\":null", key);
}

static void print_json(const result *r)
{
    printf("{\"bench\":\"calibrate\",\"cases\":[");
    for (int k = 0; k < N_JOB; k++) {
        const job *j = &jobs[k];
        printf("%s{\"body\":\"%s\",\"fitted\":\"%s\",\"grid\":[%d,%d,%d],\"method\":\"%s\",\"nodes\":%d,"
               "\"parameters\":%d,\"runs\":%d,\"evaluations\":%lld,\"rejected\":%lld,\"ended\":\"%s\"",
               k ? "," : "", j->name, j->fit, j->grid[0], j->grid[1], j->grid[2],
               j->annealing ? "annealing" : "adjoint", r[k].n_node, r[k].n_parameter, r[k].n_repeat, r[k].n_evaluation,
               r[k].n_rejected, r[k].ended);
        print_number("start_percent", r[k].start_percent);
        print_number("hand_percent", r[k].hand_percent);
        print_number("percent", r[k].percent);
        print_number("unseen_percent", r[k].verify_percent);
        print_number("prepare_s", r[k].make_s);
        print_number("truth_s", r[k].truth_s);
        print_number("search_s", r[k].fit_s);
        printf("}");
    }
    printf("]");
    print_number("annealing_over_adjoint", r[1].percent / r[0].percent);
    print_number("gear_grid_over_one", r[3].percent / r[2].percent);
    print_number("cube_grid_over_one", r[5].percent / r[4].percent);
    print_number("bar_grid_over_one", r[7].percent / r[6].percent);
    printf("}\n");
}

int bench_calibrate(const char *folder_or_null, bool json)
{
    result r[N_JOB];
    pal_diagnostic diag = {{0}};
    for (int k = 0; k < N_JOB; k++) {
        double enough = k > 0 ? near_enough * r[k - 1].percent : 0;
        pal_err err = run_job(&jobs[k], folder_or_null ? folder_or_null : "deploy/problems", enough, &r[k], &diag);
        if (!err) continue;
        fprintf(stderr, "palpate bench: calibrate: %s%s\n", diag.text[0] ? diag.text : pal_err_text(err),
                err == PAL_ERR_IO && !folder_or_null ? " (palpate bench calibrate FOLDER says where the problems are)"
                                                     : "");
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    if (json)
        print_json(r);
    else
        print_table(r);
    return 0;
}
