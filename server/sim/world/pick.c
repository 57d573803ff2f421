/* Nearest point of a triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5), over all triangles. A
 * command picks once, so there is no search structure. */
#include "server/sim/world/pick.h"

#include "server/base/vec3.h"

#include <stddef.h>

static double on_edge(const double a[3], const double b[3], const double p[3], double *t)
{
    double along[3], at[3], apart[3];
    pal_sub3(along, b, a), pal_sub3(at, p, a);
    double length2 = pal_dot3(along, along), s = length2 > 0 ? pal_dot3(at, along) / length2 : 0;
    *t = s < 0 ? 0 : s > 1 ? 1 : s;
    for (int k = 0; k < 3; k++) apart[k] = at[k] - *t * along[k];
    return pal_dot3(apart, apart);
}

/* weights of the corners of the nearest point; returns the squared distance */
static double on_triangle(double corner[3][3], const double p[3], double w[3])
{
    double ab[3], ac[3], ap[3], best = INFINITY, t;
    pal_sub3(ab, corner[1], corner[0]), pal_sub3(ac, corner[2], corner[0]), pal_sub3(ap, p, corner[0]);
    double d00 = pal_dot3(ab, ab), d01 = pal_dot3(ab, ac), d11 = pal_dot3(ac, ac);
    double d20 = pal_dot3(ap, ab), d21 = pal_dot3(ap, ac), det = d00 * d11 - d01 * d01;
    double v = det > 0 ? (d11 * d20 - d01 * d21) / det : -1, u = det > 0 ? (d00 * d21 - d01 * d20) / det : -1;
    if (v >= 0 && u >= 0 && v + u <= 1) {
        w[0] = 1 - v - u, w[1] = v, w[2] = u;
        for (int k = 0; k < 3; k++) ap[k] -= v * ab[k] + u * ac[k];
        return pal_dot3(ap, ap);
    }
    for (int e = 0; e < 3; e++) {
        double d2 = on_edge(corner[e], corner[(e + 1) % 3], p, &t);
        if (!(d2 < best)) continue;
        best = d2;
        w[e] = 1 - t, w[(e + 1) % 3] = t, w[(e + 2) % 3] = 0;
    }
    return best;
}

static void corners(const float *x, const int32_t tri[3], double out[3][3])
{
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++) out[k][c] = (double)x[3 * (size_t)tri[k] + (size_t)c];
}

bool pal_pick_nearest(const pal_shown *shown, const float *position_m, const double at_m[3], pal_pick *out)
{
    const float *x = position_m ? position_m : shown->rest_m;
    double best = INFINITY, corner[3][3];
    *out = (pal_pick){.triangle = -1, .face = -1};
    for (int t = 0; t < shown->n_tri; t++) {
        const int32_t *tri = shown->tri + 3 * (size_t)t;
        double w[3] = {0};
        if ((shown->face && shown->face[t] < 0) || (tri[0] == tri[1] && tri[1] == tri[2])) continue;
        corners(x, tri, corner);
        double d2 = on_triangle(corner, at_m, w);
        if (!(d2 < best)) continue;
        best = d2;
        out->triangle = t;
        pal_copy3(out->weight, w);
    }
    if (out->triangle < 0) return false;
    if (shown->face) out->face = shown->face[out->triangle];
    out->distance_m = sqrt(best);
    corners(shown->rest_m, shown->tri + 3 * (size_t)out->triangle, corner);
    for (int k = 0; k < 3; k++) pal_axpy3(out->rest_m, out->weight[k], corner[k]);
    return true;
}
