/* The active dofs of a body packed in the order of the active list: what a solver that assembles forces several times
 * in a sub-step advances, and what components with compute_forces work on. Only files compiled with the room's options
 * include this (simd.h). Memory from the arena. Thread: make [load], then [sim]. */
#ifndef PAL_SIM_SURFACE_ACTIVE_NODES_H
#define PAL_SIM_SURFACE_ACTIVE_NODES_H
#include "server/sim/core/effect.h"
#include "server/sim/core/simd.h"

typedef struct pal_active_nodes {
    pal_v8 *xv;     /* position m and velocity m/s: x y z 0 x y z 0        [n_active], room for n_dof */
    pal_quad *f;    /* force N; components add                             [n_active] */
    pal_quad *rest; /* position at rest m; mass kg in the fourth number    [n_active] */
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
pal_err pal_active_nodes_make(pal_body *body, pal_arena *arena);
/* xv and rest from the body's x, v, x_rest and mass_kg */
void pal_active_nodes_load(const pal_body *body);
/* can pal_run_forces run every FORCE component on packed dofs? */
bool pal_active_nodes_complete(const pal_step *step);
/* `run` of a component with compute_forces: packs the body, computes, adds to the body's f */
pal_err pal_active_nodes_run(void *self, pal_step *step, pal_err (*pull)(void *self, pal_step *step));
#endif
