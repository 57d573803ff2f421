/* Component skin_output: shown vertices by skinning (paper B section 4.2; the equations and errata are in
 * mesh/volume/skin.h). It computes frames of the surface nodes in use, then every shown vertex from its five nearest
 * ones. */
#include "server/sim/core/effect.h"

#include <string.h>

static size_t axes_count(const pal_skin *skin)
{
    return (pal_skin_frames_bytes(skin) + sizeof(double) - 1) / sizeof(double);
}

static void evaluate(pal_body *body)
{
    pal_skin_frames(body->display.skin, body->d, body->team, body->display.skin_axes);
    pal_skin_evaluate(body->display.skin, body->display.skin_axes, body->team, body->display.shown);
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_body *body = build->body;
    if (!body->display.skin || !body->display.surface ||
        body->display.skin->n_vertex != body->display.surface->n_vertex || body->display.skin->n_node > body->n_node)
        return PAL_REFUSE(build->diag, "%s: the body has no skin that fits its mesh", item->path);
    double *axes = PAL_NEW(build->arena, double, axes_count(body->display.skin));
    float *shown = PAL_NEW(build->arena, float, 3 * (size_t)body->display.skin->n_vertex);
    if (!axes || !shown) return PAL_ERR_MEMORY;
    body->display.skin_axes = axes;
    body->display.n_shown = body->display.skin->n_vertex;
    body->display.shown = shown;
    body->display.shown_node = NULL;
    evaluate(body);
    *self = body;
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
    pal_body *own = self;
    (void)body;
    memset(own->display.skin_axes, 0, axes_count(own->display.skin) * sizeof(double));
    evaluate(own);
}

const pal_effect pal_effect_skin_output = {PAL_EFFECT("skin_output", OUTPUT), .reset = reset};
