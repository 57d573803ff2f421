/* When a change of stiffness is damped, and how much. */
#include "server/sim/recovery/stiffening_damper.h"

#include "server/base/vec3.h"
#include "server/sim/recovery/tuning.h"

#include <math.h>

/* sum m u^2 of the free dofs, and their mass */
static double displacement_kg_m2(const pal_body *body, double *mass_kg)
{
    double sum = 0, u[3];
    *mass_kg = 0;
    for (int k = 0; k < body->n_active; k++) {
        size_t i = (size_t)pal_body_point(body, k);
        if (body->support[i]) continue;
        pal_sub3(u, body->x + 3 * i, body->x_rest + 3 * i);
        *mass_kg += body->mass_kg[i];
        sum += body->mass_kg[i] * pal_dot3(u, u);
    }
    return sum;
}

void pal_stiffening_damper_begin(pal_body *body, double before_J, double after_J)
{
    double mass, sum = displacement_kg_m2(body, &mass);
    double max = body->length_scale_m, work = after_J - before_J;
    if (!(after_J > PAL_STIFFENING_RISE * before_J * (1 + 1e-9))) return;
    if (!(2 * work > max * max * mass) || !(sum > 0) || !isfinite(work)) return;
    double w = sqrt(2 * after_J / sum);
    /* a damper at work continues, with the larger constant and the longer time */
    body->stiffening_damping_1_s = fmax(body->stiffening_damping_1_s, 2 * w);
    body->stiffening_damping_s = fmax(body->stiffening_damping_s, PAL_STIFFENING_PERIODS / w);
}

void pal_stiffening_damper_hold(pal_body *body, double stored_J)
{
    double mass, sum = displacement_kg_m2(body, &mass);
    if (!(sum > 0) || !isfinite(stored_J)) return;
    const double c = 2 * sqrt(2 * stored_J / sum);
    body->stiffening_damping_1_s =
        body->stiffening_damping_s > PAL_STIFFENING_HOLD_S ? fmax(body->stiffening_damping_1_s, c) : c;
    body->stiffening_damping_s = fmax(body->stiffening_damping_s, PAL_STIFFENING_HOLD_S);
}
