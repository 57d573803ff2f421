/* ws://: websockets and HTTP on one port, by libwebsockets 4.1.6 (Debian).
 *
 * Measured facts it keeps to: tx_packet_size 1 MiB; no extensions, ever (permessage-deflate can abort
 * the process); one lws_write per writable callback; protocols[0] takes connections without a subprotocol unchecked, so
 * they are denied there; HTTP_CONFIRM_UPGRADE is not handled. Its time limits do not hold for an upgrade to HTTP/2 nor
 * for CONNECT, so every socket has a deadline of its own until it is a websocket. The listening socket is our own and
 * every accepted socket is adopted: so a port in use has a clear sentence, and socket options are set before the first
 * byte. What is received: at most 4096 bytes a message. Browsers: Origin must be this host, and Host a loopback name;
 * where other machines may connect, also an IP address, this machine's name or one that is listed. So no page reaches
 * the server by a foreign name that resolves here (DNS rebinding). */
#include "protocol/ticket.h"
#include "server/base/log.h"
#include "server/net/transport/transport.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <libwebsockets.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

enum { CHUNK = 64 << 10, HEADERS = 4096, SEND_QUEUE = 16 << 10, UNACKED_MS = 15000, DROP_S = 2, BACKLOG = 128 };
/* us; longer than lws keeps an idle connection (keepalive_timeout); three times that while a file is read (test_ws) */
static const lws_usec_t DEADLINE_US = 10000000;
_Static_assert((int)PAL_PACKET_HEADROOM >= LWS_PRE, "a packet has room for the websocket header");

struct pal_transport {
    pal_peer_events events;
    struct lws_vhost *vhost;
    int listen_fd, spare_fd; /* spare: given up to turn a caller away when descriptors run out */
    bool remote, adopted;    /* adopted: lws closes listen_fd with the loop */
    char *hosts;             /* names by which it is reached, "a,b"        */
    uint8_t chunk[LWS_PRE + CHUNK];
};

/* per request and per websocket; lws zeroes and owns them */
typedef struct request {
    pal_packet *body;
    size_t at;
} request;
typedef struct connection {
    pal_peer peer; /* first: the transport's record is found from it */
    struct lws *wsi;
    bool text, open;
    size_t n;
    uint8_t bytes[PAL_CONTROL_IN_MAX];
} connection;

static pal_transport *transport_of(struct lws *wsi)
{
    return lws_vhost_user(lws_get_vhost(wsi));
}

/* ---- who may come ---- */

/* the name of "name", "name:port", "[address]" or "[address]:port", without brackets; false: it is none of them */
static bool name_of_host(const char *host, char *name, size_t cap)
{
    const bool v6 = *host == '[';
    const char *from = host + v6, *end = from + strcspn(from, v6 ? "]" : ":"), *port = end + (v6 && *end);
    if (end == from || (size_t)(end - from) >= cap || (v6 && !*end)) return false;
    memcpy(name, from, (size_t)(end - from));
    name[end - from] = 0;
    return *port == 0 || (*port == ':' && port[1] && !port[1 + strspn(port + 1, "0123456789")]);
}

/* is it one of "a,b,c"? */
static bool is_listed(const char *list, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = list; at && *at; at += strcspn(at, ","), at += *at == ',')
        if (strcspn(at, ",") == n && !strncasecmp(at, name, n)) return true;
    return false;
}

/* A page of a stranger can have any name lead here, but no address and not this machine's own name */
static bool name_allowed(const pal_transport *t, const char *name)
{
    struct in_addr v4;
    struct in6_addr v6;
    char own[256] = "";
    const bool is_v4 = inet_pton(AF_INET, name, &v4) == 1;
    if (!strcasecmp(name, "localhost") || !strcmp(name, "::1") || (is_v4 && ntohl(v4.s_addr) >> 24 == 127)) return true;
    if (!t->remote) return false;
    if (is_v4 || inet_pton(AF_INET6, name, &v6) == 1 || is_listed(t->hosts, name)) return true;
    return !gethostname(own, sizeof own - 1) && own[0] && !strcasecmp(name, own);
}

