/* Control messages as tables of fields, one table per message, read by one reader and written by one writer, so that
 * both directions agree by construction. The writer needs no memory; the reader hands text to cJSON only after its
 * size, nesting, number of values and UTF-8 were checked, so what cJSON allocates is bounded. */
#include "protocol/control_table.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DEPTH_MAX = 8, VALUES_IN = 256, VALUES_OUT = 4096 };
#define INTEGER_MAX 9007199254740992.0 /* 2^53 */

/* one value of a struct, and the bytes that it has there */
typedef union scalar {
    uint16_t u16;
    uint32_t u32;
    uint64_t u64;
    double f64;
    bool flag;
    pal_wire_role role;
    int tool;
} scalar;
static const size_t size_of[] = {[U16] = 2,
                                 [U32] = 4,
                                 [U64] = 8,
                                 [F64] = 8,
                                 [NUMBER_OR_NAN] = 8,
                                 [BOOL] = sizeof(bool),
                                 [ROLE] = sizeof(pal_wire_role),
                                 [TOOL] = sizeof(int)};

static const char *const role_name[PAL_WIRE_ROLE_COUNT] = {"viewer", "trainee", "instructor"};

const char *pal_wire_role_name(pal_wire_role role)
{
    return (unsigned)role < PAL_WIRE_ROLE_COUNT ? role_name[role] : "unknown";
}

const char *pal_control_name(pal_control_type type)
{
    return (unsigned)type < PAL_CONTROL_COUNT ? pal_control_message_table[type].name : NULL;
}

/* length of the well-formed UTF-8 sequence at s, 0 when there is none (overlong, surrogate, cut, beyond U+10FFFF) */
static size_t utf8_length(const uint8_t *s, size_t n)
{
    uint8_t a = s[0];
    size_t length = a < 0x80                ? 1
                    : a >= 0xC2 && a < 0xE0 ? 2
                    : a >= 0xE0 && a < 0xF0 ? 3
                    : a >= 0xF0 && a < 0xF5 ? 4
                                            : 0;
    if (length == 0 || length > n) return 0;
    for (size_t i = 1; i < length; i++)
        if ((s[i] & 0xC0) != 0x80) return 0;
    if ((a == 0xE0 && s[1] < 0xA0) || (a == 0xED && s[1] > 0x9F)) return 0;
    if ((a == 0xF0 && s[1] < 0x90) || (a == 0xF4 && s[1] > 0x8F)) return 0;
    return length;
}

/* is this what a string field may hold? */
static bool good_text(const char *text, size_t n)
{
    for (size_t i = 0; i < n;) {
        uint8_t c = (uint8_t)text[i];
        size_t length = utf8_length((const uint8_t *)text + i, n - i);
        if (length == 0 || c < 0x20 || c == 0x7F) return false;
        i += length;
    }
    return true;
}

typedef struct writer {
    char *dst;
    size_t cap, n;
    int refusal;
} writer;

static void add(writer *w, const char *text, size_t n)
{
    if (w->refusal) return;
    if (n >= w->cap - w->n) {
        w->refusal = PAL_REFUSAL_SPACE;
        return;
    }
    memcpy(w->dst + w->n, text, n);
    w->n += n;
    w->dst[w->n] = 0;
}

static void add_text(writer *w, const char *text, size_t size)
{
    size_t n = strnlen(text, size);
    if (n == size || !good_text(text, n)) w->refusal = PAL_REFUSAL_FIELD;
    add(w, "\"", 1);
    for (size_t i = 0; i < n && !w->refusal; i++) {
        if (text[i] == '"' || text[i] == '\\') add(w, "\\", 1);
        add(w, text + i, 1);
    }
    add(w, "\"", 1);
}

/* the shortest of the usual forms that reads back as the same double */
static void add_number(writer *w, double v)
{
    char digits[40];
    if (!isfinite(v)) {
        w->refusal = PAL_REFUSAL_NAN;
        return;
    }
    for (int precision = 9; precision <= 17; precision += 4) {
        snprintf(digits, sizeof digits, "%.*g", precision, v);
        if (strtod(digits, NULL) == v) break;
    }
    add(w, digits, strlen(digits));
}

static void add_tool(writer *w, int tool)
{
    if (tool < PAL_WIRE_TOOL_NONE || tool >= PAL_WIRE_TOOL_MAX)
        w->refusal = PAL_REFUSAL_RANGE;
    else if (tool == PAL_WIRE_TOOL_NONE)
        add(w, "null", 4);
    else
        add_number(w, tool);
}

