/* `palpate bench organ [SURFACE.ply]`: finite-element organs of growing size, live under a pull that is switched on and
 * off, by each preconditioner. The voxels of a closed surface, or of a computed organ; its lowest 12 % are held, E
 * 20 kPa, nu 0.45; the nodes within a fifth of the organ's length of its highest one are pulled sideways. Medians over
 * steps: the processor's time of the calling thread, also with several. Then organs with five stiff lumps in a row, E
 * times the contrast, and the computed stomach with a wall, whose factor has fewer entries a node. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/geometry/procedural.h"
#include "server/num/median.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS_MAX = 120 };

typedef struct job {
    pal_prepared mesh;
    const char *solver, *kind;
    double young_Pa, step_s, contrast, pull; /* pull: share of E S^2 */
    int threads;
} job;

/* pulls: a hollow organ bends more, by 6 to 31 % of its length under this one */
#define PULL_SOLID  2e-3
#define PULL_HOLLOW 2e-4
/* wall of the stomach over its length: 9.7 mm, one voxel and a half at 3,500 nodes */
#define WALL_SHARE 0.04

/* the computed stomach, and the same surface inside it, turned round */
static pal_err make_hollow(pal_surface *out)
{
    pal_stomach stomach;
    double low[3], high[3], *normal = NULL;
    PAL_TRY(pal_stomach_make(&stomach));
    const pal_surface *outer = &stomach.surface;
    const int n = 3 * outer->n_vertex, n_corner = 3 * outer->n_tri;
    pal_err err = PAL_ERR_OK;
    *out = (pal_surface){.n_vertex = 2 * outer->n_vertex, .n_tri = 2 * outer->n_tri};
    PAL_ARRAY(&err, out->x, 2 * n);
    PAL_ARRAY(&err, out->tri, 2 * n_corner);
    PAL_ARRAY(&err, normal, n);
    if (!err) {
        pal_surface_box(outer, low, high);
        pal_surface_normals(outer, normal);
        const double wall_m = WALL_SHARE * (high[1] - low[1]);
        for (int i = 0; i < n; i++) out->x[i] = outer->x[i], out->x[n + i] = outer->x[i] - wall_m * normal[i];
        for (int i = 0; i < n_corner; i++)
            out->tri[i] = outer->tri[i], out->tri[2 * n_corner - 1 - i] = outer->n_vertex + outer->tri[i];
    }
    free(normal);
    pal_surface_free(&stomach.surface);
    return err;
}

/* the resolution that gives nearest to so many nodes */
static pal_err make_body(const pal_surface *surface, int n_node, pal_prepared *out, pal_diagnostic *diag)
{
    int best = 0;
    double nearest = INFINITY;
    for (int low = 8, high = 160; low <= high;) {
        const int resolution = (low + high) / 2;
        pal_voxel_options options = {.resolution = resolution, .border = true};
        pal_voxels voxels;
        pal_voxel_report report;
        PAL_TRY(pal_voxels_fill(surface, &options, &voxels, &report, diag));
        /* a body of n voxels has some n + 3 n^(2/3) nodes */
        const double n = (double)(voxels.n_inside + voxels.n_border), nodes = n + 3 * cbrt(n * n);
        pal_voxels_free(&voxels);
        if (fabs(nodes - n_node) < nearest) nearest = fabs(nodes - n_node), best = resolution;
        if (nodes < n_node)
            low = resolution + 1;
        else
            high = resolution - 1;
    }
    pal_voxel_options options = {.resolution = best, .border = true};
    pal_prepare_report report;
    return pal_prepared_make(surface, &options, out, &report, diag);
}

/* boxes a fifth of the organ's length apart along x, nearly as wide, in the middle of y and z; only what is inside the
 * organ counts */
static void add_lumps(pal_body_def *body, const job *j)
{
    double low[3], high[3];
    pal_surface_box(&j->mesh.surface, low, high);
    const double length = high[0] - low[0];
    for (int k = 0; k < 5; k++) {
        pal_region *lump = &body->region[body->n_region++];
        *lump = (pal_region){
            .kind = PAL_REGION_BOX, .young_Pa = j->contrast * j->young_Pa, .poisson = NAN, .density_kg_m3 = NAN};
        for (int c = 0; c < 3; c++) {
            const double at = c == 0 ? low[0] + 0.2 * (k + 0.5) * length : 0.5 * (low[c] + high[c]);
            lump->low_m[c] = at - 0.08 * length, lump->high_m[c] = at + 0.08 * length;
        }
    }
}

