/* Subdivided solids with a row cell_elastic, without a world: nodes are set directly, no point carries them. */
#ifndef TESTS_SIM_CELL_BODIES_H
#define TESTS_SIM_CELL_BODIES_H
#include "server/base/vec3.h"
#include "server/sim/cell_kernel.h"
#include "server/sim/effect_list.h"
#include "tests/mesh/solids.h"

typedef struct cell_body {
    pal_cells cells;
    pal_scene *scene;
    pal_body_def *def;
    pal_solid *solid;
    pal_body body;
    pal_arena *arena;
    pal_item item;
    pal_note note;
    pal_step step;
    pal_cells_elastic *row;
} cell_body;

static const pal_effect *const cell_effect = &pal_effect_cell_elastic;

/* cells become the body's */
static inline void cell_begin(cell_body *b, pal_cells cells)
{
    memset(b, 0, sizeof *b);
    b->cells = cells;
    b->scene = calloc(1, sizeof *b->scene);
    b->arena = pal_arena_create(1 << 20, true);
    if (!b->scene || !b->arena) abort();
    pal_scene_default(b->scene);
    b->def = &b->scene->body[0];
    pal_body_default(b->def, "solid", NULL);
    b->def->cells = &b->cells;
    b->def->material.young_Pa = 1000, b->def->material.poisson = 0.3;
    pal_item_init(&b->item, "model", "cell_elastic");
}
/* after material and keys were set */
static inline pal_err cell_make(cell_body *b, int n_level)
{
    const pal_subdivision_options options = {.n_level = n_level};
    void *self = NULL;
    pal_body *body = &b->body;
    if (pal_solid_make(b->def, &options, &b->solid, &b->note)) {
        CHECK_FAIL("%s", b->note.text);
        exit(1);
    }
    if (pal_body_allocate_embedded(body, b->arena, &b->solid->rows)) abort();
    memcpy(body->node_rest, b->solid->node_rest, 3 * sizeof(double) * (size_t)body->n_node);
    memcpy(body->d, b->solid->node_rest, 3 * sizeof(double) * (size_t)body->n_node);
    body->solid = b->solid;
    pal_build build = {.scene = b->scene, .def = b->def, .body = body, .arena = b->arena, .note = &b->note};
    pal_err err = cell_effect->make(&b->item, &build, &self);
    b->row = self;
    b->step = (pal_step){.body = body, .dt_s = 0.01};
    return err;
}
static inline void cell_free(cell_body *b)
{
    pal_solid_free(b->solid);
    pal_cells_free(&b->cells);
    pal_arena_destroy(b->arena);
    free(b->scene);
    memset(b, 0, sizeof *b);
}
static inline void cell_must(cell_body *b, pal_cells cells, int n_level)
{
    cell_begin(b, cells);
    if (cell_make(b, n_level)) CHECK_FAIL("%s", b->note.text);
}

/* a cube cut into eight pyramids' worth of parts: 24 hexahedra and 48 pyramids round the middle after a level */
static inline pal_cells cell_pyramids(void)
{
    pal_cells c = solid_pyramids();
    solid_jitter(&c, 0.05, 3);
    return c;
}
/* one cubic element in the middle of 26 hexahedra, on a jittered lattice of edge 1 */
static inline pal_cells cell_lattice(double jitter)
{
    pal_cells c = solid_block(3, 3, 3);
    solid_jitter(&c, jitter, 5);
    return c;
}
/* what there is in each kind, for loops over all: a hexahedron, a cubic element with 26 hexahedra, pyramids, a mix */
enum { CELL_BODIES = 4 };
static inline void cell_nth(cell_body *b, int i)
{
    pal_cells c = i == 0   ? solid_block(1, 1, 1)
                  : i == 1 ? cell_lattice(0.1)
                  : i == 2 ? cell_pyramids()
                           : solid_block(2, 1, 1);
    if (i == 0 || i == 3) solid_jitter(&c, 0.15, 7);
    cell_must(b, c, i < 2 ? 0 : i == 2 ? 1 : 2);
}

/* leaves elements of other kinds out */
static inline void cell_only(cell_body *b, pal_cell_kind kind)
{
    for (pal_cell_kind k = 0; k < PAL_CELL_KINDS; k++)
        if (k != kind) b->row->group[k].n = b->row->group[k].n_block = 0;
}

static inline const double *cell_force(cell_body *b)
{
    memset(b->body.f, 0, 3 * sizeof(double) * (size_t)b->body.n_node);
    cell_effect->run(b->row, &b->step);
    return b->body.f;
}
/* net force and net torque about the origin, over the sums of the lengths of what adds up to them */
static inline void cell_net(cell_body *b, double *force, double *torque)
{
    double f_sum[3] = {0, 0, 0}, t_sum[3] = {0, 0, 0}, size = 0, lever = 0, c[3];
    const double *f = cell_force(b);
    for (int m = 0; m < b->body.n_node; m++) {
        pal_add3(f_sum, f_sum, f + 3 * m);
        pal_cross3(c, b->body.d + 3 * m, f + 3 * m);
        pal_add3(t_sum, t_sum, c);
        size += pal_norm3(f + 3 * m), lever += pal_norm3(c);
    }
    *force = pal_norm3(f_sum) / size, *torque = pal_norm3(t_sum) / lever;
}
static inline double cell_energy(cell_body *b)
{
    return cell_effect->energy(b->row, &b->body);
}
/* d = A X + t */
static inline void cell_map(cell_body *b, const double a[9], double t)
{
    for (int i = 0; i < b->body.n_node; i++) {
        const double *x = b->body.node_rest + 3 * i;
        for (int c = 0; c < 3; c++) b->body.d[3 * i + c] = pal_dot3(a + 3 * c, x) + t;
    }
}
/* d += noise of so many m */
static inline void cell_shake(cell_body *b, double amount, uint64_t seed)
{
    for (int i = 0; i < 3 * b->body.n_node; i++) b->body.d[i] += amount * (2 * pal_random_unit(seed, (uint64_t)i) - 1);
}
/* a turn by angle about (1, 2, 3) */
static inline void cell_rotation(double angle, double r[9])
{
    double n = sqrt(14), s = sin(angle / 2), q[4] = {cos(angle / 2), s / n, 2 * s / n, 3 * s / n};
    double w = q[0], x = q[1], y = q[2], z = q[3];
    const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(r, m, sizeof m);
}
static inline double cell_largest(const double *a, int n)
{
    double most = 0;
    for (int i = 0; i < n; i++) {
        if (!(fabs(a[i]) <= 1e300)) return INFINITY;
        most = fmax(most, fabs(a[i]));
    }
    return most;
}
static inline double cell_dot(const double *a, const double *b, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}
#endif
