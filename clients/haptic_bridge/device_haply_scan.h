/* The fields that the bridge uses of a state message of Haply's service: a scanner of JSON that visits each byte once
 * and allocates nothing, so that it may run in a servo tick. Thread: [any]. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_HAPLY_SCAN_H
#define PAL_HAPTIC_BRIDGE_DEVICE_HAPLY_SCAN_H
#include <stdbool.h>
#include <stddef.h>

enum { PAL_HAPLY_BUTTONS = 4 };

/* device axes of the service, m, m/s, N; has_: was in the last message scanned, while the rest keeps its value */
typedef struct pal_haply_state {
    char device[24], wireless[24], wired[24]; /* ids; "": none seen */
    double position_m[3], force_N[3];         /* force: what the service gives after its filters */
    double wireless_quat[4], wired_quat[4];   /* w x y z */
    bool button[PAL_HAPLY_BUTTONS];
    bool has_position, has_force, has_wireless, has_wired;
    bool not_calibrated, no_power;
} pal_haply_state;

/* index: which of the devices of the message. false: not one JSON value of at most 16 levels; *state is then undefined
 */
bool pal_haply_scan(const char *text, size_t n, int index, pal_haply_state *state);
#endif
