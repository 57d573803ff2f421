/* Tuning constants of calibration. Tests: tests/calibrate/test_equilibrium.c (E), test_calibrate.c (C), test_settle.c
 * (S), tests/house/test_calibrate.sh (H). */
#ifndef PAL_CALIBRATE_TUNING_H
#define PAL_CALIBRATE_TUNING_H

/* residual over the loads at an equilibrium, and above which a linear solve has failed; rest lengths above which a
 * stretched edge ends the search (E) */
#define PAL_EQUILIBRIUM_TOLERANCE 1e-9
#define PAL_LINEAR_RESIDUAL       1e-6
#define PAL_MAX_STRETCH           4.0
/* per cent squared: floor of mean e^2 in the objective: a thousandth of a per cent is accurate enough (C) */
#define PAL_ERROR_FLOOR 1e-6
/* annealing: share of the range of theta that is searched, beyond which most points have no equilibrium; share of it
 * below which steps change the error insignificantly, 5e-3 in ln k over 2 x 2 decades (C) */
#define PAL_ANNEAL_BOX     (2.0 / 3)
#define PAL_ANNEAL_COLDEST 5e-4
/* points of a truth farther outside the surface's box, over its diagonal, belong to another body (H) */
#define PAL_MAX_OUTSIDE 0.05
/* at rest: largest and mean speed over U/T, largest and mean acceleration over A (settle.h), for so many s (S) */
#define PAL_SETTLE_MAX_V  1e-4
#define PAL_SETTLE_MEAN_V 3e-5
#define PAL_SETTLE_MAX_A  1e-2
#define PAL_SETTLE_MEAN_A 1e-3
#define PAL_SETTLE_HOLD_S 0.25
#endif
