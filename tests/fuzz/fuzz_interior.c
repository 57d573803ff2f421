/* INTERIOR: any bytes; what is accepted decodes to finite numbers that are written and read again alike. */
#include "protocol/interior_codec.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

enum { MAX = 1 << 14 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t level[MAX], work[7 * MAX], packed[16 * MAX];
    static float node[4 * MAX], move[3 * MAX];
    pal_interior_head head, back;
    size_t n = 0;
    if (pal_interior_get_head(bytes, n_byte, &head) || head.n_node > MAX) return 0;
    if (pal_interior_get(bytes, n_byte, head.n_node, work, &head, move, level)) return 0;
    for (uint32_t i = 0; i < head.n_node; i++) {
        for (uint32_t c = 0; c < 3; c++) {
            node[4 * i + c] = move[3 * i + c];
            if (!isfinite(move[3 * i + c])) abort();
        }
        node[4 * i + 3] = (float)((double)head.low + ((double)head.high - (double)head.low) * level[i] / 255);
    }
    back = head;
    if (pal_interior_put(node, &back, work, packed, sizeof packed, &n)) abort();
    if (pal_interior_get(packed, n, head.n_node, work, &back, move, level)) abort();
    for (uint32_t i = 0; i < head.n_node; i++)
        for (uint32_t c = 0; c < 3; c++)
            if (!(fabs((double)move[3 * i + c] - (double)node[4 * i + c]) <= 0.51 * (double)back.q_m)) abort();
    return 0;
}
