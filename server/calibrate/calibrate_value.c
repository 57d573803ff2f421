/* Error of a set of constants, and its slope. */
#include "server/calibrate/calibration.h"

#include "server/base/vec3.h"
#include "server/calibrate/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static pal_err make_workspace(const pal_calibration *c, pal_calibration_workspace *s)
{
    const int n = 3 * c->lattice.n_node;
    bool made = true;
    s->calibration = c;
    s->arena = pal_arena_create(1 << 16, true);
    if (!s->arena) return PAL_ERR_MEMORY;
    for (int k = 0; k < PAL_SPRING_KINDS; k++) {
        s->k[k] = PAL_NEW(s->arena, double, c->lattice.kind[k].n_item);
        s->slope[k] = PAL_NEW(s->arena, double, c->lattice.kind[k].n_item);
        made = made && s->k[k] && s->slope[k];
    }
    for (int i = 0; i < c->n_case; i++) made = (s->x[i] = PAL_NEW(s->arena, double, n)) && made;
    s->value = PAL_NEW(s->arena, double, c->info.n_used);
    s->node = PAL_NEW(s->arena, double, n / 3);
    s->dJ_du = PAL_NEW(s->arena, double, n);
    s->gradient = PAL_NEW(s->arena, double, c->info.n_parameter);
    if (!made || !s->value || !s->node || !s->dJ_du || !s->gradient) return PAL_ERR_MEMORY;
    return pal_equilibrium_workspace_create(&c->lattice, &s->workspace);
}

pal_err pal_calibration_workspace_create(const pal_calibration *calibration, pal_calibration_workspace **out)
{
    pal_calibration_workspace *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    pal_err err = make_workspace(calibration, s);
    if (err)
        pal_calibration_workspace_destroy(s);
    else
        *out = s;
    return err;
}

void pal_calibration_workspace_destroy(pal_calibration_workspace *s)
{
    if (!s) return;
    pal_equilibrium_workspace_destroy(s->workspace);
    pal_arena_destroy(s->arena);
    free(s);
}

/* ---- theta -> constants of springs ---- */

void pal_calibration_constants(const pal_calibration *c, const double *theta, int k, double *k_J)
{
    const double *t = theta + (size_t)k * (size_t)c->info.n_used;
    for (int i = 0; i < c->lattice.n_node; i++) {
        k_J[i] = 0;
        if (!c->has_grid) k_J[i] = exp(t[0]);
        for (int e = c->has_grid ? c->weights.start[i] : 0; c->has_grid && e < c->weights.start[i + 1]; e++)
            k_J[i] += c->weights.weight[e] * exp(t[c->weights.node[e]]);
    }
}

static void spread_constants(pal_calibration_workspace *s, const double *theta)
{
    const pal_calibration *c = s->calibration;
    for (int k = 0; k < c->info.n_kind; k++) {
        const pal_springs *springs = &c->lattice.kind[c->info.kind[k]];
        pal_calibration_constants(c, theta, k, s->node);
        for (int i = 0; i < springs->n_item; i++) {
            double sum = 0;
            for (int p = 0; p < springs->n_corner; p++) sum += s->node[springs->item[springs->n_corner * i + p]];
            s->k[c->info.kind[k]][i] = sum / springs->n_corner;
        }
    }
}

/* adds the slopes of the spring constants to gradient [n_parameter] */
static void gather_slopes(pal_calibration_workspace *s, const double *theta)
{
    const pal_calibration *c = s->calibration;
    for (int k = 0; k < c->info.n_kind; k++) {
        const pal_springs *springs = &c->lattice.kind[c->info.kind[k]];
        const double *t = theta + (size_t)k * (size_t)c->info.n_used, *slope = s->slope[c->info.kind[k]];
        double *to = s->gradient + (size_t)k * (size_t)c->info.n_used, *used = s->value;
        memset(s->node, 0, sizeof(double) * (size_t)c->lattice.n_node);
        memset(used, 0, sizeof(double) * (size_t)c->info.n_used);
        for (int i = 0; i < springs->n_item; i++)
            for (int p = 0; p < springs->n_corner; p++)
                s->node[springs->item[springs->n_corner * i + p]] += slope[i] / springs->n_corner;
        if (c->has_grid) pal_grid_weights_apply_transpose(&c->weights, s->node, used);
        for (int i = 0; i < c->lattice.n_node && !c->has_grid; i++) used[0] += s->node[i];
        for (int i = 0; i < c->info.n_used; i++) to[i] += exp(t[i]) * used[i];
    }
}

