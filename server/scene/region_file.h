/* What varies over a scene's body: material regions, constants of springs on a grid; JSON <-> pal_region,
 * pal_spring_grid (private to this room). Thread: [load]. */
#ifndef PAL_SCENE_REGION_FILE_H
#define PAL_SCENE_REGION_FILE_H
#include "server/scene/json_reader.h"
#include "server/scene/loaded_scene.h"

enum { PAL_GRID_NODES_MAX = 65536 }; /* nodes of a grid in a file */

/* the list "regions" of a body whose mesh is read already */
pal_err pal_region_read(const pal_json *body, pal_loaded_scene *scene, int index);
/* adds the list to a body's object unless it is empty; label volumes get the names of pal_region_volume */
void pal_region_append(cJSON *object, const pal_body_def *body, const char *stem);
/* "STEM_region2.nii", and the file itself: NIfTI-1, one byte a voxel, in the frame of the mesh's file; IO */
void pal_region_volume(const char *stem, int region, char *out, size_t n_byte);
pal_err pal_region_write(const pal_body_def *body, int region, const char *path, pal_diagnostic *diag);

/* the key "grid" of a body's model, whose name is read already; nothing when it is absent */
pal_err pal_spring_grid_read(const pal_json *model, pal_loaded_scene *scene, int index);
/* adds the key to a model's object unless there is no grid; every number comes back with the same bits */
void pal_spring_grid_append(cJSON *model, const pal_spring_grid *grid);
#endif
