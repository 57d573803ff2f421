/* Smoothing without shrinkage (Taubin 1995): a step towards the neighbours' mean, then a slightly longer step back.
 * Thread: [load]. */
#ifndef PAL_MESH_SMOOTH_H
#define PAL_MESH_SMOOTH_H
#include "server/mesh/surface.h"

/* rounds of one step there (0.5) and back (-0.53), in place; vertices of open edges stay; MEMORY */
pal_err pal_surface_smooth(pal_surface *surface, int rounds);
/* the same, but after every round vertex i is at most reach_m[i] from where it began */
pal_err pal_surface_smooth_within(pal_surface *surface, int rounds, const double *reach_m);
#endif
