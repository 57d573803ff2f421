/* Component blend (inserted_components.h). */
#include "server/sim/world/inserted_components.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"

typedef struct blend {
    double share; /* remaining fraction of both: from 1 to 0 */
    bool begun;   /* a sub-step was made */
    /* [n_node][3]; of an adaptive body in N/kg, at an inactive vertex the mean of its edge's ends */
    double *force_N;
    float *display_offset_m; /* [n_shown][3]; NULL: none */
    pal_body *body;
} blend;

/* remaining fraction of the display offset */
static void set_display(const blend *state, double share)
{
    if (!state->display_offset_m) return;
    state->body->display.offset_m = share > 0 ? state->display_offset_m : NULL;
    state->body->display.offset_part = share > 0 ? share : 0;
}

/* adds the fraction of the load to `load` */
static void add_load(const blend *state, double share, double *load)
{
    const pal_body *body = state->body;
    for (int k = 0; k < pal_body_nodes(body); k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_axpy3(load + i, body->active ? share * body->mass_kg[i / 3] : share, state->force_N + i);
    }
}

static pal_err run(void *self, pal_step *step)
{
    blend *state = self;
    if (state->share > 0) add_load(state, state->share, step->body->load);
    state->share = pal_blend_toward(state->share, 0, step->dt_s, PAL_BLEND_S);
    state->begun = true;
    /* contact used the surface of the previous sub-step and follows it from there */
    set_display(state, state->share);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    blend *state = self;
    (void)body;
    state->share = 0;
    set_display(state, 0);
}

/* the load decreases while the component exists */
static double settled_s(const void *self)
{
    (void)self;
    return INFINITY;
}

const pal_effect pal_effect_blend = {
    .name = "blend", .stage = PAL_STAGE_CONTACT, .run = run, .reset = reset, .sleep.settled_s = settled_s};

/* ---- components inserted and removed at run time ---- */

/* a later split must not leave the whole load of a coarse vertex on the fine vertex it becomes */
static void per_mass(const pal_body *body, double *force)
{
    const pal_dofs *dofs = &body->dofs;
    for (int32_t i = 0; i < body->n_node; i++) {
        double *f = force + 3 * (size_t)i;
        if (pal_dofs_has(dofs, i)) {
            pal_scale3(f, body->mass_kg[i] > 0 ? 1 / body->mass_kg[i] : 0, f);
            continue;
        }
        const int32_t *end = dofs->levels->edge[pal_levels_vertex_parent(dofs->levels, i)].vertex;
        pal_set3(f, 0, 0, 0);
        for (int k = 0; k < 2; k++) pal_axpy3(f, 0.5, force + 3 * (size_t)end[k]);
    }
}

/* what a new component starts with; force_N and display_offset_m may be NULL */
typedef struct blend_start {
    const double *force_N;
    const float *display_offset_m;
    double display_offset_part;
} blend_start;

static pal_err make(void *user, pal_plan *plan, int b, pal_arena *arena, void **self)
{
    const blend_start *from = user;
    pal_body *body = &plan->body[b];
    size_t n = 3 * (size_t)body->n_node, n_shown = 3 * (size_t)body->display.n_shown;
    blend *state = PAL_NEW(arena, blend, 1);
    if (!state || !(state->force_N = PAL_NEW(arena, double, n))) return PAL_ERR_MEMORY;
    const float *offset_m = from->display_offset_m;
    if (offset_m && !(state->display_offset_m = PAL_NEW(arena, float, n_shown))) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < n && from->force_N; i++)
        state->force_N[i] = isfinite(from->force_N[i]) ? from->force_N[i] : 0;
    for (size_t i = 0; i < n_shown && offset_m; i++)
        state->display_offset_m[i] =
            isfinite(offset_m[i]) ? (float)(from->display_offset_part * (double)offset_m[i]) : 0;
    state->body = body;
    state->share = 1;
    *self = state;
    return PAL_ERR_OK;
}

static void remove_component(pal_inserted *blends, pal_plan *plan, int b)
{
    set_display(blends->self[b], 0);
    pal_plan_remove(plan, blends->self[b]);
    blends->self[b] = NULL;
}

static pal_err change(pal_inserted *blends, pal_plan *plan, int body, blend_start from)
{
    void *self;
    PAL_TRY(pal_plan_add(plan, body, &pal_effect_blend, make, &from, &self));
    if (blends->self[body]) remove_component(blends, plan, body);
    blends->self[body] = self;
    set_display(self, 1);
    return PAL_ERR_OK;
}

pal_err pal_blend_components_set(pal_inserted *rows, pal_plan *plan, int body, const double *force_N)
{
    const pal_body *b = &plan->body[body];
    PAL_TRY(change(rows, plan, body, (blend_start){force_N, b->display.offset_m, b->display.offset_part}));
    blend *state = rows->self[body];
    if (b->active) per_mass(b, state->force_N);
    return PAL_ERR_OK;
}

pal_err pal_blend_components_set_display(pal_inserted *rows, pal_plan *plan, int body, const float *display_offset_m)
{
    const blend *was = rows->self[body];
    const double *force_N = was && !was->begun ? was->force_N : NULL;
    return change(rows, plan, body, (blend_start){force_N, display_offset_m, 1});
}

void pal_blend_components_add(const pal_inserted *rows, int body, double scale, double *load)
{
    const blend *state = rows->self[body];
    if (state) add_load(state, scale * state->share, load);
}

void pal_blend_components_remove_idle(pal_inserted *rows, pal_plan *plan)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b] && ((const blend *)rows->self[b])->share == 0) remove_component(rows, plan, b);
}
