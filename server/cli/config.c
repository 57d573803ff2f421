/* One table of keys serves the file, the environment, the flags and the manual. */
#include "server/cli/config.h"

#include "server/base/utf8.h"
#include "server/cli/report.h"
#include "server/mesh/files/file_bytes.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FILE_MAX = 1 << 16, VARIABLE = 64, OWN_FLAGS = 40 };
static const char levels[] = "error|warn|info|debug";

const pal_flag pal_config_keys[PAL_CONFIG_KEYS] = {
    {"listen", "ADDRESS", PAL_FLAG_TEXT, NULL, 0, 0, "address to listen on (127.0.0.1)"},
    {"port", "N", PAL_FLAG_COUNT, NULL, 0, 65535, "port; 0 takes any free one (8090)"},
    {"allow_remote", NULL, PAL_FLAG_SWITCH, NULL, 0, 1,
     "let other machines connect: needed for any address but this machine's own"},
    {"hosts", "NAME,...", PAL_FLAG_TEXT, NULL, 0, 0,
     "names by which other machines reach this one (its addresses and its own name)"},
    {"tls_cert", "FILE", PAL_FLAG_TEXT, NULL, 0, 0,
     "certificate, or chain of them, in PEM: serve https and wss (none)"},
    {"tls_key", "FILE", PAL_FLAG_TEXT, NULL, 0, 0, "key of that certificate, in PEM"},
    {"health", "[ADDRESS:]PORT", PAL_FLAG_TEXT, NULL, 0, 0,
     "serve /healthz, /readyz and /metrics there, and only there (on the main port, unless others may connect)"},
    {"open", NULL, PAL_FLAG_SWITCH, NULL, 0, 1,
     "for a demo: whoever connects may be instructor or trainee, take tools, edit and pause (only with a ticket)"},
    {"keys", "FILE", PAL_FLAG_TEXT, NULL, 0, 0, "key file of the tickets that palpate ticket makes (none)"},
    {"viewer", "FOLDER", PAL_FLAG_TEXT, NULL, 0, 0, "files of the page (those beside the program)"},
    {"error_m", "M", PAL_FLAG_NUMBER, NULL, 0, 0.01,
     "most error of streamed positions, m (1/3000 of the box, at most 0.00005)"},
    {"max_clients", "N", PAL_FLAG_COUNT, NULL, 1, 10000, "members at once, who may hold tools or give orders (200)"},
    {"max_viewers", "N", PAL_FLAG_COUNT, NULL, 1, 10000, "viewers at once, counted apart from members (1000)"},
    {"relays", "URL,...", PAL_FLAG_TEXT, NULL, 0, 0,
     "relays to which pages go that only watch and find no place here (none)"},
    {"threads", "N", PAL_FLAG_COUNT, NULL, 1, 64, "threads that share a step, where the scene does not say (1)"},
    {"lcm", "URL", PAL_FLAG_TEXT, NULL, 0, 0, "also speak LCM there, in a process of its own (off)"},
    {"lcm_key", "FILE", PAL_FLAG_TEXT, NULL, 0, 0,
     "key file of that bus: only what is signed with a key in it moves tools (none)"},
    {"lcm_channel", "PREFIX", PAL_FLAG_TEXT, NULL, 0, 0, "of the channels of that bus; one a rig (PALPATE1)"},
    {"log", levels, PAL_FLAG_WORD, NULL, 0, 0, "what is logged (info)"},
    {"record", "FILE", PAL_FLAG_TEXT, NULL, 0, 0, "write the input log there, for palpate replay (off)"},
    {"drain_to", "ADDRESS", PAL_FLAG_TEXT, NULL, 0, 0,
     "where members go when this server ends: that of the server that resumes its sessions, https://b.example/ (off)"},
    {"agones", "PORT", PAL_FLAG_COUNT, NULL, 1, 65535,
     "be an Agones game server: port of its sidecar on this machine (AGONES_SDK_HTTP_PORT, else off)"},
};
/* where a key is stored, in the order of the keys */
static const size_t place[PAL_CONFIG_KEYS] = {
    offsetof(pal_config, listen),      offsetof(pal_config, port),     offsetof(pal_config, allow_remote),
    offsetof(pal_config, hosts),       offsetof(pal_config, tls_cert), offsetof(pal_config, tls_key),
    offsetof(pal_config, health),      offsetof(pal_config, open),     offsetof(pal_config, keys),
    offsetof(pal_config, viewer),      offsetof(pal_config, error_m),  offsetof(pal_config, max_clients),
    offsetof(pal_config, max_viewers), offsetof(pal_config, relays),   offsetof(pal_config, threads),
    offsetof(pal_config, lcm),         offsetof(pal_config, lcm_key),  offsetof(pal_config, lcm_channel),
    offsetof(pal_config, log),         offsetof(pal_config, record),   offsetof(pal_config, drain_to),
    offsetof(pal_config, agones),
};

