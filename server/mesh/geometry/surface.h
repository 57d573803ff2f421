/* Triangle surfaces at rest: positions, triangles, welding and cleaning, adjacency, measures.
 *
 * A pal_surface owns its arrays (heap); pal_surface_free frees them. Positions are metres relative to origin_m, which
 * is subtracted in double precision while reading, so that a body far from the file's origin keeps its accuracy.
 * Triangles are counter-clockwise seen from outside when the file means them so. Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_SURFACE_H
#define PAL_MESH_GEOMETRY_SURFACE_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct pal_surface {
    int n_vertex, n_tri;
    double *x;          /* position relative to origin_m, m     [n_vertex][3] */
    int32_t *tri;       /* vertex indices                       [n_tri][3]    */
    double origin_m[3]; /* file position (in m) = x + origin_m                */
    /* places of the corners in images, u and v from the lower left corner, and the number of the triangle's image, -1:
     * none; NULL: the surface has no images (image_map.h) [n_tri][3][3] */
    float *image_at;
} pal_surface;

/* counts of what reading and cleaning dropped, joined or repaired */
typedef struct pal_surface_report {
    char format[16];                   /* "obj", "stl binary", "stl ascii", "ply", "off", "nifti", "inr"         */
    char place[32];                    /* where the first face or voxel stands: "line 12", "byte 84"; or empty   */
    int64_t n_vertex_read, n_tri_read; /* as stored; polygons count as their triangles                           */
    int64_t n_welded;                  /* vertices joined to an earlier one                                      */
    double max_weld_m;                 /* farthest that one of them was from it                                  */
    int64_t n_degenerate, n_duplicate; /* triangles dropped: repeated corner or no area; same three corners      */
    int64_t n_nonfinite;               /* triangles dropped because a corner is NaN or infinite                  */
    int64_t n_unused;                  /* vertices of no triangle, dropped                                       */
    int64_t n_folded;   /* triangles dropped besides because their doubles have the other orientation: fins  */
    int64_t n_repaired; /* triangles without area between three corners, repaired by splitting a neighbour   */
} pal_surface_report;

/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_surface_free(pal_surface *surface);
/* deep copy; MEMORY */
pal_err pal_surface_copy(const pal_surface *from, pal_surface *to);

/* Joins each vertex to the first earlier one that stays and is within tolerance (relative to the bounding-box diagonal;
 * 0: equal positions only). Those that stay are farther apart, so that no chain of vertices contracts. Drops
 * degenerate, duplicate and non-finite triangles and unused vertices, recentres, and adds the counts to report (may be
 * NULL). In place. REFUSED when no triangle is left, MEMORY. */
pal_err pal_surface_clean(pal_surface *surface, double tolerance, pal_surface_report *report, pal_diagnostic *diag);

/* moves the box centre to zero and adds it to origin_m */
void pal_surface_recentre(pal_surface *surface);

/* axis-aligned box; diagonal = |high - low| */
void pal_surface_box(const pal_surface *surface, double low_m[3], double high_m[3]);
double pal_surface_area(const pal_surface *surface);   /* m^2 */
double pal_surface_volume(const pal_surface *surface); /* signed, m^3: meaningful for closed surfaces */

/* triangles around each vertex as sparse rows: start [n_vertex+1], item [3 n_tri]; the caller frees both; MEMORY */
pal_err pal_surface_fans(const pal_surface *surface, int32_t **start, int32_t **item);

/* a side of a triangle in the row of the smaller of its vertices */
typedef struct pal_surface_side {
    int32_t high, corner; /* larger vertex; 3 t + k for the side from corner k to corner k + 1 of triangle t */
} pal_surface_side;
/* all sides by their smaller, then their larger vertex, then by corner, so that the sides of an edge lie side by side:
 * start [n_vertex+1], side [3 n_tri]; the caller frees both; MEMORY */
pal_err pal_surface_sides(const pal_surface *surface, int32_t **start, pal_surface_side **side);

/* drops vertices of no triangle, and image_at, and keeps the order of the others; map [n_vertex] is scratch */
void pal_surface_drop_unused(pal_surface *surface, int32_t *map);

/* edge-connected components: label of each triangle [n_tri] (caller's memory), number out; MEMORY */
pal_err pal_surface_components(const pal_surface *surface, int32_t *label, int *n_component);

/* topology for reports: edges with one triangle, with more than two, and with two in the same direction */
typedef struct pal_surface_topology {
    int n_open_edge, n_nonmanifold_edge, n_misoriented_edge;
    int n_nonmanifold_vertex; /* vertices with more than one fan of triangles */
    bool closed, manifold, oriented;
} pal_surface_topology;
pal_err pal_surface_check(const pal_surface *surface, pal_surface_topology *out);

/* area-weighted unit vertex normals [n_vertex][3] (caller's memory); a vertex without area gets zero */
void pal_surface_normals(const pal_surface *surface, double *normal);
#endif
