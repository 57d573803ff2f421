/* Bytes of an event device, in whole and in pieces: the same axes and buttons, and a deflection of at most 1. */
#include "clients/haptic_bridge/device_input.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_input_axes whole, pieces;
    memset(&whole, 0, sizeof whole);
    for (int i = 0; i < 6; i++) whole.low[i] = i == 5 ? 7 : -500, whole.high[i] = i == 5 ? 7 : 500;
    pieces = whole;
    const size_t step = n_byte > 0 ? 1 + bytes[0] % 31 : 1;
    pal_input_feed(&whole, bytes, n_byte);
    for (size_t i = 0; i < n_byte; i += step) pal_input_feed(&pieces, bytes + i, n_byte - i < step ? n_byte - i : step);
    if (memcmp(whole.value, pieces.value, sizeof whole.value) || whole.buttons != pieces.buttons) abort();
    for (int i = 0; i < 6; i++) {
        const double d = pal_input_deflection(&whole, i);
        if (!(d >= -1 && d <= 1)) abort();
    }
    return 0;
}
