/* Adaptive simulated annealing. The walk is a sequence of evaluations numbered from 0. Number g has a random key of its
 * own, of which counter 0 decides acceptance and the others draw the values. */
#include "server/num/anneal.h"

#include "server/base/heap.h"
#include "server/num/random.h"
#include "server/num/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct walk {
    const pal_anneal_options *o;
    pal_anneal_result *r;
    pal_diagnostic *diag;
    int n, n_batch;
    double *best, *last;  /* points                               [n]           */
    double last_cost;     /* DBL_MAX: the walk has no point yet                 */
    double *k;            /* count of a parameter's temperature at the last re-annealing [n] */
    double *sensitivity;  /* s_i, 0: none                         [n]           */
    double *p, *cost;     /* points of a batch and their costs    [n_batch][n], [n_batch] */
    double t0, k_accept;  /* start temperature of acceptance, its count         */
    double sum_temper[2]; /* |costs| of the first good samples: sum / n_temperature_sample, number */
    int64_t since_better, since_accepted, since_generated;
    bool ended;
} walk;

void pal_anneal_default(pal_anneal_options *options)
{
    pal_anneal_options *o = options;
    *o = (pal_anneal_options){.n_start = 100, .n_temperature_sample = 5, .n_batch = 8, .enough = -DBL_MAX};
    o->ratio_scale = 1e-5, o->anneal_scale = 100, o->cost_scale = 1;
    o->reanneal_accepted = 100, o->reanneal_generated = 10000;
    o->min_temperature_ratio = 1e-10, o->difference = 1e-3;
}

static double rate(const pal_anneal_options *o)
{
    return -log(o->ratio_scale) * exp(-log(o->anneal_scale) / o->n_parameter);
}

static double cool(double c, int n, double k, double min_temperature_ratio)
{
    return fmax(min_temperature_ratio, exp(-c * pow(k, 1.0 / n)));
}

/* the count at which T/T0 is the ratio */
static double count_of(double c, int n, double ratio, double min_temperature_ratio)
{
    return pow(-log(fmin(1, fmax(min_temperature_ratio, ratio))) / c, n);
}

double pal_anneal_temperature_ratio(const pal_anneal_options *options, double k)
{
    return cool(rate(options), options->n_parameter, k, options->min_temperature_ratio);
}

double pal_anneal_jump(double temperature, double u)
{
    double size = temperature * expm1(fabs(2 * u - 1) * log1p(1 / temperature));
    return u < 0.5 ? -size : size;
}

static double acceptance_temperature(const walk *w)
{
    return w->t0 * cool(w->o->cost_scale * rate(w->o), w->n, w->k_accept, ANNEAL_COLDEST);
}

static uint64_t key_of(const walk *w, int64_t number)
{
    return pal_random_bits(w->o->seed, (uint64_t)number);
}

static double uniform_point(const walk *w, int i, double u)
{
    double low = w->o->low[i], high = w->o->high[i];
    return fmin(high, fmax(low, low + u * (high - low)));
}

static void draw_sample(const walk *w, int64_t number, double *p)
{
    uint64_t key = key_of(w, number);
    for (int i = 0; i < w->n; i++) p[i] = uniform_point(w, i, pal_random_unit(key, (uint64_t)i + 1));
}

/* the count of parameter i after the candidates so far and `ahead` more: one sum, the same for every batch size */
static double count_at(const walk *w, int i, int ahead)
{
    return w->k[i] + (double)(w->since_generated + ahead);
}

/* a candidate from the last accepted point, with `ahead` candidates before it */
static void draw_candidate(const walk *w, int64_t number, int ahead, double *p)
{
    const pal_anneal_options *o = w->o;
    const double c = rate(o);
    uint64_t key = key_of(w, number), counter = 1;
    for (int i = 0; i < w->n; i++) {
        double t = cool(c, w->n, count_at(w, i, ahead), o->min_temperature_ratio), range = o->high[i] - o->low[i];
        int draw = 0;
        do p[i] = w->last[i] + range * pal_anneal_jump(t, pal_random_unit(key, counter++));
        while (!(p[i] >= o->low[i] && p[i] <= o->high[i]) && ++draw < ANNEAL_MAX_DRAW);
        if (draw == ANNEAL_MAX_DRAW) p[i] = uniform_point(w, i, pal_random_unit(key, counter++));
    }
}

