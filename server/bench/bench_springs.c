/* `palpate bench springs`: milliseconds of a sub-step (forces and integration) and of skinning, against the limits of
 * this machine: memory triad and fused multiply-add. Medians over steps; a limit is the best of several runs.
 *
 * Floating point operations are counted from the kernels (a root counts 17: a guess and four Newton steps); bytes are
 * those that a sub-step must stream: constants, first slots, positions and forces of the nodes. The kernels add and
 * multiply in separate instructions, so that results are the same on every machine: they reach half of the
 * multiply-add limit at most. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/mesh/geometry/organ.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_CASE = 3, N_STEP = 31, TRIAD = 4 << 20, CHAINS = 128, LINKS = 16 };

typedef struct result {
    char name[48];
    int n_tet, n_node, n_tri, n_sub;
    double step_ms, spring_ms[3], solve_ms, skin_ms; /* sub-step; its three spring components; verlet; a frame */
    double limit_ms, flop, byte;
} result;

/* GB/s of a = b + s c, far beyond the caches */
static double measure_triad(void)
{
    double *a = calloc(TRIAD, sizeof *a), *b = calloc(TRIAD, sizeof *b), *c = calloc(TRIAD, sizeof *c), best = INFINITY;
    for (int run = 0; run < 7 && a && b && c; run++) {
        double began = pal_clock_s();
        for (int i = 0; i < TRIAD; i++) a[i] = b[i] + 3.0 * c[i];
        best = fmin(best, pal_clock_s() - began);
        /* each run depends on the one before, so that the compiler keeps all */
        b[run] = a[run] + 1;
    }
    free(a), free(b), free(c);
    return 24e-9 * TRIAD / best;
}

/* GFLOP/s of independent chains of multiply-adds */
static double measure_fma(void)
{
    static double value[CHAINS];
    volatile double factor = 0.999, term = 0.001;
    double m = factor, t = term, best = INFINITY;
    const int n = 4000;
    for (int run = 0; run < 7; run++) {
        double began = pal_clock_s();
        for (int turn = 0; turn < n; turn++)
            for (int i = 0; i < CHAINS; i++) {
                double v = value[i];
                for (int k = 0; k < LINKS; k++) {
#ifdef __FMA__
                    v = fma(v, m, t);
#else
                    v = v * m + t;
#endif
                }
                value[i] = v;
            }
        best = fmin(best, pal_clock_s() - began);
    }
    return value[0] == value[CHAINS - 1] ? 2e-9 * CHAINS * LINKS * n / best : 0;
}

/* an organ with a surface of 50,000 triangles, at the resolution that gives nearest to 13,000 tetrahedra */
static pal_err make_organ(pal_prepared *out, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    PAL_TRY(pal_organ_make(50000, &surface));
    pal_err err = PAL_ERR_OK;
    int best = 0;
    double nearest = INFINITY;
    for (int resolution = 14; resolution < 40 && !err; resolution++) {
        pal_voxel_options options = {.resolution = resolution, .border = true};
        pal_voxels voxels;
        pal_voxel_report report;
        err = pal_voxels_fill(&surface, &options, &voxels, &report, diag);
        if (err) break;
        double apart = fabs(5.0 * (double)(voxels.n_inside + voxels.n_border) - 13000);
        if (apart < nearest) nearest = apart, best = resolution;
        pal_voxels_free(&voxels);
    }
    pal_voxel_options options = {.resolution = best, .border = true};
    pal_prepare_report report;
    if (!err) err = pal_prepared_make(&surface, &options, out, &report, diag);
    pal_surface_free(&surface);
    return err;
}

/* floating point operations and bytes of one sub-step */
static pal_err count_work(const pal_tets *tets, result *out)
{
    int32_t *edge = NULL, *face = NULL;
    int n_edge = 0, n_face = 0;
    pal_err err = pal_tets_edges(tets, &edge, &n_edge);
    if (!err) err = pal_tets_faces(tets, &face, &n_face);
    free(edge);
    free(face);
    out->flop = 39.0 * n_edge + 76.0 * n_face + 73.0 * tets->n_tet + 18.0 * tets->n_node;
    out->byte = (16 + 1.0) * n_edge + (16 + 1.5) * n_face + (16 + 2.0) * tets->n_tet + 3 * 120.0 * tets->n_node;
    return err;
}

static void read_times(const pal_world *world, result *r)
{
    static const char *const spring[3] = {"edge_distance", "face_area", "tet_volume"};
    r->skin_ms = bench_component_ms(world, "output", NULL);
    r->solve_ms = bench_component_ms(world, "solve", NULL) / r->n_sub;
    r->step_ms = bench_component_ms(world, "force", NULL) / r->n_sub + r->solve_ms;
    for (int k = 0; k < 3; k++) r->spring_ms[k] = bench_component_ms(world, NULL, spring[k]) / r->n_sub;
}

