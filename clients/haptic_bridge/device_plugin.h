/* A back end from a file: a shared object that exports `const pal_haptic_v1 *pal_haptic_entry(void)` (device.h), for
 * devices whose library is C++ or whose licence keeps it apart: CHAI3D, libnifalcon, VRPN.
 *
 * id: "FILE" or "FILE,ID" with the id of the plug-in. Its poses pass the same examination as those of the other back
 * ends; a table that is older than device.h lacks its last functions, one of another ABI is refused. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_PLUGIN_H
#define PAL_HAPTIC_BRIDGE_DEVICE_PLUGIN_H
#include "clients/haptic_bridge/device.h"

const pal_haptic_v1 *pal_device_plugin(void);
#endif
