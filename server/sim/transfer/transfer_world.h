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
/* Call it after pal_world_transfer for the edited body: each lasting load moves to the node nearest at rest to the
 * one that bore it; the sum is unchanged. Without memory the loads are dropped */
void pal_world_transfer_loads(pal_world *world, int body, const pal_world *before);
/* sets x and v [n_dof][3] (NULL: unchanged) of a body, with v = 0 where it is fixed, and updates its nodes */
void pal_transfer_set_state(pal_body *body, const double *x, const double *v);
#endif
