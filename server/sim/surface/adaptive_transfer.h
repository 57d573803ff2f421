/* An adaptive surface that goes on where another of the same coarse triangles is, whatever number of levels both have.
 * Thread: [sim]; no heap. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_TRANSFER_H
#define PAL_SIM_SURFACE_ADAPTIVE_TRANSFER_H
#include "server/sim/surface/adaptive_surface.h"

/* is the vertex one of the surface's levels, and a node now? */
static inline bool pal_adaptive_uses(const pal_adaptive_surface *s, int32_t vertex)
{
    return vertex < s->levels.n_vertex[s->levels.n_level - 1] && pal_adaptive_has(s, vertex);
}
/* splits what is split in `from`, coarse faces first, as far as `to` goes, from rest; with the same levels the state is
 * the same */
void pal_adaptive_copy_refinement(pal_body *to, const pal_body *from);
/* places and velocities [to->n_dof][3] of the vertices of `to` as it is refined now: those of `from`; what that has not
 * stands between the ends of its edge, as far off it as at rest, or is at rest when it is held. x, v may be those of
 * `to` */
void pal_adaptive_transfer_state(const pal_body *to, const pal_body *from, double *x, double *v);
#endif
