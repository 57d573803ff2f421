/* One tool as row tool_push of one body feels it, and how another body's row goes on with it when that body takes its
 * place between two steps (transfer.h).
 *
 * Handed over are the proxy, its side, what friction holds, and the force: tissue that takes over is pressed at first
 * by the very force of before, on the nodes that lie where those before it were, and that force is let go over
 * PAL_BLEND_TRANSFER_S while contact comes in by as much:
 *     force = s F + (1 - s) contact,   s = 1 -> 0,
 * so that what is felt goes from the force of before to that of after and not by way of none (a proxy that is seated
 * anew has no depth), nor of one that belongs to the other body's contact stiffness. A tool that goes back meanwhile is
 * followed by F less k a metre, k the tissue's stiffness under half a radius.
 * Memory: the world's arena; what is handed over is heap. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_TOOL_CONTACT_H
#define PAL_SIM_CONTACT_TOOL_CONTACT_H
#include "server/sim/contact/contact_implicit.h"
#include "server/sim/contact/contact_patch.h"
#include "server/sim/contact/haptic_stiffness.h"
#include "server/sim/contact/proxy.h"
#include "server/sim/core/effect.h"

/* what a tool needs beside with an implicit solver */
typedef struct pal_tool_contact_implicit {
    pal_contact_implicit solve;
    pal_haptic_stiffness stiffness;
    pal_contact_patches old_patches; /* published anew when the solver asks again */
    int n_old_patch;
    double old_side[3], old_back_m;
    bool published;
    double back_m, last_m[3]; /* the proxy keeps so far back from its tool for the sake of caps; tool a sub-step ago */
} pal_tool_contact_implicit;

/* the force of before */
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
    bool friction_due; /* friction begins with the force across that was handed over */
} pal_contact_blend;

typedef struct pal_tool_contact {
    bool active; /* the proxy is somewhere */
    pal_proxy proxy;
    double ramp;          /* 0..1: rises after the proxy was seated */
    double time_behind_s; /* for how long it has been far behind    */
    int32_t *list;        /* contact points near in this step [max_point] */
    int n_list;
    double nearest_m; /* from the tool's way to the nearest point at the start of the step */
    pal_proxy_limits limits;
    pal_contact *contact; /* [CONTACT_MAX] */
    int n_contact;
    double slip[3];      /* sideways way of the tool over tissue that friction still holds, m */
    double uncapped_N;   /* normal force of the last sub-step before caps */
    bool retriangulated; /* other triangles are drawn since the step before */
    double wanted_1_s2;  /* interpolated: stiffness over mass that the solver made its sub-steps for */
    double share;        /* of the stiffness that is stable; falls at once, rises slowly; implicit: find_stiffening */
    double total[3];     /* on the tool, this sub-step, this body */
    pal_contact_patches patches;
    pal_contact_blend hold;
    pal_tool_contact_implicit *implicit; /* implicit solvers only */
} pal_tool_contact;

/* `to`, of `body`, goes on where `from`, of another body that stands in its place, is; points: that body's, and place
 * as of pal_effect.hand; k_N_m as above, ramp of the tool. Without memory contact begins as it is. Both stand still */
void pal_tool_contact_transfer(pal_tool_contact *to, const pal_body *body, const pal_tool_contact *from,
                               const pal_body *old, pal_contact_points *points, const pal_interpolation *place,
                               double k_N_m);
/* before contact in a sub-step: what is still held of the force of before, to body->load and the tool; share is then
 * what contact leaves to it. here_m: the tool, body frame */
void pal_tool_contact_blend(pal_tool_contact *h, pal_step *step, pal_tool *tool, const double here_m[3]);
/* friction's spring as it is stretched by the force across that was handed over, once: stiffness is that of all
 * contacts as long as the share is what it is. True: slip_m is it */
bool pal_tool_contact_friction(pal_tool_contact *h, const double along[3], double stiffness_N_m, double slip_m[3]);
void pal_tool_contact_end_blend(pal_tool_contact *h); /* contact is alone again */
void pal_tool_contact_free(pal_tool_contact *h);      /* heap memory */
#endif
