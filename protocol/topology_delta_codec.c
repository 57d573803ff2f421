/* Planes of folded differences in one LZ4 block: slots first, then their corners. */
#include "protocol/topology_delta_codec.h"

#include "protocol/bytes.h"
#include "protocol/planes.h"

#include <lz4.h>

#define REVISION_MAX ((uint64_t)1 << 53)

size_t pal_topology_delta_bound(uint32_t n_changed)
{
    if (n_changed > PAL_TRIANGLE_SLOT_MAX) return 0;
    return PAL_TOPOLOGY_DELTA_HEAD_BYTES + (size_t)LZ4_COMPRESSBOUND(PAL_TOPOLOGY_DELTA_WORK_BYTES(n_changed));
}

/* slots and corners as planes; RANGE when a number is none */
static int write_planes(const uint32_t *slot, const uint32_t *table, uint32_t n_changed, uint8_t *work)
{
    size_t n = n_changed, n_corner = 3 * n;
    uint8_t *corners = work + 4 * n;
    uint32_t before[3] = {0, 0, 0};
    for (size_t i = 0; i < n; i++) {
        uint32_t last = i ? slot[i - 1] : 0;
        if (slot[i] >= PAL_TRIANGLE_SLOT_MAX || (i && slot[i] <= last)) return PAL_REFUSAL_RANGE;
        pal_put_plane(work, n, i, pal_fold(slot[i] - last));
        for (size_t c = 0; c < 3; c++) {
            uint32_t corner = table[3 * (size_t)slot[i] + c];
            if (corner >= PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_RANGE;
            pal_put_plane(corners, n_corner, 3 * i + c, pal_fold(corner - before[c]));
            before[c] = corner;
        }
    }
    return 0;
}

int pal_topology_delta_put(const uint32_t *slot, const uint32_t *table, pal_topology_delta_head *head, uint8_t *work,
                           uint8_t *dst, size_t cap, size_t *n_byte)
{
    uint32_t n = head->n_changed;
    if (n == 0 || n > PAL_TRIANGLE_SLOT_MAX) return PAL_REFUSAL_COUNT;
    if (head->part >= PAL_WIRE_PART_MAX || head->revision >= REVISION_MAX) return PAL_REFUSAL_RANGE;
    if (cap < pal_topology_delta_bound(n)) return PAL_REFUSAL_SPACE;
    int refusal = write_planes(slot, table, n, work);
    if (refusal) return refusal;
    int packed = LZ4_compress_default((const char *)work, (char *)dst + PAL_TOPOLOGY_DELTA_HEAD_BYTES,
                                      (int)PAL_TOPOLOGY_DELTA_WORK_BYTES(n),
                                      (int)(pal_topology_delta_bound(n) - PAL_TOPOLOGY_DELTA_HEAD_BYTES));
    if (packed <= 0) return PAL_REFUSAL_SPACE;
    head->n_lz4 = (uint32_t)packed;
    pal_wire_put_head(dst, PAL_WIRE_TOPOLOGY_DELTA, 0, head->part);
    pal_put_u32(dst + 8, head->epoch);
    pal_put_u32(dst + 12, n);
    pal_put_u64(dst + 16, head->revision);
    pal_put_u32(dst + 24, (uint32_t)PAL_TOPOLOGY_DELTA_WORK_BYTES(n));
    pal_put_u32(dst + 28, head->n_lz4);
    *n_byte = PAL_TOPOLOGY_DELTA_HEAD_BYTES + (size_t)packed;
    return 0;
}

int pal_topology_delta_get_head(const uint8_t *bytes, size_t n_byte, pal_topology_delta_head *out)
{
    pal_wire_head wire;
    int refusal = pal_wire_get_head_of(bytes, n_byte, PAL_WIRE_TOPOLOGY_DELTA, 0, &wire);
    if (refusal) return refusal;
    if (n_byte < PAL_TOPOLOGY_DELTA_HEAD_BYTES) return PAL_REFUSAL_SHORT;
    pal_topology_delta_head h = {.part = wire.index,
                                 .epoch = pal_get_u32(bytes + 8),
                                 .n_changed = pal_get_u32(bytes + 12),
                                 .revision = pal_get_u64(bytes + 16),
                                 .n_lz4 = pal_get_u32(bytes + 28)};
    if (h.part >= PAL_WIRE_PART_MAX || h.revision >= REVISION_MAX) return PAL_REFUSAL_RANGE;
    if (h.n_changed == 0 || h.n_changed > PAL_TRIANGLE_SLOT_MAX) return PAL_REFUSAL_COUNT;
    if (pal_get_u32(bytes + 24) != PAL_TOPOLOGY_DELTA_WORK_BYTES(h.n_changed)) return PAL_REFUSAL_COUNT;
    refusal = pal_wire_check_size(n_byte - PAL_TOPOLOGY_DELTA_HEAD_BYTES, h.n_lz4);
    if (refusal) return refusal;
    /* one byte of LZ4 gives at most 255 bytes */
    if (PAL_TOPOLOGY_DELTA_WORK_BYTES(h.n_changed) / 255 > h.n_lz4) return PAL_REFUSAL_COUNT;
    *out = h;
    return 0;
}

/* walks the planes; table NULL: only checks */
static int read_planes(const uint8_t *work, uint32_t n_changed, uint32_t n_slot, uint32_t n_vertex, uint32_t *table)
{
    size_t n = n_changed, n_corner = 3 * n;
    const uint8_t *corners = work + 4 * n;
    uint32_t slot = 0, corner[3] = {0, 0, 0};
    for (size_t i = 0; i < n; i++) {
        uint32_t next = slot + pal_unfold(pal_get_plane(work, n, i));
        if (next >= n_slot || (i && next <= slot)) return PAL_REFUSAL_RANGE;
        slot = next;
        for (size_t c = 0; c < 3; c++) {
            corner[c] += pal_unfold(pal_get_plane(corners, n_corner, 3 * i + c));
            if (corner[c] >= n_vertex) return PAL_REFUSAL_RANGE;
        }
        if (table) memcpy(table + 3 * (size_t)slot, corner, sizeof corner);
    }
    return 0;
}

int pal_topology_delta_get(const uint8_t *bytes, size_t n_byte, uint32_t n_slot, uint32_t n_vertex, uint8_t *work,
                           pal_topology_delta_head *head, uint32_t *table)
{
    pal_topology_delta_head h;
    int refusal = pal_topology_delta_get_head(bytes, n_byte, &h);
    if (refusal) return refusal;
    if (h.n_changed > n_slot) return PAL_REFUSAL_COUNT;
    int n_raw = (int)PAL_TOPOLOGY_DELTA_WORK_BYTES(h.n_changed);
    if (LZ4_decompress_safe((const char *)bytes + PAL_TOPOLOGY_DELTA_HEAD_BYTES, (char *)work, (int)h.n_lz4, n_raw) !=
        n_raw)
        return PAL_REFUSAL_LZ4;
    refusal = read_planes(work, h.n_changed, n_slot, n_vertex, NULL);
    if (refusal) return refusal;
    read_planes(work, h.n_changed, n_slot, n_vertex, table);
    *head = h;
    return 0;
}
