/* palpate bench springs: milliseconds of a sub-step (forces and integration) and of skinning, against this machine's
 * own limits: memory triad and fused multiply-add. Medians over steps; the limits are the best of some runs.
 *
 * Floating point operations are counted from the kernels (one root is 17: a guess and four Newton steps); bytes are
 * what must stream past once a sub-step: constants, first slots and the nodes' positions and forces. The kernels add
 * and multiply apart, so that the answer is the same everywhere: half of the multiply-add limit is all they can reach.
 */
#include "server/bench/bench.h"

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
    double step_ms, row_ms[3], solve_ms, skin_ms; /* a sub-step; its three spring rows; verlet; a frame */
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
        /* the next run needs this one's sum, so that none is left out */
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

/* a box of voxels, shown by its own boundary */
static pal_err make_box(const int n[3], pal_prepared *out)
{
    size_t n_voxel = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    pal_voxels voxels = {.n = {n[0], n[1], n[2]}, .edge_m = 0.006, .n_inside = (int64_t)n_voxel};
    memset(out, 0, sizeof *out);
    voxels.kind = malloc(n_voxel);
    if (!voxels.kind) return PAL_ERR_MEMORY;
    memset(voxels.kind, 2, n_voxel);
    pal_err err = pal_voxels_split(&voxels, &out->tets);
    pal_voxels_free(&voxels);
    return err;
}

/* an organ shown with 50,000 triangles, at the resolution whose mesh comes nearest to 13,000 tetrahedra */
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

/* constraints, their operations and bytes, from the rows' own meshes */
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

static void sum_rows(const pal_world *world, result *r, double *skin_ns)
{
    static const char *const springs[3] = {"edge_distance", "face_area", "tet_volume"};
    *skin_ns = r->step_ms = r->solve_ms = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        double ms = 1e-6 * (double)info.spent_ns / r->n_sub;
        if (!strcmp(info.stage, "output")) *skin_ns = (double)info.spent_ns;
        if (!strcmp(info.stage, "solve")) r->solve_ms = ms;
        if (!strcmp(info.stage, "force") || !strcmp(info.stage, "solve")) r->step_ms += ms;
        for (int k = 0; k < 3; k++)
            if (!strcmp(info.name, springs[k])) r->row_ms[k] = ms;
    }
}

static pal_err run_world(const pal_scene *scene, result *out, pal_diagnostic *diag)
{
    double step[N_STEP], row[3][N_STEP], solve[N_STEP], skin[N_STEP];
    pal_world *world;
    PAL_TRY(pal_world_create(scene, diag, &world));
    pal_err err = PAL_ERR_OK;
    for (int i = -2; i < N_STEP && !err; i++) {
        pal_world_wake(world);
        err = pal_world_step(world, scene->step_s);
        out->n_sub = pal_world_substeps(world);
        if (i < 0) continue;
        sum_rows(world, out, &skin[i]);
        step[i] = out->step_ms, solve[i] = out->solve_ms;
        for (int k = 0; k < 3; k++) row[k][i] = out->row_ms[k];
    }
    pal_world_destroy(world);
    if (err) return pal_diagnostic_set(diag, err, "the step failed: %s", pal_err_text(err));
    out->step_ms = pal_median(step, N_STEP), out->solve_ms = pal_median(solve, N_STEP);
    out->skin_ms = 1e-6 * pal_median(skin, N_STEP);
    for (int k = 0; k < 3; k++) out->row_ms[k] = pal_median(row[k], N_STEP);
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

static void print_table(const result *r, double triad, double fma_limit)
{
    printf("one thread, medians of %d steps; this machine: triad %.1f GB/s, multiply-add %.1f GFLOP/s\n", N_STEP, triad,
           fma_limit);
    printf("body            tets   nodes  ms/sub-step  edges  faces   tets  verlet  limit  GFLOP/s  of limit   GB/s  "
           "of triad  sub-steps  triangles  skin ms\n");
    for (int k = 0; k < N_CASE; k++) {
        double gflops = 1e-6 * r[k].flop / r[k].step_ms, gbs = 1e-6 * r[k].byte / r[k].step_ms;
        printf("%-12s %7d %7d %12.3f %6.3f %6.3f %6.3f %7.3f %6.2f %8.1f %8.0f%% %6.1f %8.0f%% %10d", r[k].name,
               r[k].n_tet, r[k].n_node, r[k].step_ms, r[k].row_ms[0], r[k].row_ms[1], r[k].row_ms[2], r[k].solve_ms,
               r[k].limit_ms, gflops, 100 * gflops / fma_limit, gbs, 100 * gbs / triad, r[k].n_sub);
        if (r[k].n_tri > 0) printf(" %10d %8.3f", r[k].n_tri, r[k].skin_ms);
        printf("\n");
    }
}

static void print_json(const result *r, double triad, double fma_limit)
{
    printf("{\"bench\":\"springs\",\"runs\":%d,\"triad_GB_s\":%.2f,\"fma_GFLOP_s\":%.2f,\"cases\":[", N_STEP, triad,
           fma_limit);
    for (int k = 0; k < N_CASE; k++) {
        double gflops = 1e-6 * r[k].flop / r[k].step_ms, gbs = 1e-6 * r[k].byte / r[k].step_ms;
        printf("%s{\"name\":\"%s\",\"tets\":%d,\"nodes\":%d,\"substep_ms\":%.4f,\"edge_distance_ms\":%.4f,"
               "\"face_area_ms\":%.4f,\"tet_volume_ms\":%.4f,\"verlet_ms\":%.4f,\"limit_ms\":%.2f,\"GFLOP_s\":%.2f,"
               "\"of_fma\":%.3f,\"GB_s\":%.2f,\"of_triad\":%.3f,\"substeps\":%d,\"triangles\":%d,\"skin_ms\":%.4f}",
               k ? "," : "", r[k].name, r[k].n_tet, r[k].n_node, r[k].step_ms, r[k].row_ms[0], r[k].row_ms[1],
               r[k].row_ms[2], r[k].solve_ms, r[k].limit_ms, gflops, gflops / fma_limit, gbs, gbs / triad, r[k].n_sub,
               r[k].n_tri, r[k].skin_ms);
    }
    printf("]}\n");
}

int bench_springs(bool json)
{
    static const int box[2][3] = {{20, 13, 10}, {40, 26, 25}};
    static const char *const name[N_CASE] = {"box 13k", "box 130k", "organ 13k"};
    static const double limit_ms[N_CASE] = {0.25, 3, 0.25};
    result r[N_CASE];
    pal_diagnostic diag = {{0}};
    for (int k = 0; k < N_CASE; k++) {
        pal_prepared mesh = {0};
        pal_err err = k < 2 ? make_box(box[k], &mesh) : make_organ(&mesh, &diag);
        if (!err) err = run_case(name[k], &mesh, limit_ms[k], &r[k], &diag);
        pal_prepared_free(&mesh);
        if (err) {
            fprintf(stderr, "palpate bench: springs: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
            return err == PAL_ERR_MEMORY ? 3 : 1;
        }
    }
    double triad = measure_triad(), fma_limit = measure_fma();
    if (json)
        print_json(r, triad, fma_limit);
    else
        print_table(r, triad, fma_limit);
    return 0;
}
