/* Verbs that switch the configuration of a body. Thread: [net]. */
#ifndef PAL_NET_HUB_SWITCH_H
#define PAL_NET_HUB_SWITCH_H
#include "server/net/hub_verb.h"

void pal_hub_run_switch(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
#endif
