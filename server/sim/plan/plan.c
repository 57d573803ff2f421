/* Bodies and ordered components from a scene. */
#include "server/sim/plan/plan.h"

#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/lowest_frequency.h"
#include "server/sim/implicit/tissue_compliance.h"
#include "server/sim/plan/plan_requests.h"

#include <stdlib.h>
#include <string.h>

/* holds the vertices on open edges, on every level: the halves of an open edge are open edges too */
static pal_err fix_rim(pal_body *body, int index, pal_diagnostic *diag)
{
    if (!body->active)
        return PAL_REFUSE(diag, "body \"%s\" supports[%d].boundary: the model has no surface of its own", body->name,
                          index);
    const pal_levels *levels = body->dofs.levels;
    if (levels->closed)
        return PAL_REFUSE(diag, "body \"%s\" supports[%d].boundary: the surface has no open edge", body->name, index);
    for (int i = 0; i < body->n_dof; i++)
        if (pal_levels_on_boundary(levels, i)) body->support[i] = PAL_FIXED;
    return PAL_ERR_OK;
}

static const double *mesh_origin(const pal_prepared *mesh)
{
    return mesh->tets.n_node > 0 ? mesh->tets.origin_m : mesh->surface.origin_m;
}

/* arrays, supports and the ordered requests of one body */
static pal_err build_body(pal_plan_requests *s, const pal_scene *scene)
{
    const pal_body_def *def = s->build.def;
    pal_body *body = s->build.body;
    char *name = pal_arena_alloc(s->build.arena, PAL_NAME);
    if (!name) return PAL_ERR_MEMORY;
    memcpy(name, def->name, PAL_NAME);
    body->name = name;
    const pal_model *model = pal_model_find(def->model.name);
    if (!model) return PAL_REFUSE(s->build.diag, "body \"%s\": there is no model \"%s\"", body->name, def->model.name);
    pal_config_entry *own = s->own;
    *own = def->model;
    PAL_TRY(model->build(own, &s->build, &s->from_model));
    for (int k = 0; k < def->n_support; k++) {
        if (def->support[k].rim) PAL_TRY(fix_rim(body, k, s->build.diag));
        pal_support_mark_fixed(&def->support[k], scene->up, body->x_rest, body->n_dof, body->support);
    }
    if (body->dofs.update_mass) body->dofs.update_mass(body);
    double low[3], high[3];
    pal_box3_empty(low, high);
    for (int i = 0; i < body->n_node; i++) pal_box3_add(low, high, body->node_rest + 3 * (size_t)i);
    body->length_scale_m = pal_dist3(low, high);
    body->load_cap_N = pal_body_load_cap_N(body, def->material.young_Pa);
    if (body->tets || body->interpolation)
        body->full_corner_kg = def->material.density_kg_m3 * pow(body->edge_m, 3) / 8;
    const double *origin = mesh_origin(def->mesh), *first = mesh_origin(scene->body[0].mesh);
    for (int c = 0; c < 3; c++) body->offset_m[c] = origin[c] - first[c];

    return pal_plan_requests_collect(s);
}

/* the sentences of the components of a body, in one piece of memory */
static pal_err explain(const pal_plan_requests *s, pal_component *list, int n_component, const char **reason)
{
    size_t n_byte = 0, used = 0;
    for (int i = 0; i < s->n_request; i++) n_byte += pal_plan_request_reason(s, &s->request[i], NULL, 0) + 1;
    char *text = pal_arena_alloc(s->build.arena, n_byte);
    if (!text) return PAL_ERR_MEMORY;
    *reason = text;
    for (int i = 0; i < s->n_request; i++) {
        size_t n = pal_plan_request_reason(s, &s->request[i], text + used, n_byte - used);
        for (int k = 0; k < n_component; k++)
            if (list[k].effect == s->request[i].effect) list[k].reason = text + used;
        used += n + 1;
    }
    return PAL_ERR_OK;
}

/* The lowest frequency of a body that moves by itself, where damping or sleep follow from it; then its drag. list: all
 * but the solver [n] */
