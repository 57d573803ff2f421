/* FIELD: any bytes; what is accepted decodes to values that are written and read again to the same levels. */
#include "protocol/field_codec.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

enum { MAX = 1 << 16 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t level[MAX], again[MAX], work[MAX], packed[2 * MAX];
    static float value[MAX];
    pal_field_head head, back;
    size_t n = 0;
    if (pal_field_get_head(bytes, n_byte, &head) || head.n_vertex > MAX) return 0;
    if (pal_field_get(bytes, n_byte, head.n_vertex, &head, level)) return 0;
    uint8_t min = 255, max = 0;
    for (uint32_t i = 0; i < head.n_vertex; i++) {
        value[i] = (float)pal_field_value(&head, level[i]);
        min = level[i] < min ? level[i] : min;
        max = level[i] > max ? level[i] : max;
    }
    back = head;
    if (pal_field_put(value, &back, work, packed, sizeof packed, &n)) abort();
    if (pal_field_get(packed, n, head.n_vertex, &back, again)) abort();
    /* a message that uses both ends of its range, in numbers wide enough for a float, means the same levels */
    double wide = (double)head.high - (double)head.low, size = (double)(head.high > -head.low ? head.high : -head.low);
    if (min != 0 || max != 255 || wide < 1e-3 * size || wide < 1e-30) return 0;
    if (memcmp(level, again, head.n_vertex)) abort();
    return 0;
}
