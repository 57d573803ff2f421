/* What the bridge finds on this machine: which back ends there are (--list-devices), and one device step by step
 * (--doctor). Both print one line for each fact, for people. Thread: [load]. */
#ifndef PAL_HAPTIC_BRIDGE_DOCTOR_H
#define PAL_HAPTIC_BRIDGE_DOCTOR_H
#include "clients/haptic_bridge/servo.h"

/* a line for each back end: how many devices and which, or what was looked for and why it failed */
void pal_doctor_list(void);
/* Limits of the system, the back end's own steps, the device, its first pose, and seconds of its servo without force.
 * Each line begins with "ok" or "not ok", then says what to do. The number of those that are not ok. options: backend
 * and rate_hz */
int pal_doctor(const char *id, const pal_servo_options *options, double seconds);
#endif
