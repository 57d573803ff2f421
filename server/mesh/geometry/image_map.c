/* Image coordinates of a cleaned surface from the triangles as read. Cleaning keeps most triangles, whose middles are
 * then equal; the others (split at a vertex, decimated) look for the nearest place among the triangles around. */
#include "server/mesh/geometry/image_map.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/kd_tree.h"

enum { AROUND = 16 };             /* triangles with the nearest middles, among which the nearest place is looked for */
static const double same = 0.01;  /* of the size of a triangle: its corners are moved by less when it is welded */
static const double within = 0.1; /* of the way from a corner to the middle */
/* of the longest side of a triangle in the image: its corner has the place of another triangle's there when they are
 * nearer than this, as they are where a surface was decimated and not at a seam */
static const float near = 0.25f;

void pal_image_map_free(pal_image_map *map)
{
    PAL_FREE(map->x, map->at, map->material);
    memset(map, 0, sizeof *map);
}

static void middle_of(const double *corner[3], double out[3])
{
    for (int a = 0; a < 3; a++) out[a] = (corner[0][a] + corner[1][a] + corner[2][a]) / 3;
}

/* barycentric coordinates of the projection of p to the plane of a triangle; false: it has no area */
static bool weights_of(const double *x, const double p[3], double w[3])
{
    double u[3], v[3], d[3];
    pal_sub3(u, x + 3, x);
    pal_sub3(v, x + 6, x);
    pal_sub3(d, p, x);
    const double uu = pal_dot3(u, u), uv = pal_dot3(u, v), vv = pal_dot3(v, v), det = uu * vv - uv * uv;
    if (!(det > 1e-24 * uu * vv)) return false;
    w[1] = (vv * pal_dot3(d, u) - uv * pal_dot3(d, v)) / det;
    w[2] = (uu * pal_dot3(d, v) - uv * pal_dot3(d, u)) / det;
    w[0] = 1 - w[1] - w[2];
    return true;
}

/* distance from p to the place of a triangle that is near: the projection, moved into the triangle; its weights */
static double place_on(const double *x, const double p[3], double w[3])
{
    double at[3] = {0, 0, 0}, sum = 0;
    if (!weights_of(x, p, w)) return HUGE_VAL;
    for (int k = 0; k < 3; k++) sum += w[k] = fmax(0, w[k]);
    for (int k = 0; k < 3; k++) {
        w[k] /= sum;
        for (int a = 0; a < 3; a++) at[a] += w[k] * x[3 * k + a];
    }
    return pal_dist3(at, p);
}

/* takes the coordinates of triangle m when its corners are those of the surface's, in any order */
static bool take_same(const pal_image_map *map, int m, const double *corner[3], float *at)
{
    const double size = pal_dist3(corner[0], corner[1]) + pal_dist3(corner[1], corner[2]);
    for (int k = 0; k < 3; k++) {
        int best = 0;
        double nearest = HUGE_VAL;
        for (int j = 0; j < 3; j++) {
            const double d = pal_dist3(map->x + 9 * (size_t)m + 3 * j, corner[k]);
            if (d < nearest) nearest = d, best = j;
        }
        if (nearest > same * size) return false;
        memcpy(at + 3 * k, map->at + 9 * (size_t)m + 3 * best, 3 * sizeof *at);
    }
    return true;
}

/* the place in the image nearest to p, of any material, or only of that of `of`, which it keeps where there is none */
static void take_nearest(const pal_image_map *map, const pal_kd_tree *tree, const double p[3], const float *of,
                         float at[3])
{
    int32_t around[AROUND];
    double distance2[AROUND], nearest = HUGE_VAL, w[3] = {0};
    const int n = pal_kd_tree_nearest(tree, p, AROUND, around, distance2);
    if (of)
        memcpy(at, of, 3 * sizeof *at);
    else
        at[0] = at[1] = 0, at[2] = -1;
    for (int k = 0; k < n; k++) {
        const double d = place_on(map->x + 9 * (size_t)around[k], p, w);
        const float *from = map->at + 9 * (size_t)around[k];
        if (!(d < nearest) || (of && from[2] != of[2])) continue;
        nearest = d;
        for (int c = 0; c < 2; c++) at[c] = (float)(w[0] * from[c] + w[1] * from[3 + c] + w[2] * from[6 + c]);
        at[2] = from[2];
    }
}

