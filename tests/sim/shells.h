/* Worlds of adaptive surfaces for tests: a surface as a pal_prepared without voxels, one body of model
 * adaptive_springs, no gravity and no tools unless asked, and loads that are spread over a region whatever level it
 * has. */
#ifndef TESTS_SIM_SHELLS_H
#define TESTS_SIM_SHELLS_H
#include "server/base/vec3.h"
#include "server/mesh/mesh_file.h"
#include "server/mesh/stomach.h"
#include "server/sim/shell.h"
#include "server/sim/world.h"
#include "tests/check.h"

typedef struct shell_scene {
    pal_prepared mesh;
    pal_scene *scene;
    pal_world *world;
    pal_body *body;
    pal_note note;
} shell_scene;

/* takes the surface's arrays */
static inline void shell_scene_take(shell_scene *s, pal_surface *surface)
{
    memset(s, 0, sizeof *s);
    s->mesh.surface = *surface;
    memset(surface, 0, sizeof *surface);
    memcpy(s->mesh.tets.origin_m, s->mesh.surface.origin_m, sizeof s->mesh.tets.origin_m);
    s->scene = calloc(1, sizeof *s->scene);
    if (!s->scene) abort();
    pal_scene_default(s->scene);
    s->scene->n_body = 1;
    pal_body_def *def = &s->scene->body[0];
    pal_body_default(def, "shell", &s->mesh);
    pal_item_init(&def->model, "model", "adaptive_springs");
    pal_item_init(&def->output, "output", "surface_out");
    def->n_support = def->n_effect = 0;
    def->material.damping_1_s = 0;
}

static inline pal_item *shell_scene_model(shell_scene *s)
{
    return &s->scene->body[0].model;
}
static inline void shell_scene_number(shell_scene *s, const char *key, double number)
{
    if (pal_item_put_number(shell_scene_model(s), key, number, NULL)) abort();
}
static inline void shell_scene_text(shell_scene *s, const char *key, const char *text)
{
    if (pal_item_put_text(shell_scene_model(s), key, text, NULL)) abort();
}
static inline pal_item *shell_scene_effect(shell_scene *s, const char *name)
{
    pal_body_def *def = &s->scene->body[0];
    pal_item *item = &def->effect[def->n_effect];
    char path[32];
    snprintf(path, sizeof path, "effects[%d]", def->n_effect++);
    pal_item_init(item, path, name);
    return item;
}
static inline void shell_scene_hold(shell_scene *s, const double low[3], const double high[3])
{
    pal_body_def *def = &s->scene->body[0];
    pal_support *box = &def->support[def->n_support++];
    *box = (pal_support){.lowest = false};
    pal_copy3(box->low_m, low);
    pal_copy3(box->high_m, high);
}
static inline bool shell_scene_start(shell_scene *s)
{
    if (pal_world_create(s->scene, &s->note, &s->world)) {
        printf("  %s\n", s->note.text);
        s->world = NULL;
        return false;
    }
    s->body = pal_world_body(s->world, 0);
    return true;
}
static inline void shell_scene_close(shell_scene *s)
{
    pal_world_destroy(s->world);
    free(s->scene);
    pal_surface_free(&s->mesh.surface);
    memset(s, 0, sizeof *s);
}

/* force_N spread over the free nodes within radius_m of `at` (rest positions): mass times a smooth bump, so that it is
 * nearly the same pressure on every mixture of levels; returns how many bear it */
static inline int shell_scene_press(shell_scene *s, const double at[3], double radius_m, const double force_N[3])
{
    const pal_body *body = s->body;
    double sum = 0, f[3];
    int n = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < body->n_active; k++) {
            int i = pal_body_point(body, k);
            double r = pal_dist3(body->x_rest + 3 * i, at) / radius_m, bump = (1 - r * r) * (1 - r * r);
            if (!(r < 1) || body->held[i]) continue;
            if (pass == 0) {
                sum += bump * body->mass_kg[i];
                continue;
            }
            pal_scale3(f, bump * body->mass_kg[i] / sum, force_N);
            n += !pal_world_load(s->world, 0, i, f);
        }
    return n;
}

/* root of the mean squared distance from rest over the active nodes */
static inline double shell_scene_rms(const shell_scene *s)
{
    const pal_body *body = s->body;
    double sum = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double d = pal_dist3(body->x + 3 * i, body->x_rest + 3 * i);
        sum += d * d;
    }
    return sqrt(sum / body->n_active);
}

/* the vertex of level 0 that is nearest to a place at rest */
static inline int shell_scene_nearest(const shell_scene *s, const double at[3])
{
    int best = 0;
    for (int i = 1; i < s->mesh.surface.n_vertex; i++)
        if (pal_dist3(s->body->x_rest + 3 * i, at) < pal_dist3(s->body->x_rest + 3 * best, at)) best = i;
    return best;
}
#endif
