/* What makes a body stiffer while it is bent puts work into it, k times as much for E k times as high: let go, that
 * work would throw the body about, and when E goes back the motion stays. The brake takes it away: for a moment the
 * body goes back to its new rest as through something thick, at critical damping of the motion that the work would
 * make, c = 2 w,  w^2 = 2 U / sum m u^2,  for 8 / w seconds, U what is stored after the change, u the way from rest.
 * At least one step long, and nothing where the work is small: where no more than ten times of what was stored is
 * there, or where it would move the body by no more than its box diagonal S in a second, on average over its mass.
 * A body that nothing holds is slowed as a whole, too. Solvers verlet and central_cg add c to their drag, rk4 does not;
 * implicit ones damp by themselves. Thread: [sim]. No memory. */
#ifndef PAL_SIM_RECOVERY_STIFFENING_DAMPER_H
#define PAL_SIM_RECOVERY_STIFFENING_DAMPER_H
#include "server/sim/core/body.h"

/* U of the body's rows went from before_J to after_J by a change from outside */
void pal_stiffening_damper_begin(pal_body *body, double before_J, double after_J);
/* what the body stores grows bit by bit, to stored_J now: the same c for the next 0.1 s, unless a brake that was begun
 * lasts longer: then what is more of both */
void pal_stiffening_damper_hold(pal_body *body, double stored_J);
/* after a step of dt_s */
static inline void pal_stiffening_damper_advance(pal_body *body, double dt_s)
{
    if (body->stiffening_damping_1_s == 0) return;
    body->stiffening_damping_s -= dt_s;
    if (body->stiffening_damping_s <= 0) body->stiffening_damping_1_s = 0;
}
#endif
