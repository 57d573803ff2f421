/* A grip (tool_grab) that goes on on another body in the same place (transfer.h): the hold o (tool_grab.c) stays that
 * of the tissue for good, so that no switch takes anything from the pull; the force is at first what it was, by a shift
 * of the hold that fades in PAL_HANDED_SHIFT_S, after which the new method's own force is felt; on surfaces that adapt
 * it is then all gone, as one of three levels may pull three times as hard as one of one. A switch before that sets the
 * shift anew. Thread: [sim]. */
#ifndef PAL_SIM_HANDED_H
#define PAL_SIM_HANDED_H
#include <stdbool.h>

#define PAL_HANDED_SHIFT_S 0.4

typedef struct pal_handed {
    bool due; /* handed over, and nothing was felt since */
    /* on the body of before: patch, force on it, hold in the tool's axes; k of an implicit solver's spring, else 0 */
    double y[3], force_N[3], hold[3], k_N_m;
    bool evenly;             /* shift goes by as much in every step */
    double shift[3], left_s; /* of the hold, axes of the world; until it is gone */
} pal_handed;

/* the spring as it stands when the new body begins, in the body's frame */
typedef struct pal_handed_spring {
    double y[3], drag_N[3];      /* patch; force on it of the damper          */
    double at_m[3];              /* tool                                      */
    double hold[3], was_hold[3]; /* o and that of before, turned with the tool */
    double k_N_m;                /* above 0                                   */
    bool firm;                   /* an implicit solver's                      */
} pal_handed_spring;

/* sets shift, so that the spring pulls as it did; nothing is due then */
void pal_handed_begin(pal_handed *handed, const pal_handed_spring *spring);
/* goal += shift, which fades by dt_s */
void pal_handed_add(pal_handed *handed, double dt_s, double goal[3]);
#endif
