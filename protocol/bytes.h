/* Little-endian numbers in byte buffers, the same on any host. Private to this room. */
#ifndef PAL_PROTOCOL_BYTES_H
#define PAL_PROTOCOL_BYTES_H
#include <endian.h>
#include <stdint.h>
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
#endif
