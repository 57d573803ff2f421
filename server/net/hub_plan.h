/* Messages about the plan and its bodies, and the verb that disables a component. Thread: [net]. */
#ifndef PAL_NET_HUB_PLAN_H
#define PAL_NET_HUB_PLAN_H
#include "server/net/hub_verb.h"

void pal_hub_hello_components(const pal_hub_room *room, pal_wire_hello *out);
void pal_hub_topology_components(const pal_hub_room *room, pal_wire_topology *out);
void pal_hub_status_plan(const pal_hub_room *room, const pal_frame *frame, pal_wire_status *out);
void pal_hub_count_unobserved(pal_hub_room *room); /* called at every tick */
void pal_hub_run_component(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
/* sends the refusal of the client's last command about a component, once the world has reported it */
void pal_hub_component_result(pal_hub *hub, pal_client *client);
#endif