static pal_err make_scene(const job *j, pal_scene *scene, pal_diagnostic *diag)
{
    pal_scene_default(scene);
    scene->n_body = 1;
    scene->step_s = j->step_s;
    scene->threads = j->threads;
    pal_body_def *body = &scene->body[0];
    pal_body_default(body, "body", &j->mesh);
    body->material.young_Pa = j->young_Pa, body->material.poisson = 0.45;
    if (j->contrast > 0) add_lumps(body, j);
    body->output.name[0] = 0;
    body->n_effect = 0;
    pal_entry_init(&body->model, "model", "fem");
    pal_entry_init(&body->solver, "solver", j->solver);
    return pal_entry_put_text(&body->solver, !strcmp(j->solver, "static_newton") ? "linear" : "preconditioner", j->kind,
                              diag);
}

/* pulls the nodes around the highest one, share of E S^2 */
static pal_err pull(pal_world *world, const job *j, double share)
{
    pal_body *body = pal_world_body(world, 0);
    const double size = body->length_scale_m;
    int top = 0, n = 0;
    for (int i = 0; i < body->n_node; i++)
        if (body->x_rest[3 * i + 2] > body->x_rest[3 * top + 2]) top = i;
    for (int turn = 0; turn < 2; turn++)
        for (int i = 0; i < body->n_node; i++) {
            double d2 = 0;
            for (int c = 0; c < 3; c++) d2 += pow(body->x_rest[3 * i + c] - body->x_rest[3 * top + c], 2);
            if (d2 > 0.04 * size * size) continue;
            if (turn == 0)
                n++;
            else
                PAL_TRY(pal_world_load(world, 0, i, (double[]){share * j->young_Pa * size * size / n, 0, 0}));
        }
    body->load_cap_N = INFINITY;
    return PAL_ERR_OK;
}

static double largest_move_m(const pal_body *body)
{
    double max = 0;
    for (int i = 0; i < body->n_node; i++) {
        double d2 = 0;
        for (int c = 0; c < 3; c++) d2 += pow(body->x[3 * i + c] - body->x_rest[3 * i + c], 2);
        max = fmax(max, d2);
    }
    return sqrt(max);
}

static pal_err run_live(const job *j, pal_table *r, pal_diagnostic *diag)
{
    static double ms[STEPS_MAX];
    static pal_scene scene;
    pal_world *world = NULL;
    double mean_cg = 0, max_cg = 0, move_m = 0, began = pal_clock_s();
    pal_err err = make_scene(j, &scene, diag);
    if (!err) err = pal_world_create(&scene, diag, &world);
    if (err) return err;
    const double made = pal_clock_s();
    const pal_body *body = pal_world_body(world, 0);
    const int n = body->n_node > 10000 ? STEPS_MAX / 2 : STEPS_MAX, half = (int)lround(0.25 / j->step_s);
    for (int i = -1; i < n && !err; i++) {
        if (i >= 0 && i % half == 0) err = pull(world, j, i / half % 2 ? 0 : j->pull);
        double step_ms = 0;
        if (!err) err = bench_step(world, j->step_s, &step_ms);
        pal_solve_report report;
        if (err || i < 0) continue;
        pal_world_solve_report(world, 0, &report);
        ms[i] = step_ms, mean_cg += (double)report.n_cg / n, max_cg = fmax(max_cg, report.n_cg);
        move_m = fmax(move_m, largest_move_m(body));
    }
    if (!err) {
        const double p50_ms = pal_median(ms, n);
        TABLE_ROW(r, NUMBER("nodes", "nodes", 6, 0, body->n_node), TEXT("solver", "solver", -14, j->solver),
                  TEXT("preconditioner", "preconditioner", -14, j->kind),
                  NUMBER("threads", "threads", 7, 0, j->threads), NUMBER("young_Pa", "E Pa", 7, 0, j->young_Pa),
                  NUMBER("contrast", "contrast", 8, 0, fmax(1, j->contrast)),
                  NUMBER("make_s", "make s", 7, 3, made - began), NUMBER("p50_ms", "ms p50", 8, 3, p50_ms),
                  NUMBER("p95_ms", "ms p95", 8, 3, ms[n * 95 / 100]), NUMBER("cg_mean", "CG mean", 7, 1, mean_cg),
                  NUMBER("cg_max", "CG max", 6, 0, max_cg), NUMBER("move_mm", "moves mm", 8, 2, 1e3 * move_m));
    }
    pal_world_destroy(world);
    return err;
}

