/* One small scene of each model for tests that hold for all of them: a box of springs, a box of cubes (fem), an
 * adaptive sphere and a subdivided block, held at their lowest part, with gravity, two tools and a guard. The caller
 * changes what it needs and opens the world. */
#ifndef TESTS_SIM_MODEL_SCENES_H
#define TESTS_SIM_MODEL_SCENES_H
#include "server/mesh/cell_shapes.h"
#include "server/sim/world.h"
#include "tests/check.h"
#include "tests/session/small_scene.h"
#include "tests/sim/boxes.h"

typedef enum model_kind { SPRINGS, FEM, SHELL, SOLID, MODEL_KINDS } model_kind;
static const char *const model_kind_name[MODEL_KINDS] = {"tet_springs", "fem", "adaptive_springs", "subdivision_fem"};

typedef struct model_scene {
    model_kind kind;
    pal_prepared mesh;
    pal_cells cells;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
    pal_note note;
} model_scene;

static inline pal_item *model_scene_effect(model_scene *m, const char *name)
{
    pal_item *item = &m->def->effect[m->def->n_effect];
    char path[32];
    snprintf(path, sizeof path, "bodies[0].effects[%d]", m->def->n_effect++);
    pal_item_init(item, path, name);
    return item;
}

static inline void model_scene_box(model_scene *m)
{
    bool made = !box_make(4, 3, 3, 0.02, &m->mesh);
    if (made && m->kind == FEM) made = !pal_hexes_find(&m->mesh.tets, &m->mesh.hexes, &m->note);
    if (!made) abort();
    pal_body_default(m->def, "thing", &m->mesh);
    pal_item_init(&m->def->output, "bodies[0].output", "surface_out");
}

static inline void model_scene_solid(model_scene *m)
{
    const int32_t n[3] = {2, 2, 2};
    const double size_m[3] = {0.08, 0.06, 0.06};
    pal_surface surface = {0};
    if (pal_cells_block(n, size_m, &m->cells, &m->note) || pal_cells_boundary(&m->cells, &surface, NULL, NULL) ||
        pal_prepared_surface(&surface, &m->mesh))
        abort();
    pal_surface_free(&surface);
    pal_body_default_cells(m->def, "thing", &m->mesh, &m->cells);
    pal_item_init(&m->def->model, "bodies[0].model", "subdivision_fem");
    pal_item_put_number(&m->def->model, "levels", 1, NULL);
}

/* without effects; lowest part held; 10 kPa, 0.4, drag 8/s */
static inline void model_scene_make(model_scene *m, model_kind kind)
{
    memset(m, 0, sizeof *m);
    m->kind = kind;
    m->scene = calloc(1, sizeof *m->scene);
    if (!m->scene) abort();
    pal_scene_default(m->scene);
    m->scene->n_body = 1;
    m->def = &m->scene->body[0];
    if (kind == SPRINGS || kind == FEM) model_scene_box(m);
    if (kind == SOLID) model_scene_solid(m);
    if (kind == SHELL) {
        if (!small_ball(&m->mesh.surface, 0.04, 8)) abort();
        pal_body_default(m->def, "thing", &m->mesh);
        pal_item_init(&m->def->output, "bodies[0].output", "surface_out");
    }
    if (kind != SOLID) pal_item_init(&m->def->model, "bodies[0].model", model_kind_name[kind]);
    m->def->solver.name[0] = 0;
    m->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.4, .density_kg_m3 = 1000, .damping_1_s = 8};
    m->def->n_effect = 0;
    m->def->n_support = 1;
    m->def->support[0] = (pal_support){.lowest = true, .fraction = kind == SHELL ? 0.2 : 0.05};
    pal_tools_default(m->scene, 2);
    m->scene->tool[0].radius_m = m->scene->tool[1].radius_m = 0.008;
}

static inline void model_scene_defaults(model_scene *m)
{
    static const char *const names[] = {"gravity", "tool_push", "tool_grab", "finite_guard"};
    for (int i = 0; i < 4; i++) model_scene_effect(m, names[i]);
}

static inline bool model_scene_open(model_scene *m)
{
    pal_err err = pal_world_create(m->scene, &m->note, &m->world);
    if (err) CHECK_FAIL("%s: %s", model_kind_name[m->kind], m->note.text);
    if (!err) m->body = pal_world_body(m->world, 0);
    return !err;
}

static inline void model_scene_close(model_scene *m)
{
    pal_world_destroy(m->world);
    pal_cells_free(&m->cells);
    if (m->kind == FEM) pal_hexes_free(&m->mesh.hexes);
    if (m->kind == SOLID)
        pal_prepared_free(&m->mesh);
    else
        box_free(&m->mesh);
    free(m->scene);
    memset(m, 0, sizeof *m);
}

/* steps with tool 0 pressing and tool 1 grabbing from step 5 on */
static inline bool model_scene_touch(model_scene *m, int from, int n)
{
    for (int i = from; i < from + n; i++) {
        double t = i / 60.0, z = m->kind == SHELL || m->kind == SOLID ? 0.035 : 0.06;
        double x = m->kind == SHELL || m->kind == SOLID ? -0.03 : 0;
        const pal_pose press = {.position_m = {x + 0.025, x + 0.03, z + 0.012 - 0.02 * t}, .quat = {1, 0, 0, 0}};
        const pal_pose pull = {
            .position_m = {x + 0.06, x + 0.03, z + 0.002 + 0.01 * t}, .quat = {1, 0, 0, 0}, .buttons = i > 5};
        if (pal_world_pose(m->world, 0, &press) || pal_world_pose(m->world, 1, &pull)) return false;
        if (pal_world_step(m->world, m->scene->step_s)) return false;
    }
    return true;
}

static inline bool model_scene_steps(model_scene *m, int n)
{
    for (int i = 0; i < n; i++)
        if (pal_world_step(m->world, m->scene->step_s)) return false;
    return true;
}

/* place of a row in the plan, -1: it is not there */
static inline int model_scene_row(const model_scene *m, const char *name)
{
    pal_row_info info;
    for (int i = 0; i < pal_world_rows(m->world); i++) {
        pal_world_row(m->world, i, &info);
        if (!strcmp(info.name, name)) return i;
    }
    return -1;
}
#endif
