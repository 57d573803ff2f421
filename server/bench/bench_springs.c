/* `palpate bench springs`: milliseconds of a sub-step (forces and integration) and of skinning, against the limits of
 * this machine: memory triad and fused multiply-add; and how many times as fast they are with two threads as with one,
 * in worlds that step in turn. Medians over steps; a limit is the best of several runs.
 *
 * Floating point operations are counted from the kernels (a root counts 1, of a face 17: a guess and four Newton
 * steps); bytes are those that a sub-step must stream: constants, first slots, positions and forces of the nodes. The
 * kernels add and multiply in separate instructions, so that results are the same on every machine: they reach half of
 * the multiply-add limit at most. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/mesh/geometry/procedural.h"

#include "server/num/median.h"
#include <math.h>
#include <stdlib.h>

enum {
    N_CASE = 4,
    N_STEP = 31,
    LARGE = 50000,
    N_LARGE_STEP = 7,
    N_PART = 6,
    TRIAD = 4 << 20,
    CHAINS = 128,
    LINKS = 16
};

typedef struct result {
    int n_sub;
    double ms[N_PART], flop, byte; /* ms: a sub-step; its three spring components; verlet; skinning of a frame */
    double faster[N_PART];         /* with two threads */
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

/* an organ with a surface of n_tri triangles, at the resolution that gives nearest to n_tet tetrahedra */
static pal_err make_organ(int n_tri, int n_tet, pal_prepared *out, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    PAL_TRY(pal_organ_make(n_tri, &surface));
    pal_err err = PAL_ERR_OK;
    /* an organ fills a quarter of its box */
    const int first = (int)cbrt(n_tet / 5.0);
    int best = 0;
    double nearest = INFINITY;
    for (int resolution = first; resolution < 2 * first && !err; resolution++) {
        pal_voxel_options options = {.resolution = resolution, .border = true};
        pal_voxels voxels;
        pal_voxel_report report;
        err = pal_voxels_fill(&surface, &options, &voxels, &report, diag);
        if (err) break;
        double apart = fabs(5.0 * (double)(voxels.n_inside + voxels.n_border) - n_tet);
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
    out->flop = 24.0 * n_edge + 61.0 * n_face + 73.0 * tets->n_tet + 18.0 * tets->n_node;
    out->byte = (16 + 1.0) * n_edge + (16 + 1.5) * n_face + (16 + 2.0) * tets->n_tet + 3 * 120.0 * tets->n_node;
    return err;
}

/* times of a step, ms */
static pal_err run_step(pal_world *world, double step_s, double ms[N_PART])
{
    static const char *const spring[3] = {"edge_distance", "face_area", "tet_volume"};
    pal_world_wake(world);
    PAL_TRY(pal_world_step(world, step_s));
    const int n_sub = pal_world_substeps(world);
    for (int k = 0; k < 3; k++) ms[1 + k] = bench_component_ms(world, NULL, spring[k]) / n_sub;
    ms[4] = bench_component_ms(world, "solve", NULL) / n_sub;
    ms[0] = bench_component_ms(world, "force", NULL) / n_sub + ms[4];
    ms[5] = bench_component_ms(world, "output", NULL);
    return PAL_ERR_OK;
}

static pal_err run_worlds(pal_world *const world[2], double step_s, int n_step, result *out)
{
    double one[N_PART][N_STEP], faster[N_PART][N_STEP];
    for (int i = -2; i < n_step; i++) {
        double ms[2][N_PART];
        for (int w = 0; w < 2; w++) PAL_TRY(run_step(world[w], step_s, ms[w]));
        for (int k = 0; k < N_PART && i >= 0; k++) one[k][i] = ms[0][k], faster[k][i] = ms[0][k] / ms[1][k];
    }
    out->n_sub = pal_world_substeps(world[0]);
    for (int k = 0; k < N_PART; k++)
        out->ms[k] = pal_median(one[k], n_step), out->faster[k] = pal_median(faster[k], n_step);
    return PAL_ERR_OK;
}

static pal_err run_world(pal_scene *scene, int n_tet, result *out, pal_diagnostic *diag)
{
    pal_world *world[2] = {NULL, NULL};
    pal_err err = PAL_ERR_OK;
    for (int w = 0; w < 2 && !err; w++) {
        scene->threads = w + 1;
        err = pal_world_create(scene, diag, &world[w]);
    }
    if (!err) {
        err = run_worlds(world, scene->step_s, n_tet > LARGE ? N_LARGE_STEP : N_STEP, out);
        if (err) pal_diagnostic_set(diag, err, "the step failed: %s", pal_err_text(err));
    }
    for (int w = 0; w < 2; w++) pal_world_destroy(world[w]);
    return err;
}

static pal_err run_case(const char *name, const pal_prepared *mesh, double limit_ms, const double machine[2],
                        pal_table *r, pal_diagnostic *diag)
{
    static pal_scene scene;
    result c = {0};
    bool skinned = mesh->skin.n_vertex > 0;
    pal_scene_default(&scene);
    scene.n_body = 1;
    pal_body_default(&scene.body[0], "body", mesh);
    if (!skinned) scene.body[0].output.name[0] = 0;
    scene.body[0].n_effect = 1;
    PAL_TRY(count_work(&mesh->tets, &c));
    PAL_TRY(run_world(&scene, mesh->tets.n_tet, &c, diag));
    double gflops = 1e-6 * c.flop / c.ms[0], gbs = 1e-6 * c.byte / c.ms[0];
    TABLE_ROW(r, TEXT("name", "body", -10, name), NUMBER("tets", "tets", 7, 0, mesh->tets.n_tet),
              NUMBER("nodes", "nodes", 7, 0, mesh->tets.n_node), NUMBER("substep_ms", "ms/sub-step", 11, 3, c.ms[0]),
              NUMBER("edge_distance_ms", "edges", 6, 3, c.ms[1]), NUMBER("face_area_ms", "faces", 6, 3, c.ms[2]),
              NUMBER("tet_volume_ms", "tets", 6, 3, c.ms[3]), NUMBER("verlet_ms", "verlet", 7, 3, c.ms[4]),
              NUMBER("limit_ms", "limit", 6, 2, limit_ms), NUMBER("GFLOP_s", "GFLOP/s", 8, 1, gflops),
              NUMBER("of_fma", "of limit", 8, 2, gflops / machine[1]), NUMBER("GB_s", "GB/s", 6, 1, gbs),
              NUMBER("of_triad", "of triad", 8, 2, gbs / machine[0]), NUMBER("substeps", "sub-steps", 9, 0, c.n_sub),
              NUMBER("triangles", "triangles", 9, 0, skinned ? mesh->surface.n_tri : 0),
              NUMBER("skin_ms", "skin ms", 8, 3, skinned ? c.ms[5] : NAN),
              NUMBER("two_threads", "x on 2", 6, 2, c.faster[0]),
              NUMBER("skin_two_threads", "skin x on 2", 11, 2, skinned ? c.faster[5] : NAN));
    return PAL_ERR_OK;
}

pal_err bench_springs(pal_table *r, pal_diagnostic *diag)
{
    static const int box[2][3] = {{20, 13, 10}, {40, 26, 25}};
    static const char *const name[N_CASE] = {"box 13k", "box 130k", "organ 13k", "organ 130k"};
    static const double limit_ms[N_CASE] = {0.25, 3, 0.25, 3};
    const double machine[2] = {measure_triad(), measure_fma()};
    TABLE_ROW(r, VALUE("steps", N_STEP), VALUE("triad_GB_s", machine[0]), VALUE("fma_GFLOP_s", machine[1]));
    pal_table_note(
        r,
        "one thread and times as fast on 2, medians of %d steps (large bodies: 7); this machine: triad %.1f GB/s, "
        "multiply-add %.1f GFLOP/s",
        N_STEP, machine[0], machine[1]);
    pal_table_list(r, "cases");
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_CASE && !err; k++) {
        pal_prepared mesh = {0};
        err = k < 2 ? bench_box(box[k], 0.006, &mesh, diag)
                    : make_organ(k == 2 ? 50000 : 500000, k == 2 ? 13000 : 130000, &mesh, diag);
        if (!err) err = run_case(name[k], &mesh, limit_ms[k], machine, r, diag);
        pal_prepared_free(&mesh);
    }
    return err;
}
