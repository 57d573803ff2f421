/* Tuning constants of the robustness cases. S: box diagonal of a body. Bounded by tests/robustness and by
 * tests/house/test_robustness.sh, which run the cases on bodies that must pass. */
#ifndef PAL_ROBUSTNESS_TUNING_H
#define PAL_ROBUSTNESS_TUNING_H

/* RMS distance from rest, in S, that counts as returned: a tenth of a millimetre on a liver */
#define PAL_RETURN_S 1e-3
/* s allowed for the return (also the lower bound where slow bodies get more) */
#define PAL_RETURN_TIME_S 10.0
/* RMS speed, S/s, that counts as rest: a tenth of that distance in that time. A body whose supports were switched may
 * still creep towards its new rest, a hundred times as fast */
#define PAL_REST_SPEED_S_S     (0.1 * PAL_RETURN_S / PAL_RETURN_TIME_S)
#define PAL_SWITCHED_SPEED_S_S (100 * PAL_REST_SPEED_S_S)
/* s: rest must last this long, so that a turning point of an oscillation is not mistaken for it */
#define PAL_REST_HOLD_S 0.25
/* trend of a return (return_watch.h): looked for after FIRST s, then each time the time has grown by EACH; the rates of
 * its two quarters differ by at most UNEVEN; where the rate is that of the body's own time constant within TAU_SHARE, a
 * fall of the error by exp(FALL) suffices, else exp(1); the return is extrapolated where it takes SAVES times as long.
 * A body that would stop a fifth of its error off rest shows another rate than its own (robustness/test_return_watch)
 */
#define PAL_TREND_FIRST_S   4.0
#define PAL_TREND_EACH      1.2
#define PAL_TREND_UNEVEN    0.03
#define PAL_TREND_TAU_SHARE 0.15
#define PAL_TREND_FALL      0.05
#define PAL_TREND_SAVES     1.25
/* time constants after which a displacement of 0.01 S is within 1e-7 S, a tenth of the drift allowed in an hour; those
 * of an implicit step while a body settles. A step is one linearised iteration: one of four time constants is a search
 * for balance, which on a slender loaded body fails or lasts longer than the motion (tests/stability/by_family.md) */
#define PAL_SETTLE_TAU    12
#define PAL_LONG_STEP_TAU 0.1
/* energy rise over the input, as a share: rounding and contact corrections; solvers whose velocities lag (robustness.h)
 */
#define PAL_ENERGY_SLACK         0.01
#define PAL_ENERGY_SLACK_VERLET  0.05
#define PAL_ENERGY_SLACK_CENTRAL 0.3
/* S, correction of a contact in one step, which a tool may add to the energy times its force cap */
#define PAL_TOOL_CORRECTION_S 0.02
/* share of the body's weight (or its node load cap) times S, an energy that is rounding */
#define PAL_NO_ENERGY 1e-9
/* share of what a node bears (or the weight) that bends a body without crushing an element; a tenth, E h^2 on a full
 * node, crushes one (in a liver of 6 voxels; a beam, and a liver of 8, bear a fifth) */
#define PAL_BEND_SHARE 0.05
/* processor time, s, of all cases: at least this, and enough for so many simulated seconds */
#define PAL_ROBUSTNESS_CPU_S       60.0
#define PAL_ROBUSTNESS_SIMULATED_S 500.0
#endif
