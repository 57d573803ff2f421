/* The transport interface. A transport carries whole messages between a peer and the hub without interpreting them.
 *
 * Sending is pull-based: the hub signals that messages wait (ready), and the transport asks for one (next) whenever
 * the peer can take one. A transport therefore queues nothing, and each message is chosen at the last moment: control
 * first, then the newest frame. Thread: [net]. */
#ifndef PAL_NET_TRANSPORT_TRANSPORT_H
#define PAL_NET_TRANSPORT_TRANSPORT_H
#include "server/net/transport/loop.h"
#include "server/net/transport/packet.h"

typedef struct pal_transport pal_transport;
typedef struct pal_transport_ops pal_transport_ops;

enum { PAL_PEER_REASON = 124 }; /* a websocket close reason holds 123 bytes */

/* one connection; a transport embeds it in its own struct */
typedef struct pal_peer {
    const pal_transport_ops *ops;
    void *client;     /* the hub's data; NULL after closed or when refused */
    char address[46]; /* IP address from which it comes; "": none */
    int drop_code;    /* nonzero: closing with this code, nothing more is sent or received */
    char drop_reason[PAL_PEER_REASON];
} pal_peer;

/* an HTTP response */
typedef struct pal_reply {
    int status;
    const char *type;    /* content type */
    const char *caching; /* cache-control */
    char etag[48];       /* quoted; "": none */
    pal_packet *body;    /* owned by the transport; NULL: none */
} pal_reply;

/* an HTTP request */
typedef struct pal_request {
    const char *path;
    bool health;         /* asked on the listener of health and metrics */
    const char *ticket;  /* of the header Authorization: Bearer; "": none */
    const char *address; /* IP address from which it comes; "": none */
    const char *body;    /* of a POST, JSON [n_body]; NULL: a GET */
    size_t n_body;
} pal_request;

/* callbacks of the hub */
typedef struct pal_peer_events {
    /* a peer connected for a session ("": the first) with a ticket ("": none); may drop it at once */
    void (*opened)(void *user, pal_peer *peer, const char *session, const char *ticket);
    /* one whole message; n_byte <= 4096 (the transport drops longer ones with 1009) */
    void (*received)(void *user, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text);
    bool (*waiting)(void *user, const pal_peer *peer); /* would next return a message? */
    pal_packet *(*next)(void *user, pal_peer *peer);   /* message to send now, owned by the transport; NULL: none */
    void (*closed)(void *user, pal_peer *peer);        /* once for every opened */
    /* a GET or POST: fills *reply; never serves data of other members */
    void (*get)(void *user, const pal_request *request, pal_reply *reply);
    void *user;
} pal_peer_events;

/* where to listen */
typedef struct pal_listen_address {
    const char *ip;    /* "127.0.0.1", "::1" */
    int port;          /* 0: any, and open sets the one chosen */
    bool remote;       /* other machines may connect: Host may also be an IP address, this machine's name, or */
    const char *hosts; /* one of these, "a,b"; NULL: none */
    int max_socket;    /* of the loop */
    const char *tls_certificate, *tls_key; /* PEM files; NULL: no TLS */
    const char *health_ip;                 /* of a listener for health and metrics alone, without TLS; NULL: none */
    int health_port;                       /* 0: any, and open sets the one chosen */
} pal_listen_address;

struct pal_transport_ops {
    bool sockets; /* needs a loop with sockets */
    /* copies events. REFUSED: names address and reason. [load] */
    pal_err (*open)(pal_loop *loop, pal_listen_address *address, const pal_peer_events *events, pal_diagnostic *diag,
                    pal_transport **out);
    void (*ready)(pal_peer *peer);           /* next may have a message; asks waiting */
    void (*drop)(pal_peer *peer);            /* drop_code is set: close as soon as possible */
    void (*close)(pal_transport *transport); /* after pal_loop_shut; closes the remaining peers. [load] */
};

/* websockets; LCM peers use clients/lcm_bridge, which speaks ws. Tests have one without sockets
 * (tests/net/mem_transport.h) */
extern const pal_transport_ops pal_ws_transport;

/* marks a peer for closing with a websocket close code and a reason of at most 123 bytes; the first mark wins */
void pal_peer_drop(pal_peer *peer, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));
#endif
