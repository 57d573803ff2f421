/* MacCracken-Joy subdivision of solids (paper A section 3.1; MacCracken, Joy 1996): from control cells to many small
 * ones.
 *
 * A level cuts every cell into one new cell for each of its vertices: where k of the cell's faces meet in the vertex,
 * the new cell has 2 k quads, so it is a hexahedron where k = 3. New vertices, in this order: one for each old vertex,
 * edge, face and cell. New cell i corresponds to entry i of the old complex's cell_vertex, its first vertex being the
 * old one.
 *
 * The new vertices are weighted sums of the old ones, d = A p over all levels. On the boundary and on creases the
 * weights use no interior vertex: boundary surfaces are Catmull-Clark surfaces (with averaging, only where four faces
 * meet), creases cubic B-splines. server/mesh/README.md gives the rules. Thread: [load] to make, [any] to read. */
#ifndef PAL_MESH_CELLS_MACCRACKEN_JOY_H
#define PAL_MESH_CELLS_MACCRACKEN_JOY_H
#include "server/mesh/cells/cells.h"
#include "server/num/interpolation.h"

#define PAL_SUBDIVISION_MAX 8 /* levels */

typedef enum pal_subdivision_rule {
    PAL_SUBDIVISION_MACCRACKEN_JOY, /* weights of MacCracken, Joy 1996                                           */
    PAL_SUBDIVISION_AVERAGING,      /* Bajaj, Schaefer, Warren, Xu 2002: cut without moving, then every vertex to the
                                     * mean of its cells' centroids. The same where the complex is regular           */
} pal_subdivision_rule;

typedef struct pal_subdivision_options {
    int n_level; /* 0..PAL_SUBDIVISION_MAX; 0: the control cells themselves     */
    pal_subdivision_rule rule;
    size_t budget_byte; /* most memory, about, while it is made; 0: 512 MiB            */
} pal_subdivision_options;

/* Sharp features. An edge becomes its midpoint, a face its centroid, a vertex stays, for as many levels as the
 * sharpness says; a remainder below 1 blends with the smooth rule for one level more (DeRose, Kass, Truong 1998). A
 * vertex with two sharp edges lies on a crease, with three or more it is a corner; at the boundary, only edges of the
 * boundary count. A sharp face does not sharpen its edges: tag them too for a flat face with crisp sides. Pinched edges
 * become their midpoints, pinched vertices stay. Features inside a thin or strongly bent solid may fold cells, because
 * their surroundings move and they do not; on the boundary they usually do not. */
typedef struct pal_subdivision {
    int n_level;
    pal_cells cells;        /* after the last level; x = A p to the bit                                   */
    pal_interpolation rows; /* A                          [cells.n_vertex rows of control vertices]       */
    int32_t *cell_origin;   /* control cell that each cell is part of                      [cells.n_cell] */
    int32_t *face_origin;   /* control face that each face is part of, -1: inside a cell   [cells.n_face] */
    size_t n_byte;          /* memory of all arrays, about                                                */
} pal_subdivision;

/* The control cells are copied. REFUSED: number of levels out of range, or the cells of a level fold, with level, cell
 * and number. BUDGET, with both numbers, before the memory is allocated; MEMORY. */
pal_err pal_subdivision_make(const pal_cells *control, const pal_subdivision_options *options, pal_subdivision *out,
                             pal_diagnostic *diag);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_subdivision_free(pal_subdivision *s);
#endif
