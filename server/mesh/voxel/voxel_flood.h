/* Private to the voxel files: the paper's flood fill (paper B section 2.2). Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_FLOOD_H
#define PAL_MESH_VOXEL_VOXEL_FLOOD_H
#include "server/mesh/geometry/box_tree.h"
#include "server/mesh/voxel/voxel_bits.h"
#include "server/mesh/voxel/voxels.h"

/* Sets the voxels that a flood fill reaches from a seed behind every triangle without crossing the surface between
 * neighbouring centres; REFUSED when it reaches the border of the grid (the surface leaks), MEMORY */
pal_err pal_voxels_flood(const pal_surface *surface, const pal_box_tree *tree, const pal_voxels *grid, pal_bits *inside,
                         pal_diagnostic *diag);
#endif
