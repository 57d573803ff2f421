/* News of a room: who is there, and who gave which command. All members get them at most four times a second; the
 * members are encoded once for all. Also how the last orders are taken back, and notices to all. Thread: [net]. */
#ifndef PAL_NET_HUB_NEWS_H
#define PAL_NET_HUB_NEWS_H
#include "server/net/hub_core.h"

/* counts a command as carried out, for the list of orders, and logs it */
void pal_hub_note_order(pal_client *client, const pal_wire_command *command);
/* tells members and orders that have changed, when it is time; the result is when it is next, ns, or 0: nothing */
uint64_t pal_hub_report_news(pal_hub_room *room, uint64_t now_ns);
/* the orders that a client has not been told; NULL: none */
pal_packet *pal_hub_next_orders(pal_client *client);
/* an order of the client takes effect now; this begins what takes it back, of which the caller fills the rest */
pal_hub_undo *pal_hub_undo_begin(pal_client *client, const char *verb);
/* The same where a command of the session takes it back. A member's orders of the same kind within PAL_SLOW_NS are one:
 * the position of a slider */
void pal_hub_undo_by_command(pal_client *client, const char *verb, const pal_command *command);
/* tells every member a sentence under a code, and logs it */
void pal_hub_notice(pal_hub_room *room, const char *code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
#endif
