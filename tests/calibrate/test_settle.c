/* Calibrated bodies as they run live: the live rest is Newton's, the damping that is steady soonest is found, and what
 * cannot rest says so. */
#include "server/calibrate/equilibrium.h"
#include "server/calibrate/settle.h"
#include "tests/check.h"

#include "server/base/vec3.h"

#include <string.h>

enum { NX = 6, NY = 2, NZ = 2 };
static const double h = 0.02, young = 2e4, density = 1000;

/* a beam of springs along x, held at its end x = 0 */
typedef struct beam {
    pal_prepared mesh;
    pal_scene scene;
    pal_world *world;
    pal_lattice lattice;
    double *force, *u; /* [n_node][3] */
    int n;
} beam;

static bool make_mesh(pal_prepared *out)
{
    pal_voxels voxels = {.n = {NX, NY, NZ}, .edge_m = h, .n_inside = NX * NY * NZ};
    voxels.kind = malloc((size_t)NX * NY * NZ);
    if (!voxels.kind) return false;
    memset(voxels.kind, 2, (size_t)NX * NY * NZ);
    pal_err err = pal_voxels_split(&voxels, &out->tets);
    pal_voxels_free(&voxels);
    return !err;
}

/* Newton's rest of the same rows under the same load */
static bool find_rest(beam *b)
{
    const double factor = young * h * h * h;
    pal_equilibrium_workspace *workspace;
    pal_equilibrium_options o = {.linear = false};
    double *k[PAL_SPRING_KINDS];
    memcpy(b->u, b->lattice.x_rest, 3 * sizeof(double) * (size_t)b->n);
    if (pal_equilibrium_workspace_create(&b->lattice, &workspace)) return false;
    for (int s = 0; s < PAL_SPRING_KINDS; s++) {
        k[s] = malloc(sizeof(double) * (size_t)(b->lattice.kind[s].n_item + 1));
        for (int i = 0; i < b->lattice.kind[s].n_item; i++) k[s][i] = (s ? 1 : 0.5) * factor;
    }
    const double *const given[PAL_SPRING_KINDS] = {k[0], k[1], k[2]};
    pal_equilibrium_report report;
    pal_err err = pal_equilibrium(workspace, given, b->force, &o, b->u, &report, NULL);
    for (int i = 0; i < 3 * b->n; i++) b->u[i] -= b->lattice.x_rest[i];
    for (int s = 0; s < PAL_SPRING_KINDS; s++) free(k[s]);
    pal_equilibrium_workspace_destroy(workspace);
    return !err;
}

static void close_beam(beam *b)
{
    pal_lattice_free(&b->lattice);
    pal_world_destroy(b->world);
    pal_prepared_free(&b->mesh);
    free(b->force);
    free(b->u);
}

/* load_N: sum over the nodes of the far end, along -z */
static bool open_beam(beam *b, double load_N)
{
    pal_diagnostic diag = {""};
    memset(b, 0, sizeof *b);
    if (!make_mesh(&b->mesh)) return false;
    pal_scene_default(&b->scene);
    b->scene.n_body = 1;
    pal_body_def *body = &b->scene.body[0];
    pal_body_default(body, "beam", &b->mesh);
    body->n_effect = 0;
    body->output.name[0] = 0;
    body->material = (pal_material){.young_Pa = young, .poisson = 0.3, .density_kg_m3 = density, .damping_1_s = 4};
    body->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1e-6, 1, 1}};
    pal_entry_init(&body->model, "model", "tet_springs");
    pal_err err = pal_entry_put_text(&body->model, "weights", "volume", &diag);
    if (!err) err = pal_entry_put_number(&body->model, "k_distance_J", 0.5 * young * h * h * h, &diag);
    if (!err) err = pal_entry_put_number(&body->model, "k_area_J", young * h * h * h, &diag);
    if (!err) err = pal_entry_put_number(&body->model, "k_volume_J", young * h * h * h, &diag);
    if (!err) err = pal_world_create(&b->scene, &diag, &b->world);
    if (!err) err = pal_lattice_make(b->world, 0, &b->lattice, &diag);
    if (err) printf("  %s\n", diag.text);
    b->n = b->mesh.tets.n_node;
    b->force = calloc(3 * (size_t)b->n, sizeof(double));
    b->u = calloc(3 * (size_t)b->n, sizeof(double));
    int n_end = 0;
    for (int i = 0; i < b->n; i++) n_end += b->mesh.tets.x[3 * i] > (NX - 0.5) * h;
    for (int i = 0; i < b->n; i++)
        if (b->mesh.tets.x[3 * i] > (NX - 0.5) * h) b->force[3 * i + 2] = -load_N / n_end;
    return !err && find_rest(b);
}

