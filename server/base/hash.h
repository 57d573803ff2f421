/* FNV-1a, 64 bits (Fowler, Noll, Vo): identifies files and states; not cryptographic. Thread: any. */
#ifndef PAL_BASE_HASH_H
#define PAL_BASE_HASH_H
#include <stddef.h>
#include <stdint.h>

#define PAL_HASH_START 0xcbf29ce484222325u /* the hash of no bytes (FNV offset basis) */

/* hash of more bytes, continued from `hash` */
static inline uint64_t pal_hash_bytes(uint64_t hash, const void *bytes, size_t n_byte)
{
    const unsigned char *at = bytes;
    for (size_t i = 0; i < n_byte; i++) hash = (hash ^ at[i]) * 0x100000001b3u;
    return hash;
}
#endif
