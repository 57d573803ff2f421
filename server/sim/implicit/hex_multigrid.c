/* Multigrid of voxel hexahedra: the finest level. */
#include "server/sim/implicit/hex_multigrid.h"

#include "server/base/heap.h"
#include "server/mesh/volume/cell_hierarchy.h"
#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <string.h>

typedef float vec8 __attribute__((vector_size(32)));
typedef float vec8_memory __attribute__((vector_size(32), aligned(4), may_alias));

static inline vec8 load(const float *at)
{
    return *(const vec8_memory *)at;
}
static inline void store(float *at, vec8 a)
{
    *(vec8_memory *)at = a;
}

/* ---- load ---- */

pal_err pal_hex_grid_make(const pal_body *body, pal_arena *arena, pal_grid_hierarchy *out)
{
    const pal_hexes *hexes = body->hexes;
    const double h = body->tets->edge_m;
    double low[3] = {INFINITY, INFINITY, INFINITY};
    int32_t *place;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, place, 3 * (size_t)hexes->n_hex);
    if (err) return err;
    for (int i = 0; i < 3 * body->n_node; i++) low[i % 3] = fmin(low[i % 3], body->x_rest[i]);
    for (int e = 0; e < hexes->n_hex; e++)
        for (int c = 0; c < 3; c++)
            place[3 * e + c] = (int32_t)lround((body->x_rest[3 * hexes->node[8 * e] + c] - low[c]) / h);
    const pal_lattice_cells cells = {hexes->n_hex, body->n_node, hexes->node, place, body->support};
    err = pal_cell_hierarchy_make(&cells, PAL_COARSEST_NODES, arena, out);
    free(place);
    return err;
}

/* groups of slots with nodes */
static pal_err find_groups(pal_hex_multigrid *mg, pal_arena *arena)
{
    const pal_node_order *order = mg->body->node_order;
    uint8_t *used;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, used, mg->n_slot / PAL_LANES + 1);
    if (err) return err;
    for (int i = 0; i < order->n_node; i++) used[order->slot[i] / PAL_LANES] = 1;
    for (int g = 0; g <= mg->n_slot / PAL_LANES; g++) mg->n_group += used[g];
    mg->group = PAL_NEW(arena, int32_t, mg->n_group);
    for (int g = 0, n = 0; g <= mg->n_slot / PAL_LANES && mg->group; g++)
        if (used[g]) mg->group[n++] = PAL_LANES * g;
    free(used);
    return mg->group ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_hex_multigrid_make(const pal_body *body, const pal_elastic_hexes *cubes, const pal_grid_hierarchy *grid,
                               pal_arena *arena, pal_hex_multigrid *out)
{
    *out = (pal_hex_multigrid){.body = body, .cubes = cubes, .grid = grid, .n_slot = body->node_order->n_slot};
    const size_t n = (size_t)out->n_slot;
    PAL_TRY(pal_hex_single_make(cubes, body->node_order, arena, &out->single));
    PAL_TRY(find_groups(out, arena));
    out->weight = PAL_NEW(arena, float, n), out->inverse = PAL_NEW(arena, float, n);
    out->x = PAL_NEW(arena, float, 3 * n), out->b = PAL_NEW(arena, float, 3 * n), out->d = PAL_NEW(arena, float, 3 * n);
    out->r = PAL_NEW(arena, float, 3 * n), out->q = PAL_NEW(arena, float, 3 * n);
    if (!out->weight || !out->inverse || !out->x || !out->b || !out->d || !out->r || !out->q) return PAL_ERR_MEMORY;
    return pal_multigrid_create(grid, &out->coarse);
}

void pal_hex_multigrid_destroy(pal_hex_multigrid *mg)
{
    pal_multigrid_destroy(mg->coarse);
    mg->coarse = NULL;
}

/* ---- finest level ---- */

/* q = A p */
static void multiply(const pal_hex_multigrid *mg, const float *p, float *q)
{
    for (int g = 0; g < mg->n_group; g++) {
        const size_t at = (size_t)mg->group[g], n = (size_t)mg->n_slot;
        const vec8 weight = load(mg->weight + at);
        for (size_t i = at; i < 3 * n; i += n) store(q + i, weight * load(p + i));
    }
    pal_hex_single_multiply(&mg->single, p, q);
}

