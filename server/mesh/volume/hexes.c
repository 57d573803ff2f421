/* Voxel hexahedra found in a tetrahedral mesh, and their fill.
 *
 * Tetrahedra in the order of the splitter are recognised by its two patterns. Any other order is recognised by
 * position: five consecutive tetrahedra are a cube when they have eight nodes in all, which lie at the corners of a
 * cube of edge edge_m along the axes, and when their volumes, each positive, sum to that of the cube. */
#include "server/mesh/volume/hexes.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/voxel/voxel_bits.h"
#include "server/mesh/voxel/voxel_fraction.h"

/* relative to edge_m: error of node positions from single precision in a file, at some hundred voxels across */
#define AWAY 1e-4
/* a voxel that lacks less is whole: rounding */
#define WHOLE 1e-6

void pal_hexes_free(pal_hexes *hexes)
{
    PAL_FREE(hexes->node, hexes->fill, hexes->weight);
    memset(hexes, 0, sizeof *hexes);
}

double pal_hexes_weights(const pal_hexes *hexes, int e, double min_fill, double weight[8])
{
    const double fill = (double)hexes->fill[e], more = fmax(0, min_fill - fill) / 8;
    for (int q = 0; q < 8; q++)
        weight[q] = (hexes->weight ? (double)hexes->weight[8 * (size_t)e + (size_t)q] : fill / 8) + more;
    return fmax(fill, min_fill);
}

/* The nearest point of a cube on a plane of constant sum: all are shifted by the same, then clipped. The sum grows with
 * the shift, which bisection finds */
void pal_hexes_set_weights(pal_hexes *hexes, int e, const double weight[8])
{
    float *to = hexes->weight + 8 * (size_t)e;
    double min_weight = weight[0], max_weight = weight[0], wanted = 0, shift = 0;
    for (int q = 0; q < 8; q++)
        wanted += weight[q], min_weight = fmin(min_weight, weight[q]), max_weight = fmax(max_weight, weight[q]);
    double low = -max_weight, high = 0.125 - min_weight;
    if (wanted > 1 - WHOLE) low = shift = high;
    for (int k = 0; k < 40 && (min_weight < 0 || max_weight > 0.125); k++) {
        double sum = 0;
        shift = (low + high) / 2;
        for (int q = 0; q < 8; q++) sum += fmin(fmax(weight[q] + shift, 0), 0.125);
        if (sum < wanted)
            low = shift;
        else
            high = shift;
    }
    for (int q = 0; q < 8; q++) to[q] = (float)fmin(fmax(weight[q] + shift, 0), 0.125);
    hexes->fill[e] = pal_weight_sum(to);
}

/* The corners when the five are in the order of the splitter and the voxel is a cube: then their volumes are right. The
 * last tetrahedron distinguishes the two patterns. */
static bool read_pattern(const pal_tets *tets, const int32_t *five, int32_t node[8])
{
    /* positions of the corners among the twenty */
    static const uint8_t FIRST[2][8] = {{0, 1, 2, 4, 3, 8, 12, 7}, {2, 0, 4, 1, 8, 3, 7, 12}};
    int parity = five[16] == five[2];
    const uint8_t *corner = pal_voxel_tets[parity][0];
    double h = tets->edge_m, away = AWAY * h;
    int32_t differ = 0;
    int n_away = 0;
    for (int c = 0; c < 8; c++) node[c] = five[FIRST[parity][c]];
    for (int i = 0; i < 20; i++) differ |= node[corner[i]] ^ five[i];
    if (differ) return false;
    const double *low = tets->x + 3 * (size_t)node[0];
    for (int c = 1; c < 8; c++) {
        const double *x = tets->x + 3 * (size_t)node[c];
        n_away += !(fabs(x[0] - low[0] - (c & 1 ? h : 0)) < away) + !(fabs(x[1] - low[1] - (c & 2 ? h : 0)) < away) +
                  !(fabs(x[2] - low[2] - (c & 4 ? h : 0)) < away);
    }
    return n_away == 0;
}

/* corner bits of each node from its position in the box of the twenty corners; false when one is at no corner */
static bool find_corners(const pal_tets *tets, const int32_t *five, int32_t node[8])
{
    double low[3], high[3], h = tets->edge_m;
    pal_box3_empty(low, high);
    for (int i = 0; i < 20; i++) pal_box3_add(low, high, tets->x + 3 * (size_t)five[i]);
    for (int c = 0; c < 8; c++) node[c] = -1;
    for (int i = 0; i < 20; i++) {
        int corner = 0;
        for (int k = 0; k < 3; k++) {
            double along = (tets->x[3 * (size_t)five[i] + (size_t)k] - low[k]) / h;
            if (!(fabs(along) < AWAY || fabs(along - 1) < AWAY)) return false;
            corner |= (along > 0.5) << k;
        }
        if (node[corner] >= 0 && node[corner] != five[i]) return false;
        node[corner] = five[i];
    }
    for (int c = 0; c < 8; c++)
        if (node[c] < 0) return false;
    double sum = 0;
    for (int t = 0; t < 5; t++) {
        double volume = pal_tet_volume(tets->x, five + 4 * t);
        if (!(volume > 0)) return false;
        sum += volume;
    }
    return fabs(sum - h * h * h) <= 10 * AWAY * h * h * h;
}