/* copies the host of the request; false: there is none, it has other than harmless characters, or it is not allowed */
static bool host_allowed(struct lws *wsi, char *host, int cap)
{
    static const char harmless[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_:[]";
    char name[256];
    if (lws_hdr_copy(wsi, host, cap, WSI_TOKEN_HOST) <= 0 || host[strspn(host, harmless)]) return false;
    return name_of_host(host, name, sizeof name) && name_allowed(transport_of(wsi), name);
}

/* native clients send no Origin; a page's must be this very host */
static bool origin_allowed(struct lws *wsi, const char *host)
{
    char origin[256];
    int n = lws_hdr_total_length(wsi, WSI_TOKEN_ORIGIN);
    if (n == 0) return true;
    if (lws_hdr_copy(wsi, origin, sizeof origin, WSI_TOKEN_ORIGIN) <= 0) return false;
    const char *name = !strncmp(origin, "http://", 7) ? origin + 7 : !strncmp(origin, "https://", 8) ? origin + 8 : "";
    return !strcasecmp(name, host);
}

static int deny(struct lws *wsi, unsigned status)
{
    (void)lws_return_http_status(wsi, status, NULL);
    return -1;
}

/* a name by which no browser may come: the words are for whoever has a name of this machine that is not known */
static int deny_host(struct lws *wsi)
{
    (void)lws_return_http_status(wsi, 403, "unknown host name: if it is this server's, give it with --hosts");
    return -1;
}

static int filter_upgrade(struct lws *wsi)
{
    char host[256], path[64];
    if (lws_get_network_wsi(wsi) != wsi) return deny(wsi, 403);
    if (!host_allowed(wsi, host, sizeof host)) return deny_host(wsi);
    if (lws_hdr_copy(wsi, path, sizeof path, WSI_TOKEN_GET_URI) <= 0 || strcmp(path, "/ws")) return deny(wsi, 403);
    return origin_allowed(wsi, host) ? 0 : deny(wsi, 403);
}

/* ---- HTTP ---- */

static int add(struct lws *wsi, const char *name, const char *value, unsigned char **p, unsigned char *end)
{
    return lws_add_http_header_by_name(wsi, (const unsigned char *)name, (const unsigned char *)value,
                                       (int)strlen(value), p, end);
}

static int write_headers(struct lws *wsi, const pal_reply *reply, const char *host, size_t n_body)
{
    unsigned char buffer[LWS_PRE + HEADERS], *start = buffer + LWS_PRE, *p = start, *end = buffer + sizeof buffer - 1;
    char policy[1024];
    snprintf(policy, sizeof policy,
             "default-src 'self'; connect-src 'self' ws://%s wss://%s; worker-src 'self'; img-src 'self' data:; "
             "style-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
             host, host);
    if (lws_add_http_header_status(wsi, (unsigned)reply->status, &p, end)) return 1;
    if (reply->type && add(wsi, "content-type:", reply->type, &p, end)) return 1;
    if (reply->status != 304 && lws_add_http_header_content_length(wsi, n_body, &p, end)) return 1;
    if (reply->caching && add(wsi, "cache-control:", reply->caching, &p, end)) return 1;
    if (reply->etag[0] && add(wsi, "etag:", reply->etag, &p, end)) return 1;
    if (add(wsi, "content-security-policy:", policy, &p, end) ||
        add(wsi, "x-content-type-options:", "nosniff", &p, end) ||
        add(wsi, "referrer-policy:", "no-referrer", &p, end) ||
        add(wsi, "cross-origin-resource-policy:", "same-origin", &p, end))
        return 1;
    return lws_finalize_write_http_header(wsi, start, &p, end);
}

/* does If-None-Match name this tag? */
static bool has_already(struct lws *wsi, const char *etag)
{
    char tags[512];
    if (!etag[0] || lws_hdr_copy(wsi, tags, sizeof tags, WSI_TOKEN_HTTP_IF_NONE_MATCH) <= 0) return false;
    return strstr(tags, etag) != NULL || !strcmp(tags, "*");
}

static int complete(struct lws *wsi)
{
    return lws_http_transaction_completed(wsi) ? -1 : 0;
}

static int begin_reply(struct lws *wsi, request *r, const char *path)
{
    pal_transport *t = transport_of(wsi);
    pal_reply reply;
    char host[256];
    bool head = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    if (lws_get_network_wsi(wsi) != wsi) return -1;
    lws_set_timer_usecs(wsi, DEADLINE_US);
    if (!host_allowed(wsi, host, sizeof host)) return deny_host(wsi);
    if (!head && lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0) return deny(wsi, 405);
    t->events.get(t->events.user, path, &reply);
    size_t n_body = reply.body ? reply.body->n_byte : 0;
    bool same = reply.status == 200 && has_already(wsi, reply.etag);
    if (same) reply.status = 304;
    if (write_headers(wsi, &reply, host, n_body)) {
        pal_packet_drop(reply.body);
        return -1;
    }
    if (same || head || n_body == 0) {
        pal_packet_drop(reply.body);
        return complete(wsi);
    }
    pal_packet_replace(&r->body, reply.body);
    r->at = 0;
    lws_callback_on_writable(wsi);
    return 0;
}

static int continue_reply(struct lws *wsi, request *r)
{
    pal_transport *t = transport_of(wsi);
    if (!r || !r->body) return 0;
    size_t n = r->body->n_byte - r->at;
    bool last = n <= CHUNK;
    if (!last) n = CHUNK;
    memcpy(t->chunk + LWS_PRE, r->body->bytes + r->at, n);
    if (lws_write(wsi, t->chunk + LWS_PRE, n, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) < 0) return -1;
    r->at += n;
    if (last) {
        pal_packet_replace(&r->body, NULL);
        return complete(wsi);
    }
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, 30);
    lws_set_timer_usecs(wsi, 3 * DEADLINE_US);
    lws_callback_on_writable(wsi);
    return 0;
}

