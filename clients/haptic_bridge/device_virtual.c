/* Virtual device and hand (clients/haptic_bridge/README.md, "Devices").
 *   plant     m v' = Fa + k1 (xh - x) + b1 (vh - v) - b v - Coulomb(fc, stick)
 *   hand      M vh' = -(k1 (xh - x) + b1 (vh - v)) + k2 (xd - xh) - b2 vh
 *   actuator  Fa' = (F - Fa) / tau, F applied one tick after it was written, clamped to the peak
 *   encoder   floor(x / q) q
 * three axes alike, semi-implicit Euler at 50 us. Departure: README.md's table gives no viscous term b of the
 * plant; 0.05 N s/m is taken for all devices (a guess, as most of the column of apparent mass). */
#include "clients/haptic_bridge/device_virtual.h"
#include "server/base/vec3.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SUB_STEP_S      50e-6
#define CATCH_UP_MAX_S  0.2 /* after a longer pause in wall time the plant skips the rest */
#define VISCOUS_NS_M    0.05
#define TOUCH_CONTACT_N 0.1
#define TOUCH_REST_M_S  0.005 /* a hand this slow feels what it touches, no damping */
#define TOUCH_TICKS     20    /* of the servo, which a late one answers with old forces */
#define APPROACH_M_S    0.04

typedef struct virtual_device {
    const char *id, *name;
    double peak_N, continuous_N, k_max, b_max, radius_m, mass_kg, coulomb_N, step_m;
} virtual_device;
static const virtual_device virtual_devices[] = {
    {"touch", "virtual Touch", 3.3, 0.88, 400, 4, 0.075, 0.045, 0.26, 0.055e-3},
    {"premium", "virtual Premium 1.5", 8.5, 1.4, 800, 5, 0.12, 0.075, 0.04, 0.03e-3},
    {"omega3", "virtual omega.3", 12, 12, 5000, 30, 0.075, 0.25, 0.3, 0.01e-3},
    {"inverse3", "virtual Inverse3", 10, 10, 1000, 6, 0.15, 0.15, 0.2, 0.02e-3},
    {"falcon", "virtual Falcon", 8, 8, 3000, 20, 0.04, 0.6, 0.6, 0.064e-3},
};

typedef struct virtual_hand {
    const char *id;
    double k1, b1, mass_kg, k2, b2; /* mass 0: no hand */
} virtual_hand;
static const virtual_hand virtual_hands[] = {
    {"average", 575, 1.3, 0.21, 175, 11},
    {"light", 230, 0.3, 0.1, 63, 3.7},
    {"firm", 1040, 4.6, 0.4, 533, 27},
    {"off", 0, 0, 0, 0, 0},
};

typedef enum virtual_script { STILL, PRESS_HOLD, CYCLE, RAMP, STROKE, TAP, GRASP, SCULPT, SCRIPT_COUNT } virtual_script;
static const char *const virtual_scripts[] = {"still",  "press-hold", "cycle", "ramp",
                                              "stroke", "tap",        "grasp", "sculpt"};

/* the scripts grasp and sculpt: height that the hand intends at the end of each phase, and the phase's length */
static const struct {
    double up_m, seconds;
} virtual_grasp[] = {
    [PAL_VIRTUAL_TOUCH] = {0, 0.5},     [PAL_VIRTUAL_CLOSED] = {0, 0.5},      [PAL_VIRTUAL_PULL] = {0.03, 2},
    [PAL_VIRTUAL_SETTLE] = {0.03, 0.5}, [PAL_VIRTUAL_HOLD] = {0.03, 1.5},     [PAL_VIRTUAL_BACK] = {0, 2},
    [PAL_VIRTUAL_OPEN] = {0.02, 1},     [PAL_VIRTUAL_DONE] = {0.02, INFINITY}};

typedef struct virtual_state {
    const virtual_device *device;
    const virtual_hand *hand;
    virtual_script script;
    double depth_m, height_m, descent_m, wait_s, display_offset_s;
    double viscous, coulomb;
    const pal_clock *clock; /* that read advances to; NULL: only pal_virtual_advance does */
    pal_clock steps;
    _Atomic uint64_t steps_ns;
    bool touched;
    int n_contact; /* advances in a row at whose end the resting hand felt something */
    long n_read, fail_at;
    double time_s, touched_s, rest_s; /* rest: time not yet turned into whole sub-steps */
    double touched_z;
    uint64_t last_ns;
    double x[3], v[3], xh[3], vh[3], xd[3], applied[3];
    double command[3], next[3], push[3];
    uint32_t buttons;
    double quat[4];
    atomic_int phase; /* pal_virtual_phase */
    atomic_bool stopped, enabled;
} virtual_state;

