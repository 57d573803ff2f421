/* Transfer between two adaptive surfaces with the same coarse triangles, whatever number of levels both have. Thread:
 * [sim]; no heap. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_TRANSFER_H
#define PAL_SIM_SURFACE_ADAPTIVE_TRANSFER_H
#include "server/sim/surface/adaptive_surface.h"

/* splits in `to` the faces that are split in `from`, as far as its levels go, from rest; with the same levels the state
 * is the same */
void pal_adaptive_copy_refinement(pal_body *to, const pal_body *from);
/* positions and velocities [to->n_dof][3] of the present nodes of `to`: those of `from`; a vertex that is no node there
 * stands between the ends of its edge, as far off it as at rest, or at rest when it is fixed. x, v may be those of `to`
 */
void pal_adaptive_transfer_state(const pal_body *to, const pal_body *from, double *x, double *v);
#endif
