/* Monotonic time, pacing, and clocks that tests advance by hand. Thread: any. */
#ifndef PAL_BASE_CLOCK_H
#define PAL_BASE_CLOCK_H
#include <pthread.h>
#include <stdint.h>

uint64_t pal_clock_ns(void);                       /* CLOCK_MONOTONIC */
uint64_t pal_clock_thread_ns(void);                /* processor time of the calling thread */
uint64_t pal_clock_thread_of_ns(pthread_t thread); /* of another one, which has not been joined */
double pal_clock_s(void);                          /* pal_clock_ns in seconds */
void pal_clock_sleep_until_ns(uint64_t when);      /* absolute; signals do not end it */

/* The time that leases, pacing and deadlines refer to. Where a clock is an option, NULL means pal_clock_monotonic;
 * tests give one of their own (tests/fixtures/manual_clock.h). Durations of work (profiles, prices) are always measured
 * with the functions above. */
typedef struct pal_clock {
    uint64_t (*now_ns)(void *user);
    /* returns at when_ns, or earlier after a wake, even one shortly before the sleep: the caller compares the time */
    void (*sleep_until_ns)(void *user, uint64_t when_ns);
    /* Interrupts every sleep, because a thread is to end or the result of another thread has come. NULL: no thread
     * sleeps longer than the caller may wait, and the times are those of CLOCK_MONOTONIC */
    void (*wake)(void *user);
    void *user;
} pal_clock;
extern const pal_clock pal_clock_monotonic;
uint64_t pal_clock_now_ns(const pal_clock *clock);
void pal_clock_wake(const pal_clock *clock);
#endif