void pal_config_default(pal_config *config)
{
    *config = (pal_config){
        .listen = "127.0.0.1", .port = 8090, .max_clients = 200, .max_viewers = 1000, .threads = 1, .log = "info"};
}

pal_log_level pal_config_log_level(const pal_config *config)
{
    int level = pal_flag_word(levels, config->log);
    return level < 0 ? PAL_LOG_INFO : (pal_log_level)level;
}

/* PAL_CONFIG_KEYS: unknown */
static size_t find(const char *key)
{
    size_t k = 0;
    while (k < PAL_CONFIG_KEYS && strcmp(pal_config_keys[k].name, key) != 0) k++;
    return k;
}

pal_err pal_config_set(pal_config *config, const char *key, const char *text, const char *where, pal_diagnostic *diag)
{
    size_t k = find(key), n = strlen(text);
    if (k == PAL_CONFIG_KEYS) return PAL_REFUSE(diag, "%s: unknown key", where);
    void *out = (char *)config + place[k];
    PAL_TRY(pal_flag_read(&pal_config_keys[k], text, where, out, diag));
    if (pal_config_keys[k].kind != PAL_FLAG_TEXT && pal_config_keys[k].kind != PAL_FLAG_WORD) return PAL_ERR_OK;
    if (n >= PAL_CONFIG_TEXT)
        return PAL_REFUSE(diag, "%s: %zu bytes of text, more than %d", where, n, PAL_CONFIG_TEXT - 1);
    if (!pal_utf8_all_printable(text, n)) return PAL_REFUSE(diag, "%s: has a control character", where);
    if (out == config->listen && n == 0) return PAL_REFUSE(diag, "%s: is empty", where);
    memcpy(out, text, n + 1);
    return PAL_ERR_OK;
}

/* a value of the file as text; NULL: of the wrong kind, and *fault says so */
static const char *text_of(const cJSON *item, pal_flag_kind kind, char number[32], const char **fault)
{
    if (kind == PAL_FLAG_SWITCH) {
        *fault = "is not true or false";
        return cJSON_IsBool(item) ? cJSON_IsTrue(item) ? "true" : "false" : NULL;
    }
    if (kind == PAL_FLAG_TEXT || kind == PAL_FLAG_WORD) {
        *fault = "is not a text";
        return cJSON_GetStringValue(item);
    }
    *fault = "is not a number";
    snprintf(number, 32, "%.17g", item->valuedouble);
    return cJSON_IsNumber(item) ? number : NULL;
}

static pal_err read_keys(pal_config *config, const char *name, const cJSON *root, pal_diagnostic *diag)
{
    char where[PAL_CONFIG_TEXT], number[32];
    const char *fault;
    if (!cJSON_IsObject(root)) return PAL_REFUSE(diag, "%s: not a JSON object", name);
    for (const cJSON *item = root->child; item; item = item->next) {
        size_t k = find(item->string);
        snprintf(where, sizeof where, "%.180s: %.60s", name, item->string);
        if (k == PAL_CONFIG_KEYS) return PAL_REFUSE(diag, "%s: unknown key", where);
        if (cJSON_GetObjectItemCaseSensitive(root, item->string) != item)
            return PAL_REFUSE(diag, "%s: the key is given twice", where);
        const char *text = text_of(item, pal_config_keys[k].kind, number, &fault);
        if (!text) return PAL_REFUSE(diag, "%s: %s", where, fault);
        PAL_TRY(pal_config_set(config, item->string, text, where, diag));
    }
    return PAL_ERR_OK;
}

