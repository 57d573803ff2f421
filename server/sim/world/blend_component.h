/* What makes up for a change of a running body and is let go over 10 steps (numerics.md part 3):
 * Forces. When another body takes its place (transfer.h), or its supports change, the difference between what pulled on
 * it before and what pulls now acts as a load on its nodes that falls from all to nothing. On a body that adapts it
 * goes with their masses: what is split meanwhile leaves no coarse vertex's load on a fine one.
 * What is shown. The surface of another body hangs on other nodes and lies a little elsewhere where those of both stand
 * as near as they can: the way from there to where it was shown before is added to what is shown, and touched
 * (body.display_offset_m), all of it in the first frame, a tenth less in each of the next.
 * One CONTACT row, `ease`, per body, there only meanwhile: world.h, pal_world_blend_force, pal_world_blend_display. It
 * is no entry of scenes. [sim], heap only in make and destroy. */
#ifndef PAL_SIM_WORLD_BLEND_COMPONENT_H
#define PAL_SIM_WORLD_BLEND_COMPONENT_H
#include "server/sim/plan/plan.h"

enum { PAL_BLEND_STEPS = 10 };

extern const pal_effect pal_effect_blend;

/* rows that come and go, by body; zeroed: none */
typedef struct pal_blend_components {
    pal_arena *arena[PAL_BODY_MAX]; /* each row's memory, NULL: no such row */
    void *self[PAL_BODY_MAX];
} pal_blend_components;

/* the load [n_node][3], N, body axes, is copied and replaces one that still acts; not finite numbers count as 0. What
 * is shown goes on being let go as it was, from all of its PAL_BLEND_STEPS steps. MEMORY: as it was */
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
