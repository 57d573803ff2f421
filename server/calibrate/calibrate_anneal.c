/* Calibration by adaptive simulated annealing (paper B section 3.2; num/anneal.h). The cost is E, the mean error in
 * per cent. A point without a stable equilibrium has no cost. Needs no slope, so it is an independent check of the
 * adjoint.
 *
 * Every point is evaluated from the start's own equilibrium, never from a neighbour's, in the workspace of any free
 * worker. E therefore depends on theta alone, and the walk on the seed alone.
 *
 * ln k_d, ln k_a, ln k_v would form a curved valley across the axes. The walk takes ln G of the lattice's shear modulus
 * (spring_law.h) and the logarithms of k_a/k_d and k_v/k_d, of which G has the largest effect. Evaluations until within
 * 1.2 times the adjoint's error, gear's twist, finite, 16 voxels, seeds 1 to 5: median 262, against 634 along ln k. */
#include "server/calibrate/calibration.h"

#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/base/team.h"
#include "server/calibrate/tuning.h"
#include "server/num/anneal.h"

#include <float.h>
#include <math.h>

enum { MAX_EVALUATION = 4000, MAX_STALL = 1500 };
/* shares of a lattice's shear modulus, by kind (spring_law.h) */
static const double shear[PAL_SPRING_KINDS] = {2.0 / 3, 4.0 / 9, 0};

typedef struct fit {
    const pal_calibration *c;
    const pal_fit_options *o;
    pal_team *team;                        /* NULL: points are evaluated elsewhere */
    pal_calibration_workspace **workspace; /* one per worker [n_workspace] */
    pal_err *err;                          /* error of each worker [n_workspace] */
    int n_workspace, n_batch;
    pal_fit_result *out;
    double begin_s;
    int64_t max;
    const char *ended; /* NULL: not ended */
    /* coordinates of the walk: start, bounds [n_parameter], and the start as theta */
    double *first, *low, *high, *start;
    double *shown, *theta; /* theta of a step [n_parameter], of a batch [n_batch][n_parameter] */
    double *cost;          /* of the current batch; owned by the walk */
} fit;

/* ---- coordinates: ln of the shear modulus, and of the other constants over that of edges, node by node ---- */

static double shear_of(const pal_calibration *c, const double *ratio, int i)
{
    double sum = shear[c->info.kind[0]];
    for (int k = 1; k < c->info.n_kind; k++) sum += shear[c->info.kind[k]] * exp(ratio[k * c->info.n_used + i]);
    return log(sum);
}

static void to_walk(const pal_calibration *c, const double *theta, double *p)
{
    for (int i = 0; i < c->info.n_used; i++) {
        for (int k = 1; k < c->info.n_kind; k++) p[k * c->info.n_used + i] = theta[k * c->info.n_used + i] - theta[i];
        p[i] = theta[i] + shear_of(c, p, i);
    }
}

/* Clamps to the bounds of theta. The first point of the walk is the start bit by bit. */
static void to_theta(const fit *f, const double *p, double *theta)
{
    const pal_calibration *c = f->c;
    size_t n = sizeof(double) * (size_t)c->info.n_parameter;
    if (!memcmp(p, f->first, n)) {
        memcpy(theta, f->start, n);
        return;
    }
    for (int i = 0; i < c->info.n_used; i++) {
        theta[i] = p[i] - shear_of(c, p, i);
        for (int k = 1; k < c->info.n_kind; k++) theta[k * c->info.n_used + i] = theta[i] + p[k * c->info.n_used + i];
    }
    for (int i = 0; i < c->info.n_parameter; i++) theta[i] = fmin(fmax(theta[i], c->low[i]), c->high[i]);
}

/* bounds around the calibration's start that include the start of the walk */
static void make_box(fit *f, const double *theta)
{
    const pal_calibration *c = f->c;
    memcpy(f->start, theta, sizeof(double) * (size_t)c->info.n_parameter);
    to_walk(c, theta, f->first);
    to_walk(c, c->theta, f->shown);
    for (int i = 0; i < c->info.n_parameter; i++) {
        f->low[i] = fmin(f->first[i], f->shown[i] + PAL_ANNEAL_BOX * (c->low[i] - c->theta[i]));
        f->high[i] = fmax(f->first[i], f->shown[i] + PAL_ANNEAL_BOX * (c->high[i] - c->theta[i]));
    }
}

static void evaluate_one(void *user, int worker, int index)
{
    fit *f = user;
    pal_calibration_value v;
    const double *theta = f->theta + (size_t)index * (size_t)f->c->info.n_parameter;
    pal_err err = pal_calibration_evaluate(f->c, f->workspace[worker], theta, PAL_CALIBRATION_FIT, &v, NULL, NULL);
    f->cost[index] = err ? DBL_MAX : v.error_percent;
    if (err == PAL_ERR_MEMORY) f->err[worker] = err;
}

