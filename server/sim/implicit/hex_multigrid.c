/* Multigrid of voxel hexahedra: the finest level. */
#include "server/sim/implicit/hex_multigrid.h"

#include "server/base/heap.h"
#include "server/base/subnormals.h"
#include "server/mesh/volume/cell_hierarchy.h"
#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <string.h>

/* groups of slots, and nodes, of a piece of work of a thread: some five microseconds */
enum { GROUPS = 96, NODES = 512 };

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

static pal_err make_grid(const pal_body *body, pal_arena *arena, pal_grid_hierarchy *out)
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
static pal_err find_groups(pal_hex_levels *levels, pal_arena *arena)
{
    const pal_node_order *order = levels->body->node_order;
    uint8_t *used;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, used, levels->n_slot / PAL_LANES + 1);
    if (err) return err;
    for (int i = 0; i < order->n_node; i++) used[order->slot[i] / PAL_LANES] = 1;
    for (int g = 0; g <= levels->n_slot / PAL_LANES; g++) levels->n_group += used[g];
    levels->group = PAL_NEW(arena, int32_t, levels->n_group);
    for (int g = 0, n = 0; g <= levels->n_slot / PAL_LANES && levels->group; g++)
        if (used[g]) levels->group[n++] = PAL_LANES * g;
    free(used);
    return levels->group ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_hex_levels_make(const pal_body *body, const pal_elastic_hexes *cubes, pal_arena *arena, pal_hex_levels *out)
{
    const size_t n = (size_t)body->node_order->n_slot;
    *out = (pal_hex_levels){.body = body, .cubes = cubes, .n_slot = (int)n};
    PAL_TRY(make_grid(body, arena, &out->grid));
    if (out->grid.n_level == 0) return PAL_ERR_OK;
    PAL_TRY(pal_hex_single_make(cubes, body, arena, &out->single));
    PAL_TRY(find_groups(out, arena));
    out->x = PAL_NEW(arena, float, 3 * n), out->b = PAL_NEW(arena, float, 3 * n), out->d = PAL_NEW(arena, float, 3 * n);
    out->r = PAL_NEW(arena, float, 3 * n), out->q = PAL_NEW(arena, float, 3 * n);
    out->part = PAL_NEW(arena, float, 4 * (size_t)body->n_node);
    out->changed_cell = PAL_NEW(arena, uint8_t, out->grid.level[0].n_cell);
    out->changed_node = PAL_NEW(arena, uint8_t, body->n_node);
    return out->x && out->b && out->d && out->r && out->q && out->part && out->changed_cell && out->changed_node
               ? PAL_ERR_OK
               : PAL_ERR_MEMORY;
}

pal_err pal_hex_multigrid_make(pal_hex_levels *levels, bool refreshed, pal_arena *arena, pal_hex_multigrid *out)
{
    const size_t n = (size_t)levels->n_slot, n_lane = PAL_LANES * (size_t)levels->cubes->n_block;
    *out = (pal_hex_multigrid){.levels = levels};
    for (int k = 0; k < (refreshed ? 2 : 1); k++) {
        pal_hex_values *values = k == 0 ? &out->now : &out->next;
        values->weight = PAL_NEW(arena, float, n), values->inverse = PAL_NEW(arena, float, n);
        if (!values->weight || !values->inverse) return PAL_ERR_MEMORY;
    }
    if (levels->single.rotation && refreshed) {
        out->turned = PAL_NEW(arena, float, 9 * n_lane);
        if (!out->turned) return PAL_ERR_MEMORY;
    }
    PAL_TRY(pal_multigrid_create(&levels->grid, &out->now.coarse));
    pal_spare_thread_init(&out->spare_thread);
    return PAL_ERR_OK;
}

void pal_hex_multigrid_destroy(pal_hex_multigrid *mg)
{
    if (!mg->now.coarse) return;
    pal_spare_thread_destroy(&mg->spare_thread);
    pal_multigrid_destroy(mg->now.coarse);
    pal_multigrid_destroy(mg->next.coarse);
    pal_stiff_nodes_destroy(&mg->now.stiff_nodes), pal_stiff_nodes_destroy(&mg->next.stiff_nodes);
    mg->now.coarse = mg->next.coarse = NULL;
}

