/* Copies of shown vertices. A triangle passes u, v and look of its corners on to its finest parts; there, a vertex gets
 * one copy for each different value. Parts of two triangles beside an edge compute the same values from the same ends,
 * so that only edges along which the ends differ are drawn twice. */
#include "server/sim/world/shown_copies.h"

#include "server/base/heap.h"

/* a drawn vertex: a copy of `of`; its value; the next one with the same `of`, -1: none */
typedef struct drawn {
    int32_t of, next; /* of -1: no triangle has it yet */
    float value[3];
} drawn;

typedef struct splitter {
    const pal_levels *levels;
    int n, n_pair, first_pair; /* first_pair: of the present triangle */
    drawn *vertex;             /* [n]         */
    int32_t *pair;             /* [n_pair][2] */
    pal_err err;
} splitter;

static bool same_value(const float a[3], const float b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static int32_t drawn_with(splitter *s, int32_t v, const float value[3])
{
    int32_t k = v;
    if (s->vertex[v].of < 0) {
        s->vertex[v].of = v;
        memcpy(s->vertex[v].value, value, sizeof s->vertex->value);
    }
    while (!same_value(s->vertex[k].value, value)) {
        if (s->vertex[k].next < 0) {
            if (!PAL_GROW(s->vertex, s->n)) return s->err = PAL_ERR_MEMORY, v;
            s->vertex[k].next = s->n;
            s->vertex[s->n] = (drawn){.of = v, .next = -1, .value = {value[0], value[1], value[2]}};
            return s->n++;
        }
        k = s->vertex[k].next;
    }
    return k;
}

static void add_pair(splitter *s, int32_t v, int32_t copy)
{
    for (int k = s->first_pair; k < s->n_pair; k++)
        if (s->pair[2 * k] == v) return;
    if (!pal_heap_grow(&s->pair, (size_t)s->n_pair, 2 * sizeof *s->pair)) {
        s->err = PAL_ERR_MEMORY;
        return;
    }
    s->pair[2 * s->n_pair] = v, s->pair[2 * s->n_pair++ + 1] = copy;
}

static void middle_value(const float a[3], const float b[3], float out[3])
{
    for (int c = 0; c < 2; c++) out[c] = 0.5f * (a[c] + b[c]);
    out[2] = a[2];
}

/* the finest parts of a face with these corners and values */
static void visit(splitter *s, int32_t face, const int32_t *vertex, const float value[3][3])
{
    const pal_levels *l = s->levels;
    const int32_t child = l ? pal_levels_face_child(l, face, 0) : -1;
    if (child < 0) {
        for (int k = 0; k < 3 && !s->err; k++) {
            const int32_t copy = drawn_with(s, vertex[k], value[k]);
            if (copy != vertex[k]) add_pair(s, vertex[k], copy);
        }
        return;
    }
    float middle[3][3], part[3][3]; /* middle k: of the edge from corner k to the next */
    for (int k = 0; k < 3; k++) middle_value(value[k], value[(k + 1) % 3], middle[k]);
    for (int k = 0; k < 3; k++) {
        memcpy(part[k], value[k], sizeof *part);
        memcpy(part[(k + 1) % 3], middle[k], sizeof *part);
        memcpy(part[(k + 2) % 3], middle[(k + 2) % 3], sizeof *part);
        visit(s, child + k, l->face + 3 * (size_t)(child + k), (const float(*)[3])part);
    }
    visit(s, child + 3, l->face + 3 * (size_t)(child + 3), (const float(*)[3])middle);
}

/* from what was found to the arrays of the part */
static pal_err keep(const splitter *s, const int32_t *start, int n_tri, pal_shown *shown, pal_arena *arena)
{
    const int n = s->n, n_own = shown->n_vertex, n_copy = n - n_own;
    const int n_coarse = shown->parent ? shown->n_coarse : n_own;
    float *uv = PAL_NEW(arena, float, 2 * (size_t)n), *rest_m = PAL_NEW(arena, float, 3 * (size_t)n);
    uint8_t *look = PAL_NEW(arena, uint8_t, n);
    int32_t *copy_of = PAL_NEW(arena, int32_t, n_copy + 1), *parent = PAL_NEW(arena, int32_t, 2 * (n - n_coarse) + 2);
    int32_t *copy_start = PAL_NEW(arena, int32_t, n_tri + 1), *pair = PAL_NEW(arena, int32_t, 2 * s->n_pair + 2);
    if (!uv || !rest_m || !look || !copy_of || !parent || !copy_start || !pair) return PAL_ERR_MEMORY;
    memcpy(rest_m, shown->rest_m, 3 * sizeof *rest_m * (size_t)n_own);
    if (shown->parent) memcpy(parent, shown->parent, 2 * sizeof *parent * (size_t)(n_own - n_coarse));
    for (int i = 0; i < n; i++) {
        memcpy(uv + 2 * (size_t)i, s->vertex[i].value, 2 * sizeof *uv);
        look[i] = (uint8_t)s->vertex[i].value[2];
        if (i < n_own) continue;
        const int32_t of = copy_of[i - n_own] = s->vertex[i].of;
        parent[2 * (i - n_coarse)] = parent[2 * (i - n_coarse) + 1] = of;
        memcpy(rest_m + 3 * (size_t)i, rest_m + 3 * (size_t)of, 3 * sizeof *rest_m);
    }
    shown->uv = uv, shown->look = look;
    if (n_copy == 0) return PAL_ERR_OK;
    memcpy(copy_start, start, sizeof *start * (size_t)(n_tri + 1));
    memcpy(pair, s->pair, 2 * sizeof *pair * (size_t)s->n_pair);
    shown->n_vertex = n, shown->rest_m = rest_m;
    shown->copy_of = copy_of, shown->copy_start = copy_start, shown->copy_pair = pair;
    shown->n_coarse = n_coarse, shown->parent = parent;
    return PAL_ERR_OK;
}

/* its triangles by copies; those at load by their own vertices become the coarse ones */
static pal_err name_copies(pal_shown *shown, pal_arena *arena)
{
    if (!shown->copy_start) return PAL_ERR_OK;
    int32_t *tri = PAL_NEW(arena, int32_t, 3 * (size_t)shown->n_tri);
    if (!tri) return PAL_ERR_MEMORY;
    for (int i = 0; i < shown->n_tri; i++)
        pal_shown_copies_slot(shown, i, shown->tri + 3 * (size_t)i, tri + 3 * (size_t)i);
    if (!shown->is_adaptive) shown->coarse_tri = shown->tri, shown->n_coarse_tri = shown->n_tri;
    shown->tri = tri;
    return PAL_ERR_OK;
}

pal_err pal_shown_copies_make(pal_shown *shown, int n_tri, const int32_t *tri, const float *corner,
                              const pal_levels *levels, pal_arena *arena)
{
    splitter s = {.levels = levels, .n = 0};
    int32_t *start;
    PAL_ARRAY(&s.err, start, n_tri + 1);
    for (; s.n < shown->n_vertex && !s.err; s.n++) {
        if (!PAL_GROW(s.vertex, s.n))
            s.err = PAL_ERR_MEMORY;
        else
            s.vertex[s.n] = (drawn){.of = -1, .next = -1};
    }
    for (int t = 0; t < n_tri && !s.err; t++) {
        start[t] = s.first_pair = s.n_pair;
        visit(&s, t, tri + 3 * (size_t)t, (const float(*)[3])(corner + 9 * (size_t)t));
        start[t + 1] = s.n_pair;
    }
    shown->slot_level = levels ? levels->n_level - 1 : 0;
    if (!s.err) s.err = keep(&s, start, n_tri, shown, arena);
    if (!s.err) s.err = name_copies(shown, arena);
    return PAL_FREED(s.err, start, s.vertex, s.pair);
}

void pal_shown_copies_slot(const pal_shown *shown, int slot, const int32_t from[3], int32_t to[3])
{
    const int t = slot >> 2 * shown->slot_level;
    const bool empty = (from[0] | from[1] | from[2]) == 0;
    int32_t out[3] = {from[0], from[1], from[2]};
    for (int32_t k = shown->copy_start[t]; k < shown->copy_start[t + 1] && !empty; k++)
        for (int c = 0; c < 3; c++)
            if (from[c] == shown->copy_pair[2 * (size_t)k]) out[c] = shown->copy_pair[2 * (size_t)k + 1];
    memcpy(to, out, sizeof out);
}
