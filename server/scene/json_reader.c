/* The tree is cJSON's; what it does not check is checked here: depth, UTF-8, duplicate keys, bytes behind the root. */
#include "server/scene/json_reader.h"

#include "server/mesh/files/file_bytes.h"

#include "server/base/utf8.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
            return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: line %d: byte %zu is not UTF-8 text",
                                      json->file, line_of(text, k), k);
        if (quoted && code == '\\')
            k++;
        else if (code == '"')
            quoted = !quoted;
        else if (!quoted && (code == '[' || code == '{'))
            depth++;
        else if (!quoted && (code == ']' || code == '}'))
            depth--;
        if (depth > PAL_JSON_DEPTH)
            return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: line %d: nested deeper than %d", json->file,
                                      line_of(text, k), PAL_JSON_DEPTH);
        k += (size_t)n;
    }
    return PAL_ERR_OK;
}

pal_err pal_json_parse(const pal_json *json, const char *text, size_t n_byte, cJSON **out)
{
    if (n_byte > PAL_JSON_MAX_BYTES)
        return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: %zu bytes, more than %d", json->file, n_byte,
                                  PAL_JSON_MAX_BYTES);
    PAL_TRY(check_text(json, text, n_byte));
    const char *end = text;
    cJSON *root = n_byte ? cJSON_ParseWithLengthOpts(text, n_byte, &end, false) : NULL;
    size_t at = end && end >= text ? (size_t)(end - text) : 0;
    if (!root)
        return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: line %d: not JSON", json->file,
                                  line_of(text, at < n_byte ? at : n_byte));
    while (at < n_byte && strchr(" \t\r\n", text[at])) at++;
    if (at < n_byte || !cJSON_IsObject(root)) {
        cJSON_Delete(root);
        return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: line %d: %s", json->file,
                                  at < n_byte ? line_of(text, at) : 1,
                                  at < n_byte ? "more text behind the end" : "not a JSON object");
    }
    *out = root;
    return PAL_ERR_OK;
}

pal_err pal_json_refuse(const pal_json *json, const char *path, const char *format, ...)
{
    char sentence[384];
    va_list args;
    va_start(args, format);
    vsnprintf(sentence, sizeof sentence, format, args);
    va_end(args);
    return pal_diagnostic_set(json->diag, PAL_ERR_REFUSED, "%s: %s%s%s", json->file, path, *path ? ": " : "", sentence);
}

const char *pal_json_key(char out[PAL_JSON_PATH], const char *path, const char *key)
{
    snprintf(out, PAL_JSON_PATH, "%s%s%.40s", path, *path ? "." : "", key);
    return out;
}

const char *pal_json_entry(char out[PAL_JSON_PATH], const char *path, int index)
{
    snprintf(out, PAL_JSON_PATH, "%s[%d]", path, index);
    return out;
}

/* "a, b, c" of the known keys, for the sentence about an unknown one */
static void list_known(const char *const *known, char *out, size_t n_byte)
{
    size_t n = 0;
    out[0] = 0;
    for (int k = 0; known[k] && n < n_byte; k++)
        n += (size_t)snprintf(out + n, n_byte - n, "%s%s", k ? ", " : "", known[k]);
}

/* a key as it may be printed: at most 40 characters without control characters */
static void clean_key(const char *key, char out[64])
{
    size_t n = 0;
    for (; *key && n < 40; key++)
        if ((unsigned char)*key >= 0x20 && (unsigned char)*key < 0x7f) out[n++] = *key;
    out[n] = 0;
}

pal_err pal_json_object(const pal_json *json, const cJSON *object, const char *path, const char *const *known)
{
    char at[PAL_JSON_PATH], list[256], key[64];
    if (!cJSON_IsObject(object)) return pal_json_refuse(json, path, "is not an object {...}");
    if (cJSON_GetArraySize(object) > PAL_JSON_KEYS)
        return pal_json_refuse(json, path, "more than %d keys", PAL_JSON_KEYS);
    for (const cJSON *child = object->child; child; child = child->next) {
        bool found = !known;
        for (int k = 0; known && known[k] && !found; k++) found = !strcmp(child->string, known[k]);
        clean_key(child->string, key);
        if (!found) {
            list_known(known, list, sizeof list);
            return pal_json_refuse(json, pal_json_key(at, path, key), "unknown key; known are %s", list);
        }
        for (const cJSON *other = object->child; other != child; other = other->next)
            if (!strcmp(other->string, child->string))
                return pal_json_refuse(json, pal_json_key(at, path, key), "the key is there twice");
    }
    return PAL_ERR_OK;
}

