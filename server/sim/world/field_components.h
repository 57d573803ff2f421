/* Fields shown in colour: components field_output are inserted into a running plan with memory of their own and
 * removed again (world.h, pal_world_field). Call between steps. Thread: [sim]. */
#ifndef PAL_SIM_WORLD_FIELD_COMPONENTS_H
#define PAL_SIM_WORLD_FIELD_COMPONENTS_H
#include "server/sim/plan/plan.h"

/* the inserted components, by body and field; zeroed: none */
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
#endif
