/* Sanitises text from any source for a control message: valid UTF-8 without control characters, truncated at a
 * character. Thread: any. */
#ifndef PAL_NET_TRANSPORT_PLAIN_TEXT_H
#define PAL_NET_TRANSPORT_PLAIN_TEXT_H
#include <stddef.h>

/* writes at most cap - 1 bytes; each byte outside valid UTF-8 and each control character becomes one '?' or blank */
void pal_plain_text(char *to, size_t cap, const char *from);
#endif