/* ---- finest level ---- */

/* q = A p, where q is weight p already */
static void multiply(const pal_hex_multigrid *mg, const float *p)
{
    pal_hex_single_multiply(&mg->levels->single, mg->levels->body->team, (float)mg->now.stiff, p, mg->levels->q);
}

/* q = weight p */
static void weigh(const pal_hex_multigrid *mg, const float *p)
{
    const size_t n = (size_t)mg->levels->n_slot;
    for (int g = 0; g < mg->levels->n_group; g++)
        for (size_t at = (size_t)mg->levels->group[g], i = at; i < 3 * n; i += n)
            store(mg->levels->q + i, load(mg->now.weight + at) * load(p + i));
}

/* one step of the smoother on a piece of the groups of slots: r, d, x, and q = weight times what is multiplied next */
typedef struct pass {
    const pal_hex_multigrid *mg;
    enum { FROM_ZERO, FROM_X, STEP } what;
    bool last;
    float keep, take, weight;
} pass;

static void pass_groups(void *user, int worker, int index)
{
    const pass *p = user;
    const pal_hex_multigrid *mg = p->mg;
    const size_t n = (size_t)mg->levels->n_slot;
    const int first = index * GROUPS, end = first + GROUPS < mg->levels->n_group ? first + GROUPS : mg->levels->n_group;
    (void)worker;
    for (int g = first; g < end; g++) {
        const size_t at = (size_t)mg->levels->group[g];
        const vec8 take = p->take * load(mg->now.inverse + at), weight = load(mg->now.weight + at);
        for (size_t i = at; i < 3 * n; i += n) {
            vec8 r = load((p->what == STEP ? mg->levels->r : mg->levels->b) + i), x = {0};
            if (p->what != FROM_ZERO) r -= load(mg->levels->q + i), x = load(mg->levels->x + i);
            vec8 d = take * r;
            if (p->what == STEP) d += p->keep * load(mg->levels->d + i);
            x += p->weight * d;
            store(mg->levels->r + i, r), store(mg->levels->d + i, d), store(mg->levels->x + i, x);
            store(mg->levels->q + i, weight * (p->last ? x : d));
        }
    }
}

static void run_pass(pass *p)
{
    const pal_hex_multigrid *mg = p->mg;
    pal_team_run(mg->levels->body->team, (mg->levels->n_group + GROUPS - 1) / GROUPS, pass_groups, p);
}

/* x = the smoother's answer, from 0 or from x, with q = weight x before and after */
static void smooth(const pal_hex_multigrid *mg, const pal_chebyshev *smoother, bool from_zero)
{
    if (!from_zero) multiply(mg, mg->levels->x);
    run_pass(&(pass){.mg = mg,
                     .what = from_zero ? FROM_ZERO : FROM_X,
                     .take = 4 / (3 * mg->now.lambda),
                     .weight = smoother->weight[0]});
    for (int k = 1; k < smoother->degree; k++) {
        multiply(mg, mg->levels->d);
        run_pass(&(pass){.mg = mg,
                         .what = STEP,
                         .last = k == smoother->degree - 1,
                         .keep = pal_chebyshev_keep(k),
                         .take = pal_chebyshev_take(k) / mg->now.lambda,
                         .weight = smoother->weight[k]});
    }
}

static void turn(const float *w, const float *v, bool back, float *to)
{
    for (int i = 0; i < 3; i++) {
        const float *a = back ? w + i : w + 3 * i;
        const int step = back ? 3 : 1;
        to[i] = a[0] * v[0] + a[step] * v[1] + a[2 * step] * v[2];
    }
}

/* the way between nodes and slots */
typedef struct transfer {
    void (*piece)(const struct transfer *t, int first, int end); /* of the nodes */
    const pal_hex_multigrid *mg;
    const pal_warp *warp;
    const double *in;
    double *out, scale;
    const float *coarse; /* answer of the first coarser level */
} transfer;