static int http_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    request *r = own;
    (void)n_byte;
    switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return deny(wsi, 403); /* no subprotocol, or none we know */
    case LWS_CALLBACK_HTTP:
        return begin_reply(wsi, r, in);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return continue_reply(wsi, r);
    case LWS_CALLBACK_TIMER:
        return -1;
    case LWS_CALLBACK_CLOSED_HTTP:
    case LWS_CALLBACK_HTTP_DROP_PROTOCOL:
        if (r) pal_packet_replace(&r->body, NULL);
        return 0;
    default:
        return 0;
    }
}

/* ---- websocket ---- */

/* ends the callback: closes when the hub or the transport has marked the peer */
static int finish(connection *c)
{
    if (!c->peer.drop_code) return 0;
    lws_close_reason(c->wsi, (enum lws_close_status)c->peer.drop_code, (unsigned char *)c->peer.drop_reason,
                     strlen(c->peer.drop_reason));
    return -1;
}

/* the ticket among the subprotocols that a client offers, cut off in place; "": none */
static const char *ticket_of(char *offered)
{
    char *at = strstr(offered, PAL_TICKET_PREFIX);
    if (!at) return "";
    at += strlen(PAL_TICKET_PREFIX);
    at[strcspn(at, ", ")] = 0;
    return at;
}

static int established(struct lws *wsi, connection *c)
{
    pal_transport *t = transport_of(wsi);
    char argument[64], offered[256] = "";
    const char *session = lws_get_urlarg_by_name(wsi, "session=", argument, sizeof argument);
    (void)lws_hdr_copy(wsi, offered, sizeof offered, WSI_TOKEN_PROTOCOL);
    memset(c, 0, sizeof *c);
    c->wsi = wsi;
    c->peer.ops = &pal_ws_transport;
    c->open = true;
    lws_set_timer_usecs(wsi, LWS_SET_TIMER_USEC_CANCEL);
    lws_get_peer_simple(wsi, c->peer.address, sizeof c->peer.address);
    t->events.opened(t->events.user, &c->peer, session ? session : "", ticket_of(offered));
    return 0;
}

