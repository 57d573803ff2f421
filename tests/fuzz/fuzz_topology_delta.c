/* PATCH messages to a small table. A first byte below 128: the rest is a whole message. Otherwise the rest are planes,
 * which are packed and framed here, so that the fuzzer need not invent LZ4 blocks. What is taken leaves a table of
 * valid corners, and written again from that table it means the same. */
#include "protocol/topology_delta_codec.h"

#include <lz4.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

enum { SLOTS = 108, VERTICES = 56, CAP = 8192 };

static void one(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)], packed[CAP];
    uint32_t table[SLOTS][3], again[SLOTS][3], slot[SLOTS], n = 0;
    pal_topology_delta_head head, back;
    size_t n_packed = 0;
    memset(table, 0xFF, sizeof table);
    memset(again, 0xFF, sizeof again);
    int refusal = pal_topology_delta_get(bytes, n_byte, SLOTS, VERTICES, work, &head, table[0]);
    for (uint32_t p = 0; p < SLOTS; p++) {
        if (!memcmp(table[p], again[p], sizeof table[p])) continue;
        for (int c = 0; c < 3; c++)
            if (table[p][c] >= VERTICES) abort();
        slot[n++] = p;
    }
    if (n != (refusal ? 0 : head.n_changed)) abort();
    if (refusal) return;
    if (pal_topology_delta_put(slot, table[0], &head, work, packed, sizeof packed, &n_packed)) abort();
    if (pal_topology_delta_get(packed, n_packed, SLOTS, VERTICES, work, &back, again[0])) abort();
    if (memcmp(table, again, sizeof table) || back.revision != head.revision) abort();
}

static void planes(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t message[CAP];
    static const uint8_t head[PAL_TOPOLOGY_DELTA_HEAD_BYTES] = {'P', 'A', 'L', '1', PAL_WIRE_TOPOLOGY_DELTA};
    int n_lz4 = n_byte > 4000 ? 0
                              : LZ4_compress_default((const char *)bytes, (char *)message + sizeof head, (int)n_byte,
                                                     (int)(sizeof message - sizeof head));
    memcpy(message, head, sizeof head);
    for (int i = 0; i < 4; i++) {
        message[12 + i] = (uint8_t)(n_byte / 16 >> (8 * i));
        message[24 + i] = (uint8_t)(n_byte >> (8 * i));
        message[28 + i] = (uint8_t)((size_t)n_lz4 >> (8 * i));
    }
    one(message, sizeof head + (size_t)n_lz4);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    if (n_byte == 0) return 0;
    if (bytes[0] < 128)
        one(bytes + 1, n_byte - 1);
    else
        planes(bytes + 1, n_byte - 1);
    return 0;
}
