/* Little-endian numbers in byte buffers, the same on any host, and heads of binary messages. Private to this room. */
#ifndef PAL_PROTOCOL_BYTES_H
#define PAL_PROTOCOL_BYTES_H
#include "protocol/wire.h"

#include <endian.h>
#include <string.h>

static inline void pal_put_u16(uint8_t *b, uint16_t v)
{
    v = htole16(v);
    memcpy(b, &v, sizeof v);
}
static inline void pal_put_u32(uint8_t *b, uint32_t v)
{
    v = htole32(v);
    memcpy(b, &v, sizeof v);
}
static inline void pal_put_u64(uint8_t *b, uint64_t v)
{
    v = htole64(v);
    memcpy(b, &v, sizeof v);
}
static inline void pal_put_f32(uint8_t *b, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    pal_put_u32(b, bits);
}
static inline uint16_t pal_get_u16(const uint8_t *b)
{
    uint16_t v;
    memcpy(&v, b, sizeof v);
    return le16toh(v);
}
static inline uint32_t pal_get_u32(const uint8_t *b)
{
    uint32_t v;
    memcpy(&v, b, sizeof v);
    return le32toh(v);
}
static inline uint64_t pal_get_u64(const uint8_t *b)
{
    uint64_t v;
    memcpy(&v, b, sizeof v);
    return le64toh(v);
}
static inline float pal_get_f32(const uint8_t *b)
{
    uint32_t bits = pal_get_u32(b);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}
static inline double pal_get_f64(const uint8_t *b)
{
    uint64_t bits = pal_get_u64(b);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

/* writes a head; returns the place behind it */
uint8_t *pal_put_head(uint8_t *at, uint8_t kind, uint8_t flags, uint16_t index);
/* head of a message of one kind with no other flags than these */
int pal_get_head(const uint8_t *bytes, size_t n_byte, uint8_t kind, uint8_t flags, pal_wire_head *out);
/* SHORT or LONG where n_byte is not what is wanted */
int pal_check_size(size_t n_byte, size_t wanted);
#endif
