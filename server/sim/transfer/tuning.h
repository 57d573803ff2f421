/* Constants of the transfer of a state. */
#ifndef PAL_SIM_TRANSFER_TUNING_H
#define PAL_SIM_TRANSFER_TUNING_H

/* largest factor, up or down, by which displacements and velocities are scaled to match the energy. A transfer whose
 * interpolated energy is higher by as much gets more rounds of smoothing (tests/stability/test_switch_slider.c) */
#define PAL_TRANSFER_MAX_SCALE 1.8
/* share of a node's last move in the next round of smoothing (Polyak's heavy ball; stable below 1, as forces over
 * bounds of stiffness have no eigenvalue above 1) (tests/stability/test_switch_slider.c) */
#define PAL_TRANSFER_INERTIA 0.8

enum {
    /* rounds of smoothing, each an evaluation of forces; a quarter of them after a rehearsal, five times as many where
     * the energy is far too high (tests/stability/test_switch_slider.c) */
    PAL_TRANSFER_ROUNDS = 40,
    PAL_TRANSFER_SCALE_ROUNDS = 8 /* of scaling */
};
#endif
