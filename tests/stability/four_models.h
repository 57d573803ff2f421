/* One small body of each model under one roof, for hard cases that are put to all four alike: a box of tetrahedra as
 * springs, a sphere as an adaptive surface, a box of voxels as finite elements, a block of control cells. E 10 kPa, nu
 * 0.45, 1000 kg/m^3, drag 4/s, the lowest part held unless free; no gravity, no tools. */
#ifndef TESTS_STABILITY_FOUR_MODELS_H
#define TESTS_STABILITY_FOUR_MODELS_H
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_shapes.h"
#include "server/mesh/geometry/procedural.h"
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/world/world.h"
#include "tests/fixtures/boxes.h"
#include "tests/stability/hard_case.h"

enum { FOUR_SPRINGS, FOUR_ADAPTIVE, FOUR_FEM, FOUR_SOLID, FOUR_MODELS };
static const char *const four_name[FOUR_MODELS] = {"tet_springs", "adaptive_springs", "fem", "subdivision_fem"};

typedef struct four {
    int model;
    pal_prepared mesh;
    pal_cells cells;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
    pal_diagnostic diag;
} four;

/* the scene around what `mesh` and `cells` hold by now */
static inline void four_scene(four *s, bool fixed)
{
    s->scene = calloc(1, sizeof *s->scene);
    if (!s->scene) abort();
    pal_scene_default(s->scene);
    s->scene->n_body = 1;
    s->def = &s->scene->body[0];
    if (s->model == FOUR_SOLID)
        pal_body_default_cells(s->def, four_name[s->model], &s->mesh, &s->cells);
    else
        pal_body_default(s->def, four_name[s->model], &s->mesh);
    pal_entry_init(&s->def->model, "model", four_name[s->model]);
    pal_entry_init(&s->def->output, "output", "surface_output");
    s->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
    s->def->n_effect = 0, s->def->n_support = fixed;
    s->def->support[0] = (pal_support_def){.lowest = true, .fraction = 0.08};
    if (s->model == FOUR_ADAPTIVE) pal_entry_put_number(&s->def->model, "levels", 3, NULL);
    if (s->model == FOUR_FEM) pal_entry_init(&s->def->solver, "solver", "implicit_euler");
    if (s->model == FOUR_SOLID) {
        pal_entry_init(&s->def->solver, "solver", "implicit_euler");
        pal_entry_put_number(&s->def->model, "levels", 1, NULL);
    }
}

/* not yet open */
static inline void four_take(four *s, int model, bool fixed)
{
    memset(s, 0, sizeof *s);
    s->model = model;
    pal_surface surface = {0};
    bool ok = true;
    if (model == FOUR_SPRINGS || model == FOUR_FEM) ok = !box_make(3, 3, 3, 0.01, &s->mesh);
    if (model == FOUR_FEM) ok = ok && !pal_hexes_find(&s->mesh.tets, &s->mesh.hexes, &s->diag);
    if (model == FOUR_ADAPTIVE) ok = !pal_sphere_make(0.03, &s->mesh.surface);
    if (model == FOUR_SOLID) {
        ok = !pal_cells_block((const int32_t[3]){2, 2, 2}, (const double[3]){0.04, 0.04, 0.04}, &s->cells, &s->diag);
        ok = ok && !pal_cells_boundary(&s->cells, &surface, NULL, NULL) && !pal_prepared_surface(&surface, &s->mesh);
        pal_surface_free(&surface);
    }
    if (!ok) printf("  %s\n", s->diag.text), abort();
    four_scene(s, fixed);
}

static inline pal_config_entry *four_effect(four *s, const char *name)
{
    pal_config_entry *item = &s->def->effect[s->def->n_effect];
    char path[32];
    snprintf(path, sizeof path, "effects[%d]", s->def->n_effect++);
    pal_entry_init(item, path, name);
    return item;
}

static inline bool four_open(four *s)
{
    const pal_err err = pal_world_create(s->scene, &s->diag, &s->world);
    if (err)
        printf("  %s: %s\n", four_name[s->model], s->diag.text);
    else
        s->body = pal_world_body(s->world, 0);
    return !err;
}

static inline void four_close(four *s)
{
    pal_world_destroy(s->world);
    free(s->scene);
    pal_cells_free(&s->cells);
    pal_hexes_free(&s->mesh.hexes);
    if (s->model == FOUR_SOLID)
        pal_prepared_free(&s->mesh);
    else
        box_free(&s->mesh);
    memset(s, 0, sizeof *s);
}

/* false when a step failed or left something that is no number, or a body was frozen */
static inline bool four_step(four *s, int n, double dt_s)
{
    for (int i = 0; i < n; i++)
        if (pal_world_step(s->world, dt_s) || !pal_body_finite(s->body) || s->body->frozen) return false;
    return true;
}

/* percent of S */
static inline double four_off(const four *s)
{
    double sum = 0;
    for (int k = 0; k < s->body->n_active; k++) {
        const int i = pal_body_point(s->body, k);
        sum += pow(pal_dist3(s->body->x + 3 * i, s->body->x_rest + 3 * i), 2);
    }
    return 100 * sqrt(sum / s->body->n_active) / s->body->length_scale_m;
}

/* the highest node in use, nearest to the axis */
static inline int four_top(const four *s)
{
    int best = -1;
    double max = -INFINITY;
    for (int k = 0; k < pal_body_nodes(s->body); k++) {
        const int i = s->body->interpolation ? k : pal_body_point(s->body, k);
        const double *x = s->body->node_rest + 3 * i, at = x[2] - 0.01 * fabs(x[0] - x[1]);
        if (at > max) max = at, best = i;
    }
    return best;
}

/* energy less the work of lasting loads since rest */
static inline double four_energy_J(const four *s)
{
    double work = 0;
    for (int i = 0; i < 3 * s->body->n_node && s->body->external_force; i++)
        work += s->body->external_force[i] * (s->body->d[i] - s->body->node_rest[i]);
    return pal_world_energy_J(s->world) - work;
}

/* a lasting load spread over the upper third, N */
static inline void four_load(four *s, const double force_N[3])
{
    double low = INFINITY, high = -INFINITY, mass = 0;
    for (int pass = 0; pass < 3; pass++)
        for (int k = 0; k < pal_body_nodes(s->body); k++) {
            const int i = s->body->interpolation ? k : pal_body_point(s->body, k);
            const double z = s->body->node_rest[3 * i + 2];
            double f[3];
            if (pass == 0) low = fmin(low, z), high = fmax(high, z);
            if (pass == 0 || z < low + 0.66 * (high - low)) continue;
            if (pass == 1) mass += s->body->node_mass_kg[i];
            pal_scale3(f, s->body->node_mass_kg[i] / mass, force_N);
            if (pass == 2 && pal_world_load(s->world, 0, i, f)) abort();
        }
}

/* largest distance between points of two worlds of the same body, percent of S */
static inline double four_apart(const four *a, const double *x)
{
    double max = 0;
    for (int k = 0; k < a->body->n_active; k++) {
        const int i = pal_body_point(a->body, k);
        max = fmax(max, pal_dist3(a->body->x + 3 * i, x + 3 * i));
    }
    return 100 * max / a->body->length_scale_m;
}
#endif
