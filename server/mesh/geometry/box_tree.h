/* AABB tree over the triangles of a surface: its winding number. The tree borrows the surface. Thread: [load] to build,
 * then read-only by any. */
#ifndef PAL_MESH_GEOMETRY_BOX_TREE_H
#define PAL_MESH_GEOMETRY_BOX_TREE_H
#include "server/mesh/geometry/surface.h"

typedef struct pal_box_tree pal_box_tree;

pal_err pal_box_tree_create(const pal_surface *surface, pal_box_tree **out); /* borrows surface; MEMORY */
void pal_box_tree_destroy(pal_box_tree *tree);

/* of a triangle with corners [3][3] seen from p, sr, positive from within (van Oosterom & Strackee 1983); 0 from a
 * point in its plane [any] */
double pal_solid_angle(const double *corner[3], const double p[3]);
/* solid angle of the surface at p over 4 pi (fast winding number, Barill et al. 2018): 1 inside, 0 outside */
double pal_box_tree_winding(const pal_box_tree *tree, const double p[3]);
#endif
