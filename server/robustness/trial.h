/* A trial: one robustness case run on a world of the scene, monitored at each step and judged. Core of this room;
 * private to it. */
#ifndef PAL_ROBUSTNESS_TRIAL_H
#define PAL_ROBUSTNESS_TRIAL_H
#include "server/base/clock.h"
#include "server/robustness/return_watch.h"
#include "server/robustness/robustness.h"
#include "server/robustness/tuning.h"

typedef struct pal_trial {
    pal_scene *scene;        /* the user's, with at least two tools if tools can touch it; heap */
    pal_world *world, *twin; /* twin: an undisturbed run of a driven scene; otherwise NULL */
    const pal_robustness_options *options;
    pal_diagnostic *diag;        /* of the whole run */
    double *rest[PAL_BODY_MAX];  /* rest positions of the bodies [n_dof][3] */
    double *start[PAL_BODY_MAX]; /* scratch: present positions [n_dof][3] */
    double rest_J;
    /* of the slowest body, 0: not known; of all bodies the largest */
    double lowest_1_s, tau_s;
    bool settles_each; /* rest cannot be restored from positions: it is found again for every case */
    bool touches;      /* a body has a component that tools push */
    int body;          /* the first such body, else 0                                              */
    double deadline_s; /* processor time at which this case ends */
    bool late;         /* it was reached */
    int parameter;     /* of the case */
    pal_robustness_result *out;
    /* Energy less the work of sustained loads. It may only fall after the last change of those loads. */
    double base_J, scale_J, excess_J, allowed_J;
    double excluded_rise_J; /* sum of the rises that were not judged */
    int n_skip, since;
    uint64_t count;    /* random numbers drawn */
    bool rest_late;    /* the processor time was over before the scene was at rest */
    int rest_inverted; /* elements that are inverted at rest, because a body does not bear its loads */
    bool rests;        /* the scene comes to rest by itself, nothing inverted; else the return cannot be judged */
    unsigned causes;   /* reported in this case, bit 1 << pal_cause */
    bool slow;         /* the return was extrapolated to more than PAL_RETURN_TIME_S */
    bool may_stop[PAL_BODY_MAX], may_stay[PAL_BODY_MAX], stopped[PAL_BODY_MAX]; /* of each body */
    pal_err err;
} pal_trial;

static inline double pal_trial_cpu_s(void) /* processor time of this thread */
{
    return 1e-9 * (double)pal_clock_thread_ns();
}

/* Makes one monitored step. False: stop (a value that is not finite, frozen, deadline reached, step refused). */
bool pal_trial_step(pal_trial *trial, double dt_s);
bool pal_trial_run(pal_trial *trial, double seconds); /* steps of the scene */
/* Watches the return (return_watch.h) for `seconds`; if that is PAL_RETURN_TIME_S or more, for as long as the bodies'
 * own time constants may need. Sets deviation_S and return_s and reports how it returned. */
void pal_trial_return(pal_trial *trial, double seconds);
/* trial_rest.c */
void pal_trial_find_times(pal_trial *trial); /* sets lowest_1_s and tau_s, in the rest state */
/* a step with which bodies that creep come to rest soon: some tau_s where all solvers are implicit, else the scene's
 */
double pal_trial_long_step_s(const pal_trial *trial);
double pal_trial_speed_S_s(const pal_trial *trial); /* largest RMS speed of a body over its S */
/* Inverted elements of bodies that have to return. Bodies whose elements are not on their own points count their
 * recoveries since n_recovery. */
int pal_trial_count_inverted(const pal_trial *trial, uint64_t *n_recovery);
bool pal_trial_settle(pal_trial *trial, double *took_s);  /* runs until nothing moves; false: it still does */
void pal_trial_save(const pal_trial *trial, double **to); /* present positions of all bodies */
bool pal_trial_back_to_rest(pal_trial *trial);
bool pal_trial_step_twin(pal_trial *trial, double dt_s);
/* largest RMS from rest of any body over its S; required: of those that must return */
double pal_trial_deviation_S(const pal_trial *trial, bool required);
double pal_trial_energy(const pal_trial *trial); /* energy less the work of lasting loads */
/* Takes the present energy as the new reference, after loads or shapes were changed from outside. */
void pal_trial_rebase(pal_trial *trial);
/* Adds a sentence to the diagnostic. PAL_CAUSE_NONE: only that. */
void pal_trial_report(pal_trial *trial, pal_cause cause, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* Excludes a rise to this energy from judgement and adds it to excluded_rise_J. */
void pal_trial_exclude_rise(pal_trial *trial, double energy_J);
double pal_trial_random(pal_trial *trial); /* in (0, 1) */
/* The far node of every body, the one in use that is farthest from its supports, bears the share of what it can, spread
 * over the nodes within one element of it; share 0: the load is gone. */
void pal_trial_load(pal_trial *trial, double share, const double direction[3]);
int pal_trial_far_node(const pal_trial *trial, int body);
void pal_trial_box(const pal_trial *trial, int body, double low_m[3],
                   double high_m[3]);          /* of the present nodes, scene frame */
void pal_trial_remove_loads(pal_trial *trial); /* lasting loads of all bodies */
/* what a node bears, or the weight of the body if that is smaller, N */
double pal_trial_load_cap_N(const pal_trial *trial, int body, int node);
/* largest diagonal of the present box of a body over its S */
double pal_trial_extent_S(const pal_trial *trial);

typedef enum pal_disturbance {
    PAL_FLAT,
    PAL_POINT,
    PAL_MIRRORED,
    PAL_SHUFFLED,
    PAL_STRETCHED,
    PAL_BLOWN_UP
} pal_disturbance;

typedef struct pal_robustness_case {
    const char *name, *what, *criterion;
    void (*run)(pal_trial *trial);
    int parameter; /* a disturbance, how much longer the steps are, whether the tool jumps */
} pal_robustness_case;

/* runs one case from the rest state in so much processor time, judges it and fills trial->out */
void pal_trial_run_case(pal_trial *trial, const pal_robustness_case *which, double seconds);

/* robustness_shapes.c */
void pal_robustness_shape(pal_trial *trial);
void pal_robustness_poisoned(pal_trial *trial);
void pal_robustness_meganewton(pal_trial *trial);
void pal_robustness_long_step(pal_trial *trial);
void pal_robustness_stiffer(pal_trial *trial);
void pal_robustness_hour(pal_trial *trial);
/* robustness_tools.c */
void pal_robustness_one_tool(pal_trial *trial);
void pal_robustness_pressed(pal_trial *trial);
void pal_robustness_numbers(pal_trial *trial);
void pal_robustness_supports(pal_trial *trial);
void pal_robustness_random(pal_trial *trial);
#endif
