/* Relays that a full server or relay names to who only watches: addresses of pages,
 * "https://a.example/,http://b:8092/". One with ?session=NAME shows that session alone. Thread: any. */
#ifndef PAL_NET_TRANSPORT_RELAY_LIST_H
#define PAL_NET_TRANSPORT_RELAY_LIST_H
#include "server/base/err.h"

#include <cjson/cJSON.h>

enum { PAL_RELAY_LIST_MAX = 16 }; /* addresses */

/* NULL and "": none. REFUSED: the first that is no http or https address, or too many; names flag */
pal_err pal_relay_list_check(const char *list, const char *flag, pal_diagnostic *diag);
/* an array of them, which the caller owns; NULL: there are none */
cJSON *pal_relay_list_json(const char *list);
#endif
