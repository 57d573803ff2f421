/* `palpate bench estimate`: what the live estimator predicts for the neighbours of the configuration of a running body,
 * against what they take and leave after a switch. The procedural organ as finite elements and as springs, pulled aside
 * by a load on all nodes: the estimate is made while it swings; then for each neighbour the same swing is switched to
 * it as a session does, and both worlds step alternately. Cost: a step of the scene in the new configuration over one
 * in the old, medians of processor time, predicted over measured; once alone and once with a second body that keeps its
 * configuration. Error: the estimate of the new configuration for the state that it received, predicted over estimated.
 * Wanted: cost within 30 %. With a SCENE: what one estimate of its first body takes, while it is pulled. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"
#include "server/estimate/estimation.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"
#include "server/session/configuration_switch.h"

#include <malloc.h>
#include <stdio.h>

enum { N_CASE = 8, N_ESTIMATE = 12, WARM = 12, ROUNDS = 6, MAX_SAMPLE = 1024, MAX_NODE = 30000 };
static const double max_ratio = 1.3, round_s = 0.1;
/* total load as a share of E S^2, S the box diagonal: bends the organ by a few per cent */
static const double load_share = 0.001;

typedef struct subject {
    const char *name;
    int resolution;
    bool fem;
    const char *solver, *element; /* NULL: the default */
    bool two;                     /* a second, equal body keeps its configuration */
} subject;

typedef struct neighbour {
    pal_measured_configuration predicted;
    int n_node, n_substep;
    double was_ms, ms; /* of a step before and after the switch */
    double own_m;      /* estimated error of the new configuration */
    pal_err err;
} neighbour;

typedef struct result {
    pal_estimate estimate;
    neighbour neighbour[PAL_ESTIMATE_NEIGHBOURS];
} result;

/* sideways, proportional to the masses of the nodes: the same on every mesh */
static pal_err put_load(pal_world *world, const pal_scene *scene)
{
    pal_body *body = pal_world_body(world, 0);
    const double aside[3] = {scene->up[1], scene->up[2], scene->up[0]};
    double sum_kg = 0,
           total = load_share * scene->body[0].material.young_Pa * body->length_scale_m * body->length_scale_m, f[3];
    for (int i = 0; i < body->n_node; i++) sum_kg += body->node_mass_kg[i];
    for (int i = 0; i < body->n_node; i++) {
        pal_scale3(f, total * body->node_mass_kg[i] / sum_kg, aside);
        PAL_TRY(pal_world_load(world, 0, i, f));
    }
    return PAL_ERR_OK;
}

/* a few steps from rest under the load */
static pal_err swing(pal_world *world, const pal_scene *scene)
{
    pal_world_reset(world);
    PAL_TRY(put_load(world, scene));
    for (int i = 0; i < WARM; i++) PAL_TRY(pal_world_step(world, scene->step_s));
    return PAL_ERR_OK;
}

/* a round of timed steps; cost [MAX_SAMPLE] may be NULL */
static pal_err timed(pal_world *world, double step_s, double *ms, pal_estimate_cost *cost, int *n)
{
    for (double time = 0; time < round_s - 1e-9 && *n < MAX_SAMPLE; time += step_s, ++*n) {
        pal_world_wake(world);
        PAL_TRY(bench_step(world, step_s, &ms[*n]));
        if (cost) cost[*n] = pal_estimate_cost_of(world, 0, ms[*n]);
    }
    return PAL_ERR_OK;
}

static pal_err estimate(const pal_scene *scene, pal_world *world, const pal_estimate_cost *cost, int n_cost,
                        pal_estimate *out, pal_diagnostic *diag)
{
    pal_estimation *work = NULL;
    PAL_TRY(pal_estimation_open(scene, 0, NULL, diag, &work));
    pal_estimate_state *state = pal_estimation_state(work);
    bool ok = pal_estimate_copy(state, world, 0);
    for (int i = 0; i < n_cost && i < PAL_ESTIMATE_STEPS; i++) state->cost[state->n_cost++] = cost[i];
    ok = ok && pal_estimation_run(work, out);
    pal_estimation_close(work);
    return ok ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "the state has no estimate");
}

/* both worlds step alternately from the transferred state */
static pal_err step_alternately(pal_world *was, double was_s, pal_world *now, double now_s, neighbour *r)
{
    double ms[2][MAX_SAMPLE];
    int n[2] = {0, 0};
    for (int k = 0; k < ROUNDS; k++) {
        PAL_TRY(timed(was, was_s, ms[0], NULL, &n[0]));
        PAL_TRY(timed(now, now_s, ms[1], NULL, &n[1]));
    }
    r->n_substep = pal_world_substeps(now);
    r->was_ms = pal_median(ms[0], n[0]), r->ms = pal_median(ms[1], n[1]) * was_s / now_s;
    return PAL_ERR_OK;
}

