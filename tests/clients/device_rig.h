/* A back end and its fake (tests/fakes), with the servo and its threads on a clock that the test advances. The fake is
 * loaded by the bridge's own way; tissue lies below z = 0 of the world, whose axes are the device's. */
#ifndef TESTS_CLIENTS_DEVICE_RIG_H
#define TESTS_CLIENTS_DEVICE_RIG_H
#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/servo_thread.h"
#include "tests/check.h"
#include "tests/fakes/fake_plant.h"
#include "tests/fixtures/manual_clock.h"

#include <dlfcn.h>

#define RIG_MS_NS     1000000u
#define RIG_STIFFNESS 200.0f

typedef struct device_rig {
    manual_clock clock;
    const fake_control *fake;
    pal_servo_options o;
    pal_servo *servo;
    pal_servo_thread *thread;
    pal_servo_view view;
    uint32_t seq;
    int n_lost, n_back, n_fault;
    char lost[PAL_DEVICE_TEXT]; /* the last sentence about it */
} device_rig;

/* the fake that the bridge has found under this name */
static inline const fake_control *rig_fake(const char *library)
{
    void *loaded = dlopen(library, RTLD_LAZY | RTLD_NOLOAD);
    const fake_control *(*entry)(void) = NULL;
    void *address = loaded ? dlsym(loaded, "fake_entry") : NULL;
    memcpy(&entry, &address, sizeof entry);
    return entry ? entry() : NULL;
}

/* opens the device on a clock that stands; < 0: its error */
static inline int rig_open(device_rig *r, const pal_haptic_v1 *backend, const char *id)
{
    *r = (device_rig){.fake = r->fake,
                      .o = {.backend = backend, .rate_hz = 1000, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    manual_clock_init(&r->clock, 1000 * (uint64_t)RIG_MS_NS);
    pal_device_set_clock(&r->clock.clock);
    r->o.clock = &r->clock.clock;
    return backend->open(&r->o.device, id, &r->o.info);
}

static inline bool rig_run(device_rig *r)
{
    if (pal_servo_create(&r->o, &r->servo) || pal_servo_thread_start(r->servo, &r->o, NULL, &r->thread)) return false;
    manual_clock_settle(&r->clock, r->o.info.thread_model == PAL_DEVICE_POLLED ? 2 : 1); /* watchdog, and the servo */
    return true;
}

/* *timing may be NULL */
static inline void rig_close(device_rig *r, pal_servo_timing *timing)
{
    /* a tick is needed to see the end, and the test calls for none any more */
    if (r->fake) r->fake->set(FAKE_STALL_AT, 0);
    if (r->fake) r->fake->set(FAKE_WALL, 1);
    pal_servo_thread_stop(r->thread, timing);
    pal_servo_destroy(r->servo);
    r->o.backend->close(r->o.device);
}

static inline void rig_look(device_rig *r)
{
    const pal_servo_view *view = pal_servo_take_view(r->servo);
    if (view) r->view = *view;
    pal_servo_event event;
    while (pal_servo_take_event(r->servo, &event)) {
        r->n_back += event.kind == PAL_EVENT_RECOVERED && strstr(event.text, "device") != NULL;
        r->n_fault += event.kind == PAL_EVENT_FAULT;
        if (event.kind != PAL_EVENT_DEVICE_LOST) continue;
        r->n_lost++;
        snprintf(r->lost, sizeof r->lost, "%s", event.text);
    }
}

/* 1 ms with one tick, and a model every 16 ms */
static inline void rig_tick(device_rig *r)
{
    const bool calls = r->o.info.thread_model != PAL_DEVICE_POLLED;
    if (r->seq++ % 16 == 0) {
        const uint64_t stamp_us = manual_clock_now(&r->clock) / 1000;
        pal_wire_haptic model = {.seq = r->seq, .stamp_us = stamp_us, .n_patch = 1, .frame_us = 16667};
        model.patch[0] =
            (pal_wire_contact_patch){.id = 1, .group = 1, .n = {0, 0, 1}, .k1_N_m = RIG_STIFFNESS, .radius_m = 1};
        pal_servo_put_model(r->servo, &model, 1, manual_clock_now(&r->clock));
    }
    manual_clock_advance(&r->clock, RIG_MS_NS);
    manual_clock_settle(&r->clock, calls ? 1 : 2);
    if (calls) r->fake->frames(1);
    rig_look(r);
}
static inline void rig_ticks(device_rig *r, int n)
{
    for (int i = 0; i < n; i++) rig_tick(r);
}

/* time without ticks, while a device is lost or stalls; n_thread sleep on the clock */
static inline void rig_wait(device_rig *r, int ms, int n_thread)
{
    manual_clock_settle(&r->clock, n_thread);
    manual_clock_steps(&r->clock, ms, RIG_MS_NS, n_thread);
    rig_look(r);
}

/* until the device presses the tissue with some force, at most 6 s */
static inline bool rig_press(device_rig *r)
{
    r->fake->set(FAKE_BUTTONS, 1);
    for (int i = 0; i < 6000 && !(r->view.depth_m > 0.0025 && r->view.fade == 1); i++) rig_tick(r);
    rig_ticks(r, 300); /* the hand sinks in */
    return r->view.depth_m > 0.0025;
}

static inline double rig_motor_force(const device_rig *r)
{
    double force_N[3];
    r->fake->truth(NULL, force_N);
    return sqrt(force_N[0] * force_N[0] + force_N[1] * force_N[1] + force_N[2] * force_N[2]);
}

/* until the motors give more than that, at most 2 s */
static inline bool rig_until_force(device_rig *r, double force_N)
{
    for (int i = 0; i < 2000 && rig_motor_force(r) <= force_N; i++) rig_tick(r);
    return rig_motor_force(r) > force_N;
}
#endif
