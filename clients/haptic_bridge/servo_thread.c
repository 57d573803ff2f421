#include "clients/haptic_bridge/servo_thread.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/triple_buffer.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define WATCHDOG_NS      20000000u
#define WATCHDOG_STEP_NS 5000000u
#define ONE_SECOND_NS    1000000000u
#define JUDGE_MIN_TICKS  2000
#define LIMIT_LATE_US    2000.0
#define OFF_LATE_US      10000.0
#define OFF_MISSED       0.01

enum { FIFO_SERVO = 80, FIFO_WATCHDOG = 81, STACK_TOUCH_BYTES = 256 * 1024, JUDGE_SECONDS = 10 };

struct pal_servo_thread {
    pal_servo *servo;
    pal_servo_options options;
    const pal_clock *clock;
    pthread_t loop, watchdog;
    bool has_watchdog;
    atomic_bool stop, idle; /* idle: no ticks are due, as the device is lost or has not begun to call */
    atomic_uint n_watchdog;
    atomic_int rt_flags;
    uint64_t period_ns, last_ns, judge_ns; /* last: 0 before the first tick */
    pal_triple_buffer timings;
    pal_servo_timing slot[3], total;
    /* lateness of each of the last seconds, for the judgement */
    pal_jitter second[JUDGE_SECONDS];
    uint64_t second_missed[JUDGE_SECONDS];
    int now_second;
};

static void thread_touch_stack(void)
{
    volatile char block[STACK_TOUCH_BYTES];
    for (size_t i = 0; i < sizeof block; i += 4096) block[i] = 0;
}

/* once a second: publishes the timing and decides what forces the loop may give */
static void thread_judge(pal_servo_thread *t)
{
    static _Thread_local pal_jitter window;
    memset(&window, 0, sizeof window);
    uint64_t missed = 0;
    for (int i = 0; i < JUDGE_SECONDS; i++) {
        pal_jitter_merge(&window, &t->second[i]);
        missed += t->second_missed[i];
    }
    int level = 0;
    if (window.n + missed >= JUDGE_MIN_TICKS) {
        const double late = pal_jitter_at_us(&window, 0.999);
        if (late > LIMIT_LATE_US) level = 1;
        if (late > OFF_LATE_US || (double)missed > OFF_MISSED * (double)(window.n + missed)) level = 2;
    }
    pal_servo_set_degraded(t->servo, level);
    t->total.rt_flags = atomic_load(&t->rt_flags) | (level == 1 ? PAL_RT_LIMITED : 0) | (level == 2 ? PAL_RT_OFF : 0);
    t->total.n_watchdog = atomic_load(&t->n_watchdog);
    pal_servo_timing *slot = pal_triple_buffer_slot(&t->timings);
    *slot = t->total;
    pal_triple_buffer_publish(&t->timings);
    t->now_second = (t->now_second + 1) % JUDGE_SECONDS;
    memset(&t->second[t->now_second], 0, sizeof t->second[0]);
    t->second_missed[t->now_second] = 0;
}

/* false: the thread is to end */
static bool thread_sleep_until(pal_servo_thread *t, uint64_t when_ns)
{
    t->clock->sleep_until_ns(t->clock->user, when_ns);
    return !atomic_load(&t->stop);
}

/* one tick at its time: what it took to come, and once a second the judgement */
static void thread_tick(pal_servo_thread *t, uint64_t now, uint64_t late, uint64_t missed)
{
    pal_servo_tick(t->servo, now);
    pal_jitter_add(&t->total.lateness, late);
    pal_jitter_add(&t->second[t->now_second], late);
    if (t->last_ns) pal_jitter_add(&t->total.period, now - t->last_ns);
    t->last_ns = now;
    t->total.n_tick++;
    t->total.n_missed += missed;
    t->second_missed[t->now_second] += missed;
    if (now < t->judge_ns) return;
    thread_judge(t);
    t->judge_ns += ONE_SECOND_NS;
}

/* lost, and there is a way to get it back */
static bool thread_is_lost(const pal_servo_thread *t)
{
    return pal_servo_device_lost(t->servo) && t->options.backend->reopen;
}

/* the servo of a polled device, until the end or until the device is lost */
static void thread_poll(pal_servo_thread *t)
{
    uint64_t due = pal_clock_now_ns(t->clock) + t->period_ns, missed = 0;
    while (thread_sleep_until(t, due)) {
        const uint64_t now = pal_clock_now_ns(t->clock), late = now > due ? now - due : 0;
        thread_tick(t, now, late, missed);
        if (thread_is_lost(t)) return;
        atomic_store(&t->idle, false);
        due += t->period_ns;
        /* missed ticks are left out, the grid of due times stays */
        const uint64_t after = pal_clock_now_ns(t->clock), behind = after > due ? after - due : 0;
        missed = behind ? behind / t->period_ns + (behind > t->period_ns / 2) : 0;
        due += missed * t->period_ns;
    }
}

/* a tick of a device that calls (device.h, run): late is what it comes after a period */
static int thread_on_call(void *user)
{
    pal_servo_thread *t = user;
    const uint64_t now = pal_clock_now_ns(t->clock);
    if (atomic_exchange(&t->idle, false) && sched_getscheduler(0) == SCHED_FIFO)
        atomic_fetch_or(&t->rt_flags, PAL_RT_FIFO);
    const uint64_t due = t->last_ns ? t->last_ns + t->period_ns : now, late = now > due ? now - due : 0;
    thread_tick(t, now, late, late / t->period_ns);
    return atomic_load(&t->stop) || pal_servo_device_lost(t->servo);
}

