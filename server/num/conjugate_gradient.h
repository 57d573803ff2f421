/* Preconditioned conjugate gradients for symmetric positive definite systems (Hestenes & Stiefel 1952), with the
 * preconditioner given as a function. beta is Polak and Ribiere's, so that a preconditioner which is not the same from
 * call to call (single precision, another cycle of multigrid) does no harm. No heap. Thread: any, one per struct. */
#ifndef PAL_NUM_CONJUGATE_GRADIENT_H
#define PAL_NUM_CONJUGATE_GRADIENT_H
#include "server/base/team.h"

#include <stdbool.h>

typedef struct pal_conjugate_gradient {
    int n;                                                          /* unknowns */
    void (*multiply)(void *user, const double *p, double *out);     /* out = A p                      */
    void (*precondition)(void *user, const double *r, double *out); /* out ~ A^-1 r                    */
    void *user;
    pal_team *team;    /* threads that share the sums; NULL: the caller's alone. The same bits with any number */
    double *r;         /* in: b - A x for the first guess x, out: of the last [n] */
    double *z, *p, *q; /* work [n]                                                */
    /* a search for x'b = x'A x alone, whose error is about r' A^-1 r: it ends once that is below the share `gain` of
     * `energy` as the preconditioner sees it. energy: in: x'b of the first guess, out: of the last; gain 0: not asked
     */
    double gain, energy;
    double residual; /* out: |r|, Euclidean                                     */
    int n_done;      /* out: iterations so far, while it runs too               */
    /* out, for precondition: its answer to this r was no descent, z'r <= 0; it is asked once more, for one that is
     * surely symmetric and positive definite */
    bool careful;
} pal_conjugate_gradient;

/* Improves x until |r| <= target, with at least `min` (unless r = 0) and at most `max` iterations; stops where a number
 * is not finite, a direction has no positive curvature, or a careful answer is no descent either. Returns the number of
 * iterations. */
int pal_conjugate_gradient_run(pal_conjugate_gradient *cg, double *x, double target, int min, int max);

/* dot product of n numbers in a fixed order, 8 partial sums in each of chunks of 16,384 numbers: the same bits on every
 * machine */
double pal_dot_product(int n, const double *a, const double *b);
#endif