static int received(struct lws *wsi, connection *c, const void *bytes, size_t n_byte)
{
    pal_transport *t = transport_of(wsi);
    if (c->peer.drop_code) return finish(c);
    if (lws_is_first_fragment(wsi)) {
        c->n = 0;
        c->text = !lws_frame_is_binary(wsi);
    }
    size_t rest = lws_remaining_packet_payload(wsi);
    if (n_byte > sizeof c->bytes - c->n || rest > sizeof c->bytes - c->n - n_byte) {
        pal_peer_drop(&c->peer, PAL_WIRE_CLOSE_TOO_BIG, "a message is at most %d bytes", PAL_CONTROL_IN_MAX);
        return finish(c);
    }
    if (n_byte) memcpy(c->bytes + c->n, bytes, n_byte);
    c->n += n_byte;
    if (rest == 0 && lws_is_final_fragment(wsi)) {
        t->events.received(t->events.user, &c->peer, c->bytes, c->n, c->text);
        c->n = 0;
    }
    return finish(c);
}

static int writable(struct lws *wsi, connection *c)
{
    pal_transport *t = transport_of(wsi);
    if (c->peer.drop_code) return finish(c);
    pal_packet *p = t->events.next(t->events.user, &c->peer);
    if (!p) return finish(c);
    int n = lws_write(wsi, p->bytes, p->n_byte, p->text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY);
    pal_packet_drop(p);
    if (n < 0) return -1;
    if (t->events.waiting(t->events.user, &c->peer)) lws_callback_on_writable(wsi);
    return finish(c);
}

static int ws_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    connection *c = own;
    switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return filter_upgrade(wsi);
    case LWS_CALLBACK_ESTABLISHED:
        return established(wsi, c);
    case LWS_CALLBACK_RECEIVE:
        return received(wsi, c, in, n_byte);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return writable(wsi, c);
    case LWS_CALLBACK_CLOSED:
        if (!c->open) return 0;
        c->open = false;
        c->peer.drop_code = c->peer.drop_code ? c->peer.drop_code : PAL_WIRE_CLOSE_NORMAL;
        transport_of(wsi)->events.closed(transport_of(wsi)->events.user, &c->peer);
        return 0;
    default:
        return 0;
    }
}

/* ---- the listening socket ---- */

static void tune(int fd)
{
    int on = 1, low = SEND_QUEUE, unacked_ms = UNACKED_MS;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    /* what is not on the wire yet can still be replaced by something newer */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &low, sizeof low);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &unacked_ms, sizeof unacked_ms);
}

static void accept_all(pal_transport *t)
{
    for (int i = 0; i < BACKLOG; i++) {
        int fd = accept4(t->listen_fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd >= 0) {
            tune(fd);
            struct lws *wsi = lws_adopt_socket_vhost(t->vhost, fd); /* closes it when it cannot */
            if (wsi) lws_set_timer_usecs(wsi, DEADLINE_US);
            continue;
        }
        if (errno == EINTR || errno == ECONNABORTED) continue;
        if ((errno != EMFILE && errno != ENFILE) || t->spare_fd < 0) return;
        close(t->spare_fd);
        fd = accept4(t->listen_fd, NULL, NULL, SOCK_CLOEXEC);
        if (fd >= 0) close(fd);
        t->spare_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    }
}

static int listen_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    (void)own, (void)in, (void)n_byte;
    /* a protocol of ours, not a subprotocol to ask for */
    if (reason == LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION) return deny(wsi, 403);
    if (reason == LWS_CALLBACK_RAW_RX_FILE) accept_all(transport_of(wsi));
    return 0;
}

static const struct lws_protocols protocols[] = {
    {"http", http_callback, sizeof(request), PAL_CONTROL_IN_MAX, 0, NULL, 1 << 20},
    {PAL_PROTOCOL_NAME, ws_callback, sizeof(connection), PAL_CONTROL_IN_MAX, 0, NULL, 1 << 20},
    {"palpate-listen", listen_callback, 0, 0, 0, NULL, 0},
    {NULL, NULL, 0, 0, 0, NULL, 0}};

static const lws_retry_bo_t alive = {.secs_since_valid_ping = 20, .secs_since_valid_hangup = 40};

