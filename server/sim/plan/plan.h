/* The plan: the ordered components of a scene. One entry of a scene becomes one component; a component exists only
 * if an entry or a model asks for it. Components are ordered by stage, then by body, then in the order of the model
 * and of the scene. An entry of the scene replaces the model's component of the same effect. Thread: [load] to
 * build, then components belong to [sim]. */
#ifndef PAL_SIM_PLAN_PLAN_H
#define PAL_SIM_PLAN_PLAN_H
#include "server/sim/core/effect.h"

typedef struct pal_plan {
    int n_body, n_component, n_max;
    pal_body *body;                           /* [n_body]                                         */
    pal_component *component;                 /* [n_component], room for n_max                          */
    int *component_body;                      /* index of each component's body [n_row] */
    int first[PAL_STAGE_COUNT][PAL_BODY_MAX]; /* components of a stage and body: component + first, ... */
    int n_of[PAL_STAGE_COUNT][PAL_BODY_MAX];  /* ... and how many                                 */
    size_t scratch_byte;                      /* max need of one component in a sub-step */
    const char *reason[PAL_BODY_MAX]; /* scene entry that asks for each component of a body, texts one after another */
} pal_plan;

/* builds bodies and components into arena; REFUSED names the entry; MEMORY */
pal_err pal_plan_build(const pal_scene *scene, pal_arena *arena, pal_diagnostic *diag, pal_plan *out);
void pal_plan_free(
    pal_plan *plan); /* frees what components allocated outside the arena; call it before the arena is freed */
/* components that no entry of the scene asks for: fields, a brush, and a blend beside the one that it replaces */
enum { PAL_PLAN_INSERTED_MAX = PAL_FIELD_COUNT + 3 };
/* insert_at puts a made component before the one at `at`, at most PAL_PLAN_INSERTED_MAX for a body beyond those of
 * load; remove takes it out and destroys it with its own memory. Call between steps. [sim] */
void pal_plan_insert_at(pal_plan *plan, int at, int body, const pal_component *component);
void pal_plan_remove(pal_plan *plan, const void *self);
/* Makes a component that no entry asks for (its reason is NULL) in memory of its own and appends it to those of its
 * stage and body; *self is what make has set. Errors: those of make, and MEMORY; nothing has changed then. Call between
 * steps. [sim] */
typedef pal_err pal_plan_make_component(void *user, pal_plan *plan, int body, pal_arena *arena, void **self);
pal_err pal_plan_add(pal_plan *plan, int body, const pal_effect *effect, pal_plan_make_component *make, void *user,
                     void **self);
/* Switches a component off or on (world.h, pal_world_switch_component), without checks of budget and limits.
 * *changed: the state was different before. material: the present one of the body. scratch_byte of the plan may
 * grow. [sim] */
pal_err pal_plan_switch(pal_plan *plan, const pal_scene *scene, int body, const char *name, bool on,
                        const pal_material *material, pal_diagnostic *diag, bool *changed);
/* true: pal_plan_switch would refuse to switch this component off in the present plan */
bool pal_plan_requires(const pal_plan *plan, int index);
size_t pal_plan_bytes(const pal_plan *plan); /* memory beside the world's arena: components, subdivision solids */
#endif
