/* How the last orders of a session are taken back, and notices to all its members. Thread: [net]. */
#ifndef PAL_NET_HUB_UNDO_H
#define PAL_NET_HUB_UNDO_H
#include "server/net/hub_core.h"

/* an order of the client takes effect now; this begins what takes it back, of which the caller fills the rest */
pal_hub_undo *pal_hub_undo_begin(pal_client *client, const char *verb);
/* The same where a command of the session takes it back. A member's orders of the same kind within PAL_SLOW_NS are one:
 * the position of a slider */
void pal_hub_undo_by_command(pal_client *client, const char *verb, const pal_command *command);
/* tells every member a sentence under a code, and logs it */
void pal_hub_notice(pal_hub_room *room, const char *code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
#endif
