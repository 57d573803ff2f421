/* Control cells of plain solids, made of hexahedra. Lengths in metres; vertices and cells are numbered in rows, the
 * first count running fastest. All: REFUSED names the number out of range, BUDGET over PAL_CELL_SHAPE_MAX cells,
 * MEMORY. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_SHAPES_H
#define PAL_MESH_CELLS_CELL_SHAPES_H
#include "server/mesh/cells/cells.h"

enum { PAL_CELL_SHAPE_MAX = 1000000 };

/* n[0] x n[1] x n[2] bricks of the box from -size/2 to size/2 */
pal_err pal_cells_block(const int32_t n[3], const double length_scale_m[3], pal_cells *out, pal_diagnostic *diag);
/* n >= 3 bricks in a circle about z: square section of edge thick_m, its middle at radius_m > thick_m / 2 */
pal_err pal_cells_ring(int32_t n, double radius_m, double thick_m, pal_cells *out, pal_diagnostic *diag);
/* a tube about z: n[0] >= 3 around, n[1] through the wall from inner_m to outer_m, n[2] along length_m */
pal_err pal_cells_tube(const int32_t n[3], double inner_m, double outer_m, double length_m, pal_cells *out,
                       pal_diagnostic *diag);
/* a full torus about z: n >= 3 around, section a disc of radius tube_m < radius_m about the circle of radius_m, cut
 * into a middle square of m x m and four petals of m x m cells, 5 m^2 in all */
pal_err pal_cells_torus(int32_t n, int32_t m, double radius_m, double tube_m, pal_cells *out, pal_diagnostic *diag);
#endif
