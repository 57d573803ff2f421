/* The parts of the error of one body: from future steps (time, algebraic) and from equilibria (the other parts). */
#include "server/estimate/estimation.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/estimate/tuning.h"
#include "server/num/median.h"
#include "server/sim/world/zz_estimator.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_AHEAD = 12, TIMED = 7 };

/* ---- one estimate ---- */

/* the median of a member (offset), because an interrupted step takes too long; NaN: no step */
static double median_cost(const pal_estimate_state *s, size_t offset)
{
    double value[PAL_ESTIMATE_STEPS];
    for (int i = 0; i < s->n_cost; i++) value[i] = (double)*(const float *)((const char *)&s->cost[i] + offset);
    return s->n_cost > 0 ? pal_median(value, s->n_cost) : (double)NAN;
}

/* sets the state and its loads in a world of the same mesh */
static pal_err set_state(const pal_estimation *w, pal_world *world)
{
    const pal_estimate_state *s = &w->state;
    pal_body *body = pal_world_body(world, 0);
    pal_material now;
    PAL_TRY(pal_estimate_match_components(s, world, world == w->exact ? w->exact_scene : w->scene, true));
    pal_world_current_material(world, 0, &now);
    if (memcmp(&now, &s->material, sizeof now)) {
        PAL_TRY(pal_world_material(world, 0, &s->material, NULL));
        body->load_cap_N = INFINITY;
    }
    for (int i = 0; i < body->n_node; i++) PAL_TRY(pal_world_load(world, 0, i, s->load + 3 * (size_t)i));
    memcpy(body->x, s->x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(body->v, s->v, 3 * sizeof(double) * (size_t)body->n_dof);
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_set3(body->v + 3 * i, 0, 0, 0);
    body->frozen = false;
    pal_world_invalidate_limits(world, 0);
    return PAL_ERR_OK;
}

/* Makes n steps of dt_s from the state -> x; ms: time of one. False: stopped, or not possible. */
static bool make_steps(const pal_estimation *w, pal_world *world, int n, double dt_s, double *x, double *ms)
{
    const pal_body *body = pal_world_body(world, 0);
    bool good = !set_state(w, world);
    uint64_t began = pal_clock_thread_ns();
    for (int i = 0; i < n && good; i++) good = !pal_estimate_stopped(w) && !pal_world_step(world, dt_s);
    *ms = 1e-6 * (double)(pal_clock_thread_ns() - began) / n;
    memcpy(x, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    return good && pal_body_finite(body);
}

/* computes the algebraic and time parts from future steps */
static void find_time_parts(pal_estimation *w, pal_estimate *out)
{
    double step_s = w->scene->step_s, ms = isnan(out->ms) ? 1 : out->ms;
    int n_sub = w->state.n_substep > 0 ? w->state.n_substep : 1, n_dof = w->state.n_dof;
    int n = (int)fmin(fmin(MAX_AHEAD, ceil(PAL_AHEAD_S / step_s)), fmax(1, PAL_AHEAD_MS / (4 * ms)));
    pal_world *exact = w->exact ? w->exact : w->live;
    double live_ms = NAN, exact_ms = NAN, half_ms;
    out->algebraic_m = w->exact ? NAN : 0;
    if (w->exact && !make_steps(w, w->live, n, step_s, w->first, &live_ms)) return;
    if (!make_steps(w, exact, n * n_sub, step_s / n_sub, w->second, &exact_ms)) return;
    if (w->exact) out->algebraic_m = pal_max_dist3(w->first, w->second, n_dof);
    if (!make_steps(w, exact, 2 * n * n_sub, 0.5 * step_s / n_sub, w->first, &half_ms)) return;
    if (w->exact && n_sub == 1)
        w->prediction.decade =
            pow(fmax(exact_ms / live_ms, 1), 1 / log10(w->prediction.tolerance / PAL_TOLERANCE_EXACT));
    out->time_m = pal_max_dist3(w->first, w->second, n_dof) / (1 - ldexp(1, -w->prediction.solver_order));
}

/* Measures once the body's own method on the coarse mesh and on this one, under the same loads. */
static void measure_size_cost(pal_estimation *w)
{
    pal_world *small = NULL;
    if (w->measured || !w->coarse.world) return;
    w->measured = true;
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return;
    *scene = *w->coarse.scene;
    scene->body[0].model = w->scene->body[0].model;
    scene->body[0].solver = w->scene->body[0].solver;
    if (!pal_world_create(scene, NULL, &small)) {
        const pal_body *loaded = pal_world_view_body(w->coarse.world, 0);
        pal_body *body = pal_world_body(small, 0);
        (void)pal_estimate_match_components(&w->state, small, scene, true);
        body->load_cap_N = INFINITY;
        for (int i = 0; loaded->external_force && i < body->n_node && body->n_node == loaded->n_node; i++)
            (void)pal_world_load(small, 0, i, loaded->external_force + 3 * (size_t)i);
        pal_estimate_cost_model(w->scene, w->live, small, &w->prediction);
    }
    pal_world_destroy(small);
    free(scene);
}

/* ---- equilibria ---- */

/* Computes the loads under which the present shape is an equilibrium: the acting loads less the residual, which
 * accelerates the body or is taken by drag (d'Alembert). At rest they equal the acting loads. Supports bear the
 * residual of their own nodes. */
static bool find_borne(pal_estimation *w)
{
    pal_estimate_state *s = &w->state;
    pal_body *body = pal_world_body(w->live, 0);
    if (set_state(w, w->live)) return false;
    memset(body->v, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    if (pal_world_assemble_forces(w->live, 0)) return false;
    memcpy(s->borne, s->load, 3 * sizeof(double) * (size_t)s->n_node);
    for (int i = 0; i < s->n_node; i++)
        if (!body->support[i]) pal_axpy3(s->borne + 3 * (size_t)i, -1, body->f + 3 * (size_t)i);
    return true;
}

static double known(double part)
{
    return isnan(part) ? 0 : part;
}

/* largest distance between two rest solutions, at nodes of the running body that the coarser one has */
static double change(const pal_rest_solution *rest, const pal_rest_solution *coarser)
{
    double max = 0;
    for (int k = 0; k < coarser->n_common; k++) {
        size_t i = 3 * (size_t)coarser->common[k];
        max = fmax(max, pal_dist3(rest->x + i, coarser->x + i));
    }
    return max;
}

/* Is the last change at least as large as the previous one? */
static bool changes_grow(pal_estimation *w, const pal_body *body, double last)
{
    if (!w->coarsest.world || !pal_rest_solution_find(&w->coarsest, &w->state, body, NULL, w->stop)) return false;
    double first = w->shown.n > 0 ? pal_display_error_change(&w->shown, PAL_DISPLAY_COARSE, PAL_DISPLAY_COARSEST)
                                  : change(&w->coarse, &w->coarsest);
    return first > 0 && last >= first;
}

/* Distance of the skin from its elements. 0 for springs, whose distance from the elements already includes it. */
static double skin_off(pal_estimation *w)
{
    return w->shown.n > 0 && !w->springs ? pal_display_error_skin(&w->shown, w->fine.x, 0) : 0;
}

static void discretise(pal_estimation *w, const pal_body *body, pal_estimate *out)
{
    pal_zz_estimator_error zz_estimator;
    bool fresh = false;
    if (!pal_zz_estimator_estimate(w->fine.world, 0, NULL, &zz_estimator, NULL))
        out->energy_error_percent = zz_estimator.percent;
    if (!pal_rest_solution_find(&w->coarse, &w->state, body, NULL, w->stop)) {
        if (w->coarse.world)
            pal_estimate_remark(out->diag, "discretisation: the coarser mesh finds no rest under these loads");
        return;
    }
    double last = w->shown.n > 0 ? pal_display_error_change(&w->shown, PAL_DISPLAY_FINE, PAL_DISPLAY_COARSE)
                                 : change(&w->fine, &w->coarse);
    if ((w->cut || w->thin) && !w->springs)
        fresh = pal_estimate_hierarchy_refresh(w->scene, body, &w->prediction.configuration, &w->state, w->shown.n > 0,
                                               !w->cut, w->stop, &w->family);
    const pal_estimate_hierarchy *f = &w->family;
    w->prediction.left[0] = f->known ? known(f->half) : 0, w->prediction.left[1] = f->known ? known(f->twice) : 0;
    if (w->cut) {
        char text[80];
        pal_estimate_hierarchy_describe(f, fresh, text, sizeof text);
        pal_estimate_remark(out->diag, text);
    }
    if (f->known) {
        w->prediction.order = PAL_USUAL_ORDER;
        out->discretisation_m = last * f->times + skin_off(w);
        return;
    }
    bool early = changes_grow(w, body, last);
    w->prediction.order = early ? PAL_EARLY_ORDER : PAL_USUAL_ORDER;
    if (early) pal_estimate_remark(out->diag, "discretisation: still grows from mesh to mesh, so more may be left");
    out->discretisation_m = last / (exp2(w->prediction.order) - 1) + skin_off(w);
}

/* Springs fitted to converged finite elements are closer to those than to elements on their own voxels. The error
 * is therefore their distance from the Richardson limit of the two meshes, which includes the discretisation part. */
static void compare_fitted(pal_estimation *w, pal_estimate *out)
{
    double max = 0, more = 1 / (exp2(w->prediction.order) - 1);
    if (w->shown.n > 0) max = pal_display_error_skin(&w->shown, w->state.x, more);
    for (int k = 0; k < w->coarse.n_common && w->shown.n == 0; k++) {
        size_t i = 3 * (size_t)w->coarse.common[k];
        double limit[3];
        for (size_t c = 0; c < 3; c++) limit[c] = w->fine.x[i + c] + more * (w->fine.x[i + c] - w->coarse.x[i + c]);
        max = fmax(max, pal_dist3(w->state.x + i, limit));
    }
    out->model_m = max, out->discretisation_m = 0;
    pal_estimate_remark(out->diag, "fitted: the mesh's part is in the model's");
}

static void compare_models(pal_estimation *w, const pal_body *body, pal_estimate *out)
{
    int n = w->state.n_node;
    if (w->springs && w->prediction.configuration.k_distance_J > 0 && out->discretisation_m > 0)
        compare_fitted(w, out);
    else if (w->springs) /* their present positions are the equilibrium under `borne` */
        out->model_m =
            w->shown.n > 0 ? pal_display_error_skin(&w->shown, w->state.x, 0) : pal_max_dist3(w->state.x, w->fine.x, n);
    else if (!w->model.world)
        out->model_m = !strcmp(pal_estimate_model_text(&w->scene->body[0], "law", ""), "neo_hookean") ? 0 : (double)NAN;
    else if (pal_rest_solution_find(&w->model, &w->state, body, w->fine.x, w->stop))
        out->model_m = pal_max_dist3(w->model.x, w->fine.x, n);
}

static bool has_moved(const pal_estimation *w, const pal_estimate *out)
{
    return out->max_m > PAL_UNMOVED * pal_world_view_body(w->live, 0)->length_scale_m;
}

static void find_rests(pal_estimation *w, pal_estimate *out)
{
    const pal_body *body = pal_world_body(w->live, 0);
    if (!w->fine.world) return;
    out->locking = w->locks;
    if (!has_moved(w, out)) {
        if (w->coarse.world) out->discretisation_m = 0;
        out->model_m = out->energy_error_percent = 0;
        return;
    }
    if (!find_borne(w) || !pal_rest_solution_find(&w->fine, &w->state, body, w->state.x, w->stop)) {
        out->locking = false;
        pal_estimate_remark(out->diag, "no rest was found under these loads");
        return;
    }
    discretise(w, body, out);
    if (!pal_estimate_stopped(w)) compare_models(w, body, out);
}

static double largest_move(const pal_estimation *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    return pal_max_dist3(w->state.x, body->x_rest, w->state.n_dof);
}

/* Without its dominant parts the sum must stay unknown: it would otherwise be compared with complete errors of a
 * study. */
static void sum_up(const pal_estimation *w, pal_estimate *out)
{
    bool whole = !isnan(out->discretisation_m) && !(w->springs && isnan(out->model_m));
    out->error_m = whole ? out->discretisation_m + known(out->algebraic_m) + known(out->time_m) + known(out->model_m)
                         : (double)NAN;
}

/* a sleeping body costs almost nothing: measures the cost of an awake step */
static void report_sleep_cost(pal_estimation *w, pal_estimate *out)
{
    if (!w->state.asleep) return;
    if (isnan(out->ms) && !w->awake_ms) (void)make_steps(w, w->live, TIMED, w->scene->step_s, w->first, &w->awake_ms);
    if (isnan(out->ms)) out->ms = w->awake_ms;
    out->asleep = true;
    pal_estimate_remark(out->diag, PAL_ESTIMATE_ASLEEP);
}

/* the steps of a body at its initial shape contain only rounding */
static void drop_rounding(const pal_estimation *w, pal_estimate *out)
{
    double min_m = PAL_UNMOVED * pal_world_view_body(w->live, 0)->length_scale_m;
    if (has_moved(w, out)) return;
    if (out->time_m < min_m) out->time_m = 0;
    if (out->algebraic_m < min_m) out->algebraic_m = 0;
}

bool pal_estimation_run(pal_estimation *w, pal_estimate *out)
{
    *out = (pal_estimate){.tick = w->state.tick,
                          .time_s = w->state.time_s,
                          .max_m = largest_move(w),
                          .discretisation_m = NAN,
                          .algebraic_m = NAN,
                          .time_m = NAN,
                          .model_m = NAN,
                          .energy_error_percent = NAN,
                          .ms = median_cost(&w->state, offsetof(pal_estimate_cost, ms))};
    memcpy(out->diag, w->diag, sizeof out->diag);
    report_sleep_cost(w, out);
    find_time_parts(w, out);
    drop_rounding(w, out);
    if (!pal_estimate_stopped(w)) find_rests(w, out);
    sum_up(w, out);
    if (!pal_estimate_stopped(w)) measure_size_cost(w);
    w->prediction.n_substep = w->state.n_substep;
    w->prediction.other_substeps = ceil(w->scene->step_s / w->state.other_limit_s * (1 - 1e-12));
    w->prediction.once = w->state.n_cost ? median_cost(&w->state, offsetof(pal_estimate_cost, once)) : 0;
    w->prediction.beside = w->state.n_cost ? median_cost(&w->state, offsetof(pal_estimate_cost, beside)) : 0;
    pal_estimate_predict(&w->prediction, out);
    return !pal_estimate_stopped(w);
}
