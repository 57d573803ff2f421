/* Iso-surface of a scalar field: marching tetrahedra on a body-centred cubic lattice.
 *
 * Every sign pattern gives a closed, manifold, outward-oriented surface without cracks, because each lattice edge is
 * crossed at most once and its tetrahedra form a ring around it. Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_CONTOUR_H
#define PAL_MESH_GEOMETRY_CONTOUR_H
#include "server/mesh/geometry/surface.h"

/* value at a point (m): positive inside, negative outside; must be finite and continuous */
typedef double pal_contour_field(const void *self, const double p_m[3]);

typedef struct pal_contour_box {
    double low_m[3], high_m[3]; /* the body lies well inside; on the border the field counts as outside */
    double spacing_m;           /* lattice cell edge; about 9 triangles per squared spacing of surface  */
} pal_contour_box;

/* out: recentred surface. REFUSED when nothing is inside, BUDGET beyond 200 million lattice points, MEMORY */
pal_err pal_contour(pal_contour_field *field, const void *self, const pal_contour_box *box, pal_surface *out,
                    pal_diagnostic *diag);
#endif
