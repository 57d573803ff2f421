/* Runs a body's FORCE components. */
#include "server/sim/core/effect.h"

#include "server/base/clock.h"
#include "server/sim/core/simd_blocks.h"

#include <string.h>

static bool skips(const pal_step *step, const pal_effect *effect, pal_forces which)
{
    if (which == PAL_FORCES_ALL || which == PAL_FORCES_PACKED) return step->drag_separate && effect->drag;
    return effect->drag || effect->internal != (which == PAL_FORCES_INTERNAL);
}

static pal_err run_each(pal_step *step, pal_forces which)
{
    const bool packed = which == PAL_FORCES_PACKED;
    uint64_t before = pal_clock_ns();
    for (int i = 0; i < step->n_force; i++) {
        pal_component *component = &step->force[i];
        if (skips(step, component->effect, which)) continue;
        component->n_run++;
        PAL_TRY((packed ? component->effect->compute_forces : component->effect->run)(component->self, step));
        uint64_t now = pal_clock_ns();
        component->spent_ns += now - before;
        before = now;
    }
    return PAL_ERR_OK;
}

pal_err pal_run_forces(pal_step *step, pal_forces which)
{
    pal_node_order *order = step->body->node_order;
    if (order) pal_node_order_begin(order, step->single, step->body->d);
    const pal_err err = run_each(step, which);
    if (order) pal_node_order_end(order, step->body->f);
    return err;
}

/* forces begin as the loads; in the parts of the nodes, so that a thread's nodes stay in its caches */
static void begin_part(void *user, int worker, int part)
{
    const pal_body *body = user;
    const int n_part = pal_node_order_parts(body->node_order), first = pal_part_first(body->n_node, n_part, part),
              n = pal_part_first(body->n_node, n_part, part + 1) - first;
    (void)worker;
    memcpy(body->f + 3 * (size_t)first, body->load + 3 * (size_t)first, 3 * sizeof(double) * (size_t)n);
}

pal_err pal_assemble_forces(pal_step *step)
{
    pal_body *body = step->body;
    for (int k = 0; k < body->n_active && body->active; k++) {
        size_t i = 3 * (size_t)body->active[k];
        for (size_t c = 0; c < 3; c++) body->f[i + c] = body->load[i + c];
    }
    pal_body_update_nodes(body);
    if (!body->active) pal_team_run(body->team, pal_node_order_parts(body->node_order), begin_part, body);
    PAL_TRY(pal_run_forces(step, PAL_FORCES_ALL));
    if (body->interpolation) {
        memset(body->g, 0, 3 * sizeof(double) * (size_t)body->n_dof);
        pal_interpolation_apply_transpose(body->interpolation, body->f, body->g);
    }
    return PAL_ERR_OK;
}

bool pal_components_change(const pal_component *component, int n, double time_s)
{
    for (int i = 0; i < n; i++) {
        const pal_effect *effect = component[i].effect;
        if (effect->sleep.settled_s && !(time_s >= effect->sleep.settled_s(component[i].self))) return true;
    }
    return false;
}

double pal_components_energy_J(const pal_component *component, int n, const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        if (component[i].effect->energy) sum += component[i].effect->energy(component[i].self, body);
    return sum;
}

const char *pal_stage_name(pal_stage stage)
{
    static const char *const names[] = {"contact", "force", "solve", "adapt", "guard", "output"};
    return (unsigned)stage < PAL_STAGE_COUNT ? names[stage] : "?";
}
