/* The world: steps a plan. Start reading at pal_world_step, at the end. */
#include "server/sim/world/world.h"

#include "server/base/clock.h"
#include "server/base/spare_thread.h"
#include "server/base/vec3.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/lowest_frequency.h"
#include "server/sim/world/shown_copies.h"
#include "server/sim/world/world_core.h"

#include <stdlib.h>
#include <string.h>

/* ---- load ---- */

pal_step pal_world_body_step(pal_world *w, int b)
{
    pal_plan *p = &w->plan;
    return (pal_step){.body = &p->body[b],
                      .tools = &w->tools,
                      .scratch = w->scratch,
                      .force = p->component + p->first[PAL_STAGE_FORCE][b],
                      .n_force = p->n_of[PAL_STAGE_FORCE][b],
                      .contact = p->component + p->first[PAL_STAGE_CONTACT][b],
                      .n_contact = p->n_of[PAL_STAGE_CONTACT][b],
                      .adapt = p->component + p->first[PAL_STAGE_ADAPT][b],
                      .n_adapt = p->n_of[PAL_STAGE_ADAPT][b],
                      .time_s = w->time_s};
}

double pal_world_find_limit(pal_world *w, int sub)
{
    double min = INFINITY;
    for (int b = 0; b < w->plan.n_body; b++) {
        pal_step step = pal_world_body_step(w, b);
        step.sub = sub;
        const pal_component *solve = &w->plan.component[w->plan.first[PAL_STAGE_SOLVE][b]];
        if (step.body->frozen || step.body->asleep || !solve->effect->bounds.limit) continue;
        double limit = solve->effect->bounds.limit(solve->self, &step);
        step.body->dt_limit_s = limit;
        if (!(limit > 0))
            pal_body_stop_bad(step.body, "its forces allow no stable step");
        else if (limit < min)
            min = limit;
    }
    w->limit_s = min;
    return min;
}

/* number of sub-steps for a time; beyond the budget: budget + 1 */
static int count_substeps(const pal_world *w, double time_s, double limit_s)
{
    double n = ceil(time_s / limit_s * (1 - 1e-12));
    return n < 1 ? 1 : n > w->max_substep ? w->max_substep + 1 : (int)n;
}

static bool refines(const pal_world *w, int b)
{
    return w->plan.body[b].active && w->plan.n_of[PAL_STAGE_ADAPT][b] > 0;
}

/* Clears what FORCE components cached with the last forces (rotations of elements), so that a new world equals a
 * reset one */
static void reset_forces(pal_world *w, int b)
{
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_FORCE][b]; i++) {
        const pal_component *component = &w->plan.component[w->plan.first[PAL_STAGE_FORCE][b] + i];
        if (component->effect->reset) component->effect->reset(component->self, &w->plan.body[b]);
    }
}

/* the limit at rest and on the finest level that bodies may reach, whatever their present state; invalidates every
 * solver's limit */
static double find_rest_limit(pal_world *w)
{
    double min = INFINITY, limit_s = w->limit_s;
    for (int b = 0; b < w->plan.n_body; b++) {
        pal_body *body = &w->plan.body[b];
        const pal_component *solve = &w->plan.component[w->plan.first[PAL_STAGE_SOLVE][b]];
        if (!solve->effect->bounds.limit) continue;
        double *x = body->x, *d = body->d;
        body->x = body->x_rest;
        if (!body->interpolation) body->d = body->x_rest;
        pal_body_update_nodes(body);
        pal_step step = pal_world_body_step(w, b);
        step.n_contact = 0;
        double limit = solve->effect->bounds.limit(solve->self, &step);
        body->x = x, body->d = d;
        pal_body_update_nodes(body);
        /* refinement may reach the finest level; each level halves the step approximately (paper C, eq. 9) */
        if (refines(w, b)) limit = ldexp(limit, body->dofs.finest + 1 - body->dofs.levels->n_level);
        if (solve->effect->reset) solve->effect->reset(solve->self, body);
        if (body->interpolation) reset_forces(w, b);
        if (!(limit >= min)) min = limit;
    }
    w->limit_s = limit_s;
    return min;
}

