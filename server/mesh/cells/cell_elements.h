/* Finite elements of a subdivision solid and their nodes (paper A section 3.4).
 *
 *   cubic    64 nodes, uniform tricubic B-spline (3.4.1, 3.4.4): a hexahedron away from the boundary in a regular
 *            neighbourhood. Node m = 16 j + 4 k + l has the shape function B_j(u) B_k(v) B_l(w); the cell's own corners
 *            have j, k, l in {1, 2}.
 *   hex      8 nodes, trilinear (3.4.2): all other hexahedra. Corner c at bits 0, 1, 2 for u, v, w
 *   pyramid  5 nodes (3.4.3): one for each quad of any other cell. Its base counter-clockwise seen from the apex, then
 *            the apex, a virtual node in the mean of the cell's vertices (num/spline.h)
 *
 * (u, v, w) is right-handed: det of d(x,y,z)/d(u,v,w) is positive in a cell that is not inside out. Its origin is the
 * cell's first vertex, u runs along the first edge use there. Nodes up to n_vertex - 1 are vertices of the complex,
 * node n_vertex + i is virtual node i, no degree of freedom of its own but one more row of d = A p. Owns its arrays
 * (heap); constant once made. Thread: [load] to make, [any] to read. */
#ifndef PAL_MESH_CELLS_CELL_ELEMENTS_H
#define PAL_MESH_CELLS_CELL_ELEMENTS_H
#include "server/mesh/cells/cells.h"
#include "server/num/interpolation.h"

enum { PAL_CUBIC_NODES = 64, PAL_PYRAMID_NODES = 5 };

typedef enum pal_cell_kind { PAL_CELL_CUBIC, PAL_CELL_HEX, PAL_CELL_PYRAMID, PAL_CELL_KINDS } pal_cell_kind;

typedef struct pal_cell_elements {
    int32_t n_vertex, n_virtual;
    int32_t n[PAL_CELL_KINDS];      /* elements of each kind                                                   */
    int32_t *node[PAL_CELL_KINDS];  /* [n][64], [n][8], [n][5]                                                 */
    int32_t *cell[PAL_CELL_KINDS];  /* cell of each element, ascending                                    [n]  */
    int32_t *virtual_cell;          /* cell of each virtual node, ascending                       [n_virtual]  */
    pal_interpolation virtual_rows; /* virtual nodes by vertices of the complex     [n_virtual rows of n_vertex] */
} pal_cell_elements;

/* REFUSED: a cell that is no hexahedron has a face that is no quad (any complex subdivided once has quads only), with
 * cell, face and number; MEMORY */
pal_err pal_cell_elements_make(const pal_cells *cells, pal_cell_elements *out, pal_diagnostic *diag);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_cell_elements_free(pal_cell_elements *e);

/* interpolation of all nodes, virtual ones last, from that of the vertices (matrix A of pal_subdivision); MEMORY */
pal_err pal_cell_elements_interpolation(const pal_cell_elements *e, const pal_interpolation *vertices,
                                        pal_interpolation *out);

static inline int pal_cell_kind_nodes(pal_cell_kind kind)
{
    return kind == PAL_CELL_CUBIC ? PAL_CUBIC_NODES : kind == PAL_CELL_HEX ? 8 : PAL_PYRAMID_NODES;
}
/* all elements, #FE of Table 1 of paper A */
static inline int32_t pal_cell_elements_count(const pal_cell_elements *e)
{
    return e->n[PAL_CELL_CUBIC] + e->n[PAL_CELL_HEX] + e->n[PAL_CELL_PYRAMID];
}
/* elements of a kind in percent of all: %BE, %LE, %PE of Table 1 */
static inline double pal_cell_elements_percent(const pal_cell_elements *e, pal_cell_kind kind)
{
    int32_t all = pal_cell_elements_count(e);
    return all ? 100.0 * e->n[kind] / all : 0;
}
#endif
