/* palpate bench estimate: what the live estimate foresees of the neighbours of a running body's setting, against what
 * they take and leave once the body is switched to them. The procedural organ as finite elements and as springs, pulled
 * aside by a load on all of its nodes: the estimate is made while it swings, then for each neighbour the same swing is
 * switched to it as a session does, and both worlds step in turn. Cost: a step of the scene in the new setting over one
 * in the old, medians of processor time of both, foreseen over measured. Twice: two such bodies, one of them switched.
 * Error: the new setting's own estimate of the state that it took over, foreseen over estimated. Asked: cost within 30
 * %. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/bench/bench.h"
#include "server/cli/median.h"
#include "server/estimate/estimation.h"
#include "server/scene/scene_file.h"
#include "server/session/configuration_switch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_CASE = 8, WARM = 12, ROUNDS = 6, MOST = 1024, MOST_NODE = 30000 };
static const double most_off = 1.3, round_s = 0.1;
/* of E S^2, on all nodes together: bends it by some per cent */
static const double pull = 0.001;

typedef struct subject {
    const char *name;
    pal_surface_scene options;
    bool two; /* another one like it stands beside it and keeps its setting */
} subject;

typedef struct row {
    pal_measured_configuration foreseen;
    int n_node, n_substep;
    double was_ms, ms; /* of the settings before and after, of a step of the scene */
    double own_m;      /* what the new setting's estimate says */
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

/* aside, in proportion to the nodes' masses: the same on every mesh */
static pal_err put_load(pal_world *world, const pal_scene *scene)
{
    pal_body *body = pal_world_body(world, 0);
    const double aside[3] = {scene->up[1], scene->up[2], scene->up[0]};
    double sum_kg = 0, total = pull * scene->body[0].material.young_Pa * body->length_scale_m * body->length_scale_m,
           f[3];
    for (int i = 0; i < body->n_node; i++) sum_kg += body->node_mass_kg[i];
    for (int i = 0; i < body->n_node; i++) {
        pal_scale3(f, total * body->node_mass_kg[i] / sum_kg, aside);
        PAL_TRY(pal_world_load(world, 0, i, f));
    }
    return PAL_ERR_OK;
}

/* from rest, under the load, a few steps on */
static pal_err swing(pal_world *world, const pal_scene *scene)
{
    pal_world_reset(world);
    PAL_TRY(put_load(world, scene));
    for (int i = 0; i < WARM; i++) PAL_TRY(pal_world_step(world, scene->step_s));
    return PAL_ERR_OK;
}

/* a round of steps, each on the clock */
static pal_err timed(pal_world *world, double step_s, pal_estimate_cost *cost, int *n)
{
    for (double time = 0; time < round_s - 1e-9 && *n < MOST; time += step_s) {
        pal_world_wake(world);
        uint64_t began = pal_clock_thread_ns();
        PAL_TRY(pal_world_step(world, step_s));
        cost[(*n)++] = pal_estimate_cost_of(world, 0, 1e-6 * (double)(pal_clock_thread_ns() - began));
    }
    return PAL_ERR_OK;
}

/* cost: of steps so far */
static pal_err estimate(const pal_scene *scene, pal_world *world, const pal_estimate_cost *cost, int n_cost,
                        pal_estimate *out, pal_diagnostic *diag)
{
    pal_estimation *work = NULL;
    PAL_TRY(pal_estimation_open(scene, 0, NULL, diag, &work));
    pal_estimate_state *state = pal_estimation_state(work);
    bool good = pal_estimate_copy(state, world, 0);
    for (int i = 0; i < n_cost && i < PAL_ESTIMATE_STEPS; i++) state->cost[state->n_cost++] = cost[i];
    good = good && pal_estimation_run(work, out);
    pal_estimation_close(work);
    return good ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "nothing is known of the state");
}

static double median_ms(const pal_estimate_cost *cost, int n)
{
    double ms[MOST];
    for (int i = 0; i < n; i++) ms[i] = (double)cost[i].ms;
    return pal_median(ms, n);
}

/* both step in turn from the state that is handed over */
static pal_err in_turn(pal_world *was, double was_s, pal_world *now, double now_s, row *r)
{
    pal_estimate_cost *cost = malloc(2 * MOST * sizeof *cost);
    int n[2] = {0, 0};
    pal_err err = cost ? PAL_ERR_OK : PAL_ERR_MEMORY;
    for (int k = 0; k < ROUNDS && !err; k++) {
        err = timed(was, was_s, cost, &n[0]);
        if (!err) err = timed(now, now_s, cost + MOST, &n[1]);
    }
    r->n_substep = pal_world_substeps(now);
    if (!err) r->was_ms = median_ms(cost, n[0]), r->ms = median_ms(cost + MOST, n[1]) * was_s / now_s;
    free(cost);
    return err;
}

