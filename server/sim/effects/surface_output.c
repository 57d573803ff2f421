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
    float *to = body->display.shown + 3 * (size_t)vertex;
    for (int c = 0; c < 3; c++) to[c] = (float)x[c];
}

static void evaluate(pal_body *body)
{
    for (int i = 0; i < body->display.n_shown; i++) show(body, i, body->d + 3 * (size_t)body->display.shown_node[i]);
}

static void take_active(surface_output *out, const pal_body *body)
{
    memcpy(out->was, body->active, sizeof *out->was * (size_t)body->n_active);
    out->n_was = body->n_active;
    out->revision = body->display.revision;
}

/* shows the active points; points that became inactive return to rest */
static void evaluate_active(surface_output *out)
{
    pal_body *body = out->body;
    if (out->revision != body->display.revision) {
        for (int k = 0; k < out->n_was; k++) show(body, out->was[k], body->x_rest + 3 * (size_t)out->was[k]);
        take_active(out, body);
    }
    for (int k = 0; k < body->n_active; k++) {
        int i = body->active[k];
        show(body, i, body->d + 3 * (size_t)i);
    }
}

/* the boundary faces on their own nodes, as the body's surface without a skin */
static pal_err make_boundary(const pal_tets *tets, pal_build *build, surface_output *out)
{
    pal_display *display = &build->body->display;
    int n_shown = 0, n = 0;
    int32_t *place = PAL_NEW(build->arena, int32_t, tets->n_node);
    if (!place) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < 3 * (size_t)tets->n_face; i++) place[tets->face[i]] = 1;
    for (int i = 0; i < tets->n_node; i++) n_shown += place[i];
    int32_t *node = PAL_NEW(build->arena, int32_t, n_shown);
    int32_t *tri = PAL_NEW(build->arena, int32_t, 3 * (size_t)tets->n_face);
    double *x = PAL_NEW(build->arena, double, 3 * (size_t)n_shown);
    if (!node || !tri || !x) return PAL_ERR_MEMORY;
    for (int i = 0; i < tets->n_node; i++) {
        if (!place[i]) continue;
        memcpy(x + 3 * (size_t)n, tets->x + 3 * (size_t)i, 3 * sizeof *x);
        node[n] = i;
        place[i] = n++;
    }
    for (size_t i = 0; i < 3 * (size_t)tets->n_face; i++) tri[i] = place[tets->face[i]];
    out->surface = (pal_surface){.n_vertex = n_shown, .n_tri = tets->n_face, .x = x, .tri = tri};
    memcpy(out->surface.origin_m, tets->origin_m, sizeof out->surface.origin_m);
    display->surface = &out->surface;
    display->skin = NULL;
    display->skin_axes = NULL;
    display->shown_node = node;
    return PAL_ERR_OK;
}

/* every point of an adaptive body is a shown vertex */
static pal_err make_adaptive(pal_build *build, surface_output *out)
{
    pal_body *body = build->body;
    int32_t *node = PAL_NEW(build->arena, int32_t, body->n_node);
    out->was = PAL_NEW(build->arena, int32_t, body->n_node);
    if (!out->was || !node) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_node; i++) node[i] = i;
    body->display.shown_node = node;
    take_active(out, body);
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_body *body = build->body;
    const pal_tets *tets = body->tets;
    const bool boundary = !body->active && !body->interpolation;
    if (boundary && (!tets || tets->n_face == 0 || tets->n_node > body->n_node))
        return PAL_REFUSE(build->diag, "%s: the body has no boundary faces to show", item->path);
    surface_output *out = PAL_NEW(build->arena, surface_output, 1);
    if (!out) return PAL_ERR_MEMORY;
    out->body = body;
    if (body->active) PAL_TRY(make_adaptive(build, out));
    if (boundary) PAL_TRY(make_boundary(tets, build, out));
    body->display.n_shown = body->display.surface->n_vertex;
    body->display.shown = PAL_NEW(build->arena, float, 3 * (size_t)body->display.n_shown);
    if (!body->display.shown) return PAL_ERR_MEMORY;
    evaluate(body);
    *self = out;
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

static pal_err run(void *self, pal_step *step)
{
    reset(self, step->body);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_surface_output = {PAL_EFFECT("surface_output", OUTPUT), .reset = reset};
