/* Adaptive simulated annealing (Ingber 1989, 1995; paper B 3.2): minimises a cost over a box, with a temperature for
 * each parameter that sinks with its own count and is stretched anew by the cost's sensitivities (re-annealing).
 *
 * Schedule (numerics.md 1 B): c = -ln(1e-5) exp(-ln(100)/D), T_i(k) = T0_i exp(-c k_i^(1/D)), new value
 * p_i + y (high_i - low_i) with y = sgn(u - 1/2) T_i ((1 + 1/T_i)^|2u - 1| - 1), drawn again until it lies in the box;
 * accepted when u < exp(-(E_new - E_last)/T_acc). Begins with n_start random samples, of which the best is the first
 * point; T0_acc is the mean |cost| of the first n_temper good samples. Costs that are not finite or are DBL_MAX never
 * enter a mean or a difference; they are never accepted.
 *
 * Candidates are evaluated in batches, side by side. Candidate number g takes its random numbers from (seed, g) and the
 * last accepted point; when one of a batch is accepted, those after it are thrown away and drawn again from the new
 * point. The walk is therefore that of the serial method, number by number, whatever the size of a batch.
 * Heap while it runs; thread: [load]. */
#ifndef PAL_NUM_ANNEAL_H
#define PAL_NUM_ANNEAL_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

/* one evaluation that the walk took, in its order; for trajectories (paper B Fig 8) */
typedef struct pal_anneal_step {
    int64_t generation;                    /* counted from 0, samples of the start included            */
    double cost;                           /* DBL_MAX: no value                                        */
    double best;                           /* the least so far                                         */
    bool accepted, improved, start, probe; /* start: one of the samples; probe: a difference of re-annealing */
    const double *p;                       /* [n_parameter], borrowed                                  */
} pal_anneal_step;

typedef struct pal_anneal_options {
    int n_parameter;
    const double *low, *high; /* [n_parameter], low < high                            */
    const double *first;      /* a point that is evaluated beside the samples, or NULL */
    uint64_t seed;
    int n_start;                               /* 100                                                  */
    int n_temper;                              /* 5                                                    */
    int n_batch;                               /* candidates evaluated at once: 8                      */
    int64_t most_evaluation;                   /* of the walk; <= 0: no limit                          */
    double ratio_scale;                        /* 1e-5: Temperature_Ratio_Scale                        */
    double anneal_scale;                       /* 100: Temperature_Anneal_Scale                        */
    double cost_scale;                         /* 1: Cost_Parameter_Scale_Ratio                        */
    int reanneal_accepted, reanneal_generated; /* 100, 10000; 0: never               */
    double difference;                         /* 1e-3 of the range: step of the sensitivities         */
    double enough;                             /* ends when the best cost is at most this; -1: never   */
    int64_t stall;                             /* ends after so many evaluations without a better one; 0: never */
    /* cost[i] of point p + i n_parameter for n points at once; DBL_MAX or not finite: no value. An error ends the walk
     */
    pal_err (*evaluate)(void *user, const double *p, int n, double *cost);
    /* called for every step of the walk in its order; false ends it. May be NULL */
    bool (*step)(void *user, const pal_anneal_step *step);
    void *user;
} pal_anneal_options;

typedef struct pal_anneal_result {
    double best;                              /* DBL_MAX: no sample had a value                          */
    int64_t n_evaluation;                     /* of the walk                                             */
    int64_t n_spent;                          /* those thrown away included                              */
    int64_t n_accepted, n_failed, n_reanneal; /* failed: no value                          */
    double temperature;                       /* T_acc at the end                                        */
} pal_anneal_result;

void pal_anneal_default(pal_anneal_options *options); /* the numbers above; everything else zero */
/* best_p [n_parameter] and *result hold the best so far also after an error. REFUSED: a box that is none, no
 * parameters; NUMERIC: no sample had a value within most_evaluation; MEMORY; what evaluate gives */
pal_err pal_anneal(const pal_anneal_options *options, double *best_p, pal_anneal_result *result, pal_note *note);
#endif
