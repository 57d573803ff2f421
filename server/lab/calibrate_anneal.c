/* Calibration by adaptive simulated annealing (paper B 3.2; num/anneal.h): the cost is E, the mean error in per cent; a
 * point without a stable rest has no cost. Needs no slope, so it also checks the adjoint's answer from outside.
 *
 * Every point is evaluated from the start's own rest, never from a neighbour's, on the seat of whichever worker is
 * free: E depends on theta alone and the walk on the seed alone. */
#include "server/lab/calibrate_parts.h"

#include "server/base/clock.h"
#include "server/base/team.h"
#include "server/num/anneal.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_EVALUATION = 4000, MOST_STALL = 1500 };
/* paper B has three constants on a smooth bent valley: steps below this share of the range are of no use (anneal.h) */
static const double COLDEST = 1e-6;

typedef struct fit {
    const pal_calibration *c;
    const pal_fit_options *o;
    pal_team *team;              /* NULL: points are evaluated elsewhere */
    pal_calibration_seat **seat; /* one for each worker [n_seat] */
    pal_err *err;                /* what went wrong on a seat [n_seat] */
    int n_seat;
    pal_fit_result *out;
    double begin_s;
    int64_t most;
    const char *ended; /* NULL: goes on */
    /* the batch at hand */
    const double *theta;
    double *cost;
} fit;

static void evaluate_one(void *user, int worker, int index)
{
    fit *f = user;
    pal_calibration_value v;
    const double *theta = f->theta + (size_t)index * (size_t)f->c->n_parameter;
    pal_err err = pal_calibration_evaluate(f->c, f->seat[worker], theta, PAL_CALIBRATION_FIT, &v, NULL, NULL);
    f->cost[index] = err ? DBL_MAX : v.error_percent;
    if (err == PAL_ERR_MEMORY) f->err[worker] = err;
}

/* a batch of the walk */
static pal_err evaluate(void *user, const double *theta, int n, double *cost)
{
    fit *f = user;
    if (f->o->evaluate) return f->o->evaluate(f->o->user, theta, n, cost);
    f->theta = theta, f->cost = cost;
    pal_team_run(f->team, n, evaluate_one, f);
    for (int i = 0; i < f->n_seat; i++)
        if (f->err[i]) return f->err[i];
    return PAL_ERR_OK;
}

/* shows a step of the walk to the caller; false: enough of it */
static bool tell(void *user, const pal_anneal_step *at)
{
    fit *f = user;
    const pal_fit_options *o = f->o;
    if (at->generation == 0) f->out->start_percent = at->cost;
    pal_fit_step step = {.evaluation = at->generation,
                         .error_percent = at->cost,
                         .best_percent = at->best,
                         .seconds = pal_clock_s() - f->begin_s,
                         .theta = at->p,
                         .improved = at->improved};
    if (o->step && !o->step(o->user, &step))
        f->ended = "stopped";
    else if (o->enough_percent > 0 && at->best <= o->enough_percent)
        f->ended = "enough";
    else if (at->generation + 1 >= f->most)
        f->ended = "evaluations";
    else if (o->budget_s > 0 && step.seconds >= o->budget_s)
        f->ended = "budget";
    return !f->ended;
}

static pal_err walk(fit *f, double *theta, pal_note *note)
{
    const pal_calibration *c = f->c;
    pal_anneal_options a;
    pal_anneal_result r;
    pal_note why = {""};
    pal_anneal_default(&a);
    a.n_parameter = c->n_parameter;
    a.low = c->low, a.high = c->high, a.first = theta;
    a.seed = f->o->seed;
    a.n_batch = f->o->evaluate ? f->o->n_batch : pal_team_size(f->team);
    a.most_evaluation = f->most;
    a.coldest = COLDEST;
    a.stall = MOST_STALL;
    a.evaluate = evaluate;
    a.step = tell;
    a.user = f;
    pal_err err = pal_anneal(&a, theta, &r, &why);
    f->out->n_evaluation = r.n_evaluation;
    f->out->n_rejected = r.n_failed;
    f->out->n_spent = r.n_spent;
    f->out->ended = f->ended ? f->ended : "stalled";
    if (err == PAL_ERR_NUMERIC && r.best == DBL_MAX)
        return pal_note_set(note, err, "none of %lld sets of constants comes to a stable rest under the loads",
                            (long long)r.n_evaluation);
    return err ? pal_note_set(note, err, "%s", why.text[0] ? why.text : pal_err_text(err)) : err;
}

/* team and seats; with points evaluated elsewhere one seat, for the best */
static pal_err make(fit *f)
{
    f->n_seat = 1;
    if (!f->o->evaluate) {
        PAL_TRY(pal_team_create(f->o->n_worker, &f->team));
        f->n_seat = pal_team_size(f->team);
    }
    f->seat = calloc((size_t)f->n_seat, sizeof(pal_calibration_seat *));
    f->err = calloc((size_t)f->n_seat, sizeof *f->err);
    if (!f->seat || !f->err) return PAL_ERR_MEMORY;
    for (int i = 0; i < f->n_seat; i++) PAL_TRY(pal_calibration_seat_create(f->c, &f->seat[i]));
    return PAL_ERR_OK;
}

static void clean_up(fit *f)
{
    pal_team_destroy(f->team);
    for (int i = 0; i < f->n_seat && f->seat; i++) pal_calibration_seat_destroy(f->seat[i]);
    free(f->seat);
    free(f->err);
}

pal_err pal_fit_anneal(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                       pal_fit_result *out, pal_note *note)
{
    const pal_calibration *c = calibration;
    const unsigned all = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY;
    *out = (pal_fit_result){.start_percent = DBL_MAX, .ended = "stopped"};
    fit f = {.c = c,
             .o = options,
             .out = out,
             .begin_s = pal_clock_s(),
             .most = options->most_evaluation > 0 ? options->most_evaluation : MOST_EVALUATION};
    for (int i = 0; i < c->n_parameter; i++) theta[i] = fmin(fmax(theta[i], c->low[i]), c->high[i]);
    pal_err err = make(&f);
    if (err)
        pal_note_set(note, err, "no memory to calibrate %d constants", c->n_parameter);
    else
        err = walk(&f, theta, note);
    if (!err) err = pal_calibration_evaluate(c, f.seat[0], theta, all, &out->value, NULL, note);
    out->seconds = pal_clock_s() - f.begin_s;
    clean_up(&f);
    return err;
}
