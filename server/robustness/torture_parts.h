/* What torture.c and the files of its insults share. Private to these. */
#ifndef PAL_ROBUSTNESS_TORTURE_PARTS_H
#define PAL_ROBUSTNESS_TORTURE_PARTS_H
#include "server/robustness/torture.h"

typedef struct pal_rig {
    pal_scene *scene;        /* the user's, with two tools at least where tools can touch; heap */
    pal_world *world, *twin; /* twin: an untouched run of a scene that is led; else NULL */
    const pal_torture_options *options;
    pal_diagnostic *diag;        /* of the whole run */
    double *rest[PAL_BODY_MAX];  /* where the bodies rest          [n_dof][3] */
    double *start[PAL_BODY_MAX]; /* room for where they are        [n_dof][3] */
    double rest_J;
    double patience_s; /* that bodies have to come back */
    bool anew;         /* rest cannot be put back as positions: it is found again for every insult */
    bool touches;      /* a body has a row that tools push                                         */
    int body;          /* the first such body, else 0                                              */
    double deadline_s; /* processor time at which this insult ends */
    bool late;         /* it was reached                           */
    pal_torture_result *out;
    /* energy less the work of lasting loads: since the last change of those it may only fall */
    double base_J, scale_J, excess_J, allowed_J;
    double forgiven_J; /* rises that were not judged, summed */
    uint64_t n_split;
    int n_skip, since;
    uint64_t count;              /* random numbers drawn */
    bool rests;                  /* the scene does by itself: else nothing can be said about coming back */
    bool needs_rest, asked_back; /* ... has to come back; all bodies that have to did                    */
    bool may_stop[PAL_BODY_MAX], may_stay[PAL_BODY_MAX], stopped[PAL_BODY_MAX]; /* of each body */
    pal_err err;
} pal_rig;

/* one step, watched; false: stop (a number that is none, frozen, late, a step refused) */
bool pal_rig_step(pal_rig *rig, double dt_s);
bool pal_rig_run(pal_rig *rig, double seconds); /* steps of the scene */
/* runs until all bodies have been within 0.1 % S of rest for half a second, at most seconds (where 10 or more are
 * given, patience_s if that is more); sets left_S and back_s */
void pal_rig_relax(pal_rig *rig, double seconds);
/* torture_rest.c */
double pal_rig_patience(const pal_rig *rig);
double pal_rig_speed_S_s(const pal_rig *rig);
bool pal_rig_settle(pal_rig *rig, double *took_s);
void pal_rig_keep(pal_rig *rig, double **to);
bool pal_rig_back_to_rest(pal_rig *rig);
bool pal_rig_lead(pal_rig *rig);
bool pal_rig_step_twin(pal_rig *rig, double dt_s);
double pal_rig_left(const pal_rig *rig);   /* largest RMS from rest of any body over its S */
double pal_rig_energy(const pal_rig *rig); /* energy less the work of lasting loads */
/* loads or shapes have changed from outside: what is there now is what may not grow */
void pal_rig_rebase(pal_rig *rig);
void pal_rig_moved(pal_rig *rig); /* the same after positions were set */
void pal_rig_say(pal_rig *rig, const char *format, ...) __attribute__((format(printf, 2, 3)));
void pal_rig_skip(pal_rig *rig, const char *format, ...) __attribute__((format(printf, 2, 3)));
void pal_rig_fail(pal_rig *rig, const char *format, ...) __attribute__((format(printf, 2, 3)));
void pal_rig_undecided(pal_rig *rig, const char *format, ...) __attribute__((format(printf, 2, 3))); /* unless failed */
/* a rise to this energy is not judged, but summed up */
void pal_rig_forgive(pal_rig *rig, double energy_J);
double pal_rig_random(pal_rig *rig);                /* in (0, 1) */
int pal_rig_far_node(const pal_rig *rig, int body); /* in use and farthest from what is held */
void pal_rig_box(const pal_rig *rig, int body, double low_m[3], double high_m[3]); /* of the nodes now, scene frame */
bool pal_rig_springs(const pal_rig *rig, int body);                                /* it is of model tet_springs */
double pal_rig_cap_N(const pal_rig *rig, int body); /* load_cap_N, or what its weight would be where that is less */

typedef struct pal_insult {
    const char *name, *what, *criterion;
    void (*run)(pal_rig *rig);
} pal_insult;

/* torture_shapes.c */
void pal_insult_flat(pal_rig *rig);
void pal_insult_point(pal_rig *rig);
void pal_insult_mirrored(pal_rig *rig);
void pal_insult_shuffled(pal_rig *rig);
void pal_insult_blown_up(pal_rig *rig);
void pal_insult_stretched(pal_rig *rig);
void pal_insult_poisoned(pal_rig *rig);
void pal_insult_meganewton(pal_rig *rig);
void pal_insult_long_step(pal_rig *rig);
void pal_insult_longer_step(pal_rig *rig);
void pal_insult_stiffer(pal_rig *rig);
void pal_insult_hour(pal_rig *rig);
/* torture_tools.c */
void pal_insult_teleport(pal_rig *rig);
void pal_insult_inside(pal_rig *rig);
void pal_insult_pressed(pal_rig *rig);
void pal_insult_numbers(pal_rig *rig);
void pal_insult_supports(pal_rig *rig);
void pal_insult_random(pal_rig *rig);
#endif
