/* SHA-256 (FIPS 180-4), for the content names of assets; tested with the standard's vectors. Thread: any. */
#ifndef PAL_PROTOCOL_SHA256_H
#define PAL_PROTOCOL_SHA256_H
#include <stddef.h>
#include <stdint.h>

void pal_sha256(const void *bytes, size_t n_byte, uint8_t digest[32]);
#endif