/* b = scale in */
static void take_nodes(const transfer *t, int first, int end)
{
    const int32_t *slot = t->mg->levels->body->node_order->slot;
    const size_t n = (size_t)t->mg->levels->n_slot;
    float *restrict b = t->mg->levels->b;
    for (int i = first; i < end; i++) {
        const double *in = t->in + 3 * i;
        float *at = b + slot[i];
        at[0] = (float)(t->scale * in[0]), at[n] = (float)(t->scale * in[1]), at[2 * n] = (float)(t->scale * in[2]);
    }
}

/* out = scale x */
static void give_nodes(const transfer *t, int first, int end)
{
    const int32_t *slot = t->mg->levels->body->node_order->slot;
    const size_t n = (size_t)t->mg->levels->n_slot;
    const float *x = t->mg->levels->x;
    for (int i = first; i < end; i++) {
        const float *at = x + slot[i];
        double *restrict out = t->out + 3 * i;
        out[0] = t->scale * (double)at[0], out[1] = t->scale * (double)at[n], out[2] = t->scale * (double)at[2 * n];
    }
}

/* part [n_node][4] = what the residual b - A x at the node is to each node that it is interpolated from */
static void restrict_nodes(const transfer *t, int first, int end)
{
    const pal_hex_levels *levels = t->mg->levels;
    const int32_t *slot = levels->body->node_order->slot, *start = levels->grid.level[0].start;
    const size_t n = (size_t)levels->n_slot;
    const float *b = levels->b, *q = levels->q;
    for (int i = first; i < end; i++) {
        if (start[i] == start[i + 1]) continue;
        const float share = 1 / (float)(start[i + 1] - start[i]);
        float v[3], *restrict to = levels->part + 4 * i;
        for (size_t c = 0, at = (size_t)slot[i]; c < 3; c++, at += n) v[c] = share * (b[at] - q[at]);
        if (t->warp->rotated)
            turn(t->warp->w + 9 * i, v, true, to);
        else
            memcpy(to, v, sizeof v);
    }
}

/* x += the mean of the coarse answer, turned; q = weight x */
static void prolong_nodes(const transfer *t, int first, int end)
{
    const pal_hex_levels *levels = t->mg->levels;
    const pal_grid_level *grid = &levels->grid.level[0];
    const int32_t *slot = levels->body->node_order->slot, *start = grid->start;
    const size_t n = (size_t)levels->n_slot;
    float *restrict x = levels->x, *restrict q = levels->q;
    for (int i = first; i < end; i++) {
        const int n_from = start[i + 1] - start[i];
        const float weight = t->mg->now.weight[slot[i]];
        float v[3] = {0, 0, 0}, turned[3];
        if (n_from == 0) continue;
        for (int k = start[i]; k < start[i + 1]; k++)
            for (int c = 0; c < 3; c++) v[c] += t->coarse[4 * grid->from[k] + c];
        if (t->warp->rotated)
            turn(t->warp->w + 9 * i, v, false, turned);
        else
            memcpy(turned, v, sizeof v);
        for (size_t c = 0, at = (size_t)slot[i]; c < 3; c++, at += n) {
            x[at] += turned[c] / (float)n_from;
            q[at] = weight * x[at];
        }
    }
}

static void transfer_piece(void *user, int worker, int index)
{
    const transfer *t = user;
    const int n_node = t->mg->levels->body->n_node, first = index * NODES;
    (void)worker;
    t->piece(t, first, first + NODES < n_node ? first + NODES : n_node);
}

static void run_transfer(transfer *t)
{
    const pal_body *body = t->mg->levels->body;
    pal_team_run(body->team, (body->n_node + NODES - 1) / NODES, transfer_piece, t);
}

/* x += W S' (S A S')^-1 S W' (b - A x) */
static void correct_stiff(pal_hex_multigrid *mg, const pal_warp *warp)
{
    pal_hex_levels *levels = mg->levels;
    if (mg->now.stiff_nodes.n == 0) return;
    multiply(mg, levels->x);
    pal_stiff_nodes_correct(&mg->now.stiff_nodes, levels->body, warp, levels->n_slot, levels->b, levels->q, levels->x);
    weigh(mg, levels->x);
}