/* costs of the first m points of the batch */
static pal_err evaluate(walk *w, int m)
{
    for (int j = 0; j < m; j++) w->cost[j] = DBL_MAX;
    w->r->n_spent += m;
    PAL_TRY(w->o->evaluate(w->o->user, w->p, m, w->cost));
    for (int j = 0; j < m; j++)
        if (!isfinite(w->cost[j])) w->cost[j] = DBL_MAX;
    return PAL_ERR_OK;
}

/* number of m evaluations that the limit still allows */
static int allowed(const walk *w, int64_t m)
{
    int64_t left = w->o->max_evaluation > 0 ? w->o->max_evaluation - w->r->n_evaluation : INT64_MAX;
    if (m > w->n_batch) m = w->n_batch;
    return (int)(m < left ? m : left);
}

/* records point j of the batch as an evaluation of the walk: the best point, the stopping criteria, the callback */
static void record(walk *w, int j, pal_anneal_step step)
{
    const pal_anneal_options *o = w->o;
    pal_anneal_result *r = w->r;
    step.p = w->p + (size_t)j * (size_t)w->n;
    step.cost = w->cost[j];
    step.generation = r->n_evaluation++;
    step.improved = step.cost < r->best;
    r->n_failed += step.cost == DBL_MAX;
    r->n_accepted += step.accepted;
    w->since_better++;
    if (step.improved) {
        r->best = step.cost;
        memcpy(w->best, step.p, sizeof(double) * (size_t)w->n);
        w->since_better = 0;
    }
    step.best = r->best;
    if (o->step && !o->step(o->user, &step)) w->ended = true;
    if (o->max_evaluation > 0 && r->n_evaluation >= o->max_evaluation) w->ended = true;
    if (o->enough > -DBL_MAX && r->best <= o->enough) w->ended = true;
    /* samples never count as a stall, unless none has a value */
    bool sampling = step.start && (r->best < DBL_MAX || r->n_evaluation - (o->first != NULL) < o->n_start);
    if (o->stall > 0 && w->since_better >= o->stall && !sampling) w->ended = true;
}

/* takes cost j as the first point when it is the best so far, and into the mean of T0_acc when it is a sample */
static void record_start(walk *w, int j, bool sample)
{
    double cost = w->cost[j];
    if (sample && cost < DBL_MAX && w->sum_temper[1] < w->o->n_temperature_sample) {
        w->sum_temper[0] += fabs(cost) / w->o->n_temperature_sample;
        w->sum_temper[1]++;
    }
    if (cost < w->last_cost) {
        w->last_cost = cost;
        memcpy(w->last, w->p + (size_t)j * (size_t)w->n, sizeof(double) * (size_t)w->n);
    }
    record(w, j, (pal_anneal_step){.start = true});
}

static pal_err start(walk *w)
{
    const pal_anneal_options *o = w->o;
    if (o->first) {
        memcpy(w->p, w->best, sizeof(double) * (size_t)w->n);
        PAL_TRY(evaluate(w, 1));
        record_start(w, 0, false);
    }
    for (int64_t sample = 0; !w->ended && (sample < o->n_start || w->last_cost == DBL_MAX);) {
        int m = allowed(w, sample < o->n_start ? o->n_start - sample : w->n_batch);
        for (int j = 0; j < m; j++) draw_sample(w, w->r->n_evaluation + j, w->p + (size_t)j * (size_t)w->n);
        PAL_TRY(evaluate(w, m));
        for (int j = 0; j < m && !w->ended; j++) {
            record_start(w, j, true);
            sample++;
            /* beyond n_start the first value ends the sampling */
            if (sample >= o->n_start && w->last_cost < DBL_MAX) break;
        }
    }
    w->since_better = 0;
    w->t0 = w->sum_temper[1] > 0 ? w->sum_temper[0] * (o->n_temperature_sample / w->sum_temper[1]) : fabs(w->last_cost);
    return PAL_ERR_OK;
}

