/* Groups of cells, level by level. */
#include "server/mesh/volume/cell_hierarchy.h"

#include "server/base/heap.h"
#include "server/num/union_find.h"

#include <stdlib.h>
#include <string.h>

/* a finer cell in the order of blocks */
typedef struct entry {
    int32_t block[3], cell;
} entry;

static int compare_entries(const void *pa, const void *pb)
{
    const entry *a = pa, *b = pb;
    for (int axis = 2; axis >= 0; axis--)
        if (a->block[axis] != b->block[axis]) return a->block[axis] < b->block[axis] ? -1 : 1;
    return a->cell < b->cell ? -1 : a->cell > b->cell;
}

static bool same_block(const entry *a, const entry *b)
{
    return a->block[0] == b->block[0] && a->block[1] == b->block[1] && a->block[2] == b->block[2];
}

/* a finer level, and what is found of the coarser one */
typedef struct work {
    pal_lattice_cells from;
    entry *entry;    /* [n_cell] */
    int32_t *group;  /* coarse cell of each finer cell [n_cell] */
    uint8_t *octant; /* place of each finer cell in its coarse cell [n_cell] */
    int32_t *corner; /* corners of coarse cells that nodes are interpolated from, by the parity of the node: bit of each
                        axis along which it lies between two; -1: none [n_node][8] */
    int32_t *root;   /* node of each corner of a coarse cell [n_coarse][8] */
    int n_coarse;
} work;

/* numbers the groups of the cells first to end of one block, from the smallest cell of each; cells that share a node
 * are of one group. seen [n_node]: a cell at each node, of this block or an earlier one; join [n_cell]: by place in
 * `entry` */
static void group_block(work *w, const entry *first, const entry *end, int32_t *seen, int32_t *join)
{
    const int32_t begin = (int32_t)(first - w->entry), n = (int32_t)(end - first);
    pal_union_find_init(join, n);
    for (int32_t k = 0; k < n; k++)
        for (int c = 0; c < 8; c++) {
            int32_t *at = &seen[w->from.node[8 * (size_t)first[k].cell + (size_t)c]];
            if (*at >= begin)
                pal_union_find_join(join, *at - begin, k);
            else
                *at = begin + k;
        }
    const int32_t n_group = pal_union_find_label(join, n);
    for (int32_t k = 0; k < n; k++) w->group[first[k].cell] = w->n_coarse + join[k];
    w->n_coarse += n_group;
}

/* groups of all blocks, whose entries are sorted */
static pal_err group_cells(work *w)
{
    pal_err err = PAL_ERR_OK;
    int32_t *seen, *join;
    PAL_ARRAY(&err, seen, (size_t)w->from.n_node + 1);
    PAL_ARRAY(&err, join, (size_t)w->from.n_cell + 1);
    for (int i = 0; i < w->from.n_node && !err; i++) seen[i] = -1;
    const entry *end = w->entry + w->from.n_cell;
    for (const entry *e = w->entry, *next; e < end && !err; e = next) {
        for (next = e + 1; next < end && same_block(e, next); next++) {
        }
        group_block(w, e, next, seen, join);
    }
    free(seen), free(join);
    return err;
}

/* Corner `corner` of the cell at `octant` of a coarse cell lies between corners of it. k: bit of each axis along which
 * it is between two, that of the far one. Returns corner k of the coarse cell; -1: there is none */
static int coarse_corner(int octant, int corner, int k)
{
    int d = 0;
    for (int axis = 0; axis < 3; axis++) {
        const int at = (octant >> axis & 1) + (corner >> axis & 1); /* 0, 1, 2 halves of the coarse cell */
        if (at != 1 && k >> axis & 1) return -1;
        d |= (at == 1 ? k >> axis & 1 : at / 2) << axis;
    }
    return d;
}

/* corners of coarse cells that one node of the finer level is interpolated from are one */
static void join_corners(work *w)
{
    pal_union_find_init(w->root, 8 * w->n_coarse);
    for (int i = 0; i < 8 * w->from.n_node; i++) w->corner[i] = -1;
    for (int e = 0; e < w->from.n_cell; e++)
        for (int c = 0; c < 8; c++)
            for (int k = 0; k < 8; k++) {
                const int d = coarse_corner(w->octant[e], c, k);
                if (d < 0) continue;
                int32_t *seen = &w->corner[8 * (size_t)w->from.node[8 * (size_t)e + (size_t)c] + (size_t)k];
                const int32_t here = 8 * w->group[e] + d;
                if (*seen < 0)
                    *seen = here;
                else
                    pal_union_find_join(w->root, *seen, here);
            }
}

/* a level that is hardly coarser */
static bool too_many(const work *w, const pal_grid_level *level)
{
    return level->n_node > PAL_LEVEL_SHRINKS * w->from.n_node;
}

/* children of each coarse cell */
static pal_err list_children(const work *w, pal_arena *arena, pal_grid_level *out)
{
    out->n_cell = w->n_coarse;
    out->child = PAL_NEW(arena, int32_t, w->from.n_cell);
    out->first = PAL_NEW(arena, int32_t, w->n_coarse + 2);
    out->octant = PAL_NEW(arena, uint8_t, w->from.n_cell);
    if (!out->child || !out->first || !out->octant) return PAL_ERR_MEMORY;
    memcpy(out->octant, w->octant, (size_t)w->from.n_cell);
    for (int e = 0; e < w->from.n_cell; e++) out->first[w->group[e] + 2]++;
    for (int g = 0; g < w->n_coarse; g++) out->first[g + 2] += out->first[g + 1];
    for (int e = 0; e < w->from.n_cell; e++) out->child[out->first[w->group[e] + 1]++] = e;
    return PAL_ERR_OK;
}

