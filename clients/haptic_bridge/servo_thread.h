/* The real-time thread of a servo, its watchdog and its timing measurement (clients/haptic_bridge/README.md,
 * "Real time").
 *
 * The loop sleeps until absolute times of the clock in pal_servo_options. A tick later than one period counts as missed
 * and is skipped, never caught up. Where the system allows it: SCHED_FIFO 80 (watchdog 81), locked memory, a prefaulted
 * stack, the last processor; what it refuses is reported. Every second the lateness of the last 10 s is checked: p99.9
 * above 2 ms limits stiffness; above 10 ms, or more than 1 % missed ticks, forces are off. The watchdog stops the
 * device after 20 ms without a tick.
 *
 * A device that calls (device.h, run) ticks on the thread of its library or in the loop, at its own pace: a tick is
 * late by what it comes after one period. A lost device is opened again every 2 s, where its back end can; until then
 * there are no ticks, and the watchdog rests. */
#ifndef PAL_HAPTIC_BRIDGE_SERVO_THREAD_H
#define PAL_HAPTIC_BRIDGE_SERVO_THREAD_H
#include "clients/haptic_bridge/jitter.h"
#include "clients/haptic_bridge/servo.h"

typedef struct pal_servo_thread pal_servo_thread;

enum { PAL_RT_FIFO = 1, PAL_RT_LOCKED = 2, PAL_RT_LIMITED = 4, PAL_RT_OFF = 8 };

typedef struct pal_servo_timing {
    pal_jitter period, lateness; /* of all ticks                          */
    uint64_t n_tick, n_missed;
    int rt_flags;        /* PAL_RT_*                              */
    uint64_t n_watchdog; /* times the watchdog stopped the device */
} pal_servo_timing;

/* Starts both threads; borrows servo and device until stop. diag: what the system refused, "" for nothing. [load] */
pal_err pal_servo_thread_start(pal_servo *servo, const pal_servo_options *options, pal_diagnostic *diag,
                               pal_servo_thread **out);
/* ends the threads with zero force; *timing: of the whole run, may be NULL. NULL thread is fine. [load] */
void pal_servo_thread_stop(pal_servo_thread *thread, pal_servo_timing *timing);
/* [net] timing as of the last full second; NULL: unchanged since the last call */
const pal_servo_timing *pal_servo_thread_timing(pal_servo_thread *thread);
#endif
