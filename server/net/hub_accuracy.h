/* Accuracy and cost as clients see them (protocol/README.md): the points of the study once, then the estimate of a
 * body at every tick of the hub. Thread: [net]. */
#ifndef PAL_NET_HUB_ACCURACY_H
#define PAL_NET_HUB_ACCURACY_H
#include "server/net/hub_verb.h"

void pal_hub_estimates_due(pal_client *client); /* called at every tick */
bool pal_hub_wants_estimate(const pal_client *client);
pal_packet *pal_hub_next_estimate(pal_client *client); /* NULL: none is due */
/* Errors displayed to clients for the current configuration of a body (from its estimate, else its study) and for the
 * configuration `to` (point: index in the study; -1: the neighbour's point, else the study's). NaN: none is displayed.
 * Both are NaN for a body whose estimate is older than PAL_HUB_ESTIMATE_OLD_S of its steps, or that has woken since. */
void pal_hub_shown_errors(const pal_hub_room *room, int body, int point, const pal_configuration *to, double *now_m,
                          double *then_m);
/* time of a step in the room's study of the point that is a configuration, ms; NaN: none is. [net] */
double pal_hub_study_ms(const pal_hub_room *room, int body, const pal_configuration *of);
#endif
