/* Bodies of voxels with a row hex_elastic, without a world: any set of voxels of a lattice, cubes and their
 * five-tetrahedra split, as `pal_build` gives them to the row. */
#ifndef TESTS_SIM_HEX_BODIES_H
#define TESTS_SIM_HEX_BODIES_H
#include "boxes.h"
#include "server/sim/effect_list.h"
#include "server/sim/elastic_hex.h"
#include "tests/check.h"

typedef struct hex_body {
    pal_tets tets;
    pal_hexes hexes;
    pal_scene *scene;
    pal_body_def *def;
    pal_body body;
    pal_arena *arena;
    pal_item item;
    pal_note note;
    pal_step step;
    pal_hex_row *row;
} hex_body;

static const pal_effect *const hex_effect = &pal_effect_hex_elastic;

static inline double *hex_zeros(int n)
{
    double *a = n > 0 ? calloc((size_t)n, sizeof *a) : NULL;
    if (!a) abort();
    return a;
}

/* voxels of the box n that `keep` wants, edge h; NULL: all */
static inline void hex_body_begin(hex_body *b, const int n[3], bool (*keep)(int, int, int), double h_m)
{
    const int n_all = (n[0] + 1) * (n[1] + 1) * (n[2] + 1), n_box = n[0] * n[1] * n[2];
    memset(b, 0, sizeof *b);
    int32_t *name = malloc(sizeof *name * (size_t)n_all);
    b->tets.x = calloc(3 * (size_t)n_all, sizeof(double));
    b->tets.tet = calloc(20 * (size_t)n_box, sizeof *b->tets.tet);
    b->tets.h_m = h_m;
    b->hexes.node = calloc(8 * (size_t)n_box, sizeof *b->hexes.node);
    b->hexes.fill = calloc((size_t)n_box, sizeof *b->hexes.fill);
    b->scene = calloc(1, sizeof *b->scene);
    b->arena = pal_arena_create(1 << 20, true);
    if (!name || !b->tets.x || !b->tets.tet || !b->hexes.node || !b->hexes.fill || !b->scene || !b->arena) abort();
    for (int i = 0; i < n_all; i++) name[i] = -1;
    for (int v = 0; v < n_box; v++) {
        int i = v % n[0], j = v / n[0] % n[1], k = v / n[0] / n[1];
        if (keep && !keep(i, j, k)) continue;
        int32_t five[5][4], *corner = b->hexes.node + 8 * b->hexes.n_hex;
        for (int c = 0; c < 8; c++) {
            int at[3] = {i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)}, all = box_node(n, at[0], at[1], at[2]);
            if (name[all] < 0) {
                name[all] = b->tets.n_node++;
                for (int q = 0; q < 3; q++) b->tets.x[3 * name[all] + q] = h_m * at[q];
            }
            corner[c] = name[all];
        }
        b->hexes.fill[b->hexes.n_hex++] = 1;
        box_split(n, i, j, k, five);
        for (int q = 0; q < 20; q++) b->tets.tet[4 * b->tets.n_tet + q] = name[five[q / 4][q % 4]];
        b->tets.n_tet += 5;
    }
    free(name);
    pal_scene_default(b->scene);
    b->def = &b->scene->body[0];
    pal_body_default(b->def, "voxels", NULL);
    pal_item_init(&b->item, "model", "hex_elastic");
}

/* makes the row, after keys, fill, material and regions were set */
static inline pal_err hex_body_make(hex_body *b)
{
    pal_body *body = &b->body;
    if (pal_body_allocate(body, b->arena, b->tets.n_node)) abort();
    memcpy(body->x_rest, b->tets.x, 3 * sizeof(double) * (size_t)body->n_node);
    memcpy(body->x, b->tets.x, 3 * sizeof(double) * (size_t)body->n_node);
    body->tets = &b->tets, body->hexes = &b->hexes, body->h_m = b->tets.h_m, body->implicit = true;
    for (int i = 0; i < body->n_node; i++) body->mass_kg[i] = 1;
    pal_build build = {.scene = b->scene, .def = b->def, .body = body, .arena = b->arena, .note = &b->note};
    void *self = NULL;
    pal_err err = hex_effect->make(&b->item, &build, &self);
    b->row = self;
    b->step = (pal_step){.body = body, .dt_s = 0.01};
    return err;
}

