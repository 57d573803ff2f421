/* Constants of the room world. */
#ifndef PAL_SIM_WORLD_TUNING_H
#define PAL_SIM_WORLD_TUNING_H

/* smallest fraction of its cap that a node of a supported body bears, however far it is (tests/sim/world/test_world.c)
 */
#define PAL_LOAD_FAR_SHARE 0.01
/* factor of moduli up to which two points count as one material in the recovery of stress: less than that stress jumps
 * by no more than it varies (tests/sim/world/test_zz_estimator.c) */
#define PAL_SAME_MATERIAL 1.25
#endif
