/* One walk over the bytes; the ranges are those of RFC 3629. */
#include "server/net/transport/plain_text.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* length of the valid character at s, 0: not valid */
static size_t character(const unsigned char *s)
{
    if (s[0] < 0x80) return 1;
    size_t n = s[0] >= 0xC2 && s[0] < 0xE0 ? 2 : (s[0] & 0xF0) == 0xE0 ? 3 : s[0] >= 0xF0 && s[0] < 0xF5 ? 4 : 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xC0) != 0x80) return 0;
    /* overlong forms, surrogates, beyond U+10FFFF */
    if (n == 3 && ((s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xED && s[1] > 0x9F))) return 0;
    if (n == 4 && ((s[0] == 0xF0 && s[1] < 0x90) || (s[0] == 0xF4 && s[1] > 0x8F))) return 0;
    return n;
}

static void copy(char *to, size_t cap, const char *from, bool json)
{
    const unsigned char *s = (const unsigned char *)from;
    size_t at = 0;
    while (*s) {
        size_t n = character(s), need = n ? n : 1;
        bool control = *s < 0x20 || *s == 0x7F || (*s == 0xC2 && n == 2 && s[1] < 0xA0);
        bool escaped = json && (*s == '"' || *s == '\\');
        if (control) need = 1;
        if (at + need + escaped >= cap) break;
        if (escaped) to[at++] = '\\';
        if (control)
            to[at] = ' ';
        else if (n)
            memcpy(to + at, s, n);
        else
            to[at] = '?';
        at += need;
        s += n ? n : 1;
    }
    to[at] = 0;
}

void pal_plain_text(char *to, size_t cap, const char *from)
{
    copy(to, cap, from, false);
}

void pal_plain_json(char *to, size_t cap, const char *from)
{
    copy(to, cap, from, true);
}
