/* Surface or label volume -> prepared mesh and its scene (private to this room). Thread: [load]. */
#ifndef PAL_SCENE_SCENE_IMPORT_H
#define PAL_SCENE_SCENE_IMPORT_H
#include "server/scene/scene_file.h"

/* reads, contours a label if it is a volume, chooses the resolution, makes tetrahedra and skin; report may be NULL */
pal_err pal_scene_prepare_file(const char *path, const pal_surface_scene *options, pal_prepared *out,
                               pal_surface_scene_report *report, pal_diagnostic *diag);
/* Leaves out what of body `index` nothing holds (scene_loose.c, mesh/loose_components.h), once its supports and effects
 * are there, and says in loaded->loose what that was. Model adaptive_springs keeps all pieces. Errors name the body */
pal_err pal_scene_drop_loose(pal_loaded_scene *loaded, int index, bool largest_only, pal_diagnostic *diag);
/* Model adaptive_springs (scene_adaptive.c). The surface alone, or its largest piece, as a prepared mesh; errors have
 * no file's name */
pal_err pal_scene_adaptive_prepare(const pal_surface *surface, const pal_surface_scene *options, pal_prepared *out,
                                   pal_diagnostic *diag);
/* makes its levels once, to refuse what the model would and to tell what they have; mass by the density in options */
pal_err pal_scene_adaptive_inspect(const pal_surface *surface, const pal_surface_scene *options,
                                   pal_surface_scene_report *report, pal_diagnostic *diag);
/* model, output and supports of a body with defaults */
pal_err pal_scene_adaptive_defaults(pal_body_def *body, const pal_surface_scene *options,
                                    const pal_surface_scene_report *report, pal_diagnostic *diag);
/* a shape of mesh/stomach.h by name, its box's middle at zero, and how it is held; up where it has one */
typedef struct pal_scene_shape {
    const char *name, *title;
    pal_surface surface;
    bool in_space; /* anchors fixed in space, nothing held */
    int n_support;
    pal_support_def support[2];
    double up[3];
} pal_scene_shape;
pal_err pal_scene_shape_make(const char *name, pal_scene_shape *out, pal_diagnostic *diag);

/* text -> [a-z0-9_-], at most PAL_NAME - 1 characters, never empty */
void pal_scene_plain_name(const char *text, char out[PAL_NAME]);
/* file name without folder and endings: "/a/liver.inr.gz" -> "liver" */
void pal_scene_stem(const char *path, char *out, size_t n_byte);
#endif
