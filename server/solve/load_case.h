/* What a load case of a problem means on a mesh: its voxels, the nodes its supports hold, the consistent nodal forces
 * of its loads. Shared by the finite-element solve and by calibration, so that both bear the very same loads. [load] */
#ifndef PAL_SOLVE_LOAD_CASE_H
#define PAL_SOLVE_LOAD_CASE_H
#include "server/mesh/volume/locate.h"
#include "server/sim/core/body.h"
#include "server/sim/core/problem.h"

/* how the surface becomes voxels */
typedef struct pal_case_voxel_options {
    int resolution;  /* voxels on the longest axis                                           */
    bool fill;       /* scale cut voxels by their filled share; false: voxels at least half filled, whole */
    double min_fill; /* cut voxels with less inside are dropped; 0: with fill 0.25, or 0.02 where that would lose 2.5
                          % of the volume; without fill 0.5 */
    bool align;      /* shift the voxels so that their faces lie on the border of a support that cuts the body */
} pal_case_voxel_options;

/* components that no support of the problem holds are dropped or refused (mesh/volume/loose_components.h); REFUSED,
 * BUDGET, MEMORY as of pal_prepared_make too */
pal_err pal_case_voxels(const pal_problem *problem, const pal_surface *surface, const pal_case_voxel_options *how,
                        pal_prepared *out, pal_diagnostic *diag);

/* "(0, 0, 0) .. (1, 1, 1)" in the frame of the problem, for sentences */
typedef struct pal_box_text {
    char text[160];
} pal_box_text;
pal_box_text pal_box_describe(const pal_box *box);
/* x (frame of the problem) is in the box, or within `slack` of it */
bool pal_box_contains(const pal_box *box, const double x[3], double slack);
/* a node on a region's border is in it, whatever rounding says */
double pal_case_tolerance_m(const pal_tets *tets);

/* the supports in the body's frame -> out [n_support]; REFUSED names one that holds no node */
pal_err pal_case_supports(const pal_problem *problem, const pal_tets *tets, pal_support_def out[PAL_PROBLEM_REGIONS],
                          pal_diagnostic *diag);

/* forces [n_node][3], N, on the nodes of the body's elements (NULL element: its tetrahedra): += those of every load;
 * area_m2 [n_load] of tractions, may be NULL. locate is of the same mesh, surface the body's own. REFUSED names a load
 * that meets no surface or lies outside; MEMORY */
pal_err pal_case_forces(const pal_problem *problem, const pal_problem_case *load_case, const pal_body *body,
                        const pal_locate *locate, const pal_surface *surface, double *force_N, double *area_m2,
                        pal_diagnostic *diag);
/* the same of one load */
pal_err pal_case_force(const pal_problem *problem, const pal_problem_case *load_case, int load, const pal_body *body,
                       const pal_locate *locate, const pal_surface *surface, double *force_N, double *area_m2,
                       pal_diagnostic *diag);

/* shape functions of a body's element at local coordinates of pal_locate_point; returns the number of corners, whose
 * nodes are at *node */
int pal_case_shape_functions(const pal_body *body, int element, const double local[4], double shape[10],
                             const int32_t **node);
#endif
