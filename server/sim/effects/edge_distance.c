/* Row edge_distance: every edge keeps its length. C = (l - l0)/l0, E = k/2 C^2, f_i = +(k C + c C') (d/l)/l0 and the
 * opposite on j, d from i to j (paper B 4.1, F_D).
 *
 * Departures: erratum B1 (the paper's force lacks 1/l0^2). An edge shorter than 1e-9 S has no direction and takes its
 * rest direction, so that a body collapsed to a plane or a point opens again. */
#include "server/base/vec3.h"
#include "server/sim/effect_list.h"
#include "server/sim/spring_law.h"

#include <stdlib.h>

enum { CHUNK = PAL_SPRING_CHUNK };

typedef struct edge_distance {
    pal_spring spring;
    int n_edge;
    size_t n_padded;
    int32_t *a, *b;  /* ends, index of their x coordinate           [n_padded] */
    double *inv_l0;  /* 1 / rest length, 1/m; 0 on padding          [n_padded] */
    double *node_w2; /* sum of 2 / l0^2 over the edges of each node [n_dof]    */
    double least_m;
} edge_distance;

static pal_err fill(edge_distance *row, const pal_build *build, const int32_t *edge, int n_edge)
{
    const pal_body *body = build->body;
    row->n_padded = pal_spring_padded(n_edge);
    row->a = PAL_NEW(build->arena, int32_t, row->n_padded);
    row->b = PAL_NEW(build->arena, int32_t, row->n_padded);
    row->inv_l0 = PAL_NEW(build->arena, double, row->n_padded);
    row->node_w2 = PAL_NEW(build->arena, double, body->n_dof);
    if (!row->a || !row->b || !row->inv_l0 || !row->node_w2) return PAL_ERR_MEMORY;
    row->least_m = 1e-9 * body->size_m;
    for (int e = 0; e < n_edge; e++) {
        int i = edge[2 * e], j = edge[2 * e + 1];
        double l0 = pal_dist3(body->x_rest + 3 * i, body->x_rest + 3 * j);
        if (!(l0 > row->least_m)) continue;
        row->a[row->n_edge] = 3 * i;
        row->b[row->n_edge] = 3 * j;
        row->inv_l0[row->n_edge++] = 1 / l0;
        row->node_w2[i] += 2 / (l0 * l0);
        row->node_w2[j] += 2 / (l0 * l0);
    }
    return PAL_ERR_OK;
}

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    edge_distance *row = PAL_NEW(build->arena, edge_distance, 1);
    if (!row) return PAL_ERR_MEMORY;
    PAL_TRY(pal_spring_read(PAL_SPRING_DISTANCE, item, build, &row->spring));
    int32_t *edge;
    int n_edge;
    PAL_TRY(pal_tets_edges(build->body->tets, &edge, &n_edge));
    pal_err err = fill(row, build, edge, n_edge);
    free(edge);
    *self = row;
    return err;
}

/* a chunk's forces on the ends a; returns how many edges are too short for a direction */
static inline int compute(const edge_distance *row, const pal_body *body, size_t first, bool damped, double f[3][CHUNK])
{
    const int32_t *a = row->a + first, *b = row->b + first;
    const double *inv = row->inv_l0 + first, *x = body->d, *v = body->dv;
    double k = row->spring.k_J, c = row->spring.c_Js, least = row->least_m;
    int n_short = 0;
    for (int l = 0; l < CHUNK; l++) {
        int i = a[l], j = b[l];
        double dx = x[j] - x[i], dy = x[j + 1] - x[i + 1], dz = x[j + 2] - x[i + 2], w = inv[l];
        double length = sqrt(dx * dx + dy * dy + dz * dz);
        bool is_short = !(length > least);
        double inv_l = 1 / (is_short ? 1.0 : length);
        double p = k * (length * w - 1);
        if (damped) p += c * w * inv_l * (dx * (v[j] - v[i]) + dy * (v[j + 1] - v[i + 1]) + dz * (v[j + 2] - v[i + 2]));
        double s = is_short ? 0.0 : p * w * inv_l;
        f[0][l] = s * dx, f[1][l] = s * dy, f[2][l] = s * dz;
        n_short += is_short;
    }
    return n_short;
}

static void reopen(const edge_distance *row, const pal_body *body, size_t first, double f[3][CHUNK])
{
    for (size_t l = 0; l < CHUNK; l++) {
        double w = row->inv_l0[first + l], d[3], rest[3];
        int i = row->a[first + l], j = row->b[first + l];
        if (w == 0) continue;
        pal_sub3(d, body->d + j, body->d + i);
        double length = pal_norm3(d);
        if (length > row->least_m) continue;
        pal_sub3(rest, body->x_rest + j, body->x_rest + i);
        double s = row->spring.k_J * (length * w - 1) * w * w;
        for (int c = 0; c < 3; c++) f[c][l] = s * rest[c];
    }
}

static pal_err run(void *self, pal_step *step)
{
    const edge_distance *row = self;
    const pal_body *body = step->body;
    double *force = body->f, f[3][CHUNK];
    for (size_t first = 0; first < row->n_padded; first += CHUNK) {
        int n_short = row->spring.c_Js > 0 ? compute(row, body, first, true, f) : compute(row, body, first, false, f);
        if (n_short > 0) reopen(row, body, first, f);
        for (size_t l = 0; l < CHUNK; l++) {
            double *fa = force + row->a[first + l], *fb = force + row->b[first + l];
            for (int c = 0; c < 3; c++) fa[c] += f[c][l], fb[c] -= f[c][l];
        }
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const edge_distance *row = self;
    double sum = 0;
    for (int e = 0; e < row->n_edge; e++) {
        double c = pal_dist3(body->d + row->a[e], body->d + row->b[e]) * row->inv_l0[e] - 1;
        sum += 0.5 * row->spring.k_J * c * c;
    }
    return sum;
}

/* |g| = 1/l0 at both ends; the part across the edge, k C/(l l0), never exceeds it when l > l0 and is no stiffness when
 * l < l0 */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const edge_distance *row = self;
    for (int i = 0; i < body->n_dof; i++) bound_N_m[i] += row->spring.k_J * row->node_w2[i];
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    const edge_distance *row = self;
    for (int i = 0; i < body->n_dof; i++) bound_Ns_m[i] += row->spring.c_Js * row->node_w2[i];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_note *note)
{
    (void)note;
    pal_spring_material(&((edge_distance *)self)->spring, body, to);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_edge_distance = {.name = "edge_distance",
                                             .stage = PAL_STAGE_FORCE,
                                             .internal = true,
                                             .make = make,
                                             .run = run,
                                             .energy = energy,
                                             .stiffness = stiffness,
                                             .damping = damping,
                                             .material = material};
