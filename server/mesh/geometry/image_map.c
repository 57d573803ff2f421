/* Image coordinates of a cleaned surface from the triangles as read. Cleaning keeps most triangles, whose middles are
 * then equal; the others (split at a vertex, decimated) look for the nearest place among the triangles around. */
#include "server/mesh/geometry/image_map.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/kd_tree.h"

enum { AROUND = 16 };             /* triangles with the nearest middles, among which the nearest place is looked for */
static const double same = 0.01;  /* of the size of a triangle: its corners are moved by less when it is welded */
static const double within = 0.1; /* of the way from a corner to the middle */

void pal_image_map_free(pal_image_map *map)
{
    PAL_FREE(map->x, map->uv);
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
static bool take_same(const pal_image_map *map, int m, const double *corner[3], float *uv)
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
        memcpy(uv + 2 * k, map->uv + 6 * (size_t)m + 2 * best, 2 * sizeof *uv);
    }
    return true;
}

static void take_nearest(const pal_image_map *map, const pal_kd_tree *tree, const double p[3], float uv[2])
{
    int32_t around[AROUND];
    double distance2[AROUND], nearest = HUGE_VAL, w[3] = {0};
    const int n = pal_kd_tree_nearest(tree, p, AROUND, around, distance2);
    uv[0] = uv[1] = 0;
    for (int k = 0; k < n; k++) {
        const double d = place_on(map->x + 9 * (size_t)around[k], p, w);
        const float *from = map->uv + 6 * (size_t)around[k];
        if (!(d < nearest)) continue;
        nearest = d;
        for (int c = 0; c < 2; c++) uv[c] = (float)(w[0] * from[c] + w[1] * from[2 + c] + w[2] * from[4 + c]);
    }
}

pal_err pal_image_map_corners(const pal_image_map *map, const pal_surface *surface, float *uv)
{
    pal_kd_tree *tree = NULL;
    pal_err err = PAL_ERR_OK;
    double *middle;
    PAL_ARRAY(&err, middle, 3 * (size_t)map->n_tri);
    for (int m = 0; m < map->n_tri && !err; m++) {
        const double *x = map->x + 9 * (size_t)m, *corner[3] = {x, x + 3, x + 6};
        middle_of(corner, middle + 3 * (size_t)m);
    }
    if (!err) err = pal_kd_tree_create(middle, map->n_tri, &tree);
    for (int t = 0; t < surface->n_tri && !err; t++) {
        const double *corner[3];
        double at[3], distance2, p[3];
        int32_t m = 0;
        for (int k = 0; k < 3; k++) corner[k] = surface->x + 3 * (size_t)surface->tri[3 * (size_t)t + (size_t)k];
        middle_of(corner, at);
        float *to = uv + 6 * (size_t)t;
        if (pal_kd_tree_nearest(tree, at, 1, &m, &distance2) == 1 && take_same(map, m, corner, to)) continue;
        for (int k = 0; k < 3; k++) {
            for (int a = 0; a < 3; a++) p[a] = corner[k][a] + within * (at[a] - corner[k][a]);
            take_nearest(map, tree, p, to + 2 * k);
        }
    }
    pal_kd_tree_destroy(tree);
    return PAL_FREED(err, middle);
}