static pal_err try_neighbour(const pal_scene *scene, pal_world *world, row *r, pal_diagnostic *diag)
{
    pal_configuration_switch *change = NULL;
    pal_world *next = NULL;
    pal_estimate own = {.error_m = NAN};
    if (pal_configuration_estimate_nodes(scene, 0, &r->foreseen.setting) > MOST_NODE)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "more than %d nodes", MOST_NODE);
    pal_err err = swing(world, scene);
    if (!err) err = pal_configuration_switch_prepare(scene, NULL, 0, &r->foreseen.setting, diag, &change);
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
        if (!err) err = in_turn(world, scene->step_s, next, to->step_s, r);
    }
    pal_world_destroy(next);
    pal_configuration_switch_free(change);
    return err;
}

static pal_err measure(const subject *s, result *out, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = NULL;
    pal_world *world = NULL;
    pal_estimate_cost cost[MOST];
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
            r->foreseen = out->estimate.neighbour[k];
            pal_diagnostic reason = {""};
            r->err = try_neighbour(scene, world, r, &reason);
        }
    }
    pal_world_destroy(world);
    pal_scene_free(loaded);
    return err;
}

static double cost_off(const result *c, const row *r)
{
    return r->foreseen.ms / c->estimate.ms / (r->ms / r->was_ms);
}

static const char *knob(const row *r, char text[64])
{
    const pal_configuration *s = &r->foreseen.setting;
    char tolerance[24] = "";
    if (s->tolerance > 0) snprintf(tolerance, sizeof tolerance, ", tolerance %.0e", s->tolerance);
    snprintf(text, 64, "%d voxels, %.3g ms%s", s->size, 1e3 * s->step_s, tolerance);
    return text;
}

/* a number or, where it is not known, null */
static const char *number(double value, char text[32])
{
    snprintf(text, 32, isfinite(value) ? "%.6g" : "null", value);
    return text;
}

static bool is_good(double off)
{
    return off <= most_off && off >= 1 / most_off;
}

static void print_json(const subject *s, const result *c)
{
    char text[64], a[32], b[32];
    printf("{\"name\":\"%s\",\"nodes\":%d,\"substeps\":%d,\"ms\":%.5f,\"error_m\":%s,\"neighbours\":[", s->name,
           c->n_node, c->n_substep, c->estimate.ms, number(c->estimate.error_m, a));
    for (int k = 0, told = 0; k < c->n_row; k++) {
        const row *r = &c->row[k];
        if (r->err) continue;
        printf("%s{\"setting\":\"%s\",\"nodes_foreseen\":%d,\"nodes\":%d,\"substeps_foreseen\":%d,\"substeps\":%d,"
               "\"predicted_ms\":%.5f,\"was_ms\":%.5f,\"ms\":%.5f,\"cost\":%.4f,\"predicted_m\":%s,\"estimated_m\":%s}",
               told++ ? "," : "", knob(r, text), c->estimate.neighbour_nodes[k], r->n_node,
               c->estimate.neighbour_substeps[k], r->n_substep, r->foreseen.ms, r->was_ms, r->ms, cost_off(c, r),
               number(r->foreseen.error_m, a), number(r->own_m, b));
    }
    printf("]}");
}

static void print_table(const subject *s, const result *c)
{
    char text[64];
    printf("%s: %d nodes, %.3f ms", s->name, c->n_node, c->estimate.ms);
    if (isfinite(c->estimate.error_m)) printf(", error %.3g mm", 1e3 * c->estimate.error_m);
    if (c->estimate.diag[0]) printf(" (%s)", c->estimate.diag);
    printf("\n");
    for (int k = 0; k < c->n_row; k++) {
        const row *r = &c->row[k];
        if (r->err) continue;
        double off = cost_off(c, r);
        printf("  %-34s %6d nodes (%d) %8.3f ms, foreseen %8.3f: %.2f%s", knob(r, text), r->n_node,
               c->estimate.neighbour_nodes[k], r->ms * c->estimate.ms / r->was_ms, r->foreseen.ms, off,
               is_good(off) ? "" : " (!)");
        if (isfinite(r->own_m) && isfinite(r->foreseen.error_m))
            printf("; error %.3g mm, foreseen %.3g: %.2f", 1e3 * r->own_m, 1e3 * r->foreseen.error_m,
                   r->foreseen.error_m / r->own_m);
        printf("\n");
    }
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
    if (json) printf("{\"bench\":\"estimate\",\"cases\":[");
    for (int k = 0; k < N_CASE; k++) {
        pal_diagnostic diag = {""};
        result *c = calloc(1, sizeof *c);
        pal_err err = c ? measure(&subjects[k], c, &diag) : PAL_ERR_MEMORY;
        for (int i = 0; !err && i < c->n_row; i++) {
            if (c->row[i].err) continue;
            n++, within += is_good(cost_off(c, &c->row[i]));
        }
        if (json && k) printf(",");
        if (!err && json) print_json(&subjects[k], c);
        if (!err && !json) print_table(&subjects[k], c);
        free(c);
        if (!err) continue;
        fprintf(stderr, "palpate bench: estimate: %s: %s\n", subjects[k].name,
                diag.text[0] ? diag.text : pal_err_text(err));
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    if (json)
        printf("],\"neighbours\":%d,\"within\":%d}\n", n, within);
    else
        printf("cost within 30 %% for %d of %d neighbours\n", within, n);
    return 0;
}
