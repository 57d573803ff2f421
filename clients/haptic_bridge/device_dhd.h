/* Devices of Force Dimension (omega, delta, sigma, lambda; Novint Falcon) by their DHD library, version 3.7 or newer,
 * found at run time: in $FDSDK/lib/release, then as libdrd.so or libdhd.so. The servo polls it. Axes and units are
 * ours.
 *
 * id: number of the device; "": the first. The firmware cuts the force when no command comes for 10 ms. Forces that
 * the device has switched off (its button, or too fast a motion) fade in when it switches them on. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_DHD_H
#define PAL_HAPTIC_BRIDGE_DEVICE_DHD_H
#include "clients/haptic_bridge/device.h"

const pal_haptic_v1 *pal_device_dhd(void);
#endif