static double largest(const beam *b)
{
    double max = 0;
    for (int i = 0; i < b->n; i++) max = fmax(max, pal_norm3(b->u + 3 * i));
    return max;
}

/* 0.7 N bend the beam of 12 cm by more than a fifth of its length: far from linear */
static const double bend_N = 0.7;

static void comes_to_rest_where_newton_does(void)
{
    beam b;
    pal_settle_options options;
    pal_settle_run run;
    REQUIRE(open_beam(&b, bend_N));
    pal_settle_default(&options);
    double work = options.max_work;
    const pal_settle_load load = {.force_N = b.force, .u = b.u};
    CHECK(largest(&b) > 0.024);
    CHECK_INT(pal_settle(b.world, b.scene.step_s, &load, &options, &work, &run, NULL), PAL_ERR_OK);
    CHECK(run.steady);
    CHECK_LE(run.difference_percent, 0.1);
    CHECK_NEAR(run.max_m, largest(&b), 1e-3 * largest(&b));
    CHECK(work < options.max_work);
    /* the same again from the state it was left in: nothing of the first run is left over */
    pal_settle_run again;
    CHECK_INT(pal_settle(b.world, b.scene.step_s, &load, &options, &work, &again, NULL), PAL_ERR_OK);
    CHECK(again.seconds == run.seconds && again.difference_percent == run.difference_percent);
    close_beam(&b);
}

/* a load a thousand times lighter takes as long: what is still is relative to how far the body goes */
static void light_and_heavy_loads_take_as_long(void)
{
    beam heavy, light;
    pal_settle_options options;
    pal_settle_run a, b;
    REQUIRE(open_beam(&heavy, 1e-3));
    REQUIRE(open_beam(&light, 1e-6));
    pal_settle_default(&options);
    double work = options.max_work;
    const pal_settle_load load[2] = {{heavy.force, heavy.u}, {light.force, light.u}};
    CHECK_INT(pal_settle(heavy.world, 1.0 / 60, &load[0], &options, &work, &a, NULL), PAL_ERR_OK);
    CHECK_INT(pal_settle(light.world, 1.0 / 60, &load[1], &options, &work, &b, NULL), PAL_ERR_OK);
    CHECK(a.steady && b.steady);
    CHECK_NEAR(a.seconds, b.seconds, 0.02 * a.seconds);
    close_beam(&heavy);
    close_beam(&light);
}

static void ladder_takes_the_rate_that_is_still_soonest(void)
{
    beam b;
    pal_settle_options options;
    pal_settle_report report;
    REQUIRE(open_beam(&b, bend_N));
    pal_settle_default(&options);
    const pal_settle_load load = {.force_N = b.force, .u = b.u};
    CHECK_INT(pal_settle_damping(&b.scene, &load, 1, &options, &report, NULL), PAL_ERR_OK);
    CHECK(report.steady && report.load[0].steady);
    CHECK_LE(report.load[0].difference_percent, 0.1);
    bool on_it = false;
    for (int k = 0; k < PAL_SETTLE_STEPS; k++) {
        if (!isfinite(report.rate_seconds[k])) continue;
        CHECK(report.rate_seconds[k] >= report.seconds);
        on_it |= report.rate_seconds[k] == report.seconds && pal_settle_rates_1_s[k] == report.damping_1_s;
    }
    CHECK(on_it);
    /* none of the rates is sooner */
    options.max_simulated_s = report.seconds;
    pal_material material = b.scene.body[0].material;
    for (int k = 0; k < PAL_SETTLE_STEPS; k++) {
        pal_settle_run run;
        double work = options.max_work;
        material.damping_1_s = pal_settle_rates_1_s[k];
        REQUIRE(!pal_world_material(b.world, 0, &material, NULL));
        CHECK_INT(pal_settle(b.world, b.scene.step_s, &load, &options, &work, &run, NULL), PAL_ERR_OK);
        CHECK(!run.steady || run.seconds >= report.seconds - 1e-9);
    }
    close_beam(&b);
}