/* the coarse levels' part: x += W P A1^-1 P' W' (b - A x); of a sawtooth x and q are 0 */
static void correct(pal_hex_multigrid *mg, pal_cycle cycle, const pal_warp *warp)
{
    transfer t = {.piece = restrict_nodes, .mg = mg, .warp = warp};
    if (cycle == PAL_CYCLE_V) multiply(mg, mg->levels->x);
    run_transfer(&t);
    t.coarse = pal_multigrid_solve(mg->now.coarse, cycle, mg->levels->part, mg->levels->body->team);
    t.piece = prolong_nodes;
    run_transfer(&t);
}

void pal_hex_multigrid_solve(pal_hex_multigrid *mg, pal_cycle cycle, const pal_warp *warp, const double *r, double *z)
{
    /* stiff nodes are to be corrected before the coarse levels and after them */
    if (mg->now.stiff_nodes.n > 0) cycle = PAL_CYCLE_V;
    const pal_chebyshev *smoother = pal_cycle_smoother(cycle);
    double largest = 0;
    for (int i = 0; i < 3 * mg->levels->body->n_node; i++) largest = fabs(r[i]) > largest ? fabs(r[i]) : largest;
    if (!(largest > 0) || !isfinite(largest)) {
        memset(z, 0, pal_body_bytes3(mg->levels->body));
        return;
    }
    const unsigned mode = pal_subnormals_flush();
    run_transfer(&(transfer){.piece = take_nodes, .mg = mg, .in = r, .scale = 1 / largest});
    if (cycle == PAL_CYCLE_V) {
        smooth(mg, smoother, true);
    } else {
        memset(mg->levels->x, 0, sizeof(float) * 3 * (size_t)mg->levels->n_slot);
        memset(mg->levels->q, 0, sizeof(float) * 3 * (size_t)mg->levels->n_slot);
    }
    correct_stiff(mg, warp);
    correct(mg, cycle, warp);
    correct_stiff(mg, warp);
    smooth(mg, smoother, false);
    run_transfer(&(transfer){.piece = give_nodes, .mg = mg, .out = z, .scale = largest});
    pal_subnormals_restore(mode);
}

/* ---- values ---- */

static void mark_all(const pal_hex_levels *levels)
{
    memset(levels->changed_cell, 1, (size_t)levels->grid.level[0].n_cell);
    memset(levels->changed_node, 1, (size_t)levels->body->n_node);
}

/* cells with an element that has been edited since, and the nodes of such elements; returns their number */
static int mark_edited(const pal_hex_levels *levels, uint32_t n_edit)
{
    const pal_grid_level *grid = &levels->grid.level[0];
    int n = 0;
    memset(levels->changed_cell, 0, (size_t)grid->n_cell);
    memset(levels->changed_node, 0, (size_t)levels->body->n_node);
    for (int g = 0; g < grid->n_cell; g++)
        for (int32_t m = grid->first[g]; m < grid->first[g + 1]; m++) {
            const int32_t e = grid->child[m], *node = levels->body->hexes->node + 8 * (size_t)e;
            if (levels->cubes->edited[e] <= n_edit) continue;
            levels->changed_cell[g] = 1, n++;
            for (int c = 0; c < 8; c++) levels->changed_node[node[c]] = 1;
        }
    return n;
}

/* values of the coarser levels, of the rotations given */
static pal_err fill_levels(const pal_hex_levels *levels, const float *rotation, pal_hex_values *to)
{
    const pal_grid_level *grid = &levels->grid.level[0];
    const pal_body *body = levels->body;
    pal_multigrid_begin(to->coarse, levels->changed_cell);
    for (int g = 0; g < grid->n_cell; g++) {
        double sum[24][24] = {{0}}, k[24][24];
        if (!pal_multigrid_wants(to->coarse, g)) continue;
        for (int32_t m = grid->first[g]; m < grid->first[g + 1]; m++) {
            const int e = grid->child[m];
            unsigned fixed = 0;
            for (int c = 0; c < 8; c++) fixed |= body->support[body->hexes->node[8 * e + c]] ? 1u << c : 0;
            pal_hex_single_element(&levels->single, rotation, e, to->stiff, k);
            pal_multigrid_coarsen_cell(k, grid->octant[e], fixed, sum);
        }
        pal_multigrid_add_cell(to->coarse, g, sum);
    }
    for (int i = 0; i < body->n_node; i++)
        pal_multigrid_add_mass(to->coarse, i, (double)to->weight[body->node_order->slot[i]]);
    PAL_TRY(pal_multigrid_finish(to->coarse));
    return pal_stiff_nodes_update(&to->stiff_nodes, body, &levels->single, rotation, to->weight, to->stiff,
                                  levels->changed_node);
}

