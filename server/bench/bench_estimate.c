/* `palpate bench estimate`: what the live estimator predicts for the neighbours of the configuration of a running body,
 * against what they take and leave after a switch. The procedural organ as finite elements and as springs, pulled aside
 * by a load on all nodes: the estimate is made while it swings; then for each neighbour the same swing is switched to
 * it as a session does, and both worlds step alternately. Cost: a step of the scene in the new configuration over one
 * in the old, medians of processor time, predicted over measured; once alone and once with a second body that keeps its
 * configuration. Error: the estimate of the new configuration for the state that it received, predicted over estimated.
 * Wanted: cost within 30 %. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/bench/bench.h"
#include "server/bench/bench_report.h"
#include "server/cli/median.h"
#include "server/estimate/estimation.h"
#include "server/scene/scene_file.h"
#include "server/session/configuration_switch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_CASE = 8, WARM = 12, ROUNDS = 6, MAX_SAMPLE = 1024, MAX_NODE = 30000 };
static const double max_ratio = 1.3, round_s = 0.1;
/* total load as a share of E S^2, S the box diagonal: bends the organ by a few per cent */
static const double load_share = 0.001;

typedef struct subject {
    const char *name;
    pal_surface_scene options;
    bool two; /* a second, equal body keeps its configuration */
} subject;

typedef struct row {
    pal_measured_configuration predicted;
    int n_node, n_substep;
    double was_ms, ms; /* of a step before and after the switch */
    double own_m;      /* estimated error of the new configuration */
    pal_err err;
} row;

typedef struct result {
    int n_node, n_substep, n_row;
    pal_estimate estimate;
    row row[PAL_ESTIMATE_NEIGHBOURS];
} result;

static void put_other(pal_scene *scene)
{
    pal_body_def *other = &scene->body[scene->n_body++];
    *other = scene->body[0];
    snprintf(other->name, sizeof other->name, "other");
}

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

