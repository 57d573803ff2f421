/* Supports of a static problem on their true surface, which voxels cut: the consistent penalty of GAMMA E / h over it
 * in place of held nodes (sim/core/definition.h, pal_ground). A region holds the body where its faces cut through it,
 * and what lies within is left out; a support with a normal holds the part of the surface that faces this way. Where
 * voxels fit, so that a region holds nodes of their border and no part of a voxel, these are held: it is exact there.
 * Heap; thread: [load]. */
#ifndef PAL_SOLVE_SURFACE_SUPPORTS_H
#define PAL_SOLVE_SURFACE_SUPPORTS_H
#include "server/solve/load_case.h"

/* The problem's supports on voxels of measured weights, which lose what lies within regions. young_Pa: of all
 * materials, NaN: their own. locate: of the mesh's hexahedra. The caller frees out->item. REFUSED names a support that
 * meets nothing of the body; MEMORY */
pal_err pal_surface_supports_make(const pal_problem *problem, double young_Pa, const pal_locate *locate,
                                  pal_prepared *mesh, pal_ground *out, pal_diagnostic *diag);
/* Boxes of the nodes that are held: of regions that voxels fit, and within others those that no element outside has;
 * into out [n_support]. Returns how many */
int pal_surface_supports_held(const pal_problem *problem, const pal_prepared *mesh,
                              pal_support_def out[PAL_PROBLEM_REGIONS]);
/* moves the ground of moved supports by `share` of their way */
void pal_surface_supports_move(pal_ground *ground, const pal_problem *problem, double share);
#endif
