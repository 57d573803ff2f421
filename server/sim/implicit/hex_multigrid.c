/* Multigrid of voxel hexahedra: the finest level. */
#include "server/sim/implicit/hex_multigrid.h"

#include "server/base/heap.h"
#include "server/mesh/volume/cell_hierarchy.h"
#include "server/num/subnormals.h"
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
    if (out->single.rotation) {
        out->turned = PAL_NEW(arena, float, 9 * PAL_LANES * (size_t)cubes->n_block);
        if (!out->turned) return PAL_ERR_MEMORY;
    }
    PAL_TRY(find_groups(out, arena));
    out->weight = PAL_NEW(arena, float, n), out->inverse = PAL_NEW(arena, float, n);
    out->x = PAL_NEW(arena, float, 3 * n), out->b = PAL_NEW(arena, float, 3 * n), out->d = PAL_NEW(arena, float, 3 * n);
    out->r = PAL_NEW(arena, float, 3 * n), out->q = PAL_NEW(arena, float, 3 * n);
    if (!out->weight || !out->inverse || !out->x || !out->b || !out->d || !out->r || !out->q) return PAL_ERR_MEMORY;
    PAL_TRY(pal_multigrid_create(grid, &out->coarse));
    pal_spare_thread_init(&out->spare_thread);
    return PAL_ERR_OK;
}

void pal_hex_multigrid_destroy(pal_hex_multigrid *mg)
{
    if (!mg->coarse) return;
    pal_spare_thread_destroy(&mg->spare_thread);
    pal_multigrid_destroy(mg->coarse);
    pal_multigrid_destroy(mg->next);
    mg->coarse = mg->next = NULL;
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
    double largest = 0;
    for (int i = 0; i < 3 * mg->body->n_node; i++) largest = fmax(largest, fabs(r[i]));
    if (!(largest > 0) || !isfinite(largest)) {
        memset(z, 0, pal_body_bytes3(mg->body));
        return;
    }
    const unsigned mode = pal_subnormals_flush();
    for (int i = 0; i < mg->body->n_node; i++)
        for (size_t c = 0; c < 3; c++) mg->b[(size_t)slot[i] + c * n] = (float)(r[3 * i + (int)c] / largest);
    smooth(mg, true);
    correct(mg, warp);
    smooth(mg, false);
    for (int i = 0; i < mg->body->n_node; i++)
        for (size_t c = 0; c < 3; c++) z[3 * i + (int)c] = largest * (double)mg->x[(size_t)slot[i] + c * n];
    pal_subnormals_restore(mode);
}

/* ---- values ---- */

/* values of the coarser levels, of the rotations given */
static pal_err fill_levels(const pal_hex_multigrid *mg, const float *rotation, pal_multigrid *to)
{
    const pal_grid_level *grid = &mg->grid->level[0];
    const pal_body *body = mg->body;
    pal_multigrid_zero(to);
    for (int g = 0; g < grid->n_cell; g++) {
        double sum[24][24] = {{0}}, k[24][24];
        for (int32_t m = grid->first[g]; m < grid->first[g + 1]; m++) {
            const int e = grid->child[m];
            unsigned fixed = 0;
            for (int c = 0; c < 8; c++) fixed |= body->support[body->hexes->node[8 * e + c]] ? 1u << c : 0;
            pal_hex_single_element(&mg->single, rotation, e, k);
            pal_multigrid_coarsen_cell(k, grid->octant[e], fixed, sum);
        }
        pal_multigrid_add_cell(to, g, sum);
    }
    for (int i = 0; i < body->n_node; i++) pal_multigrid_add_mass(to, i, (double)mg->weight[body->node_order->slot[i]]);
    return pal_multigrid_finish(to);
}

/* masses and D of the finest level */
static void fill_diagonal(pal_hex_multigrid *mg, double mass)
{
    const pal_body *body = mg->body;
    const pal_hexes *hexes = body->hexes;
    const int32_t *slot = body->node_order->slot;
    double k[24][24];
    memset(mg->inverse, 0, sizeof *mg->inverse * (size_t)mg->n_slot);
    for (int e = 0; e < hexes->n_hex; e++) {
        pal_hex_single_element(&mg->single, NULL, e, k);
        for (int c = 0; c < 24; c += 3)
            mg->inverse[slot[hexes->node[8 * e + c / 3]]] += (float)((k[c][c] + k[c + 1][c + 1] + k[c + 2][c + 2]) / 3);
    }
    for (int i = 0; i < body->n_node; i++) {
        float *inverse = &mg->inverse[slot[i]], weight = (float)(mass * body->mass_kg[i]);
        mg->weight[slot[i]] = weight;
        *inverse = !body->support[i] && *inverse + weight > 0 ? 1 / (*inverse + weight) : 0;
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
    pal_spare_thread_wait(&mg->spare_thread);
    pal_hex_single_stiffen(&mg->single, stiff);
    pal_hex_single_rotate(&mg->single);
    fill_diagonal(mg, mass);
    find_lambda(mg);
    return fill_levels(mg, mg->single.rotation, mg->coarse);
}

static void make_next(void *self)
{
    pal_hex_multigrid *mg = self;
    mg->outcome = mg->next ? PAL_ERR_OK : pal_multigrid_create(mg->grid, &mg->next);
    if (!mg->outcome) mg->outcome = fill_levels(mg, mg->turned, mg->next);
}

pal_err pal_hex_multigrid_refresh(pal_hex_multigrid *mg)
{
    const pal_elastic_hexes *cubes = mg->cubes;
    for (int i = 0; i < 9 * PAL_LANES * cubes->n_block && mg->turned; i++) mg->turned[i] = (float)cubes->rotation[i];
    return pal_spare_thread_run(&mg->spare_thread, make_next, mg);
}

pal_err pal_hex_multigrid_adopt(pal_hex_multigrid *mg)
{
    pal_spare_thread_wait(&mg->spare_thread);
    if (mg->outcome) return mg->outcome;
    pal_multigrid *before = mg->coarse;
    mg->coarse = mg->next, mg->next = before;
    return PAL_ERR_OK;
}

double pal_hex_multigrid_flops(const pal_hex_multigrid *mg)
{
    /* an element's 36 blocks turned and interpolated; the coarser levels add a third */
    return 1e4 * mg->cubes->n_hex;
}
