/* Surfaces and motions for the protocol tests: a bumpy cube-sphere of any fineness and the deformations that the codec
 * must survive. All are exact functions of their arguments, so that results repeat. */
#ifndef TESTS_PROTOCOL_SHAPES_H
#define TESTS_PROTOCOL_SHAPES_H
#include "tests/fixtures/random.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct shape {
    uint32_t n_vertex, n_triangle;
    float *rest_m;      /* [n_vertex][3]   */
    uint32_t *triangle; /* [n_triangle][3] */
} shape;

static inline double shape_random(uint64_t *state) /* in [-1, 1) */
{
    return (double)(int32_t)(random_bits(state) >> 32) * 0x1p-31;
}

/* vertex of a lattice point on the surface of the cube [0, f]^3, made when new */
static inline uint32_t shape_vertex(shape *s, uint32_t *table, int f, const int *p)
{
    uint32_t *slot = &table[(p[0] * (f + 1) + p[1]) * (f + 1) + p[2]];
    if (*slot == 0) {
        double d[3], r = 0;
        for (int c = 0; c < 3; c++) d[c] = tan((2.0 * p[c] / f - 1) * 0.7853981633974483), r += d[c] * d[c];
        for (int c = 0; c < 3; c++) d[c] /= sqrt(r);
        r = 0.075 * (1 + 0.12 * sin(7 * d[0] + 1) * cos(5 * d[1]) + 0.08 * sin(11 * d[2] + 3 * d[0]));
        for (int c = 0; c < 3; c++) s->rest_m[3 * (size_t)s->n_vertex + (size_t)c] = (float)(r * d[c]);
        *slot = ++s->n_vertex;
    }
    return *slot - 1;
}

/* closed surface with 6 f^2 + 2 vertices in a box of about 0.18 m */
static inline shape shape_create(int f)
{
    size_t n = 6 * (size_t)f * (size_t)f + 2;
    shape s = {0, 0, malloc(3 * n * sizeof(float)), malloc(6 * n * sizeof(uint32_t))};
    uint32_t *table = calloc((size_t)(f + 1) * (size_t)(f + 1) * (size_t)(f + 1), sizeof *table);
    for (int face = 0; face < 6; face++)
        for (int i = 0; i < f; i++)
            for (int j = 0; j < f; j++) {
                uint32_t corner[4];
                for (int k = 0; k < 4; k++) {
                    int p[3], axis = face % 3, u = i + (k == 1 || k == 2), v = j + (k >= 2);
                    p[axis] = face < 3 ? f : 0;
                    p[(axis + 1) % 3] = face < 3 ? u : v;
                    p[(axis + 2) % 3] = face < 3 ? v : u;
                    corner[k] = shape_vertex(&s, table, f, p);
                }
                const uint32_t two[6] = {corner[0], corner[1], corner[2], corner[0], corner[2], corner[3]};
                memcpy(s.triangle + 3 * (size_t)s.n_triangle, two, sizeof two);
                s.n_triangle += 2;
            }
    free(table);
    return s;
}

static inline void shape_release(shape *s)
{
    free(s->rest_m);
    free(s->triangle);
}

typedef enum shape_motion {
    MOTION_REST,
    MOTION_BUMP,     /* an 8 mm dent that wanders, and 0.3 mm jiggle */
    MOTION_BEND,     /* bump and a bend of 10 degrees               */
    MOTION_NOISE,    /* bend and 0.02 mm white noise                */
    MOTION_LOCAL,    /* about 5 % of the vertices move              */
    MOTION_TELEPORT, /* jumps of up to 2 m                          */
    MOTION_STORM,    /* white noise of 20 mm: worst case for the prediction */
    MOTION_SPIKE,    /* every 37th vertex jumps by 30 mm: escape codes */
    MOTION_COUNT
} shape_motion;

