/* Components that are switched off and on while a world runs. Off, a component is destroyed with its memory; on, it is
 * made again from its entry. make functions expect a body at rest, so its state is saved meanwhile. */
#include "server/sim/plan/plan.h"
#include "server/sim/plan/plan_requests.h"

#include "server/sim/core/effect_list.h"
#include "server/sim/implicit/lowest_frequency.h"

#include <stdlib.h>
#include <string.h>

/* puts a body to rest and returns a copy of its x and v, heap; NULL: no memory */
static double *put_to_rest(pal_body *body)
{
    const size_t n = 3 * (size_t)body->n_dof, n_byte = n * sizeof(double);
    double *saved = malloc(2 * n_byte + 1);
    if (!saved) return NULL;
    memcpy(saved, body->x, n_byte), memcpy(saved + n, body->v, n_byte);
    memcpy(body->x, body->x_rest, n_byte), memset(body->v, 0, n_byte);
    pal_body_update_nodes(body);
    return saved;
}

static void restore(pal_body *body, double *saved)
{
    const size_t n = 3 * (size_t)body->n_dof, n_byte = n * sizeof(double);
    memcpy(body->x, saved, n_byte), memcpy(body->v, saved + n, n_byte);
    pal_body_update_nodes(body);
    free(saved);
}

/* the entries of a body that is there */
static pal_err collect(pal_plan *plan, const pal_scene *scene, int b, pal_diagnostic *diag, pal_plan_requests *s)
{
    s->build = (pal_build){.scene = scene,
                           .def = &scene->body[b],
                           .body = &plan->body[b],
                           .diag = diag,
                           .scratch_byte = plan->scratch_byte};
    s->own[0] = scene->body[b].model;
    const pal_model *model = pal_model_find(s->own[0].name);
    if (!model) return PAL_ERR_INTERNAL;
    PAL_TRY(model->list(&s->own[0], &s->build, &s->from_model));
    return pal_plan_requests_collect(s);
}

static int find_request(const pal_plan_requests *s, const char *name)
{
    for (int i = 0; i < s->n_request; i++)
        if (!strcmp(s->request[i].effect->name, name)) return i;
    return -1;
}

static int find_component(const pal_plan *plan, int b, const char *name)
{
    for (int i = 0; i < plan->n_component; i++)
        if (plan->component_body[i] == b && plan->component[i].reason && !strcmp(plan->component[i].effect->name, name))
            return i;
    return -1;
}

/* elasticity: forces of its own shape, other than drag */
static bool elastic(const pal_effect *effect)
{
    return effect->stage == PAL_STAGE_FORCE && effect->internal && !effect->drag;
}

static pal_err check_removable(const pal_plan *plan, int b, const pal_effect *effect, pal_diagnostic *diag)
{
    const char *body = plan->body[b].name;
    int n_elastic = 0;
    for (int i = 0; i < plan->n_component; i++)
        n_elastic += plan->component_body[i] == b && elastic(plan->component[i].effect);
    if (effect->stage == PAL_STAGE_SOLVE)
        return PAL_REFUSE(diag, "body \"%s\": \"%s\" moves it and cannot be switched off", body, effect->name);
    if (effect->stage == PAL_STAGE_OUTPUT && strcmp(effect->name, "field_output") != 0)
        return PAL_REFUSE(diag,
                          "body \"%s\": \"%s\" gives the surface that is shown and touched and cannot be switched "
                          "off",
                          body, effect->name);
    if (elastic(effect) && n_elastic == 1)
        return PAL_REFUSE(diag, "body \"%s\": \"%s\" is the last row that holds it together", body, effect->name);
    if (!strcmp(effect->name, "moving_support"))
        return PAL_REFUSE(diag,
                          "body \"%s\": \"moving_support\" holds nodes of the body's matrix; take it out of the "
                          "scene",
                          body);
    return PAL_ERR_OK;
}

bool pal_plan_requires(const pal_plan *plan, int index)
{
    return !plan->component[index].reason ||
           check_removable(plan, plan->component_body[index], plan->component[index].effect, NULL) != PAL_ERR_OK;
}

/* makes the solver again for the body's other components with `more` (may be NULL) and without the one at `without`.
 * Components of tools say whether they need its static compliance */
static pal_err remake_solver(pal_plan *plan, pal_plan_requests *s, int b, int without, const pal_component *more,
                             pal_component *out)
{
    pal_body *body = &plan->body[b];
    const pal_component *old = &plan->component[plan->first[PAL_STAGE_SOLVE][b]];
    const pal_compliance *compliance = body->compliance;
    bool wanted = body->wants_compliance;
    pal_component *list = calloc((size_t)plan->n_component + 1, sizeof *list);
    if (!list) return PAL_ERR_MEMORY;
    int n = 0;
    for (int i = 0; i < plan->n_component; i++)
        if (plan->component_body[i] == b && i != without && plan->component[i].effect->stage != PAL_STAGE_SOLVE)
            list[n++] = plan->component[i];
    if (more) list[n++] = *more;
    s->build.made = list, s->build.n_made = n;
    body->wants_compliance = false;
    for (int i = 0; i < s->build.n_made; i++)
        body->wants_compliance |= list[i].effect->tangent && list[i].effect->tangent->settle;
    body->compliance = NULL;
    pal_err err = pal_plan_requests_make(s, &s->request[find_request(s, old->effect->name)], false, out);
    out->reason = old->reason, out->n_run = old->n_run;
    free(list);
    if (err) {
        pal_plan_destroy_component(out);
        body->compliance = compliance;
        body->wants_compliance = wanted;
    }
    return err;
}

