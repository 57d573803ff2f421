/* Private to the room: the fraction of each voxel of a grid, or of each of its octants, that lies inside a surface.
 * Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_FRACTION_H
#define PAL_MESH_VOXEL_VOXEL_FRACTION_H
#include "server/mesh/voxel/voxels.h"

/* receives the fractions of layer z of the parts, 0..1, x fastest; valid during the call */
typedef void (*pal_fraction_layer)(void *self, int z, const double *fraction /* [split n1][split n0] */);

/* Fractions of a grid (n, edge_m, low_m of grid; low_m relative to the surface's origin) of whose voxels each is split
 * into split^3 parts (split 1: the voxels themselves, 2: their octants), layer by layer from below:
 * exact to rounding (corners at 1/65536 of a voxel) where the surface is closed and its rows enter and leave
 * alternately; else by counting 6^3 samples a voxel (fewer where they would be too many), classified as voxels are.
 * Exactly 1 and exactly 0 for parts wholly inside and outside. REFUSED, BUDGET, MEMORY */
pal_err pal_voxels_fraction(const pal_surface *surface, const pal_voxels *grid, int split, pal_fraction_layer take,
                            void *self, pal_diagnostic *diag);
#endif
