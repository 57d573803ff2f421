/* `palpate bench edit`: a live edit of the material of a part of a finite-element organ. Its voxels between a plane
 * and its end along x have the body's E, which the edit changes back and forth; the others have their own by a region.
 * The organ is held at its lowest 12 % and sinks under its weight; it takes one step between two edits. Medians: the
 * processor's time of the edit, and of the step that follows, for parts from one element to all of them; with a tool,
 * whose contact wants levels of the stiffness alone as well, and without. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/mesh/geometry/procedural.h"
#include "server/num/median.h"

#include <math.h>
#include <stdlib.h>

/* an organ of 14,000 nodes */
enum { RESOLUTION = 42, EDITS = 24 };

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* the plane beyond which a share of the voxels has its corners; *n_part: how many */
static pal_err find_plane(const pal_prepared *mesh, double share, double *plane_m, int *n_part)
{
    const int n = mesh->hexes.n_hex;
    double *x = malloc(sizeof *x * (size_t)n);
    if (!x) return PAL_ERR_MEMORY;
    for (int e = 0; e < n; e++) x[e] = mesh->tets.x[3 * (size_t)mesh->hexes.node[8 * (size_t)e]];
    qsort(x, (size_t)n, sizeof *x, compare);
    const int first = share < 1 ? (int)fmin(n - 1, n * (1 - share)) : 0;
    /* voxels lie in layers: a whole layer or none */
    *plane_m = x[first] - 0.25 * mesh->tets.edge_m;
    for (*n_part = 0; *n_part < n && x[n - 1 - *n_part] > *plane_m;) ++*n_part;
    free(x);
    return PAL_ERR_OK;
}

static pal_err make_scene(const pal_prepared *mesh, double plane_m, bool tool, pal_scene *scene, pal_diagnostic *diag)
{
    pal_scene_default(scene);
    scene->n_body = 1;
    scene->step_s = 1.0 / 60;
    scene->n_tool = tool;
    if (tool) scene->tool[0] = (pal_tool_def){.radius_m = 0.01, .force_cap_N = 10};
    pal_body_def *body = &scene->body[0];
    pal_body_default(body, "body", mesh);
    body->material.young_Pa = 2e4, body->material.poisson = 0.45;
    /* the region is taken at the middle of an element */
    const double high_m = plane_m + 0.5 * mesh->tets.edge_m;
    body->region[body->n_region++] = (pal_region){.kind = PAL_REGION_BOX,
                                                  .young_Pa = 2e4,
                                                  .poisson = NAN,
                                                  .density_kg_m3 = NAN,
                                                  .low_m = {-1, -1, -1},
                                                  .high_m = {high_m, 1, 1}};
    if (!tool) body->output.name[0] = 0;
    body->n_effect = 0;
    pal_entry_init(&body->effect[body->n_effect++], "effect", "gravity");
    if (tool) pal_entry_init(&body->effect[body->n_effect++], "effect", "tool_push");
    pal_entry_init(&body->model, "model", "fem");
    pal_entry_init(&body->solver, "solver", "implicit_euler");
    return pal_entry_put_text(&body->solver, "preconditioner", "multigrid", diag);
}

static pal_err measure(const pal_prepared *mesh, double share, bool tool, pal_table *r, pal_diagnostic *diag)
{
    static pal_scene scene;
    double edit_ms[EDITS], step_ms[EDITS], plane_m;
    int n_part;
    pal_world *world = NULL;
    PAL_TRY(find_plane(mesh, share, &plane_m, &n_part));
    pal_err err = make_scene(mesh, plane_m, tool, &scene, diag);
    if (!err) err = pal_world_create(&scene, diag, &world);
    if (err) return err;
    pal_material material = scene.body[0].material;
    for (int k = 0; k < EDITS && !err; k++) {
        material.young_Pa = k % 2 ? 2e4 : 2.4e4;
        const uint64_t began = pal_clock_thread_ns();
        err = pal_world_material(world, 0, &material, diag);
        edit_ms[k] = 1e-6 * (double)(pal_clock_thread_ns() - began);
        if (!err) err = bench_step(world, scene.step_s, &step_ms[k]);
    }
    if (!err)
        TABLE_ROW(r, NUMBER("nodes", "nodes", 6, 0, pal_world_view_body(world, 0)->n_node),
                  TEXT("tool", "tool", -4, tool ? "yes" : "no"), NUMBER("edited", "edited", 6, 0, n_part),
                  NUMBER("percent", "percent", 7, 1, 100.0 * n_part / mesh->hexes.n_hex),
                  NUMBER("edit_ms", "edit ms", 8, 2, pal_median(edit_ms, EDITS)),
                  NUMBER("step_ms", "step ms", 8, 2, pal_median(step_ms, EDITS)));
    pal_world_destroy(world);
    return err;
}

pal_err bench_edit(pal_table *r, pal_diagnostic *diag)
{
    static const double share[] = {0, 0.01, 0.1, 0.5, 1};
    pal_surface surface = {0};
    pal_prepared mesh = {0};
    pal_prepare_report report;
    const pal_voxel_options options = {.resolution = RESOLUTION, .border = true};
    pal_err err = pal_organ_make(50000, &surface);
    if (!err) err = pal_prepared_make(&surface, &options, &mesh, &report, diag);
    pal_table_list(r, "edits");
    for (int k = 0; k < 10 && !err; k++) err = measure(&mesh, share[k % 5], k >= 5, r, diag);
    pal_prepared_free(&mesh);
    pal_surface_free(&surface);
    return err;
}
