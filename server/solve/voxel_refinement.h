/* The same body of voxels with smaller elements: what is left of an error then is not the elements' but the border's,
 * which stays as jagged, or as evenly spread over cut voxels, as it was. Heap; thread: [load]. */
#ifndef PAL_SOLVE_VOXEL_REFINEMENT_H
#define PAL_SOLVE_VOXEL_REFINEMENT_H
#include "server/mesh/volume/prepared.h"

/* every voxel of the mesh becomes split^3 with its fill; the skin goes. REFUSED: no voxels; BUDGET: more than 20
 * million of them; MEMORY; the mesh is untouched then */
pal_err pal_refine_voxels(pal_prepared *mesh, int split, pal_diagnostic *diag);
#endif
