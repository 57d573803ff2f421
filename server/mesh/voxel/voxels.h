/* From a surface to voxels and tetrahedra (paper B section 2.2): the voxels whose centres lie inside, border voxels
 * around them, five tetrahedra per voxel with mirrored parity. server/mesh/README.md gives the theory and the
 * departures from the paper.
 *
 * A refusal for want of a volume carries a number: reason 1, the surface has no extent; reason 2, it is closed but no
 * voxel centre lies inside (the message names a resolution that may do); reason 3, it is open and encloses nothing
 * beyond doubt. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXELS_H
#define PAL_MESH_VOXEL_VOXELS_H
#include "server/mesh/geometry/surface.h"
#include "server/mesh/geometry/tets.h"

/* how inside is decided; tests force one */
typedef enum pal_voxel_method {
    PAL_VOXELS_CHOOSE,
    PAL_VOXELS_SCANLINE,
    PAL_VOXELS_VOTE,
    PAL_VOXELS_WINDING
} pal_voxel_method;

typedef struct pal_voxel_options {
    int resolution; /* voxels on the longest axis, 1..1024                                            */
    bool border; /* keep the face neighbours of inside voxels (paper B) or, with min_fill, what is filled; false: inside
                    only */
    bool largest_only; /* keep only the largest face-connected component of inside voxels, and its border */
    int64_t max_voxel; /* BUDGET beyond this many kept voxels; 0: 50 million                             */
    double min_fill;   /* border voxels are those of which at least this fraction lies inside the surface and that faces
                          join to inside voxels, some through others; 0: all face neighbours */
    bool fill;         /* pal_prepared_make only: measure the fill of every voxel (min_fill > 0 does so too)  */
    double ahead[3];   /* 0..1 per axis: the grid begins this fraction of a voxel before the box of the surface, so that
                          its planes pass through a chosen place (the border of a support); 0: at the box */
    pal_voxel_method method;
} pal_voxel_options;

typedef struct pal_voxels {
    int n[3];           /* grid size, x fastest                                                */
    double edge_m;      /* voxel edge                                                          */
    double low_m[3];    /* corner of voxel (0,0,0), relative to origin_m                       */
    double origin_m[3]; /* as in the surface                                                   */
    uint8_t *kind;      /* 0 outside, 1 border, 2 inside                       [n2][n1][n0]    */
    int64_t n_inside, n_border;
} pal_voxels;

typedef struct pal_voxel_report {
    char method[16];          /* how inside was decided: "scanline" | "vote" | "winding" */
    int n_component;          /* face-connected components of the kept voxels, the border included */
    int64_t n_disagree;       /* voxels that no two axes settle unopposed */
    int64_t n_dropped;        /* face neighbours of inside voxels that min_fill dropped       */
    bool open;                /* some edge has an odd number of triangles                           */
    double surface_volume_m3; /* by the divergence theorem, cavities subtracted, holes closed by fans     */
    double inside_volume_m3;  /* inside voxels                                                     */
    double tree_s, fill_s;    /* time for the box tree (0: not built) and for the fill             */
} pal_voxel_report;

/* REFUSED with numbers when the surface encloses no volume (flat sheet, single triangle, nothing inside), BUDGET,
 * MEMORY */
pal_err pal_voxels_fill(const pal_surface *surface, const pal_voxel_options *options, pal_voxels *out,
                        pal_voxel_report *report, pal_diagnostic *diag);
void pal_voxels_free(pal_voxels *voxels);

/* five tetrahedra per kept voxel, vertices shared, nodes ordered so that neighbours in space are near in memory,
 * boundary faces oriented and surface nodes marked. Peak memory <= 120 bytes per tetrahedron. MEMORY */
pal_err pal_voxels_split(const pal_voxels *voxels, pal_tets *out);
#endif
