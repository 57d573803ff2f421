/* A value is scanned with the path that leads to it, "/inverse3/@/state/cursor_position/x", in which the index of the
 * chosen device is "@" and all others "-". */
#include "clients/haptic_bridge/device_haply_scan.h"

#include <string.h>

enum { SCAN_LEVELS = 16, SCAN_PATH = 96 };

typedef enum scan_kind { SCAN_NUMBER, SCAN_TRUE, SCAN_FALSE, SCAN_TEXT } scan_kind;

typedef struct scan {
    const char *at, *end;
    char path[SCAN_PATH];
    size_t n_path;
    int index, level, too_long; /* too_long: levels whose path had no room */
    pal_haply_state *out;
} scan;

typedef struct scan_field {
    const char *path;
    scan_kind kind;
    size_t offset;
    size_t seen; /* of the bool that it sets beside; 0: none */
} scan_field;
#define AT(member) offsetof(pal_haply_state, member)
#define DEVICE     "/inverse3/@/"
#define WIRELESS   "/wireless_verse_grip/@/"
#define WIRED      "/verse_grip/@/"
static const scan_field scan_fields[] = {
    {DEVICE "device_id", SCAN_TEXT, AT(device), 0},
    {WIRELESS "device_id", SCAN_TEXT, AT(wireless), 0},
    {WIRED "device_id", SCAN_TEXT, AT(wired), 0},
    {DEVICE "state/cursor_position/x", SCAN_NUMBER, AT(position_m[0]), 0},
    {DEVICE "state/cursor_position/y", SCAN_NUMBER, AT(position_m[1]), 0},
    {DEVICE "state/cursor_position/z", SCAN_NUMBER, AT(position_m[2]), AT(has_position)},
    {DEVICE "state/current_cursor_force/x", SCAN_NUMBER, AT(force_N[0]), 0},
    {DEVICE "state/current_cursor_force/y", SCAN_NUMBER, AT(force_N[1]), 0},
    {DEVICE "state/current_cursor_force/z", SCAN_NUMBER, AT(force_N[2]), AT(has_force)},
    {WIRELESS "state/orientation/w", SCAN_NUMBER, AT(wireless_quat[0]), AT(has_wireless)},
    {WIRELESS "state/orientation/x", SCAN_NUMBER, AT(wireless_quat[1]), 0},
    {WIRELESS "state/orientation/y", SCAN_NUMBER, AT(wireless_quat[2]), 0},
    {WIRELESS "state/orientation/z", SCAN_NUMBER, AT(wireless_quat[3]), 0},
    {WIRED "state/orientation/w", SCAN_NUMBER, AT(wired_quat[0]), AT(has_wired)},
    {WIRED "state/orientation/x", SCAN_NUMBER, AT(wired_quat[1]), 0},
    {WIRED "state/orientation/y", SCAN_NUMBER, AT(wired_quat[2]), 0},
    {WIRED "state/orientation/z", SCAN_NUMBER, AT(wired_quat[3]), 0},
    {WIRELESS "state/buttons/a", SCAN_TRUE, AT(button[0]), 0},
    {WIRELESS "state/buttons/b", SCAN_TRUE, AT(button[1]), 0},
    {WIRELESS "state/buttons/c", SCAN_TRUE, AT(button[2]), 0},
    {WIRELESS "state/buttons/button_0", SCAN_TRUE, AT(button[0]), 0},
    {WIRELESS "state/buttons/button_1", SCAN_TRUE, AT(button[1]), 0},
    {WIRELESS "state/buttons/button_2", SCAN_TRUE, AT(button[2]), 0},
    {WIRELESS "state/buttons/button_3", SCAN_TRUE, AT(button[3]), 0},
    {WIRED "state/button", SCAN_TRUE, AT(button[0]), 0},
    {DEVICE "status/calibrated", SCAN_FALSE, AT(not_calibrated), 0},
    {DEVICE "status/power_supply", SCAN_FALSE, AT(no_power), 0},
};

/* puts a value where its path belongs; a flag of kind SCAN_FALSE is set by false */
static void scan_store(scan *s, scan_kind kind, double number, const char *text, size_t n_text)
{
    if (s->too_long) return;
    for (size_t i = 0; i < sizeof scan_fields / sizeof scan_fields[0]; i++) {
        const scan_field *f = &scan_fields[i];
        const bool is_flag = f->kind == SCAN_TRUE || f->kind == SCAN_FALSE;
        const bool fits = f->kind == kind || (is_flag && (kind == SCAN_TRUE || kind == SCAN_FALSE));
        if (!fits || strlen(f->path) != s->n_path || memcmp(f->path, s->path, s->n_path)) continue;
        char *to = (char *)s->out + f->offset;
        if (kind == SCAN_NUMBER) memcpy(to, &number, sizeof number);
        if (is_flag) *(bool *)to = f->kind == kind;
        if (kind == SCAN_TEXT) {
            const size_t n = n_text < sizeof s->out->device - 1 ? n_text : sizeof s->out->device - 1;
            memcpy(to, text, n);
            to[n] = 0;
        }
        if (f->seen) *((bool *)s->out + f->seen) = true;
        return;
    }
}

