/* Tetrahedral meshes at rest: nodes, tetrahedra with positive volume, boundary faces, unique edges and faces.
 * A pal_tets owns its arrays (heap). Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_TETS_H
#define PAL_MESH_GEOMETRY_TETS_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct pal_tets {
    int n_node, n_tet, n_face; /* n_face: boundary triangles                                       */
    double *x;                 /* node position relative to origin_m, m               [n_node][3]  */
    int32_t *tet;              /* corners; (x1-x0).((x2-x0)x(x3-x0)) > 0              [n_tet][4]   */
    int32_t *face;             /* boundary triangles, counter-clockwise from outside  [n_face][3]  */
    uint8_t *on_surface;       /* 1: node of a boundary face                          [n_node]     */
    double origin_m[3];        /* position in the file's frame = x + origin_m                      */
    double edge_m;             /* voxel edge, or mean edge length of a foreign mesh                */
} pal_tets;

void pal_tets_free(pal_tets *tets);
/* of the tetrahedron of four nodes, m^3 */
double pal_tet_volume(const double *x, const int32_t *corner);
double pal_tets_volume(const pal_tets *tets); /* m^3 */

/* boundary faces and on_surface from tet alone (outward); replaces earlier ones; MEMORY */
pal_err pal_tets_find_boundary(pal_tets *tets);

/* unique edges [n_edge][2] and unique faces [n_face][3] (each once, inner faces too), ascending by smallest node so
 * that neighbours in memory are neighbours in space; the caller frees *out; MEMORY */
pal_err pal_tets_edges(const pal_tets *tets, int32_t **out, int *n_edge);
pal_err pal_tets_faces(const pal_tets *tets, int32_t **out, int *n_face);

/* faults: node out of range, repeated corner, volume <= 0, a face of more than two tets, a boundary that is not closed,
 * a node of no tet. REFUSED names the first and counts all. */
pal_err pal_tets_check(const pal_tets *tets, pal_diagnostic *diag);

/* face-connected components of the tets: label [n_tet], number out; MEMORY */
pal_err pal_tets_components(const pal_tets *tets, int32_t *label, int *n_component);
#endif
