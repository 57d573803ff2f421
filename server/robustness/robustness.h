/* Robustness cases: what is known to break simulations, done to a user's own scene, one case after another, each judged
 * by its own criterion. Tools that jump or appear inside, a meganewton on a vertex, all nodes in one plane or on one
 * point, mirrored, shuffled, scaled up, steps that are too long, NaN and Inf as input, supports that change while the
 * body is deformed, stiffness times a thousand, an hour under load, random commands. Bullet #3882, SOFA #4594 and #5751
 * and FleX #130 are such cases elsewhere.
 *
 * Every case begins at the scene's own rest state (under gravity, tools away), so that a case alone gives the same
 * result as among all. The common criterion: finite       every number is finite, and no body is stopped unless the
 * case allows it energy       at most the energy after the disturbance plus 1 %. Solver verlet 5 %, central_cg 30 %:
 * their velocities are half a sub-step before their positions, which shows as a ripple. A step in which hexahedra
 * change to their split or back is not judged: the two store different energies in one shape return       within 0.1 %
 * S of rest in RMS after release, S being the box diagonal. A body without supports is compared after the best rigid
 * motion
 *
 * Springs (tet_springs) recover from inversion. Where they may not (model key recover false) or do not, they may stay
 * inverted or be stopped: a lattice of lengths and volumes has several rest states. They have to be finite, bounded and
 * within 0.1 % S of rest after a reset; the verdict is `collapsed`, which is no failure. Each body of a scene is
 * excused separately. Subdivision solids are not excused: one that stays folded fails, and the report says whether a
 * reset helps.
 *
 * A scene that a moving support drives for ever is compared with an undisturbed run beside it instead of with rest; its
 * energy is not judged.
 *
 * Time is simulated time. The result depends on the scene, the seed and the processor time that is allowed: a case that
 * runs out of time before it can be judged is `undecided`, which counts as not passed. Thread: [load]. */
#ifndef PAL_ROBUSTNESS_ROBUSTNESS_H
#define PAL_ROBUSTNESS_ROBUSTNESS_H
#include "server/sim/world/world.h"

enum { PAL_ROBUSTNESS_CASES_MAX = 20, PAL_ROBUSTNESS_SAMPLES = 256 };

typedef enum pal_verdict {
    PAL_VERDICT_PASSED,
    PAL_VERDICT_FAILED,
    PAL_VERDICT_UNDECIDED,
    PAL_VERDICT_SKIPPED,
    PAL_VERDICT_COLLAPSED /* springs: bounded, away from rest, back after a reset */
} pal_verdict;
/* "passed", "FAILED", "undecided", "does not apply", "collapsed" [any] */
const char *pal_verdict_name(pal_verdict verdict);

typedef struct pal_robustness_options {
    uint64_t seed;
    double max_cpu_s; /* processor time of all cases together; 0: 60, more for scenes whose steps are expensive */
    const char *only; /* this case alone; NULL: all                                   */
    bool (*progress)(const char *what, double fraction, void *user); /* false: stop; may be NULL */
    void *user;
} pal_robustness_options;
void pal_robustness_default(pal_robustness_options *options);

typedef struct pal_robustness_result {
    const char *name, *what, *criterion; /* constants                                                             */
    pal_verdict verdict;
    char diag[240];       /* what happened, or why it does not apply                                            */
    bool finite, frozen;  /* all numbers of all bodies, always; a body was stopped                              */
    double energy, limit; /* most energy beyond what was there and put in, as a share of that, and what is allowed;
                             NaN: not judged                                                                    */
    double excluded_rise; /* sum of the rises that were not judged (cubes that change to their split, the steps in
                        which tools let go), as a share of the same; NaN as energy                         */
    double deviation_S, return_s; /* RMS from rest at the end over S; simulated time after release until within 0.1 %
                              for good, INFINITY: was not; NaN: not judged                                            */
    double simulated_s, took_s;
    pal_safeguards safeguards; /* of all bodies                                                                      */
    int n_sample;              /* energy over that at rest, after each of equally many steps, from the begin on       */
    double time_s[PAL_ROBUSTNESS_SAMPLES], energy_J[PAL_ROBUSTNESS_SAMPLES];
} pal_robustness_result;

typedef struct pal_robustness_report {
    bool rests;      /* the scene comes to rest by itself: without that nothing can be said about coming back, and
                        cases that need it are undecided                                                 */
    bool led;        /* it does not because a moving support leads it: it is judged beside an untouched run */
    double settle_s; /* simulated time that took                                                              */
    double took_s;   /* processor time of everything                                                          */
    int n_passed, n_failed, n_undecided, n_skipped, n_collapsed, n;
    pal_robustness_result result[PAL_ROBUSTNESS_CASES_MAX];
} pal_robustness_report;

int pal_robustness_case_count(void);              /* how many there are [any] */
const char *pal_robustness_case_name(int index);  /* "teleport" ... [any] */
const char *pal_robustness_case_about(int index); /* one sentence [any]   */

/* REFUSED: no such case, what pal_world_create gives; STATE: progress said stop; MEMORY */
pal_err pal_robustness_run(const pal_scene *scene, const pal_robustness_options *options, pal_robustness_report *out,
                           pal_diagnostic *diag);
#endif
