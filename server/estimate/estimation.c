/* The parts of the error of one body: from future steps (time, algebraic) and from equilibria (the other parts). Before
 * it, what they need: its own scene, a live world, meshes for the equilibria. */
#include "server/estimate/estimation.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/estimate/display_error.h"
#include "server/estimate/estimate_hierarchy.h"
#include "server/estimate/estimate_predict.h"
#include "server/estimate/tuning.h"
#include "server/num/median.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/world/zz_estimator.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_AHEAD = 12, TIMED = 7 };

struct pal_estimation {
    const _Atomic bool *stop;
    pal_scene *scene; /* the body alone, without tools and display */
    pal_estimate_state state;
    pal_world *live;          /* the body as it runs */
    bool solves;              /* its solver solves systems to a tolerance */
    pal_solve_accuracy exact; /* of steps without an algebraic error; the solver's own while it makes these */
    double decades;           /* between the two tolerances, log10 */
    double *first, *second;   /* [n_dof][3] */
    /* last equilibrium of another model or law, less where it is sought from, m [n_node][3] */
    double *offset_m;
    /* springs: voxels for finite elements; n_hex 0: use those of the scene's mesh */
    pal_prepared voxels;
    bool springs, locks;
    bool cut, thin;                                  /* many voxels are cut; the body is one or two voxels across */
    bool skinned;                                    /* a skin displays the body */
    pal_rest_solution fine, coarse, coarsest, model; /* world NULL: absent */
    pal_display_error shown;                         /* n 0: no displayed vertices, or nodes are used */
    pal_prediction prediction;
    double left;                   /* what finer meshes change still, over the change from the coarser one */
    pal_estimate_hierarchy family; /* for cut voxels */
    bool measured;                 /* the cost of more nodes is measured, or cannot be */
    double awake_ms;               /* time of a step of a body never seen awake; 0: not measured yet */
    char diag[160];
};

/* appends a clause to a diagnostic */
static void remark(char diag[160], const char *text)
{
    size_t n = strlen(diag);
    snprintf(diag + n, 160 - n, "%s%s", n > 0 ? "; " : "", text);
}

/* ---- own scene ---- */

/* A moving support counts as stationary: its nodes are fixed and positioned with the state. */
static void fix_moving_support(pal_body_def *def, const pal_config_entry *item)
{
    if (def->n_support == PAL_SUPPORT_MAX) return;
    if (pal_support_of_effect(item, &def->support[def->n_support])) def->n_support++;
}

/* Keeps all force components except contact, which the loads of the state represent. */
static void keep_forces(pal_body_def *def)
{
    int n = 0;
    for (int i = 0; i < def->n_effect; i++) {
        const pal_effect *effect = pal_effect_find(def->effect[i].name);
        if (!strcmp(def->effect[i].name, "moving_support")) fix_moving_support(def, &def->effect[i]);
        if (effect && effect->stage == PAL_STAGE_FORCE) def->effect[n++] = def->effect[i];
    }
    def->n_effect = n;
}

static pal_err make_scene(pal_estimation *w, const pal_scene *scene, int body, pal_diagnostic *diag)
{
    if (body < 0 || body >= scene->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist: the scene has %d", body,
                                  scene->n_body);
    w->scene = malloc(sizeof *w->scene);
    if (!w->scene) return PAL_ERR_MEMORY;
    *w->scene = *scene;
    w->scene->n_body = 1;
    w->scene->n_tool = 0;
    /* estimates are made beside the steps of the session, whose threads need the cores */
    w->scene->threads = 1;
    pal_body_def *def = &w->scene->body[0];
    if (body > 0) *def = scene->body[body];
    w->skinned = !strcmp(def->output.name, "skin_output");
    def->output.name[0] = 0;
    keep_forces(def);
    return PAL_ERR_OK;
}

/* ---- worlds ---- */

static const pal_component *solver_of(const pal_world *world)
{
    for (int i = 0; i < pal_world_component_count(world); i++)
        if (pal_world_component(world, i)->effect->stage == PAL_STAGE_SOLVE) return pal_world_component(world, i);
    return NULL;
}

static void exchange_accuracy(pal_estimation *w)
{
    const pal_component *solver = solver_of(w->live);
    if (w->solves) solver->effect->inspect.accuracy(solver->self, &w->exact);
}

/* how accurate steps without an algebraic error are: at least by a decade better than those of the live solver */
static void choose_exact(pal_estimation *w)
{
    exchange_accuracy(w);
    const double live = w->exact.tolerance;
    exchange_accuracy(w);
    const double exact = fmin(fmax(PAL_EXACT_SHARE * live, PAL_TOLERANCE_EXACT), 0.1 * live);
    w->exact = (pal_solve_accuracy){.tolerance = exact, .iterations = 400};
    w->decades = log10(live / exact);
}

