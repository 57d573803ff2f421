/* The contact of one tool with tissue in a sub-step of an implicit solver.
 *
 * Each point near the tool has a spring of stiffness k along `away`. In contact it is active: its load begins at k d,
 * tissue that moves by m along `away` reduces it by k m, and the force is k (d - m). Active springs that pull, and
 * points that came through the sphere, are exchanged and the solver solves again where they bear a noticeable part of
 * the forces, at most three times; after that only where contact would pull as a whole. One that comes through the
 * sphere after its release stays, as the same two choices would follow each other for ever. Coulomb friction is two
 * more springs across the mean direction, as stiff as all springs that are active at first, on the load-weighted mean
 * of the points; beyond friction times the normal force they become that constant force. Springs of points that are
 * only near do not count: a moving tool would begin its sub-step with a load of which the solver's tolerance is the
 * friction itself.
 *
 * Where the solve leaves more than the caps (pal_tool_force_share), all springs of the tool become constant forces
 * shortened to the caps and the solver solves once more (pal_tangent.settle). Tissue then moves less than before, so
 * never past the proxy. A sub-step ends on the forces that it was solved with, and the tool feels those. Thread: [sim].
 */
#ifndef PAL_SIM_CONTACT_CONTACT_IMPLICIT_H
#define PAL_SIM_CONTACT_CONTACT_IMPLICIT_H
#include "server/sim/contact/contact_spring.h"

/* points of one tool; of more, every second, third ... stands for its neighbours */
enum { PAL_CONTACT_IMPLICIT_MAX = 512 };

typedef struct pal_contact_implicit {
    /* of this sub-step, borrowed */
    pal_contact_springs *springs;
    pal_body *body;
    pal_contact *contact; /* [n_contact] */
    double friction;
    int first, n_contact; /* rows of the contacts in pal_contact_springs              */
    int across;           /* first of the two rows of friction; -1: none              */
    double friction_N_m;  /* their stiffness while they stick                         */
    double t[2][3];       /* their directions, unit                                   */
    int round;            /* solves of this sub-step settled so far                   */
    bool constant;        /* the loads are constant forces                            */
    bool staged;          /* the solver has several stages                            */
    bool capped;          /* the caps left less than uncapped_N                       */
    double total_N[3];    /* on the tool, counted in its force                        */
    double uncapped_N;    /* its size before caps                                     */
    double allowed_N;     /* the size that the caps allow                             */
    /* stretch of the friction springs at the start and end of the sub-step, tool minus tissue, m */
    double slip_m[3], next_slip_m[3], tool_move_m[3], normal_N;
    bool slides, next_slides;
    double force_N[PAL_CONTACT_IMPLICIT_MAX + 2]; /* of the loads in body->load, by row from `first` */
    double share[PAL_CONTACT_IMPLICIT_MAX];       /* scratch */
    uint8_t active[PAL_CONTACT_IMPLICIT_MAX];     /* of the contacts */
    uint8_t released[PAL_CONTACT_IMPLICIT_MAX];   /* they were, in this sub-step */
} pal_contact_implicit;

/* keeps at most PAL_CONTACT_IMPLICIT_MAX contacts, stiffer for those left out; returns how many */
int pal_contact_implicit_thin(pal_contact *contact, int n);
/* springs for n contacts with k_N_m and depth_m (below 0: only near); the loads of those in contact go to body->load.
 * move_m: displacement of the tool in this sub-step (for friction) */
void pal_contact_implicit_begin(pal_contact_implicit *solve, pal_contact_springs *springs, pal_body *body,
                                pal_contact *contact, int n, double friction, const double move_m[3]);
/* after a stage that is not the last, springs->motion_m set. True: beyond a cap, loads changed */
bool pal_contact_implicit_cap(pal_contact_implicit *solve, pal_tool *tool);
/* after the last stage: force of every contact, total on the tool. True: loads changed */
bool pal_contact_implicit_settle(pal_contact_implicit *solve, pal_tool *tool);
#endif