/* the servo of a device that calls: a lost one fails to read, which the servo reports */
static void thread_be_called(pal_servo_thread *t)
{
    const int error = t->options.backend->run(t->options.device, thread_on_call, t);
    atomic_store(&t->idle, true);
    for (int i = 0; i < 2 && error < 0 && !pal_servo_device_lost(t->servo); i++)
        pal_servo_tick(t->servo, pal_clock_now_ns(t->clock));
    /* a back end that returns at once does not keep the processor */
    if (!thread_is_lost(t)) thread_sleep_until(t, pal_clock_now_ns(t->clock) + t->period_ns);
}

static void *thread_loop(void *user)
{
    pal_servo_thread *t = user;
    const pal_haptic_v1 *backend = t->options.backend;
    thread_touch_stack();
    t->judge_ns = pal_clock_now_ns(t->clock) + t->period_ns + ONE_SECOND_NS;
    while (!atomic_load(&t->stop)) {
        t->last_ns = 0;
        t->options.info.thread_model == PAL_DEVICE_POLLED ? thread_poll(t) : thread_be_called(t);
        atomic_store(&t->idle, true);
        while (thread_is_lost(t) &&
               thread_sleep_until(t, pal_clock_now_ns(t->clock) + (uint64_t)(PAL_DEVICE_RETRY_S * ONE_SECOND_NS))) {
            if (backend->reopen(t->options.device) < 0) continue;
            backend->force_enable(t->options.device, !t->options.pose_only);
            break;
        }
    }
    pal_servo_end(t->servo);
    return NULL;
}

static void *thread_watch(void *user)
{
    pal_servo_thread *t = user;
    uint64_t now = pal_clock_now_ns(t->clock), since = now, seen = pal_servo_ticks(t->servo);
    bool stopped = false;
    while (thread_sleep_until(t, now + WATCHDOG_STEP_NS)) {
        const uint64_t ticks = pal_servo_ticks(t->servo);
        now = pal_clock_now_ns(t->clock);
        if (ticks != seen || atomic_load(&t->idle)) {
            seen = ticks, since = now;
            stopped = false;
        } else if (!stopped && now - since > WATCHDOG_NS) {
            t->options.backend->stop(t->options.device);
            pal_servo_stalled(t->servo);
            atomic_fetch_add(&t->n_watchdog, 1);
            stopped = true;
        }
    }
    return NULL;
}

/* a thread with a real-time class when allowed, else a plain one */
static pal_err thread_make(pthread_t *thread, void *(*run)(void *), void *user, int priority, bool *real_time)
{
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes)) return PAL_ERR_MEMORY;
    const struct sched_param parameter = {.sched_priority = priority};
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
    pthread_attr_setschedparam(&attributes, &parameter);
    int failed = pthread_create(thread, &attributes, run, user);
    pthread_attr_destroy(&attributes);
    *real_time = failed == 0;
    if (failed) failed = pthread_create(thread, NULL, run, user);
    return failed ? PAL_ERR_MEMORY : PAL_ERR_OK;
}

static void thread_join(pal_servo_thread *t)
{
    atomic_store(&t->stop, true);
    pal_clock_wake(t->clock);
    pthread_join(t->loop, NULL);
    if (t->has_watchdog) pthread_join(t->watchdog, NULL);
}

pal_err pal_servo_thread_start(pal_servo *servo, const pal_servo_options *options, pal_diagnostic *diag,
                               pal_servo_thread **out)
{
    pal_servo_thread *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    t->servo = servo;
    t->options = *options;
    t->clock = options->clock ? options->clock : &pal_clock_monotonic;
    t->period_ns = (uint64_t)(1e9 / options->rate_hz);
    pal_triple_buffer_init(&t->timings, &t->slot[0], &t->slot[1], &t->slot[2]);
    bool fifo = false, fifo_watch = false;
    const bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    options->backend->force_enable(options->device, !options->pose_only);
    atomic_store(&t->rt_flags, locked ? PAL_RT_LOCKED : 0);
    atomic_store(&t->idle, options->info.thread_model != PAL_DEVICE_POLLED);
    pal_err err = thread_make(&t->loop, thread_loop, t, FIFO_SERVO, &fifo);
    if (!err && !options->no_watchdog) {
        err = thread_make(&t->watchdog, thread_watch, t, FIFO_WATCHDOG, &fifo_watch);
        t->has_watchdog = !err;
        if (err) thread_join(t);
    }
    if (err) {
        free(t);
        return err;
    }
    cpu_set_t last;
    CPU_ZERO(&last);
    CPU_SET((size_t)(sysconf(_SC_NPROCESSORS_ONLN) - 1), &last);
    const bool pinned = fifo && pthread_setaffinity_np(t->loop, sizeof last, &last) == 0;
    pal_diagnostic_set(diag, PAL_ERR_OK, "%s%s%s", fifo ? "" : "no SCHED_FIFO (needs CAP_SYS_NICE or an rtprio limit) ",
                       locked ? "" : "memory not locked (needs a memlock limit) ",
                       fifo && !pinned ? "not pinned to a processor" : "");
    /* the thread of a library is the library's */
    if (fifo && options->info.thread_model != PAL_DEVICE_CALLBACK) atomic_fetch_or(&t->rt_flags, PAL_RT_FIFO);
    *out = t;
    return PAL_ERR_OK;
}

void pal_servo_thread_stop(pal_servo_thread *thread, pal_servo_timing *timing)
{
    if (!thread) return;
    thread_join(thread);
    thread->total.n_watchdog = atomic_load(&thread->n_watchdog);
    thread->total.rt_flags |= atomic_load(&thread->rt_flags);
    if (timing) *timing = thread->total;
    free(thread);
}

const pal_servo_timing *pal_servo_thread_timing(pal_servo_thread *thread)
{
    return pal_triple_buffer_take(&thread->timings);
}