static pal_err open_socket(pal_transport *t, pal_listen_address *from, pal_diagnostic *diag)
{
    const bool is_v6 = strchr(from->ip, ':') != NULL;
    union {
        struct sockaddr any;
        struct sockaddr_in v4;
        struct sockaddr_in6 v6;
    } address = {.v6 = {.sin6_family = is_v6 ? AF_INET6 : AF_INET}};
    socklen_t n = is_v6 ? sizeof address.v6 : sizeof address.v4;
    in_port_t *port = is_v6 ? &address.v6.sin6_port : &address.v4.sin_port;
    void *ip = is_v6 ? (void *)&address.v6.sin6_addr : (void *)&address.v4.sin_addr;
    char name[INET6_ADDRSTRLEN + 16];
    int on = 1;
    snprintf(name, sizeof name, is_v6 ? "[%s]:%d" : "%s:%d", from->ip, from->port);
    if (from->port < 0 || from->port > UINT16_MAX || inet_pton(address.any.sa_family, from->ip, ip) != 1)
        return PAL_REFUSE(diag, "%s is not an address to listen on", name);
    *port = htons((uint16_t)from->port);
    t->remote = from->remote;
    t->hosts = strdup(from->hosts ? from->hosts : "");
    if (!t->hosts) return PAL_ERR_MEMORY;
    t->spare_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    t->listen_fd = socket(address.any.sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (t->listen_fd < 0) return pal_diagnostic_set(diag, PAL_ERR_IO, "no socket: %s", strerror(errno));
    (void)setsockopt(t->listen_fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(t->listen_fd, &address.any, n) || listen(t->listen_fd, BACKLOG)) {
        if (errno == EADDRINUSE)
            return PAL_REFUSE(
                diag, "%s is in use by another program; choose another port with --port (0: any free one)", name);
        return PAL_REFUSE(diag, "cannot listen on %s: %s", name, strerror(errno));
    }
    if (getsockname(t->listen_fd, &address.any, &n)) return PAL_ERR_IO;
    from->port = ntohs(*port);
    return PAL_ERR_OK;
}

static void ws_close(pal_transport *transport)
{
    if (!transport) return;
    if (!transport->adopted && transport->listen_fd >= 0) close(transport->listen_fd);
    if (transport->spare_fd >= 0) close(transport->spare_fd);
    free(transport->hosts);
    free(transport);
}

static pal_err ws_open(pal_loop *loop, pal_listen_address *address, const pal_peer_events *events, pal_diagnostic *diag,
                       pal_transport **out)
{
    struct lws_context_creation_info info;
    pal_transport *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    t->events = *events;
    t->listen_fd = t->spare_fd = -1;
    pal_err err = open_socket(t, address, diag);
    if (err) return ws_close(t), err;
    memset(&info, 0, sizeof info);
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.vhost_name = "palpate";
    info.server_string = "palpate";
    info.protocols = protocols;
    info.user = t;
    info.timeout_secs = 5;
    info.timeout_secs_ah_idle = 5;
    info.keepalive_timeout = 7;
    info.retry_and_idle_policy = &alive;
    t->vhost = lws_create_vhost(pal_loop_context(loop), &info);
    lws_sock_file_fd_type fd = {.filefd = t->listen_fd};
    if (!t->vhost || !lws_adopt_descriptor_vhost(t->vhost, LWS_ADOPT_RAW_FILE_DESC, fd, "palpate-listen", NULL)) {
        ws_close(t);
        return pal_diagnostic_set(diag, PAL_ERR_IO, "the network context could not listen");
    }
    t->adopted = true;
    *out = t;
    return PAL_ERR_OK;
}

static void ws_ready(pal_peer *peer)
{
    lws_callback_on_writable(((connection *)(void *)peer)->wsi);
}

/* asks for the writable callback, which closes; a peer that takes nothing more is cut off after DROP_S */
static void ws_drop(pal_peer *peer)
{
    connection *c = (connection *)(void *)peer;
    lws_set_timeout(c->wsi, PENDING_TIMEOUT_USER_REASON_BASE, DROP_S);
    lws_callback_on_writable(c->wsi);
}

const pal_transport_ops pal_ws_transport = {true, ws_open, ws_ready, ws_drop, ws_close};