pal_err pal_world_check_budget(pal_world *w, pal_diagnostic *diag)
{
    double limit = find_rest_limit(w);
    int n = count_substeps(w, w->step_s, limit);
    bool is_adaptive = false;
    for (int b = 0; b < w->plan.n_body; b++) is_adaptive |= refines(w, b);
    if (!(limit > 0) || n > w->max_substep) {
        char who[120];
        pal_world_describe_limit(w, who, sizeof who);
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET,
                                  "a step of %g s needs %.0f sub-steps of %.3g s%s%s, max_substep allows %d: take a "
                                  "softer or denser material, larger elements%s or a shorter step",
                                  w->step_s, ceil(w->step_s / limit), limit, is_adaptive ? " on the finest level" : "",
                                  who, w->max_substep, is_adaptive ? ", fewer levels" : "");
    }
    w->rest_limit_s = limit;
    return PAL_ERR_OK;
}

/* the refinement hierarchy of an adaptive body, for encoders and renderers */
static pal_err make_hierarchy(pal_world *w, const pal_levels *levels, pal_shown *p)
{
    int n_coarse = levels->n_vertex[0];
    int32_t *parent = PAL_NEW(w->arena, int32_t, 2 * (size_t)(p->n_vertex - n_coarse) + 2);
    if (!parent) return PAL_ERR_MEMORY;
    p->is_adaptive = true;
    p->n_coarse = n_coarse, p->parent = parent;
    p->n_coarse_tri = levels->first_face[1], p->coarse_tri = levels->face;
    for (int i = n_coarse; i < p->n_vertex; i++, parent += 2)
        memcpy(parent, levels->edge[pal_levels_vertex_parent(levels, i)].vertex, 2 * sizeof *parent);
    return PAL_ERR_OK;
}

/* u, v and look of the corners of the shown triangles: of the images, of the inside of a solid; heap, NULL: all are the
 * outside of tissue */
static pal_err find_looks(const pal_body_def *def, const pal_body *body, int n_tri, float **out)
{
    const float *image_at = body->display.skin || body->active ? def->mesh->surface.image_at : NULL;
    const uint8_t *inside = body->display.shown_inside;
    *out = NULL;
    if (!(image_at && def->n_image > 0) && !inside) return PAL_ERR_OK;
    float *corner = calloc(9 * (size_t)n_tri + 1, sizeof *corner);
    if (!corner) return PAL_ERR_MEMORY;
    for (size_t t = 0; t < (size_t)n_tri; t++)
        for (size_t c = 3 * t; c < 3 * t + 3; c++) {
            if (inside) corner[3 * c + 2] = inside[t] ? PAL_LOOK_INSIDE : PAL_LOOK_OUTSIDE;
            if (inside || !(image_at[3 * c + 2] >= 0 && image_at[3 * c + 2] < (float)def->n_image)) continue;
            memcpy(corner + 3 * c, image_at + 3 * c, 3 * sizeof *corner);
            corner[3 * c + 2] += PAL_LOOK_IMAGE;
        }
    *out = corner;
    return PAL_ERR_OK;
}

static pal_err make_looks(pal_world *w, const pal_body_def *def, const pal_body *body, pal_shown *p)
{
    const int n_tri = body->active ? p->n_coarse_tri : p->n_tri;
    float *corner;
    PAL_TRY(find_looks(def, body, n_tri, &corner));
    if (!corner) return PAL_ERR_OK;
    pal_err err =
        pal_shown_copies_make(p, n_tri, body->active ? p->coarse_tri : p->tri, corner, body->dofs.levels, w->arena);
    free(corner);
    return err;
}

