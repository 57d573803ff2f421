/* Solver sdirk2: the two-stage singly diagonally implicit Runge-Kutta method of order 2, stiffly accurate and
 * L-stable (Alexander 1977), g = 1 - 1/sqrt 2:
 *     V1 = v0 + g dt a1,                    x1 = x0 + g dt V1
 *     V2 = v0 + (1 - g) dt a1 + g dt a2,    x2 = x0 + (1 - g) dt V1 + g dt V2,     v = V2, x = x2,
 * where a1 and a2 are the accelerations of the stages. Both stages have the matrix of a backward Euler step of g dt,
 * so one factor serves both; the second is linearised where the first ends. Order 2 is reached with newton > 1: a
 * single iteration omits the derivative of the rotations from the tangent.
 * A tool receives the mean force of the sub-step, (1 - g) f1 + g f2, which is the one that gives the body its
 * momentum; its contact patches are those of the end, f2.
 *
 * The second stage extrapolates the acceleration of the first by a factor of 2.4, which is stable for smooth forces
 * but not for elements that invert and recover: energy rose in one sub-step of thirty without end. After a sub-step
 * that gained energy in spite of all iterations the solver uses backward Euler until half a second passes without a
 * gain.
 *
 * Keys: as implicit_euler. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/implicit/implicit_solver.h"

#include <string.h>

#define GAMMA (1 - M_SQRT1_2)

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    return pal_implicit_make(item, build, GAMMA, self);
}

/* x* and v* of the second stage from the first one's V, which body->v holds */
static void open_second(pal_implicit *core, const pal_body *body, double dt)
{
    const double g = GAMMA, *v1 = body->v;
    for (int i = 0; i < 3 * body->n_dof; i++) {
        core->xs[i] = core->x0[i] + (1 - g) * dt * v1[i];
        core->vs[i] = core->v0[i] + (1 - g) / g * (v1[i] - core->v0[i]);
    }
}

static pal_err run(void *self, pal_step *step)
{
    pal_implicit *core = self;
    pal_body *body = step->body;
    pal_tools *tools = step->tools;
    const size_t n_byte = pal_body_bytes3(body);
    double first_N[PAL_TOOL_MAX][3];
    bool two_stages = false;
    if (!pal_implicit_begin(core, step)) return PAL_ERR_OK;
    for (bool again = true; again;) {
        memcpy(body->x, core->x0, n_byte);
        memcpy(core->xs, core->x0, n_byte);
        memcpy(core->vs, core->v0, n_byte);
        two_stages = core->rose_s <= 0;
        if (!two_stages) { /* backward Euler over the whole step, see above */
            PAL_TRY(pal_implicit_stage(core, step, step->dt_s, true));
        } else {
            PAL_TRY(pal_implicit_stage(core, step, GAMMA * step->dt_s, false));
            if (pal_implicit_settle(core, step, false)) continue;
            for (int t = 0; t < tools->n_tool; t++) pal_copy3(first_N[t], tools->tool[t].force_N);
            open_second(core, body, step->dt_s);
            PAL_TRY(pal_implicit_stage(core, step, GAMMA * step->dt_s, false));
        }
        again = pal_implicit_settle(core, step, true);
    }
    /* the mean force of both stages */
    for (int t = 0; t < tools->n_tool && two_stages; t++)
        for (int c = 0; c < 3; c++)
            tools->tool[t].force_N[c] += (1 - GAMMA) * (first_N[t][c] - tools->tool[t].force_N[c]);
    pal_implicit_end(core, step);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_sdirk2 = {.name = "sdirk2", .make = make, .run = run, PAL_IMPLICIT_HOOKS};
