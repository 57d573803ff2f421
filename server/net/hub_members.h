/* Members of a room and their tools: joining, taking and giving. Thread: [net]. */
#ifndef PAL_NET_HUB_MEMBERS_H
#define PAL_NET_HUB_MEMBERS_H
#include "server/net/hub_core.h"

void pal_hub_join(pal_client *client, const pal_wire_join *wanted);
/* tool: index or PAL_WIRE_TOOL_ANY; sends why not. true: the client holds it */
bool pal_hub_take_tool(pal_client *client, int tool);
/* gives the client's tool back, if it holds one, and ends its waiting for one */
void pal_hub_give_tool_back(pal_client *client);
/* Gives a tool that nobody has moved for PAL_IDLE_NS to the client of its room that has waited longest for any tool. A
 * client waits from the refusal of PAL_WIRE_TOOL_ANY until it gets or releases a tool. */
void pal_hub_hand_over_idle_tools(pal_hub *hub);
#endif
