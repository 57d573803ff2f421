/* Robustness cases: disturbances known to break simulations, applied one at a time to a user's scene: tools that jump
 * or appear inside a body, a meganewton on a vertex, all nodes in one plane or at one point, steps that are too long,
 * NaN and Inf as input, supports that change, stiffness times a thousand, an hour under load, random commands. Bullet
 * #3882, SOFA #4594 and #5751 and FleX #130 report such cases elsewhere.
 *
 * Each case is answered three times:
 *
 * safe       Every number is finite, no body is stopped unless the case allows it, nothing grows without bound, bad
 *            input is refused, and in every step
 *            - the energy is at most that after the disturbance plus 1 %. Solver verlet 5 %, central_cg 30 %: their
 *              velocities lag their positions by half a sub-step, which appears as a ripple. A step in which tools
 *              release is not judged;
 *            - the contact force that was solved for is at most the force cap of the tool.
 * recovered  After release the scene is within 0.1 % S of rest in RMS, S being the box diagonal, or its error falls as
 *            an exponential towards that (return_watch.h); no element is inverted. A body without supports is
 *            compared after the best rigid motion. A body asleep off rest has not recovered.
 * returns    The simulated seconds until it is back, measured or extrapolated.
 *
 * The verdict is `failed` for a case that is not safe or not recovered, `slow` where the return is extrapolated to
 * more than 10 s, else `passed`. Springs whose model key recover is false may stay inverted or be stopped, because a
 * lattice of lengths and volumes has several rest states; they must then be finite, bounded and within 0.1 % S of rest
 * after a reset. The verdict is `collapsed`, which is not a failure.
 *
 * Every case starts from the scene's own rest state (under gravity, tools away), so that a case run alone gives the
 * same result as in the full suite. A scene driven permanently by a moving support is compared with an undisturbed run
 * beside it, and its energy is not judged.
 *
 * Time is simulated time. The result depends on the scene, the seed and the allowed processor time. A case that runs
 * out of time before it can be judged is `undecided`, which is no evidence either way. Thread: [load]. */
#ifndef PAL_ROBUSTNESS_ROBUSTNESS_H
#define PAL_ROBUSTNESS_ROBUSTNESS_H
#include "server/sim/world/world.h"

enum { PAL_ROBUSTNESS_CASES_MAX = 20, PAL_ROBUSTNESS_SAMPLES = 256 };

typedef enum pal_verdict {
    PAL_VERDICT_PASSED,
    PAL_VERDICT_FAILED,
    PAL_VERDICT_UNDECIDED,
    PAL_VERDICT_SKIPPED,
    PAL_VERDICT_COLLAPSED, /* springs: bounded, away from rest, at rest after a reset */
    PAL_VERDICT_SLOW,      /* safe and recovered, but the return takes long           */
    PAL_VERDICT_COUNT
} pal_verdict;
/* "passed", "failed", "undecided", "skipped", "collapsed", "slow" [any] */
const char *pal_verdict_name(pal_verdict verdict);

/* why a case has not the best answer, the gravest first: up to INPUT not safe, up to COLLAPSED not recovered, then
 * not known */
typedef enum pal_cause {
    PAL_CAUSE_NUMBER,  /* a value that is not finite                                   */
    PAL_CAUSE_STOPPED, /* a body was stopped by its safeguards                         */
    PAL_CAUSE_ENERGY,
    PAL_CAUSE_CONTACT, /* contact force beyond the cap                                 */
    PAL_CAUSE_BOUNDS,  /* it grew                                                      */
    PAL_CAUSE_INPUT,   /* bad input accepted, state changed by a refusal, failed reset */
    PAL_CAUSE_INVERTED,
    PAL_CAUSE_ASLEEP,
    PAL_CAUSE_STUCK,
    PAL_CAUSE_MOVES,
    PAL_CAUSE_COLLAPSED, /* springs that may not recover                              */
    PAL_CAUSE_SECONDS,   /* the processor time was over                                  */
    PAL_CAUSE_NO_REST,   /* the scene does not come to rest by itself                    */
    PAL_CAUSE_NOT_APPLICABLE,
    PAL_CAUSE_NONE
} pal_cause;
/* "not finite", "stopped", "energy", "contact cap", "grew", "input", "inverted", "asleep", "stuck", "moves",
 * "collapsed", "seconds", "no rest", "does not apply", "" [any] */
const char *pal_cause_name(pal_cause cause);

typedef struct pal_robustness_options {
    uint64_t seed;
    double max_cpu_s; /* processor time of all cases; 0: 60, more for scenes with expensive steps */
    const char *only; /* runs only this case; NULL: all */
    bool (*progress)(const char *what, double fraction, void *user); /* false: stop; may be NULL */
    void *user;
} pal_robustness_options;
void pal_robustness_default(pal_robustness_options *options);

typedef enum pal_answer { PAL_UNKNOWN, PAL_NO, PAL_YES } pal_answer;

typedef struct pal_robustness_result {
    const char *name, *what, *criterion; /* constants                                                             */
    pal_verdict verdict;
    pal_answer safe, recovered; /* UNKNOWN: not judged, or the case has no such question */
    pal_cause cause;            /* the gravest one */
    char diag[240];             /* what happened, or why the case does not apply */
    bool finite, frozen;        /* all values of all bodies were finite throughout; a body was stopped */
    /* largest excess energy over the initial energy plus the work input, as a share of that; its limit. NaN: not
     * judged */
    double energy, limit;
    /* sum of the energy rises that were not judged (steps in which tools release), as the same share; NaN: as energy */
    double excluded_rise;
    double peak_contact_N, contact_cap_N; /* largest solved contact force of a tool, and that tool's cap */
    /* final RMS distance from rest over S; simulated time from release until within 0.1 % to the end, measured or
     * extrapolated, INFINITY: never; NaN: not judged */
    double deviation_S, return_s;
    double simulated_s, took_s;
    double needs_s;            /* cause SECONDS: processor time that this case may need, about; else 0 */
    pal_safeguards safeguards; /* of all bodies                                                                      */
    int n_sample;              /* energy over that at rest, at equal numbers of steps from the start on */
    double time_s[PAL_ROBUSTNESS_SAMPLES], energy_J[PAL_ROBUSTNESS_SAMPLES];
} pal_robustness_result;

typedef struct pal_robustness_report {
    /* The scene comes to rest by itself, nothing inverted. Otherwise the return cannot be judged, and cases that need
     * it are undecided. */
    bool rests, late;  /* late: the processor time was over before it did */
    int rest_inverted; /* elements inverted at rest: a body does not bear its weight and lasting loads */
    /* it does not come to rest because a moving support drives it: it is compared with an undisturbed run */
    bool driven;
    double settle_s; /* simulated time until rest */
    /* lowest angular frequency of the slowest body and the largest time constant; 0: not known */
    double lowest_1_s, tau_s;
    double took_s;                   /* processor time of the whole run */
    int n, count[PAL_VERDICT_COUNT]; /* cases, and of each verdict      */
    pal_robustness_result result[PAL_ROBUSTNESS_CASES_MAX];
} pal_robustness_report;

/* "teleport" ...; NULL: there are fewer cases. *about (may be NULL): one sentence. [any] */
const char *pal_robustness_case_name(int index, const char **about);

/* Runs the cases. Errors: REFUSED: no such case; errors of pal_world_create; STATE: progress returned false;
 * MEMORY. */
pal_err pal_robustness_run(const pal_scene *scene, const pal_robustness_options *options, pal_robustness_report *out,
                           pal_diagnostic *diag);
#endif
