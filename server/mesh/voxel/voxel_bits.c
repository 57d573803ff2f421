/* Rows of voxels as bits: runs, counts, face-connected components.
 *
 * Components join runs, not voxels: a run meets the overlapping runs of the previous row and of the previous plane,
 * which are found by walking both rows in parallel. */
#include "server/mesh/voxel/voxel_bits.h"

#include "server/base/heap.h"
#include "server/num/union_find.h"

pal_err pal_bits_create(const int n[3], pal_bits *out)
{
    pal_bits bits = {.n = {n[0], n[1], n[2]}, .n_word = (n[0] + 63) / 64};
    bits.word = calloc(pal_bits_words(&bits), sizeof *bits.word);
    if (!bits.word) return PAL_ERR_MEMORY;
    *out = bits;
    return PAL_ERR_OK;
}

void pal_bits_free(pal_bits *bits)
{
    free(bits->word);
    memset(bits, 0, sizeof *bits);
}

/* the bits from..to-1 of a row as a mask for word w, which holds some of them */
static inline uint64_t run_mask(int w, int from, int to)
{
    uint64_t mask = ~(uint64_t)0;
    if (w == from >> 6) mask &= ~(uint64_t)0 << (from & 63);
    if (w == (to - 1) >> 6) mask &= ~(uint64_t)0 >> (63 - ((to - 1) & 63));
    return mask;
}

void pal_bits_set_run(void *row, int from, int to)
{
    uint64_t *word = row;
    for (int w = from >> 6; from < to && w <= (to - 1) >> 6; w++) word[w] |= run_mask(w, from, to);
}

int64_t pal_bits_count(const pal_bits *bits)
{
    int64_t sum = 0;
    for (size_t i = 0; i < pal_bits_words(bits); i++) sum += __builtin_popcountll(bits->word[i]);
    return sum;
}

typedef struct run {
    int32_t from, to;
} run;

typedef struct runs {
    int64_t n;
    run *item;
    int64_t *start; /* first run of each row [n_row+1] */
} runs;

static bool add_run(runs *r, int from, int to)
{
    if (!PAL_GROW(r->item, r->n)) return false;
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
            if (open >= 0 && !add_run(r, open, base + at)) return false;
            open = open < 0 ? base + at : -1;
        }
    }
    return open < 0 || add_run(r, open, 64 * n_word);
}

static void join_rows(const runs *r, int32_t *parent, int64_t row, int64_t other)
{
    int64_t i = r->start[row], j = r->start[other];
    while (i < r->start[row + 1] && j < r->start[other + 1]) {
        if (r->item[i].from < r->item[j].to && r->item[j].from < r->item[i].to)
            pal_union_find_join(parent, (int32_t)i, (int32_t)j);
        *(r->item[i].to < r->item[j].to ? &i : &j) += 1;
    }
}

/* clears the components whose roots are not kept */
static void clear_others(pal_bits *bits, const runs *r, int32_t *parent, const bool *keep)
{
    const int64_t n_row = (int64_t)bits->n[1] * bits->n[2];
    for (int64_t row = 0; row < n_row; row++)
        for (int64_t i = r->start[row]; i < r->start[row + 1]; i++) {
            uint64_t *word = bits->word + (size_t)bits->n_word * (size_t)row;
            int from = r->item[i].from, to = r->item[i].to;
            if (keep[pal_union_find_root(parent, (int32_t)i)]) continue;
            for (int w = from >> 6; w <= (to - 1) >> 6; w++) word[w] &= ~run_mask(w, from, to);
        }
}

static pal_err find_runs(const pal_bits *bits, runs *r)
{
    pal_err err = PAL_ERR_OK;
    size_t n_row = (size_t)bits->n[1] * (size_t)bits->n[2];
    PAL_ZEROED(&err, r->start, n_row + 1);
    for (size_t row = 0; row < n_row && !err; row++) {
        if (!runs_of_row(r, bits->word + (size_t)bits->n_word * row, bits->n_word)) err = PAL_ERR_MEMORY;
        r->start[row + 1] = r->n;
    }
    return r->n < INT32_MAX ? err : PAL_ERR_MEMORY;
}

/* runs and the components that they form; *parent [number of runs] */
static pal_err join_runs(const pal_bits *bits, runs *r, int32_t **parent)
{
    pal_err err = find_runs(bits, r);
    PAL_ARRAY(&err, *parent, r->n);
    if (err) return err;
    pal_union_find_init(*parent, (int)r->n);
    int64_t row = 0;
    for (int z = 0; z < bits->n[2]; z++)
        for (int y = 0; y < bits->n[1]; y++, row++) {
            if (y > 0) join_rows(r, *parent, row, row - 1);
            if (z > 0) join_rows(r, *parent, row, row - bits->n[1]);
        }
    return PAL_ERR_OK;
}

pal_err pal_bits_components(pal_bits *bits, bool largest_only, int *n_component)
{
    runs r = {0};
    int32_t *parent = NULL;
    int64_t *size, best = 0;
    bool *keep;
    pal_err err = join_runs(bits, &r, &parent);
    PAL_ZEROED(&err, size, r.n);
    PAL_ZEROED(&err, keep, r.n);
    if (!err) {
        int n = 0;
        for (int64_t i = 0; i < r.n; i++) {
            int32_t root = pal_union_find_root(parent, (int32_t)i);
            n += root == i;
            size[root] += r.item[i].to - r.item[i].from;
        }
        for (int64_t i = 0; i < r.n; i++)
            if (size[i] > size[best]) best = i;
        if (r.n > 0) keep[best] = true;
        if (largest_only && n > 1) clear_others(bits, &r, parent, keep);
        *n_component = n;
    }
    return PAL_FREED(err, r.item, r.start, parent, size, keep);
}

static bool has_bit(const uint64_t *word, int from, int to)
{
    for (int w = from >> 6; w <= (to - 1) >> 6; w++)
        if (word[w] & run_mask(w, from, to)) return true;
    return false;
}

pal_err pal_bits_keep_joined(pal_bits *bits, const pal_bits *seeds)
{
    runs r = {0};
    int32_t *parent = NULL;
    bool *keep;
    const int64_t n_row = (int64_t)bits->n[1] * bits->n[2];
    pal_err err = join_runs(bits, &r, &parent);
    PAL_ZEROED(&err, keep, r.n);
    for (int64_t row = 0; row < n_row && !err; row++)
        for (int64_t i = r.start[row]; i < r.start[row + 1]; i++)
            if (has_bit(seeds->word + (size_t)seeds->n_word * (size_t)row, r.item[i].from, r.item[i].to))
                keep[pal_union_find_root(parent, (int32_t)i)] = true;
    if (!err) clear_others(bits, &r, parent, keep);
    return PAL_FREED(err, r.item, r.start, parent, keep);
}
