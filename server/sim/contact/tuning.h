/* Constants of contact between tools and tissue: unit, reason, test that bounds each. */
#ifndef PAL_SIM_CONTACT_TUNING_H
#define PAL_SIM_CONTACT_TUNING_H

/* ---- contact points ---- */

/* passing samples of a step, and parts that an edge is cut into for them. 6: a triangle stretched 3 times beyond the
 * spacing, as far as tissue goes under a tool, has no hole as wide as half a radius (test_tool_cases) */
enum { PASSING_MAX = 4096, PASSING_CUTS = 6 };

/* ---- contact of a tool that pushes (test_tool_push, test_tool_cases) ---- */

/* radii. The proxy keeps so far away from every point: points that far apart leave no hole for it */
#define MAX_DEPTH_RADII 0.5
/* contacts of one tool at a time; samples of one body */
enum { CONTACT_MAX = 2048, SAMPLE_MAX = 200000 };
/* share of a proxy's old side in its new one, over that of the force: it turns in some steps, not at once */
#define SIDE_STEPS 4
/* m. A patch is published within a radius of the tool, at least within this: a hand at 0.5 m/s needs 20 ms */
#define NEAR_M 0.010
/* s. The time that the rates per frame refer to, and the keys clamp_S and GRASP_STRETCH: they held for a step of 60 Hz
 * and hold for any other alike (test_step_length) */
#define FRAME_S (1.0 / 60)
/* least share of the force that contact with other triangles begins with (blend.h: PAL_BLEND_CONTACT_S) */
#define MIN_RAMP 0.01

/* ---- explicit contact ---- */

/* contact stiffness per area in E over radius: depth is then 0.5 % of a radius at a mean pressure of E */
#define EXPLICIT_PRESSURE 200
/* over the eigenvalue that two power iterations find, which is low by up to a quarter */
#define EIGENVALUE_SAFETY 1.3
/* s. The share of the stiffness rises at this rate at most: where the limit falls away for one sub-step only, contact
 * does not follow (test_subdivision_fem: a pressed solid stays at rest; 0.04 does not) */
#define SHARE_RISE_S 0.15
/* radii. Points so near a proxy may come to touch before the solver asks again */
#define WANTED_RADII 1.25

/* ---- implicit contact (test_contact_implicit, test_contact_rest) ---- */

/* contact over tissue stiffness: tissue gives way 15 times as much as contact */
#define IMPLICIT_STIFFNESS 15.0
/* shares by which the stiffness rises in FRAME_S while the proxy is kept from its tool, and falls while contact is
 * shallower than so many radii; largest product */
#define STIFFEN        0.3
#define SOFTEN         0.05
#define MAX_STIFFENING 8.0
#define SHALLOW_RADII  0.05
/* of a cap: contact itself gives this much, the rest is for what one step adds */
#define BELOW_CAP 0.98
/* radii. A tool that moved by less rests */
#define REST_RADII 0.01

/* ---- grasps (test_tool_grasp, test_contact_implicit) ---- */

/* stiffness in E times reach: eight times that of the tissue held, so that tissue follows the tool and not the spring
 */
#define GRASP_STIFFNESS 16
/* shares of m / dt^2 and m / dt that spring and damper of an explicit grasp take of a node's stability */
#define GRASP_ALPHA 0.25
#define GRASP_BETA  0.25
/* box diagonals. An implicit grasp stretches by no more in FRAME_S, so that a tool that jumps does not strike */
#define GRASP_STRETCH 0.02

/* ---- solves of implicit contact (test_contact_solved) ---- */

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
/* stiffnesses found in a step; points that stand for near tissue; radii within which they are as near as the nearest */
enum { STIFFNESS_BUDGET = 2, STIFFNESS_POINTS = 256 };
#define NEAR_RADII 0.125
/* radii cubed of tissue that moves along with a tool, for damping */
#define DRAG_VOLUME 4
/* passes of conjugate gradients for a contact: one is 8 % low under a round tool, two less than 1 % */
enum { STIFFNESS_PASSES = 2 };
/* least share that turning of contacts leaves of a stiffness: the linear estimate of it ends there */
#define MIN_TURNED 0.25
#endif
