/* Constants of components: unit, reason, test that bounds each. Those of contact are in contact/tuning.h, the limits of
 * inversion in recovery/tuning.h; defaults of keys stand at the head of each component. */
#ifndef PAL_SIM_EFFECTS_TUNING_H
#define PAL_SIM_EFFECTS_TUNING_H

/* loaded area over a triangle's area at rest at most: a load that grows with the area it inflates has no equilibrium
 * from about E/3 on (test_brush) */
#define MAX_AREA 2
/* S: distance from rest at which sleep may freeze a body, a tenth of what robustness trials allow a body that has
 * returned (tests/sim/effects/test_return.c) */
#define PAL_SLEEP_ERROR_S 1e-4

/* ---- refine (test_refine, test_refine_criteria) ---- */

/* of the mean edge of level 0. A body that moved by less, and whose loads are the same, is not evaluated again */
#define STILL_EDGES 1e-4
/* of the energy without rigid motion. A smaller change at a switch is not worth a factor on the stiffness */
#define RAMP_FROM 2.5e-3
#endif
