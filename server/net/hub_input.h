/* Messages from clients. Thread: [net]. */
#ifndef PAL_NET_HUB_INPUT_H
#define PAL_NET_HUB_INPUT_H
#include "server/net/hub_core.h"

/* handles one whole, untrusted message; hub: a pal_hub (a pal_peer_events.received) */
void pal_hub_received(void *hub, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text);
#endif