static uint32_t counted(const pal_control_field *f, const uint8_t *base, int *refusal)
{
    uint32_t n = f->max;
    if (f->count != FIXED) memcpy(&n, base + f->count, sizeof n);
    if (n > f->max) *refusal = PAL_REFUSAL_RANGE;
    return n > f->max ? 0 : n;
}

static void add_key(writer *w, const char *key, bool first)
{
    if (!first) add(w, ",", 1);
    add(w, "\"", 1);
    add(w, key, strlen(key));
    add(w, "\":", 2);
}

static void add_scalar(writer *w, const pal_control_field *f, const uint8_t *at)
{
    scalar v = {.u64 = 0};
    memcpy(&v, at, size_of[f->type]);
    if ((f->type == U64 && v.u64 > (uint64_t)INTEGER_MAX) ||
        (f->type == ROLE && (unsigned)v.role >= PAL_WIRE_ROLE_COUNT))
        w->refusal = PAL_REFUSAL_RANGE;
    if (f->type == BOOL)
        add(w, v.flag ? "true" : "false", v.flag ? 4 : 5);
    else if (f->type == ROLE)
        add_text(w, pal_wire_role_name(v.role), PAL_WIRE_NAME_BYTES);
    else if (f->type == TOOL)
        add_tool(w, v.tool);
    else
        add_number(w, f->type == U16 ? v.u16 : f->type == U32 ? v.u32 : f->type == U64 ? (double)v.u64 : v.f64);
}

static void add_fields(writer *w, const pal_control_field *f, const uint8_t *base, bool first);

static void add_list(writer *w, const pal_control_field *f, const uint8_t *base)
{
    uint32_t n = counted(f, base, &w->refusal);
    const uint8_t *at = base + f->offset;
    add(w, f->type == ARGS ? "{" : "[", 1);
    for (uint32_t i = 0; i < n && !w->refusal; i++) {
        if (i) add(w, ",", 1);
        if (f->type == NUMBERS) {
            add_number(w, ((const double *)(const void *)at)[i]);
        } else if (f->type == TEXTS || f->type == TEXTS_OR_EMPTY) {
            add_text(w, (const char *)at + i * f->size, f->size);
        } else if (f->type == OBJECTS) {
            add(w, "{", 1);
            add_fields(w, f->sub, at + i * f->size, true);
            add(w, "}", 1);
        } else {
            const pal_wire_arg *arg = (const pal_wire_arg *)(const void *)at + i;
            add_text(w, arg->key, sizeof arg->key);
            add(w, ":", 1);
            add_number(w, arg->value);
        }
    }
    add(w, f->type == ARGS ? "}" : "]", 1);
}

/* what nobody said is not written */
static bool left_out(const pal_control_field *f, const uint8_t *base)
{
    static const uint8_t zero[8] = {0};
    uint32_t n = 1;
    double value = 0;
    if (f->required) return false;
    if (f->type == TEXT_OR_EMPTY) return !base[f->offset];
    if (f->type == NUMBER_OR_NAN) {
        memcpy(&value, base + f->offset, sizeof value);
        return isnan(value);
    }
    if (f->type <= BOOL) return memcmp(base + f->offset, zero, size_of[f->type]) == 0;
    if (f->type == OBJECTS || f->type == NUMBERS || f->type == TEXTS_OR_EMPTY) memcpy(&n, base + f->count, sizeof n);
    return n == 0;
}

static void add_fields(writer *w, const pal_control_field *f, const uint8_t *base, bool first)
{
    for (; f->key && !w->refusal; f++) {
        if (left_out(f, base)) continue;
        add_key(w, f->key, first);
        first = false;
        if (f->type == TEXT || f->type == TEXT_OR_EMPTY) {
            add_text(w, (const char *)base + f->offset, f->size);
        } else if (f->type == OBJECT) {
            add(w, "{", 1);
            add_fields(w, f->sub, base, true);
            add(w, "}", 1);
        } else if (f->type >= NUMBERS) {
            add_list(w, f, base);
        } else {
            add_scalar(w, f, base + f->offset);
        }
    }
}