/* masses of the finest level, which an edit may change while a spare thread makes the rest; true: they are others */
static bool fill_weights(const pal_hex_levels *levels, pal_hex_values *to)
{
    const pal_body *body = levels->body;
    bool others = false;
    for (int i = 0; i < body->n_node; i++) {
        float *weight = &to->weight[body->node_order->slot[i]];
        const float now = (float)(to->mass * body->mass_kg[i]);
        others = others || *weight != now;
        *weight = now;
    }
    return others;
}

/* D of the finest level at the nodes that are marked */
static void fill_diagonal(const pal_hex_levels *levels, pal_hex_values *to)
{
    const uint8_t *node = levels->changed_node;
    const pal_body *body = levels->body;
    const pal_hexes *hexes = body->hexes;
    const int32_t *slot = body->node_order->slot;
    for (int i = 0; i < body->n_node; i++)
        if (node[i]) to->inverse[slot[i]] = 0;
    for (int e = 0; e < hexes->n_hex; e++) {
        const int32_t *corner = hexes->node + 8 * (size_t)e;
        double k[24][24];
        bool marked = false;
        for (int c = 0; c < 8; c++) marked = marked || node[corner[c]];
        if (marked) pal_hex_single_element(&levels->single, NULL, e, to->stiff, k);
        for (int c = 0; c < 8 && marked; c++)
            if (node[corner[c]])
                to->inverse[slot[corner[c]]] +=
                    (float)((k[3 * c][3 * c] + k[3 * c + 1][3 * c + 1] + k[3 * c + 2][3 * c + 2]) / 3);
    }
    for (int i = 0; i < body->n_node; i++) {
        if (!node[i]) continue;
        float *inverse = &to->inverse[slot[i]];
        const float weight = to->weight[slot[i]];
        *inverse = !body->support[i] && *inverse + weight > 0 ? 1 / (*inverse + weight) : 0;
    }
}

/* the norm sqrt(d' D d), in which D^-1 A is symmetric */
static double size_of(void *self)
{
    const pal_hex_multigrid *mg = self;
    const int32_t *slot = mg->levels->body->node_order->slot;
    double sum = 0;
    for (int i = 0; i < mg->levels->body->n_node; i++)
        for (int c = 0; c < 3; c++) {
            const float d = mg->levels->d[(size_t)slot[i] + (size_t)c * (size_t)mg->levels->n_slot];
            const float inverse = mg->now.inverse[slot[i]];
            if (inverse > 0) sum += (double)(d * d / inverse);
        }
    return sqrt(sum);
}

/* d = scale D^-1 A d */
static void apply(void *self, float scale)
{
    const pal_hex_multigrid *mg = self;
    const size_t n = (size_t)mg->levels->n_slot;
    float *d = mg->levels->d, *q = mg->levels->q;
    weigh(mg, d);
    multiply(mg, d);
    for (int g = 0; g < mg->levels->n_group; g++)
        for (size_t at = (size_t)mg->levels->group[g], i = at; i < 3 * n; i += n)
            store(d + i, load(q + i) * load(mg->now.inverse + at) * scale);
}

