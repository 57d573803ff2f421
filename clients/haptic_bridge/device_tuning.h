/* Constants of the back ends. Each has its unit, its reason and the test that bounds it. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_TUNING_H
#define PAL_HAPTIC_BRIDGE_DEVICE_TUNING_H

/* N, s: a pose whose every step stands still for so long under so much force comes from a frozen encoder: a hand
 * trembles at 8 to 12 Hz by 0.1 mm, two steps of the coarsest device (tests/clients/test_device_hdapi.c) */
#define PAL_DEVICE_FROZEN_FORCE_N 0.5
#define PAL_DEVICE_FROZEN_S       3.0
/* s: a lost device is tried again, and motors that are warm get force again, after this (test_device_hdapi.c) */
#define PAL_DEVICE_RETRY_S 2.0
/* s: force of warm motors fades out and in again as that of a stale model does (test_device_hdapi.c) */
#define PAL_DEVICE_FADE_OUT_S 0.5
#define PAL_DEVICE_FADE_IN_S  0.25
/* times 125 us: the firmware of a DHD device cuts the force when no command has come for 10 ms, ten ticks
 * (test_device_dhd.c) */
#define PAL_DEVICE_DHD_WATCHDOG 80
/* share of full deflection that is rest: a released handle springs back to within it (test_device_input.c) */
#define PAL_DEVICE_INPUT_DEAD 0.05
/* counts at full deflection where the kernel does not know them; of libspnav, before its sensitivity
 * (test_device_input.c) */
#define PAL_DEVICE_INPUT_RANGE 500
#define PAL_DEVICE_SPNAV_RANGE 350
/* m/s, rad/s at full deflection: across the workspace in 2 s (test_device_input.c) */
#define PAL_DEVICE_INPUT_SPEED_M_S  0.1
#define PAL_DEVICE_INPUT_TURN_RAD_S 1.0
/* m: half of the workspace, an organ and the room above it (test_device_input.c) */
#define PAL_DEVICE_INPUT_REACH_M 0.1
/* s: a relative axis that is held reports every 8 to 16 ms (test_device_input.c) */
#define PAL_DEVICE_INPUT_SILENT_S 0.1
#endif
