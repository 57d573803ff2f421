/* Doubles the vertices of a displayed surface along the seams of its image. */
#include "server/mesh/volume/image_seams.h"

#include "server/base/heap.h"

#include <math.h>

/* of the longest side of a triangle in the image: its corner has the place of another triangle's there when they are
 * nearer than this, as they are where a surface was decimated and not at a seam */
static const float same = 0.25f;

/* the vertices as they become: number k stands at the vertex of[k] and has uv[k]; next: another one there, -1: none */
typedef struct seams {
    int n;
    int32_t *of, *next;
    float *uv;
} seams;

static float distance(const float a[2], const float b[2])
{
    return hypotf(a[0] - b[0], a[1] - b[1]);
}

/* the vertex for a corner at `vertex` with these coordinates: one that is within reach of them, or a copy */
static int32_t vertex_with(seams *s, int32_t vertex, const float uv[2], float reach)
{
    int32_t k = vertex;
    if (s->of[k] < 0) {
        s->of[k] = vertex; /* its first corner */
        memcpy(s->uv + 2 * (size_t)k, uv, 2 * sizeof *uv);
        return k;
    }
    while (distance(s->uv + 2 * (size_t)k, uv) > reach) {
        if (s->next[k] < 0) {
            const int32_t copy = s->n++;
            s->next[k] = copy, s->next[copy] = -1, s->of[copy] = vertex;
            memcpy(s->uv + 2 * (size_t)copy, uv, 2 * sizeof *uv);
            return copy;
        }
        k = s->next[k];
    }
    return k;
}

/* longer arrays in place of those of the surface and its skin */
static pal_err double_vertices(const seams *s, pal_prepared *p)
{
    const size_t n = (size_t)s->n, near_n = PAL_SKIN_NEIGHBOURS;
    pal_err err = PAL_ERR_OK;
    double *x;
    float *uv;
    int32_t *near_frame;
    float *coef;
    PAL_ARRAY(&err, x, 3 * n);
    PAL_ARRAY(&err, uv, 2 * n);
    PAL_ARRAY(&err, near_frame, near_n * n);
    PAL_ARRAY(&err, coef, 4 * near_n * n);
    if (err) return PAL_FREED(err, x, uv, near_frame, coef);
    memcpy(uv, s->uv, 2 * n * sizeof *uv);
    for (size_t k = 0; k < n; k++) {
        const size_t from = (size_t)(s->of[k] < 0 ? (int32_t)k : s->of[k]);
        memcpy(x + 3 * k, p->surface.x + 3 * from, 3 * sizeof *x);
        if (!p->skin.n_vertex) continue;
        memcpy(near_frame + near_n * k, p->skin.near + near_n * from, near_n * sizeof *near_frame);
        memcpy(coef + 4 * near_n * k, p->skin.coef + 4 * near_n * from, 4 * near_n * sizeof *coef);
    }
    PAL_FREE(p->surface.x, p->surface.uv);
    p->surface.x = x, p->surface.uv = uv, p->surface.n_vertex = s->n;
    if (!p->skin.n_vertex) return PAL_FREED(PAL_ERR_OK, near_frame, coef);
    PAL_FREE(p->skin.near, p->skin.coef);
    p->skin.near = near_frame, p->skin.coef = coef, p->skin.n_vertex = s->n;
    return PAL_ERR_OK;
}

pal_err pal_image_seams_make(const pal_image_map *map, pal_prepared *prepared, pal_diagnostic *diag)
{
    pal_surface *surface = &prepared->surface;
    const size_t n_corner = 3 * (size_t)surface->n_tri, room = (size_t)surface->n_vertex + n_corner;
    seams s = {.n = surface->n_vertex};
    pal_err err = PAL_ERR_OK;
    float *corner;
    int32_t *tri;
    PAL_ARRAY(&err, corner, 2 * n_corner);
    PAL_ARRAY(&err, tri, n_corner);
    PAL_ARRAY(&err, s.of, room);
    PAL_ARRAY(&err, s.next, room);
    PAL_ZEROED(&err, s.uv, 2 * room);
    if (!err) err = pal_image_map_corners(map, surface, corner);
    for (int v = 0; v < surface->n_vertex && !err; v++) s.of[v] = s.next[v] = -1;
    for (size_t c = 0; c < n_corner && !err; c++) {
        const float *uv = corner + 6 * (c / 3);
        const float side = fmaxf(distance(uv, uv + 2), fmaxf(distance(uv + 2, uv + 4), distance(uv + 4, uv)));
        tri[c] = vertex_with(&s, surface->tri[c], corner + 2 * c, same * side);
    }
    if (err)
        pal_diagnostic_set(diag, err, "no memory for the image coordinates of %zu corners", n_corner);
    else if (!prepared->skin.n_vertex && s.n > surface->n_vertex)
        err = PAL_REFUSE(diag, "it has seams, at %d vertices, along which model adaptive cannot be cut",
                         s.n - surface->n_vertex);
    if (!err) err = double_vertices(&s, prepared);
    if (!err) memcpy(surface->tri, tri, n_corner * sizeof *tri);
    return PAL_FREED(err, corner, tri, s.of, s.next, s.uv);
}
