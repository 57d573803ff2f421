/* Constants of force rendering: unit, reason, test that bounds each (tests/clients). */
#ifndef PAL_RENDERING_TUNING_H
#define PAL_RENDERING_TUNING_H

/* ---- rendered model (test_local_contact) ---- */

/* s. A moving surface is extrapolated for at most this time: two to three models at 60 Hz */
#define EXTRAPOLATE_MAX_S 0.05
/* m. The acting plane of a convex group changes when another one is nearer by this: above encoder steps */
#define HYSTERESIS_M 1e-4
/* s. Damping over stiffness, at least. A spring held for a tick T needs b > K T / 2 (Colgate and Schenkel 1997), lag
 * and filter as much again each; twice that when the hand looks off the handle and adds none (test_bridge_table) */
#define DAMPING_FLOOR_S          2.5e-3
#define DAMPING_FLOOR_HAND_OFF_S 5e-3
/* m/s. Slower than this, contact sticks again and the passivity controller rests: two encoder steps a tick of the
 * coarsest device, after the filter, are noise */
#define REST_SPEED_M_S 1e-3
/* N/m. A grasp softer than this along an axis has no bounded energy for its force there, and renders none: a tenth of
 * what the server's range of stiffness begins with */
#define GRASP_STIFFNESS_MIN_N_M 1.0
/* N/m. A patch that goes out is dropped below this: 5 mN at a depth of 10 mm */
#define PATCH_STIFFNESS_MIN_N_M 0.5

/* ---- energy gate (test_energy_gate, test_bridge_table) ---- */

/* J. The tank at the start, and at most: 1 mJ is a push of 1 N over 1 mm, the least that lets a first contact correct
 * its stiffness; 5 mJ bounds what a hand can ever get back at once */
#define TANK_START_J 1e-3
#define TANK_MAX_J   5e-3
/* s. A model is blended in over the time since the one before, within these: a tick then changes force by 5 % of what a
 * model changes at most; above the longest, a model of a slow server would never be in use (test_bridge_rendering) */
#define BLEND_MIN_S 0.02
#define BLEND_MAX_S 0.1
/* N s/m. Damping that refills an empty tank, falling to 0 at TANK_START_J: 7.5 mW at 50 mm/s */
#define REFILL_DAMPING_NS_M 3.0
/* bisections for the share of a change that the tank pays: 2^-12 of a tick's change */
enum { GATE_BISECTIONS = 12 };

#endif
