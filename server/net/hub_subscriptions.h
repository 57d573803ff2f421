/* Which client looks at which field and at which estimate, and what the session computes for them: a field or an
 * estimate that nobody looks at is neither computed nor encoded. Thread: [net]. */
#ifndef PAL_NET_HUB_SUBSCRIPTIONS_H
#define PAL_NET_HUB_SUBSCRIPTIONS_H
#include "server/net/hub_core.h"

/* field NONE: no field of this part any more */
void pal_hub_set_field(pal_client *client, int part, pal_field field);
void pal_hub_set_estimate(pal_client *client, int body, bool wanted);
void pal_hub_unsubscribe_all(pal_client *client);
/* asks the session for what is wanted and not yet requested; a session whose queue is full is asked at the next tick */
void pal_hub_update_subscriptions(pal_hub_room *room);
#endif
