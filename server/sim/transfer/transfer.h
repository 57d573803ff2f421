/* The state of a body goes over to another model or mesh of the same organ, between two steps of a running world
 * (numerics.md part 3, "live switch of method or resolution").
 *
 * Places. Nodes of the new body are looked for in the elements of the old one at rest (mesh/volume/locate.h; outside
 * them the nearest element goes on by one element at most) and take displacement and velocity by its shape functions.
 * Of a solid the elements are its subdivided cells as tetrahedra, and its control points are those that put the nodes
 * there with the least squares (numerics.md part 1 A), by conjugate gradients with a small pull to rest. Two solids of
 * the same control cells share their points to the bit; of two adaptive surfaces of one organ the new one refines where
 * the old one has, as far as it can. Forces go the other way: those on old nodes are shared out to the new ones around
 * them by their masses as well, so that no net force is lost and nodes that are light (at the rim of cut elements) are
 * not thrown; where the new mesh is the finer one to all new nodes that look to the old one, so that they do not gather
 * in few. What is not balanced, and moves the old nodes, goes as their acceleration to new ones of less than half the
 * mass.
 *
 * Energy. Interpolated places cost the new elements more than the old ones had: kinks at old faces, volume that the old
 * elements left free; of a surface that adapts fewer levels leave a sharp tip where a tool held fine vertices. First
 * every node (of such a surface every vertex in use) is moved by its missing force over a bound of its stiffness (kinks
 * go first), until the elastic energy is what it was, or 40 times (200 where it is half as much again), not at all
 * where it is no more than that. What is left is made up for by the length of the displacement from rest (of a body
 * that nothing holds, from its best rigid place), by PAL_TRANSFER_MAX_SCALE at most, and where that is not enough (the
 * report's scale stands at its bound), or the mass is another one, by the velocity, by PAL_TRANSFER_MAX_VELOCITY_SCALE
 * at most. A body without velocity whose displacement stands at its bound has another energy then: the report says so.
 * A body that rests under a load with the same elastic energy stands about half way between where it rested before and
 * where it will: a point moves by half of what the methods differ in, which is less than the sum of their errors. The
 * other half is let go as the difference of all forces goes out (blend_component.h). Momentum: a body that nothing
 * holds keeps momentum and spin of before; what they ask for of the kinetic energy they have (equal masses: the same).
 *
 * Sight and touch. The same nodes as near as they can stand show a skin elsewhere: the way from what the new body would
 * show to what the old one did is let go with the forces (pal_world_blend_display), so that nothing is seen to jump,
 * and tools touch what is seen.
 *
 * What is carried besides: time, tools, poses, materials, other bodies (pal_world_transfer), lasting loads, and what a
 * tool holds (pal_effect.hand) or presses, with what friction holds (tool_contact.h), and brushes on bodies
 * that have some. Thread: one at a
 * time. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_H
#define PAL_SIM_TRANSFER_TRANSFER_H
#include "server/sim/world/world.h"

/* most that a displacement, and a velocity, is lengthened or shortened for the sake of the energy */
#define PAL_TRANSFER_MAX_SCALE          1.8
#define PAL_TRANSFER_MAX_VELOCITY_SCALE 4.0

typedef struct pal_transfer pal_transfer;

typedef struct pal_transfer_report {
    /* kinetic energy and that of elastic rows, of the whole world; loads and gravity are not in it */
    double energy_before_J, energy_after_J;
    double interpolated_J; /* as interpolation alone would have it */
    /* of a shown vertex (where another surface is shown, as the next), and of a point of the body: a node of before
     * that lies within the new elements. Skins hang on the nodes of their mesh, so that a vertex may move where no
     * point does
     */
    double max_move_m, body_move_m;
    /* farthest that a shown vertex goes from one frame to the next because of the switch: what is shown begins where it
     * was and is let go over PAL_BLEND_TRANSFER_S (blend_component.h). Without memory for that: as far as the body
     * moves */
    double frame_move_m;
    int n_smooth; /* rounds of smoothing that it took */
    double scale; /* of the displacement, 1: as interpolated and smoothed */
} pal_transfer_report;

/* What the carry needs, found beforehand: where every node of the body in scene `to` lies in that in `from` and the
 * other way round, and memory. REFUSED: an adaptive surface and another model, or two of different surfaces; what the
 * models say; MEMORY. Borrows nothing. [load] */
pal_err pal_transfer_make(const pal_scene *from, const pal_scene *to, int body, pal_diagnostic *diag,
                          pal_transfer **out);
void pal_transfer_free(pal_transfer *transfer); /* NULL is fine */
/* `next`, a new world of `to`, goes on where `before`, one of `from`, is. Both stand still; the forces in before are
 * worked out anew, its state is as it was. Deterministic. Heap memory for component `blend`; where there is none, the
 * forces change at once. [sim] */
void pal_transfer_apply(pal_transfer *transfer, pal_world *next, const pal_world *before, pal_transfer_report *out);

/* Most of a carry's time goes into smoothing what was interpolated. That part can be rehearsed while the old world goes
 * on: look takes copies of the old body and of what pulls on it (one evaluation of its forces, hash and state as they
 * were; heap memory the first time), rehearse smooths the new body and keeps what had to be added to interpolated
 * places, and the carry, and each later rehearsal, begins with it. A body that has gone on far since costs the carry
 * more rounds, never another result than within its bounds. look: false: there is nothing to rehearse (a body that
 * adapts, that is frozen), or no memory. [sim of before] rehearse: after look; the old world may go on meanwhile. [any]
 */
bool pal_transfer_snapshot(pal_transfer *transfer, const pal_world *before);
void pal_transfer_rehearse(pal_transfer *transfer, pal_world *next);
/* farthest that a node of the old body has gone since it was looked at, m; between two of its steps. [sim of before] */
double pal_transfer_drift_m(const pal_transfer *transfer, const pal_world *before);
#endif
