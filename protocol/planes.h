/* Arrays of u32 as byte planes (all low bytes, then the next ...) of folded differences: what asset and patch share.
 * Private to this room. */
#ifndef PAL_PROTOCOL_PLANES_H
#define PAL_PROTOCOL_PLANES_H
#include <stddef.h>
#include <stdint.h>

/* signed differences as small unsigned numbers: 0 -1 1 -2 ... */
static inline uint32_t pal_fold(uint32_t difference)
{
    return difference << 1 ^ (0 - (difference >> 31));
}

static inline uint32_t pal_unfold(uint32_t folded)
{
    return folded >> 1 ^ (0 - (folded & 1));
}

static inline void pal_put_plane(uint8_t *plane, size_t n, size_t i, uint32_t v)
{
    for (size_t p = 0; p < 4; p++) plane[p * n + i] = (uint8_t)(v >> (8 * p));
}

static inline uint32_t pal_get_plane(const uint8_t *plane, size_t n, size_t i)
{
    return plane[i] | (uint32_t)plane[n + i] << 8 | (uint32_t)plane[2 * n + i] << 16 | (uint32_t)plane[3 * n + i] << 24;
}
#endif
