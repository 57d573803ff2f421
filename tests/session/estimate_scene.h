/* The small ball without gravity, as springs and as finite elements, for the tests of estimates. */
#ifndef TESTS_SESSION_ESTIMATE_SCENE_H
#define TESTS_SESSION_ESTIMATE_SCENE_H
#include "tests/session/small_scene.h"

#include <string.h>

static pal_scene scene;
static pal_prepared mesh;

/* the ball as finite elements, 60 steps a second, held at its foot */
static inline pal_scene *fem_scene(void)
{
    pal_scene *fem = malloc(sizeof *fem);
    if (!fem) abort();
    *fem = scene;
    fem->step_s = 1.0 / 60;
    pal_item_init(&fem->body[0].model, "model", "fem");
    pal_item_init(&fem->body[0].solver, "solver", "implicit_euler");
    fem->body[0].material.damping_1_s = 0;
    fem->body[0].n_effect = 0;
    return fem;
}

/* on a foot as small as a voxel the ball would fall over */
static inline void without_gravity(pal_body_def *body)
{
    int n = 0;
    for (int i = 0; i < body->n_effect; i++)
        if (strcmp(body->effect[i].name, "gravity")) body->effect[n++] = body->effect[i];
    body->n_effect = n;
}

/* fills scene and mesh, so many voxels wide; false: they cannot be made */
static inline bool estimate_scene(int resolution)
{
    if (!small_scene(&scene, &mesh, resolution)) return false;
    without_gravity(&scene.body[0]);
    return true;
}
#endif
