/* A subdivision solid as finite elements (paper A section 3.1, 3.4): the cells after subdivision, their elements, the
 * interpolation d = A p, and the material as samples at the Gauss points, so that it may vary continuously within an
 * element.
 *
 * Nodes are the vertices of the subdivided cells, then the virtual nodes in the middle of cells that are no hexahedra.
 * A cubic element's nodes are control points of its spline: its material passes near them, not through them.
 * One heap object per body (pal_body.model.solid), made by the model, freed with the world. Rest shape and material are
 * constant between edits. Thread: make, sample [load]; reading [sim]. */
#ifndef PAL_SIM_SUBDIVISION_SUBDIVISION_SOLID_H
#define PAL_SIM_SUBDIVISION_SUBDIVISION_SOLID_H
#include "server/base/arena.h"
#include "server/mesh/cells/cell_elements.h"
#include "server/mesh/cells/maccracken_joy.h"
#include "server/num/spline.h"
#include "server/sim/core/definition.h"

/* samples at the 64 Gauss points (num/spline.h) of the elements of one kind, all [n][64] */
typedef struct pal_material_samples {
    float *young_Pa, *poisson, *density_kg_m3;
    float *damping_1_s; /* gamma of paper A, eq. 3 over density; 0: none there */
    double *volume_m3;  /* that the point stands for at rest: weight det J, above 0 */
} pal_material_samples;

typedef struct pal_subdivision_solid {
    pal_subdivision subdivision; /* cells: after the last level; rows: of their vertices */
    pal_cell_elements elements;
    pal_interpolation rows; /* of all nodes, virtual ones last: body->interpolation */
    double *node_rest;      /* rows times the control cells' x           [rows.n_row][3] */
    pal_material_samples samples[PAL_CELL_KINDS];
    uint64_t sampled; /* grows with every pal_subdivision_solid_sample, from 1 */
    pal_body_def def; /* of the last pal_subdivision_solid_sample; what it borrows stays borrowed */
    size_t n_byte;    /* memory of all arrays, about */
} pal_subdivision_solid;

/* shape functions of the nodes of one kind of element and their gradients at the Gauss points, and the points' weights
 */
typedef struct pal_cell_shapes {
    double n[PAL_CELL_GAUSS_POINTS][PAL_CELL_MAX_NODES], g[PAL_CELL_GAUSS_POINTS][PAL_CELL_MAX_NODES][3];
    double weight[PAL_CELL_GAUSS_POINTS];
} pal_cell_shapes;
void pal_cell_shapes_fill(pal_cell_kind kind, pal_cell_shapes *out);

/* Subdivides, chooses elements, takes the samples. REFUSED as pal_subdivision_make and pal_cell_elements_make do, or an
 * element that is folded over at a Gauss point (det J <= 0), with its cell; BUDGET, MEMORY */
pal_err pal_subdivision_solid_make(const pal_body_def *def, const pal_subdivision_options *options,
                                   pal_subdivision_solid **out, pal_diagnostic *diag);
void pal_subdivision_solid_free(pal_subdivision_solid *solid); /* NULL is fine */
/* takes the samples again, from material, regions and strokes of def at the points' positions at rest */
void pal_subdivision_solid_sample(pal_subdivision_solid *solid, const pal_body_def *def);

/* nodes of an element */
static inline const int32_t *pal_subdivision_solid_nodes(const pal_subdivision_solid *s, pal_cell_kind kind,
                                                         int element)
{
    return s->elements.node[kind] + (size_t)element * (size_t)pal_cell_kind_nodes(kind);
}
/* d(x, y, z)/d(u, v, w) of an element with nodes at x, row-major J[3 a + b] = dx_a/du_b, from gradients of
 * pal_cell_shape; returns its determinant */
double pal_subdivision_solid_jacobian(const double *x, const int32_t *node, int n_node, double (*g)[3], double J[9]);
/* Tetrahedra of nodes that fill the solid, for sections of what is shown: six for each hexahedron, around its diagonal
 * 0 7, two for each pyramid. Those of neighbours may cut their common quad along different diagonals. Cubic elements
 * are taken by the control points of their own corners, near which the material passes. From the arena; MEMORY. [load]
 */
pal_err pal_subdivision_interior(const pal_subdivision_solid *solid, pal_arena *arena, int *n_tet, int32_t **tet);
/* volume at rest by quadrature, m^3 */
double pal_subdivision_solid_volume_m3(const pal_subdivision_solid *solid);
#endif
