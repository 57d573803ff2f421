/* The time of the rig: nanoseconds since its start. */
#ifndef TESTS_RIG_RIG_CLOCK_H
#define TESTS_RIG_RIG_CLOCK_H
#include <stdint.h>

/* how much later than planned packets went on, by the rig's own fault: the system woke it late, or the receiver had no
 * room */
typedef struct rig_lateness {
    uint64_t n, sum_ns, max_ns;
} rig_lateness;

static inline void rig_lateness_add(rig_lateness *lateness, uint64_t planned_ns, uint64_t now_ns)
{
    const uint64_t late = now_ns > planned_ns ? now_ns - planned_ns : 0;
    lateness->n++, lateness->sum_ns += late;
    if (late > lateness->max_ns) lateness->max_ns = late;
}
#endif
