/* Adaptive simulated annealing (Ingber 1989, 1995; paper B section 3.2): minimises a cost over a box. Each parameter
 * has a temperature, which falls with its own count of candidates and is rescaled by the sensitivities of the cost (re-
 * annealing).
 *
 * Schedule, for D parameters: c = -ln(1e-5) exp(-ln(100)/D), T_i(k) = T0_i exp(-c k_i^(1/D)), T0_i = 1. New value p_i +
 * y (high_i - low_i) with y = sgn(u - 1/2) T_i ((1 + 1/T_i)^|2u - 1| - 1), drawn again until it lies in the box (after
 * 100 draws: uniformly in the box); accepted when u < exp(-(E_new - E_last)/T_acc). The walk begins with n_start random
 * samples, of which the best is the first point, and continues with samples until one has a value. T0_acc is the mean
 * |cost| of the first n_temperature_sample samples with a value; T_acc falls by the same law with the count of accepted
 * points. Costs that are not finite or are DBL_MAX never enter a mean or a difference and are never accepted.
 *
 * Re-annealing: s_i = |difference of the cost| for a step of parameter i, as a fraction of its range, from the best
 * point; T_i <- T_i s_max/s_i, at most T0_i, and k_i from it. A parameter whose s_i is 0 or has no value keeps its
 * temperature. T0_acc <- min(T0_acc, max(|last|, |best|, |last - best|)), T_acc <- min(max(|last - best|, T_acc),
 * T0_acc), and its count from it.
 *
 * Departures: the temperature of a parameter stays at min_temperature_ratio, where Ingber's program ends, because its
 * law soon draws steps of size zero. 1e-10 finds the minima of Rastrigin and Corana as fast as no bound; a smooth bent
 * valley needs 1e-6 (Rosenbrock). Differences are evaluations of the walk and may become the best point. All numbers
 * are fractions of the ranges.
 *
 * Candidates are evaluated in batches, in parallel. Candidate number g takes its random numbers from (seed, g) and the
 * last accepted point; when one of a batch is accepted, those after it are discarded and drawn again from the new
 * point: the walk is that of the serial method for any batch size. Uses the heap while it runs; thread: [load]. */
#ifndef PAL_NUM_ANNEAL_H
#define PAL_NUM_ANNEAL_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { PAL_ANNEAL_MAX_BATCH = 4096 };

/* one evaluation that the walk took, in its order; for trajectories (paper B Fig 8) */
typedef struct pal_anneal_step {
    int64_t generation; /* counted from 0: first, the samples, candidates and differences */
    double cost;        /* DBL_MAX: no value                                              */
    double best;        /* the least so far; DBL_MAX: none yet                            */
    bool accepted;      /* the walk continues from this candidate */
    bool improved;      /* better than all before                                         */
    bool start, probe;  /* start: first or a sample; probe: a difference of re-annealing  */
    const double *p;    /* [n_parameter], borrowed                                        */
} pal_anneal_step;

typedef struct pal_anneal_options {
    int n_parameter;
    const double *low, *high; /* [n_parameter], low < high, finite as their difference        */
    const double *first;      /* a point of the box, evaluated before the samples, or NULL    */
    uint64_t seed;
    int n_start;                  /* 100; may be 0                                                 */
    int n_temperature_sample;     /* 5                                                             */
    int n_batch;                  /* candidates of a batch, to PAL_ANNEAL_MAX_BATCH: 8 */
    int64_t max_evaluation;       /* of the walk; <= 0: no limit                                   */
    double ratio_scale;           /* 1e-5: Temperature_Ratio_Scale, in (0, 1)                      */
    double anneal_scale;          /* 100: Temperature_Anneal_Scale, > 0                            */
    double cost_scale;            /* 1: Cost_Parameter_Scale_Ratio, > 0                            */
    int reanneal_accepted;        /* points accepted since the last re-annealing: 100; 0: never    */
    int reanneal_generated;       /* candidates since then: 10000; 0: never                        */
    double min_temperature_ratio; /* 1e-10: minimum T/T0 of a parameter, in (0, 1) */
    double difference;            /* 1e-3 of the range, in (0, 0.5]: step of the sensitivities     */
    double enough;                /* ends when the best cost is at most this; -DBL_MAX: never      */
    int64_t stall; /* ends after this many evaluations without a better one, counted from the last sample, or from the
                      beginning while no point has a value; 0: never */
    /* cost[i] of point p + i n_parameter for n <= n_batch points at once; DBL_MAX, not finite or not written: no
     * value. An error ends the walk */
    pal_err (*evaluate)(void *user, const double *p, int n, double *cost);
    /* called for every step of the walk in its order; false ends it. May be NULL */
    bool (*step)(void *user, const pal_anneal_step *step);
    void *user;
} pal_anneal_options;

typedef struct pal_anneal_result {
    double best;          /* DBL_MAX: no sample had a value                    */
    int64_t n_evaluation; /* of the walk                                       */
    int64_t n_spent;      /* discarded ones included */
    int64_t n_accepted;   /* candidates                                        */
    int64_t n_failed;     /* of the walk, without a value                      */
    int64_t n_reanneal;
    double temperature; /* T_acc at the end                                  */
} pal_anneal_result;

void pal_anneal_default(pal_anneal_options *options); /* the numbers above; everything else zero */
/* exp(-c k^(1/D)), not below min_temperature_ratio: T/T0 of a parameter after k candidates; thread: any */
double pal_anneal_temperature_ratio(const pal_anneal_options *options, double k);
/* y of the schedule for a uniform u in (0, 1) at temperature T in (0, 1]; thread: any */
double pal_anneal_jump(double temperature, double u);

/* best_p [n_parameter] and *result hold the best so far also after an error; without any value best_p is `first` or the
 * middle of the box. REFUSED, nothing evaluated, best_p unchanged: an empty box, a first point outside of it, numbers
 * outside of the ranges above, or a walk that nothing could end; NUMERIC: the walk ended before any point had a value;
 * MEMORY; errors of evaluate */
pal_err pal_anneal(const pal_anneal_options *options, double *best_p, pal_anneal_result *result, pal_diagnostic *diag);
#endif
