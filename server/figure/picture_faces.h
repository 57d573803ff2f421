/* Private to body_picture.c: the visible part of a triangle surface from one direction, as pieces from far to near
 * (painter's order, by the depth of their middles: exact for convex bodies and for triangles of similar size). Faces
 * that look away are left out where the surface is closed; a closed surface inside out is turned. Thread: [load]. */
#ifndef PAL_FIGURE_PICTURE_FACES_H
#define PAL_FIGURE_PICTURE_FACES_H
#include "server/mesh/geometry/surface.h"

enum { PAL_PICTURE_CLASSES = 64, PAL_PICTURE_SHADES = 16, PAL_PICTURE_GREY = -1 };

/* axes of the paper in the body's frame, orthonormal: right, up, towards the eye */
typedef struct pal_picture_axes {
    double right[3], up[3], eye[3];
} pal_picture_axes;
/* From the direction of the eye (zero or not finite: a default); z is up, or y for an eye on the z axis. */
void pal_picture_axes_set(pal_picture_axes *axes, const double eye[3]);
static inline void pal_picture_project(const pal_picture_axes *a, const double x[3], double out[3])
{
    const double *const row[3] = {a->right, a->up, a->eye};
    for (int k = 0; k < 3; k++) out[k] = row[k][0] * x[0] + row[k][1] * x[1] + row[k][2] * x[2];
}

/* a surface of its own arrays; value: place in the colour map, 0 to 1, NaN: none. pal_picture_mesh_free frees it */
typedef struct pal_picture_mesh {
    pal_surface surface;
    double *rest;  /* NULL: none [n_vertex][3]     */
    double *value; /* [n_vertex]                   */
    bool closed;   /* every edge has two triangles */
    bool joined;   /* drawn coarser than it is: edges of folds are no outlines */
} pal_picture_mesh;
void pal_picture_mesh_free(pal_picture_mesh *mesh);
/* joins vertices within cells until at most `max` triangles can be seen; finds closed and turns what is inside out */
pal_err pal_picture_mesh_prepare(pal_picture_mesh *mesh, const pal_picture_axes *axes, int max);

typedef struct pal_picture_piece { /* a part of a triangle, of one colour */
    double depth;                  /* along axes->eye, m                  */
    double at[3][2];               /* along right and up, m; counter-clockwise or clockwise alike */
    int16_t colour;                /* class of the colour map or PAL_PICTURE_GREY               */
    uint8_t shade;                 /* 0 dark .. PAL_PICTURE_SHADES - 1: as lit from the eye     */
    uint8_t outline, crease;       /* bit k: the edge from corner k to k + 1 is one             */
} pal_picture_piece;
typedef struct pal_picture_line {
    double from[2], to[2];
} pal_picture_line;
/* *piece: heap, far to near, at most `max` unless the mesh itself has more to see; triangles whose corners are some
 * classes apart are divided. *ghost: heap, the outline of the rest shape, none without. MEMORY */
pal_err pal_picture_pieces(const pal_picture_mesh *mesh, const pal_picture_axes *axes, int max,
                           pal_picture_piece **piece, int *n_piece, pal_picture_line **ghost, int *n_ghost);
#endif
