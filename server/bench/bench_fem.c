/* `palpate bench fem`: live steps of finite-element bodies that bend under a load that is switched on and off,
 * conjugate gradient iterations with and without the warped preconditioner, and a static solve. One thread besides the
 * one that refactors; medians over steps; every body is a box of voxels.
 *
 * The beam is that of the reference solutions: 0.2 x 0.05 x 0.05 m, E 100 kPa, nu 0.45, clamped at one end, 2 N on the
 * other, which moves its tip by nearly half of its length. The load is on for half a second and off for half a second.
 */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_STEP = 240 };

typedef struct job {
    const char *name, *element, *law;
    int n[3];
    double edge_m, poisson, step_s, force_N, limit_ms;
    bool warp;
} job;

typedef struct result {
    int n_node, n_element;
    double p50_ms, p95_ms, force_ms, mean_cg, max_cg, tip_m;
} result;

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

static pal_err run_live(const job *j, result *out, pal_diagnostic *diag)
{
    static double ms[N_STEP], force[N_STEP];
    pal_prepared mesh = {0};
    pal_scene *scene = calloc(1, sizeof *scene);
    pal_world *world = NULL;
    pal_err err = scene ? bench_box(j->n, j->edge_m, &mesh, diag) : PAL_ERR_MEMORY;
    if (!err) err = make_scene(j, &mesh, 0, "implicit_euler", scene, diag);
    if (!err) err = pal_world_create(scene, diag, &world);
    *out = (result){0};
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
        out->mean_cg += (double)report.n_cg / N_STEP;
        out->max_cg = fmax(out->max_cg, report.n_cg);
        const pal_body *body = pal_world_body(world, 0);
        for (int k = 0; k < body->n_node; k++)
            out->tip_m = fmax(out->tip_m, fabs(body->x[3 * k + 2] - body->x_rest[3 * k + 2]));
    }
    if (!err) {
        const pal_body *body = pal_world_body(world, 0);
        out->n_node = body->n_node, out->n_element = body->n_element;
        out->p50_ms = pal_median(ms, N_STEP), out->p95_ms = ms[N_STEP * 95 / 100];
        out->force_ms = pal_median(force, N_STEP);
    }
    pal_world_destroy(world);
    pal_prepared_free(&mesh);
    free(scene);
    return err;
}

typedef struct static_result {
    int n_node, n_newton;
    double create_ms, solve_ms, factor_ms, residual;
    bool converged;
} static_result;

/* the reference cube: 0.1 m, nu 0.499, soft above stiff, a patch of its top loaded down and sideways */
static pal_err run_static(int n, static_result *out, pal_diagnostic *diag)
{
    const job j = {.element = "hex8_bbar",
                   .law = "linear",
                   .n = {n, n, n},
                   .edge_m = 0.1 / n,
                   .poisson = 0.499,
                   .step_s = 1.0 / 60};
    pal_prepared mesh = {0};
    pal_scene *scene = calloc(1, sizeof *scene);
    pal_world *world = NULL;
    pal_err err = scene ? bench_box(j.n, j.edge_m, &mesh, diag) : PAL_ERR_MEMORY;
    if (!err) err = make_scene(&j, &mesh, 2, "static_newton", scene, diag);
    if (!err) {
        pal_region *soft = &scene->body[0].region[scene->body[0].n_region++];
        *soft = (pal_region){.kind = PAL_REGION_BOX, .young_Pa = 5e4, .poisson = NAN, .density_kg_m3 = NAN};
        scene->body[0].material.young_Pa = 1e6;
        for (int c = 0; c < 3; c++) soft->low_m[c] = -1, soft->high_m[c] = 1;
        soft->low_m[2] = 0.05;
    }
    double began = pal_clock_s();
    if (!err) err = pal_world_create(scene, diag, &world);
    out->create_ms = 1e3 * (pal_clock_s() - began);
    const double force[3] = {5, 0, -12.5};
    if (!err) err = load_face(world, 2, 0.025, 0.075, force);
    began = pal_clock_s();
    if (!err) err = pal_world_step(world, scene->step_s);
    out->solve_ms = 1e3 * (pal_clock_s() - began);
    if (!err) {
        pal_solve_report report;
        pal_world_solve_report(world, 0, &report);
        out->n_node = pal_world_body(world, 0)->n_node, out->n_newton = report.n_newton;
        out->factor_ms = 1e3 * report.factor_s, out->residual = report.residual, out->converged = report.converged;
    }
    pal_world_destroy(world);
    pal_prepared_free(&mesh);
    free(scene);
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

static void add_job(bench_report *r, const job *j, const result *c)
{
    bench_record(r);
    bench_text(r, "name", "body", -17, j->name);
    bench_text(r, "element", "element", -10, j->element);
    bench_text(r, "law", "law", -13, j->law);
    bench_number(r, "nodes", "nodes", 5, 0, c->n_node);
    bench_number(r, "elements", "elements", 8, 0, c->n_element);
    bench_number(r, "step_ms", "step ms", 8, 2, 1e3 * j->step_s);
    bench_number(r, "p50_ms", "ms p50", 7, 3, c->p50_ms);
    bench_number(r, "p95_ms", "ms p95", 7, 3, c->p95_ms);
    bench_number(r, "limit_ms", "limit", 6, 1, j->limit_ms);
    bench_number(r, "force_ms", "forces ms", 9, 3, c->force_ms);
    bench_number(r, "cg_mean", "CG mean", 7, 1, c->mean_cg);
    bench_number(r, "cg_max", "CG max", 6, 0, c->max_cg);
    bench_number(r, "tip_m", "tip m", 6, 3, c->tip_m);
}

int bench_fem(bool json)
{
    result all[N_JOB];
    static_result s = {0};
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_JOB && !err; k++) err = run_live(&jobs[k], &all[k], &diag);
    if (!err) err = run_static(16, &s, &diag);
    bench_report r;
    bench_begin(&r, "fem", json);
    bench_note(&r, "live steps, medians of %d, one thread", N_STEP);
    bench_list(&r, "cases");
    for (int k = 0; k < N_JOB && !err; k++) add_job(&r, &jobs[k], &all[k]);
    bench_note(&r, "static cube, nu 0.499:");
    bench_list(&r, "static");
    bench_record(&r);
    bench_number(&r, "nodes", "nodes", 6, 0, s.n_node);
    bench_number(&r, "make_ms", "make ms", 8, 0, s.create_ms);
    bench_number(&r, "solve_ms", "solve ms", 8, 0, s.solve_ms);
    bench_number(&r, "factor_ms", "factor ms", 9, 0, s.factor_ms);
    bench_number(&r, NULL, "limit ms", 8, 0, 1500);
    bench_number(&r, "newton", "Newton", 6, 0, s.n_newton);
    bench_number(&r, "residual", "residual", 12, 10, s.residual);
    bench_text(&r, "converged", "converged", 9, s.converged ? "yes" : "no");
    return bench_end(&r, err, &diag);
}
