/* Constants of the solvers. */
#ifndef PAL_SIM_SOLVERS_TUNING_H
#define PAL_SIM_SOLVERS_TUNING_H

/* central_cg after a clamped displacement: largest divisor of the limit, by halvings. It returns to 1 like a contact
 * (PAL_BLEND_S) (tests/sim/solvers/test_central_cg.c, tests/stability/test_subdivision_cases.c) */
#define PAL_BACKOFF_MAX 8.0
/* verlet: loss of velocity in a sub-step times the share of added mass. The mass is chosen so that the sub-step is a
 * fixed part of the node's period, so that this is a damping ratio of half a percent at every length of sub-step
 * (tests/sim/world/test_world.c) */
#define PAL_HEAVY_LOSS 0.01
/* verlet: while a node moves by more than PAL_GUARD_MOVE in each sub-step, one in so many finds the bound again. It
 * changes by a tenth from one to the next then, and PAL_FAST_SAFETY leaves a factor of two of stability
 * (tests/stability/test_springs_cases.c) */
enum { PAL_FAST_SUBSTEPS = 4 };
/* verlet: part of the stability limit in such a motion. With the usual one a slender organ that a meganewton has drawn
 * out gains 0.4 of the energy that was put in (tests/robustness/test_robustness_answers.c), and a stretched slab with
 * added mass a hundred times its own (tests/sim/contact/test_step_length.c) */
#define PAL_FAST_SAFETY 0.5
/* static_newton: operations of a factor per entry that are worth one iteration with it, a product and two triangular
 * passes (tests/sim/solvers/test_fem_static.c) */
enum { PAL_FACTOR_FLOPS_PER_ENTRY = 20 };
/* static_newton: an iteration that leaves more of the residual is slow, and conjugate gradients on the true stiffness
 * that leave more have failed (tests/sim/solvers/test_fem_static.c) */
#define PAL_NEWTON_SLOW 0.1
/* elements. Farther than this the fastest node moves in a sub-step whose forces may be in single precision: a hundred
 * roundings of positions of 16 voxels. With none, a part of 10,000 times the stiffness of the rest gains a third of its
 * energy in 100,000 sub-steps (test_spring_single) */
#define PAL_SINGLE_MOVE 1e-4
/* elements. A body with a node farther than this from the one that positions in single precision are relative to has
 * forces in double precision. With none, the part of a body that came apart that is still held moves at 20 mm/s
 * without end once the rest is 2,500 elements away, ten times as fast as PAL_SINGLE_MOVE stops; at 90 it comes to rest
 * (test_spring_single) */
#define PAL_SINGLE_REACH 100
#endif
