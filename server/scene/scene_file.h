/* Scenes from files: JSON -> pal_scene and the prepared meshes it names. Every error names file and entry path
 * ("scene.json: bodies[0].material.young_Pa: ..."); an unknown key is an error. Thread: [load].
 *
 * {
 *   "name": "liver", "title": "Liver, abdominal CT", "source": "...",
 *   "accuracy": "2.1 % RMS of finite elements",           shown beside the title, at most 127 bytes;
 *               or {"max_error_mm": 1, "text": "..."}      and the cheapest setting of the study beside this file that
 *                                                          is within so much of its reference (palpate study)
 *   "budget": {"step_ms": 4},                             the most accurate setting of that study whose step takes at
 *                                                          most so long; with max_error_mm the cheapest that keeps both
 *   "step_s": 0.0166667,
 *   "up": [0, 0, 1],
 *   "bodies": [{
 *     "name": "liver", "mesh": "liver.palmesh"            (relative to the scene file; or "surface": "x.stl" with
 *                                                          "units": "mm", "resolution": 24, "label": 2,
 *                                                          "triangles": 50000, prepared at load)
 *     "largest": true,                                     keep only the largest of its components: what is joined by
 *                                                          faces. Without it components without support are dropped
 *                                                          below 1 % of the largest one and refused above, unless
 *                                                          nothing of the body is held (mesh/loose_components.h)
 *     "material": {"young_Pa": 5000, "poisson": 0.45, "density_kg_m3": 1000, "damping_1_s": 4},
 *     "regions": [                                         other materials in parts of the body, at most 32; what a
 *                                                          region does not give is the body's; later ones win. Springs
 *                                                          take them where their constants are derived (spring_law.h),
 *                                                          adaptive surfaces E and density
 *       {"box": {"low_m": [..], "high_m": [..]}, "young_Pa": 50000, "poisson": 0.3, "density_kg_m3": 1100},
 *       {"label": {"volume": "liver.nii.gz", "is": 2}, "young_Pa": 50000},    where that scan's voxels have the label;
 *                                                          the scan lies in the frame of the surface's file
 *       {"grid": {"n": [3, 2, 2], "low_m": [..], "high_m": [..], "young_Pa": [12 numbers, x fastest], "poisson": [..],
 *                 "density_kg_m3": [..]}}                  trilinear between its nodes, the border's values beyond
 *     ],
 *     "model": {"name": "tet_springs", "k_distance_J": ...}, (the keys stand in sim/models, one file each)
 *               or {"name": "tet_springs", "weights": "volume", "grid": {"n": [5, 5, 3], "low_m": [..], "high_m": [..],
 *                   "k_distance_J": [75 numbers, x fastest], "k_area_J": [..], "k_volume_J": [..]}}
 *                                                          constants of springs that vary over the body
 *               or {"name": "fem", "element": "hex8_bbar", "law": "corotational", "fill": true} (sim/models/fem.c)
 *               or {"name": "adaptive_springs", "levels": 2, ...} (sim/models/adaptive_springs.c): a hollow organ,
 *                                                          springs on the surface itself; a "surface" is taken as it
 *                                                          is, without voxels
 *               or {"name": "subdivision_fem", "levels": 2, ...} (sim/models/subdivision_fem.c), with "cells"
 *     "cells": "chair.palcells"                            in place of mesh or surface: control cells, .palcells or
 *                                                          .vtk, in "units" (m), moved so that the middle of their box
 *                                                          is at 0; with "origin_m": [..] they are about it already
 *     "strokes": [                                         painted on the rest shape of such a body, at most 4096;
 *                                                          E and density times factor^w, w falling over the
 *                                                          outer `soft` part
 *       {"at_m": [..], "radius_m": 0.02, "soft": 0.5, "young_factor": 10, "density_factor": 1}],
 *     "cut": {"normal": [1, 0, 0], "offset_m": 0},         of such a body: its cells beyond the plane are not shown
 *     "solver": {"name": "verlet"}, or {"name": "implicit_euler", ...} (the keys stand in sim/solvers, one file each)
 *     "output": {"name": "skin_output"},
 *     "supports": [{"lowest": 0.05}, {"box": {"low_m": [..], "high_m": [..]}},
 *                  {"boundary": true}],                    the open edges of the surface (model adaptive_springs)
 *     "effects": [{"name": "gravity"}, {"name": "tool_push", ...}, {"name": "tool_grasp"}, {"name": "finite_guard"}]
 *   }],
 *   "tools": [{"name": "probe 1", "radius_m": 0.008, "force_cap_N": 15}]
 * }
 * and "gravity_m_s2": 9.81, "max_substep": 2000 beside step_s.
 * Boxes, grids and strokes are in the body's frame: metres from origin_m of the prepared mesh, which is the middle of
 * the surface's box, or from the middle of the cells' box. Absent keys take the defaults of pal_scene_default and
 * pal_body_default. */
#ifndef PAL_SCENE_SCENE_FILE_H
#define PAL_SCENE_SCENE_FILE_H
#include "server/scene/scene_import.h"

/* at most 1 MiB of JSON, depth 16; *out is freed with pal_scene_free. IO, REFUSED, BUDGET, MEMORY */
pal_err pal_scene_load(const char *path, pal_loaded_scene **out, pal_diagnostic *diag);
/* folder: where relative mesh names are looked up; name: used in messages */
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
