/* Material regions of a scene's body: JSON <-> pal_region (private to this room). Thread: [load]. */
#ifndef PAL_SCENE_REGION_FILE_H
#define PAL_SCENE_REGION_FILE_H
#include "server/scene/json_reader.h"
#include "server/scene/scene_file.h"

/* the list "regions" of a body whose mesh is read already; folder: where relative names of volumes are looked up */
pal_err pal_region_read(const pal_json *json, const cJSON *body, const char *path, const char *folder,
                        pal_loaded_scene *scene, int index);
/* frees what the regions of a body own */
void pal_region_free(pal_loaded_scene *scene, int index);
/* adds the list to a body's object unless it is empty; label volumes get the names of pal_region_volume */
void pal_region_add(cJSON *object, const pal_body_def *body, const char *stem);
/* "STEM_region2.nii", and the file itself: NIfTI-1, one byte a voxel, in the frame of the mesh's file; IO */
void pal_region_volume(const char *stem, int region, char *out, size_t n_byte);
pal_err pal_region_write(const pal_body_def *body, int region, const char *path, pal_note *note);
#endif
