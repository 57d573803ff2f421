/* A scene with the meshes that it owns, and the options of a scene that is made from a surface or a scan. The core of
 * this room: it knows none of the other files. Thread: [load]. */
#ifndef PAL_SCENE_LOADED_SCENE_H
#define PAL_SCENE_LOADED_SCENE_H
#include "server/mesh/geometry/image_map.h"
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
    pal_cells cells[PAL_BODY_MAX];                 /* control cells about the body's origin; of another model none   */
    pal_stroke *stroke[PAL_BODY_MAX];              /* what a body's strokes borrow, from malloc; NULL: none          */
    double *spring_grid[PAL_BODY_MAX];             /* what a body's spring_grid borrows, from malloc; NULL: none */
    pal_image image[PAL_BODY_MAX][PAL_IMAGES_MAX]; /* shown on the bodies; bytes NULL: none */
    pal_loose_components loose[PAL_BODY_MAX];      /* components left out because nothing holds them */
    int n_mesh;
} pal_loaded_scene;

void pal_scene_free(pal_loaded_scene *scene); /* NULL is fine */
/* gives body `index` the images that were read for it */
void pal_scene_show_images(pal_loaded_scene *scene, int index);

/* how a bare surface or label volume is turned into a scene */
typedef struct pal_surface_scene {
    double unit_m;  /* 0: guess                                            */
    int resolution; /* 0: about 13,000 tetrahedra; fem: about 2,500 nodes  */
    int label;      /* of a label volume; < 0: the most frequent           */
    bool threshold; /* values from low to high of a volume are the body    */
    int32_t low, high;
    int target_tri;        /* shown triangles of a label volume's surface; 50,000, adaptive 1,500; a surface file that
                            * adapts is made as coarse as that when it is given, or has more than 3,000 */
    pal_material material; /* young_Pa 0: the default material                 */
    bool largest_only;     /* keep only the largest of several components         */
    double up[3];          /* unit, away from the ground; 0 0 0: (0, 0, 1)            */
    char axes[PAL_AXES_BYTES]; /* where x, y and z point in the patient, "LPS"; "": as the scan says, if it does */
    bool no_image;             /* of pal_scene_from_surface: leave the images of an OBJ file out */
    pal_image_map *image;      /* becomes where images lie on an OBJ file's surface; NULL: none is shown */
    const char *appearance; /* a word of PAL_APPEARANCES; NULL: the one in the name of the file or shape, else plastic
                             * for control cells and none for others */
    double hold;            /* lowest part of the height held in place; 0: 0.05, of cells
                             * more where that is not an eighth of the control vertices     */
    bool
        gravity; /* add the effect; a scanned shape is in equilibrium with its weight already, so the default is none */
    bool area_springs; /* add the component face_area; without it edges and volumes take its share */
    /* model fem in place of springs */
    bool fem;
    const char *element, *law, *solver; /* NULL: hex8_bbar, corotational, implicit_euler */
    bool cells; /* generated organs only: subdivision_fem on voxels of twice the edge as control cells */
    /* model adaptive_springs in place of springs: the surface as it is, without voxels */
    bool adaptive;
    int n_level;        /* 0: 2                                                           */
    double thickness_m; /* 0: 0.003                                                       */
    double inflate_Pa;  /* not 0: the component inflate with this pressure; closed surfaces only */
    const char *shape;  /* of pal_scene_procedural: "organ" (NULL), "stomach", "sphere", "sheet" */
    void (*progress)(const char *what, double fraction, void *user); /* may be NULL */
    void *user;
} pal_surface_scene;

typedef struct pal_surface_scene_report {
    pal_surface_report surface;
    pal_prepare_report prepare;
    double unit_m;
    const char *unit_name; /* "mm", "m", "given", ... */
    bool unit_guessed;     /* not given: derived from the size */
    char image[160];       /* which images are shown, or why none that the file names; "": it names none */
    double read_s;
    int resolution;
    int label;                 /* of a label volume, -1: a surface                */
    char axes[PAL_AXES_BYTES]; /* given, or of the scan; "": not known */
    int n_label;               /* labels it holds beside 0, at most 64 are counted */
    /* of model adaptive_springs, all its levels; n_level 0: another model */
    int n_level, n_node[PAL_LEVELS_MAX], n_spring[PAL_LEVELS_MAX];
    int n_piece, n_open_edge;           /* pieces without a common edge; 0 open edges: closed      */
    double area_m2, volume_m3, mass_kg; /* volume_m3 0: not closed                                 */
    size_t level_byte;                  /* memory of the levels                                    */
} pal_surface_scene_report;
#endif
