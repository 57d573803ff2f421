/* Control messages of both directions; what is accepted must be written and read again to the same text. */
#include "protocol/control.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static void one(const char *text, size_t n_byte, bool from_server)
{
    static pal_control c, d;
    static char first[PAL_CONTROL_OUT_MAX + 1], second[PAL_CONTROL_OUT_MAX + 1];
    size_t n_first, n_second;
    if (pal_control_get(text, n_byte, from_server, &c)) return;
    /* escapes may make the text longer than its limit, nothing else may be refused */
    int refusal = pal_control_put(first, sizeof first, &c, &n_first);
    if (refusal == PAL_REFUSAL_SPACE) return;
    if (refusal || pal_control_get(first, n_first, from_server, &d)) abort();
    if (pal_control_put(second, sizeof second, &d, &n_second) || n_first != n_second || memcmp(first, second, n_first))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    one((const char *)bytes, n_byte, false);
    one((const char *)bytes, n_byte, true);
    return 0;
}
