/* FRAME messages and bodies for a small fixed mesh. A first byte below 128: the rest is a whole message. Otherwise the
 * rest is a body, which is packed and framed here, so that the fuzzer need not invent LZ4 blocks. */
#include "protocol/frame_codec.h"

#include <lz4.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

enum { SIDE = 9, VERTICES = SIDE * SIDE, TRIANGLES = 2 * (SIDE - 1) * (SIDE - 1) };
static float rest[3 * VERTICES], shown[3 * VERTICES];
static pal_frame_decoder *decoder;

static void setup(void)
{
    uint32_t triangle[3 * TRIANGLES], n = 0;
    pal_frame_order *order = NULL;
    for (uint32_t i = 0; i < VERTICES; i++) {
        rest[3 * i] = 0.01f * (float)(i % SIDE);
        rest[3 * i + 1] = 0.01f * (float)(i / SIDE);
        rest[3 * i + 2] = 0.002f * (float)(i * i % 7);
    }
    for (uint32_t y = 0; y + 1 < SIDE; y++)
        for (uint32_t x = 0; x + 1 < SIDE; x++) {
            uint32_t a = y * SIDE + x;
            const uint32_t two[6] = {a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE};
            memcpy(triangle + n, two, sizeof two);
            n += 6;
        }
    if (pal_frame_order_create(rest, VERTICES, triangle, TRIANGLES, &order)) abort();
    const pal_asset asset = {TRIANGLES, rest, NULL, NULL, triangle, order};
    if (pal_frame_decoder_create(&asset, &decoder)) abort();
    pal_frame_order_destroy(order);
}

static void body(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t message[8192];
    static const uint8_t head[40] = {'P', 'A', 'L', '1', 1, [30] = 0x80, [31] = 0x38, [32] = VERTICES};
    int n_lz4 = n_byte > 4000 ? 0
                              : LZ4_compress_default((const char *)bytes, (char *)message + PAL_FRAME_HEAD_BYTES,
                                                     (int)n_byte, (int)sizeof message - PAL_FRAME_HEAD_BYTES);
    memcpy(message, head, sizeof head);
    for (int i = 0; i < 4; i++) message[36 + i] = (uint8_t)(n_byte >> (8 * i));
    for (int i = 0; i < 4; i++) message[40 + i] = (uint8_t)((size_t)n_lz4 >> (8 * i));
    pal_frame_head out;
    pal_frame_get(decoder, message, PAL_FRAME_HEAD_BYTES + (size_t)n_lz4, &out, shown);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_frame_head head;
    if (!decoder) setup();
    if (n_byte == 0) return 0;
    if (bytes[0] < 128)
        pal_frame_get(decoder, bytes + 1, n_byte - 1, &head, shown);
    else
        body(bytes + 1, n_byte - 1);
    return 0;
}
