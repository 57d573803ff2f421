/* Scene -> bodies and ordered rows. */
#include "server/sim/plan/plan_requests.h"

#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_body.h"
#include "server/sim/surface/adaptive_surface.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *pal_stage_name(pal_stage stage)
{
    static const char *const names[] = {"contact", "force", "solve", "adapt", "guard", "output"};
    return (unsigned)stage < PAL_STAGE_COUNT ? names[stage] : "?";
}

static pal_err add_wish(pal_plan_requests *s, pal_config_entry *item, bool replaces)
{
    const pal_effect *effect = pal_effect_find(item->name);
    const char *body = s->build.body->name;
    if (!effect)
        return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\" %s: there is no effect \"%s\"", body,
                                  item->path, item->name);
    for (int i = 0; i < s->n_request; i++) {
        bool solver = effect->stage == PAL_STAGE_SOLVE && s->wish[i].effect->stage == PAL_STAGE_SOLVE;
        if (s->wish[i].effect != effect && !solver) continue;
        bool models = s->wish[i].item >= s->recipe.row && s->wish[i].item < s->recipe.row + PAL_ENTRIES_MAX;
        if (!replaces || !models)
            return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\" %s: a second row of \"%s\"", body,
                                      item->path, item->name);
        s->wish[i] = (pal_plan_request){effect, item};
        return PAL_ERR_OK;
    }
    if (s->n_request == PAL_PLAN_REQUEST_MAX)
        return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\": more than %d rows", body,
                                  PAL_PLAN_REQUEST_MAX);
    s->wish[s->n_request++] = (pal_plan_request){effect, item};
    return PAL_ERR_OK;
}

/* the entry `solver` or `output`; an empty name asks for nothing */
static pal_err add_named(pal_plan_requests *s, pal_config_entry *own, const pal_config_entry *item, pal_stage stage)
{
    if (!item->name[0]) return PAL_ERR_OK;
    *own = *item;
    PAL_TRY(add_wish(s, own, true));
    if (pal_effect_find(own->name)->stage != stage)
        return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\" %s: \"%s\" is not of stage %s",
                                  s->build.body->name, own->path, own->name, pal_stage_name(stage));
    return PAL_ERR_OK;
}

/* holds the vertices on open edges, on every level: the halves of an open edge are open edges too */
static pal_err hold_rim(pal_body *body, int index, pal_diagnostic *diag)
{
    if (!body->adaptive)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "body \"%s\" supports[%d].boundary: the model has no surface of its own", body->name,
                                  index);
    const pal_levels *levels = &body->adaptive->levels;
    if (levels->closed)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "body \"%s\" supports[%d].boundary: the surface has no open edge", body->name, index);
    for (int i = 0; i < body->n_dof; i++)
        if (pal_levels_on_boundary(levels, i)) body->fixed[i] = 1;
    return PAL_ERR_OK;
}

static pal_err hold(pal_body *body, const pal_body_def *def, const double up[3], pal_diagnostic *diag)
{
    for (int s = 0; s < def->n_support; s++) {
        if (def->support[s].rim) PAL_TRY(hold_rim(body, s, diag));
        pal_support_hold(&def->support[s], up, body->x_rest, body->n_dof, body->fixed);
    }
    return PAL_ERR_OK;
}

static double box_diagonal(const pal_body *body)
{
    double low[3], high[3];
    for (int c = 0; c < 3; c++) low[c] = INFINITY, high[c] = -INFINITY;
    for (int i = 0; i < body->n_node; i++)
        for (int c = 0; c < 3; c++) {
            low[c] = fmin(low[c], body->node_rest[3 * i + c]);
            high[c] = fmax(high[c], body->node_rest[3 * i + c]);
        }
    return pal_dist3(low, high);
}

static const double *mesh_origin(const pal_prepared *mesh)
{
    return mesh->tets.n_node > 0 ? mesh->tets.origin_m : mesh->surface.origin_m;
}

/* a body that adapts is its own surface, a solid shows its boundary: what skin_output, the default, would put between
 * them is not there */
static void choose_output(const pal_body *body, pal_config_entry *output)
{
    if ((body->adaptive || body->solid) && !strcmp(output->name, "skin_output"))
        snprintf(output->name, sizeof output->name, "surface_output");
}

/* arrays, supports and the ordered wishes of one body */
static pal_err build_body(pal_plan_requests *s, const pal_scene *scene)
{
    const pal_body_def *def = s->build.def;
    pal_body *body = s->build.body;
    char *name = pal_arena_alloc(s->build.arena, PAL_NAME);
    if (!name) return PAL_ERR_MEMORY;
    memcpy(name, def->name, PAL_NAME);
    body->name = name;
    const pal_model *model = pal_model_find(def->model.name);
    if (!model)
        return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\": there is no model \"%s\"", body->name,
                                  def->model.name);
    pal_config_entry *own = s->own;
    *own = def->model;
    PAL_TRY(model->build(own, &s->build, &s->recipe));
    PAL_TRY(hold(body, def, scene->up, s->build.diag));
    if (body->solid) pal_subdivision_solid_update_mass(body);
    body->length_scale_m = box_diagonal(body);
    body->load_cap_N = pal_body_load_cap_N(body, def->material.young_Pa);
    if (body->tets || body->solid) body->full_corner_kg = def->material.density_kg_m3 * pow(body->edge_m, 3) / 8;
    const double *origin = mesh_origin(def->mesh), *first = mesh_origin(scene->body[0].mesh);
    for (int c = 0; c < 3; c++) body->offset_m[c] = origin[c] - first[c];

    return pal_plan_requests_collect(s);
}

