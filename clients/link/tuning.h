/* Policy of the clients' links. Each constant states its unit, its reason, and the test that bounds it. Thread: any. */
#ifndef PAL_LINK_TUNING_H
#define PAL_LINK_TUNING_H

/* ns without a message after which another sender may have a channel of the bus: a hand that pauses keeps its tool,
 * since bridges repeat the pose of a resting tool (test_lcm_seal) */
#define PAL_SEAL_SILENCE_NS 500000000u
/* us that a signed message may be old or early: more than clocks of hosts differ that keep time, and as long as what
 * was recorded on the bus is of use (test_lcm_seal) */
#define PAL_SEAL_AGE_US 5000000
/* states of a tool a second, at most, and those that may be lost beside the time that they take (test_lcm_seal) */
#define PAL_STATES_1_S   250
#define PAL_STATES_AHEAD 64
#endif
