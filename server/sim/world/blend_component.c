/* Component blend (blend_component.h). */
#include "server/sim/world/blend_component.h"

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
static void set_display(const blend *row, double share)
{
    if (!row->display_offset_m) return;
    row->body->display_offset_m = share > 0 ? row->display_offset_m : NULL;
    row->body->display_offset_part = share > 0 ? share : 0;
}

/* adds the fraction of the load to `load` */
static void add_load(const blend *row, double share, double *load)
{
    const pal_body *body = row->body;
    for (int k = 0; k < pal_body_nodes(body); k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_axpy3(load + i, body->active ? share * body->mass_kg[i / 3] : share, row->force_N + i);
    }
}

static pal_err run(void *self, pal_step *step)
{
    blend *row = self;
    if (row->share > 0) add_load(row, row->share, step->body->load);
    row->share = pal_blend_toward(row->share, 0, step->dt_s, PAL_BLEND_TRANSFER_S);
    row->begun = true;
    /* contact used the surface of the previous sub-step and follows it from there */
    set_display(row, row->share);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    blend *row = self;
    (void)body;
    row->share = 0;
    set_display(row, 0);
}

/* the load decreases while the component exists */
static double settled_s(const void *self)
{
    (void)self;
    return INFINITY;
}

const pal_effect pal_effect_blend = {
    .name = "blend", .stage = PAL_STAGE_CONTACT, .run = run, .reset = reset, .settled_s = settled_s};

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

static pal_err insert(pal_plan *plan, int b, pal_arena *arena, const double *force_N, const float *display_offset_m,
                      double display_offset_part, void **self)
{
    pal_body *body = &plan->body[b];
    size_t n = 3 * (size_t)body->n_node, n_shown = 3 * (size_t)body->n_shown;
    blend *row = PAL_NEW(arena, blend, 1);
    if (!row || !(row->force_N = PAL_NEW(arena, double, n))) return PAL_ERR_MEMORY;
    if (display_offset_m && !(row->display_offset_m = PAL_NEW(arena, float, n_shown))) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < n && force_N; i++) row->force_N[i] = isfinite(force_N[i]) ? force_N[i] : 0;
    for (size_t i = 0; i < n_shown && display_offset_m; i++)
        row->display_offset_m[i] =
            isfinite(display_offset_m[i]) ? (float)(display_offset_part * (double)display_offset_m[i]) : 0;
    row->body = body;
    row->share = 1;
    *self = row;
    return pal_plan_insert(plan, b,
                           &(pal_component){.effect = &pal_effect_blend, .self = row, .n_byte = pal_arena_used(arena)});
}

static void remove_component(pal_blend_components *rows, pal_plan *plan, int b)
{
    set_display(rows->self[b], 0);
    pal_plan_remove(plan, rows->self[b]);
    pal_arena_destroy(rows->arena[b]);
    rows->arena[b] = NULL;
    rows->self[b] = NULL;
}

static pal_err change(pal_blend_components *rows, pal_plan *plan, int body, const double *force_N,
                      const float *display_offset_m, double display_offset_part)
{
    void *self = NULL;
    pal_arena *arena = pal_arena_create(4096, true);
    pal_err err =
        arena ? insert(plan, body, arena, force_N, display_offset_m, display_offset_part, &self) : PAL_ERR_MEMORY;
    if (err) {
        pal_arena_destroy(arena);
        return err;
    }
    if (rows->self[body]) remove_component(rows, plan, body);
    rows->arena[body] = arena;
    rows->self[body] = self;
    set_display(self, 1);
    return PAL_ERR_OK;
}

pal_err pal_blend_components_set(pal_blend_components *rows, pal_plan *plan, int body, const double *force_N)
{
    const pal_body *b = &plan->body[body];
    PAL_TRY(change(rows, plan, body, force_N, b->display_offset_m, b->display_offset_part));
    blend *row = rows->self[body];
    if (b->active) per_mass(b, row->force_N);
    return PAL_ERR_OK;
}

pal_err pal_blend_components_set_display(pal_blend_components *rows, pal_plan *plan, int body,
                                         const float *display_offset_m)
{
    const blend *was = rows->self[body];
    return change(rows, plan, body, was && !was->begun ? was->force_N : NULL, display_offset_m, 1);
}

void pal_blend_components_add(const pal_blend_components *rows, int body, double scale, double *load)
{
    const blend *row = rows->self[body];
    if (row) add_load(row, scale * row->share, load);
}

void pal_blend_components_remove_idle(pal_blend_components *rows, pal_plan *plan)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b] && ((const blend *)rows->self[b])->share == 0) remove_component(rows, plan, b);
}

void pal_blend_components_free(pal_blend_components *rows)
{
    for (int b = 0; b < PAL_BODY_MAX; b++) pal_arena_destroy(rows->arena[b]);
}

size_t pal_blend_components_bytes(const pal_blend_components *rows)
{
    size_t n_byte = 0;
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) n_byte += pal_arena_used(rows->arena[b]);
    return n_byte;
}
