/* Constants of contact between tools and tissue: unit, reason, test that bounds each. */
#ifndef PAL_SIM_CONTACT_TUNING_H
#define PAL_SIM_CONTACT_TUNING_H

/* ---- sizes ---- */

/* passing samples of a step; contacts of one tool; samples of one body; points that represent all of a contact in a
 * power iteration, and the tissue near a tool */
enum { PASSING_MAX = 4096, CONTACT_MAX = 2048, SAMPLE_MAX = 200000, EIGENVALUE_POINTS = 256, STIFFNESS_POINTS = 256 };
/* passes of a proxy's move: pushes out of points, and slides along planes (test_tool_push: at any speed) */
enum { PROXY_PUSHES = 4, PROXY_SLIDES = 8 };
/* power iterations for a contact (test_contact_spring); stiffnesses found in a step; solves of a sub-step after which
 * springs may be chosen again: contacts that act, friction that sticks or slides (test_contact_solved) */
enum { EIGENVALUE_PASSES = 2, STIFFNESS_BUDGET = 2, CHOOSE_ROUNDS = 3 };
/* conjugate-gradient passes for a stiffness. test_contact_implicit allows 5 % from the slope of the force: 1 is 6 %
 * off, 3 are 8 % off */
enum { STIFFNESS_PASSES = 2 };

/* ---- contact points ---- */

/* |sum of normals| of a fan over the sum of their lengths, 1 when flat, 0.58 at the corner of a voxel: a frame's
 * rotation counts in full above twice this and not at all below it, where it is rounding. Also the tangential part of a
 * frame's edge over its length, below which it gives no axis (test_contact_spring) */
#define FAN_FOLDED 0.2

/* ---- contact of a tool that pushes (test_tool_push, test_tool_cases) ---- */

/* s. The rates in the keys clamp_S and in GRASP_STRETCH refer to it, so they hold for steps of any length
 * (test_step_length) */
#define FRAME_S (1.0 / 60)
/* radii. The proxy keeps so far away from every point: points that far apart leave no hole for it */
#define MAX_DEPTH_RADII 0.5
/* m. A patch is published within a radius of the tool, at least within this: a hand at 0.5 m/s is there in 20 ms, a
 * frame and the network. test_tool_push bounds it to 9 to 12 mm */
#define NEAR_M 0.010
/* s. Time constant with which a proxy's side follows the direction of its force (test_step_length; at 0.1 ms a tool
 * passes its cap threefold, test_contact_implicit), and the time from one answer of the compliance to the next for a
 * patch: slower than frames, faster than a hand */
#define FOLLOW_S (4 * FRAME_S)
/* s. The same of a tool whose force nobody feels: only its caps ask for a stiffness then (test_contact_implicit) */
#define NO_HAPTICS_FOLLOW_S 0.5
/* radii. A tool that moved by less is at rest: its stiffness is not found again (0.01 to 0.03 alike,
 * test_contact_implicit). Contact less deep is at its beginning. Path over which a slope is averaged: 5 % longer lags
 * where tissue stiffens (test_tool_push) */
#define SHALLOW_RADII 0.03

/* ---- explicit contact ---- */

/* contact stiffness per area in E over radius: depth is then 1/80 of a radius at a mean pressure of E. With 100 the
 * published stiffness is more than 6 % off that of the force (test_tool_push) */
#define EXPLICIT_PRESSURE 80
/* the same where the solver holds loads through its stages. For all but very soft springs this is more than the
 * sub-step allows, so that the limit there decides (test_adaptive_body) */
#define HELD_PRESSURE 200
/* contact stiffness over m / dt^2, for solvers that do not take it implicitly. Symplectic steps are stable for a + 2 b
 * < 4 with a and b the ratios of stiffness and damping to m / dt^2 and m / dt; with half of the stability limit for
 * tissue, a = 1, and a damping of dt/2 this is 0.8 of the largest (test_tool_push) */
#define EXPLICIT_ALPHA 1.2
/* over the eigenvalue that two power iterations find, where test_contact_spring finds up to 1.22 times as
 * much, below which it fails */
#define EIGENVALUE_SAFETY 1.3

/* share of an excess over a cap that a proxy of implicit contact is taken back by in a sub-step: half, as tissue
 * follows late (at 1 test_contact_solved fails, at 5 a tool at its cap lets go of tissue, test_contact_implicit) */
#define BACK_GAIN 0.5

/* ---- grasps (test_tool_grasp, test_contact_implicit) ---- */

/* stiffness over that of tissue, which gives way so much more: of implicit contact over that of the tissue behind it,
 * of a grasp over E times its reach, eight times that of the tissue held (test_contact_implicit) */
#define TISSUE_RATIO 16
/* shares of m / dt^2 and m / dt that spring and damper of an explicit grasp take of a node's stability, where the
 * solver does not take them implicitly */
#define GRASP_SHARE 0.25
/* box diagonals. An implicit grasp stretches by no more in FRAME_S, so that a tool that jumps does not strike (at 1
 * test_contact_implicit fails) */
#define GRASP_STRETCH 0.02

/* ---- rendered stiffness (test_contact_implicit, test_tool_push, test_tool_grasp) ---- */

/* N/m. Range of stiffness that devices render */
static const struct {
    double low, high;
} STIFFNESS_N_M = {10, 5000};
/* directions within 75 degrees of its axis belong to a group */
#define GROUP_COSINE 0.25
/* radii. Tissue that is farther than the nearest by less counts as near (at 0.5 test_contact_implicit fails) */
#define NEAREST_RADII 0.2
/* share of a force that counts as no change: a stiffness is not found again for it; springs may pull, points come
 * through and friction miss its limit by so much without another solve (test_contact_solved); contact stays so far
 * below a cap, the rest being for what one step adds (at 0.05 test_contact_implicit fails) */
#define FORCE_SHARE 0.02
#endif
