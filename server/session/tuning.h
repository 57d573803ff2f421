/* Policy of sessions. Each constant states its unit, its reason, and the test that bounds it. Thread: any. */
#ifndef PAL_SESSION_TUNING_H
#define PAL_SESSION_TUNING_H

/* ns: default time without a pose after which a tool is released, and displayed as stale (test_poses, test_hub) */
#define PAL_LEASE_NS 250000000u
/* body sizes: maximum distance of a pose from the origin, far beyond any device's workspace (test_session) */
#define PAL_POSE_REACH 100
/* fraction of a step: a step is late when it begins so long after its due time (test_session) */
#define PAL_LATE_PART 0.1
/* ns that a session rests at a time while nothing moves (its bodies sleep, or it is paused) and nobody looks or holds a
 * tool; its steps are taken together after that. 200 such sessions on one core wake 2,000 times a second in place of
 * 12,000 (test_session, tests/bench) */
#define PAL_REST_NS 100000000u
/* share of the last step in the smoothed time of a sub-step: some steps, so that one that was interrupted
 * counts for little (test_session) */
#define PAL_SUBSTEP_SHARE 0.1
/* m/s: what no hand exceeds (test_poses); larger bodies are worked on at a larger scale: their size in so many s.
 * Poses come in bursts: s that one may lie before the last. ns without a jump after which a tool that jumped is put
 * down */
#define PAL_HAND_M_S     5.0
#define PAL_HAND_SIZE_S  0.05
#define PAL_HAND_SLACK_S 0.01
#define PAL_LIFT_NS      100000000u
/* bytes of the ring buffer of the input log, at least: the poses of eight tools for many s (test_replay) */
#define PAL_LOG_RING_BYTES ((size_t)4 << 20)
/* ns between two writes of the input log, and the longest wait of its closing (test_replay) */
#define PAL_LOG_FLUSH_NS 20000000u
/* between two states in the input log: s of simulated time, and ns of processor time for the steps. Who goes on after a
 * crash, or from any moment of a recording, steps so much again (test_record_hub, test_playback_hub) */
#define PAL_STATE_S       10
#define PAL_STATE_WORK_NS 700000000u
/* ns between two fdatasync of the input log: what kill -9 or a power cut may cost (test_replay) */
#define PAL_LOG_SAVE_NS 1000000000u
/* fraction of a body's size: drift since the last snapshot above which a switch is rehearsed again
 * (test_configuration_switch) */
#define PAL_CONFIGURATION_SWITCH_MAX_DRIFT 0.005
#endif
