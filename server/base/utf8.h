/* UTF-8 from untrusted bytes: one character at a time, nothing but well-formed Unicode. Thread: any. */
#ifndef PAL_BASE_UTF8_H
#define PAL_BASE_UTF8_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* bytes of the character at text[0..n_byte-1] (1..4) and its code point; 0: not well-formed (overlong, a surrogate,
 * beyond U+10FFFF, truncated) or n_byte is 0 */
static inline int pal_utf8_next(const char *text, size_t n_byte, uint32_t *code)
{
    static const uint32_t min[5] = {0, 0, 0x80, 0x800, 0x10000};
    const uint8_t *b = (const uint8_t *)text;
    if (n_byte == 0) return 0;
    int n = b[0] < 0x80 ? 1 : (b[0] & 0xe0) == 0xc0 ? 2 : (b[0] & 0xf0) == 0xe0 ? 3 : (b[0] & 0xf8) == 0xf0 ? 4 : 0;
    if (n == 0 || (size_t)n > n_byte) return 0;
    uint32_t c = n == 1 ? b[0] : b[0] & (0x7fu >> n);
    for (int k = 1; k < n; k++) {
        if ((b[k] & 0xc0) != 0x80) return 0;
        c = c << 6 | (b[k] & 0x3fu);
    }
    if (c < min[n] || c > 0x10ffff || (c >= 0xd800 && c < 0xe000)) return 0;
    *code = c;
    return n;
}

/* May this character appear in a name or title? Control characters, line and paragraph separators, direction marks and
 * overrides, and what nobody sees (of zero width, fillers, variation selectors, tags) may not. */
static inline bool pal_utf8_printable(uint32_t c)
{
    return !(c < 0x20 || (c >= 0x7f && c < 0xa0) || c == 0xad || c == 0x34f || c == 0x61c || c == 0x115f ||
             c == 0x1160 || (c >= 0x180b && c <= 0x180e) || (c >= 0x200b && c <= 0x200f) ||
             (c >= 0x2028 && c <= 0x202e) || (c >= 0x2060 && c <= 0x206f) || c == 0x3164 ||
             (c >= 0xfe00 && c <= 0xfe0f) || c == 0xfeff || c == 0xffa0 || (c >= 0xe0000 && c <= 0xe0fff));
}

/* a blank of any width */
static inline bool pal_utf8_blank(uint32_t c)
{
    return c == ' ' || c == 0xa0 || c == 0x1680 || (c >= 0x2000 && c <= 0x200a) || c == 0x202f || c == 0x205f ||
           c == 0x3000;
}

/* is all of a text well-formed and printable? */
static inline bool pal_utf8_all_printable(const char *text, size_t n_byte)
{
    uint32_t code;
    size_t at = 0;
    for (int n; at < n_byte && (n = pal_utf8_next(text + at, n_byte - at, &code)) && pal_utf8_printable(code);)
        at += (size_t)n;
    return at == n_byte;
}
#endif
