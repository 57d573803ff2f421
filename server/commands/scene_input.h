/* The scene that an operand of a command names, in the configuration that it asks for: what serve would run.
 * Thread: [load]. */
#ifndef PAL_COMMANDS_SCENE_INPUT_H
#define PAL_COMMANDS_SCENE_INPUT_H
#include "server/scene/scene_arg.h"
#include "server/study/studied_scene.h"

typedef struct pal_scene_input {
    pal_loaded_scene *loaded;
    pal_studied_scene studied; /* studied.scene is the scene to run */
} pal_scene_input;

/* path: scene.json, its folder, control cells, a surface or a scan; input: zeroed. Close it also after an error. */
static inline pal_err pal_scene_input_open(const char *path, pal_scene_input *input, pal_diagnostic *diag)
{
    PAL_TRY(pal_scene_arg(path, NULL, &input->loaded, NULL, NULL, diag));
    return pal_studied_scene_open(path, &input->loaded->scene, &input->studied, diag);
}

static inline void pal_scene_input_close(pal_scene_input *input)
{
    pal_studied_scene_close(&input->studied);
    pal_scene_free(input->loaded);
}
#endif
