/* Haply Inverse3 by the websocket of Haply's service (format of 3.1 and 3.5): one message of force out, one of state
 * back. The exchange is the servo: each state is a tick, whose force is sent at once.
 *
 * id: "[DEVICE][@HOST:PORT]", "" for the first device of ws://localhost:10001. The origin is where the handle is when
 * the device is opened. The service filters forces; what it gives is read back. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_HAPLY_H
#define PAL_HAPTIC_BRIDGE_DEVICE_HAPLY_H
#include "clients/haptic_bridge/device.h"

const pal_haptic_v1 *pal_device_haply(void);
#endif
