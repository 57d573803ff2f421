/* Scenes of one subdivided solid for tests: blocks of control cells, crisp ones that stay boxes whatever the levels,
 * and any other cells. Nothing held, no effects; the caller fills what it needs and opens the world. */
#ifndef TESTS_SIM_SOLID_SCENE_H
#define TESTS_SIM_SOLID_SCENE_H
#include "server/base/vec3.h"
#include "server/mesh/cell_shapes.h"
#include "server/sim/solid.h"
#include "server/sim/world.h"
#include "tests/check.h"

typedef struct solid_scene {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
    pal_note note;
} solid_scene;

/* takes the cells: E 10 kPa, nu 0.45, 1000 kg/m^3, drag 4/s */
static inline void solid_scene_take(solid_scene *s, pal_cells cells, int n_level, const char *solver,
                                    const char *operator)
{
    pal_surface surface = {0};
    memset(s, 0, sizeof *s);
    s->cells = cells;
    s->scene = calloc(1, sizeof *s->scene);
    if (!s->scene || pal_cells_boundary(&s->cells, &surface, NULL, NULL) || pal_prepared_surface(&surface, &s->mesh))
        abort();
    pal_surface_free(&surface);
    pal_scene_default(s->scene);
    s->scene->n_body = 1;
    s->def = &s->scene->body[0];
    pal_body_default_cells(s->def, "solid", &s->mesh, &s->cells);
    s->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
    s->def->n_effect = s->def->n_support = 0;
    pal_item_init(&s->def->solver, "solver", solver);
    if (pal_item_put_text(&s->def->model, "operator", operator, NULL)) abort();
    if (pal_item_put_number(&s->def->model, "levels", n_level, NULL)) abort();
}

/* n bricks, lowest corner at the origin; crisp: its edges and corners are sharp, so that it stays a box */
static inline pal_cells solid_scene_box(const int32_t n[3], const double size_m[3], bool crisp)
{
    pal_cells cells = {0};
    pal_note note = {{0}};
    if (pal_cells_block(n, size_m, &cells, &note)) printf("  %s\n", note.text), abort();
    for (int e = 0; e < cells.n_edge && crisp; e++) {
        const double *a = cells.x + 3 * cells.edge[e].vertex[0], *b = cells.x + 3 * cells.edge[e].vertex[1];
        int n_side = 0;
        for (int c = 0; c < 3; c++)
            n_side += fabs(a[c] - b[c]) < 1e-6 * size_m[c] && fabs(fabs(a[c]) - size_m[c] / 2) < 1e-6 * size_m[c];
        if (n_side == 2) cells.edge[e].sharp = PAL_SHARP_EVER;
    }
    for (int i = 0; i < 3 * cells.n_vertex; i++) cells.x[i] += size_m[i % 3] / 2;
    return cells;
}

/* control points up to high_m along the axis are held */
static inline void solid_scene_hold(solid_scene *s, int axis, double high_m)
{
    pal_support *support = &s->def->support[s->def->n_support++];
    *support = (pal_support){.low_m = {-1e9, -1e9, -1e9}, .high_m = {1e9, 1e9, 1e9}};
    support->high_m[axis] = high_m;
}

static inline bool solid_scene_open(solid_scene *s)
{
    pal_err err = pal_world_create(s->scene, &s->note, &s->world);
    if (err)
        CHECK_FAIL("%s", s->note.text);
    else
        s->body = pal_world_body(s->world, 0);
    return !err;
}

static inline void solid_scene_close(solid_scene *s)
{
    pal_world_destroy(s->world);
    pal_cells_free(&s->cells);
    pal_prepared_free(&s->mesh);
    free(s->scene);
    memset(s, 0, sizeof *s);
}

static inline bool solid_scene_step(solid_scene *s, int n, double dt_s)
{
    for (int i = 0; i < n; i++)
        if (pal_world_step(s->world, dt_s)) return false;
    return true;
}

static inline pal_solve_report solid_scene_report(const solid_scene *s)
{
    pal_solve_report out = {0};
    (void)pal_world_solve_report(s->world, 0, &out);
    return out;
}
#endif
