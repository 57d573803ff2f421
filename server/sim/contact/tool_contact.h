/* The contact of one tool with one body, and its transfer to another body that takes that one's place between two steps
 * (transfer.h).
 *
 * A transfer keeps the proxy, its side, the stretch of friction, and the force F: the new tissue is pressed at first by
 * F, on the nodes at the same place, and F is released over PAL_BLEND_S while contact rises: force = s F + (1
 * - s) contact,   s = 1 -> 0, so that the force felt does not pass through zero (a proxy that starts again has no
 * depth) nor through one of the other body's contact stiffness. Under a tool that withdraws F falls by k a metre, k the
 * tissue's stiffness under half a radius. Memory: the component's arena; F heap. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_TOOL_CONTACT_H
#define PAL_SIM_CONTACT_TOOL_CONTACT_H
#include "server/sim/contact/contact_implicit.h"
#include "server/sim/contact/contact_patch.h"
#include "server/sim/contact/haptic_stiffness.h"
#include "server/sim/contact/proxy.h"
#include "server/sim/core/effect.h"

/* additional state with an implicit solver */
typedef struct pal_tool_contact_implicit {
    pal_contact_implicit solve;
    pal_contact_patches old_patches; /* published again when the solver solves again */
    int n_old_patch;
    double old_side[3], old_back_m;
    bool published;
    double back_m, last_m[3]; /* distance that the proxy keeps from its tool because of caps; tool a sub-step ago */
} pal_tool_contact_implicit;

/* the force that was transferred */
typedef struct pal_contact_blend {
    bool acts;
    bool begun; /* a sub-step has been */
    int n_node;
    int32_t *node;     /* heap [n_node]                        */
    double *force_N;   /* on them at the switch, heap [n_node][3] */
    double total_N[3]; /* on the tool at the switch            */
    double at_m[3];    /* where the tool was, body frame       */
    double k_N_m, ramp;
    double share;      /* s of this sub-step, 0: contact is alone */
    double part;       /* of the force that acts in this sub-step */
    double now_N[3];   /* part of total_N                       */
    bool friction_due; /* friction begins with the force across that was transferred */
} pal_contact_blend;

/* Row sums of the contact's stiffness, which a solver takes implicitly (body->load_stiffness). share: of Gershgorin's
 * sums that bounds the stiffness, 0: not known */
typedef struct pal_contact_row_sums {
    int n_node;
    int32_t *node;   /* [n_node], room for all of the body's */
    double *sum_N_m; /* [n_node] */
    double share;
} pal_contact_row_sums;

typedef struct pal_tool_contact {
    bool active; /* the proxy is somewhere */
    pal_proxy proxy;
    double ramp;          /* 0..1: rises after the proxy started again */
    double time_behind_s; /* for how long it has been far behind    */
    int32_t *list;        /* contact points near in this step [max_point] */
    int n_list;
    pal_proxy_limits limits;
    pal_contact *contact; /* [CONTACT_MAX] */
    int n_contact;
    double slip[3];            /* displacement of the tool across tissue that friction still holds, m */
    double uncapped_N;         /* normal force of the last sub-step before caps */
    bool retriangulated;       /* other triangles are drawn since the step before */
    double wanted_1_s2;        /* interpolated: stiffness over mass that the solver made its sub-steps for */
    double share;              /* of the stiffness that is stable; falls at once, rises slowly; implicit: 1 */
    pal_contact_row_sums rows; /* explicit only, of this sub-step */
    double total[3];           /* on the tool, this sub-step, this body */
    double torque_Nm[3];       /* counted in the tool's                 */
    pal_haptic_stiffness stiffness;
    pal_contact_patches patches;
    pal_contact_blend hold;
    pal_tool_contact_implicit *implicit; /* implicit solvers only */
} pal_tool_contact;

/* `to`, of `body`, takes the state of `from`, of another body in the same place; points: that body's; place as of
 * pal_effect.transfer; k_N_m as above. Without memory contact begins without F. Both bodies stand still */
void pal_tool_contact_transfer(pal_tool_contact *to, const pal_body *body, const pal_tool_contact *from,
                               const pal_body *old, pal_contact_points *points, const pal_interpolation *place,
                               double k_N_m);
/* before contact in a sub-step: s F to body->load and the tool. here_m: the tool, body frame */
void pal_tool_contact_blend(pal_tool_contact *h, pal_step *step, pal_tool *tool, const double here_m[3]);
/* stretch of friction by the transferred force, also along contact, once; stiffness of the contacts that act now. True:
 * slip_m is set */
bool pal_tool_contact_friction(pal_tool_contact *h, double stiffness_N_m, double slip_m[3]);
void pal_tool_contact_end_blend(pal_tool_contact *h); /* contact is alone again */
void pal_tool_contact_free(pal_tool_contact *h);      /* heap memory */
#endif