static pal_err evaluate(void *user, const double *p, int n, double *cost)
{
    fit *f = user;
    size_t n_parameter = (size_t)f->c->info.n_parameter;
    for (size_t i = 0; i < (size_t)n; i++) to_theta(f, p + i * n_parameter, f->theta + i * n_parameter);
    if (f->o->evaluate) return f->o->evaluate(f->o->user, f->theta, n, cost);
    f->cost = cost;
    pal_team_run(f->team, n, evaluate_one, f);
    for (int i = 0; i < f->n_workspace; i++)
        if (f->err[i]) return f->err[i];
    return PAL_ERR_OK;
}

/* reports a step of the walk to the caller; false: stop */
static bool report_step(void *user, const pal_anneal_step *at)
{
    fit *f = user;
    if (at->generation == 0) f->out->start_percent = at->cost;
    to_theta(f, at->p, f->shown);
    pal_fit_step step = {.evaluation = at->generation,
                         .error_percent = at->cost,
                         .best_percent = at->best,
                         .seconds = pal_clock_s() - f->begin_s,
                         .theta = f->shown,
                         .improved = at->improved};
    f->ended = pal_fit_report(f->o, &step, f->max);
    return !f->ended;
}

/* *theta: in: the start, out: the best */
static pal_err walk(fit *f, double *theta, pal_diagnostic *diag)
{
    const pal_calibration *c = f->c;
    pal_anneal_options a;
    pal_anneal_result r;
    pal_anneal_default(&a);
    a.n_parameter = c->info.n_parameter;
    a.low = f->low, a.high = f->high, a.first = f->first;
    a.seed = f->o->seed;
    a.n_batch = f->n_batch;
    a.max_evaluation = f->max;
    a.min_temperature_ratio = PAL_ANNEAL_COLDEST;
    a.stall = MAX_STALL;
    a.evaluate = evaluate;
    a.step = report_step;
    a.user = f;
    make_box(f, theta);
    pal_err err = pal_anneal(&a, f->shown, &r, diag);
    if (r.best < DBL_MAX) to_theta(f, f->shown, theta);
    f->out->n_evaluation = r.n_evaluation;
    f->out->n_rejected = r.n_failed;
    f->out->n_spent = r.n_spent;
    f->out->ended = f->ended ? f->ended : "stalled";
    if (err == PAL_ERR_NUMERIC && r.best == DBL_MAX)
        return pal_diagnostic_set(diag, err, "none of %lld sets of constants comes to a stable rest under the loads",
                                  (long long)r.n_evaluation);
    return err;
}

/* team and workspaces; one workspace, for the best point, if points are evaluated elsewhere */
static pal_err make(fit *f)
{
    size_t n = (size_t)f->c->info.n_parameter;
    f->n_workspace = 1;
    f->n_batch = f->o->n_batch < 1 ? 1 : f->o->n_batch > PAL_ANNEAL_MAX_BATCH ? PAL_ANNEAL_MAX_BATCH : f->o->n_batch;
    if (!f->o->evaluate) {
        PAL_TRY(pal_team_create(f->o->n_worker, &f->team));
        f->n_workspace = f->n_batch = pal_team_size(f->team);
    }
    f->first = calloc((5 + (size_t)f->n_batch) * n, sizeof(double));
    if (!f->first) return PAL_ERR_MEMORY;
    f->low = f->first + n, f->high = f->low + n, f->start = f->high + n, f->shown = f->start + n;
    f->theta = f->shown + n;
    f->workspace = calloc((size_t)f->n_workspace, sizeof(pal_calibration_workspace *));
    f->err = calloc((size_t)f->n_workspace, sizeof *f->err);
    if (!f->workspace || !f->err) return PAL_ERR_MEMORY;
    for (int i = 0; i < f->n_workspace; i++) PAL_TRY(pal_calibration_workspace_create(f->c, &f->workspace[i]));
    return PAL_ERR_OK;
}

pal_err pal_fit_anneal(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                       pal_fit_result *out, pal_diagnostic *diag)
{
    const pal_calibration *c = calibration;
    const unsigned all = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY;
    *out = (pal_fit_result){.start_percent = DBL_MAX, .ended = "stopped"};
    fit f = {.c = c,
             .o = options,
             .out = out,
             .begin_s = pal_clock_s(),
             .max = options->max_evaluation > 0 ? options->max_evaluation : MAX_EVALUATION};
    for (int i = 0; i < c->info.n_parameter; i++) theta[i] = fmin(fmax(theta[i], c->low[i]), c->high[i]);
    pal_err err = make(&f);
    if (err)
        pal_diagnostic_set(diag, err, "no memory to calibrate %d constants", c->info.n_parameter);
    else
        err = walk(&f, theta, diag);
    if (!err) err = pal_calibration_evaluate(c, f.workspace[0], theta, all, &out->value, NULL, diag);
    out->seconds = pal_clock_s() - f.begin_s;
    pal_team_destroy(f.team);
    for (int i = 0; i < f.n_workspace && f.workspace; i++) pal_calibration_workspace_destroy(f.workspace[i]);
    PAL_FREE(f.workspace, f.err, f.first);
    return err;
}