/* x = the smoother's answer, from 0 or from x */
static void smooth(const pal_hex_multigrid *mg, bool from_zero)
{
    const size_t n = (size_t)mg->n_slot;
    const float first = 4 / (3 * mg->lambda), weight = pal_chebyshev_weight[0];
    if (!from_zero) multiply(mg, mg->x, mg->q);
    for (int g = 0; g < mg->n_group; g++) {
        const size_t at = (size_t)mg->group[g];
        const vec8 inverse = first * load(mg->inverse + at);
        for (size_t i = at; i < 3 * n; i += n) {
            const vec8 r = from_zero ? load(mg->b + i) : load(mg->b + i) - load(mg->q + i), d = inverse * r;
            store(mg->r + i, r), store(mg->d + i, d);
            store(mg->x + i, from_zero ? weight * d : load(mg->x + i) + weight * d);
        }
    }
    for (int k = 1; k < PAL_CHEBYSHEV_DEGREE; k++) {
        const float keep = pal_chebyshev_keep(k), take = pal_chebyshev_take(k) / mg->lambda;
        multiply(mg, mg->d, mg->q);
        for (int g = 0; g < mg->n_group; g++) {
            const size_t at = (size_t)mg->group[g];
            const vec8 inverse = take * load(mg->inverse + at);
            for (size_t i = at; i < 3 * n; i += n) {
                const vec8 r = load(mg->r + i) - load(mg->q + i), d = keep * load(mg->d + i) + inverse * r;
                store(mg->r + i, r), store(mg->d + i, d);
                store(mg->x + i, load(mg->x + i) + pal_chebyshev_weight[k] * d);
            }
        }
    }
}

static void turn(const double *w, const float *v, bool back, float *to)
{
    for (int i = 0; i < 3; i++) {
        const double *a = back ? w + i : w + 3 * i;
        const int step = back ? 3 : 1;
        to[i] = (float)a[0] * v[0] + (float)a[step] * v[1] + (float)a[2 * step] * v[2];
    }
}

/* the coarse levels' part: x += W P A1^-1 P' W' (b - A x) */
static void correct(const pal_hex_multigrid *mg, const pal_warp *warp)
{
    const pal_grid_level *grid = &mg->grid->level[0];
    const int32_t *slot = mg->body->node_order->slot;
    const size_t n = (size_t)mg->n_slot;
    float *b = pal_multigrid_right_side(mg->coarse);
    multiply(mg, mg->x, mg->q);
    memset(b, 0, 4 * sizeof *b * (size_t)grid->n_node);
    for (int i = 0; i < mg->body->n_node; i++) {
        const int32_t *from = grid->from + grid->start[i];
        const int n_from = grid->start[i + 1] - grid->start[i];
        const float part = 1 / (float)n_from;
        if (n_from == 0) continue;
        float v[3];
        for (size_t c = 0, at = (size_t)slot[i]; c < 3; c++, at += n) v[c] = mg->b[at] - mg->q[at];
        if (warp->rotated) turn(warp->w + 9 * i, (float[]){v[0], v[1], v[2]}, true, v);
        for (int k = 0; k < n_from; k++)
            for (int c = 0; c < 3; c++) b[4 * from[k] + c] += part * v[c];
    }
    pal_multigrid_cycle(mg->coarse);
    const float *x = pal_multigrid_answer(mg->coarse);
    for (int i = 0; i < mg->body->n_node; i++) {
        const int32_t *from = grid->from + grid->start[i];
        const int n_from = grid->start[i + 1] - grid->start[i];
        if (n_from == 0) continue;
        float v[3] = {0, 0, 0};
        for (int k = 0; k < n_from; k++)
            for (int c = 0; c < 3; c++) v[c] += x[4 * from[k] + c];
        if (warp->rotated) turn(warp->w + 9 * i, (float[]){v[0], v[1], v[2]}, false, v);
        for (size_t c = 0, at = (size_t)slot[i]; c < 3; c++, at += n) mg->x[at] += v[c] / (float)n_from;
    }
}

void pal_hex_multigrid_solve(pal_hex_multigrid *mg, const pal_warp *warp, const double *r, double *z)
{
    const int32_t *slot = mg->body->node_order->slot;
    const size_t n = (size_t)mg->n_slot;
    double most = 0;
    for (int i = 0; i < 3 * mg->body->n_node; i++) most = fmax(most, fabs(r[i]));
    if (!(most > 0) || !isfinite(most)) {
        memset(z, 0, pal_body_bytes3(mg->body));
        return;
    }
    for (int i = 0; i < mg->body->n_node; i++)
        for (size_t c = 0; c < 3; c++) mg->b[(size_t)slot[i] + c * n] = (float)(r[3 * i + (int)c] / most);
    smooth(mg, true);
    correct(mg, warp);
    smooth(mg, false);
    for (int i = 0; i < mg->body->n_node; i++)
        for (size_t c = 0; c < 3; c++) z[3 * i + (int)c] = most * (double)mg->x[(size_t)slot[i] + c * n];
}

/* ---- values ---- */

/* the rotation of an element at the last linearise; false: none */
static bool rotation_of(const pal_elastic_hexes *cubes, int e, double r[9])
{
    const int lane = cubes->simd_blocks.place[e];
    const double *at = cubes->rotation + 9 * (lane / PAL_LANES) * PAL_LANES + lane % PAL_LANES;
    double trace = 0;
    for (int i = 0; i < 9; i++) r[i] = at[i * PAL_LANES];
    for (int i = 0; i < 9; i += 4) trace += r[i];
    return cubes->law != PAL_LAW_LINEAR && trace < 3;
}

