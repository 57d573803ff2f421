/* Components field_output inserted and removed at run time. */
#include "server/sim/world/field_components.h"

#include "server/sim/core/effect_list.h"

bool pal_field_components_given(const pal_plan *plan, int body, pal_field field)
{
    if (body < 0 || body >= plan->n_body || field <= PAL_FIELD_NONE || field >= PAL_FIELD_COUNT) return false;
    if (plan->body[body].n_shown == 0) return false;
    bool given = field == PAL_FIELD_DISPLACEMENT_M;
    for (int i = 0; i < plan->n_of[PAL_STAGE_FORCE][body]; i++)
        given = given || plan->row[plan->first[PAL_STAGE_FORCE][body] + i].effect->fields >> field & 1;
    return given;
}

static pal_err refuse(const pal_plan *plan, int body, pal_field field, pal_diagnostic *diag)
{
    if (body < 0 || body >= plan->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist", body);
    return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\" gives no %s: its model has no %s",
                              plan->body[body].name, pal_field_title(field),
                              field == PAL_FIELD_STIFFNESS_J ? "edges that are springs" : "finite elements");
}

pal_err pal_field_components_check(const pal_plan *plan, pal_diagnostic *diag)
{
    for (int b = 0; b < plan->n_body; b++)
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
            if (plan->body[b].field[k] && !pal_field_components_given(plan, b, (pal_field)k))
                return refuse(plan, b, (pal_field)k, diag);
    return PAL_ERR_OK;
}

/* makes the component as an entry of the scene does */
static pal_err make_row(pal_plan *plan, int b, pal_field field, pal_arena *arena, pal_diagnostic *diag,
                        pal_component *row)
{
    pal_config_entry item;
    pal_build build = {.body = &plan->body[b], .arena = arena, .diag = diag};
    pal_entry_init(&item, "field", row->effect->name);
    PAL_TRY(pal_entry_put_text(&item, "field", pal_field_name(field), diag));
    PAL_TRY(row->effect->make(&item, &build, &row->self));
    row->n_byte = pal_arena_used(arena);
    pal_err err = pal_plan_insert(plan, b, row);
    if (err) row->effect->destroy(row->self);
    return err;
}

pal_err pal_field_components_add(pal_field_components *rows, pal_plan *plan, int body, pal_field field, pal_step *step,
                                 pal_diagnostic *diag)
{
    if (!pal_field_components_given(plan, body, field)) return refuse(plan, body, field, diag);
    if (plan->body[body].field[field]) return PAL_ERR_OK;
    pal_component row = {.effect = pal_effect_find("field_output")};
    if (!row.effect) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "this build has no effect \"field_output\"");
    pal_arena *arena = pal_arena_create(4096, true);
    pal_err err = arena ? make_row(plan, body, field, arena, diag, &row) : PAL_ERR_MEMORY;
    if (err) {
        pal_arena_destroy(arena);
        return pal_diagnostic_set(diag, err, "no memory for the %s of body \"%s\"", pal_field_title(field),
                                  plan->body[body].name);
    }
    rows->arena[body][field] = arena;
    rows->self[body][field] = row.self;
    /* the table of components may have moved */
    step->force = plan->row + plan->first[PAL_STAGE_FORCE][body];
    step->contact = plan->row + plan->first[PAL_STAGE_CONTACT][body];
    return row.effect->run(row.self, step);
}

void pal_field_components_remove(pal_field_components *rows, pal_plan *plan, int body, pal_field field)
{
    if (body < 0 || body >= plan->n_body || field <= PAL_FIELD_NONE || field >= PAL_FIELD_COUNT) return;
    if (!rows->arena[body][field]) return;
    pal_plan_remove(plan, rows->self[body][field]);
    pal_arena_destroy(rows->arena[body][field]);
    rows->arena[body][field] = NULL;
    rows->self[body][field] = NULL;
}

void pal_field_components_free(pal_field_components *rows)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        for (int k = 0; k < PAL_FIELD_COUNT; k++) pal_arena_destroy(rows->arena[b][k]);
}

size_t pal_field_components_bytes(const pal_field_components *rows)
{
    size_t n_byte = 0;
    for (int b = 0; b < PAL_BODY_MAX; b++)
        for (int k = 0; k < PAL_FIELD_COUNT; k++)
            if (rows->arena[b][k]) n_byte += pal_arena_used(rows->arena[b][k]);
    return n_byte;
}
