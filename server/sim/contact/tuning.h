/* Constants of contact between tools and tissue: unit, reason, test that bounds each. */
#ifndef PAL_SIM_CONTACT_TUNING_H
#define PAL_SIM_CONTACT_TUNING_H

/* ---- contact points ---- */

/* passing samples of a step, and parts that an edge is cut into for them. 6: a triangle stretched 3 times beyond the
 * spacing, as far as tissue goes under a tool, has no hole as wide as half a radius (test_tool_cases) */
enum { PASSING_MAX = 4096, PASSING_CUTS = 6 };

/* ---- implicit contact (test_contact_solved) ---- */

/* solves of a sub-step after which springs may be chosen again: contacts that act, friction that sticks or slides */
enum { CHOOSE_ROUNDS = 2 };
/* share of the pushing forces that springs may pull, or points may come through, without another solve */
#define WRONG_SHARE 0.05
/* friction may pass its limit, or fall short of it, by this share without another solve */
#define FRICTION_SLACK 0.02

/* ---- rendered stiffness (test_contact_implicit, test_tool_push, test_tool_grasp) ---- */

/* m. Smaller moves of a tool teach no slope: rounding and a hand's tremor would */
#define MIN_MOVE_M 0.05e-3
/* weight of a sample over that of the next one; with moves of 0.05 mm the fit forgets in 0.25 mm */
#define FIT_FORGET 0.8
/* radii. Spread of displacements at which data weigh as much as the start value */
#define FIT_PRIOR_RADII 0.01
/* N/m. Range of stiffness that devices render */
#define MIN_STIFFNESS_N_M 10.0
#define MAX_STIFFNESS_N_M 5000.0
/* the fitted tangent stays within these multiples of the secant F/d, so that a reversal does not look like a soft wall,
 * once contact is so many radii deep */
#define MIN_SECANT   0.5
#define MAX_SECANT   6.0
#define SECANT_RADII 0.05
/* of the normal one, for a flat punch moved sideways: 2 (1 - nu) / (2 - nu) at nu 0.45 */
#define SIDEWAYS_STIFFNESS 0.71
/* a patch is the same one while its normal turns by less than 45 degrees from step to step */
#define SAME_COSINE 0.70710678118654752
/* directions within 75 degrees of its axis belong to a group */
#define GROUP_COSINE 0.25
/* radii. Tissue that is farther than the nearest by less is averaged in the direction of a near group */
#define NEAREST_RADII 0.2
/* a tool that moves less in a step, m, rests: what is shown is then low-passed over one step, 1 - 1/e */
#define REST_MOVE_M   0.2e-3
#define REST_LOW_PASS 0.63212055882855767
/* steps from one answer of the compliance to the next for a patch; change of force, as a share, and of direction (6
 * degrees) that ask for it */
enum { STIFFNESS_STEPS = 3 };
#define STIFFNESS_FORCE  0.02
#define STIFFNESS_COSINE 0.995
/* passes of conjugate gradients for a contact: one is 8 % low under a round tool, two less than 1 % */
enum { STIFFNESS_PASSES = 2 };
/* least share that turning of contacts leaves of a stiffness: the linear estimate of it ends there */
#define MIN_TURNED 0.25
#endif
