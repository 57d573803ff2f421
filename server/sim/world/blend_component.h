/* What makes up for a sudden change of a running body, and is released over PAL_BLEND_TRANSFER_S.
 * Forces: when another body takes its place (transfer.h) or its supports change, the difference between the forces
 * before and after acts as a load on its nodes that falls to nothing. On an adaptive surface it is kept per mass, so
 * that a face that is split meanwhile leaves no coarse vertex's load on a fine one.
 * Display: the surface of another body hangs on other nodes and lies a little elsewhere. The offset from where it lies
 * to where it was shown is added to what is shown and touched (body.display_offset_m).
 * One CONTACT component, `blend`, per body, present only meanwhile (world.h, pal_world_blend_force and
 * pal_world_blend_display); scenes have no entry for it. [sim], heap only in set and remove. */
#ifndef PAL_SIM_WORLD_BLEND_COMPONENT_H
#define PAL_SIM_WORLD_BLEND_COMPONENT_H
#include "server/sim/plan/plan.h"

extern const pal_effect pal_effect_blend;

/* rows that come and go, by body; zeroed: none */
typedef struct pal_blend_components {
    pal_arena *arena[PAL_BODY_MAX]; /* each row's memory, NULL: no such row */
    void *self[PAL_BODY_MAX];
} pal_blend_components;

/* The load [n_node][3], N, body axes, is copied and replaces one that still acts; numbers that are not finite count as
 * 0. A display offset that is left is released again over the whole duration. MEMORY: unchanged */
pal_err pal_blend_components_set(pal_blend_components *rows, pal_plan *plan, int body, const double *force_N);
/* the way of what is shown [n_shown][3], m, copied; replaces one that is still being let go, begins together with the
 * load where that was set since the last step, else without one. MEMORY: what is shown jumps */
pal_err pal_blend_components_set_display(pal_blend_components *rows, pal_plan *plan, int body,
                                         const float *display_offset_m);
/* scale times the load that acts in the next step, if one does: load [n_node][3] += it */
void pal_blend_components_add(const pal_blend_components *rows, int body, double scale, double *load);
void pal_blend_components_remove_idle(pal_blend_components *rows,
                                      pal_plan *plan);      /* rows that have let go are taken out */
void pal_blend_components_free(pal_blend_components *rows); /* memory only: after pal_plan_free */
size_t pal_blend_components_bytes(const pal_blend_components *rows);
#endif
