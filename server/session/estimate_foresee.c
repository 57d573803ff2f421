/* Neighbours on the knobs. */
#include "server/session/estimate_foresee.h"

#include "server/session/switching.h"

#include <math.h>

enum { LEAST_SIZE = 4, MOST_SIZE = 400, NODES_TIMES = 8 };
static const double least_step_s = 1e-4, most_step_s = 0.1, least_tolerance = 1e-12, most_tolerance = 0.5;

static void add(pal_estimate *out, const pal_setting *setting, double ms, double change_m)
{
    double error_m = out->error_m + change_m;
    if (!(ms > 0) || isnan(change_m) || error_m < 0 || out->n_neighbour == PAL_ESTIMATE_NEIGHBOURS) return;
    out->neighbour[out->n_neighbour++] = (pal_priced_setting){.setting = *setting, .ms = ms, .error_m = error_m};
}

/* would a switch take it? With `more` times the sub-steps in a step */
static bool taken(const pal_foresight *from, const pal_setting *to, double more)
{
    if (!from->scene) return true;
    bool known = from->n_substep > 1, fits = !known || more * from->n_substep <= from->scene->most_substep;
    return fits && !pal_switch_check(from->scene, from->body, to, NULL);
}

static void sizes(const pal_foresight *from, pal_estimate *out)
{
    double growth = pow(NODES_TIMES, from->growth), shrink = exp2(-from->order);
    pal_setting to = from->setting;
    /* calibrated constants hold for the size that they were found for */
    if (!(from->setting.size > 0) || from->setting.k_distance_J > 0) return;
    to.size = from->setting.size / 2;
    if (to.size >= LEAST_SIZE && taken(from, &to, 1))
        add(out, &to, out->ms / growth, out->discretisation_m * (1 / shrink - 1));
    to.size = from->setting.size * 2;
    if (to.size <= MOST_SIZE && taken(from, &to, from->implicit ? 1 : 2))
        add(out, &to, out->ms * growth, out->discretisation_m * (shrink - 1));
}

static void steps(const pal_foresight *from, pal_estimate *out)
{
    double shrink = exp2(-from->solver_order);
    pal_setting to = from->setting;
    to.step_s = from->setting.step_s * 2;
    if (to.step_s <= most_step_s && taken(from, &to, 2)) add(out, &to, out->ms / 2, out->time_m * (1 / shrink - 1));
    to.step_s = from->setting.step_s / 2;
    if (to.step_s >= least_step_s && taken(from, &to, 1)) add(out, &to, out->ms * 2, out->time_m * (shrink - 1));
}

static void tolerances(const pal_foresight *from, pal_estimate *out)
{
    pal_setting to = from->setting;
    to.tolerance = from->tolerance * 10;
    if (to.tolerance <= most_tolerance && taken(from, &to, 1))
        add(out, &to, out->ms / from->decade, out->algebraic_m * 9);
    to.tolerance = from->tolerance / 10;
    if (to.tolerance >= least_tolerance && taken(from, &to, 1))
        add(out, &to, out->ms * from->decade, out->algebraic_m * -0.9);
}

void pal_estimate_foresee(const pal_foresight *from, pal_estimate *out)
{
    out->n_neighbour = 0;
    sizes(from, out);
    if (!from->implicit) return;
    steps(from, out);
    tolerances(from, out);
}
