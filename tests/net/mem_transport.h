/* A transport with peers inside the process. The test sends, receives and turns the loop itself, so every run is
 * identical. A peer that does not receive is a stalled client. Thread: [net], the test's. */
#ifndef TESTS_NET_MEM_TRANSPORT_H
#define TESTS_NET_MEM_TRANSPORT_H
#include "protocol/control.h"
#include "server/net/transport/transport.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct pal_mem_peer pal_mem_peer;
struct pal_mem_peer {
    pal_peer peer; /* first: the transport's record is found from it */
    pal_transport *transport;
    pal_packet *fixed; /* what receive returned last */
    bool closed;
    pal_mem_peer *next;
};

struct pal_transport {
    pal_peer_events events;
    pal_mem_peer *first;
};

static inline pal_err mem_open(pal_loop *loop, pal_listen_address *address, const pal_peer_events *events,
                               pal_diagnostic *diag, pal_transport **out)
{
    (void)loop, (void)address, (void)diag;
    pal_transport *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    t->events = *events;
    *out = t;
    return PAL_ERR_OK;
}

static inline void notify_closed(pal_mem_peer *p)
{
    if (p->closed) return;
    p->closed = true;
    p->transport->events.closed(p->transport->events.user, &p->peer);
}

/* nothing to do: the test asks for messages, and the hub knows the peers that it drops */
static inline void mem_ignore(pal_peer *peer)
{
    (void)peer;
}

static inline void pal_mem_leave(pal_mem_peer *peer);

static inline void mem_close(pal_transport *transport)
{
    if (!transport) return;
    while (transport->first) pal_mem_leave(transport->first);
    free(transport);
}

static const pal_transport_ops pal_mem_transport = {false, mem_open, mem_ignore, mem_ignore, mem_close};

/* calls opened before it returns; session "": the first. NULL: out of memory. pal_mem_leave or closing the transport
 * frees the peer. */
static inline pal_mem_peer *pal_mem_connect_from(pal_transport *transport, const char *session, const char *address,
                                                 const char *ticket)
{
    pal_mem_peer *p = calloc(1, sizeof *p);
    if (!p) return NULL;
    p->peer.ops = &pal_mem_transport;
    p->transport = transport;
    p->next = transport->first;
    transport->first = p;
    snprintf(p->peer.address, sizeof p->peer.address, "%s", address);
    transport->events.opened(transport->events.user, &p->peer, session, ticket);
    return p;
}

static inline pal_mem_peer *pal_mem_connect(pal_transport *transport, const char *session)
{
    return pal_mem_connect_from(transport, session, "", "");
}

static inline void pal_mem_leave(pal_mem_peer *peer)
{
    pal_mem_peer **at = &peer->transport->first;
    while (*at != peer) at = &(*at)->next;
    *at = peer->next;
    notify_closed(peer);
    pal_packet_drop(peer->fixed);
    free(peer);
}

/* sends one message to the hub; more than 4096 bytes drop the peer, as in ws. A dropped peer sends nothing. */
static inline void pal_mem_send(pal_mem_peer *peer, const void *bytes, size_t n_byte, bool text)
{
    if (peer->peer.drop_code) return;
    if (n_byte > PAL_CONTROL_IN_MAX) {
        pal_peer_drop(&peer->peer, PAL_WIRE_CLOSE_TOO_BIG, "a message is at most %d bytes", PAL_CONTROL_IN_MAX);
        notify_closed(peer);
    } else
        peer->transport->events.received(peer->transport->events.user, &peer->peer, bytes, n_byte, text);
}

/* next message from the hub or NULL; valid until the next call for this peer */
static inline const pal_packet *pal_mem_receive(pal_mem_peer *peer)
{
    pal_packet_replace(&peer->fixed, NULL);
    if (!peer->peer.drop_code) peer->fixed = peer->transport->events.next(peer->transport->events.user, &peer->peer);
    return peer->fixed;
}

/* response to GET (assets); the caller drops the body */
static inline void pal_mem_get(pal_transport *transport, const char *path, pal_reply *reply)
{
    const pal_request request = {.path = path, .ticket = "", .address = ""};
    transport->events.get(transport->events.user, &request, reply);
}

/* the same for POST with a ticket ("": none), and for GET when body is NULL */
static inline void pal_mem_post(pal_transport *transport, const char *path, const char *ticket, const char *body,
                                pal_reply *reply)
{
    const pal_request request = {
        .path = path, .ticket = ticket, .address = "", .body = body, .n_body = body ? strlen(body) : 0};
    transport->events.get(transport->events.user, &request, reply);
}

/* websocket close code; 0: open */
static inline int pal_mem_code(const pal_mem_peer *peer)
{
    return peer->peer.drop_code;
}

static inline const char *pal_mem_reason(const pal_mem_peer *peer)
{
    return peer->peer.drop_reason;
}
#endif
