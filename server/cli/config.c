/* One table of settings serves the file, the environment, the flags and the manual. */
#include "server/cli/config.h"

#include "server/base/utf8.h"
#include "server/mesh/files/file_bytes.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FILE_MAX = 1 << 16, VARIABLE = 64 };
#define PLACE(field) offsetof(pal_config, field), sizeof(((pal_config *)0)->field)

static const pal_config_key setting[] = {
    {"listen", "ADDRESS", PAL_CONFIG_KEY_TEXT, PLACE(listen), 0, 0, "address to listen on (127.0.0.1)"},
    {"port", "N", PAL_CONFIG_KEY_INT, PLACE(port), 0, 65535, "port; 0 takes any free one (8090)"},
    {"allow_remote", "BOOL", PAL_CONFIG_KEY_BOOL, PLACE(allow_remote), 0, 1,
     "let other machines connect: needed for any address but this machine's own"},
    {"viewer", "FOLDER", PAL_CONFIG_KEY_TEXT, PLACE(viewer), 0, 0, "files of the page (those beside the program)"},
    {"error_m", "M", PAL_CONFIG_KEY_NUMBER, PLACE(error_m), 0, 0.01,
     "most error of streamed positions, m (1/3000 of the box, at most 0.00005)"},
    {"max_clients", "N", PAL_CONFIG_KEY_INT, PLACE(max_clients), 1, 10000, "clients at once (200)"},
    {"lcm", "URL", PAL_CONFIG_KEY_TEXT, PLACE(lcm), 0, 0, "also speak LCM there, in a process of its own (off)"},
    {"log", "LEVEL", PAL_CONFIG_KEY_TEXT, PLACE(log), 0, 0, "error, warn, info or debug (info)"},
    {"record", "FILE", PAL_CONFIG_KEY_TEXT, PLACE(record), 0, 0, "write the input log there, for palpate replay (off)"},
};
enum { N_SETTING = sizeof setting / sizeof setting[0] };
static const char *const level_name[] = {"error", "warn", "info", "debug"};

const pal_config_key *pal_config_keys(int *n)
{
    *n = N_SETTING;
    return setting;
}

void pal_config_default(pal_config *config)
{
    *config = (pal_config){.listen = "127.0.0.1", .port = 8090, .max_clients = 200, .log = "info"};
}

pal_log_level pal_config_log_level(const pal_config *config)
{
    for (int k = 0; k < 4; k++)
        if (!strcmp(config->log, level_name[k])) return (pal_log_level)k;
    return PAL_LOG_INFO;
}

static const pal_config_key *find(const char *key)
{
    for (int k = 0; k < N_SETTING; k++)
        if (!strcmp(setting[k].key, key)) return &setting[k];
    return NULL;
}

static pal_err set_text(pal_config *config, const pal_config_key *s, const char *text, const char *where,
                        pal_diagnostic *diag)
{
    uint32_t code;
    size_t n = strlen(text);
    if (n >= s->n_byte && strcmp(s->key, "log") != 0)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %zu bytes of text, more than %zu", where, n,
                                  s->n_byte - 1);
    for (size_t k = 0; k < n;) {
        int size = pal_utf8_next(text + k, n - k, &code);
        if (size == 0 || !pal_utf8_printable(code))
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: has a control character", where);
        k += (size_t)size;
    }
    if (!strcmp(s->key, "log")) {
        bool known = false;
        for (int k = 0; k < 4; k++) known = known || !strcmp(text, level_name[k]);
        if (!known)
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: \"%.20s\" is not error, warn, info or debug", where,
                                      text);
    }
    if (!strcmp(s->key, "listen") && n == 0) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: is empty", where);
    memcpy((char *)config + s->offset, text, n + 1);
    return PAL_ERR_OK;
}

static pal_err set_number(pal_config *config, const pal_config_key *s, double number, const char *where,
                          pal_diagnostic *diag)
{
    void *place = (char *)config + s->offset;
    if (!(number >= s->low && number <= s->high))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.15g is outside %g .. %g", where, number, s->low,
                                  s->high);
    if (s->kind == PAL_CONFIG_KEY_INT && number != floor(number))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %.15g is not a whole number", where, number);
    if (s->kind == PAL_CONFIG_KEY_INT)
        *(int *)place = (int)number;
    else
        *(double *)place = number;
    return PAL_ERR_OK;
}

