/* The calibrated body as it will run live: its scene's own rows and solver, a case's nodal loads put on at once at
 * rest, stepped until all is still (paper B section 3.3), and the damping that is still soonest. Where it comes to rest
 * is compared with Newton's rest: the springs that were fitted are those that run.
 *
 * Still: over the free nodes |v| is at most 1e-4 U/T and 3e-5 U/T in the mean, |a| at most 1e-2 A and 1e-3 A in the
 * mean, for a quarter of a second without a break. U is the largest displacement at that time, A the sum of the loads'
 * sizes over the mass of the free nodes, T = sqrt(U/A) the time in which such a body swings: thresholds that are the
 * same for a light load and a heavy one, for a stiff body and a soft one. Time is simulated time; what comes out
 * depends on the scene alone, not on the machine's speed.
 * Thread: [load]. */
#ifndef PAL_CALIBRATE_SETTLE_H
#define PAL_CALIBRATE_SETTLE_H
#include "server/sim/world/world.h"

enum { PAL_SETTLE_LOADS = 8, PAL_SETTLE_STEPS = 6 };

/* the rates that are tried, 1/s */
extern const double pal_settle_rates_1_s[PAL_SETTLE_STEPS]; /* 0.5, 1, 2, 4, 8, 16 */

typedef struct pal_settle_load {
    const double *force_N; /* [n_node][3]                                           */
    const double *u;       /* displacement to compare with [n_node][3]; NULL: none */
} pal_settle_load;

typedef struct pal_settle_options {
    double max_simulated_s; /* simulated, per load; 60                                                              */
    double max_work;        /* sub-steps times tetrahedra, of all runs together; 1.5e9 (20 s of one core)       */
    bool (*progress)(const char *what, double fraction, void *user); /* false: stop; may be NULL */
    void *user;
} pal_settle_options;
void pal_settle_default(pal_settle_options *options);

typedef struct pal_settle_run {
    bool steady;
    double seconds;            /* simulated until still, the quarter of a second included; else how long it was run */
    double max_m;              /* largest displacement at the end                                         */
    double difference_percent; /* RMS of displacement - u, in per cent of the largest u; NaN: no u          */
} pal_settle_run;

/* body 0 of a world that was made with damping_1_s > 0: reset, loaded, run. The world keeps shape and loads.
 * work: what may be spent, less what was. STATE: progress said stop; MEMORY */
pal_err pal_settle(pal_world *world, double step_s, const pal_settle_load *load, const pal_settle_options *options,
                   double *work, pal_settle_run *out, pal_diagnostic *diag);

typedef struct pal_settle_report {
    bool steady;        /* some rate brings all loads to rest                                         */
    double damping_1_s; /* that one, or the scene's own                                               */
    double seconds;     /* mean over the loads                                                        */
    double rate_seconds[PAL_SETTLE_STEPS]; /* mean over the loads; NaN: not steady, or slower than the best; or not
                                              tried */
    pal_settle_run load[PAL_SETTLE_LOADS]; /* at the rate that was taken */
} pal_settle_report;

/* tries the rates on a scene of one body with the model tet_springs: from the one nearest to 2/T (4/s where no u
 * is given) upwards while that is sooner, else downwards; a rate is given up when its mean can not be the least any
 * more. REFUSED: no loads or too many, a scene of none or several bodies; what pal_world_create gives; STATE, MEMORY */
pal_err pal_settle_damping(const pal_scene *scene, const pal_settle_load *load, int n_load,
                           const pal_settle_options *options, pal_settle_report *out, pal_diagnostic *diag);
#endif
