/* Component skin_output: shown vertices by skinning (paper B section 4.2; the equations and errata are in
 * mesh/volume/skin.h). It computes frames of the surface nodes in use, then every shown vertex from its five nearest
 * ones. */
#include "server/sim/core/effect.h"

#include <string.h>

typedef struct skin_output {
    pal_body *body;
} skin_output;

static size_t axes_count(const pal_skin *skin)
{
    return (pal_skin_frames_bytes(skin) + sizeof(double) - 1) / sizeof(double);
}

static void evaluate(pal_body *body)
{
    pal_skin_frames(body->skin, body->d, body->skin_axes);
    pal_skin_evaluate(body->skin, body->d, body->skin_axes, body->shown);
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_body *body = build->body;
    if (!body->skin || !body->surface || body->skin->n_vertex != body->surface->n_vertex ||
        body->skin->n_node > body->n_node)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: the body has no skin that fits its mesh",
                                  item->path);
    skin_output *out = PAL_NEW(build->arena, skin_output, 1);
    double *axes = PAL_NEW(build->arena, double, axes_count(body->skin));
    float *shown = PAL_NEW(build->arena, float, 3 * (size_t)body->skin->n_vertex);
    if (!out || !axes || !shown) return PAL_ERR_MEMORY;
    out->body = body;
    body->skin_axes = axes;
    body->n_shown = body->skin->n_vertex;
    body->shown = shown;
    body->shown_node = NULL;
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
    /* resets frames that were kept through a flat neighbourhood */
    pal_body *own = ((skin_output *)self)->body;
    (void)body;
    memset(own->skin_axes, 0, axes_count(own->skin) * sizeof(double));
    evaluate(own);
}

const pal_effect pal_effect_skin_output = {
    .name = "skin_output", .stage = PAL_STAGE_OUTPUT, .make = make, .run = run, .reset = reset};