/* height of the hand in the script grasp, at a constant speed in each phase */
static double virtual_grasp_up(virtual_state *s, double t)
{
    int phase = PAL_VIRTUAL_TOUCH;
    double from = 0;
    while (t >= virtual_grasp[phase].seconds) {
        from = virtual_grasp[phase].up_m;
        t -= virtual_grasp[phase++].seconds;
    }
    atomic_store(&s->phase, phase);
    const double seconds = virtual_grasp[phase].seconds, to = virtual_grasp[phase].up_m;
    return isfinite(seconds) ? from + (to - from) * t / seconds : to;
}

/* intended position of the hand: z by the script's phase, y for a stroke */
static void virtual_intend(virtual_state *s)
{
    if (s->script == STILL) return;
    if (!s->touched) {
        /* damping is no touch: the hand halts where it feels something, and has touched when it still does at rest */
        const bool in_contact = pal_norm3(s->applied) > TOUCH_CONTACT_N;
        if (!in_contact && s->time_s > s->wait_s)
            s->xd[2] = fmax(s->xd[2] - APPROACH_M_S * SUB_STEP_S, -0.9 * s->device->radius_m);
        if (s->n_contact >= TOUCH_TICKS || s->xd[2] <= s->height_m - s->descent_m) {
            s->touched = true;
            s->touched_s = s->time_s;
            s->touched_z = s->xd[2];
        }
        return;
    }
    const double t = s->time_s - s->touched_s, u = fmin(t / 0.5, 1);
    const double blend = u * u * u * (10 - 15 * u + 6 * u * u);
    double down = s->depth_m * blend;
    if (s->script == CYCLE) down = s->depth_m * 0.5 * (1 - cos(2 * 3.14159265358979 * t));
    if (s->script == RAMP) down = s->depth_m * fmin(t / 6, 1);
    if (s->script == TAP) {
        const double phase = fmod(t, 1.0), leg = s->depth_m / 0.3;
        down = phase < leg ? 0.3 * phase : fmax(s->depth_m - 0.3 * (phase - leg), -s->depth_m);
    }
    if (s->script == GRASP || s->script == SCULPT) down = -virtual_grasp_up(s, t);
    if (s->script == STROKE && t > 0.5) s->xd[1] = 0.02 * sin(3.14159265358979 * (t - 0.5));
    s->xd[2] = s->touched_z - down;
}

/* one axis over one sub-step */
static void virtual_axis(virtual_state *s, int k)
{
    const double dt = SUB_STEP_S, m = s->device->mass_kg;
    const virtual_hand *h = s->hand;
    s->applied[k] += (s->command[k] - s->applied[k]) * (1 - exp(-dt / s->display_offset_s));
    double force = s->applied[k] + s->push[k] - s->viscous * s->v[k];
    if (h->mass_kg > 0) {
        const double grip = h->k1 * (s->xh[k] - s->x[k]) + h->b1 * (s->vh[k] - s->v[k]);
        force += grip;
        s->vh[k] += dt / h->mass_kg * (-grip + h->k2 * (s->xd[k] - s->xh[k]) - h->b2 * s->vh[k]);
        s->xh[k] += dt * s->vh[k];
    }
    /* Coulomb friction takes away speed, at most all of it: that is sticking */
    double v = s->v[k] + dt / m * force;
    const double max = dt / m * s->coulomb;
    v = fabs(v) <= max ? 0 : v - copysign(max, v);
    s->v[k] = v;
    s->x[k] += dt * v;
}

void pal_virtual_advance(void *handle, double dt_s)
{
    virtual_state *s = handle;
    s->rest_s += dt_s;
    const bool off = atomic_load(&s->stopped) || !atomic_load(&s->enabled);
    if (off) pal_set3(s->command, 0, 0, 0);
    while (s->rest_s >= SUB_STEP_S * 0.999) {
        virtual_intend(s);
        for (int k = 0; k < 3; k++) virtual_axis(s, k);
        s->time_s += SUB_STEP_S;
        s->rest_s -= SUB_STEP_S;
    }
    const bool in_contact = pal_norm3(s->applied) > TOUCH_CONTACT_N && pal_norm3(s->v) < TOUCH_REST_M_S;
    s->n_contact = in_contact ? s->n_contact + 1 : 0;
    if (!off) pal_copy3(s->command, s->next);
}

static int virtual_probe(char *reason, size_t n)
{
    snprintf(reason, n, "touch premium omega3 inverse3 falcon");
    return (int)(sizeof virtual_devices / sizeof virtual_devices[0]);
}

