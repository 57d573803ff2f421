/* Calibration by gradient: bounded L-BFGS (Nocedal 1980; Luksan's code in NLopt) on theta, with the slope of the
 * adjoint.
 *
 * A point without a stable equilibrium has no value and no slope. The line search then receives a barrier: the last
 * good objective plus a parabola around the last good point, whose slope leads back there. The search shortens its
 * step. */
#include "server/calibrate/calibration.h"

#include "server/base/clock.h"

#include <float.h>
#include <math.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_EVALUATION = 1000, MEMORY_PAIRS = 30, MAX_ROUND = 4, FEW_PARAMETERS = 16 };

typedef struct fit {
    const pal_calibration *c;
    const pal_fit_options *o;
    pal_calibration_workspace *workspace;
    pal_fit_result *out;
    double begin_s;
    double *best, *good, *slope; /* [n_parameter]: best so far; last point with a value, its slope    */
    double best_objective, good_objective;
    double best_percent;
    int64_t max;
    const char *ended; /* NULL: not ended */
    pal_err err;
    pal_diagnostic *diag;
    nlopt_opt opt;
} fit;

static void stop(fit *f, const char *reason)
{
    if (!f->ended) f->ended = reason;
    if (f->ended && f->opt) nlopt_force_stop(f->opt);
}

/* objective and slope at a point; DBL_MAX: none */
static double evaluate(fit *f, const double *theta, double *slope)
{
    size_t n = sizeof(double) * (size_t)f->c->info.n_parameter;
    pal_calibration_value v;
    pal_err err = pal_calibration_evaluate(f->c, f->workspace, theta, PAL_CALIBRATION_FIT | PAL_CALIBRATION_CONTINUE,
                                           &v, slope, f->diag);
    f->out->n_evaluation++;
    if (err == PAL_ERR_MEMORY) {
        f->err = err;
        stop(f, "stopped");
        return DBL_MAX;
    }
    bool rests = !err && v.objective < DBL_MAX, improved = rests && v.objective < f->best_objective;
    f->out->n_rejected += !rests;
    if (improved) {
        memcpy(f->best, theta, n);
        f->best_objective = v.objective;
        f->best_percent = v.error_percent;
    }
    const pal_fit_step step = {.evaluation = f->out->n_evaluation - 1,
                               .error_percent = rests ? v.error_percent : DBL_MAX,
                               .best_percent = f->best_percent,
                               .seconds = pal_clock_s() - f->begin_s,
                               .theta = theta,
                               .improved = improved};
    stop(f, pal_fit_report(f->o, &step, f->max));
    return rests ? v.objective : DBL_MAX;
}

/* the objective passed to NLopt */
static double objective(unsigned n, const double *theta, double *slope, void *user)
{
    fit *f = user;
    size_t n_byte = sizeof(double) * (size_t)n;
    double *to = slope ? slope : f->slope;
    if (f->ended) {
        memset(to, 0, n_byte);
        return f->good_objective;
    }
    double value = evaluate(f, theta, to);
    if (value < DBL_MAX) {
        memcpy(f->good, theta, n_byte);
        f->good_objective = value;
        return value;
    }
    double far = 0, steep = 10;
    for (unsigned i = 0; i < n; i++) {
        double d = theta[i] - f->good[i];
        far += d * d;
        to[i] = 2 * steep * d;
    }
    return f->good_objective + steep * (1 + far);
}

static pal_err search(fit *f, double *theta)
{
    const pal_calibration *c = f->c;
    f->opt = nlopt_create(NLOPT_LD_LBFGS, (unsigned)c->info.n_parameter);
    if (!f->opt) return PAL_ERR_MEMORY;
    nlopt_set_min_objective(f->opt, objective, f);
    nlopt_set_lower_bounds(f->opt, c->low);
    nlopt_set_upper_bounds(f->opt, c->high);
    nlopt_set_vector_storage(f->opt, MEMORY_PAIRS);
    /* of the logarithm: a few constants are optimised to the end of their valley, many are not worth the time */
    nlopt_set_ftol_abs(f->opt, c->info.n_parameter <= FEW_PARAMETERS ? 1e-6 : 3e-4);
    double min;
    nlopt_optimize(f->opt, theta, &min);
    nlopt_destroy(f->opt);
    f->opt = NULL;
    return f->err;
}