pal_err pal_plan_requests_collect(pal_plan_requests *s)
{
    const pal_body_def *def = s->build.def;
    pal_config_entry *own = s->own;
    s->n_request = 0;
    for (int i = 0; i < s->recipe.n_row; i++) PAL_TRY(add_wish(s, &s->recipe.row[i], false));
    /* what is shown comes before the entries, so that a row field_output finds it */
    pal_config_entry output = def->output;
    choose_output(s->build.body, &output);
    PAL_TRY(add_named(s, ++own, &output, PAL_STAGE_OUTPUT));
    for (int i = 0; i < def->n_effect; i++) {
        *++own = def->effect[i];
        PAL_TRY(add_wish(s, own, true));
    }
    return add_named(s, ++own, &def->solver, PAL_STAGE_SOLVE);
}

/* a row's own memory begins with a block of this size and grows by such */
enum { ROW_BLOCK = 4096 };

pal_err pal_plan_requests_make(pal_plan_requests *s, const pal_plan_request *wish, bool shared, pal_component *row)
{
    pal_arena *body_arena = s->build.arena;
    pal_arena *own = shared ? NULL : pal_arena_create(ROW_BLOCK, true);
    if (!shared && !own) return PAL_ERR_MEMORY;
    size_t before = shared ? pal_arena_used(body_arena) : 0;
    *row = (pal_component){.effect = wish->effect, .arena = own, .reason = ""};
    s->build.body_arena = body_arena;
    s->build.arena = own ? own : body_arena;
    pal_err err = wish->effect->make(wish->item, &s->build, &row->self);
    row->n_byte = pal_arena_used(s->build.arena) - before;
    s->build.arena = body_arena;
    return err;
}

void pal_plan_destroy_component(pal_component *row)
{
    if (row->self && row->effect->destroy) row->effect->destroy(row->self);
    pal_arena_destroy(row->arena);
    row->self = NULL, row->arena = NULL;
}

/* where a wish comes from: the model's recipe, the solver or output of the scene, or an effect of it */
size_t pal_plan_request_reason(const pal_plan_requests *s, const pal_plan_request *wish, char *text, size_t n_byte)
{
    const pal_config_entry *model = &s->own[0], *item = wish->item;
    const pal_body_def *def = s->build.def;
    bool recipe = item >= s->recipe.row && item < s->recipe.row + PAL_ENTRIES_MAX;
    if (recipe && wish->effect->drag)
        return (size_t)snprintf(text, n_byte, "material.damping_1_s %g of body \"%s\"", def->material.damping_1_s,
                                def->name);
    if (recipe) return (size_t)snprintf(text, n_byte, "%s \"%s\"", model->path, model->name);
    return (size_t)snprintf(text, n_byte, "%s \"%s\"", item->path, item->name);
}

/* the sentences of a body's rows, in one piece of memory */
static pal_err explain(const pal_plan_requests *s, pal_component *row, int n_row, const char **reason)
{
    size_t n_byte = 0, used = 0;
    for (int i = 0; i < s->n_request; i++) n_byte += pal_plan_request_reason(s, &s->wish[i], NULL, 0) + 1;
    char *text = pal_arena_alloc(s->build.arena, n_byte);
    if (!text) return PAL_ERR_MEMORY;
    *reason = text;
    for (int i = 0; i < s->n_request; i++) {
        size_t n = pal_plan_request_reason(s, &s->wish[i], text + used, n_byte - used);
        for (int k = 0; k < n_row; k++)
            if (row[k].effect == s->wish[i].effect) row[k].reason = text + used;
        used += n + 1;
    }
    return PAL_ERR_OK;
}

/* does the row say what the body shows? */
static bool shows(const pal_plan_request *wish)
{
    return wish->effect->stage == PAL_STAGE_OUTPUT && strcmp(wish->effect->name, "field_output") != 0;
}

