/* Incomplete Cholesky factor of a pal_block_matrix without fill, L D L' by blocks of 3x3 on the pattern of the matrix
 * (IC(0); Meijerink & van der Vorst 1977), to precondition conjugate gradients where a complete factor is too large:
 * for a body of 16,000 nodes it takes a fiftieth of the memory. Stiffness is not an M-matrix, so pivots may fail to be
 * positive definite: the diagonal is then shifted, A + s diag(A), with a growing s until all pivots are (Manteuffel
 * 1980).
 *
 * Fixed points (rows and columns) are left out; solves give 0 there. Values are kept in single precision, inverses of
 * pivots in double. Memory: the caller's arena. Thread: [load] to make, then one thread at a time. */
#ifndef PAL_NUM_INCOMPLETE_CHOLESKY_H
#define PAL_NUM_INCOMPLETE_CHOLESKY_H
#include "server/num/block_matrix.h"

typedef struct pal_incomplete_cholesky {
    const pal_block_matrix *pattern; /* borrowed                                                      */
    const uint8_t *fixed;            /* borrowed; NULL: none                                     [n]  */
    double scale;                    /* of the values, a power of two near 1 / largest diagonal       */
    double shift;                    /* s of the last factor                                          */
    float *lower;                    /* blocks of L below the diagonal, as in pattern [start[n]][9]   */
    double *inverse;                 /* D^-1                                                   [n][9] */
} pal_incomplete_cholesky;

/* MEMORY. [load] */
pal_err pal_incomplete_cholesky_make(const pal_block_matrix *pattern, const uint8_t *fixed, pal_arena *arena,
                                     pal_incomplete_cholesky *out);
/* factor of a (same pattern). NUMERIC: a diagonal block is not positive definite or a value is not finite */
pal_err pal_incomplete_cholesky_factor(pal_incomplete_cholesky *f, const pal_block_matrix *a);
/* x = (L D L')^-1 b, b [n][3] may be x. No heap */
void pal_incomplete_cholesky_solve(const pal_incomplete_cholesky *f, const double *b, double *x);
#endif
