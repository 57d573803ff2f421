/* The plan: the ordered components of a scene. An entry of a scene becomes one component; what neither an entry nor a
 * model asks for does not exist. Components are ordered by stage, within a stage by body, within that as the model and
 * then the scene list them. An entry of the scene replaces the model's component of the same effect. Thread: [load] to
 * build, then components belong to [sim]. */
#ifndef PAL_SIM_PLAN_PLAN_H
#define PAL_SIM_PLAN_PLAN_H
#include "server/sim/core/effect.h"

typedef struct pal_plan {
    int n_body, n_row;
    int n_load;                               /* rows at load: the room of the arena's own tables */
    pal_body *body;                           /* [n_body]                                         */
    pal_component *row;                       /* [n_row]                                          */
    int *component_body;                      /* index of each row's body [n_row]                 */
    int first[PAL_STAGE_COUNT][PAL_BODY_MAX]; /* rows of a stage and body: row + first, ...       */
    int n_of[PAL_STAGE_COUNT][PAL_BODY_MAX];  /* ... and how many                                 */
    size_t scratch_byte;                      /* most that one row needs in a sub-step            */
    const char *reason[PAL_BODY_MAX];         /* what calls for each entry of a body, one text behind the other */
    pal_component *load_component;            /* the arena's own tables, used while there is room */
    int *load_component_body;
} pal_plan;

/* builds bodies and rows into arena; REFUSED names the entry, MEMORY */
pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_diagnostic *diag, pal_plan *out);
void pal_plan_free(pal_plan *plan); /* what rows took beside the arena; before the arena goes */
/* puts a made row behind the others of its stage and body, or takes it out again (and destroys it, its own memory
 * too); between steps. More rows than at load stand in heap memory, which is gone when they are; MEMORY: unchanged.
 * [sim] */
pal_err pal_plan_insert(pal_plan *plan, int body, const pal_component *row);
/* the same in front of the row at `at` */
pal_err pal_plan_insert_at(pal_plan *plan, int at, int body, const pal_component *row);
void pal_plan_remove(pal_plan *plan, const void *self);
/* Switches a row off or on again (world.h, pal_world_switch_component), budget and limits apart. *changed: it was not
 * so already. material: of the body now. scratch_byte of the plan may have grown. [sim] */
pal_err pal_plan_switch(pal_plan *plan, const pal_scene *scene, int body, const char *name, bool on,
                        const pal_material *material, pal_diagnostic *diag, bool *changed);
/* would pal_plan_switch refuse to switch this row off as the plan is now? */
bool pal_plan_requires(const pal_plan *plan, int row);
size_t pal_plan_bytes(const pal_plan *plan); /* heap memory: tables of more rows than at load, rows, solids */
/* one line per row into text (cut at n_byte, always ended); returns the length it wanted. [any] */
size_t pal_plan_print(const pal_plan *plan, char *text, size_t n_byte);
#endif
