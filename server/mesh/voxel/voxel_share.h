/* Private to the voxel files: which share of each voxel of a grid lies inside a surface. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_SHARE_H
#define PAL_MESH_VOXEL_SHARE_H
#include "server/mesh/voxel/voxel_scan.h"

enum { PAL_SHARE_SUB = 6 };

/* takes the shares of layer z, 0..1, x fastest; valid during the call */
typedef void (*pal_share_take)(void *self, int z, const double *share /* [n1][n0] */);

/* The shares of a grid (n, h_m, low_m of grid; low_m relative to the surface's origin), layer by layer from below:
 * to rounding (corners at 1/65536 of a voxel) where the surface is closed and its rows go in and out in turn; else by
 * counting n_sub^3 samples a voxel (0: PAL_SHARE_SUB; fewer where the samples would be too many), decided as voxels are
 * decided. Exactly 1 and exactly 0 for voxels wholly inside and outside. *exact (may be NULL) says which it was.
 * REFUSED, BUDGET, MEMORY */
pal_err pal_voxels_share(const pal_surface *surface, const pal_voxels *grid, const char *method, int n_sub,
                         pal_share_take take, void *self, bool *exact, pal_note *note);

/* clears the border voxels of which less than options->least_fill lies inside; n_dropped and n_edge_only of report */
pal_err pal_voxels_drop(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                        const pal_bits *inside, pal_bits *border, pal_voxel_report *report, pal_note *note);
#endif