static pal_err find_damping(pal_plan_requests *s, pal_component *list, int n, const pal_rest_values *rest)
{
    pal_body *body = s->build.body;
    pal_material material = s->build.def->material;
    bool wanted = material.damping_1_s == PAL_DAMPING_DERIVED, moves = true;
    for (int i = 0; i < s->n_request; i++) {
        wanted |= s->request[i].effect->sleep.wakes != NULL;
        moves &= strcmp(s->request[i].effect->name, "static_newton") != 0;
    }
    if (wanted && moves) PAL_TRY(pal_lowest_frequency_find(&s->build, rest, NULL));
    const double rate_1_s = pal_material_damping_1_s(&material, body->lowest_1_s);
    const bool other = rate_1_s != pal_material_damping_1_s(&material, 0);
    material.damping_1_s = rate_1_s;
    if (other && body->dofs.set_material) body->dofs.set_material(body, &material);
    for (int i = 0; i < n && other; i++)
        if (list[i].effect->drag && list[i].effect->material)
            PAL_TRY(list[i].effect->material(list[i].self, body, &material, s->build.diag));
    body->damping_1_s = pal_guard_drag_1_s(list, n);
    return PAL_ERR_OK;
}

/* what follows from all components of a body but its solver: compliance and damping */
static pal_err find_properties(pal_plan_requests *s, pal_component *list, int n)
{
    pal_rest_values rest = {.work = NULL};
    pal_err err = PAL_ERR_OK;
    s->build.made = list, s->build.n_made = n;
    if (s->build.body->wants_compliance && !s->build.body->implicit) err = pal_tissue_compliance_make(&s->build, &rest);
    if (!err) err = find_damping(s, list, n, &rest);
    pal_arena_destroy(rest.work);
    return err;
}

static pal_err make_components(pal_plan_requests *s, pal_component *list, int *n_component)
{
    int n_solve = 0, first = *n_component;
    const char *name = s->build.body->name;
    for (int i = 0; i < s->n_request; i++) s->build.body->implicit |= s->request[i].effect->implicit;
    for (int i = 0; i < s->n_request; i++) {
        const pal_effect *effect = s->request[i].effect;
        if (effect->moves_nodes && s->build.body->interpolation)
            return PAL_REFUSE(s->build.diag,
                              "%s: \"%s\" moves nodes, those of this body are carried by control points; take "
                              "\"central_cg\" or \"implicit_euler\"",
                              s->request[i].item->path, effect->name);
        if (s->build.body->implicit && effect->internal && !effect->tangent)
            return PAL_REFUSE(s->build.diag, "body \"%s\": row \"%s\" has no tangent, which its implicit solver needs",
                              name, effect->name);
    }
    /* the OUTPUT component first: its make says what the body shows, which is what tools touch; the SOLVE component
     * last: the others have said what they want of it */
    for (int pass = 0; pass < 3; pass++) {
        if (pass == 2) PAL_TRY(find_properties(s, list + first, *n_component - first));
        for (int i = 0; i < s->n_request; i++) {
            pal_stage stage = s->request[i].effect->stage;
            if (pass != (stage == PAL_STAGE_OUTPUT ? 0 : stage == PAL_STAGE_SOLVE ? 2 : 1)) continue;
            s->build.made = list + first, s->build.n_made = *n_component - first;
            pal_component *r = &list[(*n_component)++];
            /* what a body shows is never switched off: it shares the body's memory */
            const bool shown = stage == PAL_STAGE_OUTPUT && strcmp(s->request[i].effect->name, "field_output") != 0;
            PAL_TRY(pal_plan_requests_make(s, &s->request[i], shown, r));
            n_solve += r->effect->stage == PAL_STAGE_SOLVE;
        }
    }
    if (n_solve != 1) return PAL_REFUSE(s->build.diag, "body \"%s\": %d solvers, wanted one", name, n_solve);
    return PAL_ERR_OK;
}

/* components made body by body -> by stage, then body */
static void sort_components(pal_plan *plan, const pal_component *made, const int *made_body)
{
    int n = 0;
    for (int stage = 0; stage < PAL_STAGE_COUNT; stage++)
        for (int b = 0; b < plan->n_body; b++) {
            plan->first[stage][b] = n;
            for (int i = 0; i < plan->n_component; i++)
                if (made_body[i] == b && made[i].effect->stage == (pal_stage)stage) {
                    plan->component[n] = made[i];
                    plan->component_body[n++] = b;
                }
            plan->n_of[stage][b] = n - plan->first[stage][b];
        }
}

