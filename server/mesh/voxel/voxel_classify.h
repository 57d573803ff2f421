/* Private to the voxel files: which voxels are inside a surface. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_CLASSIFY_H
#define PAL_MESH_VOXEL_VOXEL_CLASSIFY_H
#include "server/mesh/voxel/voxel_scanline.h"
#include "server/mesh/voxel/voxels.h"

/* Inside voxels by rows along x when every row enters and leaves alternately (or, for an inside-out surface, leaves and
 * enters): true and inside set; false: inside is unusable */
bool pal_scan_plain(const pal_crossings *crossings, pal_bits *inside);

/* Sets the inside bits of a grid (n, edge_m, low_m of grid) by the method asked for or chosen, and method, n_disagree,
 * surface_volume_m3 and tree_s of the report; REFUSED when nothing is inside, MEMORY */
pal_err pal_voxels_classify(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                            pal_bits *inside, pal_voxel_report *report, pal_diagnostic *diag);
#endif
