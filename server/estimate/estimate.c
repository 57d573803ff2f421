/* Copies the state of a body from a running world and matches the components of another world to it. */
#include "server/estimate/estimate.h"

#include "server/base/vec3.h"

#include <math.h>
#include <string.h>

pal_estimate pal_estimate_unknown(void)
{
    return (pal_estimate){.max_m = NAN,
                          .error_m = NAN,
                          .discretisation_m = NAN,
                          .algebraic_m = NAN,
                          .time_m = NAN,
                          .model_m = NAN,
                          .force_percent = NAN,
                          .energy_error_percent = NAN,
                          .ms = NAN};
}

pal_err pal_estimate_match_components(const pal_estimate_state *state, pal_world *world, const pal_scene *scene,
                                      bool recipe)
{
    const pal_body_def *def = &scene->body[0];
    for (int k = 0; k < state->n_component; k++) {
        bool has = pal_world_find_component(world, 0, state->component[k]) >= 0, may = recipe || has;
        for (int i = 0; i < def->n_effect; i++) may = may || !strcmp(def->effect[i].name, state->component[k]);
        if (has == state->component_enabled[k] || !may) continue;
        PAL_TRY(pal_world_switch_component(world, scene, 0, state->component[k], state->component_enabled[k], NULL));
        pal_world_body(world, 0)->load_cap_N = INFINITY;
    }
    return PAL_ERR_OK;
}

pal_err pal_estimate_match(const pal_estimate_state *state, pal_world *world, const pal_scene *scene, bool recipe)
{
    pal_body *body = pal_world_body(world, 0);
    pal_material now;
    PAL_TRY(pal_estimate_match_components(state, world, scene, recipe));
    pal_world_current_material(world, 0, &now);
    if (memcmp(&now, &state->material, sizeof now)) {
        PAL_TRY(pal_world_material(world, 0, &state->material, NULL));
        body->load_cap_N = INFINITY;
    }
    body->frozen = false;
    return PAL_ERR_OK;
}

pal_estimate_cost pal_estimate_cost_of(const pal_world *world, int body, double step_ms)
{
    const char *of = pal_world_view_body(world, body)->name;
    double once_ns = 0, beside_ns = 0, own_ns = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        const pal_component *component = pal_world_component(world, i);
        const pal_stage stage = component->effect->stage;
        const bool inner = stage == PAL_STAGE_FORCE || stage == PAL_STAGE_SOLVE;
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        double *sum_ns = inner && info.body == of              ? &own_ns
                         : inner || stage == PAL_STAGE_CONTACT ? &beside_ns
                                                               : &once_ns;
        *sum_ns += (double)component->spent_ns;
    }
    /* relative to the components alone: the step is measured by another clock */
    double all_ns = once_ns + beside_ns + own_ns;
    pal_estimate_cost cost = {.ms = (float)step_ms};
    if (all_ns > 0) cost.once = (float)(once_ns / all_ns), cost.beside = (float)(beside_ns / all_ns);
    return cost;
}

/* A tool reports a force and this body bears a contact load. Tools on another body do not count. */
static bool is_touched(const pal_world *world, const pal_body *body)
{
    const pal_tools *tools = pal_world_tools(world);
    bool any = false, borne = false;
    for (int t = 0; t < tools->n_tool; t++)
        any = any || pal_dot3(tools->tool[t].mean_force_N, tools->tool[t].mean_force_N) > 0;
    for (int i = 0; i < 3 * body->n_node && any && !borne; i++)
        borne = body->load[i] != (body->external_force ? body->external_force[i] : 0);
    return borne;
}

static double other_limit_s(const pal_world *world, int body)
{
    double min = INFINITY;
    for (int b = 0; b < pal_world_body_count(world); b++) {
        const pal_body *other = pal_world_view_body(world, b);
        if (b != body && !other->asleep && !other->frozen) min = fmin(min, other->dt_limit_s);
    }
    return min;
}

bool pal_estimate_copy(pal_estimate_state *state, const pal_world *world, int body)
{
    const pal_body *from = pal_world_view_body(world, body);
    size_t n_byte = 3 * sizeof(double) * (size_t)from->n_dof;
    if (from->n_dof != state->n_dof || from->n_node != state->n_node || from->frozen || !pal_body_finite(from))
        return false;
    memcpy(state->x, from->x, n_byte);
    memcpy(state->v, from->v, n_byte);
    memcpy(state->load, from->load, 3 * sizeof(double) * (size_t)from->n_node);
    state->touched = is_touched(world, from);
    if (from->external_force)
        memcpy(state->external_force, from->external_force, 3 * sizeof(double) * (size_t)from->n_node);
    else
        memset(state->external_force, 0, 3 * sizeof(double) * (size_t)from->n_node);
    state->tick = pal_world_tick(world);
    state->time_s = pal_world_time_s(world);
    state->n_substep = pal_world_substeps(world);
    state->other_limit_s = other_limit_s(world, body);
    state->asleep = from->asleep;
    pal_world_current_material(world, body, &state->material);
    for (int k = 0; k < state->n_component; k++)
        state->component_enabled[k] = pal_world_find_component(world, body, state->component[k]) >= 0;
    return true;
}
