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
/* penalty of a support on a surface through voxels, times E / h: softer than stiff by 1 / GAMMA of a voxel's length,
 * which makes up for what voxels miss of the stress at a clamp's edge. 15 has 1.4 times the turned gear's error at 32
 * voxels and half of the turned beam's; the error falls as h, so that more is better from 64 voxels on
 * (tests/accuracy/test_cut_voxels.c) */
#define PAL_SUPPORT_GAMMA 9.0
/* twist of hex8_bbar in static problems (elements/elastic_hex.h). It halves the error of the gear at 24 to 48 voxels
 * and adds a twentieth to the beam's, two voxels thick or eight; a bending factor of 0.7 besides would take a fifth
 * more of the gear's and add 4 % to the error of two voxels (tests/accuracy/test_cut_voxels.c, test_fem_reference.c) */
#define PAL_SOLVE_TWIST 0.1
#endif
