/* Legacy VTK files and XML files (.vtu, .vtp): a grid of one kind of element with fields at nodes and cells.
 * Thread: [load]. */
#ifndef PAL_MESH_FILES_VTK_FILE_H
#define PAL_MESH_FILES_VTK_FILE_H
#include "server/base/err.h"

#include <stdint.h>

typedef struct pal_vtk_field {
    const char *name;    /* blanks and control characters are written as _       */
    int n_component;     /* 1: scalars, 3: vectors                               */
    const double *value; /* [n_node or n_element][n_component]                   */
} pal_vtk_field;

typedef struct pal_vtk_grid {
    const char *title; /* one line, may be NULL                                           */
    int n_node, n_element;
    int n_corner;           /* 8: hexahedra, 4: tetrahedra, 10: quadratic tetrahedra; 3: triangles (VTP) */
    const double *x;        /* node position relative to origin_m, m              [n_node][3]  */
    const double *origin_m; /* [3], NULL: 0                                                    */
    const int32_t *node;    /* as num/shape_functions.h numbers corners and middles [n_element][n_corner] */
    int n_point, n_cell;    /* fields at nodes and at elements                                 */
    const pal_vtk_field *point, *cell;
} pal_vtk_grid;

/* ASCII with 17 digits, a decimal point whatever the locale; whole file written or none; REFUSED (n_corner,
 * n_component), IO */
pal_err pal_mesh_write_vtk(const char *path, const pal_vtk_grid *grid, pal_diagnostic *diag);
/* The same as XML, which ParaView reads as a series (the title is left out). A path that ends with .vtu is written like
 * this by pal_mesh_write_vtk too. */
pal_err pal_mesh_write_vtu(const char *path, const pal_vtk_grid *grid, pal_diagnostic *diag);
/* Triangles as XML PolyData. Errors: as above. */
pal_err pal_mesh_write_vtp(const char *path, const pal_vtk_grid *grid, pal_diagnostic *diag);
#endif
