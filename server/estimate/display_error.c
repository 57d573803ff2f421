/* Displayed vertices by skin and by element interpolation (display_error.h). */
#include "server/estimate/display_error.h"

#include "server/base/vec3.h"

#include <stdlib.h>
#include <string.h>

static pal_err make(pal_display_error *s)
{
    size_t n = 3 * (size_t)s->n;
    for (int k = 0; k < PAL_DISPLAY_RESTS; k++)
        if (s->rest[k]->world)
            PAL_TRY(pal_rest_solution_interpolation(s->rest[k], s->mesh->surface.x, s->n, 1, false, &s->by[k]));
    s->frames = malloc(pal_skin_frames_bytes(&s->mesh->skin) + 64);
    s->skin_m = malloc(n * sizeof *s->skin_m), s->unmoved_m = malloc(n * sizeof *s->unmoved_m);
    s->u[0] = malloc(n * sizeof(double)), s->u[1] = malloc(n * sizeof(double));
    return s->frames && s->skin_m && s->unmoved_m && s->u[0] && s->u[1] ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* Clears the frames first: otherwise a collapsed neighbourhood would reuse the previous frame. */
static void show(pal_display_error *s, const double *x, float *out)
{
    memset(s->frames, 0, pal_skin_frames_bytes(&s->mesh->skin));
    pal_skin_frames(&s->mesh->skin, x, NULL, s->frames);
    pal_skin_evaluate(&s->mesh->skin, s->frames, NULL, out);
}

pal_err pal_display_error_make(const pal_rest_solution *fine, const pal_rest_solution *coarse,
                               const pal_rest_solution *coarsest, pal_display_error *out)
{
    const pal_prepared *mesh = fine->scene->body[0].mesh;
    const pal_body *body = pal_world_view_body(fine->world, 0);
    *out = (pal_display_error){.mesh = mesh, .rest = {fine, coarse, coarsest}};
    if (mesh->skin.n_vertex < 1 || mesh->skin.n_vertex != mesh->surface.n_vertex || mesh->skin.n_node > body->n_node)
        return PAL_ERR_OK;
    out->n = mesh->skin.n_vertex;
    pal_err err = make(out);
    if (err)
        pal_display_error_free(out);
    else
        show(out, body->node_rest, out->unmoved_m);
    return err;
}

void pal_display_error_free(pal_display_error *s)
{
    for (int k = 0; k < PAL_DISPLAY_RESTS; k++) pal_interpolation_free(&s->by[k]);
    free(s->frames), free(s->skin_m), free(s->unmoved_m), free(s->u[0]), free(s->u[1]);
    *s = (pal_display_error){.n = 0};
}

/* displacements of the vertices by the elements of a rest solution */
static void by_elements(pal_display_error *s, int k, double *u)
{
    pal_rest_solution_displacement(s->rest[k], &s->by[k], u);
}

double pal_display_error_change(pal_display_error *s, int of, int to)
{
    by_elements(s, of, s->u[0]);
    by_elements(s, to, s->u[1]);
    return pal_max_dist3(s->u[0], s->u[1], s->n);
}

double pal_display_error_skin(pal_display_error *s, const double *x, double more)
{
    by_elements(s, PAL_DISPLAY_FINE, s->u[0]);
    if (more > 0) by_elements(s, PAL_DISPLAY_COARSE, s->u[1]);
    for (int i = 0; i < 3 * s->n && more > 0; i++) s->u[0][i] += more * (s->u[0][i] - s->u[1][i]);
    show(s, x, s->skin_m);
    for (int i = 0; i < 3 * s->n; i++) s->u[1][i] = (double)s->skin_m[i] - (double)s->unmoved_m[i];
    return pal_max_dist3(s->u[0], s->u[1], s->n);
}
