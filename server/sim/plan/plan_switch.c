/* Rows that are switched off and on while a world runs. Off, a row is destroyed with its memory; on, it is made again
 * from its entry. make functions expect a body at rest, so its state is put aside meanwhile. */
#include "server/sim/plan/plan.h"
#include "server/sim/plan/plan_requests.h"

#include "server/sim/core/effect_list.h"

#include <stdlib.h>
#include <string.h>

/* x, v and d of a body while it is put to rest */
typedef struct state {
    double *x, *v;
} state;

static pal_err put_to_rest(pal_body *body, state *kept)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof;
    *kept = (state){.x = malloc(n_byte + 1), .v = malloc(n_byte + 1)};
    if (!kept->x || !kept->v) {
        free(kept->x), free(kept->v);
        return PAL_ERR_MEMORY;
    }
    memcpy(kept->x, body->x, n_byte), memcpy(kept->v, body->v, n_byte);
    memcpy(body->x, body->x_rest, n_byte), memset(body->v, 0, n_byte);
    pal_body_update_nodes(body);
    return PAL_ERR_OK;
}

static void put_back(pal_body *body, state *kept)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof;
    memcpy(body->x, kept->x, n_byte), memcpy(body->v, kept->v, n_byte);
    pal_body_update_nodes(body);
    free(kept->x), free(kept->v);
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
    PAL_TRY(model->list(&s->own[0], &s->build, &s->recipe));
    return pal_plan_requests_collect(s);
}

static int find_request(const pal_plan_requests *s, const char *name)
{
    for (int i = 0; i < s->n_request; i++)
        if (!strcmp(s->request[i].effect->name, name)) return i;
    return -1;
}

/* place of a row of load in the body's list of entries; rows that were put in later stand behind them all */
static int rank(const pal_plan_requests *s, const pal_component *row)
{
    return row->arena ? find_request(s, row->effect->name) : PAL_PLAN_REQUEST_MAX;
}

static int find_row(const pal_plan *plan, int b, const char *name)
{
    for (int i = 0; i < plan->n_row; i++)
        if (plan->component_body[i] == b && plan->row[i].arena && !strcmp(plan->row[i].effect->name, name)) return i;
    return -1;
}

/* elasticity: forces of its own shape, other than drag */
static bool elastic(const pal_effect *effect)
{
    return effect->stage == PAL_STAGE_FORCE && effect->internal && !effect->drag;
}

static pal_err may_go(const pal_plan *plan, int b, const pal_effect *effect, pal_diagnostic *diag)
{
    const char *body = plan->body[b].name;
    int n_elastic = 0;
    for (int i = 0; i < plan->n_row; i++) n_elastic += plan->component_body[i] == b && elastic(plan->row[i].effect);
    if (effect->stage == PAL_STAGE_SOLVE)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\": \"%s\" moves it and cannot be switched off",
                                  body, effect->name);
    if (effect->stage == PAL_STAGE_OUTPUT && strcmp(effect->name, "field_output") != 0)
        return pal_diagnostic_set(
            diag, PAL_ERR_REFUSED,
            "body \"%s\": \"%s\" gives the surface that is shown and touched and cannot be switched "
            "off",
            body, effect->name);
    if (elastic(effect) && n_elastic == 1)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\": \"%s\" is the last row that holds it together",
                                  body, effect->name);
    if (!strcmp(effect->name, "moving_support"))
        return pal_diagnostic_set(
            diag, PAL_ERR_REFUSED,
            "body \"%s\": \"moving_support\" holds nodes of the body's matrix; take it out of the "
            "scene",
            body);
    return PAL_ERR_OK;
}

bool pal_plan_requires(const pal_plan *plan, int row)
{
    return !plan->row[row].arena || may_go(plan, plan->component_body[row], plan->row[row].effect, NULL) != PAL_ERR_OK;
}

/* the body's rows but its solver, with `more` (may be NULL) and without the one at `without` */
static int list_rows(const pal_plan *plan, int b, int without, const pal_component *more, pal_component *out)
{
    int n = 0;
    for (int i = 0; i < plan->n_row; i++)
        if (plan->component_body[i] == b && i != without && plan->row[i].effect->stage != PAL_STAGE_SOLVE)
            out[n++] = plan->row[i];
    if (more) out[n++] = *more;
    return n;
}

