/* Displayed vertices by skin and by element interpolation (display_error.h). */
#include "server/estimate/display_error.h"

#include "server/base/vec3.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Interpolation of the vertices in the elements of a rest solution; slightly outside points are extrapolated. */
static pal_err find_rows(const pal_rest_solution *rest, const pal_surface *surface, pal_interpolation *out)
{
    const pal_body *own = pal_world_view_body(rest->world, 0);
    const pal_prepared *mesh = rest->scene->body[0].mesh;
    const int n = own->n_corner;
    pal_locate *locate = NULL;
    pal_interpolation_builder rows;
    PAL_TRY(pal_locate_create(&mesh->tets, n == PAL_HEX_CORNERS ? &mesh->hexes : NULL, &locate));
    pal_interpolation_builder_begin(&rows, surface->n_vertex, own->n_node, INT32_MAX);
    for (int i = 0; i < surface->n_vertex && !rows.err; i++) {
        double local[4], shape[PAL_MAX_CORNERS];
        int e = pal_locate_point(locate, surface->x + 3 * (size_t)i, local, NULL);
        pal_element_shape_functions(own, local, shape);
        for (int k = 0; k < n; k++)
            pal_interpolation_builder_add(&rows, own->element[(size_t)n * (size_t)e + (size_t)k], shape[k]);
        pal_interpolation_builder_end_row(&rows);
    }
    pal_locate_destroy(locate);
    return pal_interpolation_builder_finish(&rows, out);
}

static pal_err make(pal_display_error *s)
{
    int max = 1;
    for (int k = 0; k < PAL_DISPLAY_RESTS; k++) {
        if (!s->rest[k]->world) continue;
        PAL_TRY(find_rows(s->rest[k], &s->mesh->surface, &s->by[k]));
        max = (int)fmax(max, pal_world_view_body(s->rest[k]->world, 0)->n_node);
    }
    size_t n = 3 * (size_t)s->n;
    s->frames = malloc(pal_skin_frames_bytes(&s->mesh->skin) + 64);
    s->place = malloc(n * sizeof *s->place), s->unmoved_m = malloc(n * sizeof *s->unmoved_m);
    s->u[0] = malloc(n * sizeof(double)), s->u[1] = malloc(n * sizeof(double));
    s->node = malloc(3 * sizeof(double) * (size_t)max);
    return s->frames && s->place && s->unmoved_m && s->u[0] && s->u[1] && s->node ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* Clears the frames first: otherwise a collapsed neighbourhood would reuse the previous frame. */
static void show(pal_display_error *s, const double *x, float *out)
{
    memset(s->frames, 0, pal_skin_frames_bytes(&s->mesh->skin));
    pal_skin_frames(&s->mesh->skin, x, s->frames);
    pal_skin_evaluate(&s->mesh->skin, x, s->frames, out);
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
    free(s->frames), free(s->place), free(s->unmoved_m), free(s->u[0]), free(s->u[1]), free(s->node);
    *s = (pal_display_error){.n = 0};
}

/* displacements of the vertices by the elements of a rest solution */
static void by_elements(pal_display_error *s, int k, double *u)
{
    const pal_body *own = pal_world_view_body(s->rest[k]->world, 0);
    for (int i = 0; i < 3 * own->n_node; i++) s->node[i] = own->d[i] - own->node_rest[i];
    pal_interpolation_apply(&s->by[k], s->node, u);
}

static double farthest(const pal_display_error *s)
{
    double max = 0;
    for (int i = 0; i < s->n; i++) max = fmax(max, pal_dist3(s->u[0] + 3 * (size_t)i, s->u[1] + 3 * (size_t)i));
    return max;
}

double pal_display_error_change(pal_display_error *s, int of, int to)
{
    by_elements(s, of, s->u[0]);
    by_elements(s, to, s->u[1]);
    return farthest(s);
}

double pal_display_error_skin(pal_display_error *s, const double *x, double more)
{
    by_elements(s, PAL_DISPLAY_FINE, s->u[0]);
    if (more > 0) by_elements(s, PAL_DISPLAY_COARSE, s->u[1]);
    for (int i = 0; i < 3 * s->n && more > 0; i++) s->u[0][i] += more * (s->u[0][i] - s->u[1][i]);
    show(s, x, s->place);
    for (int i = 0; i < 3 * s->n; i++) s->u[1][i] = (double)s->place[i] - (double)s->unmoved_m[i];
    return farthest(s);
}
