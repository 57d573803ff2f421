/* Constants of the haptic bridge: unit, reason, test that bounds each. */
#ifndef PAL_HAPTIC_BRIDGE_TUNING_H
#define PAL_HAPTIC_BRIDGE_TUNING_H
#include "server/rendering/tuning.h"

/* ---- motors ---- */

/* s. Time constant that motors are taken to have, besides one tick of delay: that of a current loop and a cable drive.
 * Without it the tank spends what the motors' lag has given already (test_bridge_rendering: 0.14 mJ a pass) */
#define MOTOR_TIME_S 1e-3

/* ---- states (test_servo, test_servo_models) ---- */

/* s. A model older than max(this, 4 frame times, twice the usual longest gap), at most STALE_MAX_S, is stale */
#define STALE_MIN_S 0.1
#define STALE_MAX_S 0.5
/* s of delay forgotten each s. A route that is longer by 200 ms is the usual one after 12 s, clocks may drift apart by
 * a hundredth of it, and a stall of 1.5 s makes models look younger by 15 ms */
#define DELAY_FORGOTTEN 0.01
/* s. Fades: out when stale, in after it, in after arming, out for the clutch */
#define FADE_OUT_S    0.5
#define FADE_IN_S     0.25
#define FADE_START_S  1.0
#define CLUTCH_FADE_S 0.05
/* N. The clutch engages below this: what 50 ms of fading take away is hardly noticed */
#define CLUTCH_FORCE_N 0.3
/* s, m/s. Rest of the handle before forces start */
#define ARM_REST_S    0.5
#define ARM_SPEED_M_S 0.05
#define ESTOP_HOLD_S  0.5  /* s. Both buttons held so long are the emergency stop */
#define BAD_READS_MAX 2    /* failed reads in a row: the device is lost */
#define NO_FORCE_N    0.01 /* the workspace may move below this */

/* ---- sculpting (test_hand_brush) ---- */

#define BRUSH_DAB           0.5  /* of the radius between two dabs of paint: they overlap by half */
#define BRUSH_STEP          0.05 /* of the radius by which the hand moves before a force follows: 1 mm of 20 */
#define BRUSH_EXTRUDE_MIN_M 1e-3 /* a lower cell is a slip of the hand */

/* ---- limits (test_servo) ---- */

#define VELOCITY_CUT_HZ 80.0 /* of the filter on position differences: above what a hand moves, below encoder noise */
#define USER_CAP_N      3.0  /* largest force unless asked otherwise */
#define RISE_TIME_S     0.01 /* from none to the cap */
/* s. Of the mean square that is compared with the continuous rating. Makers state it for a day, small motors warm in
 * 10 to 20 s; over 1 s a pull of 4 s at twice the rating would be felt at half its force (test_bridge_rendering) */
#define RATING_TIME_S      10.0
#define SCALE_DOWN_S       2.0   /* from full force to none while above it */
#define SCALE_UP_S         5.0   /* and back */
#define STALE_DAMPING_NS_M 3.0   /* while a stale model fades */
#define FREE_DAMPING_NS_M  0.5   /* without a model */
#define WALL_STIFFNESS_N_M 200.0 /* of the edge of the workspace, below every device's limit */
#define WALL_FRACTION      0.95  /* of the workspace, where it begins */
#define DRIVEN_FORCE_N     0.05  /* a force that moves a handle */
#define DRIVEN_SPEED_M_S   0.5   /* of the device along its own force: something is wrong */
#define SPEED_MAX_M_S      2.0   /* of the device in any direction */
#define DEGRADED_K_N_M     300.0 /* stiffness without real time */

#endif
