/* A solid of control cells as a scene, for the tests of sculpting. */
#ifndef TESTS_SESSION_CLAY_H
#define TESTS_SESSION_CLAY_H
#include "server/mesh/cells/cell_shapes.h"
#include "server/sim/core/definition.h"
#include "tests/check.h"

typedef struct clay_scene {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene scene;
} clay_scene;

/* n^3 bricks of an edge of length_scale_m in all, lowest part held, subdivided once, two tools, no gravity, 10 ms steps
 */
static inline void clay_make(clay_scene *out, int n, double length_scale_m)
{
    const int32_t count[3] = {n, n, n};
    const double size[3] = {length_scale_m, length_scale_m, length_scale_m};
    pal_diagnostic diag = {""};
    pal_surface surface = {0};
    memset(out, 0, sizeof *out);
    if (pal_cells_block(count, size, &out->cells, &diag) || pal_cells_boundary(&out->cells, &surface, NULL, NULL) ||
        pal_prepared_surface(&surface, &out->mesh))
        CHECK_FAIL("no clay: %s", diag.text);
    pal_surface_free(&surface);
    pal_scene_default(&out->scene);
    snprintf(out->scene.name, PAL_NAME, "clay");
    out->scene.n_body = 1;
    out->scene.step_s = 0.01;
    pal_body_default_cells(&out->scene.body[0], "clay", &out->mesh, &out->cells);
    out->scene.body[0].n_effect = 0;
    if (pal_entry_put_number(&out->scene.body[0].model, "levels", 1, &diag)) CHECK_FAIL("%s", diag.text);
    pal_tools_default(&out->scene, 2);
}

static inline void clay_free(clay_scene *c)
{
    pal_cells_free(&c->cells);
    pal_prepared_free(&c->mesh);
}
#endif
