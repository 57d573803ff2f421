/* `palpate bench fem`: live steps of finite-element bodies that bend under a load that is switched on and off,
 * conjugate gradient iterations with and without the warped preconditioner, and a static solve. One thread besides the
 * one that refactors; medians over steps; every body is a box of voxels.
 *
 * The beam is that of the reference solutions: 0.2 x 0.05 x 0.05 m, E 100 kPa, nu 0.45, clamped at one end, 2 N on the
 * other, which moves its tip by nearly half of its length. The load is on for half a second and off for half a second.
 */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/num/median.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N_STEP = 240 };

typedef struct job {
    const char *name, *element, *law;
    int n[3];
    double edge_m, poisson, step_s, force_N, limit_ms;
    bool warp;
} job;

/* the scene of one body clamped at its lowest face along `axis`, without output and tools */
static pal_err make_scene(const job *j, const pal_prepared *mesh, int axis, const char *solver, pal_scene *scene,
                          pal_diagnostic *diag)
{
    pal_scene_default(scene);
    scene->n_body = 1;
    scene->step_s = j->step_s;
    pal_body_def *body = &scene->body[0];
    pal_body_default(body, "body", mesh);
    body->material.young_Pa = 1e5, body->material.poisson = j->poisson;
    body->output.name[0] = 0;
    body->n_effect = 0;
    body->n_support = 1;
    body->support[0] = (pal_support_def){.lowest = false};
    for (int c = 0; c < 3; c++) body->support[0].low_m[c] = -1, body->support[0].high_m[c] = 1;
    body->support[0].high_m[axis] = 1e-6;
    pal_entry_init(&body->model, "model", "fem");
    PAL_TRY(pal_entry_put_text(&body->model, "element", j->element, diag));
    PAL_TRY(pal_entry_put_text(&body->model, "law", j->law, diag));
    pal_entry_init(&body->solver, "solver", solver);
    if (!strcmp(solver, "implicit_euler")) PAL_TRY(pal_entry_put_bool(&body->solver, "warp", j->warp, diag));
    return PAL_ERR_OK;
}

/* consistent loads of a uniform traction on the face of greatest coordinate, where it lies within [low, high] along the
 * other two axes; their sum is force */
static pal_err load_face(pal_world *world, int axis, double low, double high, const double force[3])
{
    pal_body *body = pal_world_body(world, 0);
    double top = -INFINITY, total = 0;
    double *share = calloc((size_t)body->n_node, sizeof *share);
    if (!share) return PAL_ERR_MEMORY;
    const pal_tets *tets = body->tets;
    for (int i = 0; i < tets->n_node; i++) top = fmax(top, tets->x[3 * i + axis]);
    for (int f = 0; f < tets->n_face; f++) {
        bool in = true;
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) {
                double x = tets->x[3 * tets->face[3 * f + k] + c];
                in = in && (c == axis ? x > top - 1e-6 : x > low - 1e-6 && x < high + 1e-6);
            }
        for (int k = 0; k < 3 && in; k++) share[tets->face[3 * f + k]] += 1, total += 1;
    }
    pal_err err = total > 0 ? PAL_ERR_OK : PAL_ERR_INTERNAL;
    for (int i = 0; i < tets->n_node && !err; i++) {
        double f[3];
        for (int c = 0; c < 3; c++) f[c] = force[c] * share[i] / total;
        if (share[i] > 0) err = pal_world_load(world, 0, i, f);
    }
    body->load_cap_N = INFINITY;
    free(share);
    return err;
}

static pal_err run_live(const job *j, pal_table *r, pal_diagnostic *diag)
{
    static double ms[N_STEP], force[N_STEP];
    static pal_scene scene;
    pal_prepared mesh = {0};
    pal_world *world = NULL;
    double mean_cg = 0, max_cg = 0, tip_m = 0;
    pal_err err = bench_box(j->n, j->edge_m, &mesh, diag);
    if (!err) err = make_scene(j, &mesh, 0, "implicit_euler", &scene, diag);
    if (!err) err = pal_world_create(&scene, diag, &world);
    int half = (int)lround(0.5 / j->step_s);
    for (int i = -half; i < N_STEP && !err; i++) {
        int phase = (i + half) / half & 1;
        const double on[3] = {0, 0, phase ? 0 : -j->force_N};
        if ((i + half) % half == 0) err = load_face(world, 0, -1, 1, on);
        double began = pal_clock_s();
        if (!err) err = pal_world_step(world, j->step_s);
        pal_solve_report report;
        if (err || i < 0) continue;
        pal_world_solve_report(world, 0, &report);
        ms[i] = 1e3 * (pal_clock_s() - began), force[i] = bench_component_ms(world, "force", NULL);
        mean_cg += (double)report.n_cg / N_STEP, max_cg = fmax(max_cg, report.n_cg);
        const pal_body *body = pal_world_body(world, 0);
        for (int k = 0; k < body->n_node; k++) tip_m = fmax(tip_m, fabs(body->x[3 * k + 2] - body->x_rest[3 * k + 2]));
    }
    if (!err) {
        const pal_body *body = pal_world_body(world, 0);
        double p50_ms = pal_median(ms, N_STEP), p95_ms = ms[N_STEP * 95 / 100];
        TABLE_ROW(r, TEXT("name", "body", -17, j->name), TEXT("element", "element", -10, j->element),
                  TEXT("law", "law", -13, j->law), NUMBER("nodes", "nodes", 5, 0, body->n_node),
                  NUMBER("elements", "elements", 8, 0, body->n_element),
                  NUMBER("step_ms", "step ms", 8, 2, 1e3 * j->step_s), NUMBER("p50_ms", "ms p50", 7, 3, p50_ms),
                  NUMBER("p95_ms", "ms p95", 7, 3, p95_ms), NUMBER("limit_ms", "limit", 6, 1, j->limit_ms),
                  NUMBER("force_ms", "forces ms", 9, 3, pal_median(force, N_STEP)),
                  NUMBER("cg_mean", "CG mean", 7, 1, mean_cg), NUMBER("cg_max", "CG max", 6, 0, max_cg),
                  NUMBER("tip_m", "tip m", 6, 3, tip_m));
    }
    pal_world_destroy(world);
    pal_prepared_free(&mesh);
    return err;
}

