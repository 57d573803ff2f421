/* Sparse interpolation matrices: built row by row in a dense accumulator, multiplied, applied (paper A eq. 1). */
#include "server/num/interpolation.h"

#include "server/base/heap.h"
#include "server/num/sort.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GONE 1e-15 /* a weight this small has cancelled */

void pal_interpolation_free(pal_interpolation *rows)
{
    PAL_FREE(rows->start, rows->point, rows->weight);
    memset(rows, 0, sizeof *rows);
}

size_t pal_interpolation_bytes(const pal_interpolation *rows)
{
    size_t n = rows->start ? (size_t)rows->start[rows->n_row] : 0;
    return ((size_t)rows->n_row + 1) * sizeof *rows->start + n * (sizeof *rows->point + sizeof *rows->weight);
}

pal_err pal_interpolation_builder_begin(pal_interpolation_builder *b, int32_t n_row, int32_t n_point, int64_t max_entry)
{
    memset(b, 0, sizeof *b);
    b->rows.n_point = n_point, b->row_cap = n_row;
    b->max = max_entry < INT32_MAX ? max_entry : INT32_MAX;
    PAL_ZEROED(&b->err, b->rows.start, (size_t)n_row + 1);
    PAL_ARRAY(&b->err, b->rows.point, 1);
    PAL_ARRAY(&b->err, b->rows.weight, 1);
    PAL_ARRAY(&b->err, b->open, n_point);
    PAL_ZEROED(&b->err, b->sum, n_point);
    PAL_ZEROED(&b->err, b->in, n_point);
    return b->err;
}

PAL_SORT(sort, int32_t, pal_compare_int32)

void pal_interpolation_builder_end_row(pal_interpolation_builder *b)
{
    PAL_ASSERT(b->rows.n_row < b->row_cap);
    if (b->err) return;
    int32_t n = b->rows.start[b->rows.n_row];
    if ((int64_t)n + b->n_open > b->max) b->err = PAL_ERR_BUDGET;
    sort(b->open, (size_t)b->n_open);
    for (int32_t k = 0; k < b->n_open && !b->err; k++) {
        int32_t i = b->open[k];
        if (fabs(b->sum[i]) > GONE) {
            if (!PAL_GROW(b->rows.point, n) || !PAL_GROW(b->rows.weight, n)) b->err = PAL_ERR_MEMORY;
            if (!b->err) b->rows.point[n] = i, b->rows.weight[n++] = b->sum[i];
        }
        b->sum[i] = 0, b->in[i] = 0;
    }
    b->n_open = 0;
    b->rows.start[++b->rows.n_row] = n;
}

void pal_interpolation_builder_mean(pal_interpolation_builder *b, const int32_t *point, int32_t n)
{
    for (int32_t k = 0; k < n && !b->err; k++) pal_interpolation_builder_add(b, point[k], 1.0 / n);
    pal_interpolation_builder_end_row(b);
}

pal_err pal_interpolation_builder_finish(pal_interpolation_builder *b, pal_interpolation *out)
{
    pal_err err = b->err;
    PAL_FREE(b->open, b->sum, b->in);
    if (err)
        pal_interpolation_free(&b->rows);
    else
        *out = b->rows;
    memset(b, 0, sizeof *b);
    return err;
}

pal_err pal_interpolation_identity(int32_t n, pal_interpolation *out)
{
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, n, n, n);
    for (int32_t i = 0; i < n; i++) pal_interpolation_builder_mean(&b, &i, 1);
    return pal_interpolation_builder_finish(&b, out);
}

void pal_interpolation_builder_product(pal_interpolation_builder *b, const pal_interpolation *outer,
                                       const pal_interpolation *inner)
{
    PAL_ASSERT(!outer || outer->n_point == inner->n_row);
    for (int32_t i = 0; i < (outer ? outer->n_row : inner->n_row) && !b->err; i++) {
        for (int32_t k = outer ? outer->start[i] : i; k < (outer ? outer->start[i + 1] : i + 1); k++) {
            int32_t mid = outer ? outer->point[k] : k;
            for (int32_t m = inner->start[mid]; m < inner->start[mid + 1]; m++)
                pal_interpolation_builder_add(b, inner->point[m], (outer ? outer->weight[k] : 1) * inner->weight[m]);
        }
        pal_interpolation_builder_end_row(b);
    }
}

pal_err pal_interpolation_product(const pal_interpolation *outer, const pal_interpolation *inner, int64_t max_entry,
                                  pal_interpolation *out)
{
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, outer->n_row, inner->n_point, max_entry);
    pal_interpolation_builder_product(&b, outer, inner);
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
