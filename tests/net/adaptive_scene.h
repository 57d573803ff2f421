/* A hollow sphere of adaptive springs as a scene, held at its lowest part. Gravity lets it sag: it is refined while
 * it moves and comes to rest. In a storm it is heavier than it can bear and is refined and joined at the least motion,
 * so that its triangles change all the time. Without weight it begins fine and is joined where it stands. */
#ifndef TESTS_NET_ADAPTIVE_SCENE_H
#define TESTS_NET_ADAPTIVE_SCENE_H
#include "server/mesh/geometry/procedural.h"
#include "server/sim/core/definition.h"
#include "tests/check.h"

enum {
    ADAPTIVE_LEVELS = 3,
    ADAPTIVE_NODES = 114,
    ADAPTIVE_VERTICES = 1794,
    ADAPTIVE_SPRINGS = 336 * 16,
    ADAPTIVE_PLACES = 224 * 16
};

typedef enum adaptive_weather { ADAPTIVE_LOW_GRAVITY, ADAPTIVE_STORM, ADAPTIVE_WEIGHTLESS } adaptive_weather;
typedef struct adaptive_scene {
    pal_prepared mesh;
    pal_scene scene;
} adaptive_scene;

static inline bool adaptive_scene_make(adaptive_scene *s, adaptive_weather weather)
{
    memset(s, 0, sizeof *s);
    if (pal_sphere_make(0.06, &s->mesh.surface)) return false;
    pal_scene_default(&s->scene);
    snprintf(s->scene.name, sizeof s->scene.name, "adaptive");
    s->scene.n_body = 1;
    pal_body_def *def = &s->scene.body[0];
    pal_body_default(def, "sphere", &s->mesh);
    pal_entry_init(&def->model, "model", "adaptive_springs");
    def->n_effect = 0;
    pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "gravity");
    pal_tools_default(&s->scene, 1);
    bool good = !pal_entry_put_number(&def->model, "levels", ADAPTIVE_LEVELS, NULL);
    s->scene.gravity_m_s2 = weather == ADAPTIVE_STORM ? 9.81 : weather == ADAPTIVE_LOW_GRAVITY ? 2 : 0;
    if (weather == ADAPTIVE_WEIGHTLESS)
        good = good && !pal_entry_put_number(&def->model, "start_level", ADAPTIVE_LEVELS - 1, NULL);
    if (weather == ADAPTIVE_WEIGHTLESS) return good;
    pal_config_entry *refine = &def->effect[def->n_effect++];
    pal_entry_init(refine, "effects[1]", "refine");
    return good && !pal_entry_put_number(refine, "speed_m_s", weather == ADAPTIVE_STORM ? 0.02 : 0.008, NULL) &&
           !pal_entry_put_number(refine, "curvature_1_m", 0, NULL) &&
           !pal_entry_put_number(refine, "dwell_s", 0.05, NULL);
}

static inline void adaptive_scene_free(adaptive_scene *s)
{
    pal_surface_free(&s->mesh.surface);
}
#endif
