/* Assets: any bytes; the checksum is mended first, so that the fuzzer gets behind it. What is accepted must serve a
 * frame encoder and decoder. */
#include "protocol/asset.h"
#include "protocol/frame_codec.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static void mend(uint8_t *bytes, size_t n_byte)
{
    uint32_t hash = 2166136261u;
    for (size_t i = 40; i < n_byte; i++) hash = (hash ^ bytes[i]) * 16777619u;
    for (int i = 0; i < 4; i++) bytes[28 + i] = (uint8_t)(hash >> (8 * i));
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_asset *asset = NULL;
    pal_frame_encoder *e = NULL;
    if (pal_asset_decode(bytes, n_byte, &asset) && n_byte > 40) {
        uint8_t *copy = malloc(n_byte);
        if (!copy) return 0;
        memcpy(copy, bytes, n_byte);
        mend(copy, n_byte);
        asset = NULL;
        pal_asset_decode(copy, n_byte, &asset);
        free(copy);
    }
    if (asset && !pal_frame_encoder_create(asset->rest_m, asset->order, &e)) {
        const pal_frame_input given = {.error_m = 1e-4, .position_m = asset->rest_m};
        size_t cap = pal_frame_bound(asset->order->n_vertex);
        pal_frame_result result;
        uint8_t *frame = malloc(cap);
        if (frame) pal_frame_put(e, &given, frame, cap, &result);
        free(frame);
        pal_frame_encoder_destroy(e);
    }
    pal_asset_destroy(asset);
    return 0;
}
