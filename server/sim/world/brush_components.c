/* Components `brush` inserted and removed at run time. */
#include "server/sim/world/brush_components.h"

typedef struct grasp_transfer {
    const void *self;
    const pal_body *body;
} grasp_transfer;

/* inserts the component with its first brush, or with the brushes of another component, after the body's other
 * CONTACT components */
static pal_err make_row(pal_plan *plan, int b, int slot, const pal_brush *brush, const grasp_transfer *before,
                        pal_arena *arena, pal_diagnostic *diag, void **self)
{
    pal_component row = {.effect = &pal_effect_brush};
    PAL_TRY(pal_brush_make(&plan->body[b], arena, diag, &row.self));
    pal_err err = before ? PAL_ERR_OK : pal_brush_set(row.self, &plan->body[b], slot, brush, diag);
    if (before) pal_brush_hand(row.self, &plan->body[b], before->self, before->body);
    row.n_byte = pal_arena_used(arena) + pal_brush_bytes(row.self);
    if (!err) err = pal_plan_insert(plan, b, &row);
    if (err) row.effect->destroy(row.self);
    *self = row.self;
    return err;
}

pal_err pal_brush_components_set(pal_brush_components *rows, pal_plan *plan, int body, int slot, const pal_brush *brush,
                                 pal_diagnostic *diag)
{
    if (body < 0 || body >= plan->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist", body);
    if (slot < 0 || slot >= PAL_TOOL_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "tool %d does not exist", slot);
    if (!brush || brush->kind == PAL_BRUSH_NONE) {
        if (rows->self[body]) pal_brush_end(rows->self[body], slot);
        return PAL_ERR_OK;
    }
    if (rows->self[body]) return pal_brush_set(rows->self[body], &plan->body[body], slot, brush, diag);
    pal_arena *arena = pal_arena_create(4096, true);
    void *self = NULL;
    pal_err err = arena ? make_row(plan, body, slot, brush, NULL, arena, diag, &self) : PAL_ERR_MEMORY;
    if (err) {
        pal_arena_destroy(arena);
        if (err != PAL_ERR_MEMORY) return err;
        return pal_diagnostic_set(diag, err, "no memory for a brush on body \"%s\"", plan->body[body].name);
    }
    rows->arena[body] = arena;
    rows->self[body] = self;
    return PAL_ERR_OK;
}

void pal_brush_components_transfer(pal_brush_components *rows, pal_plan *plan, const pal_brush_components *before,
                                   const pal_plan *from)
{
    for (int b = 0; b < plan->n_body && b < from->n_body; b++) {
        const grasp_transfer was = {before->self[b], &from->body[b]};
        if (!was.self || pal_brush_gone(was.self) || rows->self[b]) continue;
        pal_arena *arena = pal_arena_create(4096, true);
        void *self = NULL;
        if (!arena || make_row(plan, b, 0, NULL, &was, arena, NULL, &self)) {
            pal_arena_destroy(arena);
            continue;
        }
        rows->arena[b] = arena;
        rows->self[b] = self;
    }
}

void pal_brush_components_end(pal_brush_components *rows, int slot)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) pal_brush_end(rows->self[b], slot);
}

void pal_brush_components_remove_idle(pal_brush_components *rows, pal_plan *plan)
{
    for (int b = 0; b < PAL_BODY_MAX; b++) {
        if (!rows->self[b] || !pal_brush_gone(rows->self[b])) continue;
        pal_plan_remove(plan, rows->self[b]);
        pal_arena_destroy(rows->arena[b]);
        rows->arena[b] = NULL;
        rows->self[b] = NULL;
    }
}

void pal_brush_components_free(pal_brush_components *rows)
{
    for (int b = 0; b < PAL_BODY_MAX; b++) pal_arena_destroy(rows->arena[b]);
}

size_t pal_brush_components_bytes(const pal_brush_components *rows)
{
    size_t n_byte = 0;
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) n_byte += pal_arena_used(rows->arena[b]) + pal_brush_bytes(rows->self[b]);
    return n_byte;
}
