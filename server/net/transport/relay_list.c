#include "server/net/transport/relay_list.h"

#include <stdbool.h>
#include <string.h>

/* the next address and its length; NULL: there is none */
static const char *next(const char **list, size_t *n)
{
    const char *at = *list;
    if (!at || !*at) return NULL;
    *n = strcspn(at, ",");
    *list = at + *n + (at[*n] == ',');
    return at;
}

/* a scheme, a host, and nothing that an address has to write otherwise */
static bool is_address(const char *text, size_t n)
{
    const size_t scheme = !strncmp(text, "http://", 7) ? 7 : !strncmp(text, "https://", 8) ? 8 : 0;
    if (!scheme || n <= scheme || text[scheme] == '/') return false;
    for (size_t i = 0; i < n; i++)
        if (text[i] <= ' ' || text[i] > '~' || strchr("\"<>\\^`{|}#", text[i])) return false;
    return true;
}

pal_err pal_relay_list_check(const char *list, const char *flag, pal_diagnostic *diag)
{
    size_t n = 0;
    int n_address = 0;
    for (const char *at; (at = next(&list, &n)); n_address++)
        if (!is_address(at, n))
            return PAL_REFUSE(diag, "%s: \"%.*s\" is no address as http://host:8092/", flag, (int)(n < 80 ? n : 80),
                              at);
    if (n_address > PAL_RELAY_LIST_MAX)
        return PAL_REFUSE(diag, "%s: %d addresses, more than %d", flag, n_address, PAL_RELAY_LIST_MAX);
    return PAL_ERR_OK;
}

cJSON *pal_relay_list_json(const char *list)
{
    char address[256];
    size_t n = 0;
    cJSON *array = list && *list ? cJSON_CreateArray() : NULL;
    for (const char *at; array && (at = next(&list, &n));) {
        if (n >= sizeof address) continue;
        memcpy(address, at, n), address[n] = 0;
        cJSON_AddItemToArray(array, cJSON_CreateString(address));
    }
    return array;
}
