/* The tree is cJSON's; what it does not check is checked here: depth, UTF-8, duplicate keys, bytes behind the root. */
#include "server/scene/json_reader.h"

#include "server/base/utf8.h"
#include "server/mesh/files/file_bytes.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* path of a key of the object at path; "" is the root, or the object itself */
static void join(char out[PAL_JSON_PATH], const char *path, const char *key)
{
    if (snprintf(out, PAL_JSON_PATH, "%s%s%.40s", path, *path && *key ? "." : "", key) < 0) out[0] = 0;
}

static int line_of(const char *text, size_t at)
{
    int line = 1;
    for (size_t k = 0; k < at; k++) line += text[k] == '\n';
    return line;
}

/* brackets open at most at once, counted outside of texts */
static pal_err check_text(const pal_json *json, const char *text, size_t n_byte)
{
    int depth = 0;
    bool quoted = false;
    for (size_t k = 0; k < n_byte;) {
        uint32_t code;
        int n = pal_utf8_next(text + k, n_byte - k, &code);
        if (n == 0 || code == 0)
            return PAL_REFUSE(json->diag, "%s: line %d: byte %zu is not UTF-8 text", json->file, line_of(text, k), k);
        if (quoted && code == '\\')
            k++;
        else if (code == '"')
            quoted = !quoted;
        else if (!quoted && (code == '[' || code == '{'))
            depth++;
        else if (!quoted && (code == ']' || code == '}'))
            depth--;
        if (depth > PAL_JSON_DEPTH)
            return PAL_REFUSE(json->diag, "%s: line %d: nested deeper than %d", json->file, line_of(text, k),
                              PAL_JSON_DEPTH);
        k += (size_t)n;
    }
    return PAL_ERR_OK;
}

pal_err pal_json_parse(pal_json *json, const char *text, size_t n_byte, cJSON **tree)
{
    if (n_byte > PAL_JSON_MAX_BYTES)
        return PAL_REFUSE(json->diag, "%s: %zu bytes, more than %d", json->file, n_byte, PAL_JSON_MAX_BYTES);
    PAL_TRY(check_text(json, text, n_byte));
    const char *end = text;
    cJSON *root = n_byte ? cJSON_ParseWithLengthOpts(text, n_byte, &end, false) : NULL;
    size_t at = end && end >= text ? (size_t)(end - text) : 0;
    if (!root)
        return PAL_REFUSE(json->diag, "%s: line %d: not JSON", json->file, line_of(text, at < n_byte ? at : n_byte));
    while (at < n_byte && strchr(" \t\r\n", text[at])) at++;
    if (at < n_byte || !cJSON_IsObject(root)) {
        cJSON_Delete(root);
        return PAL_REFUSE(json->diag, "%s: line %d: %s", json->file, at < n_byte ? line_of(text, at) : 1,
                          at < n_byte ? "more text behind the end" : "not a JSON object");
    }
    json->value = *tree = root;
    return PAL_ERR_OK;
}

pal_err pal_json_refuse_key(const pal_json *at, const char *key, const char *format, ...)
{
    char sentence[384], path[PAL_JSON_PATH];
    va_list args;
    va_start(args, format);
    vsnprintf(sentence, sizeof sentence, format, args);
    va_end(args);
    join(path, at->path, key);
    return PAL_REFUSE(at->diag, "%s: %s%s%s", at->file, path, *path ? ": " : "", sentence);
}

pal_err pal_json_forward(const pal_json *at, const char *key, pal_err err, const pal_diagnostic *reason)
{
    char path[PAL_JSON_PATH];
    join(path, at->path, key);
    return err ? pal_diagnostic_set(at->diag, err, "%s: %s: %s", at->file, path, reason->text) : PAL_ERR_OK;
}

pal_json pal_json_at(const pal_json *at, const char *key)
{
    pal_json child = *at;
    child.value = cJSON_GetObjectItemCaseSensitive(at->value, key);
    join(child.path, at->path, key);
    return child;
}

pal_json pal_json_entry(const pal_json *list, int index, const cJSON *value)
{
    pal_json entry = *list;
    entry.value = value;
    entry.index = index;
    if (snprintf(entry.path, sizeof entry.path, "%s[%d]", list->path, index) < 0) entry.path[0] = 0;
    return entry;
}