static void take_triangle(const pal_image_map *map, const pal_kd_tree *tree, const pal_surface *surface, int t,
                          float *to)
{
    const double *corner[3];
    double middle[3], distance2, p[3];
    float of[3];
    int32_t m = 0;
    for (int k = 0; k < 3; k++) corner[k] = surface->x + 3 * (size_t)surface->tri[3 * (size_t)t + (size_t)k];
    middle_of(corner, middle);
    if (pal_kd_tree_nearest(tree, middle, 1, &m, &distance2) == 1 && take_same(map, m, corner, to)) return;
    take_nearest(map, tree, middle, NULL, of);
    for (int k = 0; k < 3; k++) {
        for (int a = 0; a < 3; a++) p[a] = corner[k][a] + within * (middle[a] - corner[k][a]);
        take_nearest(map, tree, p, of, to + 3 * k);
    }
}

/* a triangle without image has no place in one */
static void name_images(const pal_image_map *map, const int *image, size_t n_corner, float *at)
{
    for (size_t c = 0; c < n_corner; c++, at += 3) {
        const int material = (int)at[2];
        at[2] = material >= 0 && material < map->n_material ? (float)image[material] : -1;
        if (at[2] < 0) at[0] = at[1] = 0;
    }
}

static float distance(const float a[3], const float b[3])
{
    return hypotf(a[0] - b[0], a[1] - b[1]);
}

/* Corners at a vertex with nearly the same place in the same image get the place of the first of them. next [n_corner]:
 * the next corner at the vertex that differs from those before; first [n_vertex]; -1: none */
static void join_places(const pal_surface *surface, float *at, int32_t *first, int32_t *next)
{
    for (int v = 0; v < surface->n_vertex; v++) first[v] = -1;
    for (int32_t c = 0; c < 3 * surface->n_tri; c++) {
        const float *t = at + 9 * (size_t)(c / 3);
        const float side = fmaxf(distance(t, t + 3), fmaxf(distance(t + 3, t + 6), distance(t + 6, t)));
        float *own = at + 3 * (size_t)c;
        int32_t *to = &first[surface->tri[c]];
        while (*to >= 0 && (at[3 * (size_t)*to + 2] != own[2] || distance(at + 3 * (size_t)*to, own) > near * side))
            to = &next[*to];
        if (*to >= 0)
            memcpy(own, at + 3 * (size_t)*to, 3 * sizeof *own);
        else
            *to = c, next[c] = -1;
    }
}

pal_err pal_image_map_take(const pal_image_map *map, const int *image, pal_surface *surface)
{
    pal_kd_tree *tree = NULL;
    pal_err err = PAL_ERR_OK;
    double *middle;
    float *at;
    int32_t *first, *next;
    PAL_ARRAY(&err, middle, 3 * (size_t)map->n_tri);
    PAL_ARRAY(&err, at, 9 * (size_t)surface->n_tri);
    PAL_ARRAY(&err, first, surface->n_vertex);
    PAL_ARRAY(&err, next, 3 * (size_t)surface->n_tri);
    for (int m = 0; m < map->n_tri && !err; m++) {
        const double *x = map->x + 9 * (size_t)m, *corner[3] = {x, x + 3, x + 6};
        middle_of(corner, middle + 3 * (size_t)m);
    }
    if (!err) err = pal_kd_tree_create(middle, map->n_tri, &tree);
    for (int t = 0; t < surface->n_tri && !err; t++) take_triangle(map, tree, surface, t, at + 9 * (size_t)t);
    pal_kd_tree_destroy(tree);
    if (err) return PAL_FREED(err, middle, at, first, next);
    name_images(map, image, 3 * (size_t)surface->n_tri, at);
    join_places(surface, at, first, next);
    free(surface->image_at);
    surface->image_at = at;
    return PAL_FREED(PAL_ERR_OK, middle, first, next);
}