static pal_err make_part(pal_world *w, const pal_body_def *def, int b)
{
    const pal_body *body = &w->plan.body[b];
    const pal_display *display = &body->display;
    pal_shown *p = &w->part[b];
    p->name = body->name;
    if (display->n_shown == 0) return PAL_ERR_OK;
    p->n_vertex = p->n_own = display->n_shown;
    p->n_tri = body->active ? body->dofs.n_slot : display->surface->n_tri;
    float *rest_m = PAL_NEW(w->arena, float, 3 * (size_t)p->n_vertex);
    if (!rest_m) return PAL_ERR_MEMORY;
    const double *x = display->skin ? display->surface->x : body->node_rest;
    for (int i = 0; i < p->n_vertex; i++) {
        int from = display->skin ? i : display->shown_node[i];
        for (int c = 0; c < 3; c++) rest_m[3 * i + c] = (float)(x[3 * from + c] + body->offset_m[c]);
    }
    p->rest_m = rest_m;
    p->tri = display->surface->tri;
    /* the mesh lasts as long as the scene; surfaces of models and components may change */
    if (display->surface != &def->mesh->surface) {
        int32_t *tri = PAL_NEW(w->arena, int32_t, 3 * (size_t)p->n_tri);
        if (!tri) return PAL_ERR_MEMORY;
        memcpy(tri, body->active ? body->dofs.slot : p->tri, 3 * sizeof *tri * (size_t)p->n_tri);
        p->tri = tri;
    }
    p->node_rest_m = body->node_rest;
    pal_copy3(p->offset_m, body->offset_m);
    if (body->tets) p->n_node = body->tets->n_node, p->n_tet = body->tets->n_tet, p->tet = body->tets->tet;
    if (display->tet) p->n_node = body->n_node, p->n_tet = display->n_tet, p->tet = display->tet;
    PAL_TRY(body->active ? make_hierarchy(w, body->dofs.levels, p) : PAL_ERR_OK);
    return make_looks(w, def, body, p);
}

void pal_world_show(pal_world *w, int b)
{
    pal_step step = pal_world_body_step(w, b);
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_OUTPUT][b]; i++) {
        pal_component *component = &w->plan.component[w->plan.first[PAL_STAGE_OUTPUT][b] + i];
        component->n_run++;
        (void)component->effect->run(component->self, &step);
    }
    pal_body_add_display_offset(step.body);
    pal_arena_reset(w->scratch);
    step.body->display.n_output++;
    step.body->stale = false;
}

void pal_world_show_all(pal_world *w)
{
    for (int b = 0; b < w->plan.n_body; b++) pal_world_show(w, b);
}

static pal_err create(pal_world *w, const pal_scene *scene, pal_diagnostic *diag)
{
    PAL_TRY(pal_scene_check(scene, diag));
    w->arena = pal_arena_create(1 << 20, true);
    if (!w->arena) return PAL_ERR_MEMORY;
    w->step_s = scene->step_s;
    w->max_substep = scene->max_substep;
    if (scene->threads > 1) PAL_TRY(pal_team_create(scene->threads, &w->team));
    PAL_TRY(pal_plan_build(scene, w->arena, diag, &w->plan));
    for (int b = 0; b < w->plan.n_body; b++) {
        w->plan.body[b].team = w->team;
        if (w->plan.body[b].node_order) w->plan.body[b].node_order->team = w->team;
    }
    w->scratch = pal_arena_create(w->plan.scratch_byte + 64, false);
    if (!w->scratch) return PAL_ERR_MEMORY;
    w->tools.n_tool = scene->n_tool;
    for (int t = 0; t < scene->n_tool; t++) {
        const double radius_m = scene->tool[t].radius_m;
        w->tools.tool[t].radius_m = radius_m > 0 ? radius_m : 0.04 * w->plan.body[0].length_scale_m;
        w->tools.tool[t].force_cap_N = scene->tool[t].force_cap_N;
    }
    for (int b = 0; b < w->plan.n_body; b++) {
        w->material[b] = scene->body[b].material;
        PAL_TRY(pal_material_check(&w->material[b], diag));
        pal_world_keep_lowest(w, b);
        PAL_TRY(make_part(w, &scene->body[b], b));
    }
    PAL_TRY(pal_field_components_check(&w->plan, diag));
    PAL_TRY(pal_world_check_budget(w, diag));
    w->n_substep = count_substeps(w, w->step_s, pal_world_find_limit(w, 0));
    pal_world_show_all(w);
    return PAL_ERR_OK;
}

