/* Lanczos' iteration for the largest eigenvalue of K v = lambda M v, K symmetric, M symmetric positive definite, both
 * given as functions; in the inner product of M (Parlett, The symmetric eigenvalue problem, 15.11). The bound is the
 * largest Ritz value plus its residual (Zhou and Li, Bounding the spectrum of large Hermitian matrices, 2011). No heap.
 * Thread: any, one per struct. */
#ifndef PAL_NUM_LANCZOS_H
#define PAL_NUM_LANCZOS_H

#include <stdbool.h>

enum { PAL_LANCZOS_MAX = 32 };

typedef struct pal_lanczos {
    int n;                                                      /* unknowns */
    bool (*multiply)(void *user, const double *v, double *out); /* out = K v; false: give up */
    bool (*solve)(void *user, const double *b, double *out);    /* out ~ M^-1 b; false: give up */
    void *user;
    double *z;     /* in: M times the first vector, not 0; out: M times the Ritz vector, to start the next call [n] */
    double *basis; /* work [n_basis][n]: as many as iterations, or 2 without a Ritz vector in z                   */
    int n_basis;
    double *w, *u; /* work [n]                                                                                     */
    int done;      /* out: iterations                                                                              */
    double ritz, residual; /* out: the largest Ritz value, and the maximum distance of an eigenvalue from it */
} pal_lanczos;

/* at least `min` and at most `max` (<= PAL_LANCZOS_MAX) iterations, until residual <= tolerance * ritz. Returns
 * ritz + residual; NaN: given up or not finite */
double pal_lanczos_run(pal_lanczos *l, double tolerance, int min, int max);
#endif
