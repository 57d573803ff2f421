/* Damping from a recorded release (paper B section 3.3: k_damp, the drag c = k_damp / m of the component viscous).
 *
 * The forces of the recorded touch act on the calibrated springs, step by step, until the hand lets go. Then the
 * springs return freely, and the amplitude a(t) of recorded_loads.h, of their own u(0), is compared with the recorded
 * one:    e(c) = sqrt(mean (a - a_recorded)^2), in per cent of a(0) = 1.    e is evaluated at rates spread over the
 * whole range in ln c, then a golden section narrows the interval about the best: with oscillations e has more than
 * one minimum. Thread: [load]. */
#ifndef PAL_CALIBRATE_RELEASE_H
#define PAL_CALIBRATE_RELEASE_H
#include "server/calibrate/recorded_loads.h"
#include "server/calibrate/settle.h"

typedef struct pal_release_report {
    bool fitted; /* false: no rate lets the springs return, or the work was used up before all were tried */
    double damping_1_s, percent; /* the rate and its e                                       */
    double start_percent;        /* e at the rate of the scene; NaN: it is derived from the mode */
    bool at_bound;               /* the rate is the smallest or largest that is tried        */
    int n_run;
    double seconds; /* duration of the recorded motion */
} pal_release_report;

/* scene: of one body with the model tet_springs and a mesh of tetrahedra, whose file has the frame of the recording's.
 * Of options: max_work, progress, user. Errors: REFUSED: a scene without exactly one body; errors of pal_world_create;
 * STATE: progress returned false; MEMORY. */
pal_err pal_release_damping(const pal_scene *scene, const pal_recorded_release *release,
                            const pal_settle_options *options, pal_release_report *out, pal_diagnostic *diag);
#endif
