/* Trilinear weights, and the matrix of many points: entries point by point, used nodes found by sorting, so that the
 * size of the grid does not matter. */
#include "server/num/trilinear.h"

#include "server/base/heap.h"
#include "server/num/sort.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* distance in cells below which a point lies on a plane of nodes: rounding must not make a node count that the body
 * does not reach */
static const double ON_PLANE = 1e-10;

void pal_trilinear(const pal_grid *grid, const double x[3], int64_t node[8], double weight[8])
{
    int64_t at[3];
    double t[3];
    for (int c = 0; c < 3; c++) {
        int n = grid->n[c];
        double g = n > 1 ? (x[c] - grid->low[c]) / (grid->high[c] - grid->low[c]) * (n - 1) : 0;
        g = g > 0 ? fmin(g, n - 1) : 0;
        at[c] = g < n - 1 ? (int64_t)g : (n > 1 ? n - 2 : 0);
        t[c] = g - (double)at[c];
        if (t[c] < ON_PLANE) t[c] = 0;
        if (t[c] > 1 - ON_PLANE) t[c] = 1;
    }
    for (int k = 0; k < 8; k++) {
        int64_t step = 1;
        weight[k] = 1;
        node[k] = 0;
        for (int c = 0; c < 3; c++) {
            int up = k >> c & 1;
            weight[k] *= up ? t[c] : 1 - t[c];
            node[k] += step * (at[c] + (up && grid->n[c] > 1));
            step *= grid->n[c];
        }
    }
}

double pal_trilinear_at(const pal_grid *grid, const double *value, const double x[3])
{
    int64_t node[8];
    double weight[8], sum = 0;
    pal_trilinear(grid, x, node, weight);
    for (int k = 0; k < 8; k++)
        if (weight[k] > 0) sum += weight[k] * value[node[k]];
    return sum;
}

static int compare_node(const void *a, const void *b)
{
    return PAL_COMPARE(*(const int64_t *)a, *(const int64_t *)b);
}

/* entries of every point into entry [8 n_point], weights into out; what is met is counted in start */
static void list_entries(const pal_grid *grid, const double *x, int64_t *entry, pal_grid_weights *out)
{
    int n = 0;
    for (int i = 0; i < out->n_point; i++) {
        int64_t node[8];
        double weight[8];
        out->start[i] = n;
        pal_trilinear(grid, x + 3 * (size_t)i, node, weight);
        for (int k = 0; k < 8; k++) {
            if (!(weight[k] > 0)) continue;
            entry[n] = node[k];
            out->weight[n++] = weight[k];
        }
    }
    out->start[out->n_point] = n;
}

pal_err pal_grid_weights_make(const pal_grid *grid, const double *x, int n_point, pal_grid_weights *out)
{
    size_t max = 8 * (size_t)n_point + 1;
    *out = (pal_grid_weights){.n_point = n_point};
    if (max > INT32_MAX) return PAL_ERR_MEMORY;
    pal_err err = PAL_ERR_OK;
    int64_t *entry;
    PAL_ARRAY(&err, entry, max);
    PAL_ARRAY(&err, out->start, n_point + 1);
    PAL_ARRAY(&err, out->node, max);
    PAL_ARRAY(&err, out->weight, max);
    PAL_ARRAY(&err, out->used, max);
    if (err) {
        free(entry);
        pal_grid_weights_free(out);
        return err;
    }
    list_entries(grid, x, entry, out);
    /* used nodes: the entries in order, each once */
    size_t n = (size_t)out->start[n_point];
    memcpy(out->used, entry, n * sizeof *entry);
    qsort(out->used, n, sizeof *out->used, compare_node);
    for (size_t k = 0; k < n; k++)
        if (k == 0 || out->used[k] != out->used[out->n_used - 1]) out->used[out->n_used++] = out->used[k];
    for (size_t k = 0; k < n; k++) {
        const int64_t *found = bsearch(&entry[k], out->used, (size_t)out->n_used, sizeof *out->used, compare_node);
        out->node[k] = (int32_t)(found - out->used);
    }
    free(entry);
    return PAL_ERR_OK;
}

void pal_grid_weights_free(pal_grid_weights *w)
{
    PAL_FREE(w->start, w->node, w->weight, w->used);
    *w = (pal_grid_weights){0};
}

void pal_grid_weights_apply_transpose(const pal_grid_weights *w, const double *value, double *to)
{
    for (int i = 0; i < w->n_point; i++)
        for (int k = w->start[i]; k < w->start[i + 1]; k++) to[w->node[k]] += w->weight[k] * value[i];
}
