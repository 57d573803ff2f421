/* Levels of coarse cells over the cubes of a lattice, for multigrid (num/multigrid.h).
 *
 * A coarse cell is a group of the cells in one block of 2 x 2 x 2 that share nodes; several groups in a block are
 * several coarse cells at one place. Two corners of coarse cells are one node where a node of the finer level lies in
 * both cells and is interpolated from that corner. A mesh without cuts gives the usual coarser lattice; in one with
 * cuts exactly what is severed has nodes of its own (Dick, Georgii, Westermann 2011). Memory: the caller's arena.
 * Thread: [load]. */
#ifndef PAL_MESH_VOLUME_CELL_HIERARCHY_H
#define PAL_MESH_VOLUME_CELL_HIERARCHY_H
#include "server/base/arena.h"
#include "server/num/multigrid.h"

/* cells of the finest level */
typedef struct pal_lattice_cells {
    int n_cell, n_node;
    const int32_t *node;  /* corners, x = 1, y = 2, z = 4                       [n_cell][8] */
    const int32_t *place; /* position on the lattice, no less than 0            [n_cell][3] */
    const uint8_t *fixed; /* nodes that do not move                             [n_node]    */
} pal_lattice_cells;

/* of a finer level's nodes: a level with more of them costs nearly as much as that one and corrects little
 * (tests/mesh/volume/test_cell_hierarchy.c) */
#define PAL_LEVEL_SHRINKS 0.8
/* Levels until one has at most n_coarsest nodes, or the next would have more than PAL_LEVEL_SHRINKS of its nodes: that
 * one takes no memory of the arena. MEMORY */
pal_err pal_cell_hierarchy_make(const pal_lattice_cells *cells, int n_coarsest, pal_arena *arena,
                                pal_grid_hierarchy *out);
#endif
