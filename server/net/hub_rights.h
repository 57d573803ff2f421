/* Rights of members: the one table of who may give which command. Thread: [net]. */
#ifndef PAL_NET_HUB_RIGHTS_H
#define PAL_NET_HUB_RIGHTS_H
#include "server/net/hub_core.h"

/* Who may give a command: everybody; trainees; who holds a tool; and, from `steer` on, instructors and the trainees
 * whom an instructor lets. Instructors may give every command. */
typedef enum pal_right {
    PAL_RIGHT_EVERYBODY,
    PAL_RIGHT_TRAINEE,
    PAL_RIGHT_TOOL,
    PAL_RIGHT_STEER,
    PAL_RIGHT_MATERIAL,
    PAL_RIGHT_COMPONENT,
    PAL_RIGHT_CONFIGURE,
    PAL_RIGHT_SCULPT,
    PAL_RIGHT_CUT,
    PAL_RIGHT_INSTRUCTOR,
    PAL_RIGHT_COUNT
} pal_right;
/* bits of rights, 1 << pal_right, as words ("steer sculpt") and back: "" is all of them that a trainee can be given, 0:
 * there is no such right */
void pal_rights_text(uint32_t rights, char *text, size_t cap);
uint32_t pal_rights_named(const char *name);
/* may the client do this now? */
bool pal_hub_may(const pal_client *client, pal_right right);
/* instructors may order what is slower than real time */
bool pal_hub_is_instructor(const pal_client *client);
/* does the session play a recording, so that members give it no input? *playing: where; NULL: not wanted */
bool pal_hub_playing(const pal_hub_room *room, pal_playing *playing);
/* who may, in words: "instructors, and trainees with the right sculpt" */
extern const char *const pal_right_text[PAL_RIGHT_COUNT];
#endif
