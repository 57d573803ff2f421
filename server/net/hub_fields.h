/* Fields for colouring at the hub: what a client asks to see, and the newest values of it. Thread: [net]. */
#ifndef PAL_NET_HUB_FIELDS_H
#define PAL_NET_HUB_FIELDS_H
#include "server/net/hub_core.h"

void pal_hub_subscribe_field(pal_hub *hub, pal_client *client, const pal_wire_field_subscription *wanted);
bool pal_hub_wants_field(const pal_client *client);
pal_packet *pal_hub_next_field(pal_hub *hub, pal_client *client); /* NULL: none to be sent now */
/* encodes what is new; the result is when to come again, 0: nothing waits */
uint64_t pal_hub_make_fields(pal_hub *hub, pal_hub_room *room, uint64_t now_ns);
#endif
