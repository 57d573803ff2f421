/* Sparse interpolation matrix A, whose rows give points as weighted sums of other points: d = A p (paper A eq. 1). Row
 * i has the entries start[i] .. start[i+1]-1, their points ascending and each once. The weights of a row sum to 1. Owns
 * its arrays (heap). Thread: [load] to make, [any] to read. */
#ifndef PAL_NUM_INTERPOLATION_H
#define PAL_NUM_INTERPOLATION_H
#include "server/base/err.h"

#include <stddef.h>
#include <stdint.h>

typedef struct pal_interpolation {
    int32_t n_row, n_point;
    int32_t *start; /* [n_row+1]                            */
    int32_t *point; /* of 0..n_point-1      [start[n_row]]  */
    double *weight; /*                      [start[n_row]]  */
} pal_interpolation;

void pal_interpolation_free(pal_interpolation *rows); /* and zeroes the struct; a zeroed struct is fine */
/* the identity of n points; MEMORY */
pal_err pal_interpolation_identity(int32_t n, pal_interpolation *out);
/* out = outer inner (the points of outer are the rows of inner). BUDGET: more than max_entry entries; MEMORY */
pal_err pal_interpolation_product(const pal_interpolation *outer, const pal_interpolation *inner, int64_t max_entry,
                                  pal_interpolation *out);
/* d = A p; p [n_point][3] and d [n_row][3] do not overlap */
void pal_interpolation_apply(const pal_interpolation *rows, const double *p, double *d);
/* g += A' f: forces on the rows applied to the points; f [n_row][3] and g [n_point][3] do not overlap */
void pal_interpolation_apply_transpose(const pal_interpolation *rows, const double *f, double *g);
/* memory of the arrays */
size_t pal_interpolation_bytes(const pal_interpolation *rows);

/* A matrix that is built row by row. Weights are added to the open row in any order, then the row is ended. The first
 * error is kept; later calls have no effect. */
typedef struct pal_interpolation_builder {
    pal_interpolation rows;
    int64_t max; /* entries */
    int32_t row_cap, n_open;
    int32_t *open; /* points of the open row                 [n_point] */
    double *sum;   /* their weights, 0 for all others        [n_point] */
    uint8_t *in;   /* 1: point is in the open row            [n_point] */
    pal_err err;
} pal_interpolation_builder;

/* reserves n_row rows of n_point points; BUDGET once there are more than max_entry entries */
pal_err pal_interpolation_builder_begin(pal_interpolation_builder *b, int32_t n_row, int32_t n_point,
                                        int64_t max_entry);
static inline void pal_interpolation_builder_add(pal_interpolation_builder *b, int32_t point, double weight)
{
    if (!b->in[point]) b->in[point] = 1, b->open[b->n_open++] = point;
    b->sum[point] += weight;
}
/* ends the open row; entries that have cancelled are dropped */
void pal_interpolation_builder_end_row(pal_interpolation_builder *b);
/* adds the rows of outer inner; outer NULL: the identity */
void pal_interpolation_builder_product(pal_interpolation_builder *b, const pal_interpolation *outer,
                                       const pal_interpolation *inner);
/* adds and ends a row: the mean of n points */
void pal_interpolation_builder_mean(pal_interpolation_builder *b, const int32_t *point, int32_t n);
/* moves the matrix out if there was no error; frees everything else in any case */
pal_err pal_interpolation_builder_finish(pal_interpolation_builder *b, pal_interpolation *out);
#endif
