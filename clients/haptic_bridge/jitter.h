/* Log2 histogram of times with 32 bins per octave (3 % resolution), for the period and lateness of a servo loop.
 * Adding takes a few instructions without data-dependent branches on memory. One thread writes; any thread may read a
 * copy. */
#ifndef PAL_HAPTIC_BRIDGE_JITTER_H
#define PAL_HAPTIC_BRIDGE_JITTER_H
#include <stdint.h>

enum { PAL_JITTER_BITS = 5, PAL_JITTER_STEPS = 1 << PAL_JITTER_BITS, PAL_JITTER_BINS = 38 * PAL_JITTER_STEPS };

typedef struct pal_jitter {
    uint32_t bin[PAL_JITTER_BINS];
    uint64_t n, max_ns;
} pal_jitter;

void pal_jitter_add(pal_jitter *j, uint64_t ns);
void pal_jitter_merge(pal_jitter *into, const pal_jitter *from);
/* upper edge of the bin at this fraction, us; at most the maximum; 0 when empty */
double pal_jitter_at_us(const pal_jitter *j, double fraction);
#endif
