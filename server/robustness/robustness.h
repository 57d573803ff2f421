/* Robustness cases: disturbances known to break simulations, applied one at a time to a user's scene: tools that jump
 * or appear inside a body, a meganewton on a vertex, all nodes in one plane or at one point, steps that are too long,
 * NaN and Inf as input, supports that change, stiffness times a thousand, an hour under load, random commands. Bullet
 * #3882, SOFA #4594 and #5751 and FleX #130 report such cases elsewhere.
 *
 * Every case starts from the scene's own rest state (under gravity, tools away), so that a case run alone gives the
 * same result as in the full suite. Each case has its own criterion; common to all are finite  Every number is finite,
 * and no body is stopped unless the case allows it. energy  At most the energy after the disturbance plus 1 %. Solver
 * verlet 5 %, central_cg 30 %: their velocities lag their positions by half a sub-step, which appears as a ripple. A
 * step in which hexahedra change to or from their split is not judged, because the two store different energies at the
 * same shape. return  Within 0.1 % S of rest in RMS after release, where S is the box diagonal. A body without supports
 * is compared after the best rigid motion.
 *
 * Springs (tet_springs) recover from inversion. A body of springs that may not (model key recover false) or fails to
 * may stay inverted or be stopped, because a lattice of lengths and volumes has several rest states; it must then be
 * finite, bounded and within 0.1 % S of rest after a reset. The verdict is `collapsed`, which is not a failure. A
 * subdivision solid that stays folded fails, and the report states whether a reset helps.
 *
 * A scene driven permanently by a moving support is compared with an undisturbed run beside it, and its energy is not
 * judged.
 *
 * Time is simulated time. The result depends on the scene, the seed and the allowed processor time. A case that runs
 * out of time before it can be judged is `undecided`, which counts as not passed. Thread: [load]. */
#ifndef PAL_ROBUSTNESS_ROBUSTNESS_H
#define PAL_ROBUSTNESS_ROBUSTNESS_H
#include "server/sim/world/world.h"

enum { PAL_ROBUSTNESS_CASES_MAX = 20, PAL_ROBUSTNESS_SAMPLES = 256 };

typedef enum pal_verdict {
    PAL_VERDICT_PASSED,
    PAL_VERDICT_FAILED,
    PAL_VERDICT_UNDECIDED,
    PAL_VERDICT_SKIPPED,
    PAL_VERDICT_COLLAPSED /* springs: bounded, away from rest, at rest after a reset */
} pal_verdict;
/* "passed", "FAILED", "undecided", "does not apply", "collapsed" [any] */
const char *pal_verdict_name(pal_verdict verdict);

typedef struct pal_robustness_options {
    uint64_t seed;
    double max_cpu_s; /* processor time of all cases; 0: 60, more for scenes with expensive steps */
    const char *only; /* runs only this case; NULL: all */
    bool (*progress)(const char *what, double fraction, void *user); /* false: stop; may be NULL */
    void *user;
} pal_robustness_options;
void pal_robustness_default(pal_robustness_options *options);

typedef struct pal_robustness_result {
    const char *name, *what, *criterion; /* constants                                                             */
    pal_verdict verdict;
    char diag[240];      /* what happened, or why the case does not apply */
    bool finite, frozen; /* all values of all bodies were finite throughout; a body was stopped */
    /* largest excess energy over the initial energy plus the work input, as a share of that; its limit. NaN: not
     * judged */
    double energy, limit;
    /* sum of the energy rises that were not judged (hexahedra that change to their split, steps in which tools
     * release), as the same share; NaN: as energy */
    double excluded_rise;
    /* final RMS distance from rest over S; simulated time from release until within 0.1 % to the end, INFINITY:
     * never; NaN: not judged */
    double deviation_S, return_s;
    double simulated_s, took_s;
    pal_safeguards safeguards; /* of all bodies                                                                      */
    int n_sample;              /* energy over that at rest, at equal numbers of steps from the start on */
    double time_s[PAL_ROBUSTNESS_SAMPLES], energy_J[PAL_ROBUSTNESS_SAMPLES];
} pal_robustness_result;

typedef struct pal_robustness_report {
    /* The scene comes to rest by itself. Otherwise the return cannot be judged, and cases that need it are
     * undecided. */
    bool rests;
    /* it does not come to rest because a moving support drives it: it is compared with an undisturbed run */
    bool led;
    double settle_s; /* simulated time until rest */
    double took_s;   /* processor time of the whole run */
    int n_passed, n_failed, n_undecided, n_skipped, n_collapsed, n;
    pal_robustness_result result[PAL_ROBUSTNESS_CASES_MAX];
} pal_robustness_report;

/* "teleport" ...; NULL: there are fewer cases. *about (may be NULL): one sentence. [any] */
const char *pal_robustness_case_name(int index, const char **about);

/* Runs the cases. Errors: REFUSED: no such case; errors of pal_world_create; STATE: progress returned false;
 * MEMORY. */
pal_err pal_robustness_run(const pal_scene *scene, const pal_robustness_options *options, pal_robustness_report *out,
                           pal_diagnostic *diag);
#endif
