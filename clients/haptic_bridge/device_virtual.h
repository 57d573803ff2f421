/* The virtual device and hand (clients/haptic_bridge/README.md, "Devices"). The device is a lumped plant with friction,
 * encoder quantisation, actuator lag and one tick of delay. A two-mass hand holds it and follows a script.
 * Deterministic in virtual time: the same calls give the same numbers.
 *
 * id: "touch" or "touch,key=value,..." with the devices touch premium omega3 inverse3 falcon and the keys
 *   - hand: average light firm off (average; off: no hand, a constant push of 0.5 N downward)
 *   - script: still press-hold cycle ramp stroke tap grasp sculpt (press-hold), the intended motion of the hand along
 * the device's z. All but still first descend at 40 mm/s until a force of 0.1 N. Then
 *     - press-hold: `depth` further down in 0.5 s, hold; cycle: down and up at 1 Hz; ramp: down at depth / 6 s
 *     - stroke: press-hold, then 20 mm back and forth along y; tap: down at 0.3 m/s and up, once a second
 *     - grasp: close the grasp 0.5 s after the touch, 30 mm up in 2 s, hold for 2 s, back in 2 s, let go and up
 *     - sculpt: the same, but let go before it comes back
 *   - depth: of the script, mm (8)
 *   - height: start above the workspace centre, mm (20)
 *   - descent: after so many mm the script goes on without a touch (no limit)
 *   - wait: time at rest before the script, s, so that the bridge can arm (1.6)
 *   - lag: actuator time constant, ms (1)
 *   - clock: wall steps virtual (wall). wall: read advances to the present. steps: read advances by what the servo has
 *     slept on pal_virtual_clock, so that a servo loop on a busy machine is slow and never late. virtual: only
 *     pal_virtual_advance does
 *   - fail: number of the first read that fails, like a broken cable; all later reads fail too (none) */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_VIRTUAL_H
#define PAL_HAPTIC_BRIDGE_DEVICE_VIRTUAL_H
#include "clients/haptic_bridge/device.h"
#include "server/base/clock.h"

const pal_haptic_v1 *pal_device_virtual(void);

/* virtual time: advances by dt in sub-steps of 50 us; the force written before takes effect at the end */
void pal_virtual_advance(void *handle, double dt_s);
/* clock of a device with clock=steps, which advances as the one thread that sleeps on it does; else NULL. Borrowed */
const pal_clock *pal_virtual_clock(void *handle);
/* phase of the scripts grasp and sculpt; with others always TOUCH. [any] */
typedef enum pal_virtual_phase {
    PAL_VIRTUAL_TOUCH,
    PAL_VIRTUAL_CLOSED,
    PAL_VIRTUAL_PULL,
    PAL_VIRTUAL_SETTLE, /* the first half second of holding, in which models of the pull still arrive */
    PAL_VIRTUAL_HOLD,
    PAL_VIRTUAL_BACK,
    PAL_VIRTUAL_OPEN,
    PAL_VIRTUAL_DONE
} pal_virtual_phase;
pal_virtual_phase pal_virtual_script_phase(void *handle);
/* buttons PAL_DEVICE_BUTTON_* and orientation of the handle (tests) */
void pal_virtual_set_handle(void *handle, uint32_t buttons, const double quat[4]);
/* values hidden by a real device: exact position, velocity and motor force; any may be NULL */
void pal_virtual_truth(void *handle, double position_m[3], double velocity_m_s[3], double force_N[3]);
/* constant external force instead of the hand's (tests) */
void pal_virtual_push(void *handle, const double force_N[3]);
/* sets the position of the plant, at rest (tests) */
void pal_virtual_place(void *handle, const double position_m[3]);
/* friction of the plant (tests) */
void pal_virtual_set_friction(void *handle, double viscous_Ns_m, double coulomb_N);
#endif
