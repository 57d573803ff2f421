/* The viewers of a relay: who comes, what each is sent, and the pages beside it. What is kept (relay_kept.h) is shared;
 * a viewer costs its record and its socket. Thread: [net]. */
#ifndef PAL_RELAY_VIEWERS_H
#define PAL_RELAY_VIEWERS_H
#include "clients/relay/relay_pages.h"
#include "server/net/admission/admission.h"
#include "server/net/transport/loop.h"

typedef struct pal_relay_viewers pal_relay_viewers;

/* borrows loop and kept, and listens to the loop. REFUSED: the key file, MEMORY. [load] */
pal_err pal_relay_viewers_create(pal_loop *loop, pal_relay_kept *kept, const pal_relay_options *options,
                                 pal_diagnostic *diag, pal_relay_viewers **out);
void pal_relay_viewers_destroy(pal_relay_viewers *viewers); /* after its transport; NULL is fine. [load] */
void pal_relay_viewers_events(pal_relay_viewers *viewers, pal_peer_events *out); /* for pal_transport_ops.open */
/* closes every viewer with a code and a reason, and lets nobody in any more */
void pal_relay_viewers_end(pal_relay_viewers *viewers, int code, const char *reason);
int pal_relay_viewers_here(const pal_relay_viewers *viewers); /* connections */
int pal_relay_sockets(const pal_relay_options *options);      /* that a loop needs for so many */

const pal_relay_counts *pal_relay_viewers_count(const pal_relay_viewers *viewers);
#endif
