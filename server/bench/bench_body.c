#include "server/bench/bench_body.h"

#include "server/base/clock.h"

#include <stdlib.h>
#include <string.h>

pal_err bench_box(const int n[3], double edge_m, pal_prepared *out, pal_diagnostic *diag)
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

pal_err bench_solid(const pal_cell_model *model, pal_cells *cells, pal_prepared *mesh, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    pal_err err = pal_cell_model_make(model, cells, diag);
    if (!err) err = pal_cells_boundary(cells, &surface, NULL, NULL);
    if (!err) err = pal_prepared_surface(&surface, mesh);
    pal_surface_free(&surface);
    return err;
}

pal_err bench_step(pal_world *world, double step_s, double *ms)
{
    uint64_t began = pal_clock_thread_ns();
    pal_err err = pal_world_step(world, step_s);
    *ms = 1e-6 * (double)(pal_clock_thread_ns() - began);
    return err;
}

double bench_component_ms(const pal_world *world, const char *stage, const char *name)
{
    double ms = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        if ((!stage || !strcmp(info.stage, stage)) && (!name || !strcmp(info.name, name)))
            ms += 1e-6 * (double)info.spent_ns;
    }
    return ms;
}
