/* Messages about the plan and its bodies, and the verb that disables a component. Thread: [net]. */
#ifndef PAL_NET_HUB_PLAN_H
#define PAL_NET_HUB_PLAN_H
#include "server/net/hub_verb.h"

void pal_hub_put_plan(const pal_hub_room *room, pal_wire_plan *out); /* as at open, for hello and topology */
void pal_hub_status_plan(const pal_hub_room *room, const pal_frame *frame, pal_wire_status *out);
void pal_hub_count_unobserved(pal_hub_room *room); /* called at every tick */
/* the world may refuse the command that the client has just given; the answer is sent once the world has reported it */
void pal_hub_await_answer(pal_client *client, const char *verb);
void pal_hub_world_answer(pal_client *client); /* called at every tick */
#endif
