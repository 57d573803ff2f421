/* Safeguards of a step, the same for every solver: how far a node may move before it is shortened or before bounds of
 * the stable sub-step are found again, which components are asked for inversion, and when a state counts as broken.
 * A solver whose own algorithm needs another form (SIMD nodes, a whole step that is shortened) takes the numbers from
 * here. Thread: [sim]. */
#ifndef PAL_SIM_CORE_STEP_GUARD_H
#define PAL_SIM_CORE_STEP_GUARD_H
#include "server/sim/core/effect.h"

/* Part of a length that a node may move before what was computed for it no longer holds. Of the box diagonal, in a
 * sub-step or a Newton iteration: beyond it elements are passed over and a linearisation means nothing; a tool that
 * jumps by a body's size is followed in five sub-steps (cases of tests/stability that blow a body up a hundredfold). Of
 * an element's edge, or a control cell's: bounds of stiffness hold until then (tests/sim/world/test_world.c) */
#define PAL_GUARD_MOVE 0.2

/* m, of a body */
static inline double pal_guard_max_move_m(const pal_body *body)
{
    return PAL_GUARD_MOVE * body->length_scale_m;
}
/* the factor that keeps a move within max_m; less than 1 is counted */
static inline double pal_guard_shorten(double move_m, double max_m, uint64_t *n_clamped)
{
    if (!(move_m > max_m)) return 1;
    ++*n_clamped;
    return max_m / move_m;
}
/* false: a position or velocity is not finite, and the body is frozen with its reason */
bool pal_guard_check_finite(pal_body *body);
/* asks FORCE components to look for inverted elements: PAL_INVERTED and what else is true of PAL_INVERSION_* of any */
unsigned pal_guard_recover(pal_step *step);
/* sum of the drag rates of FORCE components, 1/s */
double pal_guard_drag_1_s(const pal_component *force, int n_force);
/* Gershgorin row sums of n components: stiff += those of stiffness, N/m; damp += those of explicit damping, Ns/m
 * [n_dof] */
void pal_guard_add_bounds(const pal_component *components, int n, const pal_body *body, double *stiff, double *damp);
/* has any of them such bounds? Contact comes and goes between steps without a node moving */
bool pal_guard_has_bounds(const pal_component *components, int n);
#endif
