/* Policy of the commands. Thread: [any]. */
#ifndef PAL_COMMANDS_TUNING_H
#define PAL_COMMANDS_TUNING_H

/* 1/s: sub-steps times tetrahedra that one core of a 2020s server takes, by which `palpate calibrate` limits the live
 * run after a search of a given time; tests/house/test_calibrate.sh runs with such a limit */
#define PAL_LIVE_WORK_1_S 7.5e7
/* smallest share of a recorded hand's forces that `palpate calibrate --from` fits to before it gives up; the pull of
 * palpate-client takes a half of its own (tests/house/test_calibrate.sh) */
#define PAL_MIN_LOAD_SHARE 0.1
/* s: processor time of a node of an adaptive surface with its springs and anchor in one sub-step of rk4 on a 2020s
 * server core; the share of a step that it may take; and how many more nodes than its coarsest level a surface may
 * always have, as a share and a number. `palpate prepare` limits refinement by them; tests/house/test_commands.sh */
#define PAL_NODE_S          120e-9
#define PAL_MAX_BUSY        0.5
#define PAL_MIN_EXTRA_SHARE 0.125
#define PAL_MIN_EXTRA       400
/* nodes up to which `palpate prepare` makes a world to find how fast the body returns, within two seconds
 * (tests/house/test_commands.sh) */
#define PAL_RETURN_NODES 6000
/* Pa: Young's modulus that `palpate prepare` gives soft tissue, and the wall of a hollow organ, which is muscle */
#define PAL_SOLID_YOUNG_PA 5000
#define PAL_WALL_YOUNG_PA  50000
/* ns: least time between two starts of a palpate-lcm that ends; time for it to end after SIGTERM */
#define PAL_LCM_RESTART_NS 1000000000u
#define PAL_LCM_LEAVE_NS   1000000000u
/* m: sizes between which `palpate prepare` takes a body for one that a hand works on, from a lymph node to a torso;
 * share of the volume that voxels may miss; volume with the border layer over that of the surface beyond which more
 * of the body lies outside the surface than inside (tests/house/test_commands.sh) */
#define PAL_ORGAN_MIN_M     0.005
#define PAL_ORGAN_MAX_M     1.5
#define PAL_VOLUME_MISSED   0.05
#define PAL_LAYER_OUTWEIGHS 2
#endif
