/* Live switch of one body's method, resolution, step or tolerance.
 *
 * pal_configuration_switch_prepare (slow) builds a second world beside the running one. pal_session_transfer_begin
 * with pal_configuration_switch_transfer then replaces the running world between two steps, without a jump:
 *   - Displacement and velocity are interpolated in the elements of the old body.
 *   - Energy is preserved to 2 %. For this, displacements and velocities are rescaled within the bounds
 *     PAL_TRANSFER_MAX_SCALE (server/sim/transfer/tuning.h); the report gives the result.
 *   - The residual force and the offset of the displayed surface are blended out over PAL_BLEND_S
 *     (server/sim/core/blend.h).
 *   - Grasps, tool contacts with friction and lasting loads continue.
 *   - Brushes continue where the new body supports them.
 *
 * Thread: one at a time. */
#ifndef PAL_SESSION_CONFIGURATION_SWITCH_H
#define PAL_SESSION_CONFIGURATION_SWITCH_H
#include "server/sim/core/configuration.h"
#include "server/sim/transfer/transfer.h"
#include "server/sim/world/world.h"

typedef struct pal_configuration_switch pal_configuration_switch;
/* Builds the scene with configuration `to`, its mesh, and the interpolation from the old body to every new node.
 * `scene` is the scene of the running world; its materials and step are used. `base` is the body before its first
 * switch, with its original control cells and voxels, so that every configuration can be restored; NULL: the body as
 * in scene. Borrows the meshes of scene and base; copies both structs. Errors: REFUSED as by
 * pal_configuration_check_live (checked first) and pal_configuration_make, and when `to` is already active; BUDGET;
 * MEMORY. [any] */
pal_err pal_configuration_switch_prepare(const pal_scene *scene, const pal_body_def *base, int body,
                                         const pal_configuration *to, pal_diagnostic *diag,
                                         pal_configuration_switch **out);
const pal_scene *
pal_configuration_switch_scene(const pal_configuration_switch *change); /* lives as long as the switch */
/* pal_session_snapshot_fn and pal_session_rehearse_fn; user: a pal_configuration_switch. The snapshot asks for another
 * rehearsal while the body has moved by more than PAL_CONFIGURATION_SWITCH_MAX_DRIFT since the last snapshot. */
bool pal_configuration_switch_snapshot(void *change, const pal_world *before);
void pal_configuration_switch_rehearse(void *change, pal_world *next);
/* pal_session_transfer_fn; user: a pal_configuration_switch */
void pal_configuration_switch_transfer(void *change, pal_world *next, const pal_world *before);
uint64_t pal_configuration_switch_transfer_count(void); /* transfers made by the calling thread, for tests [any] */
/* result of the transfer, valid after it */
const pal_transfer_report *pal_configuration_switch_report(const pal_configuration_switch *change);
void pal_configuration_switch_free(
    pal_configuration_switch *change); /* NULL is fine; only after every world of its scene is destroyed */
#endif