pal_err pal_world_create(const pal_scene *scene, pal_diagnostic *diag, pal_world **out)
{
    pal_world *w = calloc(1, sizeof *w);
    pal_err err = w ? create(w, scene, diag) : PAL_ERR_MEMORY;
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "out of memory for the scene \"%s\"", scene->name);
    if (err)
        pal_world_destroy(w);
    else
        *out = w;
    return err;
}

void pal_world_destroy(pal_world *world)
{
    if (!world) return;
    pal_plan_free(&world->plan);
    pal_team_destroy(world->team);
    pal_arena_destroy(world->scratch);
    pal_arena_destroy(world->arena);
    free(world);
}

/* ---- a step ---- */

void pal_world_keep_lowest(pal_world *w, int b)
{
    w->found_1_s[b] = w->plan.body[b].lowest_1_s;
    w->found_with[b] = w->material[b];
}

double pal_world_drag_1_s(const pal_world *w, int b)
{
    return pal_guard_drag_1_s(w->plan.component + w->plan.first[PAL_STAGE_FORCE][b], w->plan.n_of[PAL_STAGE_FORCE][b]);
}

double pal_world_component_energy_J(const pal_world *w, int b)
{
    double sum = 0;
    for (int i = 0; i < w->plan.n_component; i++) {
        const pal_component *component = &w->plan.component[i];
        if (w->plan.component_body[i] == b && component->effect->energy)
            sum += component->effect->energy(component->self, &w->plan.body[b]);
    }
    return sum;
}

pal_err pal_world_find_lowest(pal_world *world, int body, double *mode)
{
    pal_plan *plan = &world->plan;
    const pal_build build = {.body = &plan->body[body],
                             .made = plan->component + plan->first[PAL_STAGE_FORCE][body],
                             .n_made = plan->n_of[PAL_STAGE_FORCE][body]};
    PAL_TRY(pal_lowest_frequency_find(&build, NULL, mode));
    pal_world_keep_lowest(world, body);
    return PAL_ERR_OK;
}

pal_err pal_world_assemble_forces(pal_world *world, int body)
{
    pal_step step = pal_world_body_step(world, body);
    pal_body_begin_loads(step.body);
    pal_err err = pal_assemble_forces(&step);
    pal_arena_reset(world->scratch);
    return err;
}

/* runs a component, which freezes only its body when it fails; false: it has failed */
static bool run_component(pal_world *w, pal_component *component, pal_step *step)
{
    const uint64_t before = pal_clock_ns();
    component->n_run++;
    const pal_err err = component->effect->run(component->self, step);
    component->spent_ns += pal_clock_ns() - before;
    if (err) pal_body_stop(step->body, -1, "row %s: %s", component->effect->name, pal_err_text(err));
    if (err && !w->component_err) w->component_err = err;
    return !err;
}

/* Lasting loads and tool contact of one body, each node's load within the cap. Loads that an implicit solver returns
 * through the contact stiffness are exempt; there the components themselves keep the remainder within the cap */
static void run_contact(pal_world *w, pal_step *step, int b)
{
    pal_body *body = step->body;
    pal_body_begin_loads(body);
    if (body->external_force) pal_body_cap_loads(body, true);
    for (int i = 0; i < step->n_contact; i++) {
        if (!run_component(w, &w->plan.component[w->plan.first[PAL_STAGE_CONTACT][b] + i], step)) return;
    }
    if (!body->implicit && step->n_contact > 0) pal_body_cap_loads(body, false);
}

static uint64_t force_ns(const pal_step *step)
{
    uint64_t sum = 0;
    for (int i = 0; i < step->n_force; i++) sum += step->force[i].spent_ns;
    return sum;
}

