/* The status of a room: encoded once for all its clients, with the numbers of each put in. Thread: [net]. */
#ifndef PAL_NET_HUB_STATUS_H
#define PAL_NET_HUB_STATUS_H
#include "server/net/hub_core.h"

/* the status of now, or of this tick if another client has had it; NULL: none yet, or out of memory */
pal_packet *pal_hub_next_status(pal_client *client);
#endif
