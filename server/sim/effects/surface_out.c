/* Shown vertices are the surface nodes of the simulated mesh themselves: no skin, the boundary faces are what is
 * shown. */
#include "server/sim/effect.h"

typedef struct surface_out {
    pal_body *body;
    pal_surface surface; /* boundary faces on shown vertices; arena memory, never freed on its own */
} surface_out;

static void evaluate(pal_body *body)
{
    for (int i = 0; i < body->n_shown; i++) {
        const double *x = body->d + 3 * (size_t)body->shown_node[i];
        float *to = body->shown + 3 * (size_t)i;
        for (int c = 0; c < 3; c++) to[c] = (float)x[c];
    }
}

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    PAL_TRY(pal_item_done(item, build->note));
    pal_body *body = build->body;
    const pal_tets *tets = body->tets;
    if (!tets || tets->n_face == 0 || tets->n_node > body->n_node)
        return pal_note_set(build->note, PAL_ERR_REFUSED, "%s: the body has no boundary faces to show", item->path);

    /* number the nodes of boundary faces */
    int n_shown = 0;
    int32_t *place = PAL_NEW(build->arena, int32_t, tets->n_node);
    if (!place) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < 3 * (size_t)tets->n_face; i++) place[tets->face[i]] = 1;
    for (int i = 0; i < tets->n_node; i++) n_shown += place[i];

    surface_out *out = PAL_NEW(build->arena, surface_out, 1);
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
    (void)self;
    evaluate(step->body);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    evaluate(((surface_out *)self)->body);
}

const pal_effect pal_effect_surface_out = {
    .name = "surface_out", .stage = PAL_STAGE_OUTPUT, .make = make, .run = run, .reset = reset};
