/* Rows of voxels as bits: runs, counts, face-connected components.
 *
 * Components join runs, not voxels: a run meets the overlapping runs of the previous row and of the previous plane,
 * which are found by walking both rows in parallel. */
#include "server/mesh/voxel/voxel_bits.h"

#include "server/num/union_find.h"

#include <stdlib.h>
#include <string.h>

pal_err pal_bits_create(const int n[3], pal_bits *out)
{
    pal_bits bits = {.n = {n[0], n[1], n[2]}, .n_word = (n[0] + 63) / 64};
    bits.word = calloc((size_t)bits.n_word * (size_t)n[1] * (size_t)n[2], sizeof *bits.word);
    if (!bits.word) return PAL_ERR_MEMORY;
    *out = bits;
    return PAL_ERR_OK;
}

void pal_bits_free(pal_bits *bits)
{
    free(bits->word);
    memset(bits, 0, sizeof *bits);
}

/* words of a row touched by from..to-1, with the mask of the first and last */
static uint64_t mask_from(int from)
{
    return ~(uint64_t)0 << (from & 63);
}

static uint64_t mask_to(int to)
{
    return ~(uint64_t)0 >> (63 - ((to - 1) & 63));
}

void pal_bits_set_run(uint64_t *row, int from, int to)
{
    if (from >= to) return;
    int a = from >> 6, b = (to - 1) >> 6;
    if (a == b) {
        row[a] |= mask_from(from) & mask_to(to);
        return;
    }
    row[a] |= mask_from(from);
    for (int w = a + 1; w < b; w++) row[w] = ~(uint64_t)0;
    row[b] |= mask_to(to);
}

static void clear_run(uint64_t *row, int from, int to)
{
    for (int w = from >> 6; w <= (to - 1) >> 6; w++) {
        uint64_t mask = ~(uint64_t)0;
        if (w == from >> 6) mask &= mask_from(from);
        if (w == (to - 1) >> 6) mask &= mask_to(to);
        row[w] &= ~mask;
    }
}

int64_t pal_bits_count(const pal_bits *bits)
{
    size_t n = (size_t)bits->n_word * (size_t)bits->n[1] * (size_t)bits->n[2];
    int64_t sum = 0;
    for (size_t i = 0; i < n; i++) sum += __builtin_popcountll(bits->word[i]);
    return sum;
}

typedef struct run {
    int32_t from, to;
} run;

typedef struct runs {
    int64_t n, cap;
    run *item;
    int64_t *start; /* first run of each row [n_row+1] */
} runs;

static bool runs_push(runs *r, int from, int to)
{
    if (r->n == r->cap) {
        int64_t cap = r->cap ? 2 * r->cap : 1024;
        run *item = realloc(r->item, (size_t)cap * sizeof *item);
        if (!item) return false;
        r->item = item;
        r->cap = cap;
    }
    r->item[r->n++] = (run){from, to};
    return true;
}

/* runs of ones in a row; a run that reaches the end of a word continues in the next */
static bool runs_of_row(runs *r, const uint64_t *row, int n_word)
{
    int open = -1;
    for (int w = 0; w < n_word; w++) {
        uint64_t left = row[w];
        int base = 64 * w, at = 0;
        if (open < 0 && left == 0) continue;
        while (at < 64) {
            uint64_t rest = (open < 0 ? left : ~left) >> at;
            if (rest == 0) break;
            at += __builtin_ctzll(rest);
            if (open < 0) {
                open = base + at;
            } else {
                if (!runs_push(r, open, base + at)) return false;
                open = -1;
            }
        }
    }
    return open < 0 || runs_push(r, open, 64 * n_word);
}

/* joins overlapping runs of two rows */
static void join_rows(const runs *r, int32_t *parent, int64_t row, int64_t other)
{
    int64_t i = r->start[row], j = r->start[other];
    while (i < r->start[row + 1] && j < r->start[other + 1]) {
        if (r->item[i].from < r->item[j].to && r->item[j].from < r->item[i].to)
            pal_union_find_join(parent, (int32_t)i, (int32_t)j);
        if (r->item[i].to < r->item[j].to)
            i++;
        else
            j++;
    }
}

static void clear_smaller(pal_bits *bits, const runs *r, int32_t *parent, const int64_t *size)
{
    int64_t best = 0, n_row = (int64_t)bits->n[1] * bits->n[2];
    for (int64_t i = 0; i < r->n; i++)
        if (parent[i] == i && size[i] > size[best]) best = i;
    for (int64_t row = 0; row < n_row; row++)
        for (int64_t i = r->start[row]; i < r->start[row + 1]; i++)
            if (pal_union_find_root(parent, (int32_t)i) != best)
                clear_run(bits->word + (size_t)bits->n_word * (size_t)row, r->item[i].from, r->item[i].to);
}

static bool find_runs(const pal_bits *bits, runs *r)
{
    size_t n_row = (size_t)bits->n[1] * (size_t)bits->n[2];
    r->start = malloc((n_row + 1) * sizeof *r->start);
    if (!r->start) return false;
    r->start[0] = 0;
    for (size_t row = 0; row < n_row; row++) {
        if (!runs_of_row(r, bits->word + (size_t)bits->n_word * row, bits->n_word)) return false;
        r->start[row + 1] = r->n;
    }
    return r->n < INT32_MAX;
}

pal_err pal_bits_components(pal_bits *bits, bool largest_only, int *n_component)
{
    runs r = {0};
    bool ok = find_runs(bits, &r);
    int32_t *parent = ok ? malloc((r.n ? (size_t)r.n : 1) * sizeof *parent) : NULL;
    int64_t *size = ok ? calloc(r.n ? (size_t)r.n : 1, sizeof *size) : NULL;
    ok = parent && size;
    if (ok) {
        pal_union_find_init(parent, (int)r.n);
        int64_t row = 0;
        for (int z = 0; z < bits->n[2]; z++)
            for (int y = 0; y < bits->n[1]; y++, row++) {
                if (y > 0) join_rows(&r, parent, row, row - 1);
                if (z > 0) join_rows(&r, parent, row, row - bits->n[1]);
            }
        int n = 0;
        for (int64_t i = 0; i < r.n; i++) {
            int32_t root = pal_union_find_root(parent, (int32_t)i);
            n += root == i;
            size[root] += r.item[i].to - r.item[i].from;
        }
        if (largest_only && n > 1) clear_smaller(bits, &r, parent, size);
        *n_component = n;
    }
    free(r.item);
    free(r.start);
    free(parent);
    free(size);
    return ok ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
