/* Worlds for tests of tools: a ball with a skin, a slab whose nodes are shown themselves, and helpers to move tools.
 * Every world has a body without gravity and damping that settles it within a second. */
#ifndef TESTS_SIM_TOOL_SCENE_H
#define TESTS_SIM_TOOL_SCENE_H
#include "server/base/vec3.h"
#include "server/sim/world.h"
#include "tests/check.h"
#include "tests/sim/boxes.h"

#include <stdlib.h>

typedef struct tool_scene {
    pal_prepared mesh;
    pal_scene *scene;
    pal_world *world;
    pal_body *body;
    bool skinned;
} tool_scene;

/* a ball of radius 1 about the origin: n_ring rings of 2 n_ring vertices and two poles */
static inline pal_err ball_surface(int n_ring, double radius_m, pal_surface *out)
{
    int n_round = 2 * n_ring, n = 0;
    memset(out, 0, sizeof *out);
    out->n_vertex = n_ring * n_round + 2;
    out->x = calloc(3 * (size_t)out->n_vertex, sizeof(double));
    out->tri = calloc(6 * (size_t)(n_ring * n_round), sizeof *out->tri);
    if (!out->x || !out->tri) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_ring; i++)
        for (int j = 0; j < n_round; j++) {
            double theta = M_PI * (i + 1) / (n_ring + 1), phi = 2 * M_PI * (j + 0.5 * (i & 1)) / n_round;
            double *x = out->x + 3 * (i * n_round + j);
            pal_set3(x, radius_m * sin(theta) * cos(phi), radius_m * sin(theta) * sin(phi), radius_m * cos(theta));
        }
    int top = n_ring * n_round, low = top + 1;
    pal_set3(out->x + 3 * top, 0, 0, radius_m);
    pal_set3(out->x + 3 * low, 0, 0, -radius_m);
    for (int j = 0; j < n_round; j++) {
        int next = (j + 1) % n_round, last = (n_ring - 1) * n_round;
        int32_t cap[6] = {top, j, next, low, last + next, last + j};
        memcpy(out->tri + 3 * n, cap, sizeof cap);
        n += 2;
        for (int i = 0; i + 1 < n_ring; i++) {
            int a = i * n_round + j, b = i * n_round + next, c = a + n_round, d = b + n_round;
            /* odd rings are shifted by half a step */
            int32_t even[6] = {a, c, b, b, c, d}, odd[6] = {a, c, d, a, d, b};
            memcpy(out->tri + 3 * n, i & 1 ? odd : even, sizeof even);
            n += 2;
        }
    }
    out->n_tri = n;
    return PAL_ERR_OK;
}

/* scene defaults: n_tool tools of one radius and cap, no gravity, heavy and damped */
static inline void tool_scene_fill(tool_scene *s, const char *output, bool held, int n_tool, double radius_m,
                                   double cap_N)
{
    s->scene = calloc(1, sizeof *s->scene);
    if (!s->scene) abort();
    pal_scene_default(s->scene);
    s->scene->n_body = 1;
    pal_body_def *def = &s->scene->body[0];
    pal_body_default(def, "body", &s->mesh);
    pal_item_init(&def->output, "output", output);
    /* heavy tissue: longer sub-steps, the same forces at rest */
    def->material.density_kg_m3 = 2000;
    def->material.damping_1_s = 10;
    def->n_support = held ? 1 : 0;
    for (int i = 1; i < def->n_effect; i++) def->effect[i - 1] = def->effect[i];
    def->n_effect--;
    pal_tools_default(s->scene, n_tool);
    for (int t = 0; t < n_tool; t++) s->scene->tool[t].radius_m = radius_m, s->scene->tool[t].force_cap_N = cap_N;
}

static inline bool tool_scene_open(tool_scene *s)
{
    pal_note note = {""};
    if (pal_world_create(s->scene, &note, &s->world)) {
        printf("  %s\n", note.text);
        return false;
    }
    s->body = pal_world_body(s->world, 0);
    return true;
}

/* ball of radius 5 cm, skinned to voxels, lowest 5 % held when asked; not yet open */
static inline bool ball_scene(tool_scene *s, int resolution, bool held, int n_tool, double radius_m, double cap_N)
{
    pal_surface surface;
    pal_note note = {""};
    pal_voxel_options options = {.resolution = resolution, .border = true};
    pal_prepare_report report;
    memset(s, 0, sizeof *s);
    s->skinned = true;
    if (ball_surface(18, 0.05, &surface)) return false;
    pal_err err = pal_prepared_make(&surface, &options, &s->mesh, &report, &note);
    pal_surface_free(&surface);
    if (err) printf("  %s\n", note.text);
    if (err) return false;
    tool_scene_fill(s, "skin_out", held, n_tool, radius_m, cap_N);
    return true;
}

/* slab nx x ny x nz voxels of h, lowest nodes held, its nodes shown; its top is at z = nz h; not yet open */
static inline bool slab_scene(tool_scene *s, int nx, int ny, int nz, double h_m, int n_tool, double radius_m,
                              double cap_N)
{
    memset(s, 0, sizeof *s);
    if (box_make(nx, ny, nz, h_m, &s->mesh)) return false;
    tool_scene_fill(s, "surface_out", true, n_tool, radius_m, cap_N);
    return true;
}

static inline void tool_scene_close(tool_scene *s)
{
    pal_world_destroy(s->world);
    free(s->scene);
    if (s->skinned)
        pal_prepared_free(&s->mesh);
    else
        box_free(&s->mesh);
}

static inline pal_err move_tool(tool_scene *s, int tool, double x, double y, double z, bool grab)
{
    pal_pose pose = {.position_m = {x, y, z}, .quat = {1, 0, 0, 0}, .buttons = grab};
    return pal_world_pose(s->world, tool, &pose);
}

static inline const pal_tool *tool_of(const tool_scene *s, int tool)
{
    return &pal_world_tools(s->world)->tool[tool];
}

/* n steps; false when one failed */
static inline bool step_world(tool_scene *s, int n)
{
    for (int i = 0; i < n; i++)
        if (pal_world_step(s->world, s->scene->step_s)) return false;
    return true;
}

static inline void sum_loads(const pal_body *body, double sum[3])
{
    pal_set3(sum, 0, 0, 0);
    for (int i = 0; i < body->n_node; i++) pal_add3(sum, sum, body->load + 3 * (size_t)i);
}

static inline double rms_displacement(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) sum += (body->x[i] - body->x_rest[i]) * (body->x[i] - body->x_rest[i]);
    return sqrt(sum / body->n_dof);
}

static inline double mean_move(const pal_body *body, int axis)
{
    double sum = 0;
    for (int i = 0; i < body->n_dof; i++) sum += body->x[3 * i + axis] - body->x_rest[3 * i + axis];
    return sum / body->n_dof;
}
#endif
