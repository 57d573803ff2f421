/* Bodies on subdivided solids for tests of what moves their control points: body arrays, masses, no model. */
#ifndef TESTS_SIM_SOLID_BODIES_H
#define TESTS_SIM_SOLID_BODIES_H
#include "server/mesh/cell_shapes.h"
#include "server/sim/effect_list.h"
#include "server/sim/solid.h"
#include "server/sim/solid_mass.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct solid_test {
    pal_cells cells;
    pal_body_def def;
    pal_scene scene;
    pal_arena *arena;
    pal_solid *solid;
    pal_solid_mass mass;
    pal_body body;
    uint64_t seed;
} solid_test;

static inline double solid_uniform(solid_test *t) /* in [-1, 1) */
{
    return check_random(&t->seed);
}

/* a block of n x n x n cells with edge size_m, corners moved at random by up to `crooked` of a cell */
static inline void solid_block(solid_test *t, int n, double size_m, double crooked)
{
    pal_note note = {{0}};
    memset(t, 0, sizeof *t);
    t->seed = 11;
    if (pal_cells_block((const int32_t[3]){n, n, n}, (const double[3]){size_m, size_m, size_m}, &t->cells, &note))
        abort();
    for (int i = 0; i < 3 * t->cells.n_vertex; i++) t->cells.x[i] += crooked * size_m / n * solid_uniform(t);
}

/* a brick of edge size_m with a pyramid on top: its apex, where four faces meet, gives pyramids */
static inline void solid_house(solid_test *t, double size_m)
{
    static double x[9][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},    {0, 0, 1},
                             {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {.5, .5, 1.8}};
    static int32_t cell[] = {0, 6, 11}, loop[] = {0, 4, 8, 12, 16, 20, 24, 28, 31, 34, 37, 40},
                   corner[] = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6,
                               3, 0, 4, 7, 4, 7, 6, 5, 4, 5, 8, 5, 6, 8, 6, 7, 8, 7, 4, 8};
    pal_cell_loops l = {.n_vertex = 9, .n_cell = 2, .x = &x[0][0], .cell = cell, .loop = loop, .corner = corner};
    pal_note note = {{0}};
    memset(t, 0, sizeof *t);
    t->seed = 11;
    if (pal_cells_make(&l, &t->cells, &note)) printf("  %s\n", note.text), abort();
    for (int i = 0; i < 27; i++) t->cells.x[i] *= size_m;
}

/* after n_level levels: solid, body arrays at rest, masses */
static inline bool solid_open(solid_test *t, int n_level)
{
    pal_note note = {{0}};
    pal_scene_default(&t->scene);
    pal_body_default(&t->def, "solid", NULL);
    t->def.cells = &t->cells;
    t->arena = pal_arena_create(1 << 20, true);
    if (pal_solid_make(&t->def, &(pal_subdivision_options){.n_level = n_level}, &t->solid, &note)) {
        printf("  %s\n", note.text);
        return false;
    }
    pal_body *b = &t->body;
    if (pal_body_allocate_embedded(b, t->arena, &t->solid->rows)) abort();
    if (pal_solid_mass_make(t->solid, t->arena, &t->mass)) abort();
    b->name = "solid", b->solid = t->solid, b->solid_mass = &t->mass;
    memcpy(b->x, t->cells.x, 3 * sizeof(double) * (size_t)b->n_dof);
    memcpy(b->x_rest, t->cells.x, 3 * sizeof(double) * (size_t)b->n_dof);
    memcpy(b->node_rest, t->solid->node_rest, 3 * sizeof(double) * (size_t)b->n_node);
    pal_solid_mass_lump(t->solid, b->mass_kg, b->node_mass_kg);
    b->size_m = 1.7 * cbrt(pal_solid_volume_m3(t->solid));
    b->h_m = cbrt(pal_solid_volume_m3(t->solid) / pal_cell_elements_count(&t->solid->elements));
    b->load_cap_N = INFINITY;
    pal_body_place(b);
    return true;
}

static inline void solid_close(solid_test *t)
{
    pal_solid_free(t->solid);
    pal_arena_destroy(t->arena);
    pal_cells_free(&t->cells);
}

/* FORCE row of the tests' own: springs between the corners of every element and from nodes to their rest places.
 * linear: f = -k (u_i - u_j), else along the line between them, which keeps angular momentum as well */
typedef struct solid_springs {
    bool linear;
    double k_N_m, anchor_N_m;
    int n_pair;
    int32_t (*pair)[2];
    double *length;
} solid_springs;

static inline void solid_corner_pairs(solid_springs *s, const int32_t *corner, int n)
{
    for (int a = 0; a < n; a++)
        for (int b = 0; b < a; b++) s->pair[s->n_pair][0] = corner[a], s->pair[s->n_pair++][1] = corner[b];
}

