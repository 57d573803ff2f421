/* Transfer of the state of a whole world to another made from an edited scene of the same bodies. transfer.h builds
 * on it for a body of another model or mesh. Thread: [sim], both worlds between two steps. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_WORLD_H
#define PAL_SIM_TRANSFER_TRANSFER_WORLD_H
#include "server/sim/world/world.h"

/* Transfers time, tools and poses, the present materials (except one that makes the edited body too stiff or too
 * light), safeguard counts, and for every other body with as many dofs x, v, lasting loads and, if adaptive, levels.
 * x, v [n_dof][3] are the state of body `edited` instead (v NULL: at rest; edited -1: none). Components start again:
 * grasps and brushes end. Allocates heap memory when a material has changed */
void pal_world_transfer(pal_world *world, const pal_world *before, int edited, const double *x, const double *v);
/* Call it after pal_world_transfer for the edited body: lasting loads, f = A' f of `from`, where A interpolates its
 * nodes from the new ones. A NULL: each load moves to the node nearest at rest. The sum is unchanged; without memory
 * the loads are dropped */
void pal_world_transfer_loads(pal_world *world, int body, const pal_body *from, const pal_interpolation *A);
/* components of one stage of a body continue where those of the same effect in the world before are */
void pal_transfer_components(pal_world *next, int body, const pal_world *before, pal_stage stage,
                             const pal_component_transfer *by);
/* sets x and v [n_dof][3] (NULL: unchanged) of a body, with v = 0 where it is fixed, and updates its nodes */
void pal_transfer_set_state(pal_body *body, const double *x, const double *v);
#endif
