/* Constants of implicit systems and their solvers. */
#ifndef PAL_SIM_IMPLICIT_TUNING_H
#define PAL_SIM_IMPLICIT_TUNING_H

/* Relative error of a solve that counts as none: default of key `tolerance`, residual of a static compliance, the share
 * of its energy that a solved stage may gain by its own error of time (tests/sim/solvers/test_fem_dynamic.c), and the
 * accuracy of a largest eigenvalue by Lanczos iteration, of which the solves with the mass in it have the square
 * (tests/sim/solvers/test_central_cg.c) */
#define PAL_SOLVER_TOLERANCE 1e-2
/* Share of its first residual that a solve leaves while contact still chooses which points touch. Of a recorded press
 * into 15,770 nodes the forces of points that choose wrongly are 1.4 % of all at the end of a step, 1.9 % with 0.05,
 * and with 0.3 the last choices are wrong by as much as the force itself (`palpate replay`; test_contact_solved) */
#define PAL_ROUGH_TOLERANCE 0.1
/* Relative differences that are rounding: residuals below this share of the step's loads, so that a body at rest costs
 * no iteration (tests/sim/solvers/test_fem_dynamic.c), and energies that count as equal in a line search, as in Hager
 * and Zhang 2005 (tests/sim/solvers/test_fem_static.c) */
#define PAL_SOLVER_FLOOR 1e-7
/* of 10 E h^2 (load_cap_N), the same for a body without loads: such forces move a node by the rounding of positions
 * (tests/stability/test_rest_after_cases.c) */
#define PAL_UNLOADED_FLOOR 1e-11
/* s, simulated. After a sub-step that gained energy in spite of all iterations sdirk2 takes backward Euler for as long:
 * a crushed body gains in one of thirty sub-steps (tests/stability/test_fem_shapes.c). Between two refreshed factors,
 * each of which takes the spare thread and a copy of the matrix; with 0.5 s a material edit gains energy
 * (tests/sim/solvers/test_solve_report.c, stability/test_fem_numbers.c) */
#define PAL_PAUSE_S 0.33
/* rad, RMS over the elements. The coarse levels of multigrid are turned after as much: a recorded pull of 15,770 nodes
 * takes 1.90 iterations a step with 0, 1.91 with 0.02 and 1.94 with 0.05 (`palpate replay`), and a beam that swings as
 * many as when they are turned in every step (test_preconditioner) */
#define PAL_TURN_RAD 0.02
/* s, simulated. A column of the answers to a spring of contact is renewed after as long: a pulled liver of 15,770 nodes
 * takes as many iterations with 0.05 and with 0.2, and a beam bent by 60 degrees 16 with those of the straight one, 14
 * with its own, 18 with none (tests/sim/implicit/test_woodbury.c) */
#define PAL_WOODBURY_RENEWAL_S 0.1
/* displacement over an element's edge of a difference of forces that gives a product with the true stiffness: far above
 * the rounding of forces in single precision, far below a change of stiffness (tests/sim/implicit, tests/sim/solvers)
 */
#define PAL_DIFFERENCE_H 1e-5
/* operations a second that every machine does on a spare thread: the simulated time after which a refreshed factor
 * takes effect is its operations over this (tests/sim/solvers/test_solve_report.c) */
#define PAL_REFRESH_FLOPS 1e9

/* estimated relative error at which two searches end: of the square of a body's lowest frequency, which is then below
 * 1 % off, but for two modes less than 3 % apart, of the 5 % that damping, sleep and reports need; and of the static
 * compliance of an explicit body as the preconditioner sees it: at 1e-2 a stiffness is 10 % off the slope of the force
 * (tests/sim/implicit/test_lowest_frequency.c, tests/sim/contact/test_haptic_models.c). Of
 * diagonal over mass, the shift that makes a singular stiffness definite, and the square of a frequency below which a
 * body counts as not held: a slender body has 1e-7, rounding of differences of forces 1e-11
 * (tests/sim/implicit/test_lowest_frequency.c) */
#define PAL_SEARCH_TOLERANCE 2e-3
/* the same for the static compliance of an implicit body, whose preconditioner is that of another shape: a strongly
 * bent body's is within 3.5 %, with 2e-3 within 5.2 % (tests/sim/solvers/test_fem_static.c) */
#define PAL_COMPLIANCE_GAIN 1e-3
#define PAL_FREQUENCY_SHIFT 1e-12
#define PAL_FREQUENCY_ZERO  1e-10

/* stiffness of an element over that of the softest, above which it has a part in the factor of the stiff nodes. A
 * contrast of 10 takes 6 or 7 iterations without this factor, too few for what it costs; 30 takes 7 to 10, and 5 with
 * it; 100 nearly three times as many as with it (tests/bench) */
#define PAL_STIFF_CONTRAST 20
/* entries of a factor that solves faster than multigrid: 6 MB, most of which stays in the processor's caches
 * (tests/bench) */
#define PAL_FACTOR_ENTRIES 1.5e6

enum {
    /* nodes below which a factor is best whatever its pattern, and above which it is not analysed; also not of the
     * stiff nodes alone (tests/bench) */
    PAL_MULTIGRID_NODES_MIN = 1000,
    PAL_MULTIGRID_NODES = 5000,
    /* the coarsest level: a factor that takes a twentieth of a cycle (tests/sim/implicit/test_preconditioner.c) */
    PAL_COARSEST_NODES = 600,
    /* iterations after which the levels of a static solve are made of the present state: they cost as much as these
     * (tests/bench) */
    PAL_MULTIGRID_ITERATIONS = 20,
    /* products with all nodes, times nodes, that finding an interpolated matrix may take at load, ten seconds of 500
     * operations for a node; forces of a node that finding a stiffness without tangents may take, about a second
     * (tests/sim/implicit/test_interpolated_implicit.c, test_lowest_frequency.c) */
    PAL_PROBE_WORK_MAX = 20000000,
    /* edge of a rigid cluster in distances of points: 150 to 850 clusters on bodies of 2,600 to 17,000 points, whose
     * factor is a tenth of the work (tests/sim/implicit/test_lowest_frequency.c) */
    PAL_FREQUENCY_CLUSTER = 3,
    /* iterations of the search at most: several times what bodies with loose border elements take */
    PAL_FREQUENCY_ITERATIONS = 300,
    /* products in a simulated second, four in 1/60 s: columns of an interpolated matrix found again after an edit, and
     * of the true stiffness for the static compliance of an explicit body, 8 evaluations of forces beside those of some
     * 20 sub-steps (tests/sim/contact/test_haptic_models.c) */
    PAL_PROBES_1_S = 240,
    /* Newton iterations, at most, of a sub-step that began with one and gained energy */
    PAL_SAFEGUARD_NEWTON = 8
};
#endif
