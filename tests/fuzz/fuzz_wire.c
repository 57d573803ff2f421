/* The binary messages: every reader on any bytes; what is accepted must be written again to the same bytes. */
#include "protocol/wire.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static void same(const uint8_t *bytes, size_t n_byte, const uint8_t *again, size_t n_again)
{
    if (n_again != n_byte || memcmp(bytes, again, n_byte)) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static uint8_t again[4096];
    static pal_wire_tools tools;
    pal_wire_head head;
    pal_wire_pose pose;
    pal_wire_ack ack;
    pal_wire_haptic haptic;
    pal_wire_get_head(bytes, n_byte, &head);
    if (!pal_wire_get_pose(bytes, n_byte, &pose))
        same(bytes, n_byte, again, pal_wire_put_pose(again, sizeof again, &pose));
    if (!pal_wire_get_ack(bytes, n_byte, &ack)) same(bytes, n_byte, again, pal_wire_put_ack(again, sizeof again, &ack));
    if (!pal_wire_get_tools(bytes, n_byte, &tools))
        same(bytes, n_byte, again, pal_wire_put_tools(again, sizeof again, &tools));
    if (!pal_wire_get_haptic(bytes, n_byte, &haptic))
        same(bytes, n_byte, again, pal_wire_put_haptic(again, sizeof again, &haptic));
    return 0;
}
