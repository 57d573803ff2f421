/* Bodies of control cells and what is painted on them: JSON <-> pal_body_def.cells, cut, pal_stroke (private to this
 * room). Thread: [load]. */
#ifndef PAL_SCENE_SUBDIVISION_FILE_H
#define PAL_SCENE_SUBDIVISION_FILE_H
#include "server/scene/json_reader.h"
#include "server/scene/loaded_scene.h"

/* Cells of a file as body `index`: in metres about the body's origin, and mesh [index] from their boundary. The origin
 * is *origin_m where it is given (NULL: not), and the file's positions are about it already; else the middle of their
 * box. unit_m: of the file's positions. Errors as of pal_cell_file_load */
pal_err pal_subdivision_load(const char *file, double unit_m, const double *origin_m, pal_loaded_scene *scene,
                             int index, pal_diagnostic *diag);
/* makes mesh [index] again from the boundary of cells [index], about the same origin; MEMORY */
pal_err pal_subdivision_update_surface(pal_loaded_scene *scene, int index, pal_diagnostic *diag);
/* the keys "cells", "units" and "origin_m" of a body */
pal_err pal_subdivision_read(const pal_json *body, pal_loaded_scene *scene, int index);
/* the list "strokes" of a body */
pal_err pal_strokes_read(const pal_json *body, pal_loaded_scene *scene, int index);
/* the key "cut" of a body: {"normal": [..], "offset_m": 0} */
pal_err pal_cut_read(const pal_json *body, pal_body_def *def);
/* adds "cells" with this file's name, "origin_m", and "cut" and "strokes" where there are such, to a body's object */
void pal_subdivision_append(cJSON *object, const pal_body_def *body, const char *file);
#endif
