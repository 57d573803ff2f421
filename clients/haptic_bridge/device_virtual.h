/* The virtual device and hand (clients/haptic_bridge/README.md, "Devices"): a lumped plant with friction, encoder
 * steps, actuator lag and one tick of delay, held by a two-mass hand that follows a script. Deterministic: in virtual
 * time the same calls give the same numbers.
 *
 * id: "touch" or "touch,key=value,..." with the devices touch premium omega3 inverse3 falcon and the keys
 *   hand    average light firm off       (average; off: no hand, a constant push of 0.5 N downward)
 *   script  still press-hold cycle ramp stroke tap   (press-hold): what the hand intends, along the device's z; all but
 *           still first come down at 40 mm/s until 0.1 N is felt, then
 *           press-hold: `depth` further down in 0.5 s, stays; cycle: down and up at 1 Hz; ramp: down at depth / 6 s;
 *           stroke: press-hold, then 20 mm to and fro along y; tap: down at 0.3 m/s and up, once a second
 *   depth   mm of the script (8)
 *   height  mm above the workspace centre where it begins (20)
 *   wait    s at rest before it begins, so that the bridge can arm (1.6)
 *   lag     actuator time constant ms (1)
 *   clock   wall virtual (wall: read goes on to the present; virtual: only pal_virtual_advance moves it)
 *   fail    number of the first read that fails, as a broken cable would; from then on all fail (none) */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_VIRTUAL_H
#define PAL_HAPTIC_BRIDGE_DEVICE_VIRTUAL_H
#include "clients/haptic_bridge/device.h"

const pal_haptic_v1 *pal_device_virtual(void);

/* virtual time: goes dt on in sub-steps of 50 us; the force written before takes effect at the end of the advance */
void pal_virtual_advance(void *handle, double dt_s);
/* what a real device would not tell: exact position, velocity and the force its motors give; any may be NULL */
void pal_virtual_truth(void *handle, double position_m[3], double velocity_m_s[3], double force_N[3]);
/* constant push from outside, instead of the hand's (tests) */
void pal_virtual_push(void *handle, const double force_N[3]);
/* sets the plant's place at rest (tests) */
void pal_virtual_place(void *handle, const double position_m[3]);
/* plant parameters for the analytic tests: mass kg, viscous N s/m, Coulomb N */
void pal_virtual_plant(void *handle, double *mass_kg, double *viscous_Ns_m, double *coulomb_N);
void pal_virtual_set_friction(void *handle, double viscous_Ns_m, double coulomb_N);
#endif