static pal_err make_live(pal_estimation *w, pal_diagnostic *diag)
{
    PAL_TRY(pal_world_create(w->scene, diag, &w->live));
    pal_world_body(w->live, 0)->load_cap_N = INFINITY;
    const pal_component *solve = solver_of(w->live);
    const char *solver = solve->effect->name;
    pal_prediction *f = &w->prediction;
    f->implicit = !strcmp(solver, "implicit_euler") || !strcmp(solver, "sdirk2");
    f->solver_order = !strcmp(solver, "implicit_euler") ? 1 : !strcmp(solver, "rk4") ? 4 : 2;
    f->work[0] = f->work[1] = f->decade = NAN;
    f->n_node = pal_world_body(w->live, 0)->n_node, f->rest_substeps = pal_world_substeps(w->live);
    f->order = PAL_USUAL_ORDER;
    f->tolerance = f->configuration.tolerance > 0 ? f->configuration.tolerance : PAL_TOLERANCE_LIVE;
    if (!solve->effect->inspect.accuracy) return PAL_ERR_OK;
    w->solves = true;
    choose_exact(w);
    return PAL_ERR_OK;
}

/* ---- meshes for equilibria ---- */

/* text value of a model key, or `otherwise` if the scene does not set it */
static const char *model_text(const pal_body_def *def, const char *key, const char *otherwise)
{
    const pal_config_value *value = pal_entry_find(&def->model, key);
    return value ? value->text : otherwise;
}

static bool nearly_incompressible(const pal_body_def *def)
{
    bool found = def->material.poisson > PAL_LOCKS_ABOVE;
    for (int k = 0; k < def->n_region; k++) {
        const pal_region *r = &def->region[k];
        found = found || r->poisson > PAL_LOCKS_ABOVE;
        for (int i = 0; r->kind == PAL_REGION_GRID && r->grid_poisson && i < r->n[0] * r->n[1] * r->n[2]; i++)
            found = found || r->grid_poisson[i] > PAL_LOCKS_ABOVE;
    }
    return found;
}

/* Finds the hexahedra that a body of springs lacks; none if it has no voxels. */
static void find_voxels(pal_estimation *w)
{
    pal_body_def *def = &w->scene->body[0];
    w->voxels = *def->mesh;
    memset(&w->voxels.hexes, 0, sizeof w->voxels.hexes);
    if (def->mesh->hexes.n_hex == 0 && !pal_hexes_find(&def->mesh->tets, &w->voxels.hexes, NULL))
        def->mesh = &w->voxels;
}

/* Share of the volume in cut voxels, whose error changes from mesh to mesh without a definite order. */
static double cut_share(const pal_hexes *hexes)
{
    double cut = 0, all = 0;
    for (int e = 0; e < hexes->n_hex; e++) {
        all += (double)hexes->fill[e];
        if ((double)hexes->fill[e] < PAL_WHOLE_FILL) cut += (double)hexes->fill[e];
    }
    return all > 0 ? cut / all : 0;
}

static bool is_thin(const pal_tets *tets)
{
    double min = INFINITY;
    for (int c = 0; c < 3; c++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < tets->n_node; i++)
            low = fmin(low, tets->x[3 * i + c]), high = fmax(high, tets->x[3 * i + c]);
        min = fmin(min, high - low);
    }
    return min < PAL_FEW_ACROSS * tets->edge_m;
}

/* Springs are compared with finite elements, and these with a neo-Hookean law. Where there is such a body, which has
 * supports then, the running one is its own equilibrium; where there is none, or the law is that one, it is solved */
static pal_err make_fine(pal_estimation *w, const pal_body *body, const char *element, const char *law,
                         pal_diagnostic *diag)
{
    pal_diagnostic refused = {""};
    const bool compared = !w->springs && strcmp(model_text(&w->scene->body[0], "law", ""), "neo_hookean");
    if (compared && !pal_rest_solution_make(w->scene, body, NULL, "neo_hookean", &refused, &w->model))
        return pal_rest_solution_of_state(w->scene, w->live, &w->fine);
    PAL_TRY(pal_rest_solution_make(w->scene, body, element, law, diag, &w->fine));
    if (compared) remark(w->diag, refused.text);
    return PAL_ERR_OK;
}

