/* One tick of the bridge (README.md): device pose in, local contact force out, states, limits.
 *
 * The servo owns no thread: servo_thread.h calls pal_servo_tick from a real-time loop, tests call it in virtual time.
 * A tick takes no lock, allocates no memory, and does no input or output except the device's. Models arrive and views
 * leave through triple buffers, events through a queue; e-stop and re-arm are atomic flags.
 *
 * What is rendered is a model (local_model.h, local_contact.h) times a gain. Every change of the two that raises the
 * stored energy is made as far as the energy tank pays for it (energy_gate.h).
 *
 * States:
 *   - ARMING lasts until the dead man's switch is held and the handle rests (< 0.05 m/s) for 0.5 s; force then fades in
 *     over 1 s.
 *   - FREE and CONTACT render forces.
 *   - STALE begins when the newest model is older than max(100 ms, 4 frame times, twice the usual longest gap). Its age
 *     counts from when it was made: time since its arrival, and its delay above the least usual one. Force fades out
 * over 500 ms under 3 N s/m damping; FREE without a model (0.5 N s/m) follows. A new model fades in over 250 ms or as
 * the tank allows.
 *   - ESTOP and FAULT give no force until re-armed. E-stop is latched; both buttons held for 0.5 s are one. A fault of
 * speed, number or stalled loop re-arms by the conditions of ARMING, and so does a lost device when it answers again.
 *
 * Limits: |F| <= cap, rising by at most cap / 10 ms and falling without limit. An rms over 10 s above the device's
 * continuous rating scales force down. Stiffness of a contact or a grasp <= device limit / (scale force_scale), 300 N/m
 * without real time. Walls of 200 N/m stand at 95 % of the workspace.
 *
 * World frame: workspace.h; F_d = force_scale R' F_w. While the clutch button is down, the world pose is constant and
 * force is faded out; the clutch engages below 0.3 N only. */
#ifndef PAL_HAPTIC_BRIDGE_SERVO_H
#define PAL_HAPTIC_BRIDGE_SERVO_H
#include "clients/haptic_bridge/device.h"
#include "clients/haptic_bridge/workspace.h"
#include "protocol/wire.h"
#include "server/base/clock.h"
#include "server/base/err.h"
#include "server/rendering/local_model.h"

#include <stdbool.h>

typedef struct pal_servo pal_servo;

typedef enum pal_servo_state {
    PAL_SERVO_OFF,
    PAL_SERVO_ARMING,
    PAL_SERVO_FREE,
    PAL_SERVO_CONTACT,
    PAL_SERVO_STALE,
    PAL_SERVO_FAULT,
    PAL_SERVO_ESTOP
} pal_servo_state;
const char *pal_servo_state_name(pal_servo_state state);

/* kinds of haptic_event_t (lcmtypes/) */
typedef enum pal_servo_event_kind {
    PAL_EVENT_BUTTON_DOWN = 1,
    PAL_EVENT_BUTTON_UP,
    PAL_EVENT_CLUTCH,
    PAL_EVENT_ESTOP,
    PAL_EVENT_ESTOP_CLEAR,
    PAL_EVENT_DEVICE_READY,
    PAL_EVENT_DEVICE_LOST,
    PAL_EVENT_FAULT,
    PAL_EVENT_STALE,
    PAL_EVENT_RECOVERED,
    PAL_EVENT_LIMIT,
    PAL_EVENT_RT_DEGRADED,
    PAL_EVENT_WORKSPACE_EDGE
} pal_servo_event_kind;
typedef struct pal_servo_event {
    int16_t kind, code;
    float value;
    const char *text; /* static string; of a lost device its own, until it is lost again */
} pal_servo_event;

