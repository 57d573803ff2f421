/* Random numbers that are the same on every machine, drawn by a counter, so that work may be done out of order and each
 * piece still has its own numbers. Thread: any. */
#ifndef PAL_NUM_RANDOM_H
#define PAL_NUM_RANDOM_H
#include <stdint.h>

/* 64 mixed bits of (seed, counter): the finaliser of SplitMix64 (Steele, Lea, Flood 2014) */
static inline uint64_t pal_random_bits(uint64_t seed, uint64_t counter)
{
    uint64_t z = seed + 0x9e3779b97f4a7c15u * (counter + 1);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/* uniform in (0, 1), 53 bits, neither end */
static inline double pal_random_unit(uint64_t seed, uint64_t counter)
{
    return ((double)(pal_random_bits(seed, counter) >> 11) + 0.5) * 0x1p-53;
}
#endif