static pal_err make_rows(pal_plan_requests *s, pal_component *row, int *n_row)
{
    int n_solve = 0, first = *n_row;
    const char *name = s->build.body->name;
    for (int i = 0; i < s->n_request; i++) s->build.body->implicit |= s->wish[i].effect->implicit;
    for (int i = 0; i < s->n_request; i++) {
        const pal_effect *effect = s->wish[i].effect;
        if (s->build.body->implicit && effect->internal && !effect->tangent)
            return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED,
                                      "body \"%s\": row \"%s\" has no tangent, which its implicit solver needs", name,
                                      effect->name);
    }
    /* the OUTPUT row first: its make says what the body shows, which is what tools touch; the SOLVE row last: the
     * others have said what they want of it */
    for (int pass = 0; pass < 3; pass++)
        for (int i = 0; i < s->n_request; i++) {
            pal_stage stage = s->wish[i].effect->stage;
            if (pass != (stage == PAL_STAGE_OUTPUT ? 0 : stage == PAL_STAGE_SOLVE ? 2 : 1)) continue;
            s->build.made = row + first, s->build.n_made = *n_row - first;
            pal_component *r = &row[(*n_row)++];
            /* what a body shows stays with it, its other rows may be switched off */
            PAL_TRY(pal_plan_requests_make(s, &s->wish[i], shows(&s->wish[i]), r));
            n_solve += r->effect->stage == PAL_STAGE_SOLVE;
        }
    if (n_solve != 1)
        return pal_diagnostic_set(s->build.diag, PAL_ERR_REFUSED, "body \"%s\": %d solvers, wanted one", name, n_solve);
    return PAL_ERR_OK;
}

/* rows made body by body -> by stage, then body */
static void sort_rows(pal_plan *plan, const pal_component *made, const int *made_body)
{
    int n = 0;
    for (int stage = 0; stage < PAL_STAGE_COUNT; stage++)
        for (int b = 0; b < plan->n_body; b++) {
            plan->first[stage][b] = n;
            for (int i = 0; i < plan->n_row; i++)
                if (made_body[i] == b && made[i].effect->stage == (pal_stage)stage) {
                    plan->row[n] = made[i];
                    plan->component_body[n++] = b;
                }
            plan->n_of[stage][b] = n - plan->first[stage][b];
        }
}

/* what a body that adapts takes in all: its arena, scratch, what the world keeps of what is shown (rest places, table
 * of triangles, parents) and lasting loads, and the world's own */
static pal_err check_memory(const pal_plan_requests *s, size_t arena_byte)
{
    enum { WORLD_BYTE = 1 << 17 };
    const pal_body *body = s->build.body;
    pal_diagnostic reason = {{0}};
    if (!body->adaptive) return PAL_ERR_OK;
    size_t n = (size_t)body->n_node,
           shown = n * (3 * sizeof(float) + 2 * sizeof(int32_t)) + (size_t)body->adaptive->n_slot * 3 * sizeof(int32_t);
    size_t n_byte = arena_byte + s->build.scratch_byte + shown + 3 * n * sizeof(double) + WORLD_BYTE;
    pal_err err = pal_adaptive_check_bytes(body->adaptive, n_byte, &reason);
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
        int before = out->n_row;
        size_t before_byte = pal_arena_used(arena);
        PAL_TRY(build_body(s, scene));
        PAL_TRY(make_rows(s, made, &out->n_row));
        PAL_TRY(explain(s, made + before, out->n_row - before, &out->reason[b]));
        size_t row_byte = 0;
        for (int i = before; i < out->n_row; i++) row_byte += made[i].arena ? made[i].n_byte : 0;
        PAL_TRY(check_memory(s, pal_arena_used(arena) - before_byte + row_byte));
        for (int i = before; i < out->n_row; i++) made_body[i] = b;
        /* rows of springs have said by now what they stand for */
        out->body[b].load_cap_N = pal_body_load_cap_N(&out->body[b], scene->body[b].material.young_Pa);
        if (s->build.scratch_byte > out->scratch_byte) out->scratch_byte = s->build.scratch_byte;
    }
    out->row = PAL_NEW(arena, pal_component, out->n_row);
    out->component_body = PAL_NEW(arena, int, out->n_row);
    if (!out->row || !out->component_body) return PAL_ERR_MEMORY;
    sort_rows(out, made, made_body);
    out->n_load = out->n_row;
    out->load_component = out->row;
    out->load_component_body = out->component_body;
    return PAL_ERR_OK;
}

/* what bodies own beside the arena */
static void free_solids(pal_plan *plan)
{
    for (int b = 0; b < plan->n_body && plan->body; b++) {
        pal_subdivision_solid_free(plan->body[b].solid);
        plan->body[b].solid = NULL;
    }
}

pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_diagnostic *diag, pal_plan *out)
{
    pal_plan_requests *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    *out = (pal_plan){0};
    pal_component made[PAL_BODY_MAX * PAL_PLAN_REQUEST_MAX] = {{0}};
    pal_err err = build_all(scene, arena, diag, s, made, out);
    /* rows that were made before something was refused */
    for (int i = 0; err && i < out->n_row; i++) pal_plan_destroy_component(&made[i]);
    if (err) {
        free_solids(out);
        *out = (pal_plan){0};
    }
    free(s);
    return err;
}

void pal_plan_free(pal_plan *plan)
{
    for (int i = 0; i < plan->n_row; i++) pal_plan_destroy_component(&plan->row[i]);
    plan->n_row = 0;
    if (plan->row != plan->load_component) free(plan->row);
    plan->row = plan->load_component = NULL;
    free_solids(plan);
}
