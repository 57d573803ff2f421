/* Per axis two byte planes of folded differences from node to node, then a byte plane of values; one LZ4 block. */
#include "protocol/interior_codec.h"

#include "protocol/bytes.h"

#include <lz4.h>
#include <math.h>
#include <stdbool.h>

#define STAMP_MAX ((uint64_t)1 << 53)

/* signed differences mod 2^16 as small unsigned numbers: 0 -1 1 -2 ... */
static uint32_t fold16(uint32_t difference)
{
    return (difference << 1 ^ (0 - (difference >> 15 & 1))) & 0xFFFF;
}

static uint32_t unfold16(uint32_t folded)
{
    return (folded >> 1 ^ (0 - (folded & 1))) & 0xFFFF;
}

size_t pal_interior_bound(uint32_t n_node)
{
    return PAL_INTERIOR_HEAD_BYTES + (size_t)LZ4_COMPRESSBOUND(PAL_INTERIOR_NODE_BYTES * n_node);
}

/* range of values and largest displacement; false when a number is not finite */
static bool range_of(const float *node, uint32_t n, pal_interior_head *head, float *largest)
{
    bool finite = true;
    head->low = head->high = node[3];
    *largest = 0;
    for (uint32_t i = 0; i < n; i++, node += 4) {
        for (int c = 0; c < 4; c++) finite &= isfinite(node[c]) != 0;
        for (int c = 0; c < 3; c++) *largest = fmaxf(*largest, fabsf(node[c]));
        head->low = node[3] < head->low ? node[3] : head->low;
        head->high = node[3] > head->high ? node[3] : head->high;
    }
    return finite;
}

static void put_planes(const float *node, const pal_interior_head *head, uint8_t *to)
{
    const size_t n = head->n_node;
    for (size_t c = 0; c < 3; c++, to += 2 * n) {
        uint32_t before = 0;
        for (size_t i = 0; i < n; i++) {
            double steps = rint((double)node[4 * i + c] / (double)head->q_m);
            /* rounding of q_m may leave the largest half a step above */
            steps = fmin(fmax(steps, -PAL_INTERIOR_DISPLACEMENT), PAL_INTERIOR_DISPLACEMENT);
            const uint32_t now = (uint32_t)(int32_t)steps, folded = fold16(now - before);
            to[i] = (uint8_t)folded, to[n + i] = (uint8_t)(folded >> 8);
            before = now;
        }
    }
    const double wide = (double)head->high - (double)head->low, scale = wide > 0 ? 255 / wide : 0;
    for (size_t i = 0; i < n; i++) to[i] = (uint8_t)(((double)node[4 * i + 3] - (double)head->low) * scale + 0.5);
}

static bool known(uint32_t field)
{
    return field > PAL_WIRE_FIELD_NONE && field < PAL_WIRE_FIELD_COUNT;
}

int pal_interior_put(const float *node, pal_interior_head *head, uint8_t *work, uint8_t *dst, size_t cap,
                     size_t *n_byte)
{
    const uint32_t n = head->n_node;
    float largest;
    if (n == 0 || n > PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    if (!known((uint32_t)head->field) || head->part >= PAL_WIRE_PART_MAX || head->sim_time_us >= STAMP_MAX ||
        !(head->q_m > 0) || !isfinite(head->q_m))
        return PAL_REFUSAL_RANGE;
    if (cap < pal_interior_bound(n)) return PAL_REFUSAL_SPACE;
    if (!range_of(node, n, head, &largest)) return PAL_REFUSAL_NAN;
    head->q_m = fmaxf(head->q_m, largest / PAL_INTERIOR_DISPLACEMENT);
    put_planes(node, head, work);
    const int packed =
        LZ4_compress_default((const char *)work, (char *)dst + PAL_INTERIOR_HEAD_BYTES,
                             (int)(PAL_INTERIOR_NODE_BYTES * n), LZ4_COMPRESSBOUND((int)(PAL_INTERIOR_NODE_BYTES * n)));
    if (packed <= 0) return PAL_REFUSAL_SPACE;
    head->n_lz4 = (uint32_t)packed;
    pal_wire_put_head(dst, PAL_WIRE_INTERIOR, 0, head->part);
    pal_put_u32(dst + 8, head->epoch);
    pal_put_u32(dst + 12, (uint32_t)head->field);
    pal_put_u64(dst + 16, head->sim_time_us);
    pal_put_f32(dst + 24, head->low);
    pal_put_f32(dst + 28, head->high);
    pal_put_f32(dst + 32, head->q_m);
    pal_put_u32(dst + 36, n);
    pal_put_u32(dst + 40, head->n_lz4);
    *n_byte = PAL_INTERIOR_HEAD_BYTES + (size_t)packed;
    return 0;
}

int pal_interior_get_head(const uint8_t *bytes, size_t n_byte, pal_interior_head *out)
{
    pal_wire_head wire;
    int refusal = pal_wire_get_head_of(bytes, n_byte, PAL_WIRE_INTERIOR, 0, &wire);
    if (refusal) return refusal;
    if (n_byte < PAL_INTERIOR_HEAD_BYTES) return PAL_REFUSAL_SHORT;
    const uint32_t field = pal_get_u32(bytes + 12);
    pal_interior_head h = {.part = wire.index,
                           .field = (pal_wire_field)field,
                           .epoch = pal_get_u32(bytes + 8),
                           .sim_time_us = pal_get_u64(bytes + 16),
                           .low = pal_get_f32(bytes + 24),
                           .high = pal_get_f32(bytes + 28),
                           .q_m = pal_get_f32(bytes + 32),
                           .n_node = pal_get_u32(bytes + 36),
                           .n_lz4 = pal_get_u32(bytes + 40)};
    if (!isfinite(h.low) || !isfinite(h.high) || !isfinite(h.q_m)) return PAL_REFUSAL_NAN;
    /* 1e30 m: steps of it stay finite floats */
    if (h.part >= PAL_WIRE_PART_MAX || !known(field) || h.sim_time_us >= STAMP_MAX || !(h.low <= h.high) ||
        !(h.q_m > 0) || h.q_m > 1e30f)
        return PAL_REFUSAL_RANGE;
    if (h.n_node == 0 || h.n_node > PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    refusal = pal_wire_check_size(n_byte - PAL_INTERIOR_HEAD_BYTES, h.n_lz4);
    if (!refusal) *out = h;
    return refusal;
}

int pal_interior_get(const uint8_t *bytes, size_t n_byte, uint32_t n_node, uint8_t *work, pal_interior_head *head,
                     float *move_m, uint8_t *level)
{
    pal_interior_head h;
    int refusal = pal_interior_get_head(bytes, n_byte, &h);
    if (refusal) return refusal;
    if (h.n_node != n_node) return PAL_REFUSAL_COUNT;
    const size_t n = n_node;
    const int n_raw = (int)(PAL_INTERIOR_NODE_BYTES * n);
    if (LZ4_decompress_safe((const char *)bytes + PAL_INTERIOR_HEAD_BYTES, (char *)work, (int)h.n_lz4, n_raw) != n_raw)
        return PAL_REFUSAL_LZ4;
    for (size_t c = 0; c < 3; c++) {
        const uint8_t *from = work + 2 * n * c;
        uint32_t now = 0;
        for (size_t i = 0; i < n; i++) {
            now = (now + unfold16(from[i] | (uint32_t)from[n + i] << 8)) & 0xFFFF;
            move_m[3 * i + c] = (float)((double)h.q_m * (int16_t)now);
        }
    }
    for (size_t i = 0; i < n; i++) level[i] = work[6 * n + i];
    *head = h;
    return 0;
}
