/* Predicts the neighbours in each parameter and the cost of a step on other meshes (estimate_predict.h). */
#include "server/estimate/estimate_predict.h"

#include "server/base/clock.h"
#include "server/base/machine.h"
#include "server/estimate/tuning.h"
#include "server/num/median.h"

#include <math.h>
#include <string.h>

enum { MIN_SIZE = 4, MAX_SIZE = 400, TIMED = 15 };

/* ---- the probe: alternating steps of two worlds, the sizes of their factors, the machine's read rate ---- */

/* a factor entry is a float, read forwards and backwards */
static const double entry_byte = 4, entry_reads = 2;

static void rest(pal_world *world)
{
    pal_body *body = pal_world_body(world, 0);
    memcpy(body->x, body->x_rest, 3 * sizeof(double) * (size_t)body->n_dof);
    memset(body->v, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    pal_world_invalidate_limits(world, 0);
}

/* Makes a few steps of both worlds from rest under their loads. out: median time of a sub-step, ms; n_cg:
 * iterations of a step. */
static bool time_steps(pal_world *const world[2], double step_s, double out[2], double n_cg[2])
{
    pal_solve_report report;
    double ms[2][TIMED];
    rest(world[0]), rest(world[1]);
    for (int k = 0; k < TIMED; k++)
        for (int v = 0; v < 2; v++) {
            uint64_t began = pal_clock_thread_ns();
            if (pal_world_step(world[v], step_s)) return false;
            if (pal_world_solve_report(world[v], 0, &report)) n_cg[v] += (double)report.n_cg / TIMED;
            ms[v][k] = 1e-6 * (double)(pal_clock_thread_ns() - began) / pal_world_substeps(world[v]);
        }
    for (int v = 0; v < 2; v++) out[v] = pal_median(ms[v], TIMED);
    return out[0] > 0 && out[1] > 0;
}

static void count(const pal_scene *scene, double limit_s, pal_prediction *out)
{
    pal_configuration at = out->configuration;
    double now = out->n_node, whole = out->rest_substeps, limit_times = scene->step_s / limit_s;
    for (int k = 0; k < 2; k++) {
        at.size = k ? 2 * out->configuration.size : out->configuration.size / 2;
        double n = at.size > 0 ? pal_configuration_estimate_nodes(scene, 0, &at) : 0;
        out->nodes[k] = n > 0 ? n / now : k ? 8 : 0.125;
        /* the limit of explicit solvers is proportional to the voxel edge */
        out->substeps[k] = out->implicit ? 1 : fmax(ceil(limit_times * (k ? 2 : 0.5) - 1e-9), 1) / whole;
    }
}

/* time of a sub-step on more nodes over that on this mesh */
static double grown(const pal_solve_report report[2], const double n_cg[2], double along, double nodes, double fine_ms)
{
    double entries = (double)report[1].factor_nonzeros, fill = log(entries / (double)report[0].factor_nonzeros) / along;
    fill = fmin(fmax(fill, PAL_MIN_FILL_RATE), PAL_MAX_FILL_RATE);
    double times = pow(nodes, fill), now = pal_machine_read_ms(entry_byte * entries),
           then = pal_machine_read_ms(entry_byte * entries * times);
    double factor_ms = fmin(n_cg[1] * entry_reads * now, PAL_MAX_FACTOR * fine_ms);
    /* finer meshes need slightly more iterations */
    double more = n_cg[0] > 0 ? fmin(fmax(log(n_cg[1] / n_cg[0]) / along, 0), PAL_MAX_ITERATIONS) : 0;
    if (!(now > 0 && then > 0)) return nodes;
    return pow(nodes, more) * ((fine_ms - factor_ms) * nodes + factor_ms * fmax(then / now, times)) / fine_ms;
}

void pal_estimate_probe_cost(const pal_scene *scene, pal_world *live, pal_world *small, pal_prediction *out)
{
    pal_world *const world[2] = {small, live};
    double ms[2], n_cg[2] = {0, 0},
                  along = log((double)pal_world_view_body(live, 0)->n_node / pal_world_view_body(small, 0)->n_node);
    pal_solve_report report[2] = {{.n_cg = 0}};
    rest(live);
    const double limit_s = pal_world_limit_s(live);
    if (!(along > 0) || !time_steps(world, scene->step_s, ms, n_cg)) return;
    bool known = pal_world_solve_report(small, 0, &report[0]) && pal_world_solve_report(live, 0, &report[1]) &&
                 report[0].factor_nonzeros > 0 && report[1].factor_nonzeros > 0;
    count(scene, limit_s, out);
    double growth = fmin(fmax(log(ms[1] / ms[0]) / along, PAL_MIN_GROWTH), PAL_MAX_GROWTH);
    out->work[0] = pow(out->nodes[0], growth);
    out->work[1] = known ? grown(report, n_cg, along, out->nodes[1], ms[1]) : out->nodes[1];
}

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
    for (int k = 0; k < 2; k++) {
        to.size = k ? from->configuration.size * 2 : from->configuration.size / 2;
        if ((k ? to.size <= MAX_SIZE : to.size >= MIN_SIZE) && taken(from, &to, k && !from->implicit ? 2 : 1))
            add(from, out, &to, out->ms * times(from, k), out->discretisation_m * (left[k] - 1), from->nodes[k],
                from->substeps[k]);
    }
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
