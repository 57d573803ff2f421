/* The lowest eigenvalue of K v = lambda M v, K symmetric positive semi-definite, M symmetric positive definite, both
 * given as functions: locally optimal preconditioned conjugate gradients with one vector (Knyazev 2001, SIAM J. Sci.
 * Comput. 23(2)). The value is a Rayleigh quotient, hence never below the lowest eigenvalue. With an exact inverse of K
 * as preconditioner a few iterations do. No heap. Thread: any, one per struct. */
#ifndef PAL_NUM_LOWEST_MODE_H
#define PAL_NUM_LOWEST_MODE_H

typedef struct pal_lowest_mode {
    int n;                                                          /* unknowns */
    void (*stiffness)(void *user, const double *v, double *out);    /* out = K v; v and out do not overlap  */
    void (*mass)(void *user, const double *v, double *out);         /* out = M v                            */
    void (*precondition)(void *user, const double *r, double *out); /* out ~ K^-1 r, positive definite      */
    void *user;
    double *x;    /* in: the first vector, not 0; out: the mode, x' M x = 1 [n] */
    double *work; /* [9][n]                                                     */
    int done;     /* out: iterations                                            */
    /* out: the Rayleigh quotient, and an estimate of its relative distance from the eigenvalue: the residual in the
     * norm of the preconditioner, and the decrease that may still come. Both are 0 where K has a motion without energy
     */
    double lambda, error;
} pal_lowest_mode;

/* at least 3 and at most max iterations, until error <= tolerance; lambda NaN: a number is not finite */
void pal_lowest_mode_run(pal_lowest_mode *m, double tolerance, int max);
#endif
