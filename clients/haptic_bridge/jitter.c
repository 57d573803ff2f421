#include "clients/haptic_bridge/jitter.h"

/* exponent, then the bits below the leading one */
static int jitter_bin(uint64_t ns)
{
    if (ns < PAL_JITTER_STEPS) return (int)ns;
    const int top = 63 - __builtin_clzll(ns);
    const int bin =
        (top - PAL_JITTER_BITS + 1) * PAL_JITTER_STEPS + (int)(ns >> (top - PAL_JITTER_BITS) & (PAL_JITTER_STEPS - 1));
    return bin < PAL_JITTER_BINS ? bin : PAL_JITTER_BINS - 1;
}

static double jitter_upper_ns(int bin)
{
    if (bin < PAL_JITTER_STEPS) return bin + 1;
    const int top = bin / PAL_JITTER_STEPS + PAL_JITTER_BITS - 1;
    return (double)(PAL_JITTER_STEPS + bin % PAL_JITTER_STEPS + 1) * (double)(1ull << (top - PAL_JITTER_BITS));
}

void pal_jitter_add(pal_jitter *j, uint64_t ns)
{
    j->bin[jitter_bin(ns)]++;
    j->n++;
    if (ns > j->max_ns) j->max_ns = ns;
}

void pal_jitter_merge(pal_jitter *into, const pal_jitter *from)
{
    for (int i = 0; i < PAL_JITTER_BINS; i++) into->bin[i] += from->bin[i];
    into->n += from->n;
    if (from->max_ns > into->max_ns) into->max_ns = from->max_ns;
}

double pal_jitter_at_us(const pal_jitter *j, double fraction)
{
    if (j->n == 0) return 0;
    const double wanted = fraction * (double)j->n;
    double seen = 0;
    for (int i = 0; i < PAL_JITTER_BINS; i++) {
        seen += j->bin[i];
        if (seen < wanted || j->bin[i] == 0) continue;
        const double upper = jitter_upper_ns(i);
        return (upper < (double)j->max_ns ? upper : (double)j->max_ns) * 1e-3;
    }
    return (double)j->max_ns * 1e-3;
}
