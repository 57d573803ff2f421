/* Symmetric 3x3 block matrices. The pattern is made by two walks over the rows in ascending order: a row is appended to
 * the column of each neighbour that is not larger, so columns come out sorted without sorting, and the work is that of
 * looking at each pair of each clique. */
#include "server/num/block_matrix.h"

#include "server/base/heap.h"

#include <math.h>

/* items that touch each node: item[start[i]..start[i + 1]) */
typedef struct incidence {
    int64_t *start;
    int64_t *item; /* list << 40 | item */
} incidence;

static pal_err find_items(int n, const pal_cliques *list, int n_list, incidence *out)
{
    pal_err err = PAL_ERR_OK;
    int64_t *start, *item;
    PAL_ZEROED(&err, start, n + 2);
    if (err) return err;
    for (int l = 0; l < n_list; l++) {
        int64_t n_node = (int64_t)list[l].n_item * list[l].n_corner;
        for (int64_t k = 0; k < n_node; k++) start[list[l].node[k] + 2]++;
    }
    for (int i = 0; i < n; i++) start[i + 2] += start[i + 1];
    PAL_ARRAY(&err, item, start[n + 1]);
    if (err) {
        free(start);
        return err;
    }
    for (int l = 0; l < n_list; l++) {
        const int32_t *node = list[l].node;
        for (int64_t e = 0; e < list[l].n_item; e++)
            for (int c = 0; c < list[l].n_corner; c++) item[start[*node++ + 1]++] = (int64_t)l << 40 | e;
    }
    *out = (incidence){start, item};
    return PAL_ERR_OK;
}

/* column[j] += 1 for every pair (i, j <= i); with row: row[column[j]++] = i as well */
static void walk_pairs(int n, const pal_cliques *list, const incidence *in, int32_t *stamp, int64_t *column,
                       int32_t *row)
{
    for (int i = 0; i < n; i++) stamp[i] = -1;
    for (int i = 0; i < n; i++) {
        stamp[i] = i;
        if (row) row[column[i]] = i;
        column[i]++;
        for (int64_t k = in->start[i]; k < in->start[i + 1]; k++) {
            const pal_cliques *c = &list[in->item[k] >> 40];
            const int32_t *node = c->node + (in->item[k] & (((int64_t)1 << 40) - 1)) * c->n_corner;
            for (int a = 0; a < c->n_corner; a++) {
                int j = node[a];
                if (j >= i || stamp[j] == i) continue;
                stamp[j] = i;
                if (row) row[column[j]] = i;
                column[j]++;
            }
        }
    }
}

static pal_err make_pattern(int n, const pal_cliques *list, const incidence *in, int32_t *stamp, int64_t *column,
                            pal_arena *arena, pal_block_matrix *out)
{
    walk_pairs(n, list, in, stamp, column, NULL);
    int64_t sum = 0;
    for (int j = 0; j < n; j++) {
        int64_t count = column[j];
        column[j] = sum;
        sum += count;
    }
    if (sum > INT32_MAX) return PAL_ERR_MEMORY;
    pal_block_matrix a = {.n = n, .start = PAL_NEW(arena, int32_t, n + 1)};
    a.row = PAL_NEW(arena, int32_t, sum);
    a.value = PAL_NEW(arena, double, 9 * sum);
    if (!a.start || !a.row || !a.value) return PAL_ERR_MEMORY;
    for (int j = 0; j < n; j++) a.start[j] = (int32_t)column[j];
    a.start[n] = (int32_t)sum;
    walk_pairs(n, list, in, stamp, column, a.row);
    *out = a;
    return PAL_ERR_OK;
}

pal_err pal_block_matrix_make(int n, const pal_cliques *list, int n_list, pal_arena *arena, pal_block_matrix *out)
{
    incidence in;
    PAL_TRY(find_items(n, list, n_list, &in));
    pal_err err = PAL_ERR_OK;
    int32_t *stamp;
    int64_t *column;
    PAL_ARRAY(&err, stamp, n);
    PAL_ZEROED(&err, column, n);
    if (!err) err = make_pattern(n, list, &in, stamp, column, arena, out);
    PAL_FREE(stamp, column, in.start, in.item);
    return err;
}

double pal_block_matrix_scale(double max)
{
    int e = 0;
    if (max > 0 && isfinite(max)) (void)frexp(max, &e);
    return ldexp(1, e > 1000 ? -1000 : e < -1000 ? 1000 : -e);
}

int pal_block_matrix_find(const pal_block_matrix *a, int i, int j)
{
    int low = a->start[j], high = a->start[j + 1];
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (a->row[middle] < i)
            low = middle + 1;
        else
            high = middle;
    }
    return low < a->start[j + 1] && a->row[low] == i ? low : -1;
}

void pal_block_matrix_zero(pal_block_matrix *a)
{
    memset(a->value, 0, sizeof *a->value * 9 * (size_t)a->start[a->n]);
}

void pal_block_matrix_multiply(const pal_block_matrix *a, double s, const double *x, double *y)
{
    for (int j = 0; j < a->n; j++) {
        const double *restrict v = a->value + 9 * (size_t)a->start[j];
        double x0 = s * x[3 * j], x1 = s * x[3 * j + 1], x2 = s * x[3 * j + 2];
        double y0 = v[0] * x0 + v[1] * x1 + v[2] * x2, y1 = v[3] * x0 + v[4] * x1 + v[5] * x2,
               y2 = v[6] * x0 + v[7] * x1 + v[8] * x2;
        double t0 = 0, t1 = 0, t2 = 0;
        for (int k = a->start[j] + 1; k < a->start[j + 1]; k++) {
            v += 9;
            const double *p = x + 3 * (size_t)a->row[k];
            double *q = y + 3 * (size_t)a->row[k];
            q[0] += v[0] * x0 + v[1] * x1 + v[2] * x2;
            q[1] += v[3] * x0 + v[4] * x1 + v[5] * x2;
            q[2] += v[6] * x0 + v[7] * x1 + v[8] * x2;
            t0 += v[0] * p[0] + v[3] * p[1] + v[6] * p[2];
            t1 += v[1] * p[0] + v[4] * p[1] + v[7] * p[2];
            t2 += v[2] * p[0] + v[5] * p[1] + v[8] * p[2];
        }
        y[3 * j] += y0 + s * t0;
        y[3 * j + 1] += y1 + s * t1;
        y[3 * j + 2] += y2 + s * t2;
    }
}
