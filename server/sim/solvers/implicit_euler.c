/* Solver implicit_euler: backward Euler, x = x0 + dt V, M (V - v0) = dt f(x, V), after Baraff & Witkin (1998) with
 * one linearisation per step (newton 1) or more. First order, with numerical damping; contact and drag are implicit
 * too.
 *
 * Keys: tolerance (1e-2), iterations (60), newton (1), substep_s (0: the scene's step), stiffness_damping_s (0),
 * refresh_iterations (12), refresh (true), warp (true), watch (true); see implicit_solver.h. */
#include "server/sim/core/effect_list.h"
#include "server/sim/implicit/implicit_solver.h"

#include <string.h>

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    return pal_implicit_make(item, build, 1, self);
}

static pal_err run(void *self, pal_step *step)
{
    pal_implicit *core = self;
    pal_body *body = step->body;
    const size_t n_byte = pal_body_bytes3(body);
    if (!pal_implicit_begin(core, step)) return PAL_ERR_OK;
    do {
        memcpy(body->x, core->x0, n_byte);
        PAL_TRY(pal_implicit_stage(core, step, step->dt_s, true));
    } while (pal_implicit_settle(core, step, true));
    pal_implicit_end(core, step);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_implicit_euler = {.name = "implicit_euler", .make = make, .run = run, PAL_IMPLICIT_HOOKS};
