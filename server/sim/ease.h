/* Forces that make up for a change of a running body and are let go: when another body takes its place (transfer.h), or
 * its supports change, the difference between what pulled on it before and what pulls now acts as a load on its nodes
 * that falls from all to nothing over 10 steps (numerics.md part 3). One CONTACT row, `ease`, per body, there only
 * meanwhile: world.h, pal_world_ease. It is no entry of scenes. [sim], heap only in make and destroy. */
#ifndef PAL_SIM_EASE_H
#define PAL_SIM_EASE_H
#include "server/sim/plan.h"

enum { PAL_EASE_STEPS = 10 };

extern const pal_effect pal_effect_ease;

/* rows that come and go, by body; zeroed: none */
typedef struct pal_ease_rows {
    pal_arena *arena[PAL_BODY_MAX]; /* each row's memory, NULL: no such row */
    void *self[PAL_BODY_MAX];
} pal_ease_rows;

/* the load [n_node][3], N, body axes, is copied and replaces one that still acts; not finite numbers count as 0.
 * MEMORY: as it was */
pal_err pal_ease_rows_set(pal_ease_rows *rows, pal_plan *plan, int body, const double *force_N);
void pal_ease_rows_tidy(pal_ease_rows *rows, pal_plan *plan); /* rows that have let go are taken out */
void pal_ease_rows_free(pal_ease_rows *rows);                 /* memory only: after pal_plan_free */
size_t pal_ease_rows_bytes(const pal_ease_rows *rows);
#endif