/* A solver that keeps its rows, made for the others as they will be. With tools' rows goes what they wanted of it */
static pal_err remake_solver(pal_plan *plan, pal_plan_requests *s, int b, int without, const pal_component *more,
                             pal_component *out)
{
    pal_body *body = &plan->body[b];
    const pal_component *old = &plan->row[plan->first[PAL_STAGE_SOLVE][b]];
    const pal_compliance *compliance = body->compliance;
    bool wanted = body->wants_compliance;
    pal_component *list = calloc((size_t)plan->n_row + 1, sizeof *list);
    if (!list) return PAL_ERR_MEMORY;
    s->build.made = list, s->build.n_made = list_rows(plan, b, without, more, list);
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

static void change_solver(pal_plan *plan, int b, const pal_component *to)
{
    pal_component *solve = &plan->row[plan->first[PAL_STAGE_SOLVE][b]];
    pal_plan_destroy_component(solve);
    *solve = *to;
}

static pal_err switch_off(pal_plan *plan, pal_plan_requests *s, int b, int at)
{
    const pal_effect *solver = plan->row[plan->first[PAL_STAGE_SOLVE][b]].effect;
    pal_component fresh;
    bool keeps = solver->keeps_components && plan->row[at].effect->stage <= PAL_STAGE_FORCE;
    if (keeps) PAL_TRY(remake_solver(plan, s, b, at, NULL, &fresh));
    if (keeps) change_solver(plan, b, &fresh);
    pal_plan_remove(plan, plan->row[at].self);
    return PAL_ERR_OK;
}

/* where in the plan a row of this request stands */
static int place_of(const pal_plan *plan, const pal_plan_requests *s, int b, int request)
{
    int stage = s->request[request].effect->stage, at = plan->first[stage][b], end = at + plan->n_of[stage][b];
    while (at < end && rank(s, &plan->row[at]) < request) at++;
    return at;
}

static pal_err switch_on(pal_plan *plan, pal_plan_requests *s, int b, int request)
{
    const pal_effect *effect = s->request[request].effect, *solver = plan->row[plan->first[PAL_STAGE_SOLVE][b]].effect;
    pal_component row, fresh = {.effect = solver};
    bool keeps = solver->keeps_components && effect->stage <= PAL_STAGE_FORCE;
    pal_err err = pal_plan_requests_make(s, &s->request[request], false, &row);
    row.reason = plan->reason[b];
    for (int i = 0; i < request; i++) row.reason += strlen(row.reason) + 1;
    if (!err && keeps) err = remake_solver(plan, s, b, -1, &row, &fresh);
    if (!err) err = pal_plan_insert_at(plan, place_of(plan, s, b, request), b, &row);
    if (err) {
        pal_plan_destroy_component(&row);
        if (fresh.self) pal_plan_destroy_component(&fresh);
        return err;
    }
    if (keeps) change_solver(plan, b, &fresh);
    return PAL_ERR_OK;
}

/* the row goes or comes, the body being at rest meanwhile */
static pal_err change(pal_plan *plan, pal_plan_requests *s, int b, int request, int at, bool on)
{
    pal_body *body = &plan->body[b];
    const pal_effect *effect = s->request[request].effect;
    state kept;
    PAL_TRY(put_to_rest(body, &kept));
    pal_err err = on ? switch_on(plan, s, b, request) : switch_off(plan, s, b, at);
    PAL_ASSERT(s->build.scratch_byte <= plan->scratch_byte);
    put_back(body, &kept);
    /* a guard knows the state of now as its last good one */
    at = on && !err ? find_row(plan, b, effect->name) : -1;
    if (at >= 0 && effect->stage == PAL_STAGE_GUARD && effect->reset) effect->reset(plan->row[at].self, body);
    return err;
}

pal_err pal_plan_switch(pal_plan *plan, const pal_scene *scene, int b, const char *name, bool on,
                        const pal_material *material, pal_diagnostic *diag, bool *changed)
{
    *changed = false;
    if (b < 0 || b >= plan->n_body || b >= scene->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist", b);
    pal_plan_requests *s = calloc(1, sizeof *s);
    pal_scene *now = malloc(sizeof *now);
    pal_err err = s && now ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) *now = *scene;
    if (!err) err = collect(plan, now, b, diag, s);
    int request = err ? -1 : find_request(s, name), at = find_row(plan, b, name);
    if (!err && request < 0)
        err = pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\": nothing in the scene calls for a row \"%s\"",
                                 plan->body[b].name, name);
    if (!err && !on) err = may_go(plan, b, s->request[request].effect, diag);
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
