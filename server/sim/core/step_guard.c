/* Safeguards that all solvers share. */
#include "server/sim/core/step_guard.h"

bool pal_guard_check_finite(pal_body *body)
{
    if (pal_body_finite(body)) return true;
    pal_body_stop_bad(body, "");
    return false;
}

unsigned pal_guard_recover(pal_step *step)
{
    unsigned seen = 0;
    for (int i = 0; i < step->n_force; i++) {
        const pal_component *force = &step->force[i];
        if (force->effect->recovery.recover) seen |= force->effect->recovery.recover(force->self, step);
    }
    return seen;
}

double pal_guard_drag_1_s(const pal_component *force, int n_force)
{
    double rate = 0;
    for (int i = 0; i < n_force; i++)
        if (force[i].effect->drag) rate += force[i].effect->drag(force[i].self);
    return rate;
}

void pal_guard_add_bounds(const pal_component *components, int n, const pal_body *body, double *stiff, double *damp)
{
    for (int i = 0; i < n; i++) {
        const pal_effect *effect = components[i].effect;
        if (effect->bounds.stiffness) effect->bounds.stiffness(components[i].self, body, stiff);
        if (effect->bounds.damping && !effect->drag) effect->bounds.damping(components[i].self, body, damp);
    }
}

bool pal_guard_has_bounds(const pal_component *components, int n)
{
    for (int i = 0; i < n; i++)
        if (components[i].effect->bounds.stiffness || components[i].effect->bounds.damping) return true;
    return false;
}
