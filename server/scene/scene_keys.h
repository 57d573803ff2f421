/* The keys of a scene file, object by object: what the readers take and what README.md documents. Thread: [any]. */
#ifndef PAL_SCENE_SCENE_KEYS_H
#define PAL_SCENE_SCENE_KEYS_H

typedef enum pal_scene_object {
    PAL_KEYS_SCENE,
    PAL_KEYS_ACCURACY,
    PAL_KEYS_BUDGET,
    PAL_KEYS_TOOL,
    PAL_KEYS_BODY,
    PAL_KEYS_MATERIAL,
    PAL_KEYS_REGION,
    PAL_KEYS_REGION_BOX,
    PAL_KEYS_LABEL,
    PAL_KEYS_REGION_GRID,
    PAL_KEYS_MODEL, /* beside the keys of the model itself */
    PAL_KEYS_SPRING_GRID,
    PAL_KEYS_SUPPORT,
    PAL_KEYS_SUPPORT_BOX,
    PAL_KEYS_STROKE,
    PAL_KEYS_CUT,
    PAL_KEYS_OBJECTS
} pal_scene_object;

/* the keys of an object, NULL-terminated; path as in README.md ("bodies[].material.", "": the scene), may be NULL */
const char *const *pal_scene_keys(pal_scene_object object, const char **path);
#endif
