/* Transfer of a body's state to another model or mesh of the same organ, between two steps of a running world.
 *
 * Projection. Nodes of the new body are located in the elements of the old body at rest (mesh/volume/locate.h;
 * outside them the nearest element is extended by at most one element) and take displacement and velocity by its
 * shape functions. The elements of a subdivision solid are its subdivided cells as tetrahedra. Its control points
 * are those that place the nodes best in the least-squares sense, by conjugate gradients with a small regularisation
 * towards rest. Two solids of the same control cells share their control points to the bit. An adaptive surface
 * refines where the old one does, as far as it can.
 * Forces are transferred the other way. Forces on old nodes are distributed over the surrounding new nodes, weighted
 * by mass, so that no net force is lost and light nodes (at the rim of cut elements) are not accelerated too much.
 * Where the new mesh is finer, they are distributed over all new nodes located in elements of the old node, so that
 * they do not concentrate in few. The unbalanced force, which accelerates the old nodes, is transferred as
 * acceleration to new nodes of less than half the mass.
 *
 * Energy. Interpolated positions give the new elements more energy than the old ones had: from kinks at old faces,
 * from volume that the old elements left free, from a sharp tip where fewer levels of a surface remain under a tool.
 * First every node moves by its force residual over a bound of its stiffness (which removes kinks first) until the
 * elastic energy equals that before, in at most 40 rounds, or 200 where the energy is more than half as much again.
 * Then the displacement from rest (of a free body, from the best-fitting rigid placement) is scaled by at most
 * PAL_TRANSFER_MAX_SCALE. The remaining difference goes into the velocity, scaled by at most
 * PAL_TRANSFER_MAX_VELOCITY_SCALE. A body at rest whose scale reaches its bound has a different energy, which the
 * report shows. A body that rests under a load with the same elastic energy is about half way between its old and
 * its new equilibrium; the other half follows as the difference of forces is released (blend_component.h). A free
 * body keeps its momentum and angular momentum.
 *
 * Display. Equal node positions can give a different skin. The offset from what the new body would show to what the
 * old one showed is released with the forces (pal_world_blend_display), so that nothing jumps and tools touch what
 * is shown.
 *
 * Also transferred: time, tools, poses, materials, other bodies (transfer_world.h), lasting loads, tissue that a
 * tool grasps (pal_effect.transfer) or presses, with friction (tool_contact.h), and brushes. Thread: one at a time. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_H
#define PAL_SIM_TRANSFER_TRANSFER_H
#include "server/sim/world/world.h"

/* largest factor, up or down, by which displacement and velocity are scaled to match the energy */
#define PAL_TRANSFER_MAX_SCALE          1.8
#define PAL_TRANSFER_MAX_VELOCITY_SCALE 4.0

typedef struct pal_transfer pal_transfer;

typedef struct pal_transfer_report {
    /* kinetic energy and that of elastic components, of the whole world; without loads and gravity */
    double energy_before_J, energy_after_J;
    double interpolated_J; /* after interpolation alone */
    /* Largest displacement by the transfer: of a shown vertex (where another surface is shown, as body_move_m) and
     * of a point of the body, an old node that lies within the new elements. Skins follow the nodes of their mesh,
     * so a vertex may move where no point of the body does */
    double max_move_m, body_move_m;
    /* Largest displacement of a shown vertex between two frames due to the switch. The shown surface starts where it
     * was and is released over PAL_BLEND_TRANSFER_S (blend_component.h). Without memory for that it equals the
     * displacement of the body */
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

/* Most of the time of a transfer goes into smoothing. This part can be rehearsed while the old world runs.
 * pal_transfer_snapshot copies the old body and the forces on it (one evaluation of its forces; hash and state are
 * unchanged; heap memory the first time). pal_transfer_rehearse smooths the new body and stores the correction of
 * the interpolated positions; the transfer and each later rehearsal start from it. If the body has moved far since,
 * the transfer takes more rounds, but its result stays within the same bounds.
 * snapshot: false: nothing to rehearse (an adaptive or frozen body) or no memory. [sim of before] rehearse: after
 * snapshot; the old world may run meanwhile. [any] */
bool pal_transfer_snapshot(pal_transfer *transfer, const pal_world *before);
void pal_transfer_rehearse(pal_transfer *transfer, pal_world *next);
/* largest displacement of a node of the old body since the snapshot, m; between two of its steps. [sim of before] */
double pal_transfer_drift_m(const pal_transfer *transfer, const pal_world *before);
#endif
