/* Tuning constants of calibration. Tests: tests/calibrate/test_equilibrium.c (E), test_calibrate.c (C), test_settle.c
 * (S), test_recorded_loads.c (R), tests/house/test_calibrate.sh (H). */
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
/* touches of a recording: s without a force that end one, as contact may miss a step; share of its largest displacement
 * above which its stillest moment is looked for; s of the mean of forces there; share of the recording's largest force
 * below which a touch is no load; 1/s, speed over displacement above which a displacement is not one at rest (R) */
#define PAL_TOUCH_GAP_S  0.1
#define PAL_HELD_SHARE   0.8
#define PAL_HELD_MEAN_S  0.05
#define PAL_TOUCH_SHARE  0.05
#define PAL_HELD_MAX_1_S 0.05
/* releases: s that are compared, at most and at least; share of a touch's largest displacement that must be left when
 * its force ends, else the tissue followed the hand; longest time whose forces are kept, s; share of the
 * recording's largest displacement below which the body is at rest when a touch begins; range of damping rates, 1/s,
 * the number of rates tried first, the relative width of the last interval,
 * and per cent of a decay curve above which no rate explains the motion (R) */
#define PAL_RELEASE_S          3.0
#define PAL_RELEASE_MIN_S      0.2
#define PAL_RELEASE_SHARE      0.1
#define PAL_RELEASE_TOUCH_S    20.0
#define PAL_RELEASE_REST_SHARE 0.02
#define PAL_RELEASE_LOW_1_S    0.05
#define PAL_RELEASE_HIGH_1_S   100.0
#define PAL_RELEASE_RATES      9
#define PAL_RELEASE_WIDTH      0.01
#define PAL_RELEASE_PERCENT    5.0
#endif
