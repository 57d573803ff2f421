/* One tool's contact with tissue in a sub-step of an implicit solver, which is as long as the whole step.
 *
 * Each point near the tool is a tie (contact_spring.h) of stiffness k along `away`. One that touches acts: its load at
 * the start of the sub-step is k d, the solver takes k back as tissue gives way, and the force that is left is k (d -
 * m), m the tissue's motion along `away`. Those that came out pulling should not have acted, and tissue that would have
 * come through the sphere should: where that is a noticeable part of the forces they are changed and the solver solves
 * again, at most twice; then again only where contact would pull as a whole. Coulomb friction is two more ties across
 * the mean direction, as stiff as all contacts together, on the mean of their points weighted by their loads; where
 * they would pass friction times the normal force, they give that constant force instead.
 *
 * Caps. The sum of the settled forces is bounded by the tool's cap at its ramp and by the node's load_cap_N. When the
 * solve left more, all ties of the tool become constant forces shortened to the cap, and the solver solves once more
 * (pal_tangent.settle); tissue then moves less than before, so never past the proxy, which is itself clamped. So a
 * sub-step ends on the very forces that it was solved with, and the tool feels those, with what ties still pull.
 *
 * Thread: [sim], makes [load]. */
#ifndef PAL_SIM_CONTACT_CONTACT_IMPLICIT_H
#define PAL_SIM_CONTACT_CONTACT_IMPLICIT_H
#include "server/sim/contact/contact_spring.h"
#include "server/sim/contact/tool_force.h"

enum {
    PAL_CONTACT_IMPLICIT_MAX = 512
}; /* points of one tool; of more, every second, third ... stands for its neighbours */

typedef struct pal_contact_implicit {
    int first, n_contact;   /* rows of the contacts in pal_contact_springs                                  */
    int across;             /* first of the two rows of friction, -1: none                       */
    double friction_N_m;    /* their stiffness while they stick                                  */
    double *force_N;        /* of the loads now in body->load, by row from `first` [PAL_CONTACT_IMPLICIT_MAX + 2] */
    double *share;          /* scratch [PAL_CONTACT_IMPLICIT_MAX]                                          */
    double t[2][3];         /* unit directions across                                            */
    bool constant;          /* the loads stay as they are whatever tissue does                   */
    uint8_t *active;        /* contacts that act [PAL_CONTACT_IMPLICIT_MAX]                                */
    int round;              /* solves of this sub-step that were settled, while ties give way    */
    bool staged;            /* the solver has several stages                                     */
    pal_solved_force force; /* on the tool */
    double uncapped_N;      /* what it was before caps                                           */
    double allowed_N;       /* what caps leave of it, or would                                   */
    bool capped;            /* it was more                                                       */
    /* friction: how far its spring is stretched at the start and end of the sub-step, tool minus tissue, m */
    double slip_m[3], next_slip_m[3], tool_move_m[3], normal_N;
    bool slides, next_slides;
} pal_contact_implicit;

pal_err pal_contact_implicit_make(pal_arena *arena, pal_contact_implicit *out);
void pal_contact_implicit_reset(pal_contact_implicit *solve);
/* keeps at most PAL_CONTACT_IMPLICIT_MAX contacts, stiffer for those left out; returns how many */
int pal_contact_implicit_thin(pal_contact *contact, int n);
/* ties for n contacts with k_N_m and depth_m (below 0: only near), and the loads of those that points into body->load;
 * move_m: the tool's own way in this sub-step (friction only) */
void pal_contact_implicit_begin(pal_contact_implicit *solve, pal_contact_springs *springs, pal_contact_points *points,
                                pal_body *body, const pal_contact *contact, int n, double friction,
                                const double move_m[3]);
/* after a stage that is not the last, ties->motion_m taken. True: beyond a cap, loads changed */
bool pal_contact_implicit_cap(pal_contact_implicit *solve, pal_contact_springs *springs, pal_body *body, pal_tool *tool,
                              pal_contact *contact);
/* after the last stage: force of every contact, total on the tool. True: loads changed */
bool pal_contact_implicit_settle(pal_contact_implicit *solve, pal_contact_springs *springs, pal_body *body,
                                 pal_tool *tool, pal_contact *contact, double friction);
#endif
