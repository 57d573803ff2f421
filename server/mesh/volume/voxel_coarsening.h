/* Voxels of twice the edge that fill the same body: the weights of each integrate over its eight voxels (nothing for
 * one that does not exist), so the volume is the same. Every second plane of the fine mesh is a plane of the coarse
 * one; `shift` selects which. Heap; thread: [load]. */
#ifndef PAL_MESH_VOLUME_VOXEL_COARSENING_H
#define PAL_MESH_VOLUME_VOXEL_COARSENING_H
#include "server/mesh/volume/prepared.h"

/* shift 0: the coarse planes of an axis begin with the lowest plane of the fine voxels, 1: one fine voxel before it.
 * Coarse voxels with less fill than min_fill are dropped, unless that would lose more than 2.5 % of the volume. out:
 * tets and hexes alone, same origin. REFUSED: no voxels; MEMORY */
pal_err pal_voxels_coarsen(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], double min_fill,
                           pal_prepared *out, pal_diagnostic *diag);
#endif
