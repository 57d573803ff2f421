/* A procedural organ, shown when no scan is available: liver-like, closed, smooth, about 0.2 m across. Thread: [load].
 */
#ifndef PAL_MESH_GEOMETRY_ORGAN_H
#define PAL_MESH_GEOMETRY_ORGAN_H
#include "server/mesh/geometry/surface.h"

/* about n_tri_about triangles (500 to 500000; others are clamped); the same surface every time; MEMORY */
pal_err pal_organ_make(int n_tri_about, pal_surface *out);
#endif
