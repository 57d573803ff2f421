/* Private to the mesh room: convex polygons of few corners, cut by planes. A corner on the plane belongs to both sides,
 * and both sides share the corners that a cut makes, so that no area is lost or counted twice. Thread: any. */
#ifndef PAL_MESH_GEOMETRY_POLYGON_H
#define PAL_MESH_GEOMETRY_POLYGON_H
#include <stddef.h>

enum { PAL_POLYGON_MAX = 24 };

typedef struct pal_polygon {
    int n;
    double x[PAL_POLYGON_MAX][3];
} pal_polygon;

static inline void pal_polygon_add(pal_polygon *p, const double x[3])
{
    if (p->n == PAL_POLYGON_MAX) return;
    for (int k = 0; k < 3; k++) p->x[p->n][k] = x[k];
    p->n++;
}

/* height [n] of the corners over the plane; low takes what lies below, high what lies above (either may be NULL). axis
 * not negative: the plane where this coordinate is `at`, so that corners of the cut lie on it to the bit */
static inline void pal_polygon_cut(const pal_polygon *p, const double *height, int axis, double at, pal_polygon *low,
                                   pal_polygon *high)
{
    if (low) low->n = 0;
    if (high) high->n = 0;
    for (int i = 0; i < p->n; i++) {
        int j = i + 1 == p->n ? 0 : i + 1;
        double a = height[i], b = height[j], q[3];
        if (a <= 0 && low) pal_polygon_add(low, p->x[i]);
        if (a >= 0 && high) pal_polygon_add(high, p->x[i]);
        if (!((a < 0 && b > 0) || (a > 0 && b < 0))) continue;
        double t = a / (a - b);
        for (int k = 0; k < 3; k++) q[k] = k == axis ? at : p->x[i][k] + t * (p->x[j][k] - p->x[i][k]);
        if (low) pal_polygon_add(low, q);
        if (high) pal_polygon_add(high, q);
    }
}

static inline void pal_polygon_cut_axis(const pal_polygon *p, int axis, double at, pal_polygon *low, pal_polygon *high)
{
    double height[PAL_POLYGON_MAX];
    for (int i = 0; i < p->n; i++) height[i] = p->x[i][axis] - at;
    pal_polygon_cut(p, height, axis, at, low, high);
}

static inline void pal_polygon_range(const pal_polygon *p, int axis, double *min, double *max)
{
    *min = *max = p->x[0][axis];
    for (int i = 1; i < p->n; i++) {
        if (p->x[i][axis] < *min) *min = p->x[i][axis];
        if (p->x[i][axis] > *max) *max = p->x[i][axis];
    }
}

/* keeps the part between two planes of an axis */
static inline void pal_polygon_clip(pal_polygon *p, int axis, double low, double high)
{
    double min, max;
    pal_polygon part;
    if (p->n == 0) return;
    pal_polygon_range(p, axis, &min, &max);
    if (min < low) pal_polygon_cut_axis(p, axis, low, NULL, &part), *p = part;
    if (max > high) pal_polygon_cut_axis(p, axis, high, &part, NULL), *p = part;
}
#endif
