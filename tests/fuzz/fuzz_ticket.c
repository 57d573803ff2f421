/* Tickets: what is read is written again to a text that reads the same. */
#include "protocol/ticket.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    const pal_ticket_key key = {.id = 7};
    char text[2 * PAL_TICKET_TEXT];
    pal_ticket ticket, again;
    const size_t n = n_byte < sizeof text - 1 ? n_byte : sizeof text - 1;
    memcpy(text, bytes, n);
    text[n] = 0;
    if (!pal_ticket_get(text, &key, 1, &ticket)) return 0;
    if (!pal_ticket_put(&ticket, &key, text) || !pal_ticket_get(text, &key, 1, &again)) abort();
    return 0;
}
