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
#include "server/mesh/geometry/levels.h"
#include "server/mesh/volume/loose_components.h"
#include "server/sim/core/definition.h"

/* what a region borrows */
typedef struct pal_loaded_region {
    uint8_t *label;
    double *grid;
} pal_loaded_region;

/* a scene with the meshes, regions and grids it owns; the address of `scene` stays */
typedef struct pal_loaded_scene {
    pal_scene scene;
    pal_prepared mesh[PAL_BODY_MAX];
    pal_loaded_region region[PAL_BODY_MAX][PAL_REGION_MAX];
    pal_cells cells[PAL_BODY_MAX];            /* control cells about the body's origin; of another model none   */
    pal_stroke *stroke[PAL_BODY_MAX];         /* what a body's strokes borrow, from malloc; NULL: none          */
    double *spring_grid[PAL_BODY_MAX];        /* what a body's spring_grid borrows, from malloc; NULL: none */
    pal_loose_components loose[PAL_BODY_MAX]; /* components left out because nothing holds them */
    int n_mesh;
} pal_loaded_scene;

/* at most 1 MiB of JSON, depth 16; *out is freed with pal_scene_free. IO, REFUSED, BUDGET, MEMORY */
pal_err pal_scene_load(const char *path, pal_loaded_scene **out, pal_diagnostic *diag);
/* folder: where relative mesh names are looked up; name: used in messages */
pal_err pal_scene_parse(const char *name, const char *json, size_t n_byte, const char *folder, pal_loaded_scene **out,
                        pal_diagnostic *diag);
void pal_scene_free(pal_loaded_scene *scene);
/* how a bare surface or label volume is turned into a scene */
typedef struct pal_surface_scene {
    double unit_m;         /* 0: guess                                            */
    int resolution;        /* 0: about 13,000 tetrahedra; fem: about 2,500 nodes  */
    int label;             /* of a label volume; < 0: the most frequent           */
    int target_tri;        /* shown triangles of a label volume's surface; 50,000, adaptive 1,500; a surface file that
                            * adapts is made as coarse as that when it is given, or has more than 3,000 */
    pal_material material; /* young_Pa 0: the default material                 */
    bool largest_only;     /* keep only the largest of several components         */
    double up[3];          /* unit, away from the ground; 0 0 0: (0, 0, 1)            */
    double hold;           /* lowest part of the height held in place; 0: 0.05, of cells
                            * more where that is not an eighth of the control vertices     */
    bool gravity;      /* add the effect; a shape as scanned carries its own weight already, so the default is none */
    bool area_springs; /* add the row face_area; without it edges and volumes bear its share */
    /* model fem in place of springs */
    bool fem;
    const char *element, *law, *solver; /* NULL: hex8_bbar, corotational, implicit_euler */
    /* model adaptive_springs in place of springs: the surface as it is, without voxels */
    bool adaptive;
    int n_level;        /* 0: 2                                                           */
    double thickness_m; /* 0: 0.003                                                       */
    double inflate_Pa;  /* not 0: the row inflate with this pressure; closed surfaces only */
    const char *shape;  /* of pal_scene_procedural: "organ" (NULL), "stomach", "sphere", "sheet" */
    void (*progress)(const char *what, double fraction, void *user); /* may be NULL */
    void *user;
} pal_surface_scene;

typedef struct pal_surface_scene_report {
    pal_surface_report surface;
    pal_prepare_report prepare;
    double unit_m;
    const char *unit_name; /* "mm", "m", "given", ... */
    bool unit_guessed;     /* nobody said it: taken from the size */
    double read_s;
    int resolution;
    int label;   /* of a label volume, -1: a surface                */
    int n_label; /* labels it holds beside 0, at most 64 are counted */
    /* of model adaptive_springs, all its levels; n_level 0: another model */
    int n_level, n_node[PAL_LEVELS_MAX], n_spring[PAL_LEVELS_MAX];
    int n_piece, n_open_edge;           /* pieces without a common edge; 0 open edges: closed      */
    double area_m2, volume_m3, mass_kg; /* volume_m3 0: not closed                                 */
    size_t level_byte;                  /* memory of the levels                                    */
} pal_surface_scene_report;

/* any surface file or label volume -> default scene: material, lowest 5 % held, three tools; with model
 * adaptive_springs the open edges are held in place of the lowest part when there are some and nobody asked for `hold`.
 * REFUSED also for a surface that this model cannot take, naming the first offender, BUDGET with both numbers when its
 * levels do not fit into 512 MiB. report may be NULL */
pal_err pal_scene_from_surface(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                               pal_surface_scene_report *report, pal_diagnostic *diag);
/* a file of control cells -> default scene of model subdivision_fem; of options: unit_m (0: metres), material, up,
 * hold, gravity and n_level (0: 2, or 1 where that would give more than 2,000 elements). Errors as of
 * pal_cell_file_load */
pal_err pal_scene_from_cells(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                             pal_diagnostic *diag);
/* our own procedural organ as a scene, for when nothing else can be had; or the shapes of mesh/stomach.h: a stomach
 * held at the ends of oesophagus and duodenum, a sphere of radius 0.05 m on anchors fixed in space, a sheet of 17 x 17
 * vertices and 0.2 m held at its border. REFUSED: there is no such shape */
pal_err pal_scene_procedural(const pal_surface_scene *options, pal_loaded_scene **out, pal_surface_scene_report *report,
                             pal_diagnostic *diag);
/* writes DIR/scene.json, DIR/NAME.palmesh (NAME.palcells) for every body and NAME_regionK.nii for every label region,
 * scene.json last; makes DIR; numbers come back with the same bits. IO, REFUSED (scene.json longer than pal_scene_load
 * takes), and then nothing that this call wrote is left */
pal_err pal_scene_save(const pal_loaded_scene *scene, const char *folder, pal_diagnostic *diag);
/* the same with the scene in a file of any name in a folder that is there, and the meshes beside it */
pal_err pal_scene_save_file(const pal_loaded_scene *scene, const char *path, pal_diagnostic *diag);
/* other texts than those from the file's name; NULL keeps one. name becomes the only body's name as well. REFUSED for
 * characters that a scene may not hold or too many of them, and then nothing changed */
pal_err pal_scene_rename(pal_loaded_scene *scene, const char *name, const char *title, const char *source,
                         pal_diagnostic *diag);
/* makes a folder and those above it; IO */
pal_err pal_scene_make_folder(const char *folder, pal_diagnostic *diag);
#endif