/* sensitivities at the best point, in the walk's own batches */
static pal_err probe(walk *w)
{
    const pal_anneal_options *o = w->o;
    const double centre_cost = w->r->best;
    double *centre = w->sensitivity + w->n;
    memcpy(centre, w->best, sizeof(double) * (size_t)w->n);
    for (int i = 0; i < w->n; i++) w->sensitivity[i] = 0;
    for (int i = 0; i < w->n && !w->ended;) {
        int m = allowed(w, w->n - i);
        for (int j = 0; j < m; j++) {
            double *p = w->p + (size_t)j * (size_t)w->n, h = o->difference * (o->high[i + j] - o->low[i + j]);
            memcpy(p, centre, sizeof(double) * (size_t)w->n);
            p[i + j] += p[i + j] + h <= o->high[i + j] ? h : -h;
        }
        PAL_TRY(evaluate(w, m));
        for (int j = 0; j < m && !w->ended; j++) {
            double s = fabs(w->cost[j] - centre_cost);
            if (w->cost[j] < DBL_MAX && isfinite(s)) w->sensitivity[i + j] = s;
            record(w, j, (pal_anneal_step){.probe = true});
        }
        i += m;
    }
    return PAL_ERR_OK;
}

static pal_err reanneal(walk *w)
{
    const double c = rate(w->o), min_temperature_ratio = w->o->min_temperature_ratio;
    double t = acceptance_temperature(w), max = 0;
    for (int i = 0; i < w->n; i++) w->k[i] = count_at(w, i, 0);
    w->since_accepted = w->since_generated = 0;
    PAL_TRY(probe(w));
    if (w->ended) return PAL_ERR_OK;
    for (int i = 0; i < w->n; i++) max = fmax(max, w->sensitivity[i]);
    for (int i = 0; i < w->n; i++)
        if (w->sensitivity[i] > 0)
            w->k[i] = count_of(c, w->n, cool(c, w->n, w->k[i], min_temperature_ratio) * (max / w->sensitivity[i]),
                               min_temperature_ratio);
    double last = w->last_cost, best = w->r->best, apart = fabs(last - best);
    w->t0 = fmin(w->t0, fmax(fmax(fabs(last), fabs(best)), apart));
    if (!(w->t0 > 0)) w->t0 = DBL_MIN;
    t = fmin(fmax(apart, t), w->t0);
    w->k_accept = count_of(w->o->cost_scale * c, w->n, t / w->t0, ANNEAL_COLDEST);
    w->r->n_reanneal++;
    return PAL_ERR_OK;
}

static bool is_accepted(const walk *w, double cost, int64_t number)
{
    if (cost == DBL_MAX) return false;
    double rise = cost - w->last_cost;
    return rise <= 0 || pal_random_unit(key_of(w, number), 0) < exp(-rise / acceptance_temperature(w));
}

/* one batch of candidates, up to the first that is accepted */
static pal_err advance(walk *w)
{
    const pal_anneal_options *o = w->o;
    const int64_t number = w->r->n_evaluation;
    int m = allowed(w, o->reanneal_generated > 0 ? o->reanneal_generated - w->since_generated : INT64_MAX);
    for (int j = 0; j < m; j++) draw_candidate(w, number + j, j, w->p + (size_t)j * (size_t)w->n);
    PAL_TRY(evaluate(w, m));
    bool accepted = false;
    for (int j = 0; j < m && !accepted && !w->ended; j++) {
        accepted = is_accepted(w, w->cost[j], number + j);
        w->since_generated++;
        if (accepted) {
            w->k_accept++;
            w->since_accepted++;
            w->last_cost = w->cost[j];
            memcpy(w->last, w->p + (size_t)j * (size_t)w->n, sizeof(double) * (size_t)w->n);
        }
        record(w, j, (pal_anneal_step){.accepted = accepted});
    }
    bool due = (o->reanneal_accepted > 0 && w->since_accepted >= o->reanneal_accepted) ||
               (o->reanneal_generated > 0 && w->since_generated >= o->reanneal_generated);
    return due && !w->ended ? reanneal(w) : PAL_ERR_OK;
}

static pal_err check_box(const pal_anneal_options *o, pal_diagnostic *diag)
{
    if (o->n_parameter < 1 || !o->low || !o->high)
        return PAL_REFUSE(diag, "annealing: %d parameters, wanted 1 at least", o->n_parameter);
    for (int i = 0; i < o->n_parameter; i++) {
        double low = o->low[i], high = o->high[i];
        if (!(low < high) || !isfinite(high - low))
            return PAL_REFUSE(diag, "annealing: parameter %d lies between %g and %g, which is no range", i, low, high);
        if (o->first && !(o->first[i] >= low && o->first[i] <= high))
            return PAL_REFUSE(diag, "annealing: parameter %d begins at %g, outside of %g to %g", i, o->first[i], low,
                              high);
    }
    return PAL_ERR_OK;
}