static pal_err run(fit *f, double *theta)
{
    const pal_calibration *c = f->c;
    size_t n = sizeof(double) * (size_t)c->info.n_parameter;
    double start = evaluate(f, theta, f->slope);
    f->out->start_percent = f->best_percent;
    if (f->err) return f->err;
    if (!(start < DBL_MAX))
        return pal_diagnostic_set(f->diag, PAL_ERR_NUMERIC,
                                  "the start has no stable rest under its loads, so there is no gradient to follow");
    memcpy(f->good, theta, n);
    f->good_objective = start;
    /* a search may end early at a barrier: restarting at the best point discards its curvature estimates */
    for (int round = 0; round < MAX_ROUND && !f->ended; round++) {
        double before = f->best_objective;
        memcpy(theta, f->best, n);
        memcpy(f->good, f->best, n);
        f->good_objective = f->best_objective;
        PAL_TRY(search(f, theta));
        if (!(f->best_objective < before - 1e-2)) break;
    }
    return PAL_ERR_OK;
}

/* Evaluates the best point again. The mean of squares may fall where the mean of errors does not; the result is
 * never worse than the start. */
static pal_err close_up(fit *f, const double *start, double *theta)
{
    const unsigned all = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY;
    pal_fit_result *out = f->out;
    if (f->best_percent > out->start_percent) memcpy(theta, start, sizeof(double) * (size_t)f->c->info.n_parameter);
    PAL_TRY(pal_calibration_evaluate(f->c, f->workspace, theta, all, &out->value, NULL, f->diag));
    if (out->value.error_percent <= out->start_percent) return PAL_ERR_OK;
    /* no equilibrium, or a worse one: it is reached only from nearby states, and a live body may not find it either */
    memcpy(theta, start, sizeof(double) * (size_t)f->c->info.n_parameter);
    return pal_calibration_evaluate(f->c, f->workspace, theta, all, &out->value, NULL, f->diag);
}

pal_err pal_fit_adjoint(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                        pal_fit_result *out, pal_diagnostic *diag)
{
    const pal_calibration *c = calibration;
    size_t n = (size_t)c->info.n_parameter;
    *out = (pal_fit_result){.start_percent = DBL_MAX};
    fit f = {.c = c,
             .o = options,
             .out = out,
             .begin_s = pal_clock_s(),
             .best_objective = DBL_MAX,
             .best_percent = DBL_MAX,
             .max = options->max_evaluation > 0 ? options->max_evaluation : MAX_EVALUATION,
             .diag = diag};
    f.best = calloc(4 * n, sizeof(double));
    pal_err err = f.best ? pal_calibration_workspace_create(c, &f.workspace) : PAL_ERR_MEMORY;
    if (err) {
        free(f.best);
        return pal_diagnostic_set(diag, err, "no memory to calibrate %d constants", c->info.n_parameter);
    }
    f.good = f.best + n, f.slope = f.good + n;
    double *start = f.slope + n;
    for (size_t i = 0; i < n; i++) start[i] = theta[i] = fmin(fmax(theta[i], c->low[i]), c->high[i]);
    err = run(&f, theta);
    if (f.best_objective < DBL_MAX) memcpy(theta, f.best, n * sizeof(double));
    if (!err) err = close_up(&f, start, theta);
    out->ended = f.ended ? f.ended : "converged";
    out->seconds = pal_clock_s() - f.begin_s;
    pal_calibration_workspace_destroy(f.workspace);
    free(f.best);
    return err;
}
