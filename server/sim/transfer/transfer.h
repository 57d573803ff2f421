/* Transfer of a body's state to another model or mesh of the same organ, between two steps of a running world.
 *
 * Projection. Nodes of the new body are located in the elements of the old body at rest (mesh/volume/locate.h; outside
 * them the nearest element is extended by at most one element) and take displacement and velocity by its shape
 * functions; elements of a subdivision solid are its subdivided cells as tetrahedra. Its control points are those that
 * place the nodes best in the least-squares sense. Two solids of the same control cells share their control points to
 * the bit. An adaptive surface refines where the old one does, as far as it can.
 * Forces on old nodes are distributed over the surrounding new nodes, weighted by mass, so that no net force is lost
 * and light nodes (at the rim of cut elements) are not accelerated too much; where the new mesh is finer, over all new
 * nodes located in elements of the old node. The unbalanced force, which accelerates the old nodes, is transferred as
 * acceleration to new nodes of less than half the mass.
 *
 * Energy. Interpolated positions give the new elements more energy than the old ones had (kinks at old faces, volume
 * that the old elements left free, a sharp tip under a tool). First every node moves by its force residual over a bound
 * of its stiffness, which removes kinks first, until the elastic energy equals that before. Then the displacement from
 * rest (of a free body, from the best-fitting rigid placement) is scaled, and the velocity for the difference that
 * remains, both by at most PAL_TRANSFER_MAX_SCALE. A body at rest whose scale reaches its bound has a different energy,
 * which the report shows. A body that rests under a load with the same elastic energy is about half way between its old
 * and its new equilibrium; the other half follows as the difference of forces is released (inserted_components.h). A
 * free body keeps its momentum and angular momentum.
 *
 * Display. The offset from what the new body would show to what the old one showed is released with the forces
 * (pal_world_blend_display), so that nothing jumps and tools touch what is shown.
 *
 * Also transferred: time, tools, poses, materials, other bodies (transfer_world.h), lasting loads, tissue that a
 * tool grasps (pal_effect.transfer) or presses, with friction (tool_contact.h), and brushes. Thread: one at a time. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_H
#define PAL_SIM_TRANSFER_TRANSFER_H
#include "server/sim/transfer/tuning.h"
#include "server/sim/world/world.h"

typedef struct pal_transfer pal_transfer;

typedef struct pal_transfer_report {
    /* kinetic energy and that of elastic components, of the whole world; without loads and gravity */
    double energy_before_J, energy_after_J;
    double interpolated_J; /* after interpolation alone */
    /* Largest displacement by the transfer: of a shown vertex (where another surface is shown, as body_move_m) and
     * of a point of the body, an old node that lies within the new elements. A skin follows the nodes of its mesh */
    double max_move_m, body_move_m;
    /* Largest displacement of a shown vertex between two frames due to the switch, while the display offset is
     * released; without memory for that the displacement of the body */
    double frame_move_m;
    int n_smooth; /* rounds of smoothing */
    double scale; /* of the displacement; 1: as interpolated and smoothed */
} pal_transfer_report;

/* Precomputes a transfer: the location of every node of the body of scene `to` in that of `from` and vice versa, and
 * work memory. REFUSED: an adaptive surface and another model, or two of different surfaces; errors of the models;
 * MEMORY. Borrows nothing. [load] */
pal_err pal_transfer_make(const pal_scene *from, const pal_scene *to, int body, pal_diagnostic *diag,
                          pal_transfer **out);
void pal_transfer_free(pal_transfer *transfer); /* NULL is allowed */
/* Sets the state of `next`, a new world of `to`, to that of `before`, a world of `from`. Both must be between steps.
 * Recomputes the forces in before; its state is unchanged. Deterministic. Allocates heap memory for component
 * `blend`; without memory the forces change at once. [sim] */
void pal_transfer_apply(pal_transfer *transfer, pal_world *next, const pal_world *before, pal_transfer_report *out);

/* Smoothing, most of the time of a transfer, can be rehearsed while the old world runs. snapshot copies the old body
 * and the forces on it (one evaluation; hash and state are unchanged; heap memory the first time); false: nothing to
 * rehearse (an adaptive or frozen body) or no memory. [sim of before] */
bool pal_transfer_snapshot(pal_transfer *transfer, const pal_world *before);
/* After snapshot: smooths the new body and stores the correction of the interpolated positions, from which the transfer
 * and each later rehearsal start. If the body has moved far since, the transfer takes more rounds. [any] */
void pal_transfer_rehearse(pal_transfer *transfer, pal_world *next);
/* largest displacement of a node of the old body since the snapshot, m; between two of its steps. [sim of before] */
double pal_transfer_drift_m(const pal_transfer *transfer, const pal_world *before);
#endif