/* the finer nodes that take part in each node */
static pal_err list_finer(int n_finer, pal_arena *arena, pal_grid_level *out)
{
    const int32_t n_entry = out->start[n_finer];
    out->begin = PAL_NEW(arena, int32_t, out->n_node + 2);
    out->finer = PAL_NEW(arena, int32_t, n_entry);
    if (!out->begin || !out->finer) return PAL_ERR_MEMORY;
    for (int32_t k = 0; k < n_entry; k++) out->begin[out->from[k] + 2]++;
    for (int i = 0; i < out->n_node; i++) out->begin[i + 2] += out->begin[i + 1];
    for (int i = 0; i < n_finer; i++)
        for (int32_t k = out->start[i]; k < out->start[i + 1]; k++) out->finer[out->begin[out->from[k] + 1]++] = i;
    return PAL_ERR_OK;
}

/* interpolation, corners of cells, nodes that no free node uses */
static pal_err fill_nodes(work *w, pal_arena *arena, pal_grid_level *out)
{
    const int n = w->from.n_node;
    out->node = PAL_NEW(arena, int32_t, 8 * (size_t)w->n_coarse);
    out->fixed = PAL_NEW(arena, uint8_t, out->n_node);
    out->start = PAL_NEW(arena, int32_t, n + 1);
    if (!out->node || !out->fixed || !out->start) return PAL_ERR_MEMORY;
    memcpy(out->node, w->root, sizeof *out->node * 8 * (size_t)w->n_coarse);
    int32_t n_from = 0;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 8; k++) n_from += !w->from.fixed[i] && w->corner[8 * i + k] >= 0;
        out->start[i + 1] = n_from;
    }
    out->from = PAL_NEW(arena, int32_t, n_from);
    if (!out->from) return PAL_ERR_MEMORY;
    memset(out->fixed, 1, (size_t)out->n_node);
    n_from = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 8; k++) {
            if (w->from.fixed[i] || w->corner[8 * i + k] < 0) continue;
            out->from[n_from] = w->root[w->corner[8 * i + k]];
            out->fixed[out->from[n_from++]] = 0;
        }
    return list_finer(n, arena, out);
}

/* place [n_coarse][3], heap, of the coarse cells; out has no more than a number of nodes if they are too many */
static pal_err coarsen(work *w, pal_arena *arena, pal_grid_level *out, int32_t **place)
{
    const pal_lattice_cells *from = &w->from;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, w->entry, from->n_cell);
    PAL_ARRAY(&err, w->group, from->n_cell);
    PAL_ARRAY(&err, w->corner, 8 * (size_t)from->n_node);
    PAL_ARRAY(&err, w->octant, from->n_cell);
    if (err) return err;
    for (int e = 0; e < from->n_cell; e++) {
        const int32_t *at = from->place + 3 * (size_t)e;
        w->entry[e] = (entry){.block = {at[0] / 2, at[1] / 2, at[2] / 2}, .cell = e};
        w->octant[e] = (uint8_t)((at[0] & 1) + 2 * (at[1] & 1) + 4 * (at[2] & 1));
    }
    qsort(w->entry, (size_t)from->n_cell, sizeof *w->entry, compare_entries);
    PAL_TRY(group_cells(w));
    PAL_ARRAY(&err, *place, 3 * (size_t)w->n_coarse + 1);
    PAL_ARRAY(&err, w->root, 8 * (size_t)w->n_coarse + 1);
    if (err) return err;
    for (int e = 0; e < from->n_cell; e++)
        memcpy(*place + 3 * (size_t)w->group[w->entry[e].cell], w->entry[e].block, sizeof w->entry[e].block);
    join_corners(w);
    out->n_node = pal_union_find_label(w->root, 8 * w->n_coarse);
    if (too_many(w, out)) return PAL_ERR_OK;
    PAL_TRY(list_children(w, arena, out));
    return fill_nodes(w, arena, out);
}

pal_err pal_cell_hierarchy_make(const pal_lattice_cells *cells, int n_coarsest, pal_arena *arena,
                                pal_grid_hierarchy *out)
{
    work w = {.from = *cells};
    int32_t *place = NULL;
    pal_err err = PAL_ERR_OK;
    out->n_level = 0;
    while (!err && out->n_level < PAL_GRID_LEVELS_MAX && w.from.n_node > n_coarsest) {
        pal_grid_level *level = &out->level[out->n_level];
        int32_t *coarse = NULL;
        w.n_coarse = 0;
        err = coarsen(&w, arena, level, &coarse);
        free(w.entry), free(w.group), free(w.octant), free(w.corner), free(w.root), free(place);
        place = coarse;
        if (err || too_many(&w, level)) break;
        w = (work){.from = {level->n_cell, level->n_node, level->node, place, level->fixed}};
        out->n_level++;
    }
    free(place);
    return err;
}
