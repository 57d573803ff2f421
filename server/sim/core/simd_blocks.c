/* Order of nodes, strips and loose blocks. */
#include "server/sim/core/simd_blocks.h"

#include "server/base/vec3.h"
#include "server/sim/core/tuning.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* a strip with fewer elements costs more than a loose block */
enum { MIN_LANES = 2, TILE = 128 };

typedef struct lattice {
    double low[3];
    int n[3], axis[3];    /* nodes along x, y, z; axes from the longest to the shortest */
    int half[3], n_class; /* half of the nodes along each sorted axis; their product  */
} lattice;

/* false: the nodes form no lattice of edge h, or a nearly empty one */
static bool find_lattice(const double *x, int n_node, double edge_m, lattice *to)
{
    double high[3];
    pal_box3_empty(to->low, high);
    for (int i = 0; i < n_node; i++) pal_box3_add(to->low, high, x + 3 * (size_t)i);
    double n_finest = 1;
    for (int c = 0; c < 3; c++) {
        double n = floor((high[c] - to->low[c]) / edge_m + 1.5);
        if (!(n >= 1 && n < 1e5)) return false;
        to->n[c] = (int)n;
        n_finest *= n + 1;
    }
    if (n_finest > 16.0 * n_node + 1000) return false;
    for (int i = 0; i < 3 * n_node; i++) {
        double g = (x[i] - to->low[i % 3]) / edge_m;
        if (fabs(g - floor(g + 0.5)) > 1e-3) return false;
    }
    for (int c = 0; c < 3; c++) to->axis[c] = c;
    for (int c = 0; c < 3; c++)
        for (int d = c + 1; d < 3; d++)
            if (to->n[to->axis[d]] > to->n[to->axis[c]]) {
                int swap = to->axis[c];
                to->axis[c] = to->axis[d];
                to->axis[d] = swap;
            }
    for (int c = 0; c < 3; c++) to->half[c] = (to->n[to->axis[c]] + 1) / 2;
    to->n_class = to->half[0] * to->half[1] * to->half[2];
    return true;
}

static int slot_of(const lattice *l, const double *x, double edge_m)
{
    int g[3];
    for (int c = 0; c < 3; c++) g[c] = (int)floor((x[l->axis[c]] - l->low[l->axis[c]]) / edge_m + 0.5);
    int class = (g[0] & 1) + 2 * (g[1] & 1) + 4 * (g[2] & 1);
    return class * l->n_class + (g[2] / 2 * l->half[1] + g[1] / 2) * l->half[0] + g[0] / 2;
}

pal_err pal_node_order_make(const double *x_rest, int n_node, double edge_m, pal_arena *arena, pal_node_order **out)
{
    lattice l;
    pal_node_order *s = PAL_NEW(arena, pal_node_order, 1);
    int32_t *slot = PAL_NEW(arena, int32_t, n_node);
    if (!s || !slot) return PAL_ERR_MEMORY;
    bool regular = find_lattice(x_rest, n_node, edge_m, &l);
    int n_slot = 0;
    for (int i = 0; i < n_node; i++) {
        slot[i] = regular ? slot_of(&l, x_rest + 3 * i, edge_m) : i;
        if (slot[i] >= n_slot) n_slot = slot[i] + 1;
    }
    /* lanes without a constraint may reach beyond the last slot */
    n_slot = (n_slot + 2 * PAL_LANES - 1) & ~(PAL_LANES - 1);
    *s = (pal_node_order){.n_node = n_node, .n_slot = n_slot, .slot = slot};
    if (!PAL_NEW_DOUBLES(arena, 3 * (size_t)n_slot, &s->x, &s->f)) return PAL_ERR_MEMORY;
    *out = s;
    return PAL_ERR_OK;
}

/* a constraint on its way into a block */
typedef struct entry {
    int32_t slot[PAL_SIMD_CORNERS_MAX], item;
} entry;

