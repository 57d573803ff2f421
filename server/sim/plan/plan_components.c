/* Components that come and go while a world runs. */
#include "server/sim/plan/plan.h"
#include "server/sim/plan/plan_requests.h"

#include <string.h>

/* components of this stage and body grow by `by`, all behind them move */
static void shift(pal_plan *plan, int stage, int body, int by)
{
    plan->n_component += by;
    plan->n_of[stage][body] += by;
    for (int s = stage; s < PAL_STAGE_COUNT; s++)
        for (int b = 0; b < plan->n_body; b++)
            if (s > stage || b > body) plan->first[s][b] += by;
}

void pal_plan_insert_at(pal_plan *plan, int at, int body, const pal_component *component)
{
    size_t n = (size_t)(plan->n_component - at);
    PAL_ASSERT(plan->n_component < plan->n_max);
    memmove(plan->component + at + 1, plan->component + at, n * sizeof *plan->component);
    memmove(plan->component_body + at + 1, plan->component_body + at, n * sizeof *plan->component_body);
    plan->component[at] = *component;
    plan->component_body[at] = body;
    shift(plan, component->effect->stage, body, 1);
}

void pal_plan_remove(pal_plan *plan, const void *self)
{
    int at = 0;
    while (at < plan->n_component && plan->component[at].self != self) at++;
    if (at == plan->n_component) return;
    int stage = plan->component[at].effect->stage, body = plan->component_body[at];
    size_t n = (size_t)(plan->n_component - at - 1);
    pal_plan_destroy_component(&plan->component[at]);
    memmove(plan->component + at, plan->component + at + 1, n * sizeof *plan->component);
    memmove(plan->component_body + at, plan->component_body + at + 1, n * sizeof *plan->component_body);
    shift(plan, stage, body, -1);
}

pal_err pal_plan_add(pal_plan *plan, int body, const pal_effect *effect, pal_plan_make_component *make, void *user,
                     void **self)
{
    pal_component component = {.effect = effect, .arena = pal_arena_create(PAL_COMPONENT_BLOCK, true)};
    pal_err err = component.arena ? make(user, plan, body, component.arena, &component.self) : PAL_ERR_MEMORY;
    if (err) {
        pal_plan_destroy_component(&component);
        return err;
    }
    component.n_byte = pal_arena_used(component.arena);
    pal_plan_insert_at(plan, plan->first[effect->stage][body] + plan->n_of[effect->stage][body], body, &component);
    *self = component.self;
    return PAL_ERR_OK;
}

size_t pal_plan_bytes(const pal_plan *plan)
{
    size_t n_byte = 0;
    for (int i = 0; i < plan->n_component; i++)
        if (plan->component[i].arena) n_byte += pal_arena_used(plan->component[i].arena);
    for (int b = 0; b < plan->n_body; b++) n_byte += plan->body[b].dofs.n_byte;
    return n_byte;
}