static void scan_space(scan *s)
{
    while (s->at < s->end && (*s->at == ' ' || *s->at == '\t' || *s->at == '\n' || *s->at == '\r')) s->at++;
}
static bool scan_char(scan *s, char c)
{
    scan_space(s);
    if (s->at == s->end || *s->at != c) return false;
    s->at++;
    return true;
}

/* a string, as it is written between its quotes */
static bool scan_string(scan *s, const char **text, size_t *n)
{
    if (!scan_char(s, '"')) return false;
    *text = s->at;
    while (s->at < s->end && *s->at != '"') s->at += *s->at == '\\' && s->end - s->at > 1 ? 2 : 1;
    if (s->at >= s->end) return false;
    *n = (size_t)(s->at - *text);
    s->at++;
    return true;
}

static bool scan_digits(scan *s, double *value, int *n)
{
    *n = 0;
    for (; s->at < s->end && *s->at >= '0' && *s->at <= '9'; s->at++, ++*n) *value = 10 * *value + (*s->at - '0');
    return *n > 0;
}

/* without the library's strtod, which wants an end of its own and asks the locale */
static bool scan_number(scan *s, double *value)
{
    const bool minus = s->at < s->end && *s->at == '-';
    int n, exponent = 0;
    double power = 0;
    s->at += minus;
    *value = 0;
    if (!scan_digits(s, value, &n)) return false;
    if (s->at < s->end && *s->at == '.') {
        s->at++;
        if (!scan_digits(s, value, &n)) return false;
        exponent = -n;
    }
    if (s->at < s->end && (*s->at == 'e' || *s->at == 'E')) {
        s->at++;
        const bool down = s->at < s->end && *s->at == '-';
        if (s->at < s->end && (*s->at == '-' || *s->at == '+')) s->at++;
        if (!scan_digits(s, &power, &n)) return false;
        exponent += (int)(down ? -1 : 1) * (power < 400 ? (int)power : 400);
    }
    double scale = 1;
    for (int i = 0; *value > 0 && i < (exponent < 0 ? -exponent : exponent) && i < 800; i++) scale *= 10;
    *value = exponent < 0 ? *value / scale : *value * scale;
    if (minus) *value = -*value;
    return true;
}

static bool scan_word(scan *s, const char *word)
{
    const size_t n = strlen(word);
    if ((size_t)(s->end - s->at) < n || memcmp(s->at, word, n)) return false;
    s->at += n;
    return true;
}

static bool scan_value(scan *s);

/* a member or an element: its name goes onto the path meanwhile */
static bool scan_under(scan *s, const char *name, size_t n)
{
    const size_t before = s->n_path;
    const bool fits = s->n_path + 1 + n < SCAN_PATH;
    if (fits) {
        s->path[s->n_path] = '/';
        memcpy(s->path + s->n_path + 1, name, n);
        s->n_path += 1 + n;
    }
    s->too_long += !fits;
    const bool good = scan_value(s);
    s->too_long -= !fits;
    s->n_path = before;
    return good;
}

static bool scan_object(scan *s)
{
    const char *name;
    size_t n;
    if (scan_char(s, '}')) return true;
    do {
        if (!scan_string(s, &name, &n) || !scan_char(s, ':') || !scan_under(s, name, n)) return false;
    } while (scan_char(s, ','));
    return scan_char(s, '}');
}

static bool scan_array(scan *s)
{
    if (scan_char(s, ']')) return true;
    int i = 0;
    do {
        if (!scan_under(s, i++ == s->index ? "@" : "-", 1)) return false;
    } while (scan_char(s, ','));
    return scan_char(s, ']');
}

static bool scan_value(scan *s)
{
    const char *text;
    size_t n;
    double number;
    if (s->level == SCAN_LEVELS) return false;
    s->level++;
    scan_space(s);
    const char c = s->at < s->end ? *s->at : 0;
    bool good = false;
    if (c == '{')
        s->at++, good = scan_object(s);
    else if (c == '[')
        s->at++, good = scan_array(s);
    else if (c == '"') {
        good = scan_string(s, &text, &n);
        if (good) scan_store(s, SCAN_TEXT, 0, text, n);
    } else if (scan_word(s, "true"))
        good = true, scan_store(s, SCAN_TRUE, 0, NULL, 0);
    else if (scan_word(s, "false"))
        good = true, scan_store(s, SCAN_FALSE, 0, NULL, 0);
    else if (scan_word(s, "null"))
        good = true;
    else if ((good = scan_number(s, &number)))
        scan_store(s, SCAN_NUMBER, number, NULL, 0);
    s->level--;
    return good;
}

bool pal_haply_scan(const char *text, size_t n, int index, pal_haply_state *state)
{
    scan s = {.at = text, .end = text + n, .index = index, .out = state};
    state->has_position = state->has_force = state->has_wireless = state->has_wired = false;
    if (!scan_value(&s)) return false;
    scan_space(&s);
    return s.at == s.end;
}
