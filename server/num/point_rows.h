/* Sparse rows that place points as weighted sums of other points: d = A p (A eq. 1). Row i has the entries
 * start[i] .. start[i+1]-1, their points ascending and each once. The weights of a row sum to 1.
 * Owns its arrays (heap). Thread: [load] to make, [any] to read. */
#ifndef PAL_NUM_POINT_ROWS_H
#define PAL_NUM_POINT_ROWS_H
#include "server/base/err.h"

#include <stddef.h>
#include <stdint.h>

typedef struct pal_point_rows {
    int32_t n_row, n_point;
    int32_t *start; /* [n_row+1]                            */
    int32_t *point; /* of 0..n_point-1      [start[n_row]]  */
    double *weight; /*                      [start[n_row]]  */
} pal_point_rows;

void pal_point_rows_free(pal_point_rows *rows); /* and zeroes the struct; a zeroed struct is fine */
/* n points, each itself; MEMORY */
pal_err pal_point_rows_identity(int32_t n, pal_point_rows *out);
/* out = outer inner: rows of outer, points of inner (outer's points are inner's rows). BUDGET when it has more than
 * most_entry entries; MEMORY */
pal_err pal_point_rows_product(const pal_point_rows *outer, const pal_point_rows *inner, int64_t most_entry,
                               pal_point_rows *out);
/* d = A p; p [n_point][3], d [n_row][3], apart */
void pal_point_rows_place(const pal_point_rows *rows, const double *p, double *d);
/* g += A' f: forces on the rows pulled back to the points; f [n_row][3], g [n_point][3], apart */
void pal_point_rows_pull(const pal_point_rows *rows, const double *f, double *g);
/* memory of the arrays */
size_t pal_point_rows_bytes(const pal_point_rows *rows);

/* Rows as they are made, one after the other. Weights are added to the open row in any order, then it is ended. The
 * first failure is kept; adding after it does nothing. */
typedef struct pal_row_build {
    pal_point_rows rows;
    int64_t cap, most;
    int32_t row_cap, n_open;
    int32_t *open; /* points of the open row                 [n_point] */
    double *sum;   /* their weights, 0 for all others        [n_point] */
    uint8_t *in;   /* 1: point is in the open row            [n_point] */
    pal_err err;
} pal_row_build;

/* room for n_row rows of n_point points; BUDGET once there are more than most_entry entries */
pal_err pal_row_build_begin(pal_row_build *b, int32_t n_row, int32_t n_point, int64_t most_entry);
static inline void pal_row_add(pal_row_build *b, int32_t point, double weight)
{
    if (!b->in[point]) b->in[point] = 1, b->open[b->n_open++] = point;
    b->sum[point] += weight;
}
/* ends the open row; entries that have cancelled are left out */
void pal_row_end(pal_row_build *b);
/* takes the rows out when all went well, frees the rest in any case */
pal_err pal_row_build_finish(pal_row_build *b, pal_point_rows *out);
#endif
