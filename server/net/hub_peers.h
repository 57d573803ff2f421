/* Operations on a client: send, refuse, drop. Thread: [net]. */
#ifndef PAL_NET_HUB_PEERS_H
#define PAL_NET_HUB_PEERS_H
#include "server/net/hub_core.h"

/* the hub's scratch message, empty but for its type */
pal_control *pal_hub_message(pal_hub *hub, pal_control_type type);
pal_packet *pal_hub_encode(pal_hub *hub, const pal_control *control); /* NULL: encoding failed, logged */
void pal_hub_send(pal_hub *hub, pal_client *client,
                  const pal_control *control); /* queues a message; overflow drops the client */
void pal_hub_send_error(pal_hub *hub, pal_client *client, const char *code, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* closes the connection; the member leaves its room at once, before the socket closes */
void pal_hub_drop(pal_hub *hub, pal_client *client, int code, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void pal_hub_leave_room(pal_hub *hub, pal_client *client);
void pal_hub_members_changed(pal_hub *hub, pal_hub_room *room);
void pal_hub_release_tool(pal_hub_room *room, int tool); /* the tool has no holder any more and leaves the scene */
uint32_t pal_hub_colour(int member);                     /* 0xRRGGBB */
#endif
