#include "clients/haptic_bridge/doctor.h"
#include "clients/haptic_bridge/servo_thread.h"
#include "server/base/clock.h"
#include "server/base/vec3.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum { FIFO_PRIORITY = 80, STEPS_MAX = 16 };

void pal_doctor_list(void)
{
    const pal_haptic_v1 *backend;
    for (int i = 0; (backend = pal_device_backend(i)); i++) {
        char reason[512] = "";
        const int n = backend->probe(reason, sizeof reason);
        if (n < 0)
            printf("%s: not available: %s\n", backend->name, reason);
        else
            printf("%s: %d: %s\n", backend->name, n, reason);
    }
}

/* one line; 1 when it is not ok */
static int doctor_line(bool good, const char *format, ...) __attribute__((format(printf, 2, 3)));
static int doctor_line(bool good, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    printf(good ? "ok      " : "not ok  ");
    vprintf(format, list);
    printf("\n");
    va_end(list);
    fflush(stdout);
    return !good;
}

static int doctor_limits(void)
{
    struct rlimit priority, locked;
    getrlimit(RLIMIT_RTPRIO, &priority);
    getrlimit(RLIMIT_MEMLOCK, &locked);
    const bool root = geteuid() == 0, may = root || priority.rlim_cur > FIFO_PRIORITY;
    int bad = root ? doctor_line(true, "real-time priority: any, as root")
                   : doctor_line(may, "real-time priority: up to %llu%s", (unsigned long long)priority.rlim_cur,
                                 may ? "" : "; give your user rtprio 85 in /etc/security/limits.d, then log in again");
    const bool all = root || locked.rlim_cur == RLIM_INFINITY;
    bad += doctor_line(all, "locked memory: %s",
                       all ? "without limit" : "limited; give your user memlock unlimited in /etc/security/limits.d");
    return bad;
}

static int doctor_steps(const pal_haptic_v1 *backend, void *device)
{
    int bad = 0;
    for (int step = 0; step < STEPS_MAX && backend->check; step++) {
        char text[512] = "";
        const int result = backend->check(device, step, text, sizeof text);
        if (result == 0) break;
        bad += doctor_line(result > 0, "%s", text);
    }
    return bad;
}

/* the servo without force: pose, rate and lateness */
static int doctor_servo(const pal_servo_options *options, double seconds)
{
    pal_servo *servo = NULL;
    pal_servo_thread *thread = NULL;
    pal_servo_timing timing = {0};
    pal_diagnostic refused = {""};
    pal_servo_view view = {0};
    pal_err err = pal_servo_create(options, &servo);
    if (!err) err = pal_servo_thread_start(servo, options, &refused, &thread);
    if (!err) pal_clock_sleep_until_ns(pal_clock_ns() + (uint64_t)(1e9 * seconds));
    const pal_servo_view *last = err ? NULL : pal_servo_take_view(servo);
    if (last) view = *last;
    pal_servo_thread_stop(thread, &timing);
    pal_servo_event event;
    int bad = err ? doctor_line(false, "servo: %s", pal_err_text(err)) : 0;
    while (!err && pal_servo_take_event(servo, &event))
        if (event.kind == PAL_EVENT_DEVICE_LOST) bad += doctor_line(false, "lost: %s", event.text);
    pal_servo_destroy(servo);
    if (err) return bad;
    const bool pose = view.n_tick > 0 && pal_finite3(view.position_m);
    bad += doctor_line(pose, "pose: %.1f %.1f %.1f mm%s", view.position_m[0] * 1e3, view.position_m[1] * 1e3,
                       view.position_m[2] * 1e3, pose ? "" : "; none came");
    const double rate = (double)timing.n_tick / seconds;
    bad += doctor_line(rate > 0.9 * options->rate_hz, "update rate: %.0f Hz of %.0f", rate, options->rate_hz);
    const bool fifo = timing.rt_flags & PAL_RT_FIFO;
    bad += doctor_line(fifo, "real time: %s, memory %s", fifo ? "SCHED_FIFO" : refused.text,
                       timing.rt_flags & PAL_RT_LOCKED ? "locked" : "not locked");
    const double late = pal_jitter_at_us(&timing.lateness, 0.999);
    bad += doctor_line(late < 2000, "%llu ticks, %llu missed, lateness p50 %.0f p99.9 %.0f max %.0f us%s",
                       (unsigned long long)timing.n_tick, (unsigned long long)timing.n_missed,
                       pal_jitter_at_us(&timing.lateness, 0.5), late, (double)timing.lateness.max_ns * 1e-3,
                       late < 2000 ? "" : "; stiffness or forces will be limited: end other programs, allow real time");
    return bad;
}

int pal_doctor(const char *id, const pal_servo_options *options, double seconds)
{
    pal_servo_options o = *options;
    int bad = doctor_limits() + doctor_steps(o.backend, NULL);
    const int error = o.backend->open(&o.device, id, &o.info);
    if (error < 0) {
        bad += doctor_line(false, "device: %s", o.backend->strerror(o.device, error));
        o.backend->close(o.device);
        return bad;
    }
    bad += doctor_line(true, "device: %s, peak %g N, continuous %g N, stiffness %g N/m%s", o.info.name, o.info.peak_N,
                       o.info.continuous_N, o.info.stiffness_max_N_m, o.info.pose_only ? "; pose only" : "");
    bad += doctor_steps(o.backend, o.device);
    o.pose_only = true;
    o.rotation[0] = o.rotation[4] = o.rotation[8] = 1;
    pal_set3(o.origin_m, 0, 0, 0);
    bad += doctor_servo(&o, seconds);
    o.backend->close(o.device);
    return bad;
}
