/* `palpate bench guards`: what it costs to be on guard while nothing goes wrong, as a share of a step, for every model:
 * two worlds of one scene step in turn under the same load; one has the row finite_guard and an implicit solver that
 * watches its energy, the other neither. Worlds are made anew several times, now the one first and now the other: where
 * two worlds of one scene lie in memory alone makes them differ by several percent. A step is the same work each time,
 * so that the least processor time of its repeats is what it takes; means of these over the steps. (Where medians over
 * all repeats said 0.9 and 5.8 % on a busy machine, these said 3.4 and 3.6.) What every solver looks at besides (is all
 * finite?) cannot be taken out and is timed alone, as is the row. Asked: 3 % of a step for difference and looks
 * together; what is watched while a step computes has no price of its own and is named. */
#include "server/base/clock.h"
#include "server/bench/bench.h"
#include "server/cli/median.h"
#include "server/mesh/cells/cell_models.h"
#include "server/mesh/geometry/organ.h"
#include "server/sim/world/world.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_CASE = 4, N_STEP = 40, N_WARM = 8 };

typedef struct guards {
    const char *model;
    int n_point, n_sub;
    bool watches;         /* an implicit solver's energy */
    uint64_t n_safeguard; /* 0, else something did go wrong */
    double with_ms, without_ms, row_ms, looks_ms, watch_ms;
} guards;

/* what scenes of the four models are made of */
typedef struct bodies {
    pal_prepared voxels, adaptive, boundary;
    pal_cells cells;
} bodies;

static pal_err make_bodies(bodies *b, pal_diagnostic *diag)
{
    pal_surface organ = {0}, faces = {0};
    pal_voxel_options options = {.resolution = 18, .border = true, .fill = true};
    pal_prepare_report report;
    pal_err err = pal_organ_make(2000, &organ);
    if (!err) err = pal_prepared_make(&organ, &options, &b->voxels, &report, diag);
    if (!err) err = pal_prepared_surface(&organ, &b->adaptive);
    if (!err) err = pal_cell_model_make(pal_cell_model_find("chair"), &b->cells, diag);
    if (!err) err = pal_cells_boundary(&b->cells, &faces, NULL, NULL);
    if (!err) err = pal_prepared_surface(&faces, &b->boundary);
    pal_surface_free(&organ);
    pal_surface_free(&faces);
    return err;
}

static void free_bodies(bodies *b)
{
    pal_prepared_free(&b->voxels);
    pal_prepared_free(&b->adaptive);
    pal_prepared_free(&b->boundary);
    pal_cells_free(&b->cells);
}

static const char *const model_name[N_CASE] = {"tet_springs", "fem", "adaptive_springs", "subdivision_fem"};
/* pairs of worlds: where guards are dear beside a short step there have to be many */
static const int n_round[N_CASE] = {10, 40, 40, 4};

static pal_err dress(pal_scene *scene, const bodies *b, int which, bool guard, pal_diagnostic *diag)
{
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_def *def = &scene->body[0];
    if (which == 3)
        pal_body_default_cells(def, "body", &b->boundary, &b->cells);
    else
        pal_body_default(def, "body", which == 2 ? &b->adaptive : &b->voxels);
    pal_entry_init(&def->model, "model", model_name[which]);
    def->support[0].fraction = 0.15;
    /* little: under all of its own weight this one topples over its foot, and is rescued in every step */
    scene->gravity_m_s2 = 0.5;
    if (which == 1) {
        pal_entry_init(&def->solver, "solver", "implicit_euler");
        if (pal_entry_put_bool(&def->solver, "watch", guard, diag)) return PAL_ERR_REFUSED;
    }
    def->n_effect = 0;
    pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "gravity");
    if (guard) pal_entry_init(&def->effect[def->n_effect++], "effects[1]", "finite_guard");
    return PAL_ERR_OK;
}

static double row_ms(const pal_world *world, const char *name)
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        if (!strcmp(info.name, name)) return 1e-6 * (double)info.spent_ns;
    }
    return 0;
}

/* what a solver does at both ends of a step */
static double looks_ms(pal_world *world)
{
    double ms[N_STEP], sum = 0;
    const pal_body *body = pal_world_body(world, 0);
    for (int k = 0; k < N_STEP; k++) {
        uint64_t before = pal_clock_thread_ns();
        sum += pal_body_finite(body) + pal_body_finite(body);
        ms[k] = 1e-6 * (double)(pal_clock_thread_ns() - before);
    }
    return sum > 0 ? pal_median(ms, N_STEP) : 0;
}

/* a table that leans to and fro, so that no body comes to rest */
static pal_err lean(pal_world *world, int step)
{
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < pal_body_nodes(body) && step % 16 == 0 && !err; k++) {
        int i = pal_body_point(body, k);
        double side = step / 16 % 2 ? 0.1 : -0.1;
        err = pal_world_load(world, 0, i, (const double[3]){side * body->node_mass_kg[i], 0, 0});
    }
    return err;
}

static pal_err step_ms(pal_world *world, double step_s, double *ms)
{
    uint64_t before = pal_clock_thread_ns();
    pal_err err = pal_world_step(world, step_s);
    *ms = 1e-6 * (double)(pal_clock_thread_ns() - before);
    return err;
}

/* of each step, the least of all rounds; with guards: ms[1] */
typedef struct times {
    double ms[2][N_STEP], row[N_STEP];
} times;

static void take_least(double *least, double ms, bool first)
{
    *least = first ? ms : fmin(*least, ms);
}