static void several_loads_share_one_rate(void)
{
    beam b;
    pal_settle_options options;
    pal_settle_report report;
    REQUIRE(open_beam(&b, bend_N));
    pal_settle_default(&options);
    double *pull = calloc(3 * (size_t)b.n, sizeof *pull);
    for (int i = 0; i < b.n; i++) pull[3 * i] = -b.force[3 * i + 2];
    const pal_settle_load load[2] = {{b.force, b.u}, {pull, NULL}};
    CHECK_INT(pal_settle_damping(&b.scene, load, 2, &options, &report, NULL), PAL_ERR_OK);
    CHECK(report.steady);
    CHECK_NEAR(report.seconds, 0.5 * (report.load[0].seconds + report.load[1].seconds), 1e-9);
    CHECK(isnan(report.load[1].difference_percent));
    CHECK(report.load[1].max_m > 0);
    free(pull);
    close_beam(&b);
}

static bool stop_at_once(const char *what, double fraction, void *user)
{
    (void)what, (void)fraction;
    ++*(int *)user;
    return false;
}

static void what_finds_no_rest_says_so(void)
{
    beam b;
    int asked = 0;
    pal_settle_options options;
    pal_settle_report report;
    REQUIRE(open_beam(&b, bend_N));
    const pal_settle_load load = {.force_N = b.force, .u = b.u};
    pal_settle_default(&options);
    options.max_simulated_s = 0.1; /* less than the quarter of a second that still has to last */
    CHECK_INT(pal_settle_damping(&b.scene, &load, 1, &options, &report, NULL), PAL_ERR_OK);
    CHECK(!report.steady && isnan(report.seconds));
    CHECK(report.damping_1_s == 4);
    CHECK(report.load[0].difference_percent > 1);
    /* a budget of work ends it as well */
    pal_settle_default(&options);
    options.max_work = 1;
    CHECK_INT(pal_settle_damping(&b.scene, &load, 1, &options, &report, NULL), PAL_ERR_OK);
    CHECK(!report.steady);
    /* and so does whoever watches */
    pal_settle_default(&options);
    options.progress = stop_at_once;
    options.user = &asked;
    CHECK_INT(pal_settle_damping(&b.scene, &load, 1, &options, &report, NULL), PAL_ERR_STATE);
    CHECK_INT(asked, 1);
    CHECK_INT(pal_settle_damping(&b.scene, &load, 0, &options, &report, NULL), PAL_ERR_REFUSED);
    /* a load that tears the body apart: frozen or far away, but an answer */
    for (int i = 0; i < 3 * b.n; i++) b.force[i] *= 1e9;
    pal_settle_default(&options);
    options.max_simulated_s = 2, options.max_work = 1e6;
    CHECK_INT(pal_settle_damping(&b.scene, &load, 1, &options, &report, NULL), PAL_ERR_OK);
    CHECK(!report.steady || report.load[0].difference_percent > 1);
    close_beam(&b);
}

int main(void)
{
    RUN(comes_to_rest_where_newton_does);
    RUN(light_and_heavy_loads_take_as_long);
    RUN(ladder_takes_the_rate_that_is_still_soonest);
    RUN(several_loads_share_one_rate);
    RUN(what_finds_no_rest_says_so);
    return check_report();
}
