/* The state of a whole world goes over to another one made from an edited scene of the same bodies. What transfer.h
 * does besides, for a body of another model or mesh, builds on it. Thread: [sim], both worlds between two steps. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_WORLD_H
#define PAL_SIM_TRANSFER_TRANSFER_WORLD_H
#include "server/sim/world/world.h"

/* Transfers time, tools and poses, the materials of now (but one that the edited body is too stiff or too light for),
 * safeguard counts, and of every other body that has as many dofs x, v, lasting loads and, where it adapts, its levels.
 * x, v [n_dof][3] are the state of body `edited` instead (v NULL: at rest; edited -1: none). Components start again:
 * what a tool held it holds no more, brushes end. Heap memory when a material has changed */
void pal_world_transfer(pal_world *world, const pal_world *before, int edited, const double *x, const double *v);
/* after it, of the edited body: each lasting load goes to the node that is nearest at rest to the one that bore it;
 * their sum stays. Without memory it bears none */
void pal_world_transfer_loads(pal_world *world, int body, const pal_world *before);
/* sets x and v [n_dof][3] (NULL: unchanged) of a body, v = 0 where it is fixed, and its nodes */
void pal_transfer_set_state(pal_body *body, const double *x, const double *v);
#endif
