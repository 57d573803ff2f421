/* Tuning constants of error estimates. Tests: tests/accuracy/test_effectivity.c (A), tests/estimate/test_estimation.c
 * (E), test_estimate_predict.c (P), test_estimator.c (T), tests/net/test_switch_bound.c (N). */
#ifndef PAL_ESTIMATE_TUNING_H
#define PAL_ESTIMATE_TUNING_H

/* ns: time between two estimates, four a second as the viewer shows them (T) */
#define PAL_ESTIMATE_PERIOD_NS 250000000u
/* s of simulated time that the time and algebraic parts look ahead, and ms that this may take (A) */
#define PAL_AHEAD_S  0.1
#define PAL_AHEAD_MS 400.0
/* displacement over the body's size below which it is rounding (E) */
#define PAL_UNMOVED 1e-9
/* Solver tolerances. Steps without an algebraic error are solved to this share of the live tolerance, but no better
 * than to the floor unless the live one is near it: the algebraic part is within 10 % of what a tolerance of 1e-10
 * gives (E). Then that of a live solver unless set, and that of equilibria (A) */
#define PAL_EXACT_SHARE     3e-3
#define PAL_TOLERANCE_EXACT 1e-9
#define PAL_TOLERANCE_LIVE  1e-2
#define PAL_TOLERANCE_REST  1e-6
/* Order of convergence of nodal displacements: 1.2 to 2.1 was observed. For a true order of 1 to 2, assuming 1.5 is off
 * by a factor of 0.55 to 1.64; an order fitted to three meshes was less accurate, because the coarsest is four times as
 * coarse. Where changes still grow from mesh to mesh, 1.5 gave 0.2 of the true error, and 1 half to twice (A) */
#define PAL_USUAL_ORDER 1.5
#define PAL_EARLY_ORDER 1.0
/* fill below which a voxel is cut; share of the volume in cut voxels that is much; voxels across that are few (A) */
#define PAL_WHOLE_FILL 0.98
#define PAL_MUCH_CUT   0.1
#define PAL_FEW_ACROSS 2.5
/* Poisson's ratio above which fully integrated hexahedra and four-node tetrahedra lock (E) */
#define PAL_LOCKS_ABOVE 0.47
/* fill below which merged voxels are dropped; share of an edge by which supports are extended against rounding (A) */
#define PAL_MERGE_MIN_FILL 0.25
#define PAL_SUPPORT_SLACK  1e-6
/* E h^2: residual that rounding of positions leaves on a node of an unloaded body (E) */
#define PAL_UNLOADED_RESIDUAL 1e-11
/* accepted relative error of the work of contact; largest factor by which contact loads change at once (N) */
#define PAL_SAME_PRESS 0.05
#define PAL_MAX_PRESS  5.0

/* hierarchy: smallest ratio to the finest size at which an error is measured; order of closer meshes; the order that
 * is averaged with it; bounds of the error with twice the voxels and of the error over the last change (A) */
#define PAL_MIN_APART        1.35
#define PAL_HIERARCHY_ORDER  2.0
#define PAL_FAR_ORDER        1.75
#define PAL_MIN_TWICE        0.02
#define PAL_MAX_ERROR_CHANGE 20.0
/* observed factors of uncertainty: with a finest mesh of OBSERVED times the voxels; without a hierarchy (A) */
#define PAL_OBSERVED_FACTOR 2.0
#define PAL_OBSERVED_FINER  2.0
#define PAL_UNKNOWN_FACTOR  3.0
/* smallest cosine of two loads for which a measurement is reused; wait before the next one over its duration (E) */
#define PAL_SAME_LOADS 0.8
#define PAL_WAIT_SHARE 20.0

/* cost: bounds of the growth with nodes of step time on fewer nodes, and of factor entries on more; largest share of
 * the factor in a sub-step; largest exponent of iterations with nodes (P) */
#define PAL_MIN_GROWTH     0.6
#define PAL_MAX_GROWTH     2.2
#define PAL_MIN_FILL_RATE  1.1
#define PAL_MAX_FILL_RATE  1.6
#define PAL_MAX_FACTOR     0.7
#define PAL_MAX_ITERATIONS 0.15
/* neighbours that are offered: s, and tolerances that solvers accept (P) */
#define PAL_NEIGHBOUR_MIN_STEP_S    1e-4
#define PAL_NEIGHBOUR_MAX_STEP_S    0.1
#define PAL_NEIGHBOUR_MIN_TOLERANCE 1e-12
#define PAL_NEIGHBOUR_MAX_TOLERANCE 0.5
#endif