/* one "key=value" of the id; false: not understood */
static bool virtual_option(virtual_state *s, const char *key, const char *value)
{
    if (!strcmp(key, "hand")) {
        for (size_t i = 0; i < sizeof virtual_hands / sizeof virtual_hands[0]; i++)
            if (!strcmp(value, virtual_hands[i].id)) return s->hand = &virtual_hands[i], true;
        return false;
    }
    if (!strcmp(key, "script")) {
        for (int i = 0; i < SCRIPT_COUNT; i++)
            if (!strcmp(value, virtual_scripts[i])) return s->script = (virtual_script)i, true;
        return false;
    }
    if (!strcmp(key, "clock")) {
        const bool steps = !strcmp(value, "steps"), none = !strcmp(value, "virtual");
        s->clock = none ? NULL : (steps ? &s->steps : &pal_clock_monotonic);
        return steps || none || !strcmp(value, "wall");
    }
    char *end;
    const double number = strtod(value, &end);
    if (end == value || *end || !(number >= 0 && number <= 1e6)) return false;
    if (!strcmp(key, "depth")) return s->depth_m = number * 1e-3, true;
    if (!strcmp(key, "height")) return s->height_m = number * 1e-3, true;
    if (!strcmp(key, "wait")) return s->wait_s = number, true;
    if (!strcmp(key, "fail")) return s->fail_at = (long)number, true;
    if (!strcmp(key, "descent")) return s->descent_m = number * 1e-3, number >= 0;
    if (!strcmp(key, "lag")) return s->display_offset_s = number * 1e-3, number > 0;
    return false;
}

enum { UNKNOWN_DEVICE = -2, UNKNOWN_OPTION = -5 };

/* 0, or the error */
static int virtual_parse(virtual_state *s, const char *id)
{
    char text[256];
    if (strlen(id) >= sizeof text) return UNKNOWN_OPTION;
    strcpy(text, id[0] ? id : "touch");
    char *rest = NULL, *word = strtok_r(text, ",", &rest);
    for (size_t i = 0; i < sizeof virtual_devices / sizeof virtual_devices[0]; i++)
        if (word && !strcmp(word, virtual_devices[i].id)) s->device = &virtual_devices[i];
    if (!s->device) return UNKNOWN_DEVICE;
    while ((word = strtok_r(NULL, ",", &rest))) {
        char *equals = strchr(word, '=');
        if (!equals) return UNKNOWN_OPTION;
        *equals = 0;
        if (!virtual_option(s, word, equals + 1)) return UNKNOWN_OPTION;
    }
    return 0;
}

static uint64_t steps_now(void *user)
{
    return atomic_load((_Atomic uint64_t *)user);
}

static void steps_sleep_until(void *user, uint64_t when_ns)
{
    _Atomic uint64_t *now_ns = user;
    const uint64_t before = atomic_load(now_ns);
    if (when_ns <= before) return;
    pal_clock_sleep_until_ns(pal_clock_ns() + when_ns - before);
    atomic_store(now_ns, when_ns);
}

const pal_clock *pal_virtual_clock(void *handle)
{
    virtual_state *s = handle;
    return s->clock == &s->steps ? s->clock : NULL;
}

static int virtual_open(void **handle, const char *id, pal_dev_info *out)
{
    virtual_state *s = calloc(1, sizeof *s);
    if (!s) return -1;
    s->hand = &virtual_hands[0];
    s->script = PRESS_HOLD;
    s->depth_m = 0.008;
    s->height_m = 0.02;
    s->descent_m = INFINITY;
    s->wait_s = 1.6;
    s->display_offset_s = 1e-3;
    s->clock = &pal_clock_monotonic;
    s->steps = (pal_clock){.now_ns = steps_now, .sleep_until_ns = steps_sleep_until, .user = &s->steps_ns};
    atomic_store(&s->steps_ns, pal_clock_ns());
    const int unknown = virtual_parse(s, id);
    if (unknown) {
        free(s);
        return unknown;
    }
    const virtual_device *d = s->device;
    s->buttons = PAL_DEVICE_BUTTON_DEADMAN;
    s->quat[0] = 1;
    s->viscous = VISCOUS_NS_M;
    s->coulomb = d->coulomb_N;
    s->x[2] = s->xh[2] = s->xd[2] = s->height_m;
    if (s->hand->mass_kg <= 0) s->push[2] = -0.5;
    if (s->clock) s->last_ns = pal_clock_now_ns(s->clock);
    *out = (pal_dev_info){.size = sizeof *out,
                          .peak_N = d->peak_N,
                          .continuous_N = d->continuous_N,
                          .stiffness_max_N_m = d->k_max,
                          .damping_max_Ns_m = d->b_max,
                          .dof_in = 3,
                          .dof_out = 3};
    strncpy(out->name, d->name, sizeof out->name - 1);
    for (int k = 0; k < 3; k++) out->low_m[k] = -d->radius_m, out->high_m[k] = d->radius_m;
    *handle = s;
    return 0;
}

