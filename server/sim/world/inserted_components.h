/* Components that no entry of a scene asks for: they are inserted into a running plan with memory of their own and
 * removed again. Call between steps. Thread: [sim]; heap only in set, add and remove. */
#ifndef PAL_SIM_WORLD_INSERTED_COMPONENTS_H
#define PAL_SIM_WORLD_INSERTED_COMPONENTS_H
#include "server/sim/core/brush.h"
#include "server/sim/plan/plan.h"

/* of one effect, by body; zeroed: none */
typedef struct pal_inserted {
    void *self[PAL_BODY_MAX];
} pal_inserted;

/* ---- fields shown in colour (world.h, pal_world_field): components field_output ---- */

/* by body and field; zeroed: none */
typedef struct pal_field_components {
    void *self[PAL_BODY_MAX][PAL_FIELD_COUNT];
} pal_field_components;

/* true for displacement; for other fields if a FORCE component can measure it */
bool pal_field_components_given(const pal_plan *plan, int body, pal_field field);
/* REFUSED: an entry of the scene asks for a field that the body's model does not give */
pal_err pal_field_components_check(const pal_plan *plan, pal_diagnostic *diag);
/* step: of this body, to compute the first values. Does nothing if the component exists already. REFUSED: field not
 * available; MEMORY */
pal_err pal_field_components_add(pal_field_components *rows, pal_plan *plan, int body, pal_field field, pal_step *step,
                                 pal_diagnostic *diag);
/* does nothing if it does not exist */
void pal_field_components_remove(pal_field_components *rows, pal_plan *plan, int body, pal_field field);

/* ---- brushes (world.h, pal_world_brush): the component `brush` comes with the first of a body and goes after the last
 * ---- */

/* A brush of kind NONE or NULL ends the brush of the slot. Errors: those of pal_brush_make and pal_brush_set; no
 * such body or slot */
pal_err pal_brush_components_set(pal_inserted *rows, pal_plan *plan, int body, int slot, const pal_brush *brush,
                                 pal_diagnostic *diag);
/* transfers the brushes of another world (pal_brush_hand); those on bodies that cannot have brushes end */
void pal_brush_components_transfer(pal_inserted *rows, pal_plan *plan, const pal_inserted *before,
                                   const pal_plan *from);
void pal_brush_components_end(pal_inserted *rows, int slot); /* ends the slot's brushes on all bodies; no heap call */
void pal_brush_components_remove_idle(pal_inserted *rows, pal_plan *plan); /* removes idle components */
size_t pal_brush_components_bytes(const pal_inserted *rows); /* heap memory beside the components' arenas */

/* ---- Compensates a sudden change of a running body and releases the compensation over PAL_BLEND_S.
 * Forces: when another body replaces it (transfer.h) or its supports change, the difference between the forces
 * before and after acts as a load on its nodes that decays to zero. On an adaptive surface the load is stored per
 * mass, so that a face that is split meanwhile does not leave the load of a coarse vertex on a fine one.
 * Display: the surface of another body is skinned to other nodes and lies at slightly different positions. The
 * offset from there to where it was shown is added to what is shown and touched (pal_display.offset_m).
 * One CONTACT component per body, `blend`, present only during the blend (world.h, pal_world_blend_force and
 * pal_world_blend_display); scenes have no entry for it.
 * ---- */

extern const pal_effect pal_effect_blend;

/* Copies the load [n_node][3], N, body axes; it replaces one that still acts. Non-finite numbers count as 0. A
 * remaining display offset is released again over the whole duration. MEMORY: unchanged */
pal_err pal_blend_components_set(pal_inserted *rows, pal_plan *plan, int body, const double *force_N);
/* Copies the offset of the shown vertices [n_shown][3], m; it replaces one that is still being released. It starts
 * together with the load if one was set since the last step, otherwise without a load. MEMORY: the shown surface
 * jumps */
pal_err pal_blend_components_set_display(pal_inserted *rows, pal_plan *plan, int body, const float *display_offset_m);
/* adds scale times the load of the next step, if one acts, to load [n_node][3] */
void pal_blend_components_add(const pal_inserted *rows, int body, double scale, double *load);
/* removes components whose release has ended */
void pal_blend_components_remove_idle(pal_inserted *rows, pal_plan *plan);
#endif