/* of the elements as they are without recovery, whose regions are softer, and end */
static void find_lambda(pal_hex_multigrid *mg)
{
    const int32_t *slot = mg->levels->body->node_order->slot;
    pal_elastic_hexes_single *single = &mg->levels->single;
    float *const acting = single->acting;
    const size_t n = (size_t)mg->levels->n_slot;
    memset(mg->levels->d, 0, 3 * sizeof *mg->levels->d * n);
    for (int i = 0; i < mg->levels->body->n_node; i++)
        for (size_t c = 0; c < 3 && mg->now.inverse[slot[i]] > 0; c++)
            mg->levels->d[(size_t)slot[i] + c * n] = pal_chebyshev_start(i, (int)c);
    single->acting = single->stiff;
    mg->now.lambda = pal_chebyshev_lambda(size_of, apply, mg);
    single->acting = acting;
}

double pal_hex_multigrid_rotate(pal_hex_multigrid *mg)
{
    return pal_hex_single_rotate(&mg->levels->single, mg->levels->body->team);
}

pal_err pal_hex_multigrid_update(pal_hex_multigrid *mg, double mass, double stiff)
{
    pal_hex_levels *levels = mg->levels;
    pal_hex_values *now = &mg->now;
    pal_spare_thread_wait(&mg->spare_thread);
    pal_hex_single_stiffen(&levels->single);
    (void)pal_hex_single_rotate(&levels->single, levels->body->team);
    const bool rest = pal_hex_single_rests(&levels->single),
               same = now->mass == mass && now->stiff == stiff && now->rest && rest;
    now->mass = mass, now->stiff = stiff;
    if (fill_weights(levels, now) || !same)
        mark_all(levels);
    else if (mark_edited(levels, now->n_edit) == 0)
        return PAL_ERR_OK;
    now->n_edit = levels->cubes->n_edit;
    fill_diagonal(levels, now);
    find_lambda(mg);
    pal_err err = fill_levels(levels, levels->single.rotation, now);
    now->rest = rest && !err;
    return err;
}

static void make_next(void *self)
{
    pal_hex_multigrid *mg = self;
    pal_hex_values *next = &mg->next;
    mg->outcome = next->coarse ? PAL_ERR_OK : pal_multigrid_create(&mg->levels->grid, &next->coarse);
    if (mg->outcome) return;
    next->rest = false;
    mark_all(mg->levels);
    fill_diagonal(mg->levels, next);
    mg->outcome = fill_levels(mg->levels, mg->turned, next);
}

pal_err pal_hex_multigrid_refresh(pal_hex_multigrid *mg, double mass, double stiff)
{
    const pal_elastic_hexes *cubes = mg->levels->cubes;
    mg->next.mass = mass, mg->next.stiff = stiff;
    (void)fill_weights(mg->levels, &mg->next);
    for (int i = 0; i < 9 * PAL_LANES * cubes->n_block && mg->turned; i++) mg->turned[i] = (float)cubes->rotation[i];
    return pal_spare_thread_run(&mg->spare_thread, make_next, mg);
}

pal_err pal_hex_multigrid_adopt(pal_hex_multigrid *mg)
{
    pal_spare_thread_wait(&mg->spare_thread);
    if (mg->outcome) return mg->outcome;
    const pal_hex_values before = mg->now;
    mg->now = mg->next, mg->next = before;
    mg->now.lambda = before.lambda;
    /* rotations do not change it */
    if (mg->now.mass != before.mass || mg->now.stiff != before.stiff) find_lambda(mg);
    return PAL_ERR_OK;
}

double pal_hex_multigrid_stiffest(const pal_hex_multigrid *mg)
{
    const pal_body *body = mg->levels->body;
    double max = 0;
    for (int i = 0; i < body->n_node; i++) {
        const double inverse = (double)mg->now.inverse[body->node_order->slot[i]];
        if (inverse > 0 && body->mass_kg[i] > 0) max = fmax(max, 1 / (inverse * body->mass_kg[i]));
    }
    return max;
}

double pal_hex_multigrid_flops(const pal_hex_multigrid *mg)
{
    const pal_stiff_nodes *stiff = &mg->now.stiff_nodes;
    /* an element's 36 blocks turned and interpolated; the coarser levels add a third */
    return 1e4 * mg->levels->cubes->n_hex + (stiff->n > 0 ? pal_cholesky_flops(stiff->factor) : 0);
}
