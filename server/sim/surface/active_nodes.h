/* The active points of a body side by side, in the order of the active list: what a solver that gathers several times
 * in a sub-step moves, and rows with `pull` work on. Only files compiled with the room's options include this
 * (simd.h). Thread: make [load], then [sim]; memory from the arena. */
#ifndef PAL_SIM_SURFACE_ACTIVE_NODES_H
#define PAL_SIM_SURFACE_ACTIVE_NODES_H
#include "server/sim/core/effect.h"
#include "server/sim/core/simd.h"

typedef struct pal_active_nodes {
    pal_v8 *xv;     /* place m and velocity m/s: x y z 0 x y z 0           [n_active], room for n_dof */
    pal_quad *f;    /* force N; rows add                                   [n_active] */
    pal_quad *rest; /* place at rest m, and in the fourth number mass kg   [n_active] */
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

/* body->pack, unless there is one; MEMORY. [load] */
pal_err pal_active_nodes_make(pal_body *body, pal_arena *arena);
/* xv and rest from the body's x, v, x_rest and mass_kg */
void pal_active_nodes_load(const pal_body *body);
/* would pal_active_nodes_assemble run every FORCE row? */
bool pal_active_nodes_complete(const pal_step *step);
/* every FORCE row's `pull`, but for drag when drag_separate. Counts each row's spent_ns */
pal_err pal_active_nodes_assemble(pal_step *step);
/* `run` of a row that has `pull`: takes the body, pulls, and adds to the body's f */
pal_err pal_active_nodes_run(void *self, pal_step *step, pal_err (*pull)(void *self, pal_step *step));
#endif
