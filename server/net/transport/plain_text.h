/* Text of any origin made fit for a control message: valid UTF-8 without control characters, cut at a character.
 * Thread: any. */
#ifndef PAL_NET_TRANSPORT_PLAIN_TEXT_H
#define PAL_NET_TRANSPORT_PLAIN_TEXT_H
#include <stddef.h>

/* at most cap - 1 bytes; every byte that is not part of valid UTF-8, and every control character, becomes one '?' or
 * blank */
void pal_plain_text(char *to, size_t cap, const char *from);
/* as the inside of a JSON string: quotes and backslashes escaped as well */
void pal_plain_json(char *to, size_t cap, const char *from);
#endif
