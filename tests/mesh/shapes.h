/* Surfaces made in the tests: each is taken from the heap (pal_surface_free) and closed and outward unless its name
 * says otherwise. Sizes in metres. */
#ifndef TESTS_MESH_SHAPES_H
#define TESTS_MESH_SHAPES_H
#include "server/mesh/surface.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define SHAPE_PI 3.14159265358979323846

static inline pal_surface shape_room(int n_vertex, int n_tri)
{
    pal_surface s = {.n_vertex = n_vertex, .n_tri = n_tri};
    s.x = malloc((size_t)n_vertex * 3 * sizeof *s.x);
    s.tri = malloc((size_t)n_tri * 3 * sizeof *s.tri);
    if (!s.x || !s.tri) abort();
    return s;
}

/* axis-aligned box of 12 triangles */
static inline pal_surface shape_box(const double low[3], const double high[3])
{
    static const int32_t TRI[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    pal_surface s = shape_room(8, 12);
    for (int v = 0; v < 8; v++)
        for (int k = 0; k < 3; k++) s.x[3 * v + k] = v >> k & 1 ? high[k] : low[k];
    memcpy(s.tri, TRI, sizeof TRI);
    return s;
}

static inline pal_surface shape_cube(double edge)
{
    double low[3] = {-edge / 2, -edge / 2, -edge / 2}, high[3] = {edge / 2, edge / 2, edge / 2};
    return shape_box(low, high);
}

static inline pal_surface shape_octahedron(double radius)
{
    static const int32_t TRI[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                      {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    pal_surface s = shape_room(6, 8);
    memset(s.x, 0, 18 * sizeof *s.x);
    for (int v = 0; v < 6; v++) s.x[3 * v + v / 2] = v & 1 ? -radius : radius;
    memcpy(s.tri, TRI, sizeof TRI);
    return s;
}

/* grid of quads around two angles; torus when both wrap */
static inline pal_surface shape_torus(double ring, double tube, int n_ring, int n_tube)
{
    pal_surface s = shape_room(n_ring * n_tube, 2 * n_ring * n_tube);
    int32_t *to = s.tri;
    for (int i = 0; i < n_ring; i++)
        for (int j = 0; j < n_tube; j++) {
            double a = 2 * SHAPE_PI * i / n_ring, b = 2 * SHAPE_PI * j / n_tube, r = ring + tube * cos(b);
            double *x = s.x + 3 * (i * n_tube + j);
            x[0] = r * cos(a), x[1] = r * sin(a), x[2] = tube * sin(b);
            int i1 = (i + 1) % n_ring, j1 = (j + 1) % n_tube;
            int32_t p = i * n_tube + j, q = i1 * n_tube + j, u = i1 * n_tube + j1, w = i * n_tube + j1;
            int32_t two[6] = {p, q, u, p, u, w};
            memcpy(to, two, sizeof two);
            to += 6;
        }
    return s;
}

/* latitude-longitude ball with bumps: radius (1 + bump sin(5 a) sin(3 b)^2); n_ring >= 3, n_band >= 2 */
static inline pal_surface shape_ball(double radius, int n_ring, int n_band, double bump)
{
    int n_inner = n_band - 1;
    pal_surface s = shape_room(n_ring * n_inner + 2, 2 * n_ring * n_inner);
    int32_t *to = s.tri, south = n_ring * n_inner, north = south + 1;
    for (int j = 0; j < n_inner; j++)
        for (int i = 0; i < n_ring; i++) {
            double a = 2 * SHAPE_PI * i / n_ring, b = SHAPE_PI * (j + 1) / n_band, wave = sin(3 * b);
            double r = radius * (1 + bump * sin(5 * a) * wave * wave), *x = s.x + 3 * (j * n_ring + i);
            x[0] = r * sin(b) * cos(a), x[1] = r * sin(b) * sin(a), x[2] = -r * cos(b);
        }
    for (int k = 0; k < 3; k++) s.x[3 * south + k] = k == 2 ? -radius : 0, s.x[3 * north + k] = k == 2 ? radius : 0;
    for (int i = 0; i < n_ring; i++) {
        int i1 = (i + 1) % n_ring;
        int32_t caps[6] = {south, i1, i, north, (n_inner - 1) * n_ring + i, (n_inner - 1) * n_ring + i1};
        memcpy(to, caps, sizeof caps);
        to += 6;
        for (int j = 0; j + 1 < n_inner; j++) {
            int32_t p = j * n_ring + i, q = j * n_ring + i1, u = p + n_ring, w = q + n_ring;
            int32_t two[6] = {p, q, w, p, w, u};
            memcpy(to, two, sizeof two);
            to += 6;
        }
    }
    return s;
}

static inline pal_surface shape_sphere(double radius)
{
    return shape_ball(radius, 48, 24, 0);
}

/* a followed by b, both freed */
static inline pal_surface shape_join(pal_surface a, pal_surface b)
{
    pal_surface s = shape_room(a.n_vertex + b.n_vertex, a.n_tri + b.n_tri);
    memcpy(s.x, a.x, (size_t)a.n_vertex * 3 * sizeof *s.x);
    memcpy(s.x + 3 * (size_t)a.n_vertex, b.x, (size_t)b.n_vertex * 3 * sizeof *s.x);
    memcpy(s.tri, a.tri, (size_t)a.n_tri * 3 * sizeof *s.tri);
    for (int i = 0; i < 3 * b.n_tri; i++) s.tri[3 * a.n_tri + i] = b.tri[i] + a.n_vertex;
    pal_surface_free(&a);
    pal_surface_free(&b);
    return s;
}

static inline void shape_move(pal_surface *s, double x, double y, double z)
{
    for (int v = 0; v < s->n_vertex; v++) s->x[3 * v] += x, s->x[3 * v + 1] += y, s->x[3 * v + 2] += z;
}

/* turned inside out */
static inline void shape_invert(pal_surface *s)
{
    for (int t = 0; t < s->n_tri; t++) {
        int32_t swap = s->tri[3 * t];
        s->tri[3 * t] = s->tri[3 * t + 1];
        s->tri[3 * t + 1] = swap;
    }
}

/* drops triangles whose centroid lies above the plane z = height */
static inline void shape_cut(pal_surface *s, double height)
{
    int n = 0;
    for (int t = 0; t < s->n_tri; t++) {
        double z = 0;
        for (int k = 0; k < 3; k++) z += s->x[3 * s->tri[3 * t + k] + 2] / 3;
        if (z > height) continue;
        memmove(s->tri + 3 * n++, s->tri + 3 * t, 3 * sizeof *s->tri);
    }
    s->n_tri = n;
}

/* every triangle gets three vertices of its own */
static inline void shape_unweld(pal_surface *s)
{
    double *x = malloc((size_t)s->n_tri * 9 * sizeof *x);
    if (!x) abort();
    for (int i = 0; i < 3 * s->n_tri; i++) {
        memcpy(x + 3 * i, s->x + 3 * s->tri[i], 3 * sizeof *x);
        s->tri[i] = i;
    }
    free(s->x);
    s->x = x;
    s->n_vertex = 3 * s->n_tri;
}

static inline uint64_t shape_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return *state >> 33;
}

/* uniform in -1..1 */
static inline double shape_uniform(uint64_t *state)
{
    return (double)shape_random(state) / (double)(1u << 30) - 1;
}

/* rotated about the origin by a random unit quaternion */
static inline void shape_rotate(pal_surface *s, uint64_t *state)
{
    double q[4], n = 0;
    do {
        n = 0;
        for (int k = 0; k < 4; k++) q[k] = shape_uniform(state), n += q[k] * q[k];
    } while (n > 1 || n < 0.01);
    for (int k = 0; k < 4; k++) q[k] /= sqrt(n);
    for (int v = 0; v < s->n_vertex; v++) {
        double *x = s->x + 3 * v, t[3];
        t[0] = 2 * (q[2] * x[2] - q[3] * x[1]), t[1] = 2 * (q[3] * x[0] - q[1] * x[2]),
        t[2] = 2 * (q[1] * x[1] - q[2] * x[0]);
        double y[3] = {x[0] + q[0] * t[0] + q[2] * t[2] - q[3] * t[1], x[1] + q[0] * t[1] + q[3] * t[0] - q[1] * t[2],
                       x[2] + q[0] * t[2] + q[1] * t[1] - q[2] * t[0]};
        memcpy(x, y, sizeof y);
    }
}
#endif