static inline void hex_body_free(hex_body *b)
{
    free(b->tets.x), free(b->tets.tet), free(b->hexes.node), free(b->hexes.fill), free(b->scene);
    pal_arena_destroy(b->arena);
    memset(b, 0, sizeof *b);
}

/* body->f = force at body->x */
static inline const double *hex_force(hex_body *b)
{
    memset(b->body.f, 0, 3 * sizeof(double) * (size_t)b->body.n_node);
    hex_effect->run(b->row, &b->step);
    return b->body.f;
}
static inline double hex_energy(hex_body *b)
{
    return hex_effect->energy(b->row, &b->body);
}

/* the same numbers everywhere, in [-1, 1] */
static inline double hex_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)*state / 9223372036854775808.0;
}
/* x = rest + noise of so many edges */
static inline void hex_shake(hex_body *b, double edges, uint64_t seed)
{
    for (int i = 0; i < 3 * b->body.n_node; i++)
        b->body.x[i] = b->body.x_rest[i] + edges * b->tets.h_m * hex_random(&seed);
}
static inline double hex_largest(const double *a, int n)
{
    double most = 0;
    for (int i = 0; i < n; i++) most = fabs(a[i]) > most ? fabs(a[i]) : most;
    return most;
}
static inline double hex_farthest(const double *a, const double *b, int n)
{
    double most = 0;
    for (int i = 0; i < n; i++) {
        if (!(fabs(a[i] - b[i]) <= 1e300)) return INFINITY;
        most = fabs(a[i] - b[i]) > most ? fabs(a[i] - b[i]) : most;
    }
    return most;
}
/* a set with holes, single voxels, edges in all directions */
static inline bool hex_irregular(int i, int j, int k)
{
    return (i * 7 + j * 5 + k * 3 + i * j * k) % 4 != 0 || (i + j + k) % 5 == 0;
}

/* K x = b on the nodes that are free, by conjugate gradients through multiply; the others keep their x */
static inline void hex_solve(hex_body *b, const uint8_t *free_node, double shift, const double *rhs, double *x)
{
    int n = 3 * b->body.n_node;
    double *r = hex_zeros(n), *p = hex_zeros(n), *q = hex_zeros(n);
    double rr = 0, first = 0;
    memset(q, 0, sizeof *q * (size_t)n);
    hex_effect->tangent->multiply(b->row, &b->body, 1, 0, x, q);
    for (int i = 0; i < n; i++) {
        r[i] = free_node[i / 3] ? rhs[i] - q[i] - shift * x[i] : 0;
        p[i] = r[i];
        rr += r[i] * r[i];
    }
    first = rr;
    for (int it = 0; it < 600 && rr > 1e-28 * first; it++) {
        double pq = 0, next = 0;
        memset(q, 0, sizeof *q * (size_t)n);
        hex_effect->tangent->multiply(b->row, &b->body, 1, 0, p, q);
        for (int i = 0; i < n; i++) q[i] = free_node[i / 3] ? q[i] + shift * p[i] : 0, pq += p[i] * q[i];
        if (!(pq > 0)) break;
        for (int i = 0; i < n; i++) {
            x[i] += rr / pq * p[i];
            r[i] -= rr / pq * q[i];
            next += r[i] * r[i];
        }
        for (int i = 0; i < n; i++) p[i] = r[i] + next / rr * p[i];
        rr = next;
    }
    free(r), free(p), free(q);
}
#endif
