/* What the entries of a body ask for. */
#include "server/sim/plan/plan_requests.h"

#include "server/sim/core/effect_list.h"

#include <stdio.h>
#include <string.h>

static pal_err add_request(pal_plan_requests *s, pal_config_entry *item, bool replaces)
{
    const pal_effect *effect = pal_effect_find(item->name);
    const char *body = s->build.body->name;
    if (!effect)
        return PAL_REFUSE(s->build.diag, "body \"%s\" %s: there is no effect \"%s\"", body, item->path, item->name);
    for (int i = 0; i < s->n_request; i++) {
        bool solver = effect->stage == PAL_STAGE_SOLVE && s->request[i].effect->stage == PAL_STAGE_SOLVE;
        if (s->request[i].effect != effect && !solver) continue;
        bool models =
            s->request[i].item >= s->from_model.row && s->request[i].item < s->from_model.row + PAL_ENTRIES_MAX;
        if (!replaces || !models)
            return PAL_REFUSE(s->build.diag, "body \"%s\" %s: a second row of \"%s\"", body, item->path, item->name);
        s->request[i] = (pal_plan_request){effect, item};
        return PAL_ERR_OK;
    }
    if (s->n_request == PAL_PLAN_REQUEST_MAX)
        return PAL_REFUSE(s->build.diag, "body \"%s\": more than %d rows", body, PAL_PLAN_REQUEST_MAX);
    s->request[s->n_request++] = (pal_plan_request){effect, item};
    return PAL_ERR_OK;
}

/* the entry `solver` or `output`; an empty name asks for nothing */
static pal_err add_named(pal_plan_requests *s, pal_config_entry *own, const pal_config_entry *item, pal_stage stage)
{
    if (!item->name[0]) return PAL_ERR_OK;
    *own = *item;
    PAL_TRY(add_request(s, own, true));
    if (pal_effect_find(own->name)->stage != stage)
        return PAL_REFUSE(s->build.diag, "body \"%s\" %s: \"%s\" is not of stage %s", s->build.body->name, own->path,
                          own->name, pal_stage_name(stage));
    return PAL_ERR_OK;
}

pal_err pal_plan_requests_collect(pal_plan_requests *s)
{
    const pal_body_def *def = s->build.def;
    pal_config_entry *own = s->own;
    s->n_request = 0;
    for (int i = 0; i < s->from_model.n_row; i++) PAL_TRY(add_request(s, &s->from_model.row[i], false));
    /* what is shown comes before the entries, so that a component field_output finds it */
    pal_config_entry output = def->output;
    /* an adaptive body is its own surface and a solid shows its boundary: they have no skin */
    if ((s->build.body->active || s->build.body->interpolation) && !strcmp(output.name, "skin_output"))
        snprintf(output.name, sizeof output.name, "surface_output");
    PAL_TRY(add_named(s, ++own, &output, PAL_STAGE_OUTPUT));
    for (int i = 0; i < def->n_effect; i++) {
        *++own = def->effect[i];
        PAL_TRY(add_request(s, own, true));
    }
    return add_named(s, ++own, &def->solver, PAL_STAGE_SOLVE);
}

pal_err pal_plan_requests_make(pal_plan_requests *s, const pal_plan_request *request, bool shared,
                               pal_component *component)
{
    pal_arena *body_arena = s->build.arena;
    pal_arena *own = shared ? NULL : pal_arena_create(PAL_COMPONENT_BLOCK, true);
    if (!shared && !own) return PAL_ERR_MEMORY;
    size_t before = shared ? pal_arena_used(body_arena) : 0;
    *component = (pal_component){.effect = request->effect, .arena = own, .reason = ""};
    s->build.body_arena = body_arena;
    s->build.arena = own ? own : body_arena;
    pal_err err = request->effect->make(request->item, &s->build, &component->self);
    component->n_byte = pal_arena_used(s->build.arena) - before;
    s->build.arena = body_arena;
    return err;
}

void pal_plan_destroy_component(pal_component *component)
{
    if (component->self && component->effect->destroy) component->effect->destroy(component->self);
    pal_arena_destroy(component->arena);
    component->self = NULL, component->arena = NULL;
}

/* where a request comes from: the model's components, the solver or output of the scene, or an effect of it */
size_t pal_plan_request_reason(const pal_plan_requests *s, const pal_plan_request *request, char *text, size_t n_byte)
{
    const pal_config_entry *model = &s->own[0], *item = request->item;
    const pal_body_def *def = s->build.def;
    bool from_model = item >= s->from_model.row && item < s->from_model.row + PAL_ENTRIES_MAX;
    if (from_model && request->effect->drag)
        return def->material.damping_1_s == PAL_DAMPING_DERIVED
                   ? (size_t)snprintf(text, n_byte, "material.damping_ratio %g of body \"%s\": %.3g 1/s",
                                      def->material.damping_ratio, def->name, s->build.body->damping_1_s)
                   : (size_t)snprintf(text, n_byte, "material.damping_1_s %g of body \"%s\"", def->material.damping_1_s,
                                      def->name);
    if (from_model) return (size_t)snprintf(text, n_byte, "%s \"%s\"", model->path, model->name);
    return (size_t)snprintf(text, n_byte, "%s \"%s\"", item->path, item->name);
}
