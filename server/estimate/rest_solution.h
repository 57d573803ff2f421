/* Equilibria beside a running body: the same body with another mesh, law or model, under the same nodal loads,
 * solved by static_newton, with displacements at the nodes of the running body. Private to this room. Allocates
 * heap memory; slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_REST_SOLUTION_H
#define PAL_ESTIMATE_REST_SOLUTION_H
#include "server/estimate/estimate.h"
#include "server/num/interpolation.h"

typedef struct pal_rest_solution {
    pal_scene *scene;
    bool own;          /* the running body as it is: world and scene are borrowed, and nothing is solved */
    pal_prepared mesh; /* owned; n_node 0: the mesh of the source scene */
    pal_world *world;
    pal_interpolation by; /* from its nodes to those of the running body; n_row 0: the nodes are identical */
    /* nodes of the running body that are corners here too, where two meshes compare without interpolation
     * [n_common] */
    int n_common;
    int32_t *common;
    double *x; /* equilibrium positions at the nodes of the running body, m [n_node][3] */
    int n_node;
    bool known; /* x is valid */
    /* factor of the tools' loads with which they press as far here as in the state: their force on this mesh over the
     * force in the state; NaN: no tool presses, or none was found */
    double press;
} pal_rest_solution;

/* scene: one body, without tools (estimation.c). element, law: NULL keeps those of the model; otherwise the
 * model becomes fem. body: the running one, made from `scene`. Errors: REFUSED, MEMORY. */
pal_err pal_rest_solution_make(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                               pal_diagnostic *diag, pal_rest_solution *out);
/* The same on voxels of twice the edge. REFUSED also if there are no voxels, or none left to merge. */
pal_err pal_rest_solution_coarser(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                                  pal_diagnostic *diag, pal_rest_solution *out);
/* The same with `size` voxels on the longest axis, made as a configuration switch makes it (configuration.h); model
 * fem only. Above 4,000 nodes tetrahedra use conjugate gradients with an incomplete factor, which needs a tenth of the
 * memory of a factor and less time. REFUSED also if the body already has that mesh. */
pal_err pal_rest_solution_sized(const pal_scene *scene, const pal_body *body, const pal_configuration *configuration,
                                int size, const char *law, pal_rest_solution *out);
/* The running body as it is: its shape is the equilibrium under the loads that it bears (estimate.h), once `world`,
 * made from `scene`, has its state. Borrows both. MEMORY */
pal_err pal_rest_solution_of_state(pal_scene *scene, pal_world *world, pal_rest_solution *out);
void pal_rest_solution_free(pal_rest_solution *rest); /* accepts a zeroed struct */
/* Interpolates in the elements of a rest solution at every stride-th of the points x [n * stride][3] (body frame).
 * Points slightly outside are extrapolated; inside: they are moved into the nearest element first. Error: MEMORY. */
pal_err pal_rest_solution_interpolation(const pal_rest_solution *rest, const double *x, int n, int stride, bool inside,
                                        pal_interpolation *out);
/* Displacements there in the last equilibrium, m [n][3]. */
void pal_rest_solution_displacement(const pal_rest_solution *rest, const pal_interpolation *by, double *u);
/* Largest distance between two rest solutions at nodes of the running body that the coarser one has, m. */
double pal_rest_solution_change(const pal_rest_solution *rest, const pal_rest_solution *coarser);
/* Finds the equilibrium under the loads of the state and sets x and known. False: no equilibrium, or *stop is set.
 * from: initial positions of the running body's nodes; NULL, and on another mesh: the previous solution.
 * A tool keeps its position, so its force depends on the mesh. Tool loads are therefore scaled until they press as
 * far as in the state, in the work-weighted mean. This takes at most two more solutions; if these come no closer,
 * the loads are left unscaled. */
bool pal_rest_solution_find(pal_rest_solution *rest, const pal_estimate_state *state, const pal_body *body,
                            const double *from, const _Atomic bool *stop);
#endif
