/* Taubin smoothing with equal weights: "A signal processing approach to fair surface design", 1995. */
#include "server/mesh/geometry/smooth.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

/* one step: x += factor (mean of neighbours - x), sums [n_vertex][3] and degree [n_vertex] as scratch; on an oriented
 * closed surface every neighbour is the next corner of exactly one triangle */
static void step(pal_surface *s, double factor, double *sum, const int32_t *degree, const uint8_t *fixed)
{
    for (size_t i = 0; i < 3 * (size_t)s->n_vertex; i++) sum[i] = 0;
    for (size_t t = 0; t < (size_t)s->n_tri; t++) {
        const int32_t *c = s->tri + 3 * t;
        for (int k = 0; k < 3; k++) {
            double *r = sum + 3 * (size_t)c[k];
            pal_add3(r, r, s->x + 3 * (size_t)c[(k + 1) % 3]);
        }
    }
    for (size_t i = 0; i < (size_t)s->n_vertex; i++) {
        if (fixed[i] || degree[i] == 0) continue;
        for (size_t a = 0; a < 3; a++) s->x[3 * i + a] += factor * (sum[3 * i + a] / degree[i] - s->x[3 * i + a]);
    }
}

/* a vertex is fixed when its outgoing neighbours are not its incoming ones: it lies on an open or misoriented edge */
static void find_fixed(const pal_surface *s, int32_t *degree, int64_t *balance, uint8_t *fixed)
{
    for (int i = 0; i < s->n_vertex; i++) degree[i] = 0, balance[i] = 0;
    for (size_t t = 0; t < (size_t)s->n_tri; t++) {
        const int32_t *c = s->tri + 3 * t;
        for (int k = 0; k < 3; k++) {
            degree[c[k]]++;
            balance[c[k]] += (int64_t)c[(k + 1) % 3] - c[(k + 2) % 3];
        }
    }
    for (int i = 0; i < s->n_vertex; i++) fixed[i] = balance[i] != 0;
}

/* moves every vertex back to within its reach of its start along its normal there, and to within twice that
 * tangentially: sliding along the surface does not change the shape */
static void limit_displacement(pal_surface *s, const double *start, const double *normal, const double *reach_m)
{
    for (size_t i = 0; i < (size_t)s->n_vertex; i++) {
        const double *n = normal + 3 * i;
        double d[3], max = reach_m[i];
        pal_sub3(d, s->x + 3 * i, start + 3 * i);
        double along = pal_dot3(d, n);
        pal_axpy3(d, -along, n);
        double across = pal_norm3(d), part = across > 2 * max ? 2 * max / across : 1;
        pal_copy3(s->x + 3 * i, start + 3 * i);
        pal_axpy3(s->x + 3 * i, fmin(fmax(along, -max), max), n);
        pal_axpy3(s->x + 3 * i, part, d);
    }
}

pal_err pal_surface_smooth(pal_surface *surface, int rounds, const double *reach_m)
{
    size_t n = (size_t)surface->n_vertex;
    pal_err err = PAL_ERR_OK;
    double *sum, *start, *normal;
    int32_t *degree;
    int64_t *balance;
    uint8_t *fixed;
    PAL_ARRAY(&err, sum, 3 * n);
    PAL_ARRAY(&err, start, 3 * n);
    PAL_ARRAY(&err, normal, 3 * n);
    PAL_ARRAY(&err, degree, n);
    PAL_ARRAY(&err, balance, n);
    PAL_ARRAY(&err, fixed, n);
    if (!err) {
        memcpy(start, surface->x, 3 * n * sizeof *start);
        pal_surface_normals(surface, normal);
        find_fixed(surface, degree, balance, fixed);
        for (int k = 0; k < rounds; k++) {
            step(surface, SMOOTH_STEP, sum, degree, fixed);
            if (reach_m)
                limit_displacement(surface, start, normal, reach_m);
            else
                step(surface, SMOOTH_BACK, sum, degree, fixed);
        }
    }
    return PAL_FREED(err, sum, start, normal, degree, balance, fixed);
}