pal_err pal_json_number(const pal_json *json, const cJSON *object, const char *path, const char *key, double low,
                        double high, double *out)
{
    char at[PAL_JSON_PATH];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!item) return PAL_ERR_OK;
    if (!cJSON_IsNumber(item)) return pal_json_refuse(json, pal_json_key(at, path, key), "is not a number");
    if (!(item->valuedouble >= low && item->valuedouble <= high))
        return pal_json_refuse(json, pal_json_key(at, path, key), "%g is outside %g .. %g", item->valuedouble, low,
                               high);
    *out = item->valuedouble;
    return PAL_ERR_OK;
}

pal_err pal_json_count(const pal_json *json, const cJSON *object, const char *path, const char *key, int low, int high,
                       int *out)
{
    char at[PAL_JSON_PATH];
    double number = *out;
    PAL_TRY(pal_json_number(json, object, path, key, low, high, &number));
    if (number != floor(number)) return pal_json_refuse(json, pal_json_key(at, path, key), "%g is not whole", number);
    *out = (int)number;
    return PAL_ERR_OK;
}

pal_err pal_json_bool(const pal_json *json, const cJSON *object, const char *path, const char *key, bool *out)
{
    char at[PAL_JSON_PATH];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (item && !cJSON_IsBool(item)) return pal_json_refuse(json, pal_json_key(at, path, key), "is not true or false");
    if (item) *out = cJSON_IsTrue(item);
    return PAL_ERR_OK;
}

pal_err pal_json_vector(const pal_json *json, const cJSON *object, const char *path, const char *key, double out[3])
{
    char at[PAL_JSON_PATH];
    double number[3];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!item) return PAL_ERR_OK;
    const cJSON *child = cJSON_IsArray(item) ? item->child : NULL;
    for (int k = 0; k < 3; k++, child = child->next) {
        if (!child || !cJSON_IsNumber(child) || !isfinite(child->valuedouble))
            return pal_json_refuse(json, pal_json_key(at, path, key), "is not a list of three numbers");
        number[k] = child->valuedouble;
    }
    if (child) return pal_json_refuse(json, pal_json_key(at, path, key), "is not a list of three numbers");
    memcpy(out, number, sizeof number);
    return PAL_ERR_OK;
}

pal_err pal_json_text(const pal_json *json, const cJSON *object, const char *path, const char *key, bool may_be_empty,
                      char *out, size_t n_byte)
{
    char at[PAL_JSON_PATH];
    uint32_t code;
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!item) return PAL_ERR_OK;
    pal_json_key(at, path, key);
    if (!cJSON_IsString(item)) return pal_json_refuse(json, at, "is not a text");
    size_t n = strlen(item->valuestring);
    if (n >= n_byte) return pal_json_refuse(json, at, "%zu bytes of text, more than %zu", n, n_byte - 1);
    if (n == 0 && !may_be_empty) return pal_json_refuse(json, at, "is empty");
    for (size_t k = 0; k < n;) {
        int size = pal_utf8_next(item->valuestring + k, n - k, &code);
        if (size == 0 || !pal_utf8_printable(code)) return pal_json_refuse(json, at, "has a control character");
        k += (size_t)size;
    }
    memcpy(out, item->valuestring, n + 1);
    return PAL_ERR_OK;
}

pal_err pal_json_list(const pal_json *json, const cJSON *object, const char *path, const char *key, int max,
                      const cJSON **out)
{
    char at[PAL_JSON_PATH];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    *out = NULL;
    if (!item) return PAL_ERR_OK;
    if (!cJSON_IsArray(item)) return pal_json_refuse(json, pal_json_key(at, path, key), "is not a list [...]");
    int n = cJSON_GetArraySize(item);
    if (n > max) return pal_json_refuse(json, pal_json_key(at, path, key), "%d entries, more than %d", n, max);
    *out = item;
    return PAL_ERR_OK;
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

pal_err pal_json_read(const char *path, char *folder, size_t n_folder, char **text, size_t *n_byte,
                      pal_diagnostic *diag)
{
    const char *slash = strrchr(path, '/');
    int n = slash == path ? snprintf(folder, n_folder, "/")
            : slash       ? snprintf(folder, n_folder, "%.*s", (int)(slash - path), path)
                          : snprintf(folder, n_folder, ".");
    if (n < 0 || (size_t)n >= n_folder)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%.100s...: the path is too long", path);
    uint8_t *bytes;
    PAL_TRY(pal_file_read(path, PAL_JSON_MAX_BYTES, &bytes, n_byte, diag));
    *text = (char *)bytes;
    return PAL_ERR_OK;
}