/* position of frame k at 60 per second */
static inline void shape_move(const shape *s, shape_motion motion, int k, float *position_m)
{
    double t = k / 60.0, centre[3] = {0.07 * cos(2 * t), 0.07 * sin(2 * t), 0.03 * sin(3 * t)};
    uint64_t random = 77 + (uint64_t)k * 1000003;
    for (size_t i = 0; i < s->n_vertex; i++) {
        double x[3], d2 = 0;
        for (size_t c = 0; c < 3; c++) x[c] = (double)s->rest_m[3 * i + c];
        for (int c = 0; c < 3; c++) d2 += (x[c] - centre[c]) * (x[c] - centre[c]);
        double width = motion == MOTION_LOCAL ? 0.012 : 0.03, dent = 0.008 * exp(-d2 / (width * width));
        if (motion == MOTION_LOCAL && dent < 1e-5) dent = 0;
        if (motion == MOTION_REST || motion >= MOTION_TELEPORT) dent = 0;
        for (int c = 0; c < 3; c++) x[c] -= dent * centre[c] / 0.075;
        if (motion == MOTION_BUMP || motion == MOTION_BEND || motion == MOTION_NOISE)
            x[2] += 3e-4 * sin(40 * x[0] + 9 * t) * cos(35 * x[1]);
        if (motion == MOTION_BEND || motion == MOTION_NOISE) {
            double angle = 0.1745 * sin(t) * x[2] / 0.075, cosine = cos(angle), sine = sin(angle);
            double a = x[0] * cosine - x[1] * sine;
            x[1] = x[0] * sine + x[1] * cosine;
            x[0] = a;
        }
        double noise = motion == MOTION_NOISE ? 2e-5 : motion == MOTION_STORM ? 0.02 : 0;
        for (int c = 0; c < 3 && noise > 0; c++) x[c] += noise * shape_random(&random);
        if (motion == MOTION_TELEPORT) x[k % 3] += 2.0 * sin(17.0 * k);
        if (motion == MOTION_SPIKE && (i + (size_t)k) % 37 == 0) x[i % 3] += 0.03;
        for (size_t c = 0; c < 3; c++) position_m[3 * i + c] = (float)x[c];
    }
}

/* a shape with the midpoints of its edges, level by level; vertices of the coarse one keep their numbers */
typedef struct shape_family {
    shape fine;
    uint32_t n_coarse;
    uint32_t *parent; /* of vertex n_coarse + i [..][2] */
} shape_family;

static inline uint32_t shape_midpoint(shape_family *f, uint32_t *table, uint32_t n_before, uint32_t a, uint32_t b)
{
    uint32_t *slot = &table[(size_t)(a < b ? a : b) * n_before + (a < b ? b : a)];
    if (*slot == 0) {
        uint32_t v = f->fine.n_vertex++;
        float *x = f->fine.rest_m;
        for (size_t c = 0; c < 3; c++) x[3 * (size_t)v + c] = 0.5f * (x[3 * (size_t)a + c] + x[3 * (size_t)b + c]);
        f->parent[2 * (size_t)(v - f->n_coarse)] = a;
        f->parent[2 * (size_t)(v - f->n_coarse) + 1] = b;
        *slot = v;
    }
    return *slot;
}

static inline shape_family shape_family_create(int fineness, int n_level)
{
    shape s = shape_create(fineness);
    size_t max = 4 * (size_t)s.n_vertex;
    for (int l = 1; l < n_level; l++) max *= 4;
    shape_family f = {{s.n_vertex, s.n_triangle, malloc(3 * max * sizeof(float)), malloc(6 * max * sizeof(uint32_t))},
                      s.n_vertex,
                      malloc(2 * max * sizeof(uint32_t))};
    memcpy(f.fine.rest_m, s.rest_m, 3 * (size_t)s.n_vertex * sizeof(float));
    memcpy(f.fine.triangle, s.triangle, 3 * (size_t)s.n_triangle * sizeof(uint32_t));
    for (int l = 1; l < n_level; l++) {
        uint32_t n_before = f.fine.n_vertex, n_tri = f.fine.n_triangle, *t = f.fine.triangle;
        uint32_t *table = calloc((size_t)n_before * n_before, sizeof *table);
        for (uint32_t i = n_tri; i-- > 0;) {
            uint32_t v[3], m[3];
            memcpy(v, t + 3 * (size_t)i, sizeof v);
            for (int c = 0; c < 3; c++) m[c] = shape_midpoint(&f, table, n_before, v[c], v[(c + 1) % 3]);
            const uint32_t four[12] = {v[0], m[0], m[2], m[0], v[1], m[1], m[2], m[1], v[2], m[0], m[1], m[2]};
            memcpy(t + 12 * (size_t)i, four, sizeof four);
        }
        f.fine.n_triangle = 4 * n_tri;
        free(table);
    }
    free(s.rest_m);
    free(s.triangle);
    return f;
}
#endif
