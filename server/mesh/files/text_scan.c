/* Words and numbers of text files.
 *
 * A decimal number of at most 2^53 times a power of ten of at most 10^22 is one exact product or quotient of doubles
 * (Clinger 1990); everything else goes to strtod in the C locale. */
#include "server/mesh/files/text_scan.h"

#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { LONGEST_NUMBER = 1000 };

static bool is_line_end(uint8_t c)
{
    return c == '\n' || c == '\r';
}

static bool is_blank(uint8_t c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

static void take_line_end(pal_text_scan *scan)
{
    bool two = scan->end - scan->at > 1 && scan->at[0] == '\r' && scan->at[1] == '\n';
    scan->at += two ? 2 : 1;
    scan->line++;
}

bool pal_text_more(pal_text_scan *scan)
{
    for (;;) {
        while (scan->at < scan->end && is_blank(*scan->at)) scan->at++;
        if (scan->at == scan->end || is_line_end(*scan->at)) return false;
        if (scan->hash && *scan->at == '#') return false;
        bool join = scan->joins && *scan->at == '\\' && scan->end - scan->at > 1 && is_line_end(scan->at[1]);
        if (!join) return true;
        scan->at++;
        take_line_end(scan);
    }
}

bool pal_text_next_line(pal_text_scan *scan)
{
    bool join = true;
    while (join) {
        const uint8_t *first = scan->at;
        while (scan->at < scan->end && !is_line_end(*scan->at)) scan->at++;
        if (scan->at == scan->end) return false;
        join = scan->joins && scan->at > first && scan->at[-1] == '\\';
        take_line_end(scan);
    }
    return scan->at < scan->end;
}

bool pal_text_seek(pal_text_scan *scan)
{
    while (!pal_text_more(scan))
        if (!pal_text_next_line(scan)) return false;
    return true;
}

static const uint8_t *word_end(const pal_text_scan *scan)
{
    const uint8_t *p = scan->at;
    while (p < scan->end && !is_blank(*p) && !is_line_end(*p)) p++;
    bool join = scan->joins && p < scan->end && is_line_end(*p) && p - scan->at > 1 && p[-1] == '\\';
    return p - join;
}

size_t pal_text_word(pal_text_scan *scan)
{
    if (!pal_text_more(scan)) return 0;
    const uint8_t *first = scan->at;
    scan->at = word_end(scan);
    return (size_t)(scan->at - first);
}

bool pal_text_is(pal_text_scan *scan, const char *word)
{
    if (!pal_text_more(scan)) return false;
    size_t n = strlen(word);
    const uint8_t *end = word_end(scan);
    if ((size_t)(end - scan->at) != n || strncasecmp((const char *)scan->at, word, n)) return false;
    scan->at = end;
    return true;
}

/* sign, digits, point, digits, exponent: the value is mantissa times 10^power unless the mantissa reached 10^18 */
typedef struct decimal {
    bool negative;
    uint64_t mantissa;
    int64_t power;
} decimal;

/* reads a decimal from p up to end exactly; false when the bytes are no decimal number */
static bool read_decimal(const uint8_t *p, const uint8_t *end, decimal *out)
{
    decimal d = {0};
    int n_digit = 0;
    bool point = false;
    if (p < end && (*p == '-' || *p == '+')) d.negative = *p++ == '-';
    for (; p < end; p++) {
        if (*p == '.' && !point) {
            point = true;
            continue;
        }
        if (*p < '0' || *p > '9') break;
        n_digit++;
        if (d.mantissa < 1000000000000000000u) {
            d.mantissa = 10 * d.mantissa + (uint64_t)(*p - '0');
            d.power -= point;
        }
    }
    if (n_digit == 0) return false;
    if (p < end && (*p == 'e' || *p == 'E')) {
        int64_t power = 0, sign = 1;
        if (++p < end && (*p == '-' || *p == '+')) sign = *p++ == '-' ? -1 : 1;
        if (p == end) return false;
        for (; p < end && *p >= '0' && *p <= '9'; p++)
            if (power < 100000) power = 10 * power + (*p - '0');
        d.power += sign * power;
    }
    *out = d;
    return p == end;
}

static bool read_special(const uint8_t *p, const uint8_t *end, double *out)
{
    double sign = 1;
    if (p < end && (*p == '-' || *p == '+')) sign = *p++ == '-' ? -1 : 1;
    size_t n = (size_t)(end - p);
    const char *word = (const char *)p;
    bool inf = (n == 3 && !strncasecmp(word, "inf", 3)) || (n == 8 && !strncasecmp(word, "infinity", 8));
    bool nan = n >= 3 && n <= 9 && !strncasecmp(word, "nan", 3);
    if (inf) *out = sign * (double)INFINITY;
    if (nan) *out = (double)NAN;
    return inf || nan;
}

/* the word as a number by the C library; it is known to be a decimal */
static double slow_decimal(const uint8_t *p, size_t n)
{
    char text[LONGEST_NUMBER + 1];
    memcpy(text, p, n);
    text[n] = 0;
    locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (!plain) return (double)NAN;
    double value = strtod_l(text, NULL, plain);
    freelocale(plain);
    return value;
}

bool pal_text_double(pal_text_scan *scan, double *out)
{
    static const double ten[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                   1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    if (!pal_text_more(scan)) return false;
    const uint8_t *end = word_end(scan);
    decimal d;
    if (end - scan->at > LONGEST_NUMBER) return false;
    if (!read_decimal(scan->at, end, &d)) {
        if (!read_special(scan->at, end, out)) return false;
    } else if (d.mantissa <= (uint64_t)1 << 53 && d.power >= -22 && d.power <= 22) {
        double m = (double)d.mantissa, value = d.power < 0 ? m / ten[-d.power] : m * ten[d.power];
        *out = d.negative ? -value : value;
    } else {
        *out = slow_decimal(scan->at, (size_t)(end - scan->at));
    }
    scan->at = end;
    return true;
}

bool pal_text_int(pal_text_scan *scan, int64_t *out)
{
    if (!pal_text_more(scan)) return false;
    const uint8_t *first = scan->at, *p = first, *end = word_end(scan);
    int64_t value = 0;
    p += *p == '-' || *p == '+';
    if (p == end || end - p > 18) return false;
    for (; p < end; p++) {
        if (*p < '0' || *p > '9') return false;
        value = 10 * value + (*p - '0');
    }
    scan->at = end;
    *out = *first == '-' ? -value : value;
    return true;
}

pal_text_excerpt pal_text_excerpt_at(const pal_text_scan *scan)
{
    pal_text_excerpt show;
    pal_text_scan at = *scan;
    if (!pal_text_more(&at)) {
        strcpy(show.text, "nothing");
        return show;
    }
    const uint8_t *end = word_end(&at);
    size_t n = (size_t)(end - at.at), k = 0;
    show.text[k++] = '\'';
    for (; k <= n && k <= 24; k++) {
        uint8_t c = at.at[k - 1];
        show.text[k] = c < 0x20 || c > 0x7E ? '?' : (char)c;
    }
    strcpy(show.text + k, n > 24 ? "...'" : "'");
    return show;
}
