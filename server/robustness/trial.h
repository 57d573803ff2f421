/* A trial: one robustness case that runs on a world of the scene, is watched step by step and judged. Core of this
 * room; private to it. */
#ifndef PAL_ROBUSTNESS_TRIAL_H
#define PAL_ROBUSTNESS_TRIAL_H
#include "server/robustness/robustness.h"

typedef struct pal_trial {
    pal_scene *scene;        /* the user's, with two tools at least where tools can touch; heap */
    pal_world *world, *twin; /* twin: an untouched run of a scene that is led; else NULL */
    const pal_robustness_options *options;
    pal_diagnostic *diag;        /* of the whole run */
    double *rest[PAL_BODY_MAX];  /* where the bodies rest          [n_dof][3] */
    double *start[PAL_BODY_MAX]; /* room for where they are        [n_dof][3] */
    double rest_J;
    double return_time_s; /* that bodies have to come back */
    bool again;           /* rest cannot be put back as positions: it is found again for every case */
    bool touches;         /* a body has a row that tools push                                         */
    int body;             /* the first such body, else 0                                              */
    double deadline_s;    /* processor time at which this case ends */
    bool late;            /* it was reached                           */
    pal_robustness_result *out;
    /* energy less the work of lasting loads: since the last change of those it may only fall */
    double base_J, scale_J, excess_J, allowed_J;
    double excluded_rise_J; /* rises that were not judged, summed */
    uint64_t n_split;
    int n_skip, since;
    uint64_t count;                /* random numbers drawn */
    bool rests;                    /* the scene does by itself: else nothing can be said about coming back */
    bool needs_rest, has_returned; /* ... has to come back; all bodies that have to did                    */
    bool may_stop[PAL_BODY_MAX], may_stay[PAL_BODY_MAX], stopped[PAL_BODY_MAX]; /* of each body */
    pal_err err;
} pal_trial;

/* one step, watched; false: stop (a number that is not finite, frozen, late, a step refused) */
bool pal_trial_step(pal_trial *trial, double dt_s);
bool pal_trial_run(pal_trial *trial, double seconds); /* steps of the scene */
/* runs until all bodies have been within 0.1 % S of rest for half a second, at most seconds (where 10 or more are
 * given, return_time_s if that is more); sets deviation_S and return_s */
void pal_trial_relax(pal_trial *trial, double seconds);
/* trial_rest.c */
double pal_trial_return_time_s(const pal_trial *trial);
double pal_trial_speed_S_s(const pal_trial *trial);
bool pal_trial_settle(pal_trial *trial, double *took_s);
void pal_trial_save(pal_trial *trial, double **to);
bool pal_trial_back_to_rest(pal_trial *trial);
bool pal_trial_make_twin(pal_trial *trial);
bool pal_trial_step_twin(pal_trial *trial, double dt_s);
double pal_trial_deviation_S(const pal_trial *trial); /* largest RMS from rest of any body over its S */
double pal_trial_energy(const pal_trial *trial);      /* energy less the work of lasting loads */
/* loads or shapes have changed from outside: what is there now is what may not grow */
void pal_trial_rebase(pal_trial *trial);
void pal_trial_positions_set(pal_trial *trial); /* the same after positions were set */
/* adds a sentence to what happened. A case that fails or does not apply keeps that verdict; PASSED changes none */
void pal_trial_report(pal_trial *trial, pal_verdict verdict, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* a rise to this energy is not judged, but summed up */
void pal_trial_exclude_rise(pal_trial *trial, double energy_J);
double pal_trial_random(pal_trial *trial);                /* in (0, 1) */
int pal_trial_far_node(const pal_trial *trial, int body); /* in use and farthest from what is held */
void pal_trial_box(const pal_trial *trial, int body, double low_m[3],
                   double high_m[3]);                         /* of the nodes now, scene frame */
bool pal_trial_has_springs(const pal_trial *trial, int body); /* it is of model tet_springs */
double pal_trial_load_cap_N(const pal_trial *trial,
                            int body); /* load_cap_N, or what its weight would be where that is less */

typedef struct pal_robustness_case {
    const char *name, *what, *criterion;
    void (*run)(pal_trial *trial);
} pal_robustness_case;

/* robustness_shapes.c */
void pal_robustness_flat(pal_trial *trial);
void pal_robustness_point(pal_trial *trial);
void pal_robustness_mirrored(pal_trial *trial);
void pal_robustness_shuffled(pal_trial *trial);
void pal_robustness_blown_up(pal_trial *trial);
void pal_robustness_stretched(pal_trial *trial);
void pal_robustness_poisoned(pal_trial *trial);
void pal_robustness_meganewton(pal_trial *trial);
void pal_robustness_long_step(pal_trial *trial);
void pal_robustness_longer_step(pal_trial *trial);
void pal_robustness_stiffer(pal_trial *trial);
void pal_robustness_hour(pal_trial *trial);
/* robustness_tools.c */
void pal_robustness_teleport(pal_trial *trial);
void pal_robustness_inside(pal_trial *trial);
void pal_robustness_pressed(pal_trial *trial);
void pal_robustness_numbers(pal_trial *trial);
void pal_robustness_supports(pal_trial *trial);
void pal_robustness_random(pal_trial *trial);
#endif