/* e_L in per cent; dJ_du of mean e_L^2 over the fitted cases */
static double compare(const pal_calibration *c, const pal_fit_case *fit, const double *x, double *dJ_du)
{
    const double *rest = c->lattice.x_rest;
    double sum = 0, scale = 100 * 100 / (fit->max_m * fit->max_m * fit->n_point);
    if (dJ_du) memset(dJ_du, 0, 3 * sizeof(double) * (size_t)c->lattice.n_node);
    for (int i = 0; i < fit->n_point; i++) {
        double d[3];
        pal_scale3(d, -1, fit->u + 3 * i);
        if (!fit->start) {
            pal_add3(d, d, x + 3 * i);
            pal_sub3(d, d, rest + 3 * i);
            if (dJ_du) pal_axpy3(dJ_du + 3 * i, 2 * scale / c->n_fit, d);
        } else {
            for (int e = fit->start[i]; e < fit->start[i + 1]; e++) {
                pal_axpy3(d, fit->weight[e], x + 3 * fit->node[e]);
                pal_axpy3(d, -fit->weight[e], rest + 3 * fit->node[e]);
            }
            for (int e = fit->start[i]; e < fit->start[i + 1] && dJ_du; e++)
                pal_axpy3(dJ_du + 3 * fit->node[e], 2 * scale / c->n_fit * fit->weight[e], d);
        }
        sum += pal_dot3(d, d);
    }
    return sqrt(scale * sum);
}

/* Equilibrium of a case, from the requested start, otherwise from the undeformed body. */
static pal_err find_rest(pal_calibration_workspace *s, int index, bool warm_start, const pal_equilibrium_options *o,
                         int *n_newton)
{
    const pal_calibration *c = s->calibration;
    const pal_fit_case *fit = &c->fit[index];
    const double *const k[PAL_SPRING_KINDS] = {s->k[0], s->k[1], s->k[2]};
    size_t n = 3 * sizeof(double) * (size_t)c->lattice.n_node;
    pal_equilibrium_report report;
    if (!(warm_start && s->rests[index])) memcpy(s->x[index], fit->x_start, n);
    pal_err err = pal_equilibrium(s->workspace, k, fit->force_N, o, s->x[index], &report, NULL);
    *n_newton += report.n_newton;
    if (err == PAL_ERR_NUMERIC && !o->linear) {
        memcpy(s->x[index], c->lattice.x_rest, n);
        err = pal_equilibrium(s->workspace, k, fit->force_N, o, s->x[index], &report, NULL);
        *n_newton += report.n_newton;
    }
    s->rests[index] = err == PAL_ERR_OK;
    return err;
}

static pal_err evaluate_case(pal_calibration_workspace *s, const double *theta, int index, unsigned ask,
                             pal_calibration_value *out, bool want_slope)
{
    const pal_calibration *c = s->calibration;
    const pal_fit_case *fit = &c->fit[index];
    const double *const k[PAL_SPRING_KINDS] = {s->k[0], s->k[1], s->k[2]};
    bool slope = want_slope && c->cases[index].fit;
    const pal_equilibrium_options o = {.linear = fit->linear};
    out->case_percent[index] = DBL_MAX;
    pal_err err = find_rest(s, index, ask & PAL_CALIBRATION_CONTINUE, &o, &out->n_newton);
    if (err) return err;
    out->case_percent[index] = compare(c, fit, s->x[index], slope ? s->dJ_du : NULL);
    if (!slope) return PAL_ERR_OK;
    err = pal_equilibrium_adjoint(s->workspace, k, s->x[index], &o, s->dJ_du, s->slope, NULL);
    if (!err) gather_slopes(s, theta);
    return err;
}

