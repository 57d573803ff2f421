/* Sparse Cholesky factors of pal_block_matrix by CHOLMOD: the pattern is analysed once, values are factored any number
 * of times, on the caller's thread or on a spare one. Solves are our own (supernodal, no BLAS, no heap, no threads), in
 * double precision or, for preconditioning, with a single precision copy of the factor at half the memory traffic.
 *
 * Fixed points (rows and columns) are left out of the factor; solves give 0 there. A matrix that is not positive
 * definite or does not fit into memory is an error code, never an abort; the previous factor stays in use. Thread: one
 * at a time, except the work of the spare thread. */
#ifndef PAL_NUM_CHOLESKY_H
#define PAL_NUM_CHOLESKY_H
#include "server/num/block_matrix.h"

#include <stdbool.h>

typedef struct pal_cholesky pal_cholesky;

/* analyses the pattern of a (nested dissection or minimum degree, whichever gives the smaller factor); fixed [n] may be
 * NULL; the pattern and fixed are copied. MEMORY. [load] */
pal_err pal_cholesky_create(const pal_block_matrix *a, const uint8_t *fixed, pal_cholesky **out);
void pal_cholesky_destroy(pal_cholesky *c); /* joins the spare thread; NULL is fine */

/* factor of a (same pattern), single: keep the single precision copy and drop the double one. NUMERIC: not positive
 * definite or not finite; MEMORY. The spare thread must not be at work (STATE). */
pal_err pal_cholesky_factor(pal_cholesky *c, const pal_block_matrix *a, bool single);
/* x = A^-1 b, b [n][3] may be x. No heap call. STATE: there is no factor; NUMERIC: b is not finite */
pal_err pal_cholesky_solve(pal_cholesky *c, const double *b, double *x);
/* a second factor on a spare thread: copies the values of a and returns at once. STATE: one is under way */
pal_err pal_cholesky_refresh(pal_cholesky *c, const pal_block_matrix *a);
/* Waits for the factor of the spare thread and puts it into use. STATE: none was begun; NUMERIC, MEMORY: it failed and
 * the previous factor stays */
pal_err pal_cholesky_adopt(pal_cholesky *c);
int64_t pal_cholesky_nonzeros(const pal_cholesky *c); /* of the factor */
double pal_cholesky_flops(const pal_cholesky *c); /* of one factorisation, from the analysis: equal on all machines */
#endif