static pal_err try_neighbour(const pal_scene *scene, pal_world *world, neighbour *r, pal_diagnostic *diag)
{
    pal_configuration_switch *change = NULL;
    pal_world *next = NULL;
    pal_estimate own = {.error_m = NAN};
    if (pal_configuration_estimate_nodes(scene, 0, &r->predicted.configuration) > MAX_NODE)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "more than %d nodes", MAX_NODE);
    pal_err err = swing(world, scene);
    if (!err) err = pal_configuration_switch_prepare(scene, NULL, 0, &r->predicted.configuration, diag, &change);
    if (!err) err = pal_world_create(&change->set->scene, diag, &next);
    if (!err) {
        pal_configuration_switch_transfer(change, next, world);
        err = put_load(next, &change->set->scene);
    }
    if (!err) {
        r->n_node = pal_world_view_body(next, 0)->n_node;
        const pal_scene *to = &change->set->scene;
        err = estimate(to, next, NULL, 0, &own, diag);
        r->own_m = own.error_m;
        if (!err) err = step_alternately(world, scene->step_s, next, to->step_s, r);
    }
    pal_world_destroy(next);
    pal_configuration_switch_free(change);
    return err;
}

static pal_err measure(const subject *s, result *out, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = NULL;
    pal_world *world = NULL;
    pal_estimate_cost cost[MAX_SAMPLE];
    double ms[MAX_SAMPLE];
    int n = 0;
    *out = (result){0};
    const pal_surface_scene options = {.label = -1,
                                       .hold = 0.3,
                                       .fem = s->fem,
                                       .resolution = s->resolution,
                                       .solver = s->solver,
                                       .element = s->element};
    PAL_TRY(pal_scene_procedural(&options, &loaded, NULL, diag));
    pal_scene *scene = &loaded->scene;
    if (s->two) {
        pal_body_def *other = &scene->body[scene->n_body++];
        *other = scene->body[0];
        snprintf(other->name, sizeof other->name, "other");
    }
    pal_err err = pal_world_create(scene, diag, &world);
    if (!err) err = swing(world, scene);
    for (int k = 0; k < ROUNDS && !err; k++) err = timed(world, scene->step_s, ms, cost, &n);
    if (!err) err = swing(world, scene);
    if (!err) err = estimate(scene, world, cost, n, &out->estimate, diag);
    for (int k = 0; k < out->estimate.n_neighbour && !err; k++) {
        neighbour *r = &out->neighbour[k];
        r->predicted = out->estimate.neighbour[k];
        pal_diagnostic reason = {""};
        r->err = try_neighbour(scene, world, r, &reason);
    }
    pal_world_destroy(world);
    pal_scene_free(loaded);
    return err;
}

static double cost_ratio(const result *c, const neighbour *r)
{
    return r->predicted.ms / c->estimate.ms / (r->ms / r->was_ms);
}

static const char *configuration_text(const neighbour *r, char text[64])
{
    const pal_configuration *s = &r->predicted.configuration;
    char tolerance[24] = "";
    if (s->tolerance > 0) snprintf(tolerance, sizeof tolerance, ", tolerance %.0e", s->tolerance);
    snprintf(text, 64, "%d voxels, %.3g ms%s", s->size, 1e3 * s->step_s, tolerance);
    return text;
}

static bool is_within(double off)
{
    return off <= max_ratio && off >= 1 / max_ratio;
}

static void add_neighbour(pal_table *report, const subject *s, const result *c, int k)
{
    char text[64];
    const neighbour *r = &c->neighbour[k];
    const pal_estimate *e = &c->estimate;
    TABLE_ROW(
        report, TEXT("body", "body", -30, s->name),
        TEXT("configuration", "configuration", -34, configuration_text(r, text)),
        NUMBER("nodes", "nodes", 6, 0, r->n_node), NUMBER("nodes_predicted", "predicted", 9, 0, e->neighbour_nodes[k]),
        VALUE("substeps", r->n_substep), VALUE("substeps_predicted", e->neighbour_substeps[k]),
        NUMBER("ms", "ms", 8, 3, r->ms * e->ms / r->was_ms), NUMBER("predicted_ms", "predicted", 9, 3, r->predicted.ms),
        NUMBER("cost_ratio", "ratio", 6, 2, cost_ratio(c, r)),
        TEXT(NULL, "", 3, is_within(cost_ratio(c, r)) ? "" : "(!)"), NUMBER("error_m", "error m", 10, 7, r->own_m),
        NUMBER("predicted_error_m", "predicted", 10, 7, r->predicted.error_m));
}

