/* Voxels of twice the edge, by way of a grid. */
#include "server/mesh/volume/voxel_coarsening.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

/* the coarse lattice and the inside of its cells */
typedef struct grid {
    pal_voxels voxels; /* kind is set last    */
    size_t n_cell;
    double *weight; /* of the Gauss points of a cell, from its eight voxels [n2][n1][n0][8] */
} grid;

/* the cell at x; side: bits of the axes along which x lies in its upper half, may be NULL */
static size_t cell(const grid *g, const double *x, size_t *side)
{
    const pal_voxels *v = &g->voxels;
    size_t at[3], in = 0;
    for (int c = 0; c < 3; c++) {
        const double place = (x[c] - v->low_m[c]) / v->edge_m;
        at[c] = (size_t)floor(place);
        in |= (size_t)(place - floor(place) > 0.5) << c;
    }
    if (side) *side = in;
    return at[0] + (size_t)v->n[0] * (at[1] + (size_t)v->n[1] * at[2]);
}

static void middle(const pal_tets *tets, const pal_hexes *hexes, int e, double x[3])
{
    const double *corner = tets->x + 3 * (size_t)hexes->node[8 * (size_t)e];
    for (int c = 0; c < 3; c++) x[c] = corner[c] + 0.5 * tets->edge_m;
}

/* Adds the integrals of the cell's shape functions (voxel_fraction.h) over one of its voxels, whose own weights
 * integrate them */
static void add_voxel(const pal_hexes *hexes, int e, size_t side, double to[8])
{
    double weight[8];
    pal_hexes_weights(hexes, e, 1e-6, weight);
    for (size_t q = 0; q < 8; q++)
        for (size_t p = 0; p < 8; p++) {
            double shape = weight[p] / 8;
            for (int c = 0; c < 3; c++) {
                /* the point in the cell, -1..1 */
                const double x = (side >> c & 1 ? 0.5 : -0.5) + (p >> c & 1 ? 0.5 : -0.5) / sqrt(3);
                shape *= (1 + (q >> c & 1 ? sqrt(3) : -sqrt(3)) * x) / 2;
            }
            to[q] += shape;
        }
}

static double fill_of(const double weight[8])
{
    double sum = 0;
    for (int q = 0; q < 8; q++) sum += weight[q];
    return sum;
}

static pal_err make_grid(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], grid *g)
{
    pal_voxels *v = &g->voxels;
    double high[3], h = tets->edge_m;
    pal_err err = PAL_ERR_OK;
    pal_box3_empty(v->low_m, high);
    for (size_t i = 0; i < (size_t)tets->n_node; i++) pal_box3_add(v->low_m, high, tets->x + 3 * i);
    v->edge_m = 2 * h;
    g->n_cell = 1;
    for (int c = 0; c < 3; c++) {
        v->origin_m[c] = tets->origin_m[c];
        v->low_m[c] -= shift[c] ? h : 0;
        v->n[c] = (int)ceil((high[c] - v->low_m[c]) / v->edge_m - 1e-6);
        g->n_cell *= (size_t)v->n[c];
    }
    PAL_ZEROED(&err, g->weight, 8 * g->n_cell);
    PAL_ZEROED(&err, v->kind, g->n_cell);
    for (int e = 0; e < hexes->n_hex && !err; e++) {
        double x[3];
        size_t side, at;
        middle(tets, hexes, e, x);
        at = cell(g, x, &side);
        add_voxel(hexes, e, side, g->weight + 8 * at);
    }
    return err;
}

/* the voxels, without those of too little fill */
static void keep_voxels(grid *g, double min_fill)
{
    double all = 0, gone = 0;
    for (size_t i = 0; i < g->n_cell; i++) {
        const double fill = fill_of(g->weight + 8 * i);
        all += fill;
        if (fill < min_fill) gone += fill;
    }
    if (gone > COARSE_MAX_LOSS * all) min_fill = 0;
    for (size_t i = 0; i < g->n_cell; i++) {
        const double fill = fill_of(g->weight + 8 * i);
        if (fill > 0 && !(fill < min_fill)) g->voxels.kind[i] = 2, g->voxels.n_inside++;
    }
}

pal_err pal_voxels_coarsen(const pal_tets *tets, const pal_hexes *hexes, const int shift[3], double min_fill,
                           pal_prepared *out, pal_diagnostic *diag)
{
    grid g = {.weight = NULL};
    pal_prepared p = {0};
    if (hexes->n_hex == 0) return PAL_REFUSE(diag, "there are no voxels to make larger");
    pal_err err = make_grid(tets, hexes, shift, &g);
    if (!err) {
        keep_voxels(&g, min_fill);
        err = pal_voxels_split(&g.voxels, &p.tets);
    }
    if (!err) err = pal_hexes_find(&p.tets, &p.hexes, diag);
    if (!err) PAL_ARRAY(&err, p.hexes.weight, 8 * (size_t)p.hexes.n_hex);
    for (int e = 0; e < p.hexes.n_hex && !err; e++) {
        double x[3];
        middle(&p.tets, &p.hexes, e, x);
        pal_hexes_set_weights(&p.hexes, e, g.weight + 8 * cell(&g, x, NULL));
    }
    free(g.weight);
    pal_voxels_free(&g.voxels);
    p.hexes.measured = true;
    if (err) {
        pal_prepared_free(&p);
        return pal_diagnostic_set(diag, err, "no memory for voxels of twice the edge");
    }
    *out = p;
    return PAL_ERR_OK;
}
