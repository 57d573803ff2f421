/* Fields shown in colour: components field_output are inserted into a running plan with memory of their own, and
 * removed again (world.h, pal_world_field). Between steps. [sim] */
#ifndef PAL_SIM_WORLD_FIELD_COMPONENTS_H
#define PAL_SIM_WORLD_FIELD_COMPONENTS_H
#include "server/sim/plan/plan.h"

/* rows that were put in, by body and field; zeroed: none */
typedef struct pal_field_components {
    pal_arena *arena[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* each row's memory, NULL: no such component */
    void *self[PAL_BODY_MAX][PAL_FIELD_COUNT];
} pal_field_components;

/* displacement of what is shown; the others where a FORCE component can measure them */
bool pal_field_components_given(const pal_plan *plan, int body, pal_field field);
/* REFUSED: an entry of the scene asks for what the body's model does not give */
pal_err pal_field_components_check(const pal_plan *plan, pal_diagnostic *diag);
/* step: of this body, for the first values. REFUSED: not given; MEMORY; nothing happens when it is there already */
pal_err pal_field_components_add(pal_field_components *rows, pal_plan *plan, int body, pal_field field, pal_step *step,
                                 pal_diagnostic *diag);
void pal_field_components_remove(pal_field_components *rows, pal_plan *plan, int body,
                                 pal_field field);          /* nothing when it is not there */
void pal_field_components_free(pal_field_components *rows); /* memory only: after pal_plan_free */
size_t pal_field_components_bytes(const pal_field_components *rows);
#endif