static inline double solid_distance(const double *x, const int32_t pair[2])
{
    const double *a = x + 3 * pair[0], *b = x + 3 * pair[1];
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static inline void solid_springs_make(const solid_test *t, bool linear, double k_N_m, solid_springs *s)
{
    *s = (solid_springs){.linear = linear, .k_N_m = k_N_m};
    s->pair = malloc(28 * sizeof *s->pair * (size_t)pal_cell_elements_count(&t->solid->elements));
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int e = 0; e < t->solid->elements.n[kind]; e++) {
            const int32_t *node = pal_solid_nodes(t->solid, kind, e);
            int32_t corner[8];
            for (int c = 0; c < 8; c++)
                corner[c] = kind != PAL_CELL_CUBIC ? node[kind == PAL_CELL_HEX ? c : c % 5]
                                                   : node[16 * (1 + (c & 1)) + 4 * (1 + (c >> 1 & 1)) + 1 + (c >> 2)];
            solid_corner_pairs(s, corner, kind == PAL_CELL_PYRAMID ? 5 : 8);
        }
    s->length = malloc(sizeof *s->length * (size_t)s->n_pair);
    for (int i = 0; i < s->n_pair; i++) s->length[i] = solid_distance(t->body.node_rest, s->pair[i]);
}

static inline void solid_springs_free(solid_springs *s)
{
    free(s->pair), free(s->length);
}

static inline pal_err solid_springs_run(void *self, pal_step *step)
{
    const solid_springs *s = self;
    const double *d = step->body->d, *rest = step->body->node_rest;
    double *f = step->body->f;
    for (int i = 0; i < s->n_pair; i++) {
        const int a = 3 * s->pair[i][0], b = 3 * s->pair[i][1];
        double along = s->linear ? 1 : 1 - s->length[i] / solid_distance(d, s->pair[i]);
        for (int c = 0; c < 3; c++) {
            double u = d[a + c] - d[b + c] - (s->linear ? rest[a + c] - rest[b + c] : 0), force = s->k_N_m * along * u;
            f[a + c] -= force, f[b + c] += force;
        }
    }
    for (int i = 0; i < 3 * step->body->n_node && s->anchor_N_m != 0; i++) f[i] -= s->anchor_N_m * (d[i] - rest[i]);
    return PAL_ERR_OK;
}

static const pal_effect solid_springs_effect = {.name = "springs", .stage = PAL_STAGE_FORCE, .run = solid_springs_run};

/* a body with these springs, the rows that are given beside them, and central_cg with two of its keys */
typedef struct solid_world {
    solid_test t;
    solid_springs springs;
    pal_row force[3], contact[1], solve;
    int n_force, n_contact;
} solid_world;

static inline pal_err solid_solver(solid_world *w, double safety, double tolerance, const char *preconditioner)
{
    pal_item item;
    pal_note note = {{0}};
    pal_build build = {.scene = &w->t.scene, .def = &w->t.def, .body = &w->t.body, .arena = w->t.arena, .note = &note};
    pal_item_init(&item, "solver", "central_cg");
    if (safety > 0) (void)pal_item_put_number(&item, "safety", safety, NULL);
    if (tolerance > 0) (void)pal_item_put_number(&item, "tolerance", tolerance, NULL);
    if (preconditioner) (void)pal_item_put_text(&item, "preconditioner", preconditioner, NULL);
    w->solve.effect = &pal_effect_central_cg;
    pal_err err = pal_effect_central_cg.make(&item, &build, &w->solve.self);
    if (err) printf("  %s\n", note.text);
    return err;
}

static inline bool solid_world_open(solid_world *w, int n_level, bool linear, double k_N_m)
{
    memset(&w->springs, 0, sizeof *w - offsetof(solid_world, springs));
    if (!solid_open(&w->t, n_level)) return false;
    solid_springs_make(&w->t, linear, k_N_m, &w->springs);
    w->force[w->n_force++] = (pal_row){.effect = &solid_springs_effect, .self = &w->springs};
    return !solid_solver(w, 0, 0, NULL);
}

static inline void solid_world_close(solid_world *w)
{
    solid_springs_free(&w->springs);
    solid_close(&w->t);
}

static inline pal_step solid_step(solid_world *w, double dt_s)
{
    return (pal_step){.body = &w->t.body,
                      .force = w->force,
                      .n_force = w->n_force,
                      .contact = w->contact,
                      .n_contact = w->n_contact,
                      .dt_s = dt_s,
                      .n_sub = 1};
}

static inline double solid_limit(solid_world *w)
{
    pal_step step = solid_step(w, 0);
    return w->solve.effect->limit(w->solve.self, &step);
}

static inline void solid_run(solid_world *w, int n, double dt_s)
{
    for (int i = 0; i < n; i++) {
        pal_step step = solid_step(w, dt_s);
        if (w->solve.effect->run(w->solve.self, &step)) abort();
    }
}

/* forces at the body's present place, in body->g */
static inline void solid_forces(solid_world *w)
{
    pal_step step = solid_step(w, 0);
    step.drag_apart = true;
    if (pal_gather(&step)) abort();
}

/* every point away from rest by up to `far` elements */
static inline void solid_shake(solid_world *w, double far)
{
    pal_body *b = &w->t.body;
    for (int i = 0; i < 3 * b->n_dof; i++)
        if (!b->held[i / 3]) b->x[i] = b->x_rest[i] + far * b->h_m * solid_uniform(&w->t);
}
#endif
