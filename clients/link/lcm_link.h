/* LCM on the event loop of the clients: opened with the checks a rig needs, messages walked before they are decoded.
 *
 * LCM is a bus for one trusted LAN; a forged fragment can crash any of its subscribers, which is why it lives only in
 * palpate-lcm and palpate-bridge. Without a multicast route one warning names the command that adds it and the bus is
 * tried again every 5 s, everything else runs. Thread: [net]. */
#ifndef PAL_LINK_LCM_LINK_H
#define PAL_LINK_LCM_LINK_H
#include "clients/link/link.h"
#include "lcmtypes/lcm_walk.h"
#include "protocol/wire.h"

#include <stddef.h>

#define PAL_LCM_VERSION      1
#define PAL_LCM_PREFIX       "PALPATE1"
#define PAL_LCM_CHANNEL_MAX  63
#define PAL_LCM_DATAGRAM_MAX 65000 /* bytes of a payload that still fits one datagram with its envelope */

typedef struct pal_lcm_link pal_lcm_link;

typedef struct pal_lcm_events {
    /* a message of a subscribed channel that passed the length walk; borrowed for the call */
    void (*message)(void *user, const char *channel, const void *bytes, size_t n_byte);
    /* a message that did not, or whose channel is not plain text; may be NULL */
    void (*refused)(void *user, const char *channel, pal_walk reason);
} pal_lcm_events;

/* url: "udpm://239.255.76.67:7667?ttl=0", "memq://", or "lcm://..." for udpm. REFUSED: not such a URL. A bus that
 * cannot be opened now is not an error (see above). Copies url, borrows loop and events. */
pal_err pal_lcm_link_open(pal_link_loop *loop, const char *url, const pal_lcm_events *events, void *user,
                          pal_diagnostic *diag, pal_lcm_link **out);
void pal_lcm_link_close(pal_lcm_link *link); /* after the loop is destroyed; NULL is fine */
bool pal_lcm_link_is_up(const pal_lcm_link *link);

/* channel is a regular expression of LCM; kept over reopening; at most 8. type: what the walk expects. */
pal_err pal_lcm_link_subscribe(pal_lcm_link *link, const char *channel, const lcm_type_info_t *type);
/* encodes by the type and publishes; STATE: the bus is not up; REFUSED: longer than a datagram; IO */
pal_err pal_lcm_link_publish(pal_lcm_link *link, const char *channel, const lcm_type_info_t *type, const void *message);
/* memq only delivers when asked to; every other bus calls by itself */
void pal_lcm_link_handle(pal_lcm_link *link);

/* "PALPATE1/<session>/<what>/<n>" (n < 0: without) into channel; characters of the session that are not letters,
 * digits, '.', '-' become '_', and it is cut so that the channel fits */
void pal_lcm_channel(char channel[PAL_LCM_CHANNEL_MAX + 1], const char *session, const char *what, int n);
/* n of a channel of exactly that form, else -1 */
int pal_lcm_channel_index(const char *channel, const char *session, const char *what);
#endif
