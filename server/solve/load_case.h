/* Applies a load case of a problem to a mesh: its voxels, the nodes fixed by its supports, the consistent nodal
 * forces of its loads. Shared by the finite-element solve and by calibration, so that both use identical loads.
 * [load] */
#ifndef PAL_SOLVE_LOAD_CASE_H
#define PAL_SOLVE_LOAD_CASE_H
#include "server/mesh/volume/locate.h"
#include "server/sim/core/body.h"
#include "server/sim/core/problem.h"

/* how the surface becomes voxels */
typedef struct pal_case_voxel_options {
    int resolution;  /* voxels on the longest axis */
    bool fill;       /* cut voxels count by what is inside; false: keep voxels at least half filled, as full ones */
    double min_fill; /* cut voxels with a smaller share are dropped; 0: as in a live body (pal_filled_voxels_make), 0.5
                        without fill */
    double ahead[3]; /* without align: by how many voxels, 0 to 1, the grid begins before the body */
    bool align;      /* shift the voxels so that their faces lie on the border of a support that cuts the body */
} pal_case_voxel_options;

/* Components that no support of the problem fixes are dropped or refused (mesh/volume/loose_components.h). Errors:
 * REFUSED, BUDGET, MEMORY, also those of pal_prepared_make. */
pal_err pal_case_voxels(const pal_problem *problem, const pal_surface *surface, const pal_case_voxel_options *how,
                        pal_prepared *out, pal_diagnostic *diag);

/* "(0, 0, 0) .. (1, 1, 1)" in the frame of the problem, for messages */
typedef struct pal_box_text {
    char text[160];
} pal_box_text;
pal_box_text pal_box_describe(const pal_box *box);
/* Is x (frame of the problem) in the box, or within `slack` of it? */
bool pal_box_contains(const pal_box *box, const double x[3], double slack);
/* Material at x (frame of the problem), and at the centroid x of a tetrahedron: the last one whose region contains it;
 * NULL: none. */
const pal_problem_material *pal_case_material_at(const pal_problem *problem, const double x[3]);
const pal_problem_material *pal_case_material_of(const pal_problem *problem, const pal_tets *tets, int tet,
                                                 double x[3]);
/* Tolerance that includes a node on the border of a region, whatever the rounding. */
double pal_case_tolerance_m(const pal_tets *tets);

/* The supports in the body frame -> out [n_support]. REFUSED names one that fixes no node. */
pal_err pal_case_supports(const pal_problem *problem, const pal_tets *tets, pal_support_def out[PAL_PROBLEM_REGIONS],
                          pal_diagnostic *diag);

/* Adds the forces of a load (-1: of all), N [n_node][3], on the nodes of the body's elements (no elements: its
 * tetrahedra). area_m2 [n_load] of tractions, may be NULL. locate must be of the same mesh, surface the body's own.
 * Errors: REFUSED (names a load that meets no surface or lies outside); MEMORY. */
pal_err pal_case_forces(const pal_problem *problem, const pal_problem_case *load_case, int load, const pal_body *body,
                        const pal_locate *locate, const pal_surface *surface, double *force_N, double *area_m2,
                        pal_diagnostic *diag);

/* Moves local coordinates of pal_locate_point into the element of n_corner corners, so that a force on a point outside
 * is not extrapolated. */
void pal_case_clamp(int n_corner, double local[4]);
/* Shape functions of an element of a body at local coordinates of pal_locate_point. Returns the number of corners;
 * *node points to their nodes. */
int pal_case_shape_functions(const pal_body *body, int element, const double local[4], double shape[10],
                             const int32_t **node);
#endif