pal_err pal_hexes_find(const pal_tets *tets, pal_hexes *out, pal_diagnostic *diag)
{
    if (tets->n_tet == 0 || tets->n_tet % 5 || !(tets->edge_m > 0))
        return PAL_REFUSE(diag, "%d tetrahedra are no voxels of five each", tets->n_tet);
    pal_hexes hexes = {.n_hex = tets->n_tet / 5};
    hexes.node = pal_voxels_array((size_t)hexes.n_hex * 8 * sizeof *hexes.node);
    hexes.fill = pal_voxels_array((size_t)hexes.n_hex * sizeof *hexes.fill);
    if (!hexes.node || !hexes.fill) {
        pal_hexes_free(&hexes);
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "out of memory for %d voxels", tets->n_tet / 5);
    }
    for (size_t e = 0; e < (size_t)hexes.n_hex; e++) {
        hexes.fill[e] = 1;
        const int32_t *five = tets->tet + 20 * e;
        if (read_pattern(tets, five, hexes.node + 8 * e) || find_corners(tets, five, hexes.node + 8 * e)) continue;
        pal_hexes_free(&hexes);
        return PAL_REFUSE(diag, "tetrahedra %zu to %zu do not fill a voxel of %g m", 5 * e, 5 * e + 4, tets->edge_m);
    }
    *out = hexes;
    return PAL_ERR_OK;
}

/* the lattice around the voxels, one voxel wider on every side; low relative to the surface's origin */
static pal_err find_grid(const pal_hexes *hexes, const pal_tets *tets, const pal_surface *surface, pal_voxels *grid,
                         pal_diagnostic *diag)
{
    double low[3], high[3], h = tets->edge_m;
    pal_box3_empty(low, high);
    for (size_t i = 0; i < 8 * (size_t)hexes->n_hex; i++) pal_box3_add(low, high, tets->x + 3 * (size_t)hexes->node[i]);
    grid->edge_m = h;
    for (int k = 0; k < 3; k++) {
        double n = (high[k] - low[k]) / h;
        if (!(n < 2000)) return PAL_REFUSE(diag, "the mesh is %.0f voxels across", n);
        grid->n[k] = (int)(n + 0.5) + 2;
        grid->low_m[k] = low[k] - h + tets->origin_m[k] - surface->origin_m[k];
    }
    return PAL_ERR_OK;
}

typedef struct filler {
    const pal_voxels *grid;
    int64_t *place; /* hexahedra by layer: index in its layer, and number [n_hex][2] */
    int *start;     /* of each layer [n2+2]                                          */
    pal_hexes *hexes;
} filler;

static void set_layer(void *self, int z, const double *weight)
{
    const filler *f = self;
    for (int i = f->start[z]; i < f->start[z + 1]; i++) {
        const int64_t *place = f->place + 2 * (size_t)i;
        pal_hexes_set_weights(f->hexes, (int)place[1], weight + 8 * place[0]);
    }
}

/* distributes the hexahedra to the layers of the grid */
static void deal_layers(filler *f, const pal_hexes *hexes, const pal_tets *tets, const double shift[3])
{
    const pal_voxels *g = f->grid;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t e = 0; e < (size_t)hexes->n_hex; e++) {
            int at[3];
            for (int k = 0; k < 3; k++) {
                double x = tets->x[3 * (size_t)hexes->node[8 * e] + (size_t)k] + shift[k];
                at[k] = (int)((x - g->low_m[k]) / g->edge_m + 0.5);
            }
            if (pass == 0) {
                f->start[at[2] + 2]++;
                continue;
            }
            int64_t *to = f->place + 2 * (size_t)f->start[at[2] + 1]++;
            to[0] = at[0] + (int64_t)g->n[0] * at[1], to[1] = (int64_t)e;
        }
        for (int z = 0; pass == 0 && z < g->n[2]; z++) f->start[z + 2] += f->start[z + 1];
    }
}

pal_err pal_hexes_fill(pal_hexes *hexes, const pal_tets *tets, const pal_surface *surface, pal_diagnostic *diag)
{
    pal_voxels grid = {0};
    if (hexes->n_hex == 0) return PAL_ERR_OK;
    PAL_TRY(find_grid(hexes, tets, surface, &grid, diag));
    pal_hexes filled = *hexes;
    filler f = {.grid = &grid, .hexes = &filled};
    pal_err err = PAL_ERR_OK;
    filled.fill = filled.weight = NULL;
    PAL_ARRAY(&err, filled.fill, (size_t)hexes->n_hex);
    PAL_ARRAY(&err, filled.weight, 8 * (size_t)hexes->n_hex);
    PAL_ARRAY(&err, f.place, 2 * (size_t)hexes->n_hex);
    PAL_ZEROED(&err, f.start, grid.n[2] + 2);
    if (!err) {
        double shift[3];
        pal_sub3(shift, tets->origin_m, surface->origin_m);
        deal_layers(&f, hexes, tets, shift);
        err = pal_voxels_fraction(surface, &grid, true, set_layer, &f, diag);
    }
    PAL_FREE(f.place, f.start);
    if (err) {
        PAL_FREE(filled.fill, filled.weight);
    } else {
        PAL_FREE(hexes->fill, hexes->weight);
        hexes->fill = filled.fill, hexes->weight = filled.weight, hexes->measured = true;
    }
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "out of memory for the fill of %d voxels", hexes->n_hex);
    return err;
}
