/* The neighbours of a running body's configuration: the next lower and higher choice of each parameter, with predicted
 * time and error. Private to this room. Thread: any.
 *
 * ms is the time of a step of the scene as it is now (configuration.h: a shorter step counts as two of them).
 *   size        half and twice. The share `once` of a step's time stays (refinement, guards, display); `beside` goes
 * with the sub-steps (contact, other bodies), which are those of the body that needs most; the rest goes with the
 *               sub-steps and with the time of one of them (estimate_cost_model.h). The discretisation error goes with
 *               h^order, or as measured where many voxels are cut. None for calibrated springs, whose constants belong
 * to one size step        half and twice (implicit solvers): each takes as long; the time error goes with step^order of
 * the solver tolerance   a tenth and ten times (implicit solvers): the algebraic error goes with it, the time as
 * measured for one decade A choice that a switch would refuse is not offered: pal_configuration_check_live, and more
 * sub-steps in a step than the scene allows (of explicit solvers as many more as elements are smaller; in a longer step
 * as many more as it is longer).
 */
#ifndef PAL_ESTIMATE_ESTIMATE_PREDICT_H
#define PAL_ESTIMATE_ESTIMATE_PREDICT_H
#include "server/estimate/estimate.h"

typedef struct pal_prediction {
    const pal_scene *scene; /* of the body, as it is; NULL: all is taken */
    int body;
    int n_substep;             /* of a step now, all bodies; 0: not known */
    pal_configuration setting; /* as it is */
    int n_node, rest_substeps; /* as it is; of a step at rest, of the body alone */
    double other_substeps;     /* that other bodies need; 0: none do */
    double once, beside;       /* shares of a step's time: pal_estimate_cost */
    /* half and twice the size, over what is now: nodes as they are thought to be, sub-steps, time of a sub-step; NaN:
     * not known, no neighbour in size */
    double nodes[2], substeps[2], work[2];
    double order; /* of the elements */
    /* error of half and of twice as many voxels over this mesh's, as measured (estimate_hierarchy.h); 0: as `order` has
     * it
     */
    double left[2];
    bool implicit;    /* the parameters step and tolerance mean something */
    int solver_order; /* in time */
    double tolerance; /* of the solver as it is */
    double decade;    /* a step's time with a tenth of the tolerance over that as it is; NaN: not known */
} pal_prediction;

/* fills neighbour from ms and the parts that out has; those whose ms or change of
 * the error cannot be predicted are left out; error_m NaN where out's is */
void pal_estimate_predict(const pal_prediction *from, pal_estimate *out);
#endif
