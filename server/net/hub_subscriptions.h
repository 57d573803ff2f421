/* Subscriptions of clients to fields and estimates. A session neither computes nor encodes a field or an estimate
 * without a subscriber. Thread: [net]. */
#ifndef PAL_NET_HUB_SUBSCRIPTIONS_H
#define PAL_NET_HUB_SUBSCRIPTIONS_H
#include "server/net/hub_core.h"

/* field NONE: ends the subscription for this part */
void pal_hub_set_field(pal_client *client, int part, pal_field field);
void pal_hub_set_estimate(pal_client *client, int body, bool wanted);
void pal_hub_unsubscribe_all(pal_client *client);
/* requests subscribed data from the session; retried at the next tick when its queue is full */
void pal_hub_update_subscriptions(pal_hub_room *room);
#endif
