/* Components field_output inserted and removed at run time. */
#include "server/sim/world/inserted_components.h"

#include "server/sim/core/effect_list.h"

bool pal_field_components_given(const pal_plan *plan, int body, pal_field field)
{
    if (body < 0 || body >= plan->n_body || field <= PAL_FIELD_NONE || field >= PAL_FIELD_COUNT) return false;
    if (plan->body[body].display.n_shown == 0) return false;
    bool given = field == PAL_FIELD_DISPLACEMENT_M;
    for (int i = 0; i < plan->n_of[PAL_STAGE_FORCE][body]; i++)
        given = given || plan->component[plan->first[PAL_STAGE_FORCE][body] + i].effect->inspect.fields >> field & 1;
    return given;
}

static pal_err refuse(const pal_plan *plan, int body, pal_field field, pal_diagnostic *diag)
{
    if (body < 0 || body >= plan->n_body) return PAL_REFUSE(diag, "body %d does not exist", body);
    return PAL_REFUSE(diag, "body \"%s\" gives no %s with its model", plan->body[body].name, pal_field_title(field));
}

pal_err pal_field_components_check(const pal_plan *plan, pal_diagnostic *diag)
{
    for (int b = 0; b < plan->n_body; b++)
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
            if (plan->body[b].display.field[k] && !pal_field_components_given(plan, b, (pal_field)k))
                return refuse(plan, b, (pal_field)k, diag);
    return PAL_ERR_OK;
}

typedef struct field_start {
    const pal_effect *effect;
    pal_field field;
    pal_diagnostic *diag;
} field_start;

/* makes the component as an entry of the scene does */
static pal_err make(void *user, pal_plan *plan, int b, pal_arena *arena, void **self)
{
    const field_start *start = user;
    pal_config_entry item;
    pal_build build = {.body = &plan->body[b], .arena = arena, .diag = start->diag};
    pal_entry_init(&item, "field", start->effect->name);
    PAL_TRY(pal_entry_put_text(&item, "field", pal_field_name(start->field), start->diag));
    return start->effect->make(&item, &build, self);
}

pal_err pal_field_components_add(pal_field_components *rows, pal_plan *plan, int body, pal_field field, pal_step *step,
                                 pal_diagnostic *diag)
{
    if (!pal_field_components_given(plan, body, field)) return refuse(plan, body, field, diag);
    if (plan->body[body].display.field[field]) return PAL_ERR_OK;
    field_start start = {pal_effect_find("field_output"), field, diag};
    if (!start.effect) return PAL_REFUSE(diag, "this build has no effect \"field_output\"");
    pal_err err = pal_plan_add(plan, body, start.effect, make, &start, &rows->self[body][field]);
    if (err)
        return pal_diagnostic_set(diag, err, "no memory for the %s of body \"%s\"", pal_field_title(field),
                                  plan->body[body].name);
    return start.effect->run(rows->self[body][field], step);
}

void pal_field_components_remove(pal_field_components *rows, pal_plan *plan, int body, pal_field field)
{
    if (body < 0 || body >= plan->n_body || field <= PAL_FIELD_NONE || field >= PAL_FIELD_COUNT) return;
    if (!rows->self[body][field]) return;
    pal_plan_remove(plan, rows->self[body][field]);
    rows->self[body][field] = NULL;
}
