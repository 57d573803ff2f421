/* The servo's threads on a clock that the test advances: ticks, lateness, judgement and watchdog to the number, and
 * what crosses to a network thread by triple buffer, ring and flag (the race detector's preset runs this). */
#include "clients/haptic_bridge/device_virtual.h"
#include "clients/haptic_bridge/servo_thread.h"
#include "tests/check.h"
#include "tests/fixtures/manual_clock.h"

#include <semaphore.h>
#include <stdatomic.h>

#define MS_NS 1000000u

typedef struct trial {
    manual_clock clock;
    void *device;
    pal_servo_options o;
    pal_servo *servo;
    pal_servo_thread *thread;
    pal_servo_view view;
    pal_servo_timing timing; /* as of the last second */
    uint32_t seq;
} trial;

/* a device whose read waits while the test holds it, as a driver that hangs does */
static pal_haptic_v1 device_that_hangs;
static sem_t gate, at_gate;
static atomic_bool hangs;
static int read_at_gate(void *handle, pal_dev_state *state)
{
    if (atomic_exchange(&hangs, false)) {
        sem_post(&at_gate);
        sem_wait(&gate);
    }
    return pal_device_virtual()->read(handle, state);
}

static bool rig_start(trial *r, const pal_haptic_v1 *backend)
{
    *r = (trial){.o = {.backend = backend, .rate_hz = 1000, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    manual_clock_init(&r->clock, 1000 * (uint64_t)MS_NS);
    r->o.clock = &r->clock.clock;
    if (backend->open(&r->device, "premium,wait=0,clock=virtual", &r->o.info)) return false;
    r->o.device = r->device;
    if (pal_servo_create(&r->o, &r->servo) || pal_servo_thread_start(r->servo, &r->o, NULL, &r->thread)) return false;
    manual_clock_settle(&r->clock, 2); /* servo and watchdog */
    return true;
}

static void rig_end(trial *r, pal_servo_timing *timing)
{
    pal_servo_thread_stop(r->thread, timing);
    pal_servo_destroy(r->servo);
    pal_device_virtual()->close(r->device);
}

/* what the network side does meanwhile: a model in, events out */
static void serve(trial *r)
{
    const uint64_t stamp_us = manual_clock_now(&r->clock) / 1000;
    pal_wire_haptic model = {.seq = ++r->seq, .stamp_us = stamp_us, .n_patch = 1, .frame_us = 16667};
    model.patch[0] = (pal_wire_contact_patch){.id = 1, .group = 1, .n = {0, 0, 1}, .k1_N_m = 300};
    pal_servo_put_model(r->servo, &model, 1, manual_clock_now(&r->clock));
    pal_servo_event event;
    while (pal_servo_take_event(r->servo, &event)) CHECK(event.text != NULL);
}

/* the time goes on; the servo ticks beside the network side, then everything that was due is done */
static void rig_advance(trial *r, uint64_t ns)
{
    manual_clock_advance(&r->clock, ns);
    serve(r);
    manual_clock_settle(&r->clock, 2);
    pal_virtual_advance(r->device, 1e-9 * (double)ns);
    const pal_servo_view *view = pal_servo_take_view(r->servo);
    if (view) r->view = *view;
    const pal_servo_timing *timing = pal_servo_thread_timing(r->thread);
    if (timing) r->timing = *timing;
}

static void models_views_and_events_cross_the_threads_whole(void)
{
    trial r;
    REQUIRE(rig_start(&r, pal_device_virtual()));
    for (uint64_t n = 1; n <= 1500; n++) {
        rig_advance(&r, MS_NS);
        CHECK_INT(r.view.n_tick, n);
        CHECK(r.view.model_seq <= r.seq);
        CHECK(r.view.model_seq + 1 >= r.seq); /* the newest, or it came just after the tick took its own */
    }
    CHECK_INT(r.view.n_model_old, 0);
    CHECK_INT(r.timing.n_tick, 1001); /* published with the tick at which the first second is over */
    pal_servo_timing timing;
    rig_end(&r, &timing);
    CHECK_INT(timing.n_tick, 1500);
    CHECK_INT(timing.n_missed, 0);
    CHECK_INT(timing.n_watchdog, 0);
    CHECK_INT(timing.period.n, 1499);
    CHECK_INT(timing.period.max_ns, MS_NS);
    CHECK_INT(timing.lateness.n, 1500);
    CHECK_INT(timing.lateness.max_ns, 0);
}

static void emergency_stop_from_another_thread_is_latched(void)
{
    trial r;
    REQUIRE(rig_start(&r, pal_device_virtual()));
    for (int n = 0; n < 100; n++) rig_advance(&r, MS_NS);
    CHECK_INT(r.view.state, PAL_SERVO_ARMING);
    pal_servo_estop(r.servo);
    for (int n = 0; n < 50; n++) {
        rig_advance(&r, MS_NS);
        CHECK_INT(r.view.state, PAL_SERVO_ESTOP);
        for (int k = 0; k < 3; k++) CHECK_NEAR(r.view.force_N[k], 0, 0);
    }
    rig_end(&r, NULL);
}

static void late_ticks_are_skipped_and_the_grid_of_due_times_stays(void)
{
    trial r;
    REQUIRE(rig_start(&r, pal_device_virtual()));
    rig_advance(&r, MS_NS);
    rig_advance(&r, 4 * MS_NS + MS_NS / 4); /* due at 2, ticks at 5.25: 3, 4 and 5 are left out */
    CHECK_INT(r.view.n_tick, 2);
    rig_advance(&r, 3 * MS_NS / 4); /* due at 6 */
    CHECK_INT(r.view.n_tick, 3);
    rig_advance(&r, MS_NS);
    CHECK_INT(r.view.n_tick, 4);
    pal_servo_timing timing;
    rig_end(&r, &timing);
    CHECK_INT(timing.n_tick, 4);
    CHECK_INT(timing.n_missed, 3);
    CHECK_INT(timing.lateness.max_ns, 13 * MS_NS / 4);
    CHECK_INT(timing.period.max_ns, 17 * MS_NS / 4);
}

/* every n_between-th tick comes late_ms late, for seconds; what the loop may give then */
static int rt_flags_after(int n_between, uint64_t late_ms, int seconds)
{
    trial r;
    if (!rig_start(&r, pal_device_virtual())) return -1;
    for (uint64_t now = 0, n = 1; now < (uint64_t)seconds * 1000; n++) {
        const uint64_t ms = n % (uint64_t)n_between == 0 ? 1 + late_ms : 1;
        rig_advance(&r, ms * MS_NS);
        now += ms;
    }
    const int flags = r.timing.rt_flags & (PAL_RT_LIMITED | PAL_RT_OFF);
    rig_end(&r, NULL);
    return flags;
}

static void lateness_limits_stiffness_and_then_takes_the_forces(void)
{
    CHECK_INT(rt_flags_after(1000000, 0, 3), 0);
    CHECK_INT(rt_flags_after(500, 3, 4), PAL_RT_LIMITED); /* p99.9 of 3 ms, 0.6 % missed */
    CHECK_INT(rt_flags_after(200, 3, 4), PAL_RT_OFF);     /* 1.5 % missed */
    CHECK_INT(rt_flags_after(500, 3, 1), 0);              /* too few ticks to judge by */
    CHECK_INT(rt_flags_after(900, 12, 4), PAL_RT_OFF);    /* p99.9 of 12 ms */
}

static void watchdog_stops_the_device_of_a_loop_that_stands_still(void)
{
    trial r;
    device_that_hangs = *pal_device_virtual();
    device_that_hangs.read = read_at_gate;
    sem_init(&gate, 0, 0);
    sem_init(&at_gate, 0, 0);
    REQUIRE(rig_start(&r, &device_that_hangs));
    for (int n = 0; n < 10; n++) rig_advance(&r, MS_NS);
    atomic_store(&hangs, true);
    manual_clock_advance(&r.clock, MS_NS);
    sem_wait(&at_gate);
    /* the watchdog looks every 5 ms: at 15 ms it has seen the tick of 10 ms, and stops the device at 40 ms */
    for (int n = 0; n < 10; n++) {
        manual_clock_advance(&r.clock, 5 * MS_NS);
        manual_clock_settle(&r.clock, 1);
    }
    sem_post(&gate);
    manual_clock_settle(&r.clock, 2);
    rig_advance(&r, 2 * MS_NS);
    CHECK_INT(r.view.n_fault, 1);
    CHECK_INT(r.view.state, PAL_SERVO_ARMING);
    pal_servo_timing timing;
    rig_end(&r, &timing);
    CHECK_INT(timing.n_watchdog, 1);
}

int main(void)
{
    RUN(models_views_and_events_cross_the_threads_whole);
    RUN(emergency_stop_from_another_thread_is_latched);
    RUN(late_ticks_are_skipped_and_the_grid_of_due_times_stays);
    RUN(lateness_limits_stiffness_and_then_takes_the_forces);
    RUN(watchdog_stops_the_device_of_a_loop_that_stands_still);
    return check_report();
}
