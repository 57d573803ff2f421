/* Voxels of twice the edge that fill the same body: each takes the mean fill of the eight that it stands for (0 for one
 * that is not there), so the volume is the same. The fine mesh's planes are every other time planes of the coarse one;
 * `shift` says which ones. Heap; thread: [load]. */
#ifndef PAL_MESH_VOLUME_VOXEL_COARSENING_H
#define PAL_MESH_VOLUME_VOXEL_COARSENING_H
#include "server/mesh/volume/prepared.h"

/* shift 0: the coarse planes of an axis begin with the lowest plane of the fine voxels, 1: one fine voxel before it.
 * Coarse voxels with less fill than min_fill are dropped, unless more than 2.5 % of the volume would go. out: tets
 * and hexes alone, same origin. REFUSED: no voxels; MEMORY */
pal_err pal_voxels_coarsen(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], double min_fill,
                           pal_prepared *out, pal_diagnostic *diag);
#endif