pal_err pal_config_set(pal_config *config, const char *key, const char *text, const char *where, pal_diagnostic *diag)
{
    const pal_config_key *s = find(key);
    if (!s) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: unknown key", where);
    if (s->kind == PAL_CONFIG_KEY_TEXT) return set_text(config, s, text, where, diag);
    if (s->kind == PAL_CONFIG_KEY_BOOL) {
        bool yes = !strcmp(text, "true") || !strcmp(text, "1"), no = !strcmp(text, "false") || !strcmp(text, "0");
        if (!yes && !no)
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: \"%.40s\" is not true or false", where, text);
        *(bool *)((char *)config + s->offset) = yes;
        return PAL_ERR_OK;
    }
    char *end;
    double number = strtod(text, &end);
    if (end == text || *end || isspace((unsigned char)*text))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: \"%.40s\" is not a number", where, text);
    return set_number(config, s, number, where, diag);
}

static pal_err set_json(pal_config *config, const pal_config_key *s, const cJSON *item, const char *where,
                        pal_diagnostic *diag)
{
    switch (s->kind) {
    case PAL_CONFIG_KEY_TEXT:
        if (!cJSON_IsString(item)) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: is not a text", where);
        return set_text(config, s, item->valuestring, where, diag);
    case PAL_CONFIG_KEY_BOOL:
        if (!cJSON_IsBool(item)) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: is not true or false", where);
        *(bool *)((char *)config + s->offset) = cJSON_IsTrue(item);
        return PAL_ERR_OK;
    case PAL_CONFIG_KEY_INT:
    case PAL_CONFIG_KEY_NUMBER:
        break;
    }
    if (!cJSON_IsNumber(item)) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: is not a number", where);
    return set_number(config, s, item->valuedouble, where, diag);
}

static pal_err read_keys(pal_config *config, const char *name, const cJSON *root, pal_diagnostic *diag)
{
    char where[PAL_CONFIG_TEXT];
    if (!cJSON_IsObject(root)) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: not a JSON object", name);
    for (const cJSON *item = root->child; item; item = item->next) {
        const pal_config_key *s = find(item->string);
        snprintf(where, sizeof where, "%.180s: %.60s", name, item->string);
        if (!s) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: unknown key", where);
        if (cJSON_GetObjectItemCaseSensitive(root, item->string) != item)
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: the key is given twice", where);
        PAL_TRY(set_json(config, s, item, where, diag));
    }
    return PAL_ERR_OK;
}

pal_err pal_config_parse(pal_config *config, const char *name, const char *json, size_t n_byte, pal_diagnostic *diag)
{
    const char *end = json;
    int line = 1;
    if (n_byte > FILE_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %zu bytes, more than %d", name, n_byte, FILE_MAX);
    cJSON *root = n_byte ? cJSON_ParseWithLengthOpts(json, n_byte, &end, false) : NULL;
    size_t at = end >= json ? (size_t)(end - json) : 0;
    while (root && at < n_byte && strchr(" \t\r\n", json[at])) at++;
    if (!root || at < n_byte) {
        for (size_t k = 0; k < at && k < n_byte; k++) line += json[k] == '\n';
        cJSON_Delete(root);
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: line %d: not JSON", name, line);
    }
    pal_config fresh = *config;
    pal_err err = read_keys(&fresh, name, root, diag);
    cJSON_Delete(root);
    if (!err) *config = fresh;
    return err;
}

pal_err pal_config_file(pal_config *config, const char *path, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, FILE_MAX, &bytes, &n_byte, diag));
    pal_err err = pal_config_parse(config, path, (const char *)bytes, n_byte, diag);
    free(bytes);
    return err;
}

pal_err pal_config_environment(pal_config *config, char *const *variable, pal_diagnostic *diag)
{
    static const char prefix[] = "PALPATE_";
    pal_config fresh = *config;
    for (; *variable; variable++) {
        const char *text = strchr(*variable, '=');
        char name[VARIABLE], key[VARIABLE];
        if (!text || strncmp(*variable, prefix, sizeof prefix - 1) != 0) continue;
        snprintf(name, sizeof name, "%.*s", (int)(text - *variable), *variable);
        if (!strcmp(name, "PALPATE_CONFIG")) continue;
        snprintf(key, sizeof key, "%s", name + sizeof prefix - 1);
        for (char *c = key; *c; c++) *c = (char)tolower((unsigned char)*c);
        PAL_TRY(pal_config_set(&fresh, key, text + 1, name, diag));
    }
    *config = fresh;
    return PAL_ERR_OK;
}
