#include "server/scene/scene_keys.h"

static const struct {
    const char *path, *const key[24];
} objects[PAL_KEYS_OBJECTS] = {
    [PAL_KEYS_SCENE] = {"",
                        {"name", "title", "source", "accuracy", "budget", "step_s", "up", "anatomical_axes",
                         "gravity_m_s2", "max_substep", "threads", "keep_real_time", "bodies", "tools"}},
    [PAL_KEYS_ACCURACY] = {"accuracy.", {"max_error_mm", "text"}},
    [PAL_KEYS_BUDGET] = {"budget.", {"step_ms"}},
    [PAL_KEYS_TOOL] = {"tools[].", {"name", "radius_m", "force_cap_N", "instrument", "trocar_m"}},
    [PAL_KEYS_BODY] = {"bodies[].", {"name",    "appearance", "colour",     "largest",  "mesh",      "images",
                                     "surface", "units",      "resolution", "label",    "triangles", "material",
                                     "model",   "solver",     "output",     "supports", "effects",   "regions",
                                     "cells",   "strokes",    "origin_m",   "cut"}},
    [PAL_KEYS_MATERIAL] = {"bodies[].material.",
                           {"young_Pa", "poisson", "density_kg_m3", "damping_1_s", "damping_ratio"}},
    [PAL_KEYS_REGION] = {"bodies[].regions[].", {"box", "label", "grid", "young_Pa", "poisson", "density_kg_m3"}},
    [PAL_KEYS_REGION_BOX] = {"bodies[].regions[].box.", {"low_m", "high_m"}},
    [PAL_KEYS_LABEL] = {"bodies[].regions[].label.", {"volume", "value"}},
    [PAL_KEYS_REGION_GRID] = {"bodies[].regions[].grid.",
                              {"n", "low_m", "high_m", "young_Pa", "poisson", "density_kg_m3"}},
    [PAL_KEYS_MODEL] = {"bodies[].model.", {"grid"}},
    [PAL_KEYS_SPRING_GRID] = {"bodies[].model.grid.",
                              {"n", "low_m", "high_m", "k_distance_J", "k_area_J", "k_volume_J"}},
    [PAL_KEYS_SUPPORT] = {"bodies[].supports[].", {"lowest", "box", "boundary"}},
    [PAL_KEYS_SUPPORT_BOX] = {"bodies[].supports[].box.", {"low_m", "high_m"}},
    [PAL_KEYS_STROKE] = {"bodies[].strokes[].", {"at_m", "radius_m", "softness", "young_factor", "density_factor"}},
    [PAL_KEYS_CUT] = {"bodies[].cut.", {"normal", "offset_m"}},
};

const char *const *pal_scene_keys(pal_scene_object object, const char **path)
{
    if (path) *path = objects[object].path;
    return objects[object].key;
}
