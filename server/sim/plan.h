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
    pal_body *body;                           /* [n_body]                                         */
    pal_row *row;                             /* [n_row]                                          */
    int *row_body;                            /* index of each row's body [n_row]                 */
    int first[PAL_STAGE_COUNT][PAL_BODY_MAX]; /* rows of a stage and body: row + first, ...       */
    int n_of[PAL_STAGE_COUNT][PAL_BODY_MAX];  /* ... and how many                                 */
    size_t scratch_byte;                      /* most that one row needs in a sub-step            */
} pal_plan;

/* builds bodies and rows into arena; REFUSED names the entry, MEMORY */
pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_note *note, pal_plan *out);
const char *pal_stage_name(pal_stage stage); /* "contact" ... */
/* one line per row into text (cut at n_byte, always ended); returns the length it wanted. [any] */
size_t pal_plan_print(const pal_plan *plan, char *text, size_t n_byte);
#endif
