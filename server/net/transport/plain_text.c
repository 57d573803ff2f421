/* One walk over the characters. */
#include "server/net/transport/plain_text.h"

#include "server/base/utf8.h"

#include <string.h>

void pal_plain_text(char *to, size_t cap, const char *from)
{
    size_t at = 0, n_byte = strlen(from);
    while (n_byte > 0) {
        uint32_t code = 0;
        int n = pal_utf8_next(from, n_byte, &code);
        bool control = n > 0 && (code < 0x20 || (code >= 0x7F && code < 0xA0));
        size_t need = n > 0 && !control ? (size_t)n : 1;
        if (at + need >= cap) break;
        memcpy(to + at, control ? " " : n ? from : "?", need);
        at += need;
        from += n ? n : 1, n_byte -= n ? (size_t)n : 1;
    }
    to[at] = 0;
}