int pal_control_put(char *dst, size_t cap, const pal_control *c, size_t *n_byte)
{
    writer w = {dst, cap, 0, 0};
    if ((unsigned)c->type >= PAL_CONTROL_COUNT) return PAL_REFUSAL_KIND;
    const pal_control_message *message = &pal_control_message_table[c->type];
    size_t limit = message->from_server ? PAL_CONTROL_OUT_MAX : PAL_CONTROL_IN_MAX;
    if (w.cap > limit + 1) w.cap = limit + 1;
    if (w.cap == 0) return PAL_REFUSAL_SPACE;
    add(&w, "{\"type\":\"", 9);
    add(&w, message->name, strlen(message->name));
    add(&w, "\"", 1);
    add_fields(&w, message->fields, (const uint8_t *)&c->hello, false);
    add(&w, "}", 1);
    if (!w.refusal) *n_byte = w.n;
    return w.refusal;
}

/* size of the structure without parsing it: nesting, number of values, UTF-8 */
static int scan(const char *text, size_t n, uint32_t n_value_max)
{
    uint32_t n_value = 0;
    int depth = 0;
    bool quoted = false;
    for (size_t i = 0; i < n;) {
        size_t length = utf8_length((const uint8_t *)text + i, n - i);
        char c = text[i];
        if (length == 0 || c == 0) return PAL_REFUSAL_JSON;
        if (quoted) {
            if (c == '"') quoted = false;
            if (c == '\\') length++;
        } else if (c == '"') {
            quoted = true;
        } else if (c == '{' || c == '[') {
            n_value++;
            if (++depth > DEPTH_MAX) return PAL_REFUSAL_JSON;
        } else if (c == '}' || c == ']') {
            depth--;
        } else if (c == ',') {
            n_value++;
        }
        if (n_value > n_value_max) return PAL_REFUSAL_JSON;
        i += length;
    }
    return quoted || depth ? PAL_REFUSAL_JSON : PAL_REFUSAL_NONE;
}

static int read_text(const cJSON *item, char *dst, size_t size)
{
    const char *text = cJSON_GetStringValue(item);
    if (!text) return PAL_REFUSAL_FIELD;
    size_t n = strlen(text);
    if (n >= size || !good_text(text, n)) return PAL_REFUSAL_FIELD;
    memcpy(dst, text, n + 1);
    return 0;
}

static int read_number(const cJSON *item, double *out)
{
    if (!cJSON_IsNumber(item)) return PAL_REFUSAL_FIELD;
    if (!isfinite(item->valuedouble)) return PAL_REFUSAL_NAN;
    *out = item->valuedouble;
    return 0;
}

static int read_integer(const cJSON *item, double min, double max, double *out)
{
    double v;
    int refusal = read_number(item, &v);
    if (refusal) return refusal;
    if (v < min || v > max || v != floor(v)) return PAL_REFUSAL_RANGE;
    *out = v;
    return 0;
}

static int read_role(const cJSON *item, pal_wire_role *out)
{
    const char *text = cJSON_GetStringValue(item);
    for (int r = 0; text && r < PAL_WIRE_ROLE_COUNT; r++)
        if (!strcmp(text, role_name[r])) {
            *out = (pal_wire_role)r;
            return 0;
        }
    return PAL_REFUSAL_FIELD;
}

static int read_scalar(const pal_control_field *f, const cJSON *item, uint8_t *at)
{
    static const double max[] = {[U16] = 65535, [U32] = 4294967295.0, [U64] = INTEGER_MAX};
    double number = 0;
    scalar v = {.u64 = 0};
    int refusal = 0;
    if (f->type == BOOL) {
        v.flag = cJSON_IsTrue(item);
        refusal = cJSON_IsBool(item) ? PAL_REFUSAL_NONE : PAL_REFUSAL_FIELD;
    } else if (f->type == ROLE) {
        refusal = read_role(item, &v.role);
    } else if (f->type == TOOL) {
        refusal = read_integer(item, PAL_WIRE_TOOL_ANY, PAL_WIRE_TOOL_MAX - 1, &number);
        v.tool = (int)number;
    } else if (f->type == F64 || f->type == NUMBER_OR_NAN) {
        refusal = read_number(item, &v.f64);
    } else {
        refusal = read_integer(item, 0, max[f->type], &number);
        if (f->type == U16) v.u16 = (uint16_t)number;
        if (f->type == U32) v.u32 = (uint32_t)number;
        if (f->type == U64) v.u64 = (uint64_t)number;
    }
    if (!refusal) memcpy(at, &v, size_of[f->type]);
    return refusal;
}

