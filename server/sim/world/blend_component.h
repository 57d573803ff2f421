/* Compensates a sudden change of a running body and releases the compensation over PAL_BLEND_S.
 * Forces: when another body replaces it (transfer.h) or its supports change, the difference between the forces
 * before and after acts as a load on its nodes that decays to zero. On an adaptive surface the load is stored per
 * mass, so that a face that is split meanwhile does not leave the load of a coarse vertex on a fine one.
 * Display: the surface of another body is skinned to other nodes and lies at slightly different positions. The
 * offset from there to where it was shown is added to what is shown and touched (pal_display.offset_m).
 * One CONTACT component per body, `blend`, present only during the blend (world.h, pal_world_blend_force and
 * pal_world_blend_display); scenes have no entry for it. Thread: [sim]; heap only in set and remove. */
#ifndef PAL_SIM_WORLD_BLEND_COMPONENT_H
#define PAL_SIM_WORLD_BLEND_COMPONENT_H
#include "server/sim/plan/plan.h"

extern const pal_effect pal_effect_blend;

/* the blend components, by body; zeroed: none */
typedef struct pal_blend_components {
    void *self[PAL_BODY_MAX];
} pal_blend_components;

/* Copies the load [n_node][3], N, body axes; it replaces one that still acts. Non-finite numbers count as 0. A
 * remaining display offset is released again over the whole duration. MEMORY: unchanged */
pal_err pal_blend_components_set(pal_blend_components *rows, pal_plan *plan, int body, const double *force_N);
/* Copies the offset of the shown vertices [n_shown][3], m; it replaces one that is still being released. It starts
 * together with the load if one was set since the last step, otherwise without a load. MEMORY: the shown surface
 * jumps */
pal_err pal_blend_components_set_display(pal_blend_components *rows, pal_plan *plan, int body,
                                         const float *display_offset_m);
/* adds scale times the load of the next step, if one acts, to load [n_node][3] */
void pal_blend_components_add(const pal_blend_components *rows, int body, double scale, double *load);
/* removes components whose release has ended */
void pal_blend_components_remove_idle(pal_blend_components *rows, pal_plan *plan);
#endif
