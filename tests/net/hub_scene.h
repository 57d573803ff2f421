/* A small organ of our own as a scene, built in the test: no files needed. */
#ifndef TESTS_NET_SMALL_SCENE_H
#define TESTS_NET_SMALL_SCENE_H
#include "server/mesh/geometry/procedural.h"
#include "server/sim/core/definition.h"
#include "tests/check.h"

typedef struct small_scene {
    pal_prepared mesh;
    pal_scene scene;
} small_scene;

static inline bool small_scene_make(small_scene *s, const char *name)
{
    pal_surface surface;
    pal_voxel_options options = {.resolution = CHECK_REPEATS(6, 4), .border = true};
    pal_prepare_report report;
    pal_diagnostic diag = {""};
    memset(s, 0, sizeof *s);
    if (pal_organ_make(CHECK_REPEATS(1500, 600), &surface)) return false;
    pal_err err = pal_prepared_make(&surface, &options, &s->mesh, &report, &diag);
    pal_surface_free(&surface);
    if (err) printf("  no scene: %s\n", diag.text);
    pal_scene_default(&s->scene);
    snprintf(s->scene.name, sizeof s->scene.name, "%s", name);
    snprintf(s->scene.title, sizeof s->scene.title, "Small \"organ\"");
    snprintf(s->scene.source, sizeof s->scene.source, "made by the test");
    snprintf(s->scene.accuracy, sizeof s->scene.accuracy, "2 %% of \"truth\"");
    snprintf(s->scene.anatomical_axes, sizeof s->scene.anatomical_axes, "LPS");
    s->scene.n_body = 1;
    pal_body_default(&s->scene.body[0], "organ", &s->mesh);
    pal_tools_default(&s->scene, 2);
    s->scene.tool[0].instrument = PAL_INSTRUMENT_GRASPER;
    s->scene.tool[0].has_trocar = true, s->scene.tool[0].trocar_m[1] = 0.25;
    return !err;
}
#endif
