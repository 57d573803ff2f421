/* Live run of the calibrated body: with the components and solver of its scene, the nodal loads of a case are applied
 * at once at rest, and the scene is stepped until it is at rest again (paper B section 3.3). The damping that settles
 * first is chosen. The final state is compared with Newton's equilibrium: the live springs are the fitted ones.
 *
 * At rest: over the free nodes |v| is at most 1e-4 U/T and 3e-5 U/T in the mean, and |a| at most 1e-2 A and 1e-3 A in
 * the mean, for a quarter of a second. U is the largest displacement at that time, A the sum of the load magnitudes
 * over the mass of the free nodes, T = sqrt(U/A) the time scale of the oscillation; so light and heavy loads, stiff and
 * soft bodies are judged alike. Time is simulated time. Thread: [load]. */
#ifndef PAL_CALIBRATE_SETTLE_H
#define PAL_CALIBRATE_SETTLE_H
#include "server/sim/world/world.h"

enum { PAL_SETTLE_LOADS = 8, PAL_SETTLE_STEPS = 6 };

/* damping rates that are tried, 1/s */
extern const double pal_settle_rates_1_s[PAL_SETTLE_STEPS]; /* 0.5, 1, 2, 4, 8, 16 */

typedef struct pal_settle_load {
    const double *force_N; /* [n_node][3]                                           */
    const double *u;       /* displacement to compare with [n_node][3]; NULL: none */
} pal_settle_load;

typedef struct pal_settle_options {
    double damping_1_s;     /* the only rate to try; 0: the rates above */
    double max_simulated_s; /* simulated time per load; default 60 */
    double max_work;        /* sub-steps times tetrahedra, over all runs; default 1.5e9 (20 s of one core) */
    bool (*progress)(const char *what, double fraction, void *user); /* false: stop; may be NULL */
    void *user;
} pal_settle_options;
void pal_settle_default(pal_settle_options *options);

typedef struct pal_settle_run {
    bool steady;
    /* simulated time until at rest, including the quarter of a second; otherwise the duration of the run */
    double seconds;
    double max_m;              /* largest displacement at the end */
    double difference_percent; /* RMS of displacement - u, in per cent of the largest u; NaN: no u */
} pal_settle_run;

/* Makes a world of a scene of one body with a rate of damping, without display and tools. Errors: REFUSED: a scene
 * without exactly one body; errors of pal_world_create. */
pal_err pal_settle_world(const pal_scene *scene, double damping_1_s, pal_world **out, pal_diagnostic *diag);

/* Resets, loads and runs body 0 of a world that was made with damping_1_s > 0. The world keeps its shape and loads.
 * work: in: remaining budget; out: reduced by this run. Errors: STATE: progress returned false; MEMORY. */
pal_err pal_settle(pal_world *world, double step_s, const pal_settle_load *load, const pal_settle_options *options,
                   double *work, pal_settle_run *out, pal_diagnostic *diag);

typedef struct pal_settle_report {
    bool steady;        /* some rate brings all loads to rest */
    double damping_1_s; /* that rate, or the one of the scene */
    double seconds;     /* mean over the loads */
    /* mean over the loads; NaN: not steady, slower than the best, or not tried */
    double rate_seconds[PAL_SETTLE_STEPS];
    pal_settle_run load[PAL_SETTLE_LOADS]; /* at the chosen rate */
} pal_settle_report;

/* Tries the rates on a scene of one body with the model tet_springs. Starts at the rate nearest to 2/T (4/s if no u
 * is given) and goes up while the time falls, otherwise down. Abandons a rate once its mean cannot be the smallest.
 * Errors: REFUSED: no loads or too many, a scene without exactly one body; errors of pal_world_create; STATE,
 * MEMORY. */
pal_err pal_settle_damping(const pal_scene *scene, const pal_settle_load *load, int n_load,
                           const pal_settle_options *options, pal_settle_report *out, pal_diagnostic *diag);
#endif