static pal_err check_numbers(const pal_anneal_options *o, pal_diagnostic *diag)
{
    if (o->n_start < 0 || o->n_temperature_sample < 1 || o->n_batch < 1 || o->n_batch > PAL_ANNEAL_MAX_BATCH)
        return PAL_REFUSE(
            diag, "annealing: n_start %d, n_temper %d, n_batch %d, wanted 0, 1 and 1 at least, n_batch at most %d",
            o->n_start, o->n_temperature_sample, o->n_batch, (int)PAL_ANNEAL_MAX_BATCH);
    const double ratio = o->ratio_scale, scale = o->anneal_scale, c = rate(o), cost = o->cost_scale,
                 coldest = o->min_temperature_ratio, h = o->difference;
    const struct {
        bool valid;
        const char *name, *wanted;
        double value;
    } number[] = {{ratio > 0 && ratio < 1, "ratio_scale", "between 0 and 1", ratio},
                  {scale > 0 && isfinite(scale) && c > 0 && isfinite(c), "anneal_scale", "above 0", scale},
                  {cost > 0 && cost * c > 0 && isfinite(cost * c), "cost_scale", "above 0", cost},
                  {coldest > 0 && coldest < 1, "coldest", "between 0 and 1", coldest},
                  {h > 0 && h <= 0.5, "difference", "above 0 and at most 0.5", h}};
    for (size_t k = 0; k < sizeof number / sizeof *number; k++)
        if (!number[k].valid)
            return PAL_REFUSE(diag, "annealing: %s %g, wanted %s", number[k].name, number[k].value, number[k].wanted);
    if (isnan(o->enough) || !o->evaluate)
        return PAL_REFUSE(diag, "annealing: enough is no number, or there is nothing to evaluate");
    if (o->max_evaluation <= 0 && o->stall <= 0 && !o->step)
        return PAL_REFUSE(diag, "annealing: no limit of evaluations, no stall and no step: no end");
    return PAL_ERR_OK;
}

static pal_err run_walk(walk *w)
{
    PAL_TRY(start(w));
    if (w->r->best == DBL_MAX)
        return pal_diagnostic_set(w->diag, PAL_ERR_NUMERIC, "annealing: none of %lld points had a value",
                                  (long long)w->r->n_evaluation);
    while (!w->ended) PAL_TRY(advance(w));
    return PAL_ERR_OK;
}

pal_err pal_anneal(const pal_anneal_options *options, double *best_p, pal_anneal_result *result, pal_diagnostic *diag)
{
    const pal_anneal_options *o = options;
    *result = (pal_anneal_result){.best = DBL_MAX};
    PAL_TRY(check_box(o, diag));
    PAL_TRY(check_numbers(o, diag));
    walk w = {.o = o, .r = result, .diag = diag, .n = o->n_parameter, .n_batch = o->n_batch, .last_cost = DBL_MAX};
    const size_t n = (size_t)w.n, batch = (size_t)w.n_batch;
    /* best, last, k, sensitivity and its centre; then the batch */
    double *memory = calloc(5 + batch, sizeof(double) * n);
    w.cost = calloc(batch, sizeof *w.cost);
    pal_err err = PAL_ERR_OK;
    if (!memory || !w.cost) {
        err = pal_diagnostic_set(diag, PAL_ERR_MEMORY, "annealing: no memory for %d points of %d parameters", w.n_batch,
                                 w.n);
    } else {
        w.best = memory;
        w.last = memory + n;
        w.k = memory + 2 * n;
        w.sensitivity = memory + 3 * n;
        w.p = memory + 5 * n;
        for (int i = 0; i < w.n; i++) w.best[i] = o->first ? o->first[i] : 0.5 * o->low[i] + 0.5 * o->high[i];
        err = run_walk(&w);
        memcpy(best_p, w.best, sizeof(double) * n);
        result->temperature = result->best < DBL_MAX ? acceptance_temperature(&w) : 0;
    }
    PAL_FREE(w.cost, memory);
    return err;
}
