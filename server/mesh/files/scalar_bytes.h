/* Numbers of any size and byte order from a file's bytes. Only for the readers of this room. Thread: any. */
#ifndef PAL_MESH_FILES_SCALAR_BYTES_H
#define PAL_MESH_FILES_SCALAR_BYTES_H
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* unsigned and signed alternate from the smallest up, floating ones come last */
typedef enum pal_scalar {
    PAL_SCALAR_U8,
    PAL_SCALAR_I8,
    PAL_SCALAR_U16,
    PAL_SCALAR_I16,
    PAL_SCALAR_U32,
    PAL_SCALAR_I32,
    PAL_SCALAR_U64,
    PAL_SCALAR_I64,
    PAL_SCALAR_F32,
    PAL_SCALAR_F64,
    PAL_SCALAR_COUNT
} pal_scalar;

static inline int pal_scalar_size(pal_scalar type)
{
    static const uint8_t size[PAL_SCALAR_COUNT] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return size[type];
}

/* whole number of n bytes, n <= 8; big: most significant byte first */
static inline uint64_t pal_word_at(const uint8_t *p, int n, bool big)
{
    uint64_t word = 0;
    for (int k = 0; k < n; k++) word |= (uint64_t)p[big ? n - 1 - k : k] << 8 * k;
    return word;
}

static inline double pal_float_at(const uint8_t *p, bool big)
{
    uint32_t word = (uint32_t)pal_word_at(p, 4, big);
    float f;
    memcpy(&f, &word, sizeof f);
    return (double)f;
}

/* 64-bit whole numbers beyond 2^53 are rounded */
static inline double pal_scalar_at(const uint8_t *p, pal_scalar type, bool big)
{
    int n = pal_scalar_size(type), unused = 64 - 8 * n;
    uint64_t word = pal_word_at(p, n, big);
    double d;
    memcpy(&d, &word, sizeof d);
    if (type >= PAL_SCALAR_F32) return type == PAL_SCALAR_F32 ? pal_float_at(p, big) : d;
    /* odd types are signed: the sign bit is moved to the top and back */
    return type & 1 ? (double)((int64_t)(word << unused) >> unused) : (double)word;
}
#endif
