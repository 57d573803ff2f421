/* Switches and edits that the server itself asks for. Thread: [net]. */
#ifndef PAL_NET_HUB_SWITCH_H
#define PAL_NET_HUB_SWITCH_H
#include "server/net/hub_core.h"

/* Gives a body a configuration, whatever it costs; quality: 1 lowers it, -1 restores it, as the room then counts, 0:
 * neither. false: it cannot be asked for now */
bool pal_hub_switch_to(pal_hub_room *room, int body, const pal_configuration *to, int quality);
bool pal_hub_undo_edit(pal_hub_room *room, int body, bool redo); /* undoes the last edit of a body, or repeats it */
#endif
