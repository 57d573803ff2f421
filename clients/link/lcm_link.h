/* LCM on the clients' event loop. Opening checks the multicast route; every message is sealed when it is sent, and
 * passes admission (lcm_seal.h) and a length check before decoding.
 *
 * LCM is a bus for one trusted LAN: a forged fragment can crash any subscriber. Only palpate-lcm and palpate-bridge
 * use it. Without a multicast route, one warning names the command that adds it, the bus is retried every 5 s, and
 * everything else runs. Thread: [net]. */
#ifndef PAL_LINK_LCM_LINK_H
#define PAL_LINK_LCM_LINK_H
#include "clients/link/link.h"
#include "lcmtypes/lcm_walk.h"
#include "protocol/wire.h"

#include <stddef.h>

#define PAL_LCM_VERSION     1
#define PAL_LCM_PREFIX      "PALPATE1" /* of channels, unless a rig has another */
#define PAL_LCM_PREFIX_MAX  12         /* characters */
#define PAL_LCM_CHANNEL_MAX 63

typedef struct pal_lcm_link pal_lcm_link;

typedef struct pal_lcm_options {
    const char *url;      /* "udpm://239.255.76.67:7667?ttl=0", "memq://", or "lcm://..." for udpm; copied */
    const char *prefix;   /* of its channels, NULL: PAL_LCM_PREFIX; letters, digits, '.', '-' and '_'; copied */
    const char *key_file; /* signs what is published, and takes only what was signed with a key in it (lcm_seal.h).
                             NULL: that of the environment variable PALPATE_LCM_KEY, or none; borrowed for the call */
} pal_lcm_options;

typedef struct pal_lcm_events {
    /* is this channel listened to? Asked first; what is not, is neither checked nor refused. NULL: every subscribed one
     */
    bool (*wants)(void *user, const char *channel);
    /* a message of a subscribed channel that was admitted and passed the length check, without its seal; source: of
     * lcm_seal.h, 0 unknown; borrowed for the call */
    void (*message)(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source);
    /* a message that did not, with the reason in words; may be NULL */
    void (*refused)(void *user, const char *channel, const char *reason);
} pal_lcm_events;

/* REFUSED: URL, prefix or key file. A bus that cannot be opened yet is not an error (see above). Borrows loop and
 * events. */
pal_err pal_lcm_link_open(pal_link_loop *loop, const pal_lcm_options *options, const pal_lcm_events *events, void *user,
                          pal_diagnostic *diag, pal_lcm_link **out);
uint64_t pal_lcm_link_source(const pal_lcm_link *link);    /* of what it publishes (lcm_seal.h) */
const char *pal_lcm_link_prefix(const pal_lcm_link *link); /* of its channels */
bool pal_lcm_link_is_keyed(const pal_lcm_link *link);
void pal_lcm_link_close(pal_lcm_link *link); /* after the loop is destroyed; NULL is fine */

/* channel: an LCM regular expression behind "<prefix>/", kept when the bus reopens; at most 8. type: expected by the
 * length check. */
pal_err pal_lcm_link_subscribe(pal_lcm_link *link, const char *channel, const lcm_type_info_t *type);
/* Encodes by type and publishes on the channel of pal_lcm_channel; a message longer than a datagram goes as fragments,
 * which LCM joins. STATE: the bus is not up; REFUSED: the message has no encoding; MEMORY; IO */
pal_err pal_lcm_link_publish(pal_lcm_link *link, const char *session, const char *what, int n,
                             const lcm_type_info_t *type, const void *message);
/* delivers messages of memq; every other bus delivers by itself */
void pal_lcm_link_handle(pal_lcm_link *link);

/* writes "<prefix>/<session>/<what>/<n>" (n < 0: without n) to channel; session characters other than letters, digits,
 * '.' and '-' become '_', and session is truncated to fit */
void pal_lcm_channel(char channel[PAL_LCM_CHANNEL_MAX + 1], const char *prefix, const char *session, const char *what,
                     int n);
/* n of a channel of exactly that form; else -1 */
int pal_lcm_channel_index(const char *channel, const char *prefix, const char *session, const char *what);
#endif
