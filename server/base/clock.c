#include "server/base/clock.h"

#include <errno.h>
#include <time.h>

static uint64_t read_ns(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

uint64_t pal_clock_ns(void)
{
    return read_ns(CLOCK_MONOTONIC);
}

uint64_t pal_clock_thread_ns(void)
{
    return read_ns(CLOCK_THREAD_CPUTIME_ID);
}

uint64_t pal_clock_thread_of_ns(pthread_t thread)
{
    clockid_t clock;
    return pthread_getcpuclockid(thread, &clock) ? 0 : read_ns(clock);
}

double pal_clock_s(void)
{
    return 1e-9 * (double)pal_clock_ns();
}

void pal_clock_sleep_until_ns(uint64_t when)
{
    struct timespec t = {.tv_sec = (time_t)(when / 1000000000u), .tv_nsec = (long)(when % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, 0) == EINTR) {
    }
}

static uint64_t monotonic_now(void *user)
{
    (void)user;
    return pal_clock_ns();
}

static void monotonic_sleep(void *user, uint64_t when_ns)
{
    (void)user;
    pal_clock_sleep_until_ns(when_ns);
}

const pal_clock pal_clock_monotonic = {.now_ns = monotonic_now, .sleep_until_ns = monotonic_sleep};

uint64_t pal_clock_now_ns(const pal_clock *clock)
{
    return clock->now_ns(clock->user);
}

void pal_clock_wake(const pal_clock *clock)
{
    if (clock->wake) clock->wake(clock->user);
}