static int read_fields(const pal_control_field *f, const cJSON *object, uint8_t *base);

static int read_list(const pal_control_field *f, const cJSON *list, uint8_t *base)
{
    uint32_t n = 0;
    int refusal = 0;
    if (f->type == ARGS ? !cJSON_IsObject(list) : !cJSON_IsArray(list)) return PAL_REFUSAL_FIELD;
    for (const cJSON *item = list->child; item && !refusal; item = item->next, n++) {
        uint8_t *at = base + f->offset;
        if (n >= f->max) return PAL_REFUSAL_COUNT;
        if (f->type == NUMBERS) {
            refusal = read_number(item, (double *)(void *)at + n);
        } else if (f->type == TEXTS || f->type == TEXTS_OR_EMPTY) {
            refusal = read_text(item, (char *)at + n * f->size, f->size);
        } else if (f->type == OBJECTS) {
            refusal = read_fields(f->sub, item, at + n * f->size);
        } else {
            pal_wire_arg *arg = (pal_wire_arg *)(void *)at + n;
            size_t length = strlen(item->string);
            if (length >= sizeof arg->key || !good_text(item->string, length)) return PAL_REFUSAL_FIELD;
            memcpy(arg->key, item->string, length + 1);
            refusal = read_number(item, &arg->value);
        }
    }
    if (refusal) return refusal;
    if (f->count == FIXED) return n == f->max ? PAL_REFUSAL_NONE : PAL_REFUSAL_COUNT;
    memcpy(base + f->count, &n, sizeof n);
    return 0;
}

static int read_fields(const pal_control_field *f, const cJSON *object, uint8_t *base)
{
    int refusal = cJSON_IsObject(object) ? PAL_REFUSAL_NONE : PAL_REFUSAL_FIELD;
    for (; f->key && !refusal; f++) {
        const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, f->key);
        bool absent = !item || (f->type == TOOL && cJSON_IsNull(item));
        if (absent) {
            const int none = PAL_WIRE_TOOL_NONE;
            const double unknown = NAN;
            if (f->type == TOOL) memcpy(base + f->offset, &none, sizeof none);
            if (f->type == NUMBER_OR_NAN) memcpy(base + f->offset, &unknown, sizeof unknown);
            if (f->required) refusal = PAL_REFUSAL_FIELD;
        } else if (f->type == TEXT || f->type == TEXT_OR_EMPTY) {
            refusal = read_text(item, (char *)base + f->offset, f->size);
        } else if (f->type == OBJECT) {
            refusal = read_fields(f->sub, item, base);
        } else if (f->type >= NUMBERS) {
            refusal = read_list(f, item, base);
        } else {
            refusal = read_scalar(f, item, base + f->offset);
        }
    }
    return refusal;
}

static int read_message(const cJSON *root, bool from_server, pal_control *c)
{
    const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(root, "type"));
    if (!cJSON_IsObject(root) || !name) return PAL_REFUSAL_FIELD;
    int type = 0;
    while (type < PAL_CONTROL_COUNT && strcmp(pal_control_message_table[type].name, name)) type++;
    if (type == PAL_CONTROL_COUNT || pal_control_message_table[type].from_server != from_server)
        return PAL_REFUSAL_KIND;
    c->type = (pal_control_type)type;
    return read_fields(pal_control_message_table[type].fields, root, (uint8_t *)&c->hello);
}

int pal_control_get(const char *text, size_t n_byte, bool from_server, pal_control *out)
{
    if (n_byte > (from_server ? PAL_CONTROL_OUT_MAX : PAL_CONTROL_IN_MAX)) return PAL_REFUSAL_LONG;
    int refusal = scan(text, n_byte, from_server ? VALUES_OUT : VALUES_IN);
    if (refusal) return refusal;
    const char *end = NULL;
    cJSON *root = cJSON_ParseWithLengthOpts(text, n_byte, &end, false);
    pal_control *c = calloc(1, sizeof *c);
    if (!root || !c) {
        refusal = root ? PAL_REFUSAL_MEMORY : PAL_REFUSAL_JSON;
    } else {
        for (; end < text + n_byte; end++)
            if (*end != ' ' && *end != '\t' && *end != '\n' && *end != '\r') refusal = PAL_REFUSAL_JSON;
        if (!refusal) refusal = read_message(root, from_server, c);
        if (!refusal) *out = *c;
    }
    free(c);
    cJSON_Delete(root);
    return refusal;
}