void pal_json_list_words(const char *const *words, const char *quote, char *out, size_t n_byte)
{
    size_t n = 0;
    out[0] = 0;
    for (int k = 0; words[k] && n < n_byte; k++)
        n += (size_t)snprintf(out + n, n_byte - n, "%s%s%s%s", k ? ", " : "", quote, words[k], quote);
}

/* a key as it may be printed: at most 40 characters without control characters */
static void clean_key(const char *key, char out[64])
{
    size_t n = 0;
    for (; *key && n < 40; key++)
        if ((unsigned char)*key >= 0x20 && (unsigned char)*key < 0x7f) out[n++] = *key;
    out[n] = 0;
}

pal_err pal_json_object(const pal_json *at, const char *const *known)
{
    char list[256], key[64];
    if (!cJSON_IsObject(at->value)) return pal_json_refuse(at, "is not an object {...}");
    if (cJSON_GetArraySize(at->value) > PAL_JSON_KEYS) return pal_json_refuse(at, "more than %d keys", PAL_JSON_KEYS);
    PAL_JSON_EACH (child, at) {
        bool found = !known;
        for (int k = 0; known && known[k] && !found; k++) found = !strcmp(child->string, known[k]);
        clean_key(child->string, key);
        if (!found) {
            pal_json_list_words(known, "", list, sizeof list);
            return pal_json_refuse_key(at, key, "unknown key; known are %s", list);
        }
        for (const cJSON *other = at->value->child; other != child; other = other->next)
            if (!strcmp(other->string, child->string)) return pal_json_refuse_key(at, key, "the key is there twice");
    }
    return PAL_ERR_OK;
}

bool pal_json_has(const pal_json *at, const char *key)
{
    return cJSON_GetObjectItemCaseSensitive(at->value, key) != NULL;
}

pal_err pal_json_need(const pal_json *at, const char *key)
{
    return pal_json_has(at, key) ? PAL_ERR_OK : pal_json_refuse_key(at, key, "is missing");
}

pal_err pal_json_number(const pal_json *at, const char *key, double low, double high, double *out)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(at->value, key);
    if (!item) return PAL_ERR_OK;
    if (!cJSON_IsNumber(item)) return pal_json_refuse_key(at, key, "is not a number");
    if (!(item->valuedouble >= low && item->valuedouble <= high))
        return pal_json_refuse_key(at, key, "%g is outside %g .. %g", item->valuedouble, low, high);
    *out = item->valuedouble;
    return PAL_ERR_OK;
}

pal_err pal_json_count(const pal_json *at, const char *key, int low, int high, int *out)
{
    double number = *out;
    PAL_TRY(pal_json_number(at, key, low, high, &number));
    if (number != floor(number)) return pal_json_refuse_key(at, key, "%g is not whole", number);
    *out = (int)number;
    return PAL_ERR_OK;
}

pal_err pal_json_bool(const pal_json *at, const char *key, bool *out)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(at->value, key);
    if (item && !cJSON_IsBool(item)) return pal_json_refuse_key(at, key, "is not true or false");
    if (item) *out = cJSON_IsTrue(item);
    return PAL_ERR_OK;
}

pal_err pal_json_vector(const pal_json *at, const char *key, double out[3])
{
    double number[3];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(at->value, key);
    if (!item) return PAL_ERR_OK;
    int n = 0;
    const cJSON *child = cJSON_IsArray(item) ? item->child : NULL;
    for (; n < 3 && cJSON_IsNumber(child) && isfinite(child->valuedouble); child = child->next)
        number[n++] = child->valuedouble;
    if (n < 3 || child) return pal_json_refuse_key(at, key, "is not a list of three numbers");
    memcpy(out, number, sizeof number);
    return PAL_ERR_OK;
}

pal_err pal_json_box(const pal_json *at, const char *low_key, const char *high_key, double low[3], double high[3])
{
    PAL_TRY(pal_json_need(at, low_key));
    PAL_TRY(pal_json_need(at, high_key));
    PAL_TRY(pal_json_vector(at, low_key, low));
    PAL_TRY(pal_json_vector(at, high_key, high));
    for (int c = 0; c < 3; c++)
        if (low[c] > high[c])
            return pal_json_refuse(at, "%s[%d] %g is above %s[%d] %g", low_key, c, low[c], high_key, c, high[c]);
    return PAL_ERR_OK;
}