/* the reference cube: 0.1 m, nu 0.499, soft above stiff, a patch of its top loaded down and sideways */
static pal_err run_static(int n, pal_table *r, pal_diagnostic *diag)
{
    const job j = {.element = "hex8_bbar",
                   .law = "linear",
                   .n = {n, n, n},
                   .edge_m = 0.1 / n,
                   .poisson = 0.499,
                   .step_s = 1.0 / 60};
    static pal_scene scene;
    pal_prepared mesh = {0};
    pal_world *world = NULL;
    pal_err err = bench_box(j.n, j.edge_m, &mesh, diag);
    if (!err) err = make_scene(&j, &mesh, 2, "static_newton", &scene, diag);
    if (!err) {
        pal_region *soft = &scene.body[0].region[scene.body[0].n_region++];
        *soft = (pal_region){.kind = PAL_REGION_BOX, .young_Pa = 5e4, .poisson = NAN, .density_kg_m3 = NAN};
        scene.body[0].material.young_Pa = 1e6;
        for (int c = 0; c < 3; c++) soft->low_m[c] = -1, soft->high_m[c] = 1;
        soft->low_m[2] = 0.05;
    }
    double began = pal_clock_s();
    if (!err) err = pal_world_create(&scene, diag, &world);
    double made = pal_clock_s();
    const double force[3] = {5, 0, -12.5};
    if (!err) err = load_face(world, 2, 0.025, 0.075, force);
    double loaded = pal_clock_s();
    if (!err) err = pal_world_step(world, scene.step_s);
    if (!err) {
        pal_solve_report report;
        double solve_ms = 1e3 * (pal_clock_s() - loaded);
        pal_world_solve_report(world, 0, &report);
        TABLE_ROW(
            r, NUMBER("nodes", "nodes", 6, 0, pal_world_body(world, 0)->n_node),
            NUMBER("make_ms", "make ms", 8, 0, 1e3 * (made - began)), NUMBER("solve_ms", "solve ms", 8, 0, solve_ms),
            NUMBER("factor_ms", "factor ms", 9, 0, 1e3 * report.factor_s), NUMBER(NULL, "limit ms", 8, 0, 1500),
            NUMBER("newton", "Newton", 6, 0, report.n_newton), NUMBER("residual", "residual", 12, 10, report.residual),
            TEXT("converged", "converged", 9, report.converged ? "yes" : "no"));
    }
    pal_world_destroy(world);
    pal_prepared_free(&mesh);
    return err;
}

static const job jobs[] = {
    {"beam", "hex8_bbar", "corotational", {16, 4, 4}, 0.0125, 0.45, 1.0 / 60, 2, 1, true},
    {"beam", "hex8_bbar", "corotational", {32, 8, 8}, 0.00625, 0.45, 1.0 / 60, 2, 8, true},
    {"beam, not warped", "hex8_bbar", "corotational", {32, 8, 8}, 0.00625, 0.45, 1.0 / 60, 2, NAN, false},
    {"block", "tet4", "corotational", {20, 13, 10}, 0.006, 0.45, 1.0 / 60, 5, 10, true},
    {"beam at 1 kHz", "hex8_bbar", "corotational", {16, 4, 4}, 0.0125, 0.45, 1e-3, 2, 1, true},
    {"beam", "hex8_bbar", "neo_hookean", {16, 4, 4}, 0.0125, 0.45, 1.0 / 60, 2, NAN, true},
};
enum { N_JOB = sizeof jobs / sizeof jobs[0] };

pal_err bench_fem(pal_table *r, pal_diagnostic *diag)
{
    pal_table_note(r, "live steps, medians of %d, one thread", N_STEP);
    pal_table_list(r, "cases");
    for (int k = 0; k < N_JOB; k++) PAL_TRY(run_live(&jobs[k], r, diag));
    pal_table_note(r, "static cube, nu 0.499:");
    pal_table_list(r, "static");
    return run_static(16, r, diag);
}