/* what an adaptive body takes in all: its arena, scratch, what the world keeps of what is shown (rest places, table
 * of triangles, parents) and lasting loads, and the world's own */
static pal_err check_memory(const pal_plan_requests *s, size_t arena_byte)
{
    enum { WORLD_BYTE = 1 << 17 };
    const pal_body *body = s->build.body;
    pal_diagnostic reason = {{0}};
    if (!body->dofs.check_memory) return PAL_ERR_OK;
    size_t n = (size_t)body->n_node,
           shown = n * (3 * sizeof(float) + 2 * sizeof(int32_t)) + (size_t)body->dofs.n_slot * 3 * sizeof(int32_t);
    size_t n_byte = arena_byte + s->build.scratch_byte + shown + 3 * n * sizeof(double) + WORLD_BYTE;
    pal_err err = body->dofs.check_memory(body, n_byte, &reason);
    if (err) pal_diagnostic_set(s->build.diag, err, "body \"%s\" model: %s", body->name, reason.text);
    return err;
}

static pal_err build_all(const pal_scene *scene, pal_arena *arena, pal_diagnostic *diag, pal_plan_requests *s,
                         pal_component *made, pal_plan *out)
{
    int made_body[PAL_BODY_MAX * PAL_PLAN_REQUEST_MAX];
    out->n_body = scene->n_body;
    out->body = PAL_NEW(arena, pal_body, scene->n_body);
    if (!out->body) return PAL_ERR_MEMORY;
    for (int b = 0; b < scene->n_body; b++) {
        s->build =
            (pal_build){.scene = scene, .def = &scene->body[b], .body = &out->body[b], .arena = arena, .diag = diag};
        int before = out->n_component;
        size_t before_byte = pal_arena_used(arena);
        PAL_TRY(build_body(s, scene));
        PAL_TRY(make_components(s, made, &out->n_component));
        PAL_TRY(explain(s, made + before, out->n_component - before, &out->reason[b]));
        size_t component_byte = 0;
        for (int i = before; i < out->n_component; i++) component_byte += made[i].arena ? made[i].n_byte : 0;
        PAL_TRY(check_memory(s, pal_arena_used(arena) - before_byte + component_byte));
        for (int i = before; i < out->n_component; i++) made_body[i] = b;
        /* springs have set the modulus that they stand for */
        out->body[b].load_cap_N = pal_body_load_cap_N(&out->body[b], scene->body[b].material.young_Pa);
        if (s->build.scratch_byte > out->scratch_byte) out->scratch_byte = s->build.scratch_byte;
    }
    out->n_max = out->n_component + PAL_PLAN_INSERTED_MAX * out->n_body;
    out->component = PAL_NEW(arena, pal_component, out->n_max);
    out->component_body = PAL_NEW(arena, int, out->n_max);
    if (!out->component || !out->component_body) return PAL_ERR_MEMORY;
    sort_components(out, made, made_body);
    return PAL_ERR_OK;
}

/* frees what n components and the bodies own beside the arena. A solver's compliance goes with it, so the bodies' own
 * are freed first */
static void free_all(pal_plan *plan, pal_component *component, int n)
{
    for (int b = 0; b < plan->n_body && plan->body; b++) {
        const pal_compliance *compliance = plan->body[b].compliance;
        if (compliance && compliance->destroy) compliance->destroy(compliance->self);
        plan->body[b].compliance = NULL;
    }
    for (int i = 0; i < n; i++) pal_plan_destroy_component(&component[i]);
    for (int b = 0; b < plan->n_body && plan->body; b++)
        if (plan->body[b].dofs.destroy) plan->body[b].dofs.destroy(&plan->body[b]);
}

pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_diagnostic *diag, pal_plan *out)
{
    pal_plan_requests *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    *out = (pal_plan){0};
    pal_component made[PAL_BODY_MAX * PAL_PLAN_REQUEST_MAX] = {{0}};
    pal_err err = build_all(scene, arena, diag, s, made, out);
    if (err) { /* components that were made before something was refused */
        free_all(out, made, out->n_component);
        *out = (pal_plan){0};
    }
    free(s);
    return err;
}

void pal_plan_free(pal_plan *plan)
{
    free_all(plan, plan->component, plan->n_component);
    plan->n_component = 0;
}
