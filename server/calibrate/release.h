/* Damping from a recorded release (paper B section 3.3: k_damp, the drag c = k_damp / m of the component viscous).
 *
 * The forces of the recorded touch act on the calibrated springs, step by step, until the hand lets go. Then the
 * springs return freely. Both motions are compared by their decay curve
 *     d(t) = sqrt(integral from t of u^2 / integral from 0 of u^2),    u: rms displacement,
 * which falls from 1 to 0 and does not oscillate: of an oscillation it is the envelope, whatever the frequency, because
 * springs fitted to finite elements need not oscillate as fast as the body that was recorded. e(c) = sqrt(mean
 * (d - d_recorded)^2), in per cent, is evaluated at rates spread over the whole range in ln c, then a golden section
 * narrows the interval about the best: a slow return has too little damping or too much, so e has two minima. Thread:
 * [load]. */
#ifndef PAL_CALIBRATE_RELEASE_H
#define PAL_CALIBRATE_RELEASE_H
#include "server/calibrate/recorded_loads.h"
#include "server/calibrate/settle.h"

typedef struct pal_release_report {
    /* e is below PAL_RELEASE_PERCENT. False: the springs return otherwise at every rate (percent: the best e; DBL_MAX:
     * the work was used up before all rates were tried, or they do not return) */
    bool fitted;
    double damping_1_s, percent; /* the rate and its e                                       */
    double start_percent;        /* e at the rate of the scene; NaN: it is derived from the mode */
    int n_run;
    double seconds; /* duration of the recorded motion */
} pal_release_report;

/* scene: of one body with the model tet_springs and a mesh of tetrahedra, whose file has the frame of the recording's.
 * Of options: max_work, progress, user. Errors: REFUSED: a scene without exactly one body; errors of pal_world_create;
 * STATE: progress returned false; MEMORY. */
pal_err pal_release_damping(const pal_scene *scene, const pal_recorded_release *release,
                            const pal_settle_options *options, pal_release_report *out, pal_diagnostic *diag);
#endif
