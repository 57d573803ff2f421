/* Watches the pace of sessions. An order after which a session stays slower than real time by more than PAL_SLOW_MAX
 * is taken back, where its steps take as much of the processor. A scene with the key keep_real_time gives up accuracy
 * before it gives up time: the next cheaper configuration of its study, or a coarser one, and back when there is time
 * to spare. Members are told. Thread: [net].
 */
#ifndef PAL_NET_HUB_WATCH_H
#define PAL_NET_HUB_WATCH_H
#include "server/net/hub_core.h"

void pal_hub_watch_pace(pal_hub_room *room); /* called at every tick */
bool pal_hub_is_alive(const pal_hub *hub);   /* does every simulation step? */
#endif