static int virtual_read(void *handle, pal_dev_state *state)
{
    virtual_state *s = handle;
    if (s->fail_at > 0 && ++s->n_read >= s->fail_at) return -3;
    if (s->clock) {
        const uint64_t now = pal_clock_now_ns(s->clock);
        pal_virtual_advance(s, fmin((double)(now - s->last_ns) * 1e-9, CATCH_UP_MAX_S));
        s->last_ns = now;
    }
    *state = (pal_dev_state){.size = sizeof *state, .buttons = s->buttons};
    const int phase = atomic_load(&s->phase);
    /* sculpt lets go while it is up */
    const int last = s->script == SCULPT ? PAL_VIRTUAL_HOLD : PAL_VIRTUAL_BACK;
    if (phase >= PAL_VIRTUAL_CLOSED && phase <= last) state->buttons |= PAL_DEVICE_BUTTON_GRASP;
    memcpy(state->quat, s->quat, sizeof s->quat);
    const double q = s->device->step_m;
    for (int k = 0; k < 3; k++) state->position_m[k] = floor(s->x[k] / q) * q;
    state->stamp_us = (uint64_t)(s->time_s * 1e6);
    return 0;
}

static int virtual_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    virtual_state *s = handle;
    (void)torque_N_m, (void)grip;
    const double size = pal_norm3(force_N);
    if (!isfinite(size)) return -4;
    pal_scale3(s->next, size > s->device->peak_N ? s->device->peak_N / size : 1, force_N);
    return size > s->device->peak_N ? 1 : 0;
}

static int virtual_force_enable(void *handle, int on)
{
    virtual_state *s = handle;
    atomic_store(&s->enabled, on != 0);
    if (on) atomic_store(&s->stopped, false);
    return 0;
}

static int virtual_stop(void *handle)
{
    virtual_state *s = handle;
    atomic_store(&s->stopped, true);
    return 0;
}

static const char *virtual_strerror(void *handle, int error)
{
    (void)handle;
    static const char *const text[] = {
        "ok",
        "out of memory",
        "no such virtual device: touch, premium, omega3, inverse3 or falcon",
        "no answer from the device",
        "force is not finite",
        "the virtual hand does not know this --hand, --script or --options (--help lists them)"};
    if (error > 0) return "motor saturated";
    return error >= UNKNOWN_OPTION ? text[-error] : "unknown";
}

const pal_haptic_v1 *pal_device_virtual(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "virtual",
                                        .probe = virtual_probe,
                                        .open = virtual_open,
                                        .read = virtual_read,
                                        .write = virtual_write,
                                        .force_enable = virtual_force_enable,
                                        .stop = virtual_stop,
                                        .close = free,
                                        .strerror = virtual_strerror};
    return &table;
}

void pal_virtual_truth(void *handle, double position_m[3], double velocity_m_s[3], double force_N[3])
{
    const virtual_state *s = handle;
    if (position_m) pal_copy3(position_m, s->x);
    if (velocity_m_s) pal_copy3(velocity_m_s, s->v);
    if (force_N) pal_copy3(force_N, s->applied);
}

pal_virtual_phase pal_virtual_script_phase(void *handle)
{
    return (pal_virtual_phase)atomic_load(&((virtual_state *)handle)->phase);
}

void pal_virtual_set_handle(void *handle, uint32_t buttons, const double quat[4])
{
    virtual_state *s = handle;
    s->buttons = buttons;
    memcpy(s->quat, quat, sizeof s->quat);
}

void pal_virtual_push(void *handle, const double force_N[3])
{
    pal_copy3(((virtual_state *)handle)->push, force_N);
}

void pal_virtual_place(void *handle, const double position_m[3])
{
    virtual_state *s = handle;
    pal_copy3(s->x, position_m);
    pal_copy3(s->xh, position_m);
    pal_copy3(s->xd, position_m);
    pal_set3(s->v, 0, 0, 0);
    pal_set3(s->vh, 0, 0, 0);
}

void pal_virtual_set_friction(void *handle, double viscous_Ns_m, double coulomb_N)
{
    virtual_state *s = handle;
    s->viscous = viscous_Ns_m;
    s->coulomb = coulomb_N;
}
