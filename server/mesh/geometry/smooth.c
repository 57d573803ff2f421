/* Taubin smoothing with equal weights: "A signal processing approach to fair surface design", 1995. The pass band ends
 * at k = 1/0.5 - 1/0.53 = 0.11, so shapes longer than about ten edges keep their size. */
#include "server/mesh/geometry/smooth.h"

#include "server/base/vec3.h"

#include <stdlib.h>
#include <string.h>

static const double there = 0.5, back = -0.53;

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

/* relaxes when there is a reach, else smooths without shrinkage */
static pal_err run(pal_surface *surface, int rounds, const double *reach_m)
{
    size_t n = (size_t)surface->n_vertex + 1;
    double *sum = malloc(3 * n * sizeof *sum);
    int32_t *degree = malloc(n * sizeof *degree);
    int64_t *balance = malloc(n * sizeof *balance);
    uint8_t *fixed = malloc(n);
    double *start = malloc(6 * n * sizeof *start), *normal = start ? start + 3 * n : NULL;
    pal_err err = sum && degree && balance && fixed && start ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) {
        memcpy(start, surface->x, 3 * (size_t)surface->n_vertex * sizeof *start);
        pal_surface_normals(surface, normal);
        find_fixed(surface, degree, balance, fixed);
        for (int k = 0; k < rounds; k++) {
            step(surface, there, sum, degree, fixed);
            if (reach_m)
                limit_displacement(surface, start, normal, reach_m);
            else
                step(surface, back, sum, degree, fixed);
        }
    }
    free(start);
    free(sum);
    free(degree);
    free(balance);
    free(fixed);
    return err;
}

pal_err pal_surface_smooth(pal_surface *surface, int rounds)
{
    return run(surface, rounds, NULL);
}

pal_err pal_surface_relax(pal_surface *surface, int rounds, const double *reach_m)
{
    return run(surface, rounds, reach_m);
}
