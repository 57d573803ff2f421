/* Sparse interpolation matrices: built row by row in a dense accumulator, multiplied, applied (paper A eq. 1). */
#include "server/num/interpolation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GONE 1e-15 /* a weight this small has cancelled */

void pal_interpolation_free(pal_interpolation *rows)
{
    free(rows->start);
    free(rows->point);
    free(rows->weight);
    memset(rows, 0, sizeof *rows);
}

size_t pal_interpolation_bytes(const pal_interpolation *rows)
{
    size_t n = rows->start ? (size_t)rows->start[rows->n_row] : 0;
    return ((size_t)rows->n_row + 1) * sizeof *rows->start + n * (sizeof *rows->point + sizeof *rows->weight);
}

/* ---- row by row ---- */

pal_err pal_interpolation_builder_begin(pal_interpolation_builder *b, int32_t n_row, int32_t n_point, int64_t max_entry)
{
    memset(b, 0, sizeof *b);
    b->rows.n_point = n_point, b->row_cap = n_row;
    b->max = max_entry < INT32_MAX ? max_entry : INT32_MAX;
    b->cap = 8 * (int64_t)n_row + 16;
    if (b->cap > b->max) b->cap = b->max;
    b->rows.start = calloc((size_t)n_row + 1, sizeof *b->rows.start);
    b->rows.point = malloc((size_t)b->cap * sizeof *b->rows.point + 1);
    b->rows.weight = malloc((size_t)b->cap * sizeof *b->rows.weight + 1);
    b->open = malloc((size_t)n_point * sizeof *b->open + 1);
    b->sum = calloc((size_t)n_point + 1, sizeof *b->sum);
    b->in = calloc((size_t)n_point + 1, 1);
    if (!b->rows.start || !b->rows.point || !b->rows.weight || !b->open || !b->sum || !b->in) b->err = PAL_ERR_MEMORY;
    return b->err;
}

/* room for n more entries */
static void grow(pal_interpolation_builder *b, int64_t n)
{
    int64_t need = b->rows.start[b->rows.n_row] + n;
    if (need <= b->cap) return;
    if (need > b->max) {
        b->err = PAL_ERR_BUDGET;
        return;
    }
    int64_t cap = need + need / 2 < b->max ? need + need / 2 : b->max;
    int32_t *point = realloc(b->rows.point, (size_t)cap * sizeof *point);
    if (point) b->rows.point = point;
    double *weight = realloc(b->rows.weight, (size_t)cap * sizeof *weight);
    if (weight) b->rows.weight = weight;
    if (point && weight)
        b->cap = cap;
    else
        b->err = PAL_ERR_MEMORY;
}

static int ascending(const void *a, const void *b)
{
    int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
    return i < j ? -1 : i > j;
}

static void sort(int32_t *item, int32_t n)
{
    if (n > 64) {
        qsort(item, (size_t)n, sizeof *item, ascending);
        return;
    }
    for (int32_t i = 1; i < n; i++) {
        int32_t at = item[i], j = i;
        for (; j > 0 && item[j - 1] > at; j--) item[j] = item[j - 1];
        item[j] = at;
    }
}

void pal_interpolation_builder_end_row(pal_interpolation_builder *b)
{
    PAL_ASSERT(b->rows.n_row < b->row_cap);
    if (!b->err) grow(b, b->n_open);
    if (b->err) return;
    sort(b->open, b->n_open);
    int32_t n = b->rows.start[b->rows.n_row];
    for (int32_t k = 0; k < b->n_open; k++) {
        int32_t i = b->open[k];
        if (fabs(b->sum[i]) > GONE) b->rows.point[n] = i, b->rows.weight[n++] = b->sum[i];
        b->sum[i] = 0, b->in[i] = 0;
    }
    b->n_open = 0;
    b->rows.start[++b->rows.n_row] = n;
}

pal_err pal_interpolation_builder_finish(pal_interpolation_builder *b, pal_interpolation *out)
{
    pal_err err = b->err;
    free(b->open);
    free(b->sum);
    free(b->in);
    if (err)
        pal_interpolation_free(&b->rows);
    else
        *out = b->rows;
    memset(b, 0, sizeof *b);
    return err;
}

/* ---- whole ---- */

pal_err pal_interpolation_identity(int32_t n, pal_interpolation *out)
{
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, n, n, n);
    for (int32_t i = 0; i < n && !b.err; i++) {
        pal_interpolation_builder_add(&b, i, 1);
        pal_interpolation_builder_end_row(&b);
    }
    return pal_interpolation_builder_finish(&b, out);
}

pal_err pal_interpolation_product(const pal_interpolation *outer, const pal_interpolation *inner, int64_t max_entry,
                                  pal_interpolation *out)
{
    PAL_ASSERT(outer->n_point == inner->n_row);
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, outer->n_row, inner->n_point, max_entry);
    for (int32_t i = 0; i < outer->n_row && !b.err; i++) {
        for (int32_t k = outer->start[i]; k < outer->start[i + 1]; k++) {
            int32_t mid = outer->point[k];
            for (int32_t m = inner->start[mid]; m < inner->start[mid + 1]; m++)
                pal_interpolation_builder_add(&b, inner->point[m], outer->weight[k] * inner->weight[m]);
        }
        pal_interpolation_builder_end_row(&b);
    }
    return pal_interpolation_builder_finish(&b, out);
}

void pal_interpolation_apply(const pal_interpolation *rows, const double *p, double *d)
{
    for (int32_t i = 0; i < rows->n_row; i++) {
        double x = 0, y = 0, z = 0;
        for (int32_t k = rows->start[i]; k < rows->start[i + 1]; k++) {
            const double *q = p + 3 * (size_t)rows->point[k], w = rows->weight[k];
            x += w * q[0], y += w * q[1], z += w * q[2];
        }
        double *to = d + 3 * (size_t)i;
        to[0] = x, to[1] = y, to[2] = z;
    }
}

void pal_interpolation_apply_transpose(const pal_interpolation *rows, const double *f, double *g)
{
    for (int32_t i = 0; i < rows->n_row; i++) {
        const double *from = f + 3 * (size_t)i;
        for (int32_t k = rows->start[i]; k < rows->start[i + 1]; k++) {
            double *to = g + 3 * (size_t)rows->point[k], w = rows->weight[k];
            to[0] += w * from[0], to[1] += w * from[1], to[2] += w * from[2];
        }
    }
}
