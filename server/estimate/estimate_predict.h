/* Neighbours of a running body's configuration: the next lower and next higher value of each parameter, with
 * predicted time and error. Private to this room. Thread: one at a time.
 *
 * ms is the time of a step of the present scene (configuration.h: a step of half the length counts as two).
 *   size        Half and twice. The share `once` of a step's time is constant (refinement, safeguards, display).
 *               `beside` scales with the sub-steps (contact, other bodies), which the most demanding body sets. The
 *               rest scales with the sub-steps and the time of each (the probe below). The discretisation
 *               error scales with h^order, or as measured where many voxels are cut. Not offered for calibrated
 *               springs, whose constants are valid for one size.
 *   step        Half and twice (implicit solvers). Each step takes the same time. The time error scales with
 *               step^order of the solver.
 *   tolerance   A tenth and ten times (implicit solvers). The algebraic error is proportional to it; the time is
 *               measured for one decade.
 * A value that a switch would refuse is not offered: see pal_configuration_check_live. Neither is one that needs
 * more sub-steps in a step than the scene allows. Explicit solvers need sub-steps in proportion to 1 / element size
 * and to the step length.
 *
 * The cost of a step on other meshes comes from a short probe on two: the body's own, and its voxels merged by eights.
 * Fewer nodes: time is proportional to nodes^growth, with the growth observed between the two meshes. More nodes: all
 * time is proportional to the nodes except the factor's, which is the number of solves times the entries, each read
 * twice, at this machine's read rate for arrays of that length. The entries, and the iterations of every part, grow as
 * observed. Node counts are those of pal_configuration_estimate_nodes. */
#ifndef PAL_ESTIMATE_ESTIMATE_PREDICT_H
#define PAL_ESTIMATE_ESTIMATE_PREDICT_H
#include "server/estimate/estimate.h"

typedef struct pal_prediction {
    const pal_scene *scene; /* scene of the body, as it is; NULL: every value is accepted */
    int body;
    int n_substep;                   /* of a present step, over all bodies; 0: unknown */
    pal_configuration configuration; /* present configuration */
    int n_node, rest_substeps;       /* present nodes; sub-steps of a step at rest, of this body alone */
    double other_substeps;           /* sub-steps that other bodies need; 0: none */
    double once, beside;             /* shares of a step's time: pal_estimate_cost */
    /* half and twice the size, relative to the present: predicted nodes, sub-steps, time of a sub-step; NaN:
     * unknown, so no neighbour in size */
    double nodes[2], substeps[2], work[2];
    double order; /* of the elements */
    /* measured error with half and with twice as many voxels over that of this mesh (estimate_hierarchy.h); 0: use
     * `order` */
    double left[2];
    bool implicit;    /* the parameters step and tolerance apply */
    int solver_order; /* in time */
    double tolerance; /* present tolerance of the solver */
    double decade;    /* time of a step with a tenth of the tolerance over the present one; NaN: unknown */
} pal_prediction;

/* Fills `neighbour` of `out` from its ms and its parts of the error. Omits neighbours whose ms or error cannot be
 * predicted. Their error_m is NaN where that of `out` is. */
void pal_estimate_predict(const pal_prediction *from, pal_estimate *out);
/* Fills nodes, substeps and work of `out`, whose configuration and implicit must be set. work is NaN if the probe
 * failed. scene: the body alone; live: a world of it; small: a world of the same method on the coarse mesh. Both worlds
 * bear the same loads; their final state is unspecified. Allocates heap memory; takes some tens of ms. */
void pal_estimate_probe_cost(const pal_scene *scene, pal_world *live, pal_world *small, pal_prediction *out);
#endif
