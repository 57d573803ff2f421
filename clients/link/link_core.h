/* Structs and functions shared by link_peer.c, link_loop.c and link_get.c; private to them. Thread: [net]. */
#ifndef PAL_LINK_LINK_CORE_H
#define PAL_LINK_LINK_CORE_H
#include "clients/link/link.h"
#include "protocol/ticket.h"

#include <libwebsockets.h>
#include <stdatomic.h>

enum { LINK_RX_BYTES = 128 * 1024, LINK_HOST_BYTES = 256, LINK_PATH_BYTES = 256 };

typedef struct link_get link_get;
typedef struct link_watch link_watch;

struct pal_link_timer {
    lws_sorted_usec_list_t sul;
    pal_link_loop *loop;
    pal_link_timer *next;
    uint64_t period_us;
    void (*fn)(void *user);
    void *user;
};

struct pal_link_loop {
    struct lws_context *context;
    struct lws_vhost *vhost;
    atomic_bool stop;
    pal_link *links; /* open and closing */
    pal_link_timer *timers;
    link_get *gets;
    link_watch *watches;
};

/* parts of ws://host, wss://host[:port][/path][?query][#ticket] or http:// */
typedef struct link_address {
    char host[LINK_HOST_BYTES], path[LINK_PATH_BYTES]; /* path and query */
    char ticket[PAL_TICKET_TEXT];                      /* "": none       */
    int port;
    bool tls;
} link_address;
pal_err link_address_parse(const char *url, link_address *out, pal_diagnostic *diag);
/* what both kinds of connection ask for; object: of the callback, wsi: where it is kept */
struct lws_client_connect_info link_connect_info(pal_link_loop *loop, const link_address *to,
                                                 const char *local_protocol, void *object, struct lws **wsi);

/* bytes that come in pieces */
typedef struct link_bytes {
    uint8_t *at;
    size_t n, cap;
} link_bytes;
/* false: more than max in all, or no memory. Memory follows what really came */
bool link_bytes_append(link_bytes *to, const void *bytes, size_t n_byte, size_t max);

/* names of the local protocols; the user data is the connection's own object */
#define LINK_LOCAL_GET   "pal-get"
#define LINK_LOCAL_WATCH "pal-watch"
int link_ws_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len);
int link_get_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len);

bool link_close_all(pal_link_loop *loop); /* closes every connection with 1000; true while a websocket is open */
void link_free_all(pal_link_loop *loop);  /* after the context is destroyed */
void link_get_free_all(pal_link_loop *loop);
#endif