static void run_substep(pal_world *w, pal_step *shared)
{
    for (int b = 0; b < w->plan.n_body; b++) {
        if (w->plan.body[b].frozen || w->plan.body[b].asleep) continue;
        pal_step step = pal_world_body_step(w, b);
        step.body->stale = true;
        step.dt_s = shared->dt_s, step.sub = shared->sub, step.n_sub = shared->n_sub;
        step.time_s = shared->time_s;
        step.adds_mass = shared->adds_mass && step.body->dt_limit_s < step.dt_s;
        step.body->safeguards.n_mass_scaled += step.adds_mass;
        run_contact(w, &step, b);
        pal_component *solve = &w->plan.component[w->plan.first[PAL_STAGE_SOLVE][b]];
        uint64_t before = solve->spent_ns, forces = force_ns(&step);
        if (!step.body->frozen) (void)run_component(w, solve, &step);
        if (step.adds_mass) step.body->safeguards.ns += solve->spent_ns - before;
        solve->spent_ns -= force_ns(&step) - forces;
        /* interpolates the nodes, for contact and for the stages after the step */
        if (step.n_contact > 0 || step.sub == step.n_sub - 1) pal_body_update_nodes(step.body);
        pal_arena_reset(w->scratch);
    }
}

/* runs ADAPT, GUARD and OUTPUT components, once per step */
static void run_stage(pal_world *w, pal_stage stage, double dt_s)
{
    for (int b = 0; b < w->plan.n_body; b++) {
        pal_step step = pal_world_body_step(w, b);
        step.dt_s = dt_s;
        step.n_sub = 1;
        bool output = stage == PAL_STAGE_OUTPUT,
             skips = output ? w->unobserved && !step.body->asleep : step.body->asleep;
        /* show a body that fell asleep in this step at its final position, from which nearness of tools is tested */
        if (skips || (output && step.body->asleep && !step.body->stale)) continue;
        int n_run = 0;
        for (int i = 0; i < w->plan.n_of[stage][b]; i++) {
            /* a frozen body is shown where it stopped, if that is finite; its guard may restore it */
            if (step.body->frozen && stage == PAL_STAGE_ADAPT) continue;
            if (step.body->frozen && stage == PAL_STAGE_OUTPUT && !pal_body_finite(step.body)) continue;
            if (!run_component(w, &w->plan.component[w->plan.first[stage][b] + i], &step)) break;
            n_run++;
        }
        pal_arena_reset(w->scratch);
        if (!output) continue;
        if (n_run > 0) pal_body_add_display_offset(step.body);
        step.body->display.n_output++, step.body->stale = false;
    }
}

/* Wakes sleeping bodies that a tool approaches in this step; without observers updates the shown surface where tools
 * may touch it */
static void begin_step(pal_world *w, double dt_s)
{
    bool fixed = false;
    for (int t = 0; t < w->tools.n_tool; t++) fixed |= w->tools.tool[t].present || w->tools.tool[t].ramp > 0;
    for (int b = 0; b < w->plan.n_body; b++) {
        pal_step step = pal_world_body_step(w, b);
        step.dt_s = dt_s, step.n_sub = 1;
        for (int i = 0; i < w->plan.n_of[PAL_STAGE_GUARD][b] && step.body->asleep; i++) {
            const pal_component *component = &w->plan.component[w->plan.first[PAL_STAGE_GUARD][b] + i];
            if (component->effect->sleep.wakes && component->effect->sleep.wakes(component->self, &step))
                step.body->asleep = false;
        }
        bool touched = fixed && step.n_contact > 0 && !step.body->frozen && !step.body->asleep;
        if (w->unobserved && touched && step.body->stale) pal_world_show(w, b);
    }
}

/* equal sub-steps; the rest of the step is divided again when the limit falls below them */
static void run_substeps(pal_world *w, double dt_s)
{
    double done_s = 0;
    int n_sub = 0;
    pal_step step = {.dt_s = 0};
    for (int sub = 0; sub == 0 || sub < n_sub; sub++) {
        double limit = pal_world_find_limit(w, sub), left_s = dt_s - done_s;
        int budget = w->max_substep - sub;
        if (sub == 0 || step.dt_s > limit) {
            int n = count_substeps(w, left_s, limit);
            step.adds_mass = n > budget;
            n_sub = sub + (n > budget ? (budget > 0 ? budget : 1) : n);
            step.dt_s = left_s / (n_sub - sub);
        }
        step.sub = sub, step.n_sub = n_sub;
        step.time_s = w->time_s + done_s + step.dt_s;
        pal_tools_begin_substep(&w->tools, sub, n_sub, step.dt_s);
        run_substep(w, &step);
        done_s += step.dt_s;
    }
    w->n_substep = n_sub;
}

