/* The plan: the ordered rows of a scene. A scene entry becomes one row; what no entry and no model asks for does not
 * exist. Rows stand by stage, within a stage by body, within that in the order of the model and then the scene.
 * An entry of the scene replaces the model's row of the same effect. Thread: [load] to build, then rows belong to
 * [sim].
 */
#ifndef PAL_SIM_PLAN_H
#define PAL_SIM_PLAN_H
#include "server/sim/effect.h"

typedef struct pal_plan {
    int n_body, n_row;
    int n_load;                               /* rows since load; those beyond were put in later  */
    pal_body *body;                           /* [n_body]                                         */
    pal_row *row;                             /* [n_row]                                          */
    int *row_body;                            /* index of each row's body [n_row]                 */
    int first[PAL_STAGE_COUNT][PAL_BODY_MAX]; /* rows of a stage and body: row + first, ...       */
    int n_of[PAL_STAGE_COUNT][PAL_BODY_MAX];  /* ... and how many                                 */
    size_t scratch_byte;                      /* most that one row needs in a sub-step            */
    pal_row *load_row;                        /* the arena's own tables, used while no row was put in */
    int *load_row_body;
} pal_plan;

/* builds bodies and rows into arena; REFUSED names the entry, MEMORY */
pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_note *note, pal_plan *out);
void pal_plan_free(pal_plan *plan); /* what rows took beside the arena; before the arena goes */
/* puts a made row behind the others of its stage and body, or takes it out again (and destroys it); between steps. Rows
 * beyond those of load stand in heap memory, which is gone when they are; MEMORY: unchanged. [sim] */
pal_err pal_plan_insert(pal_plan *plan, int body, const pal_row *row);
void pal_plan_remove(pal_plan *plan, const void *self);
size_t pal_plan_bytes(const pal_plan *plan); /* heap memory of the table of rows; 0: the rows are those of load */
const char *pal_stage_name(pal_stage stage); /* "contact" ... */
/* one line per row into text (cut at n_byte, always ended); returns the length it wanted. [any] */
size_t pal_plan_print(const pal_plan *plan, char *text, size_t n_byte);
#endif