/* k = R k R' */
static void turn_element(const double r[9], double k[24][24])
{
    for (int c = 0; c < 24; c += 3)
        for (int d = 0; d < 24; d += 3) {
            double part[3][3];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    part[i][j] =
                        r[3 * i] * k[c][d + j] + r[3 * i + 1] * k[c + 1][d + j] + r[3 * i + 2] * k[c + 2][d + j];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    k[c + i][d + j] = part[i][0] * r[3 * j] + part[i][1] * r[3 * j + 1] + part[i][2] * r[3 * j + 2];
        }
}

/* the first level's matrix, and D of the finest */
static void add_elements(pal_hex_multigrid *mg)
{
    const pal_grid_level *grid = &mg->grid->level[0];
    const pal_elastic_hexes *cubes = mg->cubes;
    const int32_t *slot = mg->body->node_order->slot;
    for (int g = 0; g < grid->n_cell; g++) {
        double sum[24][24] = {{0}};
        for (int32_t m = grid->first[g]; m < grid->first[g + 1]; m++) {
            const int e = grid->child[m];
            const int32_t *node = cubes->hexes->node + 8 * e;
            double k[24][24], r[9];
            unsigned fixed = 0;
            pal_hex_single_element(cubes, e, mg->stiff, k);
            for (int c = 0; c < 8; c++) {
                fixed |= mg->body->support[node[c]] ? 1u << c : 0;
                mg->inverse[slot[node[c]]] +=
                    (float)((k[3 * c][3 * c] + k[3 * c + 1][3 * c + 1] + k[3 * c + 2][3 * c + 2]) / 3);
            }
            if (rotation_of(cubes, e, r)) turn_element(r, k);
            pal_multigrid_coarsen_cell(k, grid->octant[e], fixed, sum);
        }
        pal_multigrid_add_cell(mg->coarse, g, sum);
    }
}

/* the norm sqrt(d' D d), in which D^-1 A is symmetric */
static double size_of(const pal_hex_multigrid *mg, const float *d)
{
    const int32_t *slot = mg->body->node_order->slot;
    double sum = 0;
    for (int i = 0; i < mg->body->n_node; i++)
        for (int c = 0; c < 3; c++) {
            const size_t at = (size_t)slot[i] + (size_t)c * (size_t)mg->n_slot;
            if (mg->inverse[slot[i]] > 0) sum += (double)(d[at] * d[at] / mg->inverse[slot[i]]);
        }
    return sqrt(sum);
}

/* largest eigenvalue of D^-1 A by power iteration */
static void find_lambda(pal_hex_multigrid *mg)
{
    const int32_t *slot = mg->body->node_order->slot;
    const size_t n = (size_t)mg->n_slot;
    for (int i = 0; i < mg->body->n_node; i++)
        for (size_t c = 0; c < 3; c++) {
            const size_t at = (size_t)slot[i] + c * n;
            mg->d[at] = mg->inverse[slot[i]] > 0 ? (float)((7 * i + 3 * (int)c) % 11 - 5) : 0;
        }
    double lambda = 1, size = size_of(mg, mg->d);
    for (int k = 0; k < PAL_POWER_ITERATIONS && size > 0 && isfinite(size); k++) {
        multiply(mg, mg->d, mg->q);
        for (int g = 0; g < mg->n_group; g++) {
            const size_t at = (size_t)mg->group[g];
            for (size_t i = at; i < 3 * n; i += n)
                store(mg->d + i, load(mg->q + i) * load(mg->inverse + at) * (float)(1 / size));
        }
        lambda = size = size_of(mg, mg->d);
    }
    mg->lambda = (float)(PAL_CHEBYSHEV_SAFE * lambda);
}

void pal_hex_multigrid_rotate(pal_hex_multigrid *mg)
{
    pal_hex_single_rotate(&mg->single);
}

pal_err pal_hex_multigrid_update(pal_hex_multigrid *mg, double mass, double stiff)
{
    const pal_body *body = mg->body;
    const int32_t *slot = body->node_order->slot;
    mg->mass = mass, mg->stiff = stiff;
    pal_hex_single_stiffen(&mg->single, stiff);
    pal_hex_single_rotate(&mg->single);
    pal_multigrid_zero(mg->coarse);
    memset(mg->inverse, 0, sizeof *mg->inverse * (size_t)mg->n_slot);
    add_elements(mg);
    for (int i = 0; i < body->n_node; i++) {
        float *inverse = &mg->inverse[slot[i]];
        mg->weight[slot[i]] = (float)(mass * body->mass_kg[i]);
        if (mass > 0) pal_multigrid_add_mass(mg->coarse, i, mass * body->mass_kg[i]);
        *inverse = !body->support[i] && *inverse + mg->weight[slot[i]] > 0 ? 1 / (*inverse + mg->weight[slot[i]]) : 0;
    }
    find_lambda(mg);
    return pal_multigrid_finish(mg->coarse);
}
