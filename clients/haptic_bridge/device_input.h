/* Pose without force: SpaceMouse and other six-axis controllers by evdev (/dev/input/event*), or by the daemon
 * spacenavd through libspnav, found at run time. A deflected handle moves the tool at a speed (rate control).
 *
 * id: "": the first SpaceMouse; "/dev/input/eventN" or another file of struct input_event; "spnav": the daemon. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_INPUT_H
#define PAL_HAPTIC_BRIDGE_DEVICE_INPUT_H
#include "clients/haptic_bridge/device.h"

#include <stdbool.h>

const pal_haptic_v1 *pal_device_input(void);

/* what a stream of struct input_event says; {0} with the ranges set is a controller at rest. Thread: any one */
typedef struct pal_input_axes {
    int value[6];             /* of axes x y z rx ry rz, as the device reports them */
    int low[6], high[6];      /* of the value */
    unsigned buttons;         /* bits 0..15 */
    bool relative, lost_some; /* lost_some: the kernel has dropped events; axes count as 0 until they report again */
    unsigned char part[64];   /* of an event of which not all bytes have come */
    size_t n_part;
} pal_input_axes;
/* any n bytes; true: at least one event came */
bool pal_input_feed(pal_input_axes *axes, const unsigned char *bytes, size_t n);
/* deflection of an axis, -1 .. 1 */
double pal_input_deflection(const pal_input_axes *axes, int axis);
#endif
