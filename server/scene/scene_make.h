/* Surface or label volume -> prepared mesh (private to this room). Thread: [load]. */
#ifndef PAL_SCENE_SCENE_MAKE_H
#define PAL_SCENE_SCENE_MAKE_H
#include "server/scene/scene_file.h"

/* reads, contours a label if it is a volume, chooses the resolution, makes tetrahedra and skin; report may be NULL */
pal_err pal_scene_prepare_file(const char *path, const pal_surface_scene *options, pal_prepared *out,
                               pal_surface_scene_report *report, pal_note *note);
/* text -> [a-z0-9_-], at most PAL_NAME - 1 characters, never empty */
void pal_scene_plain_name(const char *text, char out[PAL_NAME]);
/* file name without folder and endings: "/a/liver.inr.gz" -> "liver" */
void pal_scene_stem(const char *path, char *out, size_t n_byte);
#endif
