/* Scenes from files and to files: JSON <-> pal_scene and the prepared meshes it names. README.md has every key. Every
 * error names file and entry path ("scene.json: bodies[0].material.young_Pa: ..."); an unknown key is an error.
 * Thread: [load]. */
#ifndef PAL_SCENE_SCENE_FILE_H
#define PAL_SCENE_SCENE_FILE_H
#include "server/scene/scene_import.h"

/* at most 1 MiB of JSON, depth 16; *out is freed with pal_scene_free. IO, REFUSED, BUDGET, MEMORY */
pal_err pal_scene_load(const char *path, pal_loaded_scene **out, pal_diagnostic *diag);
/* folder: the folder of relative mesh names; name: used in messages */
pal_err pal_scene_parse(const char *name, const char *json, size_t n_byte, const char *folder, pal_loaded_scene **out,
                        pal_diagnostic *diag);
/* writes DIR/scene.json, DIR/NAME.palmesh (NAME.palcells) for every body and NAME_regionK.nii for every label region,
 * scene.json last; makes DIR; numbers come back with the same bits. IO, REFUSED (scene.json longer than pal_scene_load
 * takes), and then nothing that this call wrote is left */
pal_err pal_scene_save(const pal_loaded_scene *scene, const char *folder, pal_diagnostic *diag);
/* the same with the scene in a file of any name in a folder that is there, and the meshes beside it */
pal_err pal_scene_save_file(const pal_loaded_scene *scene, const char *path, pal_diagnostic *diag);
/* makes a folder and those above it; IO */
pal_err pal_scene_make_folder(const char *folder, pal_diagnostic *diag);
#endif
