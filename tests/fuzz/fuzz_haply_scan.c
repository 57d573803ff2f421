/* A state message of Haply's service: no byte is read twice or beyond the end, and what is a number of JSON is one. */
#include "clients/haptic_bridge/device_haply_scan.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_haply_state one, two;
    memset(&one, 0, sizeof one);
    memset(&two, 0, sizeof two);
    const bool good = pal_haply_scan((const char *)bytes, n_byte, 0, &one);
    if (good != pal_haply_scan((const char *)bytes, n_byte, 1, &two))
        abort(); /* the index chooses, and refuses nothing */
    if (memchr(one.device, 0, sizeof one.device) == NULL) abort();
    if (good && n_byte == 0) abort();
    return 0;
}