/* a mesh or law that is not available leaves its part of the error unknown */
static pal_err make_rests(pal_estimation *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    pal_body_def *def = &w->scene->body[0];
    const char *element = NULL, *law = NULL;
    pal_diagnostic diag = {""};
    w->springs = !strcmp(def->model.name, "tet_springs");
    if (!w->springs && strcmp(def->model.name, "fem")) {
        remark(w->diag, "discretisation and model: not known of control cells");
        return PAL_ERR_OK;
    }
    if (w->springs) find_voxels(w);
    bool hexes = def->mesh->hexes.n_hex > 0;
    if (w->springs) element = hexes ? "hex8_bbar" : "tet4", law = "corotational";
    const char *is = element ? element : model_text(def, "element", hexes ? "hex8_bbar" : "tet4");
    w->locks = (!strcmp(is, "tet4") || !strcmp(is, "hex8")) && nearly_incompressible(def);
    pal_err err = make_fine(w, body, element, law, &diag);
    if (err) {
        remark(w->diag, diag.text);
        return err == PAL_ERR_MEMORY ? err : PAL_ERR_OK;
    }
    if (pal_estimate_stopped(w->stop)) return PAL_ERR_STATE;
    err = pal_rest_solution_coarser(w->scene, body, element, law, &diag, &w->coarse);
    if (err) remark(w->diag, diag.text);
    if (pal_estimate_stopped(w->stop)) return PAL_ERR_STATE;
    w->cut = !err && cut_share(&def->mesh->hexes) > PAL_MUCH_CUT;
    w->thin = !err && hexes && is_thin(&def->mesh->tets);
    /* without it the order is not tested */
    if (!err) (void)pal_rest_solution_coarser(w->coarse.scene, body, NULL, NULL, NULL, &w->coarsest);
    if (pal_estimate_stopped(w->stop)) return PAL_ERR_STATE;
    if (w->skinned) PAL_TRY(pal_display_error_make(&w->fine, &w->coarse, &w->coarsest, &w->shown));
    return PAL_ERR_OK;
}

static pal_err take_state(pal_estimation *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    size_t n = 3 * (size_t)body->n_dof;
    pal_estimate_state *s = &w->state;
    *s = (pal_estimate_state){.n_dof = body->n_dof, .n_node = body->n_node};
    s->x = malloc(n * sizeof(double)), s->v = malloc(n * sizeof(double));
    s->load = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->borne = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->external_force = calloc(3 * (size_t)body->n_node, sizeof(double));
    w->first = malloc(n * sizeof(double)), w->second = malloc(n * sizeof(double));
    w->offset_m = calloc(3 * (size_t)body->n_node, sizeof(double));
    for (int i = 0; i < pal_world_component_count(w->live); i++) {
        const pal_effect *effect = pal_world_component(w->live, i)->effect;
        if (effect->stage != PAL_STAGE_FORCE || s->n_component == PAL_ESTIMATE_COMPONENTS) continue;
        s->component[s->n_component] = effect->name;
        s->component_enabled[s->n_component++] = true;
    }
    return s->x && s->v && s->load && s->external_force && s->borne && w->first && w->second && w->offset_m
               ? PAL_ERR_OK
               : PAL_ERR_MEMORY;
}

static pal_err open_work(pal_estimation *w, const pal_scene *scene, int body, pal_diagnostic *diag)
{
    PAL_TRY(make_scene(w, scene, body, diag));
    pal_configuration_of(scene, body, &w->prediction.configuration);
    w->prediction.scene = w->scene, w->prediction.body = 0;
    PAL_TRY(make_live(w, diag));
    if (pal_world_body(w->live, 0)->active)
        return pal_diagnostic_set(
            diag, PAL_ERR_REFUSED,
            "body \"%s\" is refined while it runs: its error is not estimated (`palpate study` measures "
            "it against its finest level)",
            w->scene->body[0].name);
    PAL_TRY(take_state(w));
    PAL_TRY(make_rests(w));
    return pal_estimate_stopped(w->stop) ? PAL_ERR_STATE : PAL_ERR_OK;
}

pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out)
{
    pal_estimation *w = calloc(1, sizeof *w);
    if (!w) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for an estimator");
    w->stop = stop;
    pal_err err = open_work(w, scene, body, diag);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "no memory for the worlds of an estimator");
    if (err)
        pal_estimation_close(w);
    else
        *out = w;
    return err;
}

