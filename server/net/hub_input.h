/* Messages from clients. Thread: [net]. */
#ifndef PAL_NET_HUB_INPUT_H
#define PAL_NET_HUB_INPUT_H
#include "server/net/hub_core.h"

/* one whole message, untrusted; hub: a pal_hub, as pal_peer_events.received wants it */
void pal_hub_received(void *hub, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text);
#endif
