/* The servo's own threads beside a network thread: everything that crosses does so by triple buffer, ring and flag (the
 * race detector's preset runs this). Nothing here depends on how punctual the machine is. */
#include "clients/haptic_bridge/device_virtual.h"
#include "clients/haptic_bridge/servo_thread.h"
#include "server/base/clock.h"
#include "tests/check.h"

typedef struct trial {
    void *device;
    pal_servo_options o;
    pal_servo *servo;
    pal_servo_thread *thread;
} trial;

static bool rig_start(trial *r, const char *id)
{
    *r = (trial){.o = {.backend = pal_device_virtual(), .rate_hz = 1000, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    if (pal_device_virtual()->open(&r->device, id, &r->o.info)) return false;
    r->o.device = r->device;
    return !pal_servo_create(&r->o, &r->servo) && !pal_servo_thread_start(r->servo, &r->o, NULL, &r->thread);
}

static void rig_end(trial *r, pal_servo_timing *timing)
{
    pal_servo_thread_stop(r->thread, timing);
    pal_servo_destroy(r->servo);
    pal_device_virtual()->close(r->device);
}

/* the network side for one millisecond: a model in, views and events out */
static void serve(trial *r, uint32_t seq, pal_servo_view *view)
{
    pal_wire_haptic model = {.seq = seq, .n_patch = 1, .frame_us = 16667};
    model.patch[0] = (pal_wire_contact_patch){.id = 1, .group = 1, .n = {0, 0, 1}, .k1_N_m = 300};
    pal_servo_put_model(r->servo, &model, 1, pal_clock_ns());
    const pal_servo_view *fresh = pal_servo_take_view(r->servo);
    if (fresh) *view = *fresh;
    pal_servo_event event;
    while (pal_servo_take_event(r->servo, &event)) CHECK(event.text != NULL);
    (void)pal_servo_thread_timing(r->thread);
    pal_clock_sleep_until_ns(pal_clock_ns() + 1000000);
}

static void models_views_and_events_cross_the_threads_whole(void)
{
    trial r;
    REQUIRE(rig_start(&r, "premium,wait=0"));
    pal_servo_view view = {0};
    uint64_t last_tick = 0;
    const uint64_t end = pal_clock_ns() + 20000000000u;
    uint32_t seq = 0;
    while (view.n_tick < 1500 && pal_clock_ns() < end) {
        serve(&r, ++seq, &view);
        CHECK(view.n_tick >= last_tick);
        CHECK(view.model_seq <= seq);
        last_tick = view.n_tick;
    }
    CHECK(view.n_tick >= 1500);
    CHECK(view.n_model > 0);
    pal_servo_timing timing;
    rig_end(&r, &timing);
    CHECK(timing.n_tick >= 1500);
    CHECK_INT(timing.period.n, timing.n_tick - 1);
    CHECK(timing.lateness.n == timing.n_tick);
}

static void emergency_stop_from_another_thread_is_latched(void)
{
    trial r;
    REQUIRE(rig_start(&r, "premium,wait=0"));
    pal_servo_view view = {0};
    const uint64_t end = pal_clock_ns() + 20000000000u;
    uint32_t seq = 0;
    while (view.n_tick < 100 && pal_clock_ns() < end) serve(&r, ++seq, &view);
    pal_servo_estop(r.servo);
    const uint64_t at = view.n_tick;
    while (view.n_tick < at + 50 && pal_clock_ns() < end) serve(&r, ++seq, &view);
    CHECK_INT(view.state, PAL_SERVO_ESTOP);
    CHECK_NEAR(fabs(view.force_N[0]) + fabs(view.force_N[1]) + fabs(view.force_N[2]), 0, 0);
    rig_end(&r, NULL);
}

int main(void)
{
    RUN(models_views_and_events_cross_the_threads_whole);
    RUN(emergency_stop_from_another_thread_is_latched);
    return check_report();
}
