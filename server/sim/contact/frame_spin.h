/* How a frame of a skin rotates when the nodes around it move. Thread: [sim].
 *
 * A frame has X, the unit vector of N (the sum of its fan's normals), Y, the unit part of one edge e normal to X, and
 * Z = X x Y (server/mesh/volume/skin.h). With u the velocities of the nodes its spin is
 *     spin = X x X' + (Y'.Z) X,   X' = (1 - X X^T) N' / |N|,   Y'.Z = (Z.e' - (e.X) Z.X') / |e - X (X.e)|
 * which is linear in N' and e':  spin = tilt N' + twist (Z.e'). */
#ifndef PAL_SIM_CONTACT_FRAME_SPIN_H
#define PAL_SIM_CONTACT_FRAME_SPIN_H
#include "server/sim/core/body.h"

typedef struct pal_frame_face {
    int32_t a, b;
    double to_a[3], to_b[3]; /* from the frame's node, m */
} pal_frame_face;

typedef struct pal_frame_spin {
    bool turns; /* false: the fan is too flat or folded to define a rotation */
    int node, end, n_face;
    const pal_frame_face *face; /* the fan [n_face] */
    double tilt[9], twist[3], Z[3];
    /* upper bounds of the forces of a torque of 1 Nm, 1/m: of its own node, of the edge's end, and of all nodes; of a
     * node of the fan `ring` 1/m2 times the length of the edge to its neighbour there */
    double own, edge, all, ring;
} pal_frame_spin;

/* frame `slot` of display.skin at the present positions; face: memory for the fan, kept */
void pal_frame_spin_find(const pal_body *body, int slot, pal_frame_face *face, pal_frame_spin *out);
/* the spin when the nodes move with u [n_node][3] */
void pal_frame_spin_of(const pal_frame_spin *frame, const double *u, double spin[3]);
/* the transpose: a torque on the frame as forces, added to `own` at its node and to out [n_node][3] elsewhere */
void pal_frame_spin_add_torque(const pal_frame_spin *frame, const double torque[3], double own[3], double *out);
/* out [n_node] += upper bounds of the forces of a torque of this size */
void pal_frame_spin_add_bound(const pal_frame_spin *frame, double torque_Nm, double *out);
#endif
