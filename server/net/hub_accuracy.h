/* What accuracy costs, as clients see it (protocol/README.md): the study's points once, then a body's estimate at every
 * tick of the hub. Thread: [net]. */
#ifndef PAL_NET_HUB_ACCURACY_H
#define PAL_NET_HUB_ACCURACY_H
#include "server/net/hub_verb.h"

#define PAL_HUB_ESTIMATE_OLD_S 1.0 /* of steps awake: an older estimate bounds no switch */

void pal_hub_run_estimate(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
void pal_hub_estimates_due(pal_client *client); /* at every tick */
bool pal_hub_wants_estimate(const pal_client *client);
pal_packet *pal_hub_next_estimate(pal_hub *hub, pal_client *client); /* NULL: none is due */
/* the errors that clients see for the configuration that a body has (its estimate's, else its study's) and for the one
 * that it shall have (point: of the study; -1: its neighbour's, else the study's); NaN: none is shown. Both are NaN for
 * a body whose estimate is older than PAL_HUB_ESTIMATE_OLD_S of its steps, or that has woken since */
void pal_hub_shown_errors(const pal_hub_room *room, int body, int point, const pal_configuration *to, double *now_m,
                          double *then_m);
#endif
