/* Sessions of a hub: those that it was given, and those that instructors open from a folder of scenes and end while
 * others run (`POST /sessions`, protocol/README.md). A thread opens, one at a time, and closes, so that nobody waits
 * for it; it exists from the first of them on. A scene that cannot be opened is listed with the reason, and stops no
 * other. Thread: [net] unless noted. */
#ifndef PAL_NET_HUB_SESSIONS_H
#define PAL_NET_HUB_SESSIONS_H
#include "server/net/hub_core.h"

typedef struct pal_hub_sessions pal_hub_sessions;

/* a session as a room, with its stream; takes what a resumed session borrows. room->own is to be set. [any] */
pal_err pal_hub_room_open(pal_hub *hub, const pal_opened_session *opened, pal_diagnostic *diag, pal_hub_room **out);
void pal_hub_room_close(pal_hub_room *room); /* no client is in it; NULL is fine. [any] */
/* allocates, starts no thread. [load] */
pal_err pal_hub_sessions_create(pal_hub *hub, pal_hub_sessions **out);
/* lists a scene of the start that could not be opened, until it is opened or another one needs its place. [load] */
void pal_hub_sessions_fail(pal_hub_sessions *sessions, const pal_failed_scene *failed);
void pal_hub_sessions_destroy(pal_hub_sessions *sessions); /* waits for what is under way; NULL is fine. [load] */
void pal_hub_sessions_update(pal_hub_sessions *sessions);  /* what has been opened becomes a room */
/* {"open": SCENE} or {"end": SESSION} of a POST; fills *text with one sentence, and returns the HTTP status */
int pal_hub_sessions_post(pal_hub_sessions *sessions, const pal_request *request, char *text, size_t cap);
/* sessions that are being opened, or could not be: calls each with name, scene, and why not (NULL: it is under way) */
void pal_hub_sessions_openings(const pal_hub_sessions *sessions,
                               void (*each)(void *user, const char *name, const char *scene, const char *why_not),
                               void *user);
/* names of the scenes that can be opened */
int pal_hub_sessions_scenes(const pal_hub_sessions *sessions, char (*name)[PAL_NAME], int max);
#endif
