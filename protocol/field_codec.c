/* One byte per vertex between the least and the largest value, one LZ4 block. */
#include "protocol/field_codec.h"

#include "protocol/bytes.h"

#include <lz4.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define STAMP_MAX ((uint64_t)1 << 53)

static const char *const name_of[PAL_WIRE_FIELD_COUNT] = {"none",   "displacement", "von_mises", "energy",  "stiffness",
                                                          "strain", "distortion",   "young",     "density", "damping"};

pal_wire_field pal_wire_field_find(const char *name)
{
    int i = 0;
    while (i < PAL_WIRE_FIELD_COUNT && strcmp(name_of[i], name)) i++;
    return (pal_wire_field)i;
}

bool pal_wire_field_get_set(const char *names, uint32_t *set)
{
    uint32_t found = 0;
    for (const char *at = names;; at++) {
        char name[PAL_WIRE_FIELD_BYTES];
        const size_t n = strcspn(at, " ");
        if (n >= sizeof name) return false;
        memcpy(name, at, n);
        name[n] = 0;
        const pal_wire_field field = pal_wire_field_find(name);
        if (field == PAL_WIRE_FIELD_COUNT) return false;
        if (field != PAL_WIRE_FIELD_NONE) found |= 1u << field;
        at += n;
        if (!*at) break;
    }
    *set = found;
    return true;
}

void pal_wire_field_put_set(uint32_t set, char names[PAL_WIRE_FIELDS_BYTES])
{
    size_t n = 0;
    snprintf(names, PAL_WIRE_FIELDS_BYTES, "%s", name_of[PAL_WIRE_FIELD_NONE]);
    for (int k = PAL_WIRE_FIELD_NONE + 1; k < PAL_WIRE_FIELD_COUNT; k++)
        if (set & 1u << k)
            n += (size_t)snprintf(names + n, PAL_WIRE_FIELDS_BYTES - n, "%s%s", n ? " " : "", name_of[k]);
}

size_t pal_field_bound(uint32_t n_vertex)
{
    return PAL_FIELD_HEAD_BYTES + (size_t)LZ4_COMPRESSBOUND(n_vertex);
}

/* the range of the values; false when one is not finite */
static bool range_of(const float *value, uint32_t n, float *low, float *high)
{
    bool finite = true;
    *low = *high = value[0];
    for (uint32_t i = 0; i < n; i++) {
        finite &= isfinite(value[i]) != 0;
        *low = value[i] < *low ? value[i] : *low;
        *high = value[i] > *high ? value[i] : *high;
    }
    return finite;
}

static bool known(uint32_t field)
{
    return field > PAL_WIRE_FIELD_NONE && field < PAL_WIRE_FIELD_COUNT;
}

int pal_field_put(const float *value, pal_field_head *head, uint8_t *work, uint8_t *dst, size_t cap, size_t *n_byte)
{
    uint32_t n = head->n_vertex;
    float low, high;
    if (n == 0 || n > PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    if (!known((uint32_t)head->field) || head->part >= PAL_WIRE_PART_MAX || head->sim_time_us >= STAMP_MAX)
        return PAL_REFUSAL_RANGE;
    if (cap < pal_field_bound(n)) return PAL_REFUSAL_SPACE;
    if (!range_of(value, n, &low, &high)) return PAL_REFUSAL_NAN;
    double wide = (double)high - (double)low, scale = wide > 0 ? 255 / wide : 0;
    for (uint32_t i = 0; i < n; i++) work[i] = (uint8_t)(((double)value[i] - (double)low) * scale + 0.5);
    int packed =
        LZ4_compress_default((const char *)work, (char *)dst + PAL_FIELD_HEAD_BYTES, (int)n,
                             (int)(cap - PAL_FIELD_HEAD_BYTES < INT32_MAX ? cap - PAL_FIELD_HEAD_BYTES : INT32_MAX));
    if (packed <= 0) return PAL_REFUSAL_SPACE;
    head->low = low;
    head->high = high;
    head->n_lz4 = (uint32_t)packed;
    pal_wire_put_head(dst, PAL_WIRE_FIELD, 0, head->part);
    pal_put_u32(dst + 8, head->epoch);
    pal_put_u32(dst + 12, (uint32_t)head->field);
    pal_put_u64(dst + 16, head->sim_time_us);
    pal_put_f32(dst + 24, low);
    pal_put_f32(dst + 28, high);
    pal_put_u32(dst + 32, n);
    pal_put_u32(dst + 36, head->n_lz4);
    *n_byte = PAL_FIELD_HEAD_BYTES + (size_t)packed;
    return 0;
}

int pal_field_get_head(const uint8_t *bytes, size_t n_byte, pal_field_head *out)
{
    pal_wire_head wire;
    int refusal = pal_wire_get_head_of(bytes, n_byte, PAL_WIRE_FIELD, 0, &wire);
    if (refusal) return refusal;
    if (n_byte < PAL_FIELD_HEAD_BYTES) return PAL_REFUSAL_SHORT;
    uint32_t field = pal_get_u32(bytes + 12);
    pal_field_head h = {.part = wire.index,
                        .field = (pal_wire_field)field,
                        .epoch = pal_get_u32(bytes + 8),
                        .sim_time_us = pal_get_u64(bytes + 16),
                        .low = pal_get_f32(bytes + 24),
                        .high = pal_get_f32(bytes + 28),
                        .n_vertex = pal_get_u32(bytes + 32),
                        .n_lz4 = pal_get_u32(bytes + 36)};
    if (!isfinite(h.low) || !isfinite(h.high)) return PAL_REFUSAL_NAN;
    if (h.part >= PAL_WIRE_PART_MAX || !known(field) || h.sim_time_us >= STAMP_MAX || !(h.low <= h.high))
        return PAL_REFUSAL_RANGE;
    if (h.n_vertex == 0 || h.n_vertex > PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    refusal = pal_wire_check_size(n_byte - PAL_FIELD_HEAD_BYTES, h.n_lz4);
    if (!refusal) *out = h;
    return refusal;
}

int pal_field_get(const uint8_t *bytes, size_t n_byte, uint32_t n_vertex, pal_field_head *head, uint8_t *level)
{
    pal_field_head h;
    int refusal = pal_field_get_head(bytes, n_byte, &h);
    if (refusal) return refusal;
    if (h.n_vertex != n_vertex) return PAL_REFUSAL_COUNT;
    int n = LZ4_decompress_safe((const char *)bytes + PAL_FIELD_HEAD_BYTES, (char *)level, (int)h.n_lz4, (int)n_vertex);
    if (n != (int)n_vertex) return PAL_REFUSAL_LZ4;
    *head = h;
    return 0;
}
