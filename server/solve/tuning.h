/* Tuning constants of solve: limits of what preflight calls weak. */
#ifndef PAL_SOLVE_TUNING_H
#define PAL_SOLVE_TUNING_H

/* shape quality (1: regular) of an element, edge in S, filled share and mass over the mean, below which preflight
 * reports a weak spot (tests/solve/test_preflight.c) */
#define PAL_WEAK_SHAPE  0.1
#define PAL_WEAK_EDGE_S 1e-6
#define PAL_WEAK_FILL   0.05
#define PAL_WEAK_MASS   1e-3
/* Poisson's ratio above which full integration locks; with less it is within some percent (tests/stability, case
 * poisson_static) */
#define PAL_LOCKING_POISSON 0.47
/* s: time constant of a body's return above which it is said to be slow: longer than a user waits for tissue to come
 * back (tests/solve/test_preflight.c) */
#define PAL_SLOW_RETURN_S 10
/* evaluations of the forces of which the fastest gives the cost of a step: a busy machine slows some of them
 * (tests/solve/test_preflight.c) */
#define PAL_COST_EVALUATIONS 3
#endif
