/* mem:// keeps its peers in a list; closing is done at once. */
#include "server/net/transport/mem_transport.h"

#include "protocol/control.h"

#include <stdlib.h>

struct pal_mem_peer {
    pal_peer peer; /* first: the transport's record is found from it */
    pal_transport *transport;
    pal_packet *fixed; /* what receive returned last */
    bool reported, closed;
    pal_mem_peer *next;
};

struct pal_transport {
    pal_peer_events events;
    pal_mem_peer *first;
};

static pal_err mem_open(pal_loop *loop, const char *url, const pal_peer_events *events, pal_diagnostic *diag,
                        pal_transport **out)
{
    (void)loop, (void)url, (void)diag;
    pal_transport *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    t->events = *events;
    *out = t;
    return PAL_ERR_OK;
}

static void notify_closed(pal_mem_peer *p)
{
    if (p->closed) return;
    p->closed = true;
    p->transport->events.closed(p->transport->events.user, &p->peer);
}

/* a drop may come out of the middle of a hub call, so nothing is told here: the hub knows its own drops */
static void mem_drop(pal_peer *peer)
{
    ((pal_mem_peer *)(void *)peer)->reported = false;
}

static void mem_ready(pal_peer *peer)
{
    ((pal_mem_peer *)(void *)peer)->reported = true;
}

static int mem_port(const pal_transport *transport)
{
    (void)transport;
    return 0;
}

static void mem_close(pal_transport *transport)
{
    if (!transport) return;
    while (transport->first) pal_mem_leave(transport->first);
    free(transport);
}

const pal_transport_ops pal_mem_transport = {"mem", mem_open, mem_port, mem_ready, mem_drop, mem_close};

pal_mem_peer *pal_mem_connect(pal_transport *transport, const char *session)
{
    pal_mem_peer *p = calloc(1, sizeof *p);
    if (!p) return NULL;
    p->peer.ops = &pal_mem_transport;
    p->transport = transport;
    p->next = transport->first;
    transport->first = p;
    transport->events.opened(transport->events.user, &p->peer, session);
    return p;
}

void pal_mem_leave(pal_mem_peer *peer)
{
    pal_mem_peer **at = &peer->transport->first;
    while (*at != peer) at = &(*at)->next;
    *at = peer->next;
    notify_closed(peer);
    pal_packet_drop(peer->fixed);
    free(peer);
}

void pal_mem_send(pal_mem_peer *peer, const void *bytes, size_t n_byte, bool text)
{
    if (peer->peer.drop_code) return;
    if (n_byte > PAL_CONTROL_IN_MAX) {
        pal_peer_drop(&peer->peer, PAL_WIRE_CLOSE_TOO_BIG, "a message is at most %d bytes", PAL_CONTROL_IN_MAX);
        notify_closed(peer);
    } else
        peer->transport->events.received(peer->transport->events.user, &peer->peer, bytes, n_byte, text);
}

const pal_packet *pal_mem_receive(pal_mem_peer *peer)
{
    peer->reported = false;
    pal_packet_replace(&peer->fixed, NULL);
    if (!peer->peer.drop_code) peer->fixed = peer->transport->events.next(peer->transport->events.user, &peer->peer);
    return peer->fixed;
}

void pal_mem_get(pal_transport *transport, const char *path, pal_reply *reply)
{
    transport->events.get(transport->events.user, path, reply);
}

bool pal_mem_is_ready(const pal_mem_peer *peer)
{
    return peer->reported;
}

int pal_mem_code(const pal_mem_peer *peer)
{
    return peer->peer.drop_code;
}

const char *pal_mem_reason(const pal_mem_peer *peer)
{
    return peer->peer.drop_reason;
}
