/* Verbs that control a session: pause, resume, step, reset, material. Thread: [net]. */
#ifndef PAL_NET_HUB_STEERING_H
#define PAL_NET_HUB_STEERING_H
#include "server/net/hub_verb.h"

void pal_hub_run_steering(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
void pal_hub_run_reset(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
void pal_hub_run_material(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
#endif
