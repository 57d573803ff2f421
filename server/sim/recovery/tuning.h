/* Constants of inversion recovery: unit, reason, test that bounds each. */
#ifndef PAL_SIM_RECOVERY_TUNING_H
#define PAL_SIM_RECOVERY_TUNING_H

/* ---- ratios of a volume to that at rest. Recovery begins outside INVERTED_LOW to _HIGH and ends inside RECOVERED_LOW
 * to _HIGH. Above 30 the neo-Hookean energy, which grows with the square of the ratio, lets nothing else count
 * (tests/sim/elements/test_hex_recovery.c, tests/sim/subdivision/test_cell_recovery.c) ---- */
#define PAL_INVERTED_LOW   0.05
#define PAL_INVERTED_HIGH  30.0
#define PAL_RECOVERED_LOW  0.3
#define PAL_RECOVERED_HIGH (1 / PAL_INVERTED_LOW)

/* ---- clocks, s, and scale of recovery.h (tests/sim/recovery/test_recovery.c). Inversion of corners that lasts WAIT_S
 * without a load forms a region: elements with proper rotations turn most of it back before. A region that stays bad
 * takes in its neighbours every GROW_S and is the whole connected body after WHOLE_S; s needs STIFFEN_S from 0 to 1, so
 * that nothing jumps. SOFT_MIN: least s, so that a folded body that stores next to nothing straightens in seconds ----
 */
#define PAL_RECOVERY_WAIT_S    0.15
#define PAL_RECOVERY_GROW_S    0.5
#define PAL_RECOVERY_WHOLE_S   2.0
#define PAL_RECOVERY_STIFFEN_S 0.25
#define PAL_RECOVERY_SOFT_MIN  0.02
/* damping ratio of an edge of a region under an explicit solver, its ends alone on it: waves that drag would leave for
 * seconds end in a few periods of the edges, for a sub-step shorter by an eighth
 * (tests/sim/springs/test_spring_recovery.c) */
#define PAL_RECOVERY_DAMPING 0.03
/* mean strain, by energy, above which a region does not become elements: under a load they would be crushed at once
 * (tests/stability/test_fem_cases.c) */
#define PAL_RECOVERY_LEAVE_STRAIN 0.2

/* next to nothing: of load_cap_N, a load that holds nothing inverted; of the energy of regions, the motion of a body at
 * rest; of the energy at rest, what an element stores whose forces have no energy
 * (tests/sim/elements/test_hex_recovery.c) */
#define PAL_REST_SHARE 1e-3
#endif
