/* Fields in colour while a world runs: rows field_out put into its plan with memory of their own, and taken out again
 * (world.h, pal_world_field). Between steps. [sim] */
#ifndef PAL_SIM_FIELD_H
#define PAL_SIM_FIELD_H
#include "server/sim/plan/plan.h"

/* rows that were put in, by body and field; zeroed: none */
typedef struct pal_field_rows {
    pal_arena *arena[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* each row's memory, NULL: no such row */
    void *self[PAL_BODY_MAX][PAL_FIELD_COUNT];
} pal_field_rows;

/* displacement of what is shown; the others where a FORCE row can measure them */
bool pal_field_given(const pal_plan *plan, int body, pal_field field);
/* REFUSED: an entry of the scene asks for what the body's model does not give */
pal_err pal_field_check(const pal_plan *plan, pal_note *note);
/* step: of this body, for the first values. REFUSED: not given; MEMORY; nothing happens when it is there already */
pal_err pal_field_add(pal_field_rows *rows, pal_plan *plan, int body, pal_field field, pal_step *step, pal_note *note);
void pal_field_drop(pal_field_rows *rows, pal_plan *plan, int body, pal_field field); /* nothing when it is not there */
void pal_field_free(pal_field_rows *rows); /* memory only: after pal_plan_free */
size_t pal_field_bytes(const pal_field_rows *rows);
#endif
