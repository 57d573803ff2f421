#include "server/num/envelope.h"

#include "server/base/heap.h"
#include "server/num/conjugate_gradient.h"

#include <math.h>

typedef struct graph {
    int n;
    const int32_t *start, *point;
} graph;

static int32_t degree(const graph *g, int32_t i)
{
    return g->start[i + 1] - g->start[i];
}

/* points reached from root by breadth first into queue, neighbours by degree; seen is `mark` there. Returns how many */
static int spread(const graph *g, int32_t root, int32_t mark, int32_t *seen, int32_t *queue)
{
    int n = 0;
    seen[root] = mark, queue[n++] = root;
    for (int at = 0; at < n; at++) {
        const int from = n;
        for (int32_t k = g->start[queue[at]]; k < g->start[queue[at] + 1]; k++) {
            int32_t i = g->point[k];
            if (seen[i] == mark) continue;
            seen[i] = mark;
            int to = n++;
            for (; to > from && degree(g, queue[to - 1]) > degree(g, i); to--) queue[to] = queue[to - 1];
            queue[to] = i;
        }
    }
    return n;
}

/* Cuthill and McKee from the end of the graph, piece by piece, then the other way round */
static void find_order(const graph *g, int32_t *seen, int32_t *order)
{
    int done = 0;
    for (int32_t i = 0; i < g->n; i++) seen[i] = 0;
    for (int32_t i = 0; i < g->n; i++) {
        if (seen[i]) continue;
        int32_t root = i;
        int n = 0;
        for (int32_t mark = 1; mark <= 3; mark++) {
            n = spread(g, root, mark, seen, order + done);
            root = order[done + n - 1];
        }
        done += n;
    }
    for (int i = 0; i < g->n / 2; i++) {
        int32_t kept = order[i];
        order[i] = order[g->n - 1 - i], order[g->n - 1 - i] = kept;
    }
}

static int64_t find_rows(const graph *g, const int32_t *order, const int32_t *position, int32_t *first, int64_t *start)
{
    start[0] = 0;
    for (int32_t i = 0; i < g->n; i++) {
        first[i] = i;
        for (int32_t k = g->start[order[i]]; k < g->start[order[i] + 1]; k++)
            if (position[g->point[k]] < first[i]) first[i] = position[g->point[k]];
        start[i + 1] = start[i] + i - first[i] + 1;
    }
    return start[g->n];
}

pal_err pal_envelope_make(int n, const int32_t *start, const int32_t *point, int64_t max_entry, pal_arena *arena,
                          pal_envelope *out)
{
    const graph g = {n, start, point};
    pal_err err = PAL_ERR_OK;
    int32_t *index;
    int64_t *row;
    PAL_ARRAY(&err, index, 3 * (size_t)n);
    PAL_ARRAY(&err, row, n + 1);
    int32_t *order = index, *position = index + n, *first = index + 2 * (size_t)n;
    if (!err) {
        find_order(&g, position, order);
        for (int32_t i = 0; i < n; i++) position[order[i]] = i;
        if (find_rows(&g, order, position, first, row) > max_entry) err = PAL_ERR_BUDGET;
    }
    if (!err) {
        *out = (pal_envelope){.n = n, .order = PAL_NEW(arena, int32_t, 3 * (size_t)n)};
        out->start = PAL_NEW(arena, int64_t, n + 1);
        out->value = PAL_NEW(arena, double, row[n]);
        out->work = PAL_NEW(arena, double, 3 * (size_t)n);
        if (!out->order || !out->start || !out->value || !out->work) err = PAL_ERR_MEMORY;
    }
    if (!err) {
        memcpy(out->order, index, 3 * sizeof *index * (size_t)n);
        memcpy(out->start, row, sizeof *row * ((size_t)n + 1));
        out->position = out->order + n, out->first = out->order + 2 * (size_t)n;
    }
    PAL_FREE(index, row);
    return err;
}

static void load_values(pal_envelope *e, const int32_t *start, const int32_t *point, const double *value,
                        const uint8_t *skip)
{
    memset(e->value, 0, sizeof(double) * (size_t)e->start[e->n]);
    for (int32_t i = 0; i < e->n; i++) {
        const int32_t from = e->order[i];
        double *row = e->value + e->start[i];
        if (skip && skip[from]) row[i - e->first[i]] = 1;
        for (int32_t k = start[from]; k < start[from + 1]; k++) {
            const int32_t j = e->position[point[k]];
            if (j <= i && !(skip && (skip[from] || skip[point[k]]))) row[j - e->first[i]] = value[k];
        }
    }
}

pal_err pal_envelope_factor(pal_envelope *e, const int32_t *start, const int32_t *point, const double *value,
                            const uint8_t *skip)
{
    load_values(e, start, point, value, skip);
    for (int32_t i = 0; i < e->n; i++) {
        double *row = e->value + e->start[i];
        const int32_t first = e->first[i];
        for (int32_t j = first; j < i; j++) {
            const double *other = e->value + e->start[j];
            const int32_t from = first > e->first[j] ? first : e->first[j];
            const double sum = pal_dot_product(j - from, row + from - first, other + from - e->first[j]);
            row[j - first] = (row[j - first] - sum) * other[j - e->first[j]];
        }
        double pivot = row[i - first], left = pivot - pal_dot_product(i - first, row, row);
        /* a pivot of which only rounding is left is none */
        if (!(left > 1e-14 * pivot) || !isfinite(left)) return PAL_ERR_NUMERIC;
        row[i - first] = 1 / sqrt(left);
    }
    return PAL_ERR_OK;
}

void pal_envelope_solve(pal_envelope *e, const double *b, double *x)
{
    const int32_t n = e->n;
    double *y[3] = {e->work, e->work + n, e->work + 2 * (size_t)n};
    for (int32_t i = 0; i < n; i++) {
        const int32_t first = e->first[i], length = i - first;
        const double *row = e->value + e->start[i], *from = b + 3 * (size_t)e->order[i];
        for (int c = 0; c < 3; c++) y[c][i] = (from[c] - pal_dot_product(length, row, y[c] + first)) * row[length];
    }
    for (int32_t i = n; i-- > 0;) {
        const int32_t first = e->first[i], length = i - first;
        const double *restrict row = e->value + e->start[i];
        double *to = x + 3 * (size_t)e->order[i];
        for (int c = 0; c < 3; c++) {
            double *restrict above = y[c] + first;
            const double last = y[c][i] * row[length];
            for (int32_t k = 0; k < length; k++) above[k] -= last * row[k];
            to[c] = last;
        }
    }
}