pal_err pal_json_text(const pal_json *at, const char *key, bool may_be_empty, char *out, size_t n_byte)
{
    const cJSON *item = key[0] ? cJSON_GetObjectItemCaseSensitive(at->value, key) : at->value;
    if (!item) return PAL_ERR_OK;
    if (!cJSON_IsString(item)) return pal_json_refuse_key(at, key, "is not a text");
    size_t n = strlen(item->valuestring);
    if (n >= n_byte) return pal_json_refuse_key(at, key, "%zu bytes of text, more than %zu", n, n_byte - 1);
    if (n == 0 && !may_be_empty) return pal_json_refuse_key(at, key, "is empty");
    if (!pal_utf8_all_printable(item->valuestring, n)) return pal_json_refuse_key(at, key, "has a control character");
    memcpy(out, item->valuestring, n + 1);
    return PAL_ERR_OK;
}

pal_err pal_json_file_name(const pal_json *at, const char *key, char *out, size_t n_byte)
{
    char name[512] = "";
    PAL_TRY(pal_json_text(at, key, false, name, sizeof name));
    int n = name[0] == '/' ? snprintf(out, n_byte, "%s", name) : snprintf(out, n_byte, "%s/%s", at->folder, name);
    if (n >= 0 && (size_t)n < n_byte) return PAL_ERR_OK;
    return pal_json_refuse_key(at, key, "with its folder longer than %zu bytes", n_byte - 1);
}

pal_err pal_json_list(const pal_json *at, const char *key, int max, pal_json *out)
{
    *out = pal_json_at(at, key);
    if (!out->value) return PAL_ERR_OK;
    if (!cJSON_IsArray(out->value)) return pal_json_refuse(out, "is not a list [...]");
    int n = cJSON_GetArraySize(out->value);
    return n > max ? pal_json_refuse(out, "%d entries, more than %d", n, max) : PAL_ERR_OK;
}

enum { DIGITS = 32 };

/* 15 digits where they are enough, as people write them, at most 17; bytes written */
static int exact(double number, char out[DIGITS])
{
    int n = 0;
    if (!isfinite(number)) return snprintf(out, DIGITS, "null");
    for (int digits = 15; digits <= 17; digits++) {
        n = snprintf(out, DIGITS, "%.*g", digits, number);
        if (strtod(out, NULL) == number) break;
    }
    return n;
}

cJSON *pal_json_exact(double number)
{
    char text[DIGITS];
    exact(number, text);
    return cJSON_CreateRaw(text);
}

cJSON *pal_json_exact_list(const double *number, int n)
{
    char *text = malloc((DIGITS + 2) * (size_t)n + 3);
    size_t at = 1;
    if (!text) return NULL;
    text[0] = '[';
    for (int i = 0; i < n; i++) {
        if (i) text[at++] = ',', text[at++] = ' ';
        at += (size_t)exact(number[i], text + at);
    }
    memcpy(text + at, "]", 2);
    cJSON *list = cJSON_CreateRaw(text);
    free(text);
    return list;
}

bool pal_json_folder(const char *path, char *out, size_t n_byte)
{
    const char *slash = strrchr(path, '/');
    int n = slash ? slash > path ? (int)(slash - path) : 1 : 1;
    int size = snprintf(out, n_byte, "%.*s", n, slash ? path : ".");
    return size >= 0 && (size_t)size < n_byte;
}

pal_err pal_json_read(const char *path, char *folder, size_t n_folder, char **text, size_t *n_byte,
                      pal_diagnostic *diag)
{
    if (!pal_json_folder(path, folder, n_folder)) return PAL_REFUSE(diag, "%.100s...: the path is too long", path);
    uint8_t *bytes;
    PAL_TRY(pal_file_read(path, PAL_JSON_MAX_BYTES, &bytes, n_byte, diag));
    *text = (char *)bytes;
    return PAL_ERR_OK;
}