static int compare_shape(const entry *a, const entry *b)
{
    for (int c = 1; c < PAL_SIMD_CORNERS_MAX; c++) {
        int32_t da = a->slot[c] - a->slot[0], db = b->slot[c] - b->slot[0];
        if (da != db) return da < db ? -1 : 1;
    }
    return 0;
}

static int compare_entries(const void *pa, const void *pb)
{
    const entry *a = pa, *b = pb;
    int tile_a = a->slot[0] / TILE, tile_b = b->slot[0] / TILE;
    if (tile_a != tile_b) return tile_a < tile_b ? -1 : 1;
    int shape = compare_shape(a, b);
    if (shape != 0) return shape;
    if (a->slot[0] != b->slot[0]) return a->slot[0] < b->slot[0] ? -1 : 1;
    return a->item < b->item ? -1 : a->item > b->item;
}

/* how many entries from e on fit a strip that begins with it */
static int strip_length(const entry *e, const entry *end)
{
    int n = 1;
    while (e + n < end && compare_shape(e, e + n) == 0 && e[n].slot[0] > e[n - 1].slot[0] &&
           e[n].slot[0] - e[0].slot[0] < PAL_LANES)
        n++;
    return n;
}

/* entries in order: strips are numbered and placed, the rest is counted; with out->base, out->node filled too */
static void place_all(const entry *first, int n_item, pal_simd_blocks *out)
{
    const entry *end = first + n_item;
    int n_strip = 0, n_loose = 0;
    for (const entry *e = first; e < end;) {
        int n = strip_length(e, end);
        bool strip = n >= MIN_LANES;
        for (int i = 0; i < n; i++) {
            if (strip) {
                out->place[e[i].item] = PAL_LANES * n_strip + e[i].slot[0] - e->slot[0];
                continue;
            }
            int lane = n_loose % PAL_LANES, block = n_loose / PAL_LANES;
            out->place[e[i].item] = PAL_LANES * out->n_strip + n_loose++;
            for (int c = 0; c < out->n_corner && out->node; c++)
                out->node[(block * out->n_corner + c) * PAL_LANES + lane] = e[i].slot[c];
        }
        for (int c = 0; c < out->n_corner && strip && out->base; c++)
            out->base[n_strip * out->n_corner + c] = e->slot[c];
        n_strip += strip;
        e += n;
    }
    out->n_strip = n_strip;
    out->n_loose = (n_loose + PAL_LANES - 1) / PAL_LANES;
    out->n_lane = PAL_LANES * (out->n_strip + out->n_loose);
}

/* insertion sort of a few nodes by slot */
static void sort_corners(const int32_t *slot, int32_t *node, int n)
{
    for (int i = 1; i < n; i++)
        for (int j = i; j > 0 && slot[node[j]] < slot[node[j - 1]]; j--) {
            int32_t swap = node[j];
            node[j] = node[j - 1];
            node[j - 1] = swap;
        }
}

