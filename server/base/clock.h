/* Monotonic time and pacing. Thread: any. */
#ifndef PAL_BASE_CLOCK_H
#define PAL_BASE_CLOCK_H
#include <stdint.h>

uint64_t pal_clock_ns(void);                  /* CLOCK_MONOTONIC */
uint64_t pal_clock_thread_ns(void);           /* processor time of the calling thread */
double pal_clock_s(void);                     /* pal_clock_ns in seconds */
void pal_clock_sleep_until_ns(uint64_t when); /* absolute; signals do not end it */
#endif