static pal_err run_world(const pal_scene *scene, result *out, pal_diagnostic *diag)
{
    double step[N_STEP], spring[3][N_STEP], solve[N_STEP], skin[N_STEP];
    pal_world *world;
    PAL_TRY(pal_world_create(scene, diag, &world));
    pal_err err = PAL_ERR_OK;
    for (int i = -2; i < N_STEP && !err; i++) {
        pal_world_wake(world);
        err = pal_world_step(world, scene->step_s);
        out->n_sub = pal_world_substeps(world);
        if (i < 0) continue;
        read_times(world, out);
        step[i] = out->step_ms, solve[i] = out->solve_ms, skin[i] = out->skin_ms;
        for (int k = 0; k < 3; k++) spring[k][i] = out->spring_ms[k];
    }
    pal_world_destroy(world);
    if (err) return pal_diagnostic_set(diag, err, "the step failed: %s", pal_err_text(err));
    out->step_ms = pal_median(step, N_STEP), out->solve_ms = pal_median(solve, N_STEP);
    out->skin_ms = pal_median(skin, N_STEP);
    for (int k = 0; k < 3; k++) out->spring_ms[k] = pal_median(spring[k], N_STEP);
    return PAL_ERR_OK;
}

static pal_err run_case(const char *name, const pal_prepared *mesh, double limit_ms, result *out, pal_diagnostic *diag)
{
    *out = (result){.n_tet = mesh->tets.n_tet, .n_node = mesh->tets.n_node, .limit_ms = limit_ms};
    snprintf(out->name, sizeof out->name, "%s", name);
    pal_scene *scene = calloc(1, sizeof *scene);
    if (!scene) return PAL_ERR_MEMORY;
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_default(&scene->body[0], "body", mesh);
    if (mesh->skin.n_vertex > 0)
        out->n_tri = mesh->surface.n_tri;
    else
        scene->body[0].output.name[0] = 0;
    scene->body[0].n_effect = 1;
    pal_err err = count_work(&mesh->tets, out);
    if (!err) err = run_world(scene, out, diag);
    free(scene);
    return err;
}

static void add_case(bench_report *r, const result *c, double triad, double fma_limit)
{
    double gflops = 1e-6 * c->flop / c->step_ms, gbs = 1e-6 * c->byte / c->step_ms;
    bench_record(r);
    bench_text(r, "name", "body", -10, c->name);
    bench_number(r, "tets", "tets", 7, 0, c->n_tet);
    bench_number(r, "nodes", "nodes", 7, 0, c->n_node);
    bench_number(r, "substep_ms", "ms/sub-step", 11, 3, c->step_ms);
    bench_number(r, "edge_distance_ms", "edges", 6, 3, c->spring_ms[0]);
    bench_number(r, "face_area_ms", "faces", 6, 3, c->spring_ms[1]);
    bench_number(r, "tet_volume_ms", "tets", 6, 3, c->spring_ms[2]);
    bench_number(r, "verlet_ms", "verlet", 7, 3, c->solve_ms);
    bench_number(r, "limit_ms", "limit", 6, 2, c->limit_ms);
    bench_number(r, "GFLOP_s", "GFLOP/s", 8, 1, gflops);
    bench_number(r, "of_fma", "of limit", 8, 2, gflops / fma_limit);
    bench_number(r, "GB_s", "GB/s", 6, 1, gbs);
    bench_number(r, "of_triad", "of triad", 8, 2, gbs / triad);
    bench_number(r, "substeps", "sub-steps", 9, 0, c->n_sub);
    bench_number(r, "triangles", "triangles", 9, 0, c->n_tri);
    bench_number(r, "skin_ms", "skin ms", 8, 3, c->n_tri > 0 ? c->skin_ms : NAN);
}

int bench_springs(bool json)
{
    static const int box[2][3] = {{20, 13, 10}, {40, 26, 25}};
    static const char *const name[N_CASE] = {"box 13k", "box 130k", "organ 13k"};
    static const double limit_ms[N_CASE] = {0.25, 3, 0.25};
    result all[N_CASE];
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_CASE && !err; k++) {
        pal_prepared mesh = {0};
        err = k < 2 ? bench_box(box[k], 0.006, &mesh, &diag) : make_organ(&mesh, &diag);
        if (!err) err = run_case(name[k], &mesh, limit_ms[k], &all[k], &diag);
        pal_prepared_free(&mesh);
    }
    double triad = measure_triad(), fma_limit = measure_fma();
    bench_report r;
    bench_begin(&r, "springs", json);
    bench_number(&r, "steps", NULL, 0, 0, N_STEP);
    bench_number(&r, "triad_GB_s", NULL, 0, 0, triad);
    bench_number(&r, "fma_GFLOP_s", NULL, 0, 0, fma_limit);
    bench_note(&r, "one thread, medians of %d steps; this machine: triad %.1f GB/s, multiply-add %.1f GFLOP/s", N_STEP,
               triad, fma_limit);
    bench_list(&r, "cases");
    for (int k = 0; k < N_CASE && !err; k++) add_case(&r, &all[k], triad, fma_limit);
    return bench_end(&r, err, &diag);
}
