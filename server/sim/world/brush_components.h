/* Brushes in a running world. The component `brush` is inserted into the plan with the first brush of a body and
 * removed after the last (world.h, pal_world_brush). Call between steps. Thread: [sim]. */
#ifndef PAL_SIM_WORLD_BRUSH_COMPONENTS_H
#define PAL_SIM_WORLD_BRUSH_COMPONENTS_H
#include "server/sim/core/brush.h"
#include "server/sim/plan/plan.h"

/* by body; zeroed: none */
typedef struct pal_brush_components {
    void *self[PAL_BODY_MAX];
} pal_brush_components;

/* A brush of kind NONE or NULL ends the brush of the slot. Errors: those of pal_brush_make and pal_brush_set; no
 * such body or slot */
pal_err pal_brush_components_set(pal_brush_components *rows, pal_plan *plan, int body, int slot, const pal_brush *brush,
                                 pal_diagnostic *diag);
/* transfers the brushes of another world (pal_brush_hand); those on bodies that cannot have brushes end */
void pal_brush_components_transfer(pal_brush_components *rows, pal_plan *plan, const pal_brush_components *before,
                                   const pal_plan *from);
void pal_brush_components_end(pal_brush_components *rows,
                              int slot); /* ends the slot's brushes on all bodies; no heap call */
void pal_brush_components_remove_idle(pal_brush_components *rows, pal_plan *plan); /* removes idle components */
size_t pal_brush_components_bytes(const pal_brush_components *rows); /* heap memory beside the components' arenas */
#endif