/* the nodes within a fifth of its size of the body's highest one, pulled sideways */
static pal_err pull(pal_world *world, const pal_scene *scene)
{
    const pal_body *body = pal_world_view_body(world, 0);
    const double size = body->length_scale_m, total = load_share * scene->body[0].material.young_Pa * size * size,
                 aside[3] = {scene->up[1], scene->up[2], scene->up[0]};
    int top = 0, n = 0;
    for (int i = 0; i < body->n_node; i++)
        if (pal_dot3(body->node_rest + 3 * i, scene->up) > pal_dot3(body->node_rest + 3 * top, scene->up)) top = i;
    for (int turn = 0; turn < 2; turn++)
        for (int i = 0; i < body->n_node; i++) {
            double f[3];
            if (pal_dist3(body->node_rest + 3 * i, body->node_rest + 3 * top) > 0.2 * size) continue;
            pal_scale3(f, total / (n > 0 ? n : 1), aside);
            if (turn == 0)
                n++;
            else
                PAL_TRY(pal_world_load(world, 0, i, f));
        }
    return PAL_ERR_OK;
}

static double heap_MB(void)
{
    const struct mallinfo2 heap = mallinfo2();
    return 1e-6 * (double)(heap.uordblks + heap.hblkhd);
}

/* estimates of a scene's first body every 15 steps after the pull begins, as a session makes them */
static pal_err estimate_scene(const char *path, pal_table *r, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = NULL;
    pal_world *world = NULL;
    pal_estimation *work = NULL;
    pal_err err = pal_scene_load(path, &loaded, diag);
    if (!err) err = pal_world_create(&loaded->scene, diag, &world);
    if (!err) err = pull(world, &loaded->scene);
    const double before_MB = heap_MB();
    const uint64_t began = pal_clock_thread_ns();
    if (!err) err = pal_estimation_open(&loaded->scene, 0, NULL, diag, &work);
    const double open_ms = 1e-6 * (double)(pal_clock_thread_ns() - began);
    pal_table_list(r, "estimates");
    for (int k = 0; k < N_ESTIMATE && !err; k++) {
        pal_estimate e = {.error_m = NAN};
        for (int i = 0; i < 15 && !err; i++) err = pal_world_step(world, loaded->scene.step_s);
        if (!err && !pal_estimate_copy(pal_estimation_state(work), world, 0)) err = PAL_ERR_NUMERIC;
        const uint64_t now = pal_clock_thread_ns();
        if (!err && !pal_estimation_run(work, &e)) err = PAL_ERR_NUMERIC;
        const double ms = 1e-6 * (double)(pal_clock_thread_ns() - now);
        if (!err)
            TABLE_ROW(r, NUMBER("nodes", "nodes", 6, 0, pal_world_view_body(world, 0)->n_node),
                      NUMBER("open_ms", "open ms", 8, 1, open_ms), NUMBER("ms", "ms", 8, 1, ms),
                      NUMBER("heap_MB", "heap MB", 8, 1, heap_MB() - before_MB),
                      NUMBER("moved_mm", "moved mm", 9, 3, 1e3 * e.max_m),
                      NUMBER("discretisation_mm", "mesh mm", 9, 5, 1e3 * e.discretisation_m),
                      NUMBER("algebraic_mm", "solver mm", 9, 5, 1e3 * e.algebraic_m),
                      NUMBER("time_mm", "time mm", 9, 5, 1e3 * e.time_m),
                      NUMBER("model_mm", "law mm", 9, 5, 1e3 * e.model_m));
    }
    pal_estimation_close(work);
    pal_world_destroy(world);
    pal_scene_free(loaded);
    return err;
}

pal_err bench_estimate(pal_table *r, pal_diagnostic *diag)
{
    if (r->argument) return estimate_scene(r->argument, r, diag);
    static const subject subjects[N_CASE] = {{"fem hex8_bbar, 12 voxels", 12, true, NULL, NULL, false},
                                             {"fem hex8_bbar, 18 voxels", 18, true, NULL, NULL, false},
                                             {"fem hex8_bbar, 16 voxels, sdirk2", 16, true, "sdirk2", NULL, false},
                                             {"fem tet4, 16 voxels", 16, true, NULL, "tet4", false},
                                             {"springs, 12 voxels", 12, false, NULL, NULL, false},
                                             {"springs, 18 voxels", 18, false, NULL, NULL, false},
                                             {"fem hex8_bbar, 12 voxels, twice", 12, true, NULL, NULL, true},
                                             {"springs, 12 voxels, twice", 12, false, NULL, NULL, true}};
    static result c;
    int n = 0, within = 0;
    pal_table_list(r, "neighbours");
    for (int k = 0; k < N_CASE; k++) {
        PAL_TRY(measure(&subjects[k], &c, diag));
        for (int i = 0; i < c.estimate.n_neighbour; i++) {
            if (c.neighbour[i].err) continue;
            n++, within += is_within(cost_ratio(&c, &c.neighbour[i]));
            add_neighbour(r, &subjects[k], &c, i);
        }
    }
    pal_table_list(r, NULL);
    TABLE_ROW(r, VALUE("n", n), VALUE("within", within));
    pal_table_note(r, "cost within 30 %% for %d of %d neighbours", within, n);
    return PAL_ERR_OK;
}