void pal_estimation_close(pal_estimation *w)
{
    if (!w) return;
    pal_world_destroy(w->live);
    pal_rest_solution_free(&w->fine), pal_rest_solution_free(&w->coarse), pal_rest_solution_free(&w->coarsest);
    pal_rest_solution_free(&w->model);
    pal_display_error_free(&w->shown);
    pal_hexes_free(&w->voxels.hexes);
    free(w->scene);
    free(w->state.x), free(w->state.v), free(w->state.load), free(w->state.external_force), free(w->state.borne);
    free(w->first), free(w->second), free(w->offset_m);
    pal_estimate_hierarchy_free(&w->family);
    free(w);
}

pal_estimate_state *pal_estimation_state(pal_estimation *work)
{
    return &work->state;
}

/* ---- one estimate ---- */

/* the median of a member (offset), because an interrupted step takes too long; NaN: no step */
static double median_cost(const pal_estimate_state *s, size_t offset)
{
    double value[PAL_ESTIMATE_STEPS];
    for (int i = 0; i < s->n_cost; i++) value[i] = (double)*(const float *)((const char *)&s->cost[i] + offset);
    return s->n_cost > 0 ? pal_median(value, s->n_cost) : (double)NAN;
}

/* forces of a state do not depend on the steps made before it, in which elements may have been inverted */
static void reset_forces(pal_world *world)
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        const pal_component *component = pal_world_component(world, i);
        if (component->effect->stage == PAL_STAGE_FORCE && component->effect->reset)
            component->effect->reset(component->self, pal_world_view_body(world, 0));
    }
}

