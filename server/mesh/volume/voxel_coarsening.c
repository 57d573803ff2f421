/* Voxels of twice the edge, by way of a grid. */
#include "server/mesh/volume/voxel_coarsening.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

#include <stdlib.h>
#include <string.h>

typedef struct grid {
    int n[3];
    double low[3]; /* corner of cell 0 0 0 */
    double edge_m; /* edge of a coarse cell */
    float *fill;   /* [n2][n1][n0]         */
} grid;

static size_t cell(const grid *g, const double *x)
{
    size_t at[3];
    for (int c = 0; c < 3; c++) at[c] = (size_t)floor((x[c] - g->low[c]) / g->edge_m);
    return at[0] + (size_t)g->n[0] * (at[1] + (size_t)g->n[1] * at[2]);
}

/* middle of hexahedron e */
static void middle(const pal_tets *tets, const pal_hexes *hexes, int e, double x[3])
{
    const double *corner = tets->x + 3 * (size_t)hexes->node[8 * (size_t)e];
    for (int c = 0; c < 3; c++) x[c] = corner[c] + 0.5 * tets->edge_m;
}

static pal_err make_grid(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], grid *g)
{
    double high[3], h = tets->edge_m;
    pal_box3_empty(g->low, high);
    for (size_t i = 0; i < (size_t)tets->n_node; i++) pal_box3_add(g->low, high, tets->x + 3 * i);
    g->edge_m = 2 * h;
    size_t n_cell = 1;
    for (int c = 0; c < 3; c++) {
        g->low[c] -= shift[c] ? h : 0;
        g->n[c] = (int)ceil((high[c] - g->low[c]) / g->edge_m - 1e-6);
        n_cell *= (size_t)g->n[c];
    }
    g->fill = calloc(n_cell, sizeof *g->fill);
    if (!g->fill) return PAL_ERR_MEMORY;
    for (int e = 0; e < hexes->n_hex; e++) {
        double x[3];
        middle(tets, hexes, e, x);
        g->fill[cell(g, x)] += fmaxf(hexes->fill[e], 1e-6f) / 8;
    }
    return PAL_ERR_OK;
}

static void drop(grid *g, double min_fill)
{
    size_t n_cell = (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
    double all = 0, gone = 0;
    for (size_t i = 0; i < n_cell; i++) {
        all += (double)g->fill[i];
        if ((double)g->fill[i] < min_fill) gone += (double)g->fill[i];
    }
    for (size_t i = 0; i < n_cell && gone <= COARSE_MAX_LOSS * all; i++)
        if ((double)g->fill[i] < min_fill) g->fill[i] = 0;
}

static pal_err split(const grid *g, const pal_tets *fine, pal_prepared *out, pal_diagnostic *diag)
{
    size_t n_cell = (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
    pal_voxels voxels = {.edge_m = g->edge_m};
    memcpy(voxels.n, g->n, sizeof voxels.n);
    memcpy(voxels.low_m, g->low, sizeof voxels.low_m);
    memcpy(voxels.origin_m, fine->origin_m, sizeof voxels.origin_m);
    voxels.kind = calloc(n_cell, 1);
    if (!voxels.kind) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < n_cell; i++)
        if (g->fill[i] > 0) voxels.kind[i] = 2, voxels.n_inside++;
    pal_err err = pal_voxels_split(&voxels, &out->tets);
    pal_voxels_free(&voxels);
    if (!err) err = pal_hexes_find(&out->tets, &out->hexes, diag);
    return err;
}

pal_err pal_voxels_coarsen(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], double min_fill,
                           pal_prepared *out, pal_diagnostic *diag)
{
    grid g = {.fill = NULL};
    pal_prepared p = {0};
    if (hexes->n_hex == 0) return PAL_REFUSE(diag, "there are no voxels to make larger");
    pal_err err = make_grid(tets, hexes, shift, &g);
    if (!err) drop(&g, min_fill);
    if (!err) err = split(&g, tets, &p, diag);
    for (int e = 0; e < p.hexes.n_hex && !err; e++) {
        double x[3];
        middle(&p.tets, &p.hexes, e, x);
        p.hexes.fill[e] = fminf(g.fill[cell(&g, x)], 1);
    }
    free(g.fill);
    p.hexes.measured = true;
    if (err) {
        pal_prepared_free(&p);
        return pal_diagnostic_set(diag, err, "no memory for voxels of twice the edge");
    }
    *out = p;
    return PAL_ERR_OK;
}
