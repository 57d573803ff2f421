/* Insults on a user's own scene, one after another, each judged by the criterion of its hard case: tools that jump or
 * appear inside, a meganewton on a vertex, all nodes in one plane or on one point, mirrored, shuffled, blown up, steps
 * that are too long, numbers that are none, supports switched while deformed, stiffness times a thousand, an hour under
 * load, random orders. Bullet #3882, SOFA #4594 and #5751, FleX #130 are such cases elsewhere.
 *
 * Every insult begins from the scene at its own rest (under gravity, with the tools away), so that one of them alone
 * gives what it gives among all. Common rule: no number that is none, no body stopped unless the insult says so, energy
 * at most what it was after the insult plus 1 % (5 % where the solver is verlet, 30 % where it is central_cg: their
 * velocities are half a sub-step before their positions, which shows as a ripple where much moves fast; a step in which
 * cubes change to their split or back is not judged: the two store other energies in one shape), and after release
 * within 0.1 % S of rest in RMS, S being the box diagonal. A body that nothing holds is compared after the best rigid
 * motion. Springs (tet_springs) untangle; where they may not (model key untangle false), or do not find back, they may
 * stay tangled or be stopped when their shape was taken away: a lattice of lengths and volumes has several rests; they
 * have to be finite, bounded and within 0.1 % S of rest after a reset. Each body of a scene is excused for itself
 * alone. Solids of cells are not excused: one that stays folded fails, is reset to see that this brings it back, and
 * the note says what helps.
 *
 * A scene that a moving support leads for ever is compared with an untouched run beside it instead of with rest; its
 * energy is not judged. Springs that stay away until their reset are told apart: `collapsed`, no failure.
 *
 * Time is simulated; what comes out depends on the scene, the seed and the processor time that is allowed: an insult
 * that runs out of it before it can be judged is `undecided`, which counts as not passed. Thread: [load]. */
#ifndef PAL_ROBUSTNESS_ROBUSTNESS_H
#define PAL_ROBUSTNESS_ROBUSTNESS_H
#include "server/sim/world/world.h"

enum { PAL_ROBUSTNESS_CASES_MAX = 20, PAL_ROBUSTNESS_SAMPLES = 256 };

typedef enum pal_verdict {
    PAL_VERDICT_PASSED,
    PAL_VERDICT_FAILED,
    PAL_VERDICT_UNDECIDED,
    PAL_VERDICT_SKIPPED,
    PAL_VERDICT_COLLAPSED /* springs, as numerics.md part 3 has it: bounded, away from rest, back after a reset */
} pal_verdict;
/* "passed", "FAILED", "undecided", "does not apply", "collapsed" [any] */
const char *pal_verdict_name(pal_verdict verdict);

typedef struct pal_robustness_options {
    uint64_t seed;
    double max_cpu_s; /* processor time of all insults together; 0: 60, more for scenes whose steps are dear */
    const char *only; /* this insult alone; NULL: all                                   */
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
                        insults that ask for it are undecided                                                 */
    bool led;        /* it does not because a moving support leads it: it is judged beside an untouched run */
    double settle_s; /* simulated time that took                                                              */
    double took_s;   /* processor time of everything                                                          */
    int n_passed, n_failed, n_undecided, n_skipped, n_collapsed, n;
    pal_robustness_result result[PAL_ROBUSTNESS_CASES_MAX];
} pal_robustness_report;

int pal_robustness_case_count(void);               /* how many there are [any] */
const char *pal_robustness_case_name(int insult);  /* "teleport" ... [any] */
const char *pal_robustness_case_about(int insult); /* one sentence [any]   */

/* REFUSED: no such insult, what pal_world_create gives; STATE: progress said stop; MEMORY */
pal_err pal_robustness_run(const pal_scene *scene, const pal_robustness_options *options, pal_robustness_report *out,
                           pal_diagnostic *diag);
#endif
