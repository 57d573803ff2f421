/* Private to the room: what of each voxel of a grid lies inside a surface. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_FRACTION_H
#define PAL_MESH_VOXEL_VOXEL_FRACTION_H
#include "server/mesh/voxel/voxels.h"

/* receives layer z, x fastest; valid during the call: fractions of the voxels, 0..1 [n1][n0]; or weights [n1][n0][8] */
typedef void (*pal_fraction_layer)(void *self, int z, const double *layer);

/* Fractions of the voxels of a grid (n, edge_m, low_m of grid; low_m relative to the surface's origin), layer by layer
 * from below: exact to rounding (corners at 1/65536 of a voxel) where the surface is closed and its rows enter and
 * leave alternately; else by counting 6^3 samples a voxel (fewer where they would be too many), classified as voxels
 * are. Exactly 1 and exactly 0 for voxels wholly inside and outside.
 *
 * With weights: integrals over what is inside, in voxels, of the trilinear shape functions of the 2 x 2 x 2 Gauss
 * points, numbered like corners. They sum to the fraction, and with them as weights the points integrate trilinear
 * functions over the inside exactly; some may be negative, or above the 1/8 of a whole voxel. REFUSED, BUDGET, MEMORY
 */
pal_err pal_voxels_fraction(const pal_surface *surface, const pal_voxels *grid, bool weights, pal_fraction_layer take,
                            void *self, pal_diagnostic *diag);
#endif
