/* The active dofs of a body packed in the order of the active list: what a solver that assembles forces several times
 * in a sub-step advances, and what components with compute_forces work on. Only files compiled with the room's options
 * include this (simd.h). Memory from the arena. Thread: make [load], then [sim].
 *
 * Threads share passes over the nodes in parts of successive ones: the active list follows the longest axis of the body
 * (adaptive_surface.h), so a part is a slab of it, whose nodes stay in the caches of one thread. */
#ifndef PAL_SIM_SURFACE_ACTIVE_NODES_H
#define PAL_SIM_SURFACE_ACTIVE_NODES_H
#include "server/sim/core/effect.h"
#include "server/sim/core/simd.h"

typedef struct pal_active_nodes {
    pal_v8 *xv;     /* position m and velocity m/s: x y z 0 x y z 0        [n_active], room for n_dof */
    pal_quad *f;    /* force N; components add                             [n_active] */
    pal_quad *rest; /* position at rest m; mass kg in the fourth number    [n_active] */
    /* room for copies of nodes in xv and f from first_copy on, for parts that read nodes of others; 0: one thread */
    int first_copy, n_copy;
} pal_active_nodes;

PAL_INLINE pal_quad pal_v8_low(pal_v8 a)
{
    return __builtin_shufflevector(a, a, 0, 1, 2, 3);
}
PAL_INLINE pal_quad pal_v8_high(pal_v8 a)
{
    return __builtin_shufflevector(a, a, 4, 5, 6, 7);
}
PAL_INLINE pal_v8 pal_v8_join(pal_quad first, pal_quad second)
{
    return __builtin_shufflevector(first, second, 0, 1, 2, 3, 4, 5, 6, 7);
}

/* makes body->active_nodes unless there is one; MEMORY. [load] */
pal_err pal_active_nodes_make(const pal_build *build);
/* parts in which the threads of the body's team share passes over its active nodes; 1: the caller alone */
int pal_active_parts(const pal_body *body);
/* first node of a part; n_active for part n_part. Nodes of two parts share no line of the caches */
static inline int pal_active_first(const pal_body *body, int n_part, int part)
{
    return part < n_part ? pal_part_first(body->n_active, n_part, part) & -PAL_LANES : body->n_active;
}
/* xv and rest of node k from the body's x, v, x_rest and mass_kg; and of all active nodes */
PAL_INLINE void pal_active_node_load(const pal_body *body, int k)
{
    const size_t i = (size_t)pal_body_point(body, k);
    pal_quad rest = pal_quad_load(body->x_rest + 3 * i);
    rest[3] = body->mass_kg[i];
    body->active_nodes->rest[k] = rest;
    body->active_nodes->xv[k] = pal_v8_join(pal_quad_load(body->x + 3 * i), pal_quad_load(body->v + 3 * i));
}
void pal_active_nodes_load(const pal_body *body);
/* can pal_run_forces run every FORCE component on packed dofs? */
bool pal_active_nodes_complete(const pal_step *step);
/* `run` of a component with compute_forces: packs the body, computes, adds to the body's f */
pal_err pal_active_nodes_run(void *self, pal_step *step, pal_err (*pull)(void *self, pal_step *step));
#endif
