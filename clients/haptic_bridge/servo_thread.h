/* The real-time thread of a servo, its watchdog and its own measurement (clients/haptic_bridge/README.md, "Real time").
 *
 * Absolute clock_nanosleep; a tick later than one period counts as missed and is skipped, never caught up. SCHED_FIFO
 * 80 (watchdog 81), locked memory, touched stack and the last processor when the system allows them; what it does not
 * is stated. Every second the lateness of the last 10 s decides: p99.9 above 2 ms limits stiffness, above 10 ms or more
 * than 1 % missed turns forces off. The watchdog stops the device when no tick has happened for 20 ms. */
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

/* starts both threads; borrows servo and device until stop. note: what the system refused, "" when nothing. [load] */
pal_err pal_servo_thread_start(pal_servo *servo, const pal_servo_options *options, pal_diagnostic *diag,
                               pal_servo_thread **out);
/* ends the threads with zero force; *timing is the whole run's, may be NULL. NULL thread is fine. [load] */
void pal_servo_thread_stop(pal_servo_thread *thread, pal_servo_timing *timing);
/* [net] the timing as of the last full second; NULL: not newer than at the last call */
const pal_servo_timing *pal_servo_thread_timing(pal_servo_thread *thread);
#endif