pal_err pal_config_parse(pal_config *config, const char *name, const char *json, size_t n_byte, pal_diagnostic *diag)
{
    const char *end = json;
    int line = 1;
    if (n_byte > FILE_MAX) return PAL_REFUSE(diag, "%s: %zu bytes, more than %d", name, n_byte, FILE_MAX);
    cJSON *root = n_byte ? cJSON_ParseWithLengthOpts(json, n_byte, &end, false) : NULL;
    size_t at = end >= json ? (size_t)(end - json) : 0;
    while (root && at < n_byte && strchr(" \t\r\n", json[at])) at++;
    if (!root || at < n_byte) {
        for (size_t k = 0; k < at && k < n_byte; k++) line += json[k] == '\n';
        cJSON_Delete(root);
        return PAL_REFUSE(diag, "%s: line %d: not JSON", name, line);
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
        if (!strcmp(name, "PALPATE_CONFIG") || !strcmp(name, "PALPATE_TICKET") || !strcmp(name, "PALPATE_CA")) continue;
        snprintf(key, sizeof key, "%s", name + sizeof prefix - 1);
        for (char *c = key; *c; c++) *c = (char)tolower((unsigned char)*c);
        PAL_TRY(pal_config_set(&fresh, key, text + 1, name, diag));
    }
    *config = fresh;
    return PAL_ERR_OK;
}

int pal_config_parse_flags(const pal_flag_table *own, pal_config *config, int argc, char **argv,
                           pal_flag_common *common, const char **operand, int *n_operand)
{
    const char *file = getenv("PALPATE_CONFIG"), *given[PAL_CONFIG_KEYS] = {NULL};
    char name[PAL_CONFIG_KEYS][VARIABLE];
    pal_flag all[OWN_FLAGS + PAL_CONFIG_KEYS + 1], *flag = all;
    pal_diagnostic diag = {""};
    for (int k = 0; k < own->n_flag; k++) *flag++ = own->flag[k];
    for (int k = 0; k < PAL_CONFIG_KEYS; k++, flag++) {
        snprintf(name[k], VARIABLE, "--%s", pal_config_keys[k].name);
        for (char *c = name[k]; *c; c++)
            if (*c == '_') *c = '-';
        *flag = pal_config_keys[k];
        flag->name = name[k], flag->kind = PAL_FLAG_TEXT, flag->out = &given[k];
    }
    *flag++ =
        (pal_flag){"--config", "FILE", PAL_FLAG_TEXT, &file, 0, 0, "JSON file of these keys (PALPATE_CONFIG, or none)"};
    pal_flag_table table = *own;
    table.flag = all, table.n_flag = (int)(flag - all);
    table.note =
        "The file and the environment take the same keys (allow_remote, PALPATE_ALLOW_REMOTE). Flags override\n"
        "the environment, the environment overrides the file.\n";
    int code = pal_flags_parse(&table, argc, argv, common, operand, n_operand);
    if (code >= 0) return code;
    pal_config_default(config);
    pal_err err = file && *file ? pal_config_file(config, file, &diag) : PAL_ERR_OK;
    if (!err) err = pal_config_environment(config, environ, &diag);
    if (err) return pal_report_refusal(common, err, &diag);
    /* a bad flag is wrong usage, a bad file or variable is refused input */
    for (int k = 0; k < PAL_CONFIG_KEYS; k++)
        if (given[k] && pal_config_set(config, pal_config_keys[k].name, given[k], name[k], &diag))
            return pal_flags_wrong(common, "%s", diag.text);
    return -1;
}
