/* Commands to a world between two steps: poses, resets, materials, fields, brushes, components. */
#include "server/base/clock.h"
#include "server/sim/world/world.h"
#include "server/sim/world/world_core.h"

#include <math.h>
#include <string.h>

pal_err pal_world_pose(pal_world *world, int tool, const pal_pose *pose)
{
    if (tool < 0 || tool >= world->tools.n_tool) return PAL_ERR_REFUSED;
    if (pose && !pal_pose_ok(pose, 100 * world->plan.body[0].length_scale_m)) return PAL_ERR_REFUSED;
    world->has_requested_pose[tool] = pose != NULL;
    if (pose) {
        world->requested_pose[tool] = *pose;
        world->pose_ns[tool] = pal_clock_ns();
    } else {
        pal_brush_components_end(&world->brushes, tool);
    }
    return PAL_ERR_OK;
}

void pal_world_place_tools(pal_world *world)
{
    for (int t = 0; t < world->tools.n_tool; t++)
        pal_tool_place(&world->tools.tool[t], world->has_requested_pose[t] ? &world->requested_pose[t] : NULL);
}

/* resets one body to rest, its components as at load */
static void rest_body(pal_world *w, int b)
{
    pal_body *body = &w->plan.body[b];
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof, n_load = 3 * sizeof(double) * (size_t)body->n_node;
    memcpy(body->x, body->x_rest, n_byte);
    memset(body->v, 0, n_byte);
    memset(body->g, 0, n_byte);
    memset(body->f, 0, n_load);
    memset(body->load, 0, n_load);
    if (body->external_force) memset(body->external_force, 0, n_load);
    pal_body_update_nodes(body);
    body->frozen = body->asleep = false;
    body->reason[0] = 0;
    body->safeguards = (pal_safeguards){0};
    for (int i = 0; i < w->plan.n_component; i++) {
        const pal_component *component = &w->plan.component[i];
        if (w->plan.component_body[i] == b && component->effect->reset) component->effect->reset(component->self, body);
    }
}

pal_err pal_world_reset_body(pal_world *world, int body)
{
    if (body < 0 || body >= world->plan.n_body) return PAL_ERR_REFUSED;
    rest_body(world, body);
    pal_world_find_limit(world, 0);
    pal_world_show_all(world);
    return PAL_ERR_OK;
}

void pal_world_reset(pal_world *world)
{
    for (int b = 0; b < world->plan.n_body; b++) rest_body(world, b);
    for (int t = 0; t < world->tools.n_tool; t++) {
        const pal_tool *old = &world->tools.tool[t];
        world->tools.tool[t] = (pal_tool){.radius_m = old->radius_m, .force_cap_N = old->force_cap_N};
        world->has_requested_pose[t] = false;
    }
    world->tick = 0;
    world->time_s = 0;
    pal_world_find_limit(world, 0);
    pal_world_show_all(world);
}

/* given: with a damping that may be one to derive */
static pal_err apply_material(pal_world *w, int b, const pal_material *given, pal_diagnostic *diag)
{
    pal_body *body = &w->plan.body[b];
    pal_material own = *given, *to = &own;
    const pal_material *with = &w->found_with[b];
    /* all moduli and masses are scaled; another Poisson's ratio changes the frequency by little */
    const double stiffer = given->young_Pa / with->young_Pa, heavier = given->density_kg_m3 / with->density_kg_m3;
    body->lowest_1_s = w->found_1_s[b] * sqrt(stiffer / heavier);
    to->damping_1_s = pal_material_damping_1_s(given, body->lowest_1_s);
    if (body->dofs.set_material) body->dofs.set_material(body, to);
    for (int i = 0; i < w->plan.n_component; i++) {
        const pal_component *component = &w->plan.component[i];
        const pal_effect *effect = component->effect;
        if (w->plan.component_body[i] != b) continue;
        if (effect->material) PAL_TRY(effect->material(component->self, body, to, diag));
        if (!effect->material && effect->stage == PAL_STAGE_SOLVE && effect->reset)
            effect->reset(component->self, body);
    }
    double ratio = to->density_kg_m3 / w->material[b].density_kg_m3;
    for (int i = 0; i < body->n_dof && !body->dofs.set_material; i++) body->mass_kg[i] *= ratio;
    if (body->dofs.scale_mass) body->dofs.scale_mass(body, ratio);
    body->load_cap_N = pal_body_load_cap_N(body, to->young_Pa);
    body->full_corner_kg *= ratio;
    body->damping_1_s = pal_world_drag_1_s(w, b);
    w->material[b] = *given;
    return PAL_ERR_OK;
}

/* What an edit to a stiffer material has put into a deformed body would throw it about once it is soft again. So where
 * the modulus falls the motion keeps its amplitude, not its speed: with it fall the frequencies. A free body keeps its
 * momentum */
