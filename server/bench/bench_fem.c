/* palpate bench fem: live steps of finite-element bodies that bend under a load that comes and goes, conjugate gradient
 * iterations with and without the warp of the preconditioner, and a static solve. One thread but for the spare one that
 * refreshes factors; medians over steps; every body is made here, from boxes of voxels.
 *
 * The beam is that of the reference solutions: 0.2 x 0.05 x 0.05 m, E 100 kPa, nu 0.45, clamped at one end, 2 N on the
 * other, which moves its tip by nearly half of its length. The load is on for half a second and off for half a second.
 */
#include "server/bench/bench.h"

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

static pal_err make_box(const int n[3], double edge_m, pal_prepared *out, pal_diagnostic *diag)
{
    size_t n_voxel = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    pal_voxels voxels = {.n = {n[0], n[1], n[2]}, .edge_m = edge_m, .n_inside = (int64_t)n_voxel};
    memset(out, 0, sizeof *out);
    voxels.kind = malloc(n_voxel);
    if (!voxels.kind) return PAL_ERR_MEMORY;
    memset(voxels.kind, 2, n_voxel);
    pal_err err = pal_voxels_split(&voxels, &out->tets);
    if (!err) err = pal_hexes_find(&out->tets, &out->hexes, diag);
    pal_voxels_free(&voxels);
    return err;
}

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

static double row_ms(const pal_world *world, const char *stage)
{
    double ms = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        if (!strcmp(info.stage, stage)) ms += 1e-6 * (double)info.spent_ns;
    }
    return ms;
}

static pal_err run_live(const job *j, result *out, pal_diagnostic *diag)
{
    static double ms[N_STEP], force[N_STEP];
    pal_prepared mesh = {0};
    pal_scene *scene = calloc(1, sizeof *scene);
    pal_world *world = NULL;
    pal_err err = scene ? make_box(j->n, j->edge_m, &mesh, diag) : PAL_ERR_MEMORY;
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
        ms[i] = 1e3 * (pal_clock_s() - began), force[i] = row_ms(world, "force");
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

/* the reference cube: 0.1 m, nu 0.499, soft over stiff, a patch of its top pushed down and sideways */
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
    pal_err err = scene ? make_box(j.n, j.edge_m, &mesh, diag) : PAL_ERR_MEMORY;
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

static void print_table(const result *r, const static_result *s)
{
    printf("live steps, medians of %d, one thread\n", N_STEP);
    printf("body              element    law           nodes  elements  step ms  ms p50  ms p95   limit  forces ms  "
           "CG mean  CG most  tip m\n");
    for (int k = 0; k < N_JOB; k++) {
        const job *j = &jobs[k];
        printf("%-17s %-10s %-13s %5d %9d %8.2f %7.3f %7.3f ", j->name, j->element, j->law, r[k].n_node, r[k].n_element,
               1e3 * j->step_s, r[k].p50_ms, r[k].p95_ms);
        if (isfinite(j->limit_ms))
            printf("%7.1f ", j->limit_ms);
        else
            printf("%7s ", "");
        printf("%10.3f %8.1f %8.0f %6.3f\n", r[k].force_ms, r[k].mean_cg, r[k].max_cg, r[k].tip_m);
    }
    printf("static cube, nu 0.499, %d nodes: made in %.0f ms, solved in %.0f ms (%.0f of it factors), %d Newton "
           "iterations, residual %.1e, limit 1500 ms\n",
           s->n_node, s->create_ms, s->solve_ms, s->factor_ms, s->n_newton, s->residual);
}

static void print_json(const result *r, const static_result *s)
{
    printf("{\"bench\":\"fem\",\"runs\":%d,\"cases\":[", N_STEP);
    for (int k = 0; k < N_JOB; k++) {
        const job *j = &jobs[k];
        printf("%s{\"name\":\"%s\",\"element\":\"%s\",\"law\":\"%s\",\"nodes\":%d,\"elements\":%d,\"step_s\":%.6f,"
               "\"warp\":%s,\"p50_ms\":%.4f,\"p95_ms\":%.4f,\"force_ms\":%.4f,\"cg_mean\":%.2f,\"cg_most\":%.0f,"
               "\"tip_m\":%.4f}",
               k ? "," : "", j->name, j->element, j->law, r[k].n_node, r[k].n_element, j->step_s,
               j->warp ? "true" : "false", r[k].p50_ms, r[k].p95_ms, r[k].force_ms, r[k].mean_cg, r[k].max_cg,
               r[k].tip_m);
    }
    printf("],\"static\":{\"nodes\":%d,\"make_ms\":%.2f,\"solve_ms\":%.2f,\"factor_ms\":%.2f,\"newton\":%d,"
           "\"residual\":%.3e,\"converged\":%s}}\n",
           s->n_node, s->create_ms, s->solve_ms, s->factor_ms, s->n_newton, s->residual,
           s->converged ? "true" : "false");
}

int bench_fem(bool json)
{
    result r[N_JOB];
    static_result s = {0};
    pal_diagnostic diag = {{0}};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_JOB && !err; k++) err = run_live(&jobs[k], &r[k], &diag);
    if (!err) err = run_static(16, &s, &diag);
    if (err) {
        fprintf(stderr, "palpate bench: fem: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    if (json)
        print_json(r, &s);
    else
        print_table(r, &s);
    return 0;
}
