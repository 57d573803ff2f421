/* The same voxel body with smaller elements. The remaining error is then that of the border, which stays as jagged,
 * or as spread by the weights of cut voxels, as before. Allocates heap memory. Thread: [load]. */
#ifndef PAL_SOLVE_VOXEL_REFINEMENT_H
#define PAL_SOLVE_VOXEL_REFINEMENT_H
#include "server/mesh/volume/prepared.h"

/* Splits every voxel of the mesh into split^3, less those in an octant whose point has no weight, and removes the skin.
 * Errors: REFUSED: no voxels; BUDGET: more than 20 million of them; MEMORY. The mesh is unchanged after an error. */
pal_err pal_refine_voxels(pal_prepared *mesh, int split, pal_diagnostic *diag);
#endif
