/* `palpate bench sleep`: the cost of a body at rest: awake and observed, awake and not observed, asleep with a tool in
 * the room. Medians over steps of the procedural organ as springs and as finite elements, the stomach as an adaptive
 * surface, a subdivision solid of 3 x 3 x 3 cells. Wanted: asleep below 5 % of awake. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"

/* a step asleep is as short as a reading of the clock: MANY are timed together */
enum { N_STEP = 61, MANY = 64, MAX_STEP = 6000 };
static const double max_share = 0.05;

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

static pal_err measure_world(const char *name, const pal_scene *scene, pal_table *r, pal_diagnostic *diag)
{
    pal_world *world;
    double awake_ms = 0, unobserved_ms = 0, asleep_ms = 0;
    PAL_TRY(pal_world_create(scene, diag, &world));
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    int n = 0;
    for (; n < MAX_STEP && !body->asleep && !err; n++) err = pal_world_step(world, scene->step_s);
    double asleep_s = n * scene->step_s;
    if (body->frozen) err = pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "%s stopped: %s", name, body->reason);
    if (!err && !body->asleep)
        err = pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "%s does not come to rest in %g s", name, asleep_s);
    pal_pose pose = {.quat = {1, 0, 0, 0}};
    for (int c = 0; c < 3; c++) pose.position_m[c] = 1.5 * body->length_scale_m * scene->up[c];
    if (!err) err = pal_world_pose(world, 0, &pose);
    if (!err) err = timed(world, scene->step_s, false, &asleep_ms);
    if (!err && !body->asleep) err = pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "%s woke by itself", name);
    if (!err) err = timed(world, scene->step_s, true, &awake_ms);
    if (!err) err = pal_world_pose(world, 0, NULL);
    if (!err) pal_world_watch(world, false);
    if (!err) err = timed(world, scene->step_s, true, &unobserved_ms);
    if (!err)
        TABLE_ROW(r, TEXT("name", "model", -18, name), NUMBER("nodes", "nodes", 8, 0, body->n_node),
                  NUMBER("awake_ms", "awake ms", 10, 4, awake_ms),
                  NUMBER("unobserved_ms", "unobserved ms", 13, 4, unobserved_ms),
                  NUMBER("asleep_ms", "asleep ms", 10, 5, asleep_ms),
                  NUMBER("share", "share", 8, 4, asleep_ms / awake_ms),
                  NUMBER("asleep_after_s", "asleep after s", 14, 2, asleep_s),
                  TEXT(NULL, "", 8, asleep_ms <= max_share * awake_ms ? "" : "too much"));
    pal_world_destroy(world);
    return err;
}

static pal_err measure_solid(const pal_cell_model *model, pal_table *r, pal_diagnostic *diag)
{
    static pal_scene scene;
    pal_cells cells = {0};
    pal_prepared mesh = {0};
    pal_err err = bench_solid(model, &cells, &mesh, diag);
    if (!err) {
        pal_scene_default(&scene);
        pal_body_default_cells(&scene.body[0], model->name, &mesh, &cells);
        pal_entry_init(&scene.body[0].effect[scene.body[0].n_effect++], "effects[4]", "sleep");
        scene.n_body = 1;
        pal_tools_default(&scene, 1);
        err = pal_entry_put_number(&scene.body[0].model, "levels", model->n_level, diag);
        if (!err) err = measure_world("subdivision_fem", &scene, r, diag);
    }
    pal_prepared_free(&mesh);
    pal_cells_free(&cells);
    return err;
}

pal_err bench_sleep(pal_table *r, pal_diagnostic *diag)
{
    static const char *const name[3] = {"tet_springs", "fem", "adaptive_springs"};
    const pal_surface_scene organ[3] = {
        {.label = -1}, {.label = -1, .fem = true}, {.label = -1, .adaptive = true, .shape = "stomach"}};
    pal_table_note(r, "a body at rest, medians of %d steps; wanted: asleep at most %.2f of awake", N_STEP, max_share);
    pal_table_list(r, "cases");
    for (int k = 0; k < 3; k++) {
        pal_loaded_scene *loaded = NULL;
        PAL_TRY(pal_scene_procedural(&organ[k], &loaded, NULL, diag));
        pal_err err = measure_world(name[k], &loaded->scene, r, diag);
        pal_scene_free(loaded);
        if (err) return err;
    }
    return measure_solid(pal_cell_model_find("block3"), r, diag);
}
