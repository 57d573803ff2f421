/* Fewer triangles for the same shape: edge collapse by quadric error (Garland and Heckbert 1997). Thread: [load] */
#ifndef PAL_MESH_GEOMETRY_DECIMATE_H
#define PAL_MESH_GEOMETRY_DECIMATE_H
#include "server/mesh/geometry/surface.h"

/* Collapses edges, cheapest first, until at most n_tri triangles are left or no collapse is possible that keeps the
 * topology and inverts no triangle. Closed manifold surfaces stay closed and manifold with the same genus; vertices
 * that are not inside one closed fan stay in place. In place; MEMORY (surface unchanged) */
pal_err pal_surface_decimate(pal_surface *surface, int n_tri);
#endif