typedef struct pal_servo_options {
    const pal_haptic_v1 *backend; /* borrowed */
    void *device;                 /* open, borrowed */
    pal_dev_info info;
    double rate_hz;            /* nominal, 1000                                                 */
    double force_cap_N;        /* 0: the smaller of 3 N and the device's peak */
    double origin_m[3];        /* world position of the workspace centre */
    double rotation[9];        /* device to world, row-major                                     */
    double scale, force_scale; /* 0: 1                                                           */
    double leak_W;             /* energy that a change of the model may add without the tank: 0, strict */
    bool pose_only;
    bool hand_off;          /* the hand appears off the handle: damping floor 5 ms instead of 2.5 ms */
    const pal_clock *clock; /* of servo_thread.h, borrowed; NULL: pal_clock_monotonic */
    bool no_watchdog;       /* simulated device on a simulated clock: nobody is at risk */
} pal_servo_options;

/* copies options. [load] */
pal_err pal_servo_create(const pal_servo_options *options, pal_servo **out);
void pal_servo_destroy(pal_servo *servo); /* NULL is fine */

/* [servo] one tick at now_ns, which must not decrease */
void pal_servo_tick(pal_servo *servo, uint64_t now_ns);
/* [servo] real-time class measured by the loop: 0 good, 1 stiffness limited, 2 forces off */
void pal_servo_set_degraded(pal_servo *servo, int level);
/* [servo] true: two reads in a row have failed, and none since has not */
bool pal_servo_device_lost(const pal_servo *servo);
/* [servo] sends zero force to the device, at the end */
void pal_servo_end(pal_servo *servo);

/* [net] The newest model wins. generation changes with every new session (reconnect); models of older ones are
 * dropped. arrival_ns: time of its arrival on the clock of the ticks; may be after the tick that takes it. Its stamp_us
 * is the server's time of making it; of the two clocks only the rates have to agree */
void pal_servo_put_model(pal_servo *servo, const pal_wire_haptic *model, uint32_t generation, uint64_t arrival_ns);
/* [net] the server is lost or has returned as another session: drops the model at once and fades */
void pal_servo_put_generation(pal_servo *servo, uint32_t generation);
/* [net] another place of the workspace in the world; applied while there is no force, another scale only while the
 * clutch is held or before forces start */
void pal_servo_put_frame(pal_servo *servo, const pal_workspace_frame *frame);
void pal_servo_estop(pal_servo *servo);   /* [any] async-signal-safe; takes effect within one tick */
void pal_servo_rearm(pal_servo *servo);   /* [any] clears e-stop: ARMING follows                   */
void pal_servo_stalled(pal_servo *servo); /* [any] the watchdog has stopped the device: ARMING follows */

/* state of one tick, for other threads */
typedef struct pal_servo_view {
    uint64_t n_tick;
    pal_servo_state state;
    double position_m[3], quat[4], velocity_m_s[3], omega_rad_s[3]; /* world */
    double force_N[3], torque_N_m[3];                               /* commanded, on the hand, world */
    double reference_N[3];                                          /* f_ref_N of the model in use */
    int n_proxy;
    double proxy_m[PAL_LOCAL_PATCH_MAX][3]; /* tool's centre on the surface of each contact, for display */
    double fade, grip;                      /* fade: gain of the model that is rendered */
    uint32_t flags, buttons;                /* PAL_WIRE_POSE_*, PAL_WIRE_GRASP       */
    uint32_t model_seq, model_age_us;       /* age since the model was made */
    uint64_t model_stamp_us;
    uint64_t n_model, n_model_old, n_saturated, n_clamped, n_stale, n_fault, n_not_finite;
    uint64_t n_passivity;                        /* ticks in which the passivity controller damped */
    double tank_mJ, generated_mJ;                /* generated: the most that the hand has ever got on balance */
    double force_rms_N, force_max_N, jump_max_N; /* jump: largest force step by a change of model or gain */
    double depth_m, motor_temperature;
    double rendered_stiffness_N_m; /* norm of the rendered force / depth; 0 out of contact */
} pal_servo_view;
/* [net] newest unseen view or NULL; valid until the next call */
const pal_servo_view *pal_servo_take_view(pal_servo *servo);
/* [net] next event; false: none */
bool pal_servo_take_event(pal_servo *servo, pal_servo_event *out);
/* [any] increases with every tick, for the watchdog */
uint64_t pal_servo_ticks(const pal_servo *servo);
#endif
