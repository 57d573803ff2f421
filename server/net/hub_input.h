/* Messages from clients. A pose of the sender's tool becomes a pal_pose, with PAL_WIRE_POSE_AWAY a release; other
 * flags, angular velocity, force, torque, gripper and model are checked and dropped. Thread: [net]. */
#ifndef PAL_NET_HUB_INPUT_H
#define PAL_NET_HUB_INPUT_H
#include "server/net/hub_core.h"

/* handles one whole, untrusted message; hub: a pal_hub (a pal_peer_events.received) */
void pal_hub_received(void *hub, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text);
#endif
