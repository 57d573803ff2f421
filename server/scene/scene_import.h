/* Scenes made from a bare surface, a label volume, control cells or a shape of our own. Thread: [load]. */
#ifndef PAL_SCENE_SCENE_IMPORT_H
#define PAL_SCENE_SCENE_IMPORT_H
#include "server/scene/loaded_scene.h"

/* any surface file or label volume -> default scene: material, lowest 5 % held, a grasper, a retractor and a probe;
 * with model adaptive_springs the open edges are held in place of the lowest part when there are some and `hold` is 0.
 * REFUSED also for a surface that this model cannot take, naming the first offender, BUDGET with both numbers when its
 * levels do not fit into 512 MiB. report may be NULL */
pal_err pal_scene_from_surface(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                               pal_surface_scene_report *report, pal_diagnostic *diag);
/* a file of control cells -> default scene of model subdivision_fem; of options: unit_m (0: metres), material, up,
 * hold, gravity and n_level (0: 2, or 1 where that would give more than 2,000 elements). Errors as of
 * pal_cell_file_load */
pal_err pal_scene_from_cells(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                             pal_diagnostic *diag);
/* our own procedural organ as a scene, for when nothing else can be had; or the shapes of
 * server/mesh/geometry/procedural.h: a stomach held at the ends of oesophagus and duodenum, a sphere of radius 0.05 m
 * on anchors fixed in space, a sheet of 17 x 17 vertices and 0.2 m held at its border. REFUSED: there is no such shape
 */
pal_err pal_scene_procedural(const pal_surface_scene *options, pal_loaded_scene **out, pal_surface_scene_report *report,
                             pal_diagnostic *diag);
/* an organ of server/mesh/geometry/organ_family.h by its name FAMILY:SEED, which gives resolution, modulus, support and
 * gravity; of options: fem with its element, law and solver, cells or adaptive, and damping. REFUSED: no such name, or
 * cells that touch along an edge or in a corner only */
pal_err pal_scene_generated(const char *name, const pal_surface_scene *options, pal_loaded_scene **out,
                            pal_diagnostic *diag);
/* other texts than those from the file's name; NULL keeps one. name becomes the only body's name as well. REFUSED for
 * characters that a scene may not hold or too many of them, and then nothing changed */
pal_err pal_scene_rename(pal_loaded_scene *scene, const char *name, const char *title, const char *source,
                         pal_diagnostic *diag);
/* text -> [a-z0-9_-], at most PAL_NAME - 1 characters; otherwise: where none of them is there */
void pal_scene_plain_name(const char *text, const char *otherwise, char out[PAL_NAME]);
/* the first word of PAL_APPEARANCES in a name: "Gall bladder 2" and "gallbladder_ct" are a gall_bladder; "": none */
void pal_scene_guess_appearance(const char *name, char out[PAL_APPEARANCE_BYTES]);

/* ---- private to this room ---- */

/* reads, contours a label if it is a volume, chooses the resolution, makes tetrahedra and skin; report may be NULL */
pal_err pal_scene_prepare_file(const char *path, const pal_surface_scene *options, pal_prepared *out,
                               pal_surface_scene_report *report, pal_diagnostic *diag);
/* The images of the materials of an OBJ file become those of loaded->mesh[0] (scene_image.c). A file of materials or an
 * image that is not there is no fault: report->image says so. REFUSED: it is there and cannot be shown; MEMORY */
pal_err pal_scene_take_images(const char *path, const pal_image_map *map, pal_loaded_scene *loaded,
                              pal_surface_scene_report *report, pal_diagnostic *diag);
/* Leaves out what of body `index` nothing holds (mesh/volume/loose_components.h), once its supports and
 * effects are there, and records it in loaded->loose. Model adaptive_springs keeps all pieces. Errors name the
 * body */
pal_err pal_scene_drop_loose(pal_loaded_scene *loaded, int index, bool largest_only, pal_diagnostic *diag);
/* Model adaptive_springs (scene_adaptive.c). The surface alone, or its largest piece, as a prepared mesh; errors have
 * no file's name */
pal_err pal_scene_adaptive_prepare(const pal_surface *surface, const pal_surface_scene *options, pal_prepared *out,
                                   pal_diagnostic *diag);
/* makes its levels once, to refuse what the model would refuse and to report their sizes; mass by the density in
 * options */
pal_err pal_scene_adaptive_inspect(const pal_surface *surface, const pal_surface_scene *options,
                                   pal_surface_scene_report *report, pal_diagnostic *diag);
/* model, output and supports of a body with defaults */
pal_err pal_scene_adaptive_defaults(pal_body_def *body, const pal_surface_scene *options,
                                    const pal_surface_scene_report *report, pal_diagnostic *diag);
/* a shape of mesh/geometry/procedural.h by name, its box's middle at zero, and how it is held; up where it has one */
typedef struct pal_scene_shape {
    const char *name, *title;
    pal_surface surface;
    bool in_space; /* anchors fixed in space, nothing held */
    int n_support;
    pal_support_def support[2];
    double up[3];
} pal_scene_shape;
pal_err pal_scene_shape_make(const char *name, pal_scene_shape *out, pal_diagnostic *diag);

/* file name without folder and endings: "/a/liver.inr.gz" -> "liver" */
void pal_scene_stem(const char *path, char *out, size_t n_byte);
#endif
