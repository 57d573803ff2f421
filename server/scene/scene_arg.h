/* The SCENE word of a command: a scene file, a folder with a scene.json, control cells (.palcells), or
 * any surface or scan. What was left out because nothing holds it is logged. Thread: [load]. */
#ifndef PAL_SCENE_SCENE_ARG_H
#define PAL_SCENE_SCENE_ARG_H
#include "server/scene/scene_file.h"

/* options are for cells, a surface or scan; NULL: defaults. is_surface out may be NULL; report (of a surface) may be
 * NULL */
pal_err pal_scene_arg(const char *word, const pal_surface_scene *options, pal_loaded_scene **out, bool *is_surface,
                      pal_surface_scene_report *report, pal_diagnostic *diag);
#endif