/* a round of timed steps */
static pal_err timed(pal_world *world, double step_s, pal_estimate_cost *cost, int *n)
{
    for (double time = 0; time < round_s - 1e-9 && *n < MAX_SAMPLE; time += step_s) {
        pal_world_wake(world);
        uint64_t began = pal_clock_thread_ns();
        PAL_TRY(pal_world_step(world, step_s));
        cost[(*n)++] = pal_estimate_cost_of(world, 0, 1e-6 * (double)(pal_clock_thread_ns() - began));
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

static double median_ms(const pal_estimate_cost *cost, int n)
{
    double ms[MAX_SAMPLE];
    for (int i = 0; i < n; i++) ms[i] = (double)cost[i].ms;
    return pal_median(ms, n);
}

/* both worlds step alternately from the transferred state */
static pal_err step_alternately(pal_world *was, double was_s, pal_world *now, double now_s, row *r)
{
    pal_estimate_cost *cost = malloc(2 * MAX_SAMPLE * sizeof *cost);
    int n[2] = {0, 0};
    pal_err err = cost ? PAL_ERR_OK : PAL_ERR_MEMORY;
    for (int k = 0; k < ROUNDS && !err; k++) {
        err = timed(was, was_s, cost, &n[0]);
        if (!err) err = timed(now, now_s, cost + MAX_SAMPLE, &n[1]);
    }
    r->n_substep = pal_world_substeps(now);
    if (!err) r->was_ms = median_ms(cost, n[0]), r->ms = median_ms(cost + MAX_SAMPLE, n[1]) * was_s / now_s;
    free(cost);
    return err;
}

static pal_err try_neighbour(const pal_scene *scene, pal_world *world, row *r, pal_diagnostic *diag)
{
    pal_configuration_switch *change = NULL;
    pal_world *next = NULL;
    pal_estimate own = {.error_m = NAN};
    if (pal_configuration_estimate_nodes(scene, 0, &r->predicted.setting) > MAX_NODE)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "more than %d nodes", MAX_NODE);
    pal_err err = swing(world, scene);
    if (!err) err = pal_configuration_switch_prepare(scene, NULL, 0, &r->predicted.setting, diag, &change);
    if (!err) err = pal_world_create(pal_configuration_switch_scene(change), diag, &next);
    if (!err) {
        pal_configuration_switch_transfer(change, next, world);
        err = put_load(next, pal_configuration_switch_scene(change));
    }
    if (!err) {
        r->n_node = pal_world_view_body(next, 0)->n_node;
        const pal_scene *to = pal_configuration_switch_scene(change);
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
    int n = 0;
    PAL_TRY(pal_scene_procedural(&s->options, &loaded, NULL, diag));
    if (s->two) put_other(&loaded->scene);
    const pal_scene *scene = &loaded->scene;
    pal_err err = pal_world_create(scene, diag, &world);
    if (!err) err = swing(world, scene);
    for (int k = 0; k < ROUNDS && !err; k++) err = timed(world, scene->step_s, cost, &n);
    if (!err) err = swing(world, scene);
    if (!err) err = estimate(scene, world, cost, n, &out->estimate, diag);
    if (!err) {
        out->n_node = pal_world_view_body(world, 0)->n_node, out->n_substep = pal_world_substeps(world);
        out->n_row = out->estimate.n_neighbour;
        for (int k = 0; k < out->n_row; k++) {
            row *r = &out->row[k];
            r->predicted = out->estimate.neighbour[k];
            pal_diagnostic reason = {""};
            r->err = try_neighbour(scene, world, r, &reason);
        }
    }
    pal_world_destroy(world);
    pal_scene_free(loaded);
    return err;
}

static double cost_ratio(const result *c, const row *r)
{
    return r->predicted.ms / c->estimate.ms / (r->ms / r->was_ms);
}

static const char *configuration_text(const row *r, char text[64])
{
    const pal_configuration *s = &r->predicted.setting;
    char tolerance[24] = "";
    if (s->tolerance > 0) snprintf(tolerance, sizeof tolerance, ", tolerance %.0e", s->tolerance);
    snprintf(text, 64, "%d voxels, %.3g ms%s", s->size, 1e3 * s->step_s, tolerance);
    return text;
}

static bool is_within(double off)
{
    return off <= max_ratio && off >= 1 / max_ratio;
}

static void add_neighbour(bench_report *report, const subject *s, const result *c, int k)
{
    char text[64];
    const row *r = &c->row[k];
    bench_record(report);
    bench_text(report, "body", "body", -30, s->name);
    bench_text(report, "configuration", "configuration", -34, configuration_text(r, text));
    bench_number(report, "nodes", "nodes", 6, 0, r->n_node);
    bench_number(report, "nodes_predicted", "predicted", 9, 0, c->estimate.neighbour_nodes[k]);
    bench_number(report, "substeps", NULL, 0, 0, r->n_substep);
    bench_number(report, "substeps_predicted", NULL, 0, 0, c->estimate.neighbour_substeps[k]);
    bench_number(report, "ms", "ms", 8, 3, r->ms * c->estimate.ms / r->was_ms);
    bench_number(report, "predicted_ms", "predicted", 9, 3, r->predicted.ms);
    bench_number(report, "cost_ratio", "ratio", 6, 2, cost_ratio(c, r));
    bench_text(report, NULL, "", 3, is_within(cost_ratio(c, r)) ? "" : "(!)");
    bench_number(report, "error_m", "error m", 10, 7, r->own_m);
    bench_number(report, "predicted_error_m", "predicted", 10, 7, r->predicted.error_m);
}

int bench_estimate(bool json)
{
    static const subject subjects[N_CASE] = {
        {.name = "fem hex8_bbar, 12 voxels", .options = {.label = -1, .hold = 0.3, .fem = true, .resolution = 12}},
        {.name = "fem hex8_bbar, 18 voxels", .options = {.label = -1, .hold = 0.3, .fem = true, .resolution = 18}},
        {.name = "fem hex8_bbar, 16 voxels, sdirk2",
         .options = {.label = -1, .hold = 0.3, .fem = true, .resolution = 16, .solver = "sdirk2"}},
        {.name = "fem tet4, 16 voxels",
         .options = {.label = -1, .hold = 0.3, .fem = true, .resolution = 16, .element = "tet4"}},
        {.name = "springs, 12 voxels", .options = {.label = -1, .hold = 0.3, .resolution = 12}},
        {.name = "springs, 18 voxels", .options = {.label = -1, .hold = 0.3, .resolution = 18}},
        {.name = "fem hex8_bbar, 12 voxels, twice",
         .options = {.label = -1, .hold = 0.3, .fem = true, .resolution = 12},
         .two = true},
        {.name = "springs, 12 voxels, twice", .options = {.label = -1, .hold = 0.3, .resolution = 12}, .two = true}};
    int n = 0, within = 0;
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    bench_report r;
    bench_begin(&r, "estimate", json);
    bench_list(&r, "neighbours");
    for (int k = 0; k < N_CASE && !err; k++) {
        result *c = calloc(1, sizeof *c);
        err = c ? measure(&subjects[k], c, &diag) : PAL_ERR_MEMORY;
        for (int i = 0; !err && i < c->n_row; i++) {
            if (c->row[i].err) continue;
            n++, within += is_within(cost_ratio(c, &c->row[i]));
            add_neighbour(&r, &subjects[k], c, i);
        }
        free(c);
    }
    bench_list(&r, NULL);
    bench_number(&r, "n", NULL, 0, 0, n);
    bench_number(&r, "within", NULL, 0, 0, within);
    bench_note(&r, "cost within 30 %% for %d of %d neighbours", within, n);
    return bench_end(&r, err, &diag);
}