static void replace_solver(pal_plan *plan, int b, const pal_component *to)
{
    pal_component *solve = &plan->component[plan->first[PAL_STAGE_SOLVE][b]];
    pal_plan_destroy_component(solve);
    *solve = *to;
}

static pal_err switch_off(pal_plan *plan, pal_plan_requests *s, int b, int at)
{
    const pal_effect *solver = plan->component[plan->first[PAL_STAGE_SOLVE][b]].effect;
    pal_component fresh;
    bool keeps = solver->keeps_components && plan->component[at].effect->stage <= PAL_STAGE_FORCE;
    if (keeps) PAL_TRY(remake_solver(plan, s, b, at, NULL, &fresh));
    if (keeps) replace_solver(plan, b, &fresh);
    pal_plan_remove(plan, plan->component[at].self);
    return PAL_ERR_OK;
}

/* position in the plan of the component of a request */
static int position_of(const pal_plan *plan, const pal_plan_requests *s, int b, int request)
{
    int stage = s->request[request].effect->stage, at = plan->first[stage][b], end = at + plan->n_of[stage][b];
    /* components inserted later, which have no reason, follow all of load */
    while (at < end && plan->component[at].reason && find_request(s, plan->component[at].effect->name) < request) at++;
    return at;
}

static pal_err switch_on(pal_plan *plan, pal_plan_requests *s, int b, int request)
{
    const pal_effect *effect = s->request[request].effect,
                     *solver = plan->component[plan->first[PAL_STAGE_SOLVE][b]].effect;
    pal_component component, fresh = {.effect = solver};
    bool keeps = solver->keeps_components && effect->stage <= PAL_STAGE_FORCE;
    pal_err err = pal_plan_requests_make(s, &s->request[request], false, &component);
    component.reason = plan->reason[b];
    for (int i = 0; i < request; i++) component.reason += strlen(component.reason) + 1;
    if (!err && keeps) err = remake_solver(plan, s, b, -1, &component, &fresh);
    if (err) {
        pal_plan_destroy_component(&component);
        if (fresh.self) pal_plan_destroy_component(&fresh);
        return err;
    }
    pal_plan_insert_at(plan, position_of(plan, s, b, request), b, &component);
    if (keeps) replace_solver(plan, b, &fresh);
    return PAL_ERR_OK;
}

/* removes or makes the component, with the body at rest meanwhile */
static pal_err change(pal_plan *plan, pal_plan_requests *s, int b, int request, int at, bool on)
{
    pal_body *body = &plan->body[b];
    const pal_effect *effect = s->request[request].effect;
    double *saved = put_to_rest(body);
    if (!saved) return PAL_ERR_MEMORY;
    pal_err err = on ? switch_on(plan, s, b, request) : switch_off(plan, s, b, at);
    /* another stiffness; a damping that was derived stays */
    s->build.made = plan->component + plan->first[PAL_STAGE_FORCE][b], s->build.n_made = plan->n_of[PAL_STAGE_FORCE][b];
    const bool stiff = effect->stage == PAL_STAGE_FORCE && (effect->internal || effect->tangent) && !effect->drag;
    if (!err && stiff && body->lowest_1_s > 0) err = pal_lowest_frequency_find(&s->build, NULL, NULL);
    PAL_ASSERT(s->build.scratch_byte <= plan->scratch_byte);
    restore(body, saved);
    /* a guard knows the state of now as its last good one */
    at = on && !err ? find_component(plan, b, effect->name) : -1;
    if (at >= 0 && effect->stage == PAL_STAGE_GUARD && effect->reset) effect->reset(plan->component[at].self, body);
    return err;
}

pal_err pal_plan_switch(pal_plan *plan, const pal_scene *scene, int b, const char *name, bool on,
                        const pal_material *material, pal_diagnostic *diag, bool *changed)
{
    *changed = false;
    if (b < 0 || b >= plan->n_body || b >= scene->n_body) return PAL_REFUSE(diag, "body %d does not exist", b);
    pal_plan_requests *s = calloc(1, sizeof *s);
    pal_scene *now = malloc(sizeof *now);
    pal_err err = s && now ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) *now = *scene;
    if (!err) err = collect(plan, now, b, diag, s);
    int request = err ? -1 : find_request(s, name), at = find_component(plan, b, name);
    if (!err && request < 0)
        err = PAL_REFUSE(diag, "body \"%s\": nothing in the scene calls for a row \"%s\"", plan->body[b].name, name);
    if (!err && !on) err = check_removable(plan, b, s->request[request].effect, diag);
    if (!err && on != (at >= 0)) {
        /* the entries as at load, the material as it is by now */
        now->body[b].material = *material;
        err = change(plan, s, b, request, at, on);
        *changed = !err;
    }
    free(s);
    free(now);
    return err;
}
