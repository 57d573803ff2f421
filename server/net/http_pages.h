/* Responses to HTTP requests: assets, health, readiness, sessions, metrics, viewer files. Thread: [net]. */
#ifndef PAL_NET_HTTP_PAGES_H
#define PAL_NET_HTTP_PAGES_H
#include "server/net/hub_core.h"

void pal_hub_get(void *hub, const pal_request *request, pal_reply *reply); /* a pal_peer_events.get */
#endif
