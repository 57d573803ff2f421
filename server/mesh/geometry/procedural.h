/* Procedural surfaces: an organ, shown when no scan is available, and hollow bodies for the adaptive surface springs
 * (paper C, Table I): a sphere of 114 vertices, a stomach of 188, a sheet of fabric. They are the same every time; each
 * owns heap memory (pal_surface_free). Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_PROCEDURAL_H
#define PAL_MESH_GEOMETRY_PROCEDURAL_H
#include "server/mesh/geometry/surface.h"

/* liver-like, closed, smooth, about 0.2 m across; about n_tri_about triangles (500 to 500000; others are clamped);
 * MEMORY */
pal_err pal_organ_make(int n_tri_about, pal_surface *out);

enum { PAL_SPHERE_VERTEX = 114, PAL_STOMACH_VERTEX = 188, PAL_STOMACH_RING = 6 };

typedef struct pal_stomach {
    pal_surface surface; /* closed; about 0.21 x 0.24 x 0.10 m, 1.4 l; x to the body's left, y up, z to the front */
    /* vertices around the ends of the oesophagus (the cardia's) and of the duodenum (the pylorus's), neighbours in
     * order; each ring is closed by a cap of six faces around one more vertex, which is fixed with it */
    int32_t oesophagus[PAL_STOMACH_RING], oesophagus_cap;
    int32_t duodenum[PAL_STOMACH_RING], duodenum_cap;
} pal_stomach;

/* 188 vertices, 558 edges, 372 faces; angles above 25 degrees, 4 to 8 edges in each vertex; MEMORY */
pal_err pal_stomach_make(pal_stomach *out);

/* 114 vertices, 336 edges, 224 faces, all vertices at radius_m from zero, 4 to 8 edges in each; REFUSED: radius <= 0 or
 * not finite; MEMORY */
pal_err pal_sphere_make(double radius_m, pal_surface *out);

/* n x m vertices in the plane z = 0, centred on zero, width_m along x (n vertices) and height_m along y (m vertices);
 * two triangles a cell, all cells cut alike, so that inner vertices are regular; z is outside. REFUSED: n or m below 2
 * or above 20000, more than 10 million vertices, a size that is not positive and finite; MEMORY */
pal_err pal_sheet_make(int n, int m, double width_m, double height_m, pal_surface *out, pal_diagnostic *diag);
#endif
