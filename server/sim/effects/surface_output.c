/* Component surface_output: shown vertices are the surface nodes of the simulated mesh, without a skin; the boundary
 * faces are drawn.
 *
 * An adaptive body (adaptive_surface.h) shows all its points, inactive ones at rest, and the triangles of its
 * present leaves; the cost of a step is that of its active points. Of a subdivision solid (subdivision_solid.h) the
 * model gives the boundary and the node of each vertex. */
#include "server/sim/core/effect.h"

#include <string.h>

typedef struct surface_output {
    pal_body *body;
    pal_surface surface; /* boundary faces on shown vertices; arena memory, never freed on its own */
    /* adaptive bodies: points shown at the last revision */
    uint64_t revision;
    int n_was;
    int32_t *was; /* [n_was] */
} surface_output;

static void show(pal_body *body, int vertex, const double x[3])
{
    float *to = body->shown + 3 * (size_t)vertex;
    for (int c = 0; c < 3; c++) to[c] = (float)x[c];
}

static void evaluate(pal_body *body)
{
    for (int i = 0; i < body->n_shown; i++) show(body, i, body->d + 3 * (size_t)body->shown_node[i]);
}

/* shows the active points; points that became inactive return to rest */
static void evaluate_active(surface_output *out)
{
    pal_body *body = out->body;
    if (out->revision != body->revision) {
        for (int k = 0; k < out->n_was; k++) show(body, out->was[k], body->x_rest + 3 * (size_t)out->was[k]);
        memcpy(out->was, body->active, sizeof *out->was * (size_t)body->n_active);
        out->n_was = body->n_active;
        out->revision = body->revision;
    }
    for (int k = 0; k < body->n_active; k++) {
        int i = body->active[k];
        show(body, i, body->d + 3 * (size_t)i);
    }
}

static pal_err make_adaptive(pal_build *build, void **self)
{
    pal_body *body = build->body;
    size_t n = (size_t)body->n_node;
    surface_output *out = PAL_NEW(build->arena, surface_output, 1);
    int32_t *node = PAL_NEW(build->arena, int32_t, n);
    float *shown = PAL_NEW(build->arena, float, 3 * n);
    if (out) out->was = PAL_NEW(build->arena, int32_t, n);
    if (!out || !out->was || !node || !shown) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_node; i++) node[i] = i;
    out->body = body;
    out->revision = body->revision;
    body->n_shown = body->n_node;
    body->shown = shown;
    body->shown_node = node;
    evaluate(body);
    memcpy(out->was, body->active, sizeof *out->was * (size_t)body->n_active);
    out->n_was = body->n_active;
    *self = out;
    return PAL_ERR_OK;
}

/* surface and shown_node exist already */
static pal_err make_solid(pal_build *build, void **self)
{
    pal_body *body = build->body;
    surface_output *out = PAL_NEW(build->arena, surface_output, 1);
    float *shown = PAL_NEW(build->arena, float, 3 * (size_t)body->surface->n_vertex);
    if (!out || !shown) return PAL_ERR_MEMORY;
    out->body = body;
    body->n_shown = body->surface->n_vertex;
    body->shown = shown;
    evaluate(body);
    *self = out;
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_body *body = build->body;
    if (body->active) return make_adaptive(build, self);
    if (body->interpolation) return make_solid(build, self);
    const pal_tets *tets = body->tets;
    if (!tets || tets->n_face == 0 || tets->n_node > body->n_node)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: the body has no boundary faces to show",
                                  item->path);

    /* number the nodes of boundary faces */
    int n_shown = 0;
    int32_t *place = PAL_NEW(build->arena, int32_t, tets->n_node);
    if (!place) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < 3 * (size_t)tets->n_face; i++) place[tets->face[i]] = 1;
    for (int i = 0; i < tets->n_node; i++) n_shown += place[i];

    surface_output *out = PAL_NEW(build->arena, surface_output, 1);
    int32_t *node = PAL_NEW(build->arena, int32_t, n_shown);
    int32_t *tri = PAL_NEW(build->arena, int32_t, 3 * (size_t)tets->n_face);
    double *x = PAL_NEW(build->arena, double, 3 * (size_t)n_shown);
    float *shown = PAL_NEW(build->arena, float, 3 * (size_t)n_shown);
    if (!out || !node || !tri || !x || !shown) return PAL_ERR_MEMORY;

    int n = 0;
    for (int i = 0; i < tets->n_node; i++) {
        if (!place[i]) continue;
        for (int c = 0; c < 3; c++) x[3 * (size_t)n + (size_t)c] = tets->x[3 * (size_t)i + (size_t)c];
        node[n] = i;
        place[i] = n++;
    }
    for (size_t i = 0; i < 3 * (size_t)tets->n_face; i++) tri[i] = place[tets->face[i]];
    out->body = body;
    out->surface = (pal_surface){.n_vertex = n_shown, .n_tri = tets->n_face, .x = x, .tri = tri};
    for (int c = 0; c < 3; c++) out->surface.origin_m[c] = tets->origin_m[c];
    body->surface = &out->surface;
    body->skin = NULL;
    body->skin_axes = NULL;
    body->n_shown = n_shown;
    body->shown = shown;
    body->shown_node = node;
    evaluate(body);
    *self = out;
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    if (step->body->active)
        evaluate_active(self);
    else
        evaluate(step->body);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    surface_output *out = self;
    if (body->active)
        evaluate_active(out);
    else
        evaluate(out->body);
}

const pal_effect pal_effect_surface_output = {
    .name = "surface_output", .stage = PAL_STAGE_OUTPUT, .make = make, .run = run, .reset = reset};
