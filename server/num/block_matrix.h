/* Symmetric sparse matrices of 3x3 blocks, such as stiffness and mass of n points with three unknowns each: the lower
 * triangle by block columns. The pattern is made once per topology, the values are rewritten. Memory: the caller's
 * arena. Thread: [load] to make, then one thread at a time. */
#ifndef PAL_NUM_BLOCK_MATRIX_H
#define PAL_NUM_BLOCK_MATRIX_H
#include "server/base/arena.h"

#include <stdint.h>

typedef struct pal_block_matrix {
    int n;          /* block rows and columns                                                     */
    int32_t *start; /* first block of each column                           [n + 1]               */
    int32_t *row;   /* block row, ascending; the first of a column is the diagonal [start[n]]      */
    double *value;  /* A(3 row + r, 3 column + c) at [9 block + 3 r + c]     [start[n]][9]         */
} pal_block_matrix;

/* the power of two near 1 / max, the largest diagonal entry: scaled values fit single precision whatever the units */
double pal_block_matrix_scale(double max);

/* points that are coupled with one another, n_corner at a time (the elements of a component) */
typedef struct pal_cliques {
    int n_item, n_corner;
    const int32_t *node; /* [n_item][n_corner], 0 <= node < n */
} pal_cliques;

/* pattern of all pairs within the cliques of all n_list lists, and every diagonal; values zero; MEMORY */
pal_err pal_block_matrix_make(int n, const pal_cliques *list, int n_list, pal_arena *arena, pal_block_matrix *out);
/* index of the block at (i, j), i >= j; -1: not in the pattern. By bisection of the column */
int pal_block_matrix_find(const pal_block_matrix *a, int i, int j);
void pal_block_matrix_zero(pal_block_matrix *a);
/* y += s A x; x, y [n][3] */
void pal_block_matrix_multiply(const pal_block_matrix *a, double s, const double *x, double *y);
#endif