pal_err pal_simd_blocks_make_ordered(const pal_node_order *node_order, const int32_t *item, int n_item, int n_corner,
                                     pal_arena *arena, pal_simd_blocks *out)
{
    *out = (pal_simd_blocks){.n_corner = n_corner};
    out->place = PAL_NEW(arena, int32_t, n_item);
    entry *e = calloc((size_t)n_item + 1, sizeof *e);
    if (!out->place || !e) {
        free(e);
        return PAL_ERR_MEMORY;
    }
    for (int i = 0; i < n_item; i++) {
        e[i].item = i;
        for (int c = 0; c < PAL_SIMD_CORNERS_MAX; c++)
            e[i].slot[c] = node_order->slot[item[n_corner * i + (c < n_corner ? c : 0)]];
    }
    qsort(e, (size_t)n_item, sizeof *e, compare_entries);
    /* once to count, once to fill */
    place_all(e, n_item, out);
    out->base = PAL_NEW(arena, int32_t, out->n_strip * n_corner);
    out->node = PAL_NEW(arena, int32_t, out->n_loose * n_corner * PAL_LANES);
    if (out->base && out->node) place_all(e, n_item, out);
    free(e);
    return out->base && out->node ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_simd_blocks_make(const pal_node_order *node_order, int32_t *item, int n_item, int n_corner,
                             pal_arena *arena, pal_simd_blocks *out)
{
    for (int i = 0; i < n_item; i++) sort_corners(node_order->slot, item + n_corner * i, n_corner);
    return pal_simd_blocks_make_ordered(node_order, item, n_item, n_corner, arena, out);
}

/* nodes of a piece of work of a thread: some five microseconds */
enum { NODES = 2048 };

typedef struct node_pass {
    pal_node_order *order;
    const double *x;
    double *force; /* NULL: x is loaded */
} node_pass;

/* position of node i to its slot */
PAL_INLINE void load_single(const pal_node_order *order, int i, const double *x)
{
    float *to = order->single_x + order->slot[i];
    const double per_m = 1 / order->unit_m;
    for (int d = 0; d < 3; d++) to[d * order->n_slot] = (float)(per_m * (x[3 * i + d] - order->origin_m[d]));
}
/* force [n_node][3] += the force at node i, which is zero afterwards */
PAL_INLINE void take_single(const pal_node_order *order, int i, double *force)
{
    float *from = order->single_f + order->slot[i];
    for (int d = 0; d < 3; d++) {
        force[3 * i + d] += order->unit_N * (double)from[d * order->n_slot];
        from[d * order->n_slot] = 0;
    }
}

static void pass_nodes(void *user, int worker, int index)
{
    const node_pass *pass = user;
    const pal_node_order *order = pass->order;
    double *at = pass->force ? order->f : order->x;
    const int first = index * NODES, end = first + NODES < order->n_node ? first + NODES : order->n_node;
    (void)worker;
    for (int i = first; i < end && order->single; i++) {
        if (pass->force)
            take_single(order, i, pass->force);
        else
            load_single(order, i, pass->x);
    }
    for (int i = first; i < end && !order->single; i++) {
        double *x = at + order->slot[i], *y = x + order->n_slot, *z = y + order->n_slot;
        if (pass->force) {
            pass->force[3 * i] += *x, pass->force[3 * i + 1] += *y, pass->force[3 * i + 2] += *z;
            *x = *y = *z = 0;
        } else {
            *x = pass->x[3 * i], *y = pass->x[3 * i + 1], *z = pass->x[3 * i + 2];
        }
    }
}

static void run_nodes(node_pass *pass)
{
    pal_team_run(pass->order->team, (pass->order->n_node + NODES - 1) / NODES, pass_nodes, pass);
}

void pal_node_order_load(pal_node_order *node_order, const double *x)
{
    run_nodes(&(node_pass){.order = node_order, .x = x});
}
void pal_node_order_add(pal_node_order *node_order, double *force)
{
    run_nodes(&(node_pass){.order = node_order, .force = force});
}

/* plane across the shortest axis that a slot belongs to, with a node or without; beyond the last one where there is no
 * such slot of the lattice */
static int plane_of(const lattice *l, int slot)
{
    const int class = slot / l->n_class, index = slot % l->n_class;
    return 2 * (index / (l->half[0] * l->half[1])) + (class >> 2 & 1) + (class > 7 ? l->n[l->axis[2]] : 0);
}

/* A kernel adds zeros at the slots of a block's lanes without an element: is any of the block's slots elsewhere than on
 * the planes of its layer? plane: of each slot */
static bool strays(const pal_simd_blocks *blocks, int b, int layer, const int32_t *plane)
{
    if (b >= blocks->n_strip) return true;
    const int32_t *base = blocks->base + blocks->n_corner * b;
    for (int c = 0; c < blocks->n_corner; c++)
        for (int l = 0; l < PAL_LANES; l++) {
            const int32_t at = plane[base[c] + l];
            if (at != layer && at != layer + 1) return true;
        }
    return false;
}

/* layer of each block, -1: it has several; returns the number of layers, -1: no memory */
static int find_layers(const pal_simd_blocks *blocks, const pal_node_order *order, const double *x_rest, double edge_m,
                       const int32_t *item, int n_item, int32_t *layer)
{
    lattice l;
    const int n_block = blocks->n_lane / PAL_LANES;
    for (int b = 0; b < n_block; b++) layer[b] = -1;
    if (!find_lattice(x_rest, order->n_node, edge_m, &l)) return 0;
    int32_t *plane = malloc(sizeof *plane * (size_t)order->n_slot);
    if (!plane) return -1;
    for (int i = 0; i < order->n_slot; i++) plane[i] = plane_of(&l, i);
    for (int i = 0; i < n_item; i++) { /* the first element of a block decides, the others agree or stray */
        int lowest = INT_MAX;
        for (int c = 0; c < blocks->n_corner; c++) {
            const int here = plane[order->slot[item[blocks->n_corner * i + c]]];
            lowest = here < lowest ? here : lowest;
        }
        layer[blocks->place[i] / PAL_LANES] = lowest;
    }
    for (int b = 0; b < n_block; b++)
        if (strays(blocks, b, layer[b], plane)) layer[b] = -1;
    free(plane);
    return l.n[l.axis[2]];
}

pal_err pal_block_rounds_make(const pal_simd_blocks *blocks, const pal_node_order *order, const double *x_rest,
                              double edge_m, const int32_t *item, int n_item, pal_arena *arena, pal_block_rounds *out)
{
    const int n_block = blocks->n_lane / PAL_LANES;
    int32_t *layer = malloc(sizeof *layer * ((size_t)n_block + 1));
    if (!layer) return PAL_ERR_MEMORY;
    const int n_layer = find_layers(blocks, order, x_rest, edge_m, item, n_item, layer);
    if (n_layer < 0) {
        free(layer);
        return PAL_ERR_MEMORY;
    }
    *out = (pal_block_rounds){.n_round = 3};
    out->part = PAL_NEW(arena, int32_t, out->n_round + 1);
    out->first = PAL_NEW(arena, int32_t, n_layer + 2);
    out->order = PAL_NEW(arena, int32_t, n_block);
    int n_part = 0, n = 0;
    for (int round = 0; round < 3 && out->part && out->first && out->order; round++) {
        /* even layers, odd layers, blocks of several */
        for (int k = round < 2 ? round : -1; k < (round < 2 ? n_layer : 0); k += 2) {
            for (int b = 0; b < n_block; b++)
                if (layer[b] == k) out->order[n++] = b;
            if (n > out->first[n_part]) out->first[++n_part] = n;
        }
        out->part[round + 1] = n_part;
    }
    free(layer);
    return out->part && out->first && out->order ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

typedef struct round_pass {
    void (*piece)(void *user, int part);
    void *user;
    int first; /* part of the round */
} round_pass;

static void run_part(void *user, int worker, int index)
{
    const round_pass *pass = user;
    (void)worker;
    pass->piece(pass->user, pass->first + index);
}

void pal_block_rounds_run(const pal_block_rounds *rounds, pal_team *team, void (*piece)(void *user, int part),
                          void *user)
{
    for (int k = 0; k < rounds->n_round; k++) {
        round_pass pass = {.piece = piece, .user = user, .first = rounds->part[k]};
        pal_team_run(team, rounds->part[k + 1] - rounds->part[k], run_part, &pass);
    }
}

/* ---- parts of a divided order ---- */

pal_err pal_node_order_make_single(pal_node_order *node_order, double unit_m, pal_arena *arena)
{
    node_order->unit_m = unit_m;
    node_order->single_x = PAL_NEW(arena, float, 3 * (size_t)node_order->n_slot);
    node_order->single_f = PAL_NEW(arena, float, 3 * (size_t)node_order->n_slot);
    return node_order->single_x && node_order->single_f ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_node_order_divide(pal_node_order *node_order, int n_part, pal_arena *arena)
{
    if (n_part > node_order->n_node) n_part = node_order->n_node;
    node_order->part = PAL_NEW(arena, pal_node_order, n_part);
    if (!node_order->part) return PAL_ERR_MEMORY;
    for (int p = 0; p < n_part; p++) {
        node_order->part[p] = *node_order;
        if (!PAL_NEW_DOUBLES(arena, 3 * (size_t)node_order->n_slot, &node_order->part[p].x, &node_order->part[p].f))
            return PAL_ERR_MEMORY;
        if (node_order->single_x) PAL_TRY(pal_node_order_make_single(&node_order->part[p], node_order->unit_m, arena));
    }
    node_order->n_part = n_part;
    return PAL_ERR_OK;
}

static int part_of(const pal_node_order *order, int node)
{
    int part = (int)((int64_t)node * order->n_part / order->n_node);
    while (node >= pal_part_first(order->n_node, order->n_part, part + 1)) part++;
    return part;
}

/* node_of [n_slot]: -1 where there is none. Nodes of a block, -1 where a lane has an empty slot; returns how many */
static int block_nodes(const pal_simd_blocks *blocks, int b, const int32_t *node_of, int32_t *node)
{
    const int n = blocks->n_corner * PAL_LANES;
    for (int i = 0; i < n; i++) {
        const bool strip = b < blocks->n_strip;
        node[i] = node_of[strip ? blocks->base[blocks->n_corner * b + i / PAL_LANES] + i % PAL_LANES
                                : blocks->node[(size_t)(b - blocks->n_strip) * (size_t)n + (size_t)i]];
    }
    return n;
}

/* What finds the lists of the parts, once to count, once to fill. seen [n_node]: the last part whose `other` has it */
typedef struct part_search {
    const pal_simd_blocks *blocks;
    const pal_node_order *order;
    int32_t *node_of, *seen;
} part_search;

/* lists of one part from n_block and n_other on, which grow; block and other NULL: counted only */
static void find_part(const part_search *s, int part, int32_t *block, int32_t *other, int *n_block, int *n_other)
{
    for (int b = 0; b < s->blocks->n_lane / PAL_LANES; b++) {
        int32_t node[PAL_SIMD_CORNERS_MAX * PAL_LANES];
        const int n = block_nodes(s->blocks, b, s->node_of, node);
        bool touched = false;
        for (int i = 0; i < n && !touched; i++) touched = node[i] >= 0 && part_of(s->order, node[i]) == part;
        if (!touched) continue;
        if (block) block[*n_block] = b;
        ++*n_block;
        for (int i = 0; i < n; i++) {
            if (node[i] < 0 || s->seen[node[i]] == part || part_of(s->order, node[i]) == part) continue;
            s->seen[node[i]] = part;
            if (other) other[*n_other] = node[i];
            ++*n_other;
        }
    }
}

/* to counts the entries of both lists; returns the blocks of the largest part */
static int find_parts(const part_search *s, pal_part_blocks *out, int n[2])
{
    int max = 0;
    n[0] = n[1] = 0;
    for (int i = 0; i < s->order->n_node; i++) s->seen[i] = -1;
    for (int part = 0; part < s->order->n_part; part++) {
        const int before = n[0];
        find_part(s, part, out->block, out->other, &n[0], &n[1]);
        if (out->first) out->first[part + 1] = n[0], out->other_first[part + 1] = n[1];
        max = n[0] - before > max ? n[0] - before : max;
    }
    return max;
}

pal_err pal_part_blocks_make(const pal_simd_blocks *blocks, pal_node_order *node_order, pal_arena *arena,
                             pal_part_blocks *out)
{
    int n[2];
    *out = (pal_part_blocks){0};
    if (node_order->n_part < 2) return PAL_ERR_OK;
    part_search s = {.blocks = blocks, .order = node_order};
    s.node_of = malloc(sizeof *s.node_of * (size_t)node_order->n_slot);
    s.seen = malloc(sizeof *s.seen * (size_t)node_order->n_node);
    pal_err err = s.node_of && s.seen ? PAL_ERR_OK : PAL_ERR_MEMORY;
    for (int i = 0; i < node_order->n_slot && !err; i++) s.node_of[i] = -1;
    for (int i = 0; i < node_order->n_node && !err; i++) s.node_of[node_order->slot[i]] = i;
    if (!err && find_parts(&s, out, n) <= PAL_PART_MAX * blocks->n_lane / PAL_LANES) {
        pal_part_blocks made = {.first = PAL_NEW(arena, int32_t, node_order->n_part + 1),
                                .block = PAL_NEW(arena, int32_t, n[0]),
                                .other_first = PAL_NEW(arena, int32_t, node_order->n_part + 1),
                                .other = PAL_NEW(arena, int32_t, n[1])};
        err = made.first && made.block && made.other_first && made.other ? PAL_ERR_OK : PAL_ERR_MEMORY;
        if (!err) *out = made, (void)find_parts(&s, out, n);
    }
    free(s.node_of), free(s.seen);
    if (!out->first) node_order->undivided = true;
    return err;
}

PAL_INLINE void load_node(const pal_node_order *part, int i, const double *x)
{
    if (part->single) {
        load_single(part, i, x);
        return;
    }
    double *to = part->x + part->slot[i];
    for (int d = 0; d < 3; d++) to[d * part->n_slot] = x[3 * i + d];
}

void pal_part_load(const pal_part_blocks *blocks, const pal_node_order *node_order, int part, const double *x)
{
    const pal_node_order own = node_order->part[part];
    const int end = pal_part_first(own.n_node, node_order->n_part, part + 1);
    for (int i = pal_part_first(own.n_node, node_order->n_part, part); i < end && !node_order->loaded; i++)
        load_node(&own, i, x);
    for (int k = blocks->other_first[part]; k < blocks->other_first[part + 1]; k++)
        load_node(&own, blocks->other[k], x);
}

/* force += the forces at the part's own nodes, which are zero afterwards */
static void add_own(const pal_node_order *node_order, int part, double *force)
{
    const pal_node_order own = node_order->part[part];
    const int end = pal_part_first(own.n_node, node_order->n_part, part + 1);
    const int first = pal_part_first(own.n_node, node_order->n_part, part);
    for (int i = first; i < end && own.single; i++) take_single(&own, i, force);
    for (int i = first; i < end && !own.single; i++)
        for (int d = 0; d < 3; d++) {
            double *from = own.f + own.slot[i] + d * own.n_slot;
            force[3 * i + d] += *from;
            *from = 0;
        }
}

void pal_part_add(const pal_part_blocks *blocks, const pal_node_order *node_order, int part, double *force)
{
    const pal_node_order own = node_order->part[part];
    if (!node_order->shares) add_own(node_order, part, force);
    for (int k = blocks->other_first[part]; k < blocks->other_first[part + 1]; k++)
        for (int d = 0; d < 3; d++) {
            const int at = own.slot[blocks->other[k]] + d * own.n_slot;
            if (own.single)
                own.single_f[at] = 0;
            else
                own.f[at] = 0;
        }
}

void pal_node_order_begin(pal_node_order *node_order, bool single, const double *x)
{
    node_order->shares = true;
    node_order->loaded = false;
    node_order->single = single && node_order->single_x;
    memcpy(node_order->origin_m, x + 3 * (size_t)pal_node_order_origin(node_order), sizeof node_order->origin_m);
    for (int p = 0; p < node_order->n_part; p++) { /* what parts are made of in units of the whole */
        pal_node_order *part = &node_order->part[p];
        part->single = node_order->single, part->unit_N = node_order->unit_N;
        memcpy(part->origin_m, node_order->origin_m, sizeof part->origin_m);
    }
}

static void end_part(void *user, int worker, int part)
{
    const node_pass *pass = user;
    (void)worker;
    add_own(pass->order, part, pass->force);
}

void pal_node_order_end(pal_node_order *node_order, double *force)
{
    node_pass pass = {.order = node_order, .force = force};
    const bool in_parts = node_order->n_part > 0 && !node_order->undivided;
    if (node_order->loaded && in_parts) pal_team_run(node_order->team, node_order->n_part, end_part, &pass);
    if (node_order->loaded && !in_parts) run_nodes(&pass);
    node_order->shares = node_order->loaded = node_order->single = false;
}
