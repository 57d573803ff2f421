/* Fields for colouring: subscriptions of clients, and the newest values. Thread: [net]. */
#ifndef PAL_NET_HUB_FIELDS_H
#define PAL_NET_HUB_FIELDS_H
#include "server/net/hub_core.h"

/* false: an error was sent */
bool pal_hub_subscribe_field(pal_client *client, const pal_wire_field_subscription *wanted);
bool pal_hub_wants_field(const pal_client *client);
pal_packet *pal_hub_next_field(pal_client *client); /* NULL: none due */
/* encodes new values; returns the time of the next call, 0: nothing pending */
uint64_t pal_hub_make_fields(pal_hub_room *room, uint64_t now_ns);
#endif
