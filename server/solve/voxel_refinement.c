#include "server/solve/voxel_refinement.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_HEXAHEDRA = 20 * 1000 * 1000 };

/* lowest corner of hexahedron e, in voxels from low */
static void lattice_of(const pal_tets *tets, const pal_hexes *hexes, int e, const double low[3], double h, int at[3])
{
    const double *x = tets->x + 3 * (size_t)hexes->node[8 * (size_t)e];
    for (int c = 0; c < 3; c++) at[c] = (int)floor((x[c] - low[c]) / h + 0.5);
}

static size_t cell(const int n[3], int x, int y, int z)
{
    return (size_t)x + (size_t)n[0] * ((size_t)y + (size_t)n[1] * (size_t)z);
}

/* voxel lattice with an empty layer around it; weight [n2][n1][n0][8], 0 where there is no voxel */
static pal_err make_coarse(const pal_prepared *mesh, double low[3], int n[3], float **weight)
{
    const pal_tets *t = &mesh->tets;
    double high[3];
    pal_box3_empty(low, high);
    for (int i = 0; i < t->n_node; i++) pal_box3_add(low, high, t->x + 3 * (size_t)i);
    for (int c = 0; c < 3; c++) {
        n[c] = (int)floor((high[c] - low[c]) / t->edge_m + 0.5) + 2;
        low[c] -= t->edge_m;
    }
    *weight = calloc(8 * (size_t)n[0] * (size_t)n[1] * (size_t)n[2], sizeof **weight);
    if (!*weight) return PAL_ERR_MEMORY;
    for (int e = 0; e < mesh->hexes.n_hex; e++) {
        int at[3];
        lattice_of(t, &mesh->hexes, e, low, t->edge_m, at);
        float *to = *weight + 8 * cell(n, at[0], at[1], at[2]);
        for (int q = 0; q < 8; q++)
            to[q] = mesh->hexes.weight ? mesh->hexes.weight[8 * (size_t)e + (size_t)q] : mesh->hexes.fill[e] / 8;
    }
    return PAL_ERR_OK;
}

/* Weights of the fine voxel at `at`: each of its octants has the weight of the Gauss point of the octant of the coarse
 * voxel that it lies in. Returns the fill. */
static float fine_weights(const int n[3], const float *coarse, int split, const int at[3], float weight[8])
{
    const float *from = coarse + 8 * cell(n, at[0] / split, at[1] / split, at[2] / split);
    for (int q = 0; q < 8; q++) {
        int in = 0;
        for (int c = 0; c < 3; c++) in |= (2 * (at[c] % split) + (q >> c & 1) >= split) << c;
        weight[q] = from[in];
    }
    return pal_weight_sum(weight);
}

/* the fine grid, with voxels where the coarse one has something inside */
static pal_err make_fine(const pal_prepared *mesh, const double low[3], const int n[3], const float *coarse, int split,
                         pal_voxels *out)
{
    size_t n_cell = 1;
    float weight[8];
    *out = (pal_voxels){.edge_m = mesh->tets.edge_m / split};
    for (int c = 0; c < 3; c++) {
        out->n[c] = n[c] * split;
        out->low_m[c] = low[c];
        out->origin_m[c] = mesh->tets.origin_m[c];
        n_cell *= (size_t)out->n[c];
    }
    out->kind = calloc(n_cell, 1);
    if (!out->kind) return PAL_ERR_MEMORY;
    for (int z = 0; z < out->n[2]; z++)
        for (int y = 0; y < out->n[1]; y++)
            for (int x = 0; x < out->n[0]; x++)
                if (fine_weights(n, coarse, split, (int[3]){x, y, z}, weight) > 0)
                    out->kind[cell(out->n, x, y, z)] = 2, out->n_inside++;
    return PAL_ERR_OK;
}

pal_err pal_refine_voxels(pal_prepared *mesh, int split, pal_diagnostic *diag)
{
    double low[3];
    int n[3], n_hex = mesh->hexes.n_hex;
    float *coarse = NULL;
    pal_voxels fine = {0};
    pal_tets tets = {0};
    pal_hexes hexes = {0};
    if (n_hex == 0 || split < 1) return PAL_REFUSE(diag, "there are no voxels to split by %d", split);
    if ((double)n_hex * split * split * split > MAX_HEXAHEDRA)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%d voxels split by %d on each axis are more than %d", n_hex,
                                  split, MAX_HEXAHEDRA);
    pal_err err = make_coarse(mesh, low, n, &coarse);
    if (!err) err = make_fine(mesh, low, n, coarse, split, &fine);
    if (!err) err = pal_voxels_split(&fine, &tets);
    if (!err) err = pal_hexes_find(&tets, &hexes, diag);
    if (!err) PAL_ARRAY(&err, hexes.weight, 8 * (size_t)hexes.n_hex);
    for (int e = 0; e < hexes.n_hex && !err; e++) {
        int at[3];
        lattice_of(&tets, &hexes, e, low, fine.edge_m, at);
        hexes.fill[e] = fine_weights(n, coarse, split, at, hexes.weight + 8 * (size_t)e);
    }
    free(coarse);
    pal_voxels_free(&fine);
    if (err) {
        pal_tets_free(&tets);
        pal_hexes_free(&hexes);
        return pal_diagnostic_set(diag, err, "no memory to split %d voxels by %d", n_hex, split);
    }
    hexes.measured = mesh->hexes.measured;
    pal_tets_free(&mesh->tets);
    pal_hexes_free(&mesh->hexes);
    pal_skin_free(&mesh->skin);
    mesh->tets = tets;
    mesh->hexes = hexes;
    memset(&mesh->skin, 0, sizeof mesh->skin);
    return PAL_ERR_OK;
}
