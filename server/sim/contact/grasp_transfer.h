/* The transfer of a grasp (tool_grasp) to another body in the same place (transfer.h). The offset o between tool and
 * tissue (tool_grasp.c) stays that of the tissue for good, so that no switch takes anything from the pull. The force is
 * at first what it was, by a shift of o that is released over PAL_BLEND_GRASP_S, after which the new method's own force
 * is felt (one of three levels of an adaptive surface may pull three times as hard as one of one). A switch before that
 * sets the shift again. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_GRASP_TRANSFER_H
#define PAL_SIM_CONTACT_GRASP_TRANSFER_H
#include <stdbool.h>

typedef struct pal_grasp_transfer {
    bool due; /* handed over, and nothing was felt since */
    /* on the body of before: patch, force on it, hold in the tool's axes; k of an implicit solver's spring, else 0 */
    double y[3], force_N[3], hold[3], k_N_m;
    double shift[3], left_s; /* of the hold, axes of the world; until it is gone */
} pal_grasp_transfer;

/* the spring as it stands when the new body begins, in the body's frame */
typedef struct pal_grasp_spring {
    double y[3], damper_N[3];      /* patch; force on it of the damper          */
    double at_m[3];                /* tool                                      */
    double hold[3], old_hold_m[3]; /* o and that of before, turned with the tool */
    double k_N_m;                  /* above 0                                   */
    bool firm;                     /* an implicit solver's                      */
} pal_grasp_spring;

/* sets shift, so that the spring pulls as it did; nothing is due then */
void pal_grasp_transfer_begin(pal_grasp_transfer *grasp_transfer, const pal_grasp_spring *spring);
/* goal += shift, which fades by dt_s */
void pal_grasp_transfer_add(pal_grasp_transfer *grasp_transfer, double dt_s, double goal[3]);
#endif
