/* News of a room: who is there, and who gave which command. All members get them at most four times a second; the
 * members are encoded once for all. Thread: [net]. */
#ifndef PAL_NET_HUB_NEWS_H
#define PAL_NET_HUB_NEWS_H
#include "server/net/hub_core.h"

/* counts a command as carried out, for the list of orders, and logs it */
void pal_hub_note_order(pal_client *client, const pal_wire_command *command);
/* tells members and orders that have changed, when it is time; the result is when it is next, ns, or 0: nothing */
uint64_t pal_hub_report_news(pal_hub_room *room, uint64_t now_ns);
/* the orders that a client has not been told; NULL: none */
pal_packet *pal_hub_next_orders(pal_client *client);
#endif
