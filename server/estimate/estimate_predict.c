/* Predicts the neighbours in each parameter (estimate_predict.h). */
#include "server/estimate/estimate_predict.h"

#include "server/estimate/tuning.h"
#include "server/sim/core/configuration.h"

#include <math.h>

enum { MIN_SIZE = 4, MAX_SIZE = 400 };

/* nodes, substeps: relative to the present */
static void add(const pal_prediction *from, pal_estimate *out, const pal_configuration *configuration, double ms,
                double change_m, double nodes, double substeps)
{
    int n = out->n_neighbour;
    double error_m = out->error_m + change_m;
    if (!(ms > 0) || isnan(change_m) || error_m < 0 || out->n_neighbour == PAL_ESTIMATE_NEIGHBOURS) return;
    out->neighbour_nodes[n] = (int)lround(from->n_node * nodes);
    out->neighbour_substeps[n] = (int)lround(from->rest_substeps * substeps);
    out->neighbour[out->n_neighbour++] =
        (pal_measured_configuration){.configuration = *configuration, .ms = ms, .error_m = error_m};
}

/* Would a switch accept it, with `more` times the sub-steps in a step? */
static bool taken(const pal_prediction *from, const pal_configuration *to, double more)
{
    if (!from->scene) return true;
    bool known = from->n_substep > 1, fits = !known || more * from->n_substep <= from->scene->max_substep;
    return fits && !pal_configuration_check_live(from->scene, from->body, to, NULL);
}

/* sub-steps of all bodies relative to the present */
static double substeps(const pal_prediction *from, int side)
{
    double own = from->rest_substeps, beside = from->other_substeps;
    if (!(beside > 0)) return from->substeps[side];
    return fmax(own * from->substeps[side], beside) / fmax(own, beside);
}

/* time of a step relative to the present */
static double times(const pal_prediction *from, int side)
{
    double own = fmax(1 - from->once - from->beside, 0);
    return from->once + substeps(from, side) * (from->beside + own * from->work[side]);
}

static void sizes(const pal_prediction *from, pal_estimate *out)
{
    double left[2] = {from->left[0] > 0 ? from->left[0] : exp2(from->order),
                      from->left[1] > 0 ? from->left[1] : exp2(-from->order)};
    pal_configuration to = from->configuration;
    /* calibrated constants are valid only for their own size */
    if (!(from->configuration.size > 0) || from->configuration.k_distance_J > 0) return;
    to.size = from->configuration.size / 2;
    if (to.size >= MIN_SIZE && taken(from, &to, 1))
        add(from, out, &to, out->ms * times(from, 0), out->discretisation_m * (left[0] - 1), from->nodes[0],
            from->substeps[0]);
    to.size = from->configuration.size * 2;
    if (to.size <= MAX_SIZE && taken(from, &to, from->implicit ? 1 : 2))
        add(from, out, &to, out->ms * times(from, 1), out->discretisation_m * (left[1] - 1), from->nodes[1],
            from->substeps[1]);
}

static void steps(const pal_prediction *from, pal_estimate *out)
{
    double shrink = exp2(-from->solver_order);
    pal_configuration to = from->configuration;
    to.step_s = from->configuration.step_s * 2;
    if (to.step_s <= PAL_NEIGHBOUR_MAX_STEP_S && taken(from, &to, 2))
        add(from, out, &to, out->ms / 2, out->time_m * (1 / shrink - 1), 1, 1);
    to.step_s = from->configuration.step_s / 2;
    if (to.step_s >= PAL_NEIGHBOUR_MIN_STEP_S && taken(from, &to, 1))
        add(from, out, &to, out->ms * 2, out->time_m * (shrink - 1), 1, 1);
}

static void tolerances(const pal_prediction *from, pal_estimate *out)
{
    pal_configuration to = from->configuration;
    to.tolerance = from->tolerance * 10;
    if (to.tolerance <= PAL_NEIGHBOUR_MAX_TOLERANCE && taken(from, &to, 1))
        add(from, out, &to, out->ms / from->decade, out->algebraic_m * 9, 1, 1);
    to.tolerance = from->tolerance / 10;
    if (to.tolerance >= PAL_NEIGHBOUR_MIN_TOLERANCE && taken(from, &to, 1))
        add(from, out, &to, out->ms * from->decade, out->algebraic_m * -0.9, 1, 1);
}

void pal_estimate_predict(const pal_prediction *from, pal_estimate *out)
{
    out->n_neighbour = 0;
    sizes(from, out);
    if (!from->implicit) return;
    steps(from, out);
    tolerances(from, out);
}
