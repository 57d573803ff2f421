/* Components `brush` inserted and removed at run time. */
#include "server/sim/world/inserted_components.h"

/* what a new component starts with: the brush of a slot, or the brushes of another component on body `from` */
typedef struct brush_start {
    int slot;
    const pal_brush *brush;
    const void *before;
    const pal_body *from;
    pal_diagnostic *diag;
} brush_start;

static pal_err make(void *user, pal_plan *plan, int b, pal_arena *arena, void **self)
{
    const brush_start *start = user;
    PAL_TRY(pal_brush_make(&plan->body[b], arena, start->diag, self));
    if (!start->before) return pal_brush_set(*self, &plan->body[b], start->slot, start->brush, start->diag);
    pal_brush_hand(*self, &plan->body[b], start->before, start->from);
    return PAL_ERR_OK;
}

pal_err pal_brush_components_set(pal_inserted *rows, pal_plan *plan, int body, int slot, const pal_brush *brush,
                                 pal_diagnostic *diag)
{
    if (body < 0 || body >= plan->n_body) return PAL_REFUSE(diag, "body %d does not exist", body);
    if (slot < 0 || slot >= PAL_TOOL_MAX) return PAL_REFUSE(diag, "tool %d does not exist", slot);
    if (!brush || brush->kind == PAL_BRUSH_NONE) {
        if (rows->self[body]) pal_brush_end(rows->self[body], slot);
        return PAL_ERR_OK;
    }
    if (rows->self[body]) return pal_brush_set(rows->self[body], &plan->body[body], slot, brush, diag);
    brush_start start = {.slot = slot, .brush = brush, .diag = diag};
    pal_err err = pal_plan_add(plan, body, &pal_effect_brush, make, &start, &rows->self[body]);
    if (err != PAL_ERR_MEMORY) return err;
    return pal_diagnostic_set(diag, err, "no memory for a brush on body \"%s\"", plan->body[body].name);
}

void pal_brush_components_transfer(pal_inserted *rows, pal_plan *plan, const pal_inserted *before, const pal_plan *from)
{
    for (int b = 0; b < plan->n_body && b < from->n_body; b++) {
        brush_start start = {.before = before->self[b], .from = &from->body[b]};
        if (!start.before || pal_brush_gone(start.before) || rows->self[b]) continue;
        (void)pal_plan_add(plan, b, &pal_effect_brush, make, &start, &rows->self[b]);
    }
}

void pal_brush_components_end(pal_inserted *rows, int slot)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) pal_brush_end(rows->self[b], slot);
}

void pal_brush_components_remove_idle(pal_inserted *rows, pal_plan *plan)
{
    for (int b = 0; b < PAL_BODY_MAX; b++) {
        if (!rows->self[b] || !pal_brush_gone(rows->self[b])) continue;
        pal_plan_remove(plan, rows->self[b]);
        rows->self[b] = NULL;
    }
}

size_t pal_brush_components_bytes(const pal_inserted *rows)
{
    size_t n_byte = 0;
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) n_byte += pal_brush_bytes(rows->self[b]);
    return n_byte;
}
