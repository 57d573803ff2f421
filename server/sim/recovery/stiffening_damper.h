/* Stiffening damper: a change that makes a deformed body stiffer puts work into it, k times as much for k times E;
 * released, that work would throw the body about, and the motion would stay when E returns. For a moment the body has
 * critical damping of the motion that the work would cause: c = 2 w, w^2 = 2 U / sum m u^2, for 8 / w seconds and at
 * least one step, with U the energy stored after the change and u the displacement from rest. It does nothing when U is
 * at most ten times the energy before, or would move the body, on average over its mass, by at most its length scale in
 * a second. A free body is slowed as a whole too. Solvers verlet and central_cg add c to their drag, rk4 does not;
 * implicit ones damp by themselves. Thread: [sim]. No memory. */
#ifndef PAL_SIM_RECOVERY_STIFFENING_DAMPER_H
#define PAL_SIM_RECOVERY_STIFFENING_DAMPER_H
#include "server/sim/core/body.h"

/* begins: a change from outside has raised the energy of the body's components from before_J to after_J */
void pal_stiffening_damper_begin(pal_body *body, double before_J, double after_J);
/* holds while the stored energy grows bit by bit, to stored_J now: the same c for the next 0.1 s; the larger of both
 * when a damper that has begun lasts longer */
void pal_stiffening_damper_hold(pal_body *body, double stored_J);
/* after a step of dt_s */
static inline void pal_stiffening_damper_advance(pal_body *body, double dt_s)
{
    if (body->stiffening_damping_1_s == 0) return;
    body->stiffening_damping_s -= dt_s;
    if (body->stiffening_damping_s <= 0) body->stiffening_damping_1_s = 0;
}
#endif
