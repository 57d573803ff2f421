/* palpate bench sleep: what a body costs that rests: awake and watched, awake and watched by nobody, asleep with a tool
 * in the room. Median over steps of the procedural organ as springs and as finite elements, the stomach as an adaptive
 * surface, a subdivided cube of 3 x 3 x 3 cells. Asked: asleep below 5 % of awake. */
#include "server/bench/bench.h"

#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/mesh/cells/cell_models.h"
#include "server/scene/scene_file.h"
#include "server/sim/world/world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* reading the clock takes as long as a step asleep: many of those at once */
enum { N_STEP = 61, MANY = 64, MOST_STEP = 6000, CASES = 4 };
static const double most_share = 0.05;

typedef struct result {
    const char *name;
    int n_node;
    double awake_ms, unseen_ms, asleep_ms, asleep_s; /* asleep_s: simulated, until it sleeps */
} result;

static pal_err timed(pal_world *world, double step_s, bool awake, double *median_ms)
{
    double ms[N_STEP];
    int n = awake ? 1 : MANY;
    for (int i = 0; i < N_STEP; i++) {
        if (awake) pal_world_wake(world);
        uint64_t began = pal_clock_thread_ns();
        for (int k = 0; k < n; k++) PAL_TRY(pal_world_step(world, step_s));
        ms[i] = 1e-6 * (double)(pal_clock_thread_ns() - began) / n;
    }
    *median_ms = pal_median(ms, N_STEP);
    return PAL_ERR_OK;
}

static pal_err measure_world(const pal_scene *scene, result *out, pal_diagnostic *diag)
{
    pal_world *world;
    PAL_TRY(pal_world_create(scene, diag, &world));
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    out->n_node = body->n_node;
    int n = 0;
    for (; n < MOST_STEP && !body->asleep && !err; n++) err = pal_world_step(world, scene->step_s);
    out->asleep_s = n * scene->step_s;
    if (body->frozen) err = pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "%s stopped: %s", out->name, body->reason);
    if (!err && !body->asleep)
        err = pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "%s does not come to rest in %g s", out->name, out->asleep_s);
    pal_pose pose = {.quat = {1, 0, 0, 0}};
    for (int c = 0; c < 3; c++) pose.position_m[c] = 1.5 * body->length_scale_m * scene->up[c];
    if (!err) err = pal_world_pose(world, 0, &pose);
    if (!err) err = timed(world, scene->step_s, false, &out->asleep_ms);
    if (!err && !body->asleep) err = pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "%s woke by itself", out->name);
    if (!err) err = timed(world, scene->step_s, true, &out->awake_ms);
    if (!err) err = pal_world_pose(world, 0, NULL);
    if (!err) pal_world_watch(world, false);
    if (!err) err = timed(world, scene->step_s, true, &out->unseen_ms);
    pal_world_destroy(world);
    return err;
}

static pal_err measure_organ(const pal_surface_scene *options, result *out, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = NULL;
    PAL_TRY(pal_scene_procedural(options, &loaded, NULL, diag));
    pal_err err = measure_world(&loaded->scene, out, diag);
    pal_scene_free(loaded);
    return err;
}

static pal_err measure_solid(const pal_cell_model *model, result *out, pal_diagnostic *diag)
{
    pal_cells cells = {0};
    pal_prepared mesh = {0};
    pal_surface surface = {0};
    pal_scene *scene = calloc(1, sizeof *scene);
    if (!scene) return PAL_ERR_MEMORY;
    pal_err err = pal_cell_model_make(model, &cells, diag);
    if (!err) err = pal_cells_boundary(&cells, &surface, NULL, NULL);
    if (!err) err = pal_prepared_surface(&surface, &mesh);
    pal_surface_free(&surface);
    if (!err) {
        pal_scene_default(scene);
        pal_body_default_cells(&scene->body[0], model->name, &mesh, &cells);
        pal_entry_init(&scene->body[0].effect[scene->body[0].n_effect++], "effects[4]", "sleep");
        scene->n_body = 1;
        pal_tools_default(scene, 1);
        err = pal_entry_put_number(&scene->body[0].model, "levels", model->n_level, diag);
        if (!err) err = measure_world(scene, out, diag);
    }
    pal_prepared_free(&mesh);
    pal_cells_free(&cells);
    free(scene);
    return err;
}

static void print(const result *r, bool json)
{
    if (json) printf("{\"bench\":\"sleep\",\"steps\":%d,\"cases\":[", N_STEP);
    if (!json)
        printf("a body at rest, median ms of %d steps; asked: asleep at most %.0f %% of awake\n%-18s %8s %10s %12s "
               "%10s %9s %14s\n",
               N_STEP, 100 * most_share, "model", "nodes", "awake", "unwatched", "asleep", "%", "asleep after s");
    for (int k = 0; k < CASES; k++) {
        const double share = r[k].asleep_ms / r[k].awake_ms;
        if (json)
            printf("%s{\"name\":\"%s\",\"nodes\":%d,\"awake_ms\":%.5f,\"unwatched_ms\":%.5f,\"asleep_ms\":%.6f,"
                   "\"share\":%.5f,\"asleep_after_s\":%.3f}",
                   k ? "," : "", r[k].name, r[k].n_node, r[k].awake_ms, r[k].unseen_ms, r[k].asleep_ms, share,
                   r[k].asleep_s);
        else
            printf("%-18s %8d %10.4f %12.4f %10.5f %8.2f%% %14.2f%s\n", r[k].name, r[k].n_node, r[k].awake_ms,
                   r[k].unseen_ms, r[k].asleep_ms, 100 * share, r[k].asleep_s, share <= most_share ? "" : "  too much");
    }
    if (json) printf("]}\n");
}

int bench_sleep(bool json)
{
    result r[CASES] = {{.name = "tet_springs"}, {.name = "fem"}, {.name = "adaptive_springs"}};
    const pal_surface_scene springs = {.label = -1}, fem = {.label = -1, .fem = true},
                            adaptive = {.label = -1, .adaptive = true, .shape = "stomach"};
    pal_diagnostic diag = {""};
    pal_err err = measure_organ(&springs, &r[0], &diag);
    if (!err) err = measure_organ(&fem, &r[1], &diag);
    if (!err) err = measure_organ(&adaptive, &r[2], &diag);
    r[3].name = "subdivision_fem";
    if (!err) err = measure_solid(pal_cell_model_find("block3"), &r[3], &diag);
    if (err) {
        fprintf(stderr, "palpate bench: sleep: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    print(r, json);
    return 0;
}
