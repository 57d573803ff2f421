/* How a frame of a skin turns when the nodes around it move. Thread: [sim].
 *
 * A frame has X, the unit vector of N (the sum of its fan's normals), Y, the unit part of one edge e normal to X, and
 * Z = X x Y (mesh/volume/skin.h). With v the velocities of the nodes its spin is
 *     spin = X x X' + (Y'.Z) X,   X' = (1 - X X^T) N' / |N|,   Y'.Z = (Z.e' - (e.X) Z.X') / |e - X (X.e)| . */
#ifndef PAL_SIM_CONTACT_FRAME_SPIN_H
#define PAL_SIM_CONTACT_FRAME_SPIN_H
#include "server/sim/core/body.h"

typedef struct pal_frame_spin {
    bool turns; /* false: the fan is too flat or folded to say how the frame turns */
    int end;    /* other end of e                                                  */
    double X[3], Z[3];
    double part;                        /* how much of the turning counts */
    double per_normal, per_reach, rise; /* 1/|N|, 1/|e - X (X.e)|, X.e / |e - X (X.e)| */
} pal_frame_spin;

/* frame `slot` of body->skin at the present positions */
void pal_frame_spin_find(const pal_body *body, int slot, pal_frame_spin *out);
#endif