static void regularise(const pal_calibration *c, const double *theta, pal_calibration_value *out, double *slope)
{
    double smooth = c->n_edge > 0 ? 1.0 / (c->n_edge * c->info.n_kind) : 0;
    double pull = c->info.n_kind > 1 && c->has_grid ? 1.0 / (c->info.n_used * (c->info.n_kind - 1)) : 0;
    for (int k = 0; k < c->info.n_kind; k++) {
        int at = k * c->info.n_used;
        for (int e = 0; e < c->n_edge; e++) {
            int a = at + c->edge[2 * e], b = at + c->edge[2 * e + 1];
            double d = theta[a] - theta[b];
            out->smooth += smooth * d * d;
            if (slope) slope[a] += 2 * c->options.smooth * smooth * d, slope[b] -= 2 * c->options.smooth * smooth * d;
        }
        for (int i = 0; i < c->info.n_used && k > 0 && pull > 0; i++) {
            double d = theta[at + i] - theta[i] - (c->theta[at + i] - c->theta[i]);
            out->pull += pull * d * d;
            if (slope) slope[at + i] += 2 * c->options.pull * pull * d, slope[i] -= 2 * c->options.pull * pull * d;
        }
    }
}

/* sums up; *scale: d ln (mean e_L^2) / d (mean e_L^2); false: no value */
static bool add_up(const pal_calibration *c, pal_calibration_value *out, double *scale)
{
    double mean = 0, square = 0;
    out->error_percent = out->objective = DBL_MAX;
    for (int i = 0; i < c->n_case; i++) {
        if (!c->cases[i].fit) continue;
        double e = out->case_percent[i];
        if (!(e < DBL_MAX)) return false;
        mean += e / c->n_fit;
        square += e * e / c->n_fit;
    }
    double objective = log(square + PAL_ERROR_FLOOR) + c->options.smooth * out->smooth + c->options.pull * out->pull;
    if (!isfinite(objective)) return false;
    out->error_percent = mean;
    out->objective = objective;
    *scale = 1 / (square + PAL_ERROR_FLOOR);
    return true;
}

pal_err pal_calibration_evaluate(const pal_calibration *c, pal_calibration_workspace *workspace, const double *theta,
                                 unsigned ask, pal_calibration_value *out, double *slope, pal_diagnostic *diag)
{
    *out = (pal_calibration_value){.error_percent = DBL_MAX, .objective = DBL_MAX};
    for (int i = 0; i < c->n_case; i++) out->case_percent[i] = NAN;
    size_t n = sizeof(double) * (size_t)c->info.n_parameter;
    if (slope) memset(slope, 0, n);
    for (int i = 0; i < c->info.n_parameter; i++)
        if (!isfinite(theta[i]) || fabs(theta[i]) > 600)
            return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "parameter %d is %g, not the logarithm of a constant", i,
                                      theta[i]);
    memset(workspace->gradient, 0, n);
    spread_constants(workspace, theta);
    bool lost = false;
    for (int i = 0; i < c->n_case; i++) {
        bool fit = c->cases[i].fit;
        if (!(ask & (fit ? PAL_CALIBRATION_FIT : PAL_CALIBRATION_VERIFY))) continue;
        if (fit && lost) { /* one case without an equilibrium: no value */
            out->case_percent[i] = DBL_MAX;
            continue;
        }
        pal_err err = evaluate_case(workspace, theta, i, ask, out, slope && !lost);
        if (err == PAL_ERR_MEMORY) return pal_diagnostic_set(diag, err, "no memory to evaluate load case %d", i);
        lost |= fit && err;
    }
    double scale = 1;
    regularise(c, theta, out, slope);
    const bool valued = ask & PAL_CALIBRATION_FIT && !lost && add_up(c, out, &scale);
    for (int i = 0; slope && i < c->info.n_parameter; i++)
        slope[i] = valued ? slope[i] + scale * workspace->gradient[i] : 0;
    return PAL_ERR_OK;
}

bool pal_calibration_displacement(const pal_calibration *c, const pal_calibration_workspace *workspace, int index,
                                  double *u)
{
    for (int i = 0; i < 3 * c->lattice.n_node && workspace->rests[index]; i++)
        u[i] = workspace->x[index][i] - c->lattice.x_rest[i];
    return workspace->rests[index];
}

const char *pal_fit_report(const pal_fit_options *o, const pal_fit_step *step, int64_t max_evaluation)
{
    if (o->step && !o->step(o->user, step)) return "stopped";
    if (o->target_percent > 0 && step->best_percent <= o->target_percent) return "enough";
    if (step->evaluation + 1 >= max_evaluation) return "evaluations";
    return o->budget_s > 0 && step->seconds >= o->budget_s ? "budget" : NULL;
}
