/* A small ball of tissue for the tests of this room and of scene: built in the test, no files. */
#ifndef TESTS_SESSION_SMALL_SCENE_H
#define TESTS_SESSION_SMALL_SCENE_H
#include "server/sim/core/definition.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* a closed ball of radius r_m: rings x 2 rings points; false: out of memory */
static inline bool small_ball(pal_surface *out, double r_m, int rings)
{
    int wide = 2 * rings, n = 0;
    *out = (pal_surface){.n_vertex = (rings - 1) * wide + 2, .n_tri = 2 * wide * (rings - 1)};
    out->x = calloc((size_t)out->n_vertex, 3 * sizeof(double));
    out->tri = calloc((size_t)out->n_tri, 3 * sizeof(int32_t));
    if (!out->x || !out->tri) return false;
    int bottom = out->n_vertex - 2, top = out->n_vertex - 1;
    for (int i = 1; i < rings; i++)
        for (int k = 0; k < wide; k++) {
            double a = M_PI * i / rings, b = 2 * M_PI * k / wide, *x = out->x + 3 * ((i - 1) * wide + k);
            x[0] = r_m * sin(a) * cos(b), x[1] = r_m * sin(a) * sin(b), x[2] = -r_m * cos(a);
        }
    out->x[3 * bottom + 2] = -r_m;
    out->x[3 * top + 2] = r_m;
    for (int k = 0; k < wide; k++) {
        int next = (k + 1) % wide, last = (rings - 2) * wide;
        const int32_t cap[2][3] = {{bottom, next, k}, {top, last + k, last + next}};
        for (int c = 0; c < 2; c++, n++)
            for (int j = 0; j < 3; j++) out->tri[3 * n + j] = cap[c][j];
        for (int i = 0; i + 2 < rings; i++) {
            int a = i * wide + k, b = i * wide + next, c = a + wide, d = b + wide;
            const int32_t two[2][3] = {{a, b, d}, {a, d, c}};
            for (int t = 0; t < 2; t++, n++)
                for (int j = 0; j < 3; j++) out->tri[3 * n + j] = two[t][j];
        }
    }
    return true;
}

/* one body, two tools, 5 ms steps; false when the mesh cannot be made */
static inline bool small_scene(pal_scene *scene, pal_prepared *mesh, int resolution)
{
    pal_surface ball;
    pal_diagnostic diag = {""};
    pal_prepare_report report;
    pal_voxel_options options = {.resolution = resolution, .border = true};
    bool good = small_ball(&ball, 0.05, 12) && !pal_prepared_make(&ball, &options, mesh, &report, &diag);
    pal_surface_free(&ball);
    if (!good) printf("  small scene: %s\n", diag.text);
    if (!good) return false;
    pal_scene_default(scene);
    pal_body_default(&scene->body[0], "ball", mesh);
    scene->n_body = 1;
    scene->step_s = 0.005;
    pal_tools_default(scene, 2);
    return true;
}
#endif
