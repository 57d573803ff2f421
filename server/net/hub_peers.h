/* Operations on a client: send, refuse, subscribe, drop. A session neither computes nor encodes a field or an estimate
 * without a subscriber. Thread: [net]. */
#ifndef PAL_NET_HUB_PEERS_H
#define PAL_NET_HUB_PEERS_H
#include "server/net/hub_core.h"

/* the hub's scratch message, empty but for its type */
pal_control *pal_hub_message(pal_hub *hub, pal_control_type type);
pal_packet *pal_hub_encode(pal_hub *hub); /* encodes that message; NULL: failed, logged */
void pal_hub_send(pal_client *client);    /* queues the hub's message; overflow drops the client */
/* queues an error; returns false, so that a function that refuses can return it */
bool pal_hub_refuse(pal_client *client, const char *code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* fields 0: ends the subscription for this part; interior: with the values inside */
void pal_hub_set_fields(pal_client *client, int part, uint32_t fields, bool interior); /* bits 1 << pal_field */
void pal_hub_set_energy(pal_client *client, int part, bool wanted);
void pal_hub_set_estimate(pal_client *client, int body, bool wanted);
/* requests subscribed data from the session; retried at the next tick when its queue is full */
void pal_hub_update_subscriptions(pal_hub_room *room);
/* closes the connection; the member leaves its room at once, before the socket closes */
void pal_hub_drop(pal_client *client, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));
void pal_hub_leave_room(pal_client *client);
/* next client that has joined the room and is not being closed; after NULL: the first; NULL: no more */
pal_client *pal_hub_next_member(const pal_hub_room *room, pal_client *after);
bool pal_hub_only_watches(const pal_client *client);     /* joined as a viewer, which is no member */
void pal_hub_members_changed(pal_hub_room *room);        /* tells the members soon */
void pal_hub_release_tool(pal_hub_room *room, int tool); /* the tool has no holder any more and leaves the scene */
uint32_t pal_hub_colour(int member);                     /* 0xRRGGBB */
#endif