static void scale_motion(pal_body *body, double times)
{
    bool held = false;
    for (int i = 0; i < body->n_dof; i++) held |= body->support[i] != 0;
    for (int i = 0; i < 3 * body->n_dof && held && times < 1; i++)
        if (!body->support[i / 3]) body->v[i] *= sqrt(times);
}

pal_err pal_world_material(pal_world *world, int body, const pal_material *material, pal_diagnostic *diag)
{
    if (body < 0 || body >= world->plan.n_body) return PAL_REFUSE(diag, "body %d does not exist", body);
    pal_material to = *material, was = world->material[body];
    PAL_TRY(pal_material_check(&to, diag));
    world->plan.body[body].asleep = false;
    pal_err err = apply_material(world, body, &to, diag);
    if (!err) err = pal_world_check_budget(world, diag);
    if (!err) scale_motion(&world->plan.body[body], to.young_Pa / was.young_Pa);
    /* constants are functions of the material, so restoring the old one restores everything */
    if (err) (void)apply_material(world, body, &was, NULL);
    pal_world_find_limit(world, 0);
    return err;
}

bool pal_world_has_field(const pal_world *world, int body, pal_field field)
{
    return pal_field_components_given(&world->plan, body, field);
}

pal_err pal_world_field(pal_world *world, int body, pal_field field, bool wanted, pal_diagnostic *diag)
{
    pal_step step = {.dt_s = 0};
    if (body >= 0 && body < world->plan.n_body) step = pal_world_body_step(world, body);
    if (wanted) return pal_field_components_add(&world->fields, &world->plan, body, field, &step, diag);
    pal_field_components_remove(&world->fields, &world->plan, body, field);
    return PAL_ERR_OK;
}

pal_err pal_world_brush(pal_world *world, int body, int slot, const pal_brush *brush, pal_diagnostic *diag)
{
    if (body >= 0 && body < world->plan.n_body && brush && brush->kind != PAL_BRUSH_NONE)
        world->plan.body[body].asleep = false;
    return pal_brush_components_set(&world->brushes, &world->plan, body, slot, brush, diag);
}

pal_err pal_world_switch_component(pal_world *world, const pal_scene *scene, int body, const char *component, bool on,
                                   pal_diagnostic *diag)
{
    bool changed = false;
    const pal_material *now = body >= 0 && body < PAL_BODY_MAX ? &world->material[body] : NULL;
    PAL_TRY(pal_plan_switch(&world->plan, scene, body, component, on, now, diag, &changed));
    if (!changed) return PAL_ERR_OK;
    /* the solver's limit belongs to the previous components */
    pal_world_invalidate_limits(world, body);
    pal_err err = pal_world_check_budget(world, diag);
    if (err) {
        /* the plan without the component was within the budget */
        (void)pal_plan_switch(&world->plan, scene, body, component, false, now, NULL, &changed);
        pal_world_invalidate_limits(world, body);
        (void)pal_world_check_budget(world, NULL);
    }
    pal_world_invalidate_limits(world, body);
    pal_world_keep_lowest(world, body);
    world->plan.body[body].damping_1_s = pal_world_drag_1_s(world, body);
    return err;
}

void pal_world_wake(pal_world *world)
{
    for (int b = 0; b < world->plan.n_body; b++) world->plan.body[b].asleep = false;
}

void pal_world_watch(pal_world *world, bool watched)
{
    world->unobserved = !watched;
    for (int b = 0; b < world->plan.n_body && watched; b++)
        if (world->plan.body[b].stale && pal_body_finite(&world->plan.body[b])) pal_world_show(world, b);
}

pal_err pal_world_blend_force(pal_world *world, int body, const double *force_N)
{
    if (body < 0 || body >= world->plan.n_body) return PAL_ERR_REFUSED;
    world->plan.body[body].asleep = false;
    return pal_blend_components_set(&world->blends, &world->plan, body, force_N);
}

pal_err pal_world_blend_display(pal_world *world, int body, const float *display_offset_m)
{
    if (body < 0 || body >= world->plan.n_body) return PAL_ERR_REFUSED;
    world->plan.body[body].asleep = false;
    PAL_TRY(pal_blend_components_set_display(&world->blends, &world->plan, body, display_offset_m));
    pal_world_show(world, body);
    return PAL_ERR_OK;
}

void pal_world_remove_idle(pal_world *world)
{
    pal_brush_components_remove_idle(&world->brushes, &world->plan);
    pal_blend_components_remove_idle(&world->blends, &world->plan);
}

void pal_world_invalidate_limits(pal_world *world, int body)
{
    const pal_component *solve = &world->plan.component[world->plan.first[PAL_STAGE_SOLVE][body]];
    world->plan.body[body].asleep = false;
    world->plan.body[body].stale = true;
    pal_body_update_nodes(&world->plan.body[body]);
    if (solve->effect->reset) solve->effect->reset(solve->self, &world->plan.body[body]);
    pal_world_find_limit(world, 0);
}
