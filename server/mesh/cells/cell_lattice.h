/* Solids kept from a lattice of n[0] x n[1] x n[2] places, each empty or filled by
 *
 *   .            nothing
 *   #            a brick
 *   X            six pyramids that meet in the brick's middle
 *   E W N S U D  a pyramid with its apex in the middle of the face to +x, -x, +y, -y, +z, -z, its base in the other
 *   a .. l       a wedge: the brick without an edge; of 4 a + b the edge runs along axis a (x, y, z), on the high side
 *                of the next axis if b & 1, of the one after if b & 2
 *
 * Cells stand in the order of the places, x fastest. A model of cell_models.h is one of these. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_LATTICE_H
#define PAL_MESH_CELLS_CELL_LATTICE_H
#include "server/mesh/cells/cells.h"

typedef struct pal_cell_lattice {
    int32_t n[3];
    bool round;       /* the first direction closes in itself                                              */
    const char *rows; /* NULL: bricks everywhere, vertices in rows, x fastest. A letter for each x; the last letter of
                       * a row stands for those that are missing. '/' ends a row, rows run from low y, and ' ' a
                       * layer, layers from low z; the last row stands for those that are missing */
    /* from lattice numbers, corners being whole, to metres; NULL: equal steps from low to high, of round ones clockwise
     * about z, from inner to outer radius and along z */
    void (*place)(const double at[3], double x[3]);
    double low[3], high[3];
} pal_cell_lattice;

/* INTERNAL for an unknown letter; what pal_cells_make refuses; MEMORY */
pal_err pal_cell_lattice_make(const pal_cell_lattice *lattice, pal_cells *out, pal_diagnostic *diag);
#endif
