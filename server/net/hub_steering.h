/* Playback of a recording in a session (`palpate serve SCENE --replay LOG`): the verbs seek, speed and branch, and what
 * clients are told. A seek is a job that replaces the session by one that goes on from there, at an edit or a switch
 * in the recording too. Thread: [net]. */
#ifndef PAL_NET_HUB_STEERING_H
#define PAL_NET_HUB_STEERING_H
#include "server/net/hub_core.h"

void pal_hub_play_on(pal_hub_room *room); /* past an edit or a switch where the session waits */
void pal_hub_playback_status(const pal_hub_room *room, pal_wire_status *status);
void pal_hub_playback_marks(const pal_hub_room *room, pal_wire_hello *hello);
#endif
