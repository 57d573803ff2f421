/* Private to the voxel files: the fraction of each voxel of a grid that lies inside a surface. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_FRACTION_H
#define PAL_MESH_VOXEL_VOXEL_FRACTION_H
#include "server/mesh/voxel/voxel_bits.h"
#include "server/mesh/voxel/voxels.h"

enum { PAL_FRACTION_SUBSAMPLES = 6 };

/* receives the fractions of layer z, 0..1, x fastest; valid during the call */
typedef void (*pal_fraction_layer)(void *self, int z, const double *fraction /* [n1][n0] */);

/* Fractions of a grid (n, edge_m, low_m of grid; low_m relative to the surface's origin), layer by layer from below:
 * exact to rounding (corners at 1/65536 of a voxel) where the surface is closed and its rows enter and leave
 * alternately; else by counting n_sub^3 samples a voxel (0: PAL_FRACTION_SUBSAMPLES; fewer where the samples would be
 * too many), classified as voxels are. Exactly 1 and exactly 0 for voxels wholly inside and outside. *exact (may be
 * NULL) reports which it was. REFUSED, BUDGET, MEMORY */
pal_err pal_voxels_fraction(const pal_surface *surface, const pal_voxels *grid, const char *method, int n_sub,
                            pal_fraction_layer take, void *self, bool *exact, pal_diagnostic *diag);

/* Clears the border voxels of which less than options->min_fill lies inside; n_dropped and n_edge_only of report */
pal_err pal_voxels_drop(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                        const pal_bits *inside, pal_bits *border, pal_voxel_report *report, pal_diagnostic *diag);
#endif
