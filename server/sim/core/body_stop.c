/* Why a body was stopped, in one sentence. */
#include "server/base/vec3.h"
#include "server/sim/core/body.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

/* six times the volume of a tetrahedron, or of the one at the first corner of another element */
static double volume6(const double *x, const int32_t *corner, int n_corner)
{
    double a[3], b[3], c[3], n[3];
    int p = 1, q = n_corner == 8 ? 3 : 2, r = n_corner == 8 ? 4 : 3;
    pal_sub3(a, x + 3 * (size_t)corner[p], x + 3 * (size_t)corner[0]);
    pal_sub3(b, x + 3 * (size_t)corner[q], x + 3 * (size_t)corner[0]);
    pal_sub3(c, x + 3 * (size_t)corner[r], x + 3 * (size_t)corner[0]);
    pal_cross3(n, a, b);
    return fabs(pal_dot3(n, c));
}

/* the smallest element at rest around a node; -1: there is none */
static int smallest_around(const pal_body *body, int node)
{
    const int32_t *element = body->element ? body->element : body->tets ? body->tets->tet : NULL;
    int n = body->element ? body->n_element : body->tets ? body->tets->n_tet : 0, best = -1;
    int n_corner = body->element ? body->n_corner : 4;
    double min = INFINITY;
    for (int e = 0; e < n && element && !body->interpolation; e++)
        for (int c = 0; c < n_corner; c++) {
            const int32_t *corner = element + (size_t)e * (size_t)n_corner;
            double size = corner[c] == node ? volume6(body->x_rest, corner, n_corner) : INFINITY;
            if (size < min) min = size, best = e;
        }
    return best;
}

void pal_body_stop(pal_body *body, int point, const char *format, ...)
{
    char place[80] = "";
    if (body->frozen) return;
    body->frozen = true;
    body->safeguards.n_stopped++;
    if (point >= 0) {
        const double *x = body->x_rest + 3 * (size_t)point, *o = body->offset_m;
        int e = smallest_around(body, point);
        int used = snprintf(place, sizeof place, "%s %d", body->interpolation ? "control point" : "node", point);
        if (e >= 0)
            used += snprintf(place + used, sizeof place - (size_t)used, " of %s %d",
                             body->element && body->n_corner == 8 ? "cube" : "tetrahedron", e);
        snprintf(place + used, sizeof place - (size_t)used, " at (%.4g, %.4g, %.4g) mm: ", 1e3 * (x[0] + o[0]),
                 1e3 * (x[1] + o[1]), 1e3 * (x[2] + o[2]));
    }
    int used = snprintf(body->reason, sizeof body->reason, "%s", place);
    va_list list;
    va_start(list, format);
    vsnprintf(body->reason + used, sizeof body->reason - (size_t)used, format, list);
    va_end(list);
}

void pal_body_stop_bad(pal_body *body, const char *otherwise)
{
    static const char *const what[] = {"position", "speed", "force"};
    const double *number[] = {body->x, body->v, body->g};
    for (int w = 0; w < 3; w++)
        for (int k = 0; k < body->n_active; k++) {
            int i = pal_body_point(body, k);
            if (pal_finite3(number[w] + 3 * (size_t)i)) continue;
            pal_body_stop(body, i, "its %s is not finite", what[w]);
            return;
        }
    pal_body_stop(body, -1, "%s", otherwise);
}