static int count_frozen(const pal_world *w)
{
    int n = 0;
    for (int b = 0; b < w->plan.n_body; b++) n += w->plan.body[b].frozen;
    return n;
}

/* processor time of those on whom a step waits */
static uint64_t work_ns(const pal_world *w)
{
    return pal_team_mean_ns(w->team, pal_clock_thread_ns() + pal_spare_thread_waited_ns());
}

pal_err pal_world_step(pal_world *world, double dt_s)
{
    pal_world *w = world;
    if (!(dt_s > 0) || !isfinite(dt_s)) return PAL_ERR_REFUSED;
    /* a step that is too long at rest is refused; deformation is handled during the step */
    if (count_substeps(w, dt_s, w->rest_limit_s) > w->max_substep) return PAL_ERR_BUDGET;
    const uint64_t began = work_ns(w);
    int frozen = count_frozen(w);
    for (int i = 0; i < w->plan.n_component; i++) w->plan.component[i].spent_ns = 0;
    for (int t = 0; t < w->tools.n_tool; t++)
        pal_tool_begin_step(&w->tools.tool[t], w->has_requested_pose[t] ? &w->requested_pose[t] : NULL, dt_s);
    w->component_err = PAL_ERR_OK;
    pal_team_hold(w->team);
    begin_step(w, dt_s);
    run_substeps(w, dt_s);
    pal_tools_end_step(&w->tools, w->n_substep);
    w->tick++;
    w->time_s += dt_s;
    run_stage(w, PAL_STAGE_ADAPT, dt_s);
    run_stage(w, PAL_STAGE_GUARD, dt_s);
    run_stage(w, PAL_STAGE_OUTPUT, dt_s);
    pal_team_release(w->team);
    w->step_ns = work_ns(w) - began;
    w->end_ns = pal_clock_ns();
    return w->component_err ? w->component_err : count_frozen(w) > frozen ? PAL_ERR_FROZEN : PAL_ERR_OK;
}

/* ---- read access; frames and shown surfaces are in world_show.c ---- */

uint64_t pal_world_step_ns(const pal_world *world)
{
    return world->step_ns;
}

double pal_world_limit_s(const pal_world *world)
{
    return world->limit_s;
}

int pal_world_substeps(const pal_world *world)
{
    return world->n_substep;
}

int pal_world_rest_substeps(const pal_world *world)
{
    return count_substeps(world, world->step_s, world->rest_limit_s);
}

double pal_world_energy_J(const pal_world *world)
{
    double sum = 0;
    for (int b = 0; b < world->plan.n_body; b++)
        sum += pal_body_kinetic_J(&world->plan.body[b]) + pal_world_component_energy_J(world, b);
    return sum;
}

size_t pal_world_bytes(const pal_world *world)
{
    return sizeof *world + pal_arena_used(world->arena) + world->plan.scratch_byte + pal_plan_bytes(&world->plan) +
           pal_brush_components_bytes(&world->brushes);
}

int pal_world_body_count(const pal_world *world)
{
    return world->plan.n_body;
}

pal_body *pal_world_body(pal_world *world, int body)
{
    return &world->plan.body[body];
}

const pal_tools *pal_world_tools(const pal_world *world)
{
    return &world->tools;
}

bool pal_world_is_settled(const pal_world *world, int body)
{
    static const pal_stage stages[] = {PAL_STAGE_FORCE, PAL_STAGE_CONTACT, PAL_STAGE_ADAPT};
    const pal_plan *plan = &world->plan;
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++)
        if (pal_components_change(plan->component + plan->first[stages[i]][body], plan->n_of[stages[i]][body],
                                  pal_world_time_s(world)))
            return false;
    return true;
}

bool pal_world_solve_report(const pal_world *world, int body, pal_solve_report *out)
{
    const pal_component *solve = &world->plan.component[world->plan.first[PAL_STAGE_SOLVE][body]];
    *out = (pal_solve_report){0};
    if (solve->effect->inspect.report) solve->effect->inspect.report(solve->self, out);
    return solve->effect->inspect.report != NULL;
}