/* both worlds made, stepped in turn and gone; what is no sum of times goes to out from the guarded one */
static pal_err one_round(const bodies *b, int which, int round, times *t, guards *out, pal_diagnostic *diag)
{
    static pal_scene scene[2];
    pal_world *world[2] = {NULL, NULL};
    pal_err err = PAL_ERR_OK;
    for (int turn = 0; turn < 2 && !err; turn++) {
        int g = (round + turn) & 1;
        err = dress(&scene[g], b, which, g == 1, diag);
        if (!err) err = pal_world_create(&scene[g], diag, &world[g]);
    }
    for (int k = -N_WARM; k < N_STEP && !err; k++) {
        for (int turn = 0; turn < 2 && !err; turn++) {
            /* who is first changes from step to step */
            int g = (k + turn) & 1;
            double took = 0;
            err = lean(world[g], k + N_WARM);
            if (!err) err = step_ms(world[g], scene[g].step_s, &took);
            if (k >= 0) take_least(&t->ms[g][k], took, round == 0);
            if (k >= 0 && g == 1) take_least(&t->row[k], row_ms(world[1], "finite_guard"), round == 0);
        }
    }
    if (!err) {
        out->n_point = pal_world_body(world[1], 0)->n_active;
        out->n_sub = pal_world_substeps(world[1]);
        out->n_safeguard += pal_safeguards_sum(&pal_world_body(world[1], 0)->safeguards);
        out->looks_ms = looks_ms(world[1]);
        out->watches = pal_world_body(world[1], 0)->implicit;
    }
    for (int g = 0; g < 2; g++) pal_world_destroy(world[g]);
    return err;
}

static pal_err measure(const bodies *b, int which, guards *out, pal_diagnostic *diag)
{
    static times t;
    pal_err err = PAL_ERR_OK;
    *out = (guards){.model = model_name[which]};
    for (int round = 0; round < n_round[which] && !err; round++) err = one_round(b, which, round, &t, out, diag);
    for (int k = 0; k < N_STEP; k++) {
        out->with_ms += t.ms[1][k] / N_STEP;
        out->without_ms += t.ms[0][k] / N_STEP;
        out->row_ms += t.row[k] / N_STEP;
    }
    if (out->watches) out->watch_ms = out->with_ms - out->without_ms - out->row_ms;
    return err;
}

static const double most_share = 0.03;
static const char not_priced[] = "search for elements turned over, caps of loads and moves, sub-steps chosen anew, "
                                 "refusals of bad numbers, corrections of contacts";

/* a watch that is found to cost less than nothing is noise */
static double checks_ms(const guards *r)
{
    return r->looks_ms + fmax(0, r->watch_ms);
}

/* row and own checks of a step of the guarded world */
static double share(const guards *r)
{
    return (r->row_ms + checks_ms(r)) / r->with_ms;
}

static bool fits(const guards *r)
{
    return share(r) <= most_share && r->n_safeguard == 0;
}

static void print(const guards *r)
{
    printf("%-18s %8s %10s %12s %12s %8s %14s %8s\n", "model", "points", "sub-steps", "ms with", "ms without", "row %",
           "own checks %", "sum %");
    for (int k = 0; k < N_CASE; k++)
        printf("%-18s %8d %10d %12.4f %12.4f %8.2f %14.2f %8.2f  %s\n", r[k].model, r[k].n_point, r[k].n_sub,
               r[k].with_ms, r[k].without_ms, 100 * r[k].row_ms / r[k].with_ms, 100 * checks_ms(&r[k]) / r[k].with_ms,
               100 * share(&r[k]),
               r[k].n_safeguard ? "something went wrong"
               : fits(&r[k])    ? "ok"
                                : "too much");
    printf("asked: a sum of at most %g %%. Not priced: %s\n", 100 * most_share, not_priced);
}

static void print_json(const guards *r)
{
    cJSON *o = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(o, "guards");
    cJSON_AddBoolToObject(o, "ok", true);
    for (int k = 0; k < N_CASE; k++) {
        cJSON *one = cJSON_CreateObject();
        cJSON_AddItemToArray(list, one);
        cJSON_AddStringToObject(one, "model", r[k].model);
        cJSON_AddNumberToObject(one, "points", r[k].n_point);
        cJSON_AddNumberToObject(one, "rescues", (double)r[k].n_safeguard);
        cJSON_AddNumberToObject(one, "with_ms", r[k].with_ms);
        cJSON_AddNumberToObject(one, "without_ms", r[k].without_ms);
        cJSON_AddNumberToObject(one, "row_share", r[k].row_ms / r[k].with_ms);
        cJSON_AddNumberToObject(one, "checks_share", checks_ms(&r[k]) / r[k].with_ms);
        cJSON_AddNumberToObject(one, "sum_share", share(&r[k]));
        cJSON_AddBoolToObject(one, "within", fits(&r[k]));
    }
    cJSON_AddNumberToObject(o, "most_share", most_share);
    cJSON_AddStringToObject(o, "not_priced", not_priced);
    char *text = cJSON_PrintUnformatted(o);
    if (text) printf("%s\n", text);
    cJSON_free(text);
    cJSON_Delete(o);
}

int bench_guards(bool json)
{
    bodies b = {0};
    guards r[N_CASE] = {0};
    pal_diagnostic diag = {""};
    pal_err err = make_bodies(&b, &diag);
    for (int k = 0; k < N_CASE && !err; k++) err = measure(&b, k, &r[k], &diag);
    free_bodies(&b);
    if (err) {
        fprintf(stderr, "palpate bench: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
        return 3;
    }
    if (json)
        print_json(r);
    else
        print(r);
    return 0;
}
