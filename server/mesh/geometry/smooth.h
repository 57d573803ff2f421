/* Smoothing without shrinkage (Taubin 1995): a step towards the neighbours' mean, then a slightly longer step back.
 * Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_SMOOTH_H
#define PAL_MESH_GEOMETRY_SMOOTH_H
#include "server/mesh/geometry/surface.h"

/* Rounds of one step there (0.5) and back (-0.53), in place; vertices of open edges stay. With reach_m [n_vertex] (may
 * be NULL) rounds of the step there alone, but vertex i stays within reach_m[i] of its start along its normal and
 * within twice that tangentially: removes all waves that the reach covers, long ones too. MEMORY */
pal_err pal_surface_smooth(pal_surface *surface, int rounds, const double *reach_m);
#endif
