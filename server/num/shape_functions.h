/* Shape functions and quadrature of finite elements. Local coordinates: hex8 in [-1, 1]^3, corner c at the signs of bit
 * 0, 1, 2 for x, y, z (so corner numbers are those of voxel corners: x = 1, y = 2, z = 4); tet4 and tet10 barycentric,
 * corners 0-3, then the middles of edges 01 12 20 03 13 23. Thread: any. */
#ifndef PAL_NUM_SHAPE_FUNCTIONS_H
#define PAL_NUM_SHAPE_FUNCTIONS_H

enum { PAL_HEX_CORNERS = 8, PAL_TET_CORNERS = 4, PAL_TET10_CORNERS = 10, PAL_MAX_CORNERS = 10 };

extern const int pal_tet10_edge[6][2]; /* corners of each middle node */

/* values n [8] and gradients with respect to local coordinates g [8][3] (either may be NULL) at x [3] */
void pal_hex_shape(const double x[3], double n[8], double g[8][3]);
/* the same at barycentric l [4]; gradients are with respect to l[1], l[2], l[3], l[0] = 1 - their sum */
void pal_tet10_shape(const double l[4], double n[10], double g[10][3]);

/* values n [n_corner] of the element with 8, 10 or 4 corners; local: x of the hexahedron, else barycentric */
void pal_element_shape(int n_corner, const double local[4], double *n);

/* Gauss points of the hexahedron (2x2x2, weight 1 each) and of the tetrahedron (4 points, weight 1/4 of the volume,
 * exact to degree 2) */
extern const double pal_hex_gauss[8][3];
extern const double pal_tet_gauss[4][4];
/* 6 points of a triangle, exact to degree 4: barycentric and weight (sum 1) */
extern const double pal_tri_gauss[6][4];
#endif
