/* Devices of 3D Systems (Touch, Phantom) by OpenHaptics' HDAPI, found at run time as libHD.so. The thread of the
 * library's scheduler is the servo: `run` schedules our tick and waits.
 *
 * id: name of the device as its set-up has it; "": tries the default one under its usual names. Device axes of HDAPI
 * are x right, y up, z to the user, in mm. Errors of the device: motors that are warm or pushed too hard (0x200 to
 * 0x204) fade the force out, and in again 2 s after the last of them; all others end `run`. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_HDAPI_H
#define PAL_HAPTIC_BRIDGE_DEVICE_HDAPI_H
#include "clients/haptic_bridge/device.h"

const pal_haptic_v1 *pal_device_hdapi(void);
#endif
