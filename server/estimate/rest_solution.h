/* Bodies at rest beside a running one: the same body in another mesh, law or model, under the same nodal loads, solved
 * by static_newton, and its displacements where the running body has its nodes. Private to estimate_*.c. Heap memory,
 * slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_REST_SOLUTION_H
#define PAL_ESTIMATE_REST_SOLUTION_H
#include "server/estimate/estimate.h"

#include <stdatomic.h>

typedef struct pal_rest_solution {
    pal_scene *scene;
    pal_prepared mesh; /* own; n_node 0: that of the scene it was made from */
    pal_world *world;
    int n_near;    /* of each node of the running body: elements' nodes here and their weights; 0: nodes are the same */
    int32_t *near; /* [n_node][n_near] */
    double *weight;
    int n_common; /* nodes of the running body that are corners here too: places where solutions of two meshes compare
                     without interpolation [n_common] */
    int32_t *common;
    double *x; /* its rest, at the nodes of the running body m [n_node][3] */
    int n_node;
    bool known; /* x holds */
    bool sized; /* of other voxels, not of merged ones: nodes of the running body may lie outside */
} pal_rest_solution;

/* scene: of one body, without tools (estimation_setup.c); element, law: NULL keeps those of its model, which becomes
 * fem where they are given. body: the running one, as made from `scene`. REFUSED, MEMORY */
pal_err pal_rest_solution_make(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                               pal_diagnostic *diag, pal_rest_solution *out);
/* the same on voxels of twice the edge. REFUSED as well: no voxels, none left to merge */
pal_err pal_rest_solution_coarser(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                                  pal_diagnostic *diag, pal_rest_solution *out);
/* the same in so many voxels on the longest axis, as a switch to them makes it (configuration.h); model fem alone. Of
 * more than 4,000 nodes it is solved by conjugate gradients with an incomplete factor: a tenth of the memory, and less
 * time. REFUSED as well: it has that mesh already */
pal_err pal_rest_solution_sized(const pal_scene *scene, const pal_body *body, const pal_configuration *setting,
                                int size, const char *law, pal_rest_solution *out);
void pal_rest_solution_free(pal_rest_solution *rest); /* a zeroed one is fine */
/* shape functions of a body's elements at local coordinates (mesh/volume/locate.h): shape [n_corner] */
void pal_element_shape_functions(const pal_body *body, const double local[4], double *shape);
/* the rest under what the state bears -> x, known; false: no rest was found or *stop. from: places of the running
 * body's nodes to begin at; NULL, and in another mesh: where it was last.
 * A tool is held where it is, whatever the mesh makes of its force: loads of tools are taken as many times as bring
 * what they press as far, in the mean that does their work, as it is in the state (two more solutions at most; where
 * these bring it no nearer: as they are) */
bool pal_rest_solution_find(pal_rest_solution *rest, const pal_estimate_state *state, const pal_body *body,
                            const double *from, const _Atomic bool *stop);
#endif
