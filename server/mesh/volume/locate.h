/* Location of points in a mesh at rest: the element that contains a point and its local coordinates
 * (num/shape_functions.h), through a uniform grid over the elements. Points outside are assigned to the nearest
 * element, whose coordinates then lie outside their range (extrapolation). Heap; thread: [load] to make, then any
 * number of readers. */
#ifndef PAL_MESH_VOLUME_LOCATE_H
#define PAL_MESH_VOLUME_LOCATE_H
#include "server/mesh/volume/hexes.h"

typedef struct pal_locate pal_locate;
/* hexes NULL: tetrahedra, else hexahedra; both are borrowed. REFUSED without elements, MEMORY */
pal_err pal_locate_create(const pal_tets *tets, const pal_hexes *hexes, pal_locate **out);
void pal_locate_destroy(pal_locate *locate);
/* the mesh it was made for; *hex: of hexahedra */
const pal_tets *pal_locate_mesh(const pal_locate *locate, bool *hex);
/* Element of point x (frame of tets->x, finite); local: hex8 coordinates [3], or barycentric [4]; returns the element,
 * the first one where several meet; *outside_m (may be NULL): 0 inside, else the distance to the element */
int pal_locate_point(const pal_locate *locate, const double x[3], double local[4], double *outside_m);
/* local coordinates of x in one element, wherever x is */
void pal_locate_local(const pal_locate *locate, int element, const double x[3], double local[4]);

/* A quadrature point of the part of a surface that lies within one element */
typedef struct pal_quadrature_point {
    int element;
    double local[4];  /* as above                                              */
    double area_m2;   /* area of this point; the areas sum to that of the selected region */
    double normal[3]; /* unit, outward                                         */
} pal_quadrature_point;
/* The part of a triangle surface inside the box [low, high] (frame of tets->x; and with unit normal within 25 degrees
 * of `normal`, unless that is NULL or 0), cut by the box, by the planes of the voxels and by the faces of tetrahedra,
 * as quadrature points of degree 4, so that consistent nodal forces of a traction are exact. Parts outside the mesh are
 * assigned to the nearest element by extrapolation. Heap array that the caller frees; n_piece 0 and *out NULL when the
 * region meets no surface. MEMORY */
pal_err pal_locate_surface(const pal_locate *locate, const pal_surface *surface, const double low[3],
                           const double high[3], const double *normal, pal_quadrature_point **out, int *n_piece);
/* The part inside a closed surface of the face of a box that is normal to `axis`, at high (side 1) or low (side -1): by
 * the divergence theorem the surface beyond the face, projected on it, so that areas may be negative and their sums of
 * polynomials of degree 4 are exact in voxels. A point belongs to the element beyond the face. As above otherwise */
pal_err pal_locate_section(const pal_locate *locate, const pal_surface *surface, const double low[3],
                           const double high[3], int axis, int side, pal_quadrature_point **out, int *n_piece);
#endif