/* sets the state and its loads in a world of the same mesh */
static pal_err set_state(const pal_estimation *w, pal_world *world)
{
    const pal_estimate_state *s = &w->state;
    pal_body *body = pal_world_body(world, 0);
    PAL_TRY(pal_estimate_match(s, world, w->scene, true));
    reset_forces(world);
    for (int i = 0; i < body->n_node; i++) PAL_TRY(pal_world_load(world, 0, i, s->load + 3 * (size_t)i));
    memcpy(body->x, s->x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(body->v, s->v, 3 * sizeof(double) * (size_t)body->n_dof);
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_set3(body->v + 3 * i, 0, 0, 0);
    pal_world_invalidate_limits(world, 0);
    return PAL_ERR_OK;
}

/* Makes n steps of dt_s from the state -> x; ms: time of one. False: stopped, or not possible. */
static bool make_steps(const pal_estimation *w, pal_world *world, int n, double dt_s, double *x, double *ms)
{
    const pal_body *body = pal_world_body(world, 0);
    bool good = !set_state(w, world);
    uint64_t began = pal_clock_thread_ns();
    for (int i = 0; i < n && good; i++) good = !pal_estimate_stopped(w->stop) && !pal_world_step(world, dt_s);
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
    double live_ms = NAN, exact_ms = NAN, half_ms;
    out->algebraic_m = w->solves ? NAN : 0;
    if (w->solves && !make_steps(w, w->live, n, step_s, w->first, &live_ms)) return;
    exchange_accuracy(w);
    bool good = make_steps(w, w->live, n * n_sub, step_s / n_sub, w->second, &exact_ms);
    if (good && w->solves) out->algebraic_m = pal_max_dist3(w->first, w->second, n_dof);
    good = good && make_steps(w, w->live, 2 * n * n_sub, 0.5 * step_s / n_sub, w->first, &half_ms);
    exchange_accuracy(w);
    if (!good) return;
    if (w->solves && n_sub == 1) w->prediction.decade = pow(fmax(exact_ms / live_ms, 1), 1 / w->decades);
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
        pal_estimate_probe_cost(w->scene, w->live, small, &w->prediction);
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

/* the equilibrium of another model or law, sought from where it was relative to x the last time, else from x */
static bool find_other(pal_estimation *w, pal_rest_solution *other, const double *x, const pal_body *body)
{
    const int n = 3 * w->state.n_node;
    bool moved = false;
    for (int i = 0; i < n; i++) {
        w->second[i] = x[i] + w->offset_m[i];
        moved = moved || w->offset_m[i] != 0;
    }
    bool found = pal_rest_solution_find(other, &w->state, body, w->second, w->stop);
    /* the load may be another than the last time */
    if (!found && moved && !(w->stop && *w->stop)) found = pal_rest_solution_find(other, &w->state, body, x, w->stop);
    for (int i = 0; i < n; i++) w->offset_m[i] = found ? other->x[i] - x[i] : 0;
    return found;
}

static bool find_fine(pal_estimation *w, const pal_body *body)
{
    return w->springs ? find_other(w, &w->fine, w->state.x, body)
                      : pal_rest_solution_find(&w->fine, &w->state, body, w->state.x, w->stop);
}

static double known(double part)
{
    return isnan(part) ? 0 : part;
}

/* Is the last change at least as large as the previous one? */
static bool changes_grow(pal_estimation *w, const pal_body *body, double last)
{
    if (!w->coarsest.world || !pal_rest_solution_find(&w->coarsest, &w->state, body, NULL, w->stop)) return false;
    double first = w->shown.n > 0 ? pal_display_error_change(&w->shown, PAL_DISPLAY_COARSE, PAL_DISPLAY_COARSEST)
                                  : pal_rest_solution_change(&w->coarse, &w->coarsest);
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
        if (w->coarse.world) remark(out->diag, "discretisation: the coarser mesh finds no rest under these loads");
        return;
    }
    double last = w->shown.n > 0 ? pal_display_error_change(&w->shown, PAL_DISPLAY_FINE, PAL_DISPLAY_COARSE)
                                 : pal_rest_solution_change(&w->fine, &w->coarse);
    if ((w->cut || w->thin) && !w->springs)
        fresh = pal_estimate_hierarchy_refresh(w->scene, body, &w->prediction.configuration, &w->state, w->shown.n > 0,
                                               !w->cut, w->stop, &w->family);
    const pal_estimate_hierarchy *f = &w->family;
    w->prediction.left[0] = f->known ? known(f->half) : 0, w->prediction.left[1] = f->known ? known(f->twice) : 0;
    if (w->cut) {
        char text[80];
        pal_estimate_hierarchy_describe(f, fresh, text, sizeof text);
        remark(out->diag, text);
    }
    if (f->known) {
        w->prediction.order = PAL_USUAL_ORDER;
        w->left = f->times;
        out->discretisation_m = last * w->left + skin_off(w);
        return;
    }
    bool early = changes_grow(w, body, last);
    w->prediction.order = early ? PAL_EARLY_ORDER : PAL_USUAL_ORDER;
    if (early) remark(out->diag, "discretisation: still grows from mesh to mesh, so more may be left");
    w->left = 1 / (exp2(w->prediction.order) - 1);
    out->discretisation_m = last * w->left + skin_off(w);
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
    remark(out->diag, "fitted: the mesh's part is in the model's");
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
        out->model_m = !strcmp(model_text(&w->scene->body[0], "law", ""), "neo_hookean") ? 0 : (double)NAN;
    else if (find_other(w, &w->model, w->fine.x, body))
        out->model_m = pal_max_dist3(w->model.x, w->fine.x, n);
}

/* The loads with which the tools would press as far on the limit of the meshes, in shares of the present ones, by the
 * extrapolation of the discretisation part; the law's change is added. Springs: their own share is 1 */
static double force_error_percent(const pal_estimation *w)
{
    double fine = w->fine.press, limit = fine + w->left * (fine - w->coarse.press);
    double off = fabs(limit - (w->springs ? 1 : fine));
    if (w->model.world && isfinite(w->model.press) && !w->springs) off += fabs(w->model.press - fine);
    return limit > 0 ? 100 * off / limit : (double)NAN;
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
    if (!find_borne(w) || !find_fine(w, body)) {
        out->locking = false;
        remark(out->diag, "no rest was found under these loads");
        return;
    }
    discretise(w, body, out);
    if (!pal_estimate_stopped(w->stop)) compare_models(w, body, out);
    if (isfinite(out->discretisation_m)) out->force_percent = force_error_percent(w);
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
    remark(out->diag, PAL_ESTIMATE_ASLEEP);
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
    *out = pal_estimate_unknown();
    out->tick = w->state.tick, out->time_s = w->state.time_s;
    out->max_m = pal_max_dist3(w->state.x, pal_world_view_body(w->live, 0)->x_rest, w->state.n_dof);
    out->ms = median_cost(&w->state, offsetof(pal_estimate_cost, ms));
    memcpy(out->diag, w->diag, sizeof out->diag);
    report_sleep_cost(w, out);
    find_time_parts(w, out);
    drop_rounding(w, out);
    if (!pal_estimate_stopped(w->stop)) find_rests(w, out);
    sum_up(w, out);
    if (!pal_estimate_stopped(w->stop)) measure_size_cost(w);
    w->prediction.n_substep = w->state.n_substep;
    w->prediction.other_substeps = ceil(w->scene->step_s / w->state.other_limit_s * (1 - 1e-12));
    w->prediction.once = w->state.n_cost ? median_cost(&w->state, offsetof(pal_estimate_cost, once)) : 0;
    w->prediction.beside = w->state.n_cost ? median_cost(&w->state, offsetof(pal_estimate_cost, beside)) : 0;
    pal_estimate_predict(&w->prediction, out);
    return !pal_estimate_stopped(w->stop);
}