static pal_err run_static(const job *j, pal_table *r, pal_diagnostic *diag)
{
    static pal_scene scene;
    pal_world *world = NULL;
    double step_ms = 0, began = pal_clock_s();
    pal_err err = make_scene(j, &scene, diag);
    if (!err) err = pal_entry_put_number(&scene.body[0].solver, "tolerance", 1e-6, diag);
    if (!err) err = pal_entry_put_text(&scene.body[0].model, "law", "linear", diag);
    if (!err) err = pal_world_create(&scene, diag, &world);
    const double made = pal_clock_s();
    if (!err) err = pull(world, j, j->pull);
    if (!err) err = bench_step(world, j->step_s, &step_ms);
    if (!err) {
        const pal_body *body = pal_world_body(world, 0);
        pal_solve_report report;
        pal_world_solve_report(world, 0, &report);
        TABLE_ROW(r, NUMBER("nodes", "nodes", 6, 0, body->n_node), TEXT("linear", "linear", -14, j->kind),
                  NUMBER("make_s", "make s", 7, 3, made - began), NUMBER("solve_ms", "solve ms", 8, 1, step_ms),
                  NUMBER("cg", "CG", 5, 0, report.n_cg), NUMBER("residual", "residual", 10, 9, report.residual),
                  NUMBER("move_mm", "moves mm", 9, 4, 1e3 * largest_move_m(body)),
                  TEXT("converged", "converged", 9, report.converged ? "yes" : "no"));
    }
    pal_world_destroy(world);
    return err;
}

static pal_err run_hollow(const int size[4], pal_table *r, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    pal_err err = make_hollow(&surface);
    pal_table_note(r, "live, a hollow stomach, wall %g of its length:", WALL_SHARE);
    pal_table_list(r, "hollow");
    for (int s = 0; s < 4 && !err; s++) {
        job j = {.solver = "implicit_euler", .step_s = 1.0 / 60, .threads = 1, .pull = PULL_HOLLOW};
        err = make_body(&surface, size[s], &j.mesh, diag);
        for (int k = 0; k < 4 && !err; k++) {
            j.kind = k % 2 ? "multigrid" : "factor", j.young_Pa = k < 2 ? 5e3 : 1e5;
            err = run_live(&j, r, diag);
        }
        pal_prepared_free(&j.mesh);
    }
    pal_surface_free(&surface);
    return err;
}

pal_err bench_organ(pal_table *r, pal_diagnostic *diag)
{
    static const int size[] = {1300, 2700, 6900, 15770, 60000};
    static const char *const kind[] = {"factor", "jacobi", "multigrid", "multigrid"}, *const linear[] = {"multigrid",
                                                                                                         "incomplete",
                                                                                                         "direct"};
    const pal_mesh_file_options options = {.weld = 0};
    pal_surface surface = {0};
    pal_err err = r->argument ? pal_mesh_file_read(r->argument, &options, &surface, NULL, NULL, NULL, diag)
                              : pal_organ_make(50000, &surface);
    pal_table_list(r, "live");
    for (int s = 0; s < 5 && !err; s++) {
        job j = {.solver = "implicit_euler", .step_s = 1.0 / 60, .pull = PULL_SOLID};
        err = make_body(&surface, size[s], &j.mesh, diag);
        for (int k = 0; k < 8 && !err; k++) {
            j.kind = kind[k % 4], j.young_Pa = k < 4 ? 5e3 : 1e5, j.threads = k % 4 == 3 ? 2 : 1;
            if (k % 4 != 0 || j.mesh.tets.n_node < 10000) err = run_live(&j, r, diag);
        }
        pal_prepared_free(&j.mesh);
    }
    pal_table_note(r, "live, with stiff lumps:");
    pal_table_list(r, "contrast");
    for (int s = 1; s < 4 && !err; s++) {
        job j = {.solver = "implicit_euler", .step_s = 1.0 / 60, .young_Pa = 5e3, .threads = 1, .pull = PULL_SOLID};
        err = make_body(&surface, size[s], &j.mesh, diag);
        for (int k = 0; k < 6 && !err; k++) {
            j.kind = k % 2 ? "multigrid" : "factor", j.contrast = k < 2 ? 0 : k < 4 ? 1e2 : 1e4;
            if (k % 2 || j.mesh.tets.n_node < 5000) err = run_live(&j, r, diag);
        }
        pal_prepared_free(&j.mesh);
    }
    if (!err) err = run_hollow(size, r, diag);
    pal_table_note(r, "static, linear law, to 1e-6:");
    pal_table_list(r, "static");
    for (int s = 2; s < 5 && !err; s++) {
        job j = {.solver = "static_newton", .step_s = 1.0 / 60, .young_Pa = 1e5, .pull = PULL_SOLID};
        err = make_body(&surface, size[s], &j.mesh, diag);
        for (int k = 0; k < 3 && !err; k++) {
            j.kind = linear[k];
            if (k != 2 || j.mesh.tets.n_node < 20000) err = run_static(&j, r, diag);
        }
        pal_prepared_free(&j.mesh);
    }
    pal_surface_free(&surface);
    return err;
}
