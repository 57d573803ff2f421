/* ws://: websockets and HTTP on one port, by libwebsockets 4.1.6 (Debian), with TLS where there is a certificate.
 *
 * Measured facts it keeps to: tx_packet_size 1 MiB; no extensions, ever (permessage-deflate can abort the process); no
 * lws_write after one that was cut short in the same callback; messages of one callback travel as one packet, which
 * costs a tenth less processor time than a packet each. protocols[0] takes connections without a subprotocol unchecked,
 * so they are denied there. It would also make HTTP/2 of an upgrade to h2c and a raw connection of CONNECT: both are
 * answered 400 where it asks. Every socket has a deadline of its own until it is a websocket. What is received: at most
 * 4096 bytes a message. Health and metrics can have a listener of their own, for which some sockets are kept. */
#include "protocol/ticket.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/net/transport/host_name.h"
#include "server/net/transport/listener.h"
#include "server/net/transport/request_rate.h"
#include "server/net/transport/tls_files.h"
#include "server/net/transport/transport.h"
#include "server/net/transport/tuning.h"

#include <libwebsockets.h>
#include <netinet/tcp.h>
#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

enum { CHUNK = 64 << 10, HEADERS = 4096, DROP_S = 2 };
_Static_assert((int)PAL_PACKET_HEADROOM >= LWS_PRE, "a packet has room for the websocket header");

/* a listening socket, and how many it has accepted that are open */
typedef struct pal_listening {
    pal_listener listener;
    bool health, adopted; /* adopted: lws closes the listener's descriptor with the loop */
    int n_socket;
} pal_listening;

struct pal_transport {
    pal_peer_events events;
    struct lws_vhost *vhost;
    pal_listening on[2]; /* the main one, and that of health and metrics */
    bool remote;
    int max_socket;
    char *hosts; /* names by which it is reached, "a,b"        */
    pal_request_rate rate;
    uint8_t chunk[LWS_PRE + CHUNK];
};

/* per request and per websocket; lws zeroes and owns them */
typedef struct request {
    pal_packet *body;
    size_t at;
    bool waits; /* for its turn */
    char path[512];
    /* of a POST, whose headers are gone when its body is here */
    bool posts;
    char host[256], ticket[PAL_TICKET_TEXT], address[46];
    char posted[PAL_POST_MAX];
    size_t n_posted;
} request;
typedef struct connection {
    pal_peer peer; /* first: the transport's record is found from it */
    struct lws *wsi;
    bool text, open;
    size_t n;
    uint8_t bytes[PAL_CONTROL_IN_MAX];
} connection;

/* of a socket that has been adopted; NULL before */
static pal_listening *listening_of(struct lws *wsi)
{
    return lws_get_opaque_user_data(wsi);
}

static pal_transport *transport_of(struct lws *wsi)
{
    return lws_vhost_user(lws_get_vhost(wsi));
}

/* ---- who may come ---- */

/* copies the host of the request; false: there is none, or it is not allowed */
static bool host_allowed(struct lws *wsi, char *host, int cap)
{
    const pal_listening *on = listening_of(wsi);
    if (lws_hdr_copy(wsi, host, cap, WSI_TOKEN_HOST) <= 0) return false;
    return pal_host_allowed(host, transport_of(wsi)->remote || on->health, transport_of(wsi)->hosts);
}

/* native clients send no Origin; a page's must be this very host, and browsers say that it is no other site's */
static bool origin_allowed(struct lws *wsi, const char *host)
{
    char origin[256], site[32];
    if (lws_hdr_custom_copy(wsi, site, sizeof site, "sec-fetch-site:", 15) > 0 && strcmp(site, "same-origin") &&
        strcmp(site, "none"))
        return false;
    if (lws_hdr_total_length(wsi, WSI_TOKEN_ORIGIN) == 0) return true;
    return lws_hdr_copy(wsi, origin, sizeof origin, WSI_TOKEN_ORIGIN) > 0 && pal_origin_allowed(origin, host);
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

/* the ticket of a request; false: it is too long to be one */
static bool bearer_of(struct lws *wsi, char ticket[PAL_TICKET_TEXT])
{
    char header[256];
    ticket[0] = 0;
    if (lws_hdr_total_length(wsi, WSI_TOKEN_HTTP_AUTHORIZATION) <= 0) return true;
    if (lws_hdr_copy(wsi, header, sizeof header, WSI_TOKEN_HTTP_AUTHORIZATION) <= 0) return false;
    if (strncasecmp(header, "bearer ", 7)) return false;
    return snprintf(ticket, PAL_TICKET_TEXT, "%s", header + 7) < PAL_TICKET_TEXT;
}

static int send_reply(struct lws *wsi, request *r, pal_reply *reply, const char *host, bool head, bool same)
{
    size_t n_body = reply->body ? reply->body->n_byte : 0;
    if (same) reply->status = 304;
    if (write_headers(wsi, reply, host, n_body)) {
        pal_packet_drop(reply->body);
        return -1;
    }
    if (same || head || n_body == 0) {
        pal_packet_drop(reply->body);
        return complete(wsi);
    }
    pal_packet_replace(&r->body, reply->body);
    r->at = 0;
    lws_callback_on_writable(wsi);
    return 0;
}

/* of a POST, whose body is not read: the socket closes. One sentence, as the hub answers */
static int deny_post(struct lws *wsi, int status, const char *host, const char *sentence)
{
    char text[128];
    const int n = snprintf(text, sizeof text, "{\"error\":\"%s\"}\n", sentence);
    const pal_reply reply = {.status = status, .type = "application/json", .caching = "no-store"};
    unsigned char buffer[LWS_PRE + sizeof text];
    memcpy(buffer + LWS_PRE, text, (size_t)n);
    if (!write_headers(wsi, &reply, host, (size_t)n))
        (void)lws_write(wsi, buffer + LWS_PRE, (size_t)n, LWS_WRITE_HTTP_FINAL);
    return -1;
}

/* The body of a POST is to follow. A page of another site cannot send one: its Origin is not this host, and JSON it may
 * not send unasked */
static int begin_post(struct lws *wsi, request *r, const char *path)
{
    char type[64] = "", length[64] = "";
    lws_set_timer_usecs(wsi, PAL_SOCKET_DEADLINE_US);
    if (!host_allowed(wsi, r->host, sizeof r->host)) return deny_host(wsi);
    if (!origin_allowed(wsi, r->host)) return deny_post(wsi, 403, r->host, "a page of another site may not ask this");
    (void)lws_hdr_copy(wsi, type, sizeof type, WSI_TOKEN_HTTP_CONTENT_TYPE);
    if (strncasecmp(type, "application/json", 16)) return deny_post(wsi, 415, r->host, "wanted application/json");
    if (lws_hdr_copy(wsi, length, sizeof length, WSI_TOKEN_HTTP_CONTENT_LENGTH) <= 0)
        return deny_post(wsi, 411, r->host, "the length of the body is missing");
    if (strlen(length) > 8 || atol(length) < 1 || atol(length) >= PAL_POST_MAX)
        return deny_post(wsi, 413, r->host, "the body is empty or too long");
    if (strlen(path) >= sizeof r->path) return deny(wsi, 414);
    if (!bearer_of(wsi, r->ticket)) return deny_post(wsi, 401, r->host, "this is not a ticket");
    lws_get_peer_simple(wsi, r->address, sizeof r->address);
    strcpy(r->path, path);
    r->n_posted = 0;
    r->posts = true;
    return 0;
}

static int take_body(struct lws *wsi, request *r, const void *bytes, size_t n_byte)
{
    if (!r || !r->posts || n_byte >= sizeof r->posted - r->n_posted) return deny(wsi, 413);
    memcpy(r->posted + r->n_posted, bytes, n_byte);
    r->n_posted += n_byte;
    return 0;
}

static int answer_post(struct lws *wsi, request *r)
{
    pal_transport *t = transport_of(wsi);
    pal_reply reply;
    if (!r || !r->posts) return -1;
    r->posts = false;
    r->posted[r->n_posted] = 0;
    const pal_request asked = {.path = r->path,
                               .health = listening_of(wsi)->health,
                               .ticket = r->ticket,
                               .address = r->address,
                               .body = r->posted,
                               .n_body = r->n_posted};
    t->events.get(t->events.user, &asked, &reply);
    return send_reply(wsi, r, &reply, r->host, false, false);
}

static int begin_reply(struct lws *wsi, request *r, const char *path)
{
    pal_transport *t = transport_of(wsi);
    pal_reply reply;
    char host[256], ticket[PAL_TICKET_TEXT], address[46] = "";
    bool head = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    lws_set_timer_usecs(wsi, PAL_SOCKET_DEADLINE_US);
    if (!host_allowed(wsi, host, sizeof host)) return deny_host(wsi);
    if (!head && lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0) return deny(wsi, 405);
    if (!bearer_of(wsi, ticket)) return deny(wsi, 401);
    lws_get_peer_simple(wsi, address, sizeof address);
    const pal_request asked = {.path = path, .health = listening_of(wsi)->health, .ticket = ticket, .address = address};
    t->events.get(t->events.user, &asked, &reply);
    return send_reply(wsi, r, &reply, host, head, reply.status == 200 && has_already(wsi, reply.etag));
}
/* a request answers at once, or when its address may make another */
static int request_came(struct lws *wsi, request *r, const char *path)
{
    pal_transport *t = transport_of(wsi);
    char address[46] = "";
    lws_get_peer_simple(wsi, address, sizeof address);
    const uint64_t wait_ns = pal_request_rate_take(&t->rate, address, pal_clock_ns());
    const bool posts = lws_hdr_total_length(wsi, WSI_TOKEN_POST_URI) > 0;
    if (posts && wait_ns > 0) return deny_post(wsi, 429, "", "too many requests: wait a moment");
    if (wait_ns == UINT64_MAX) return deny(wsi, 429);
    if (posts) return begin_post(wsi, r, path);
    if (wait_ns == 0) return begin_reply(wsi, r, path);
    if (strlen(path) >= sizeof r->path) return deny(wsi, 414);
    strcpy(r->path, path);
    r->waits = true;
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, 30);
    lws_set_timer_usecs(wsi, (lws_usec_t)(wait_ns / 1000) + 1);
    return 0;
}

/* a turn that has come, or the end of a socket's time */
static int timer_fired(struct lws *wsi, request *r)
{
    if (!r || !r->waits) return -1;
    r->waits = false;
    return begin_reply(wsi, r, r->path);
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
    lws_set_timer_usecs(wsi, 3 * PAL_SOCKET_DEADLINE_US);
    lws_callback_on_writable(wsi);
    return 0;
}

/* Any upgrade but that to a websocket ends here: the HTTP/2 of this libwebsockets is old. For an unknown one it has
 * answered 403 itself and freed the headers, and would read them again if this returned 0 */
static int confirm_upgrade(struct lws *wsi)
{
    char upgrade[16] = "";
    if (lws_hdr_total_length(wsi, WSI_TOKEN_UPGRADE) <= 0) return -1;
    if (lws_hdr_copy(wsi, upgrade, sizeof upgrade, WSI_TOKEN_UPGRADE) > 0 && !strcasecmp(upgrade, "websocket"))
        return 0;
    return deny(wsi, 400);
}

/* libwebsockets makes a raw connection of CONNECT */
static int refuse_connect(struct lws *wsi)
{
    static const char answer[] = "HTTP/1.1 400 Bad Request\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";
    unsigned char buffer[LWS_PRE + sizeof answer];
    memcpy(buffer + LWS_PRE, answer, sizeof answer);
    (void)lws_write(wsi, buffer + LWS_PRE, sizeof answer - 1, LWS_WRITE_RAW);
    return -1;
}

static int http_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    request *r = own;
    switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return deny(wsi, 403); /* no subprotocol, or none we know */
    case LWS_CALLBACK_HTTP:
        return request_came(wsi, r, in);
    case LWS_CALLBACK_HTTP_BODY:
        return take_body(wsi, r, in, n_byte);
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
        return answer_post(wsi, r);
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return confirm_upgrade(wsi);
    case LWS_CALLBACK_RAW_ADOPT:
        return refuse_connect(wsi);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return continue_reply(wsi, r);
    case LWS_CALLBACK_TIMER:
        return timer_fired(wsi, r);
    case LWS_CALLBACK_WSI_DESTROY:
        if (listening_of(wsi)) listening_of(wsi)->n_socket--;
        return 0;
    case LWS_CALLBACK_CLOSED_HTTP:
    case LWS_CALLBACK_HTTP_DROP_PROTOCOL:
        if (r) pal_packet_replace(&r->body, NULL);
        return 0;
    default:
        return 0;
    }
}

/* ---- websocket ---- */

/* while it is on, small messages wait for those that follow, and go as one packet */
static void cork(struct lws *wsi, int on)
{
    (void)setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_CORK, &on, sizeof on);
}

/* ends the callback: closes when the hub or the transport has marked the peer */
static int finish(connection *c)
{
    if (!c->peer.drop_code) return 0;
    cork(c->wsi, 0);
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

/* what waits goes now; the socket stays corked (tcp(7), TCP_NODELAY), which spares a call for each cycle. What lws
 * sends of its own, pings, waits 0.2 s */
static void push(struct lws *wsi)
{
    const int on = 1;
    (void)setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
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
    cork(wsi, 1);
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

/* messages of one writable callback: those of a cycle and what stands before it */
enum { WRITES = 4 };

static int writable(struct lws *wsi, connection *c)
{
    pal_transport *t = transport_of(wsi);
    if (c->peer.drop_code) return finish(c);
    int n = 0;
    for (int i = 0; i < WRITES && n >= 0 && !lws_partial_buffered(wsi); i++) {
        pal_packet *p = t->events.next(t->events.user, &c->peer);
        if (!p) break;
        n = lws_write(wsi, p->bytes, p->n_byte, p->text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY);
        pal_packet_drop(p);
    }
    push(wsi);
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

/* ---- listening ---- */

static void accept_all(pal_transport *t, pal_listening *on)
{
    const lws_adoption_type kind = LWS_ADOPT_SOCKET | LWS_ADOPT_HTTP | (on->health ? 0 : LWS_ADOPT_ALLOW_SSL);
    for (int fd; (fd = pal_listener_accept(&on->listener)) >= 0;) {
        /* sockets that the health listener keeps for itself */
        if (!on->health && on->n_socket >= t->max_socket - PAL_HEALTH_SOCKETS) {
            close(fd);
            continue;
        }
        const lws_sock_file_fd_type socket = {.sockfd = fd};
        struct lws *wsi = lws_adopt_descriptor_vhost(t->vhost, kind, socket, NULL, NULL); /* closes it when it cannot */
        if (!wsi) continue;
        lws_set_opaque_user_data(wsi, on);
        on->n_socket++;
        lws_set_timer_usecs(wsi, PAL_SOCKET_DEADLINE_US);
    }
}

static int listen_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    (void)own, (void)in, (void)n_byte;
    /* a protocol of ours, not a subprotocol to ask for */
    if (reason == LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION) return deny(wsi, 403);
    if (reason == LWS_CALLBACK_RAW_RX_FILE) accept_all(transport_of(wsi), listening_of(wsi));
    return 0;
}

static const struct lws_protocols protocols[] = {
    {"http", http_callback, sizeof(request), PAL_CONTROL_IN_MAX, 0, NULL, 1 << 20},
    {PAL_PROTOCOL_NAME, ws_callback, sizeof(connection), PAL_CONTROL_IN_MAX, 0, NULL, 1 << 20},
    {"palpate-listen", listen_callback, 0, 0, 0, NULL, 0},
    {NULL, NULL, 0, 0, 0, NULL, 0}};
static const lws_retry_bo_t alive = {.secs_since_valid_ping = 20, .secs_since_valid_hangup = 40};

static void ws_close(pal_transport *t)
{
    if (!t) return;
    for (int k = 0; k < 2; k++) {
        /* lws has closed those that it adopted, with the loop */
        if (t->on[k].adopted) t->on[k].listener.fd = -1;
        pal_listener_close(&t->on[k].listener);
    }
    free(t->hosts);
    free(t);
}

static pal_err listen_on(pal_transport *t, pal_listening *on, const char *ip, int *port, pal_diagnostic *diag)
{
    PAL_TRY(pal_listener_open(&on->listener, ip, port, diag));
    const lws_sock_file_fd_type fd = {.filefd = on->listener.fd};
    struct lws *wsi = lws_adopt_descriptor_vhost(t->vhost, LWS_ADOPT_RAW_FILE_DESC, fd, "palpate-listen", NULL);
    if (!wsi) return pal_diagnostic_set(diag, PAL_ERR_IO, "the network context could not listen");
    lws_set_opaque_user_data(wsi, on);
    on->n_socket++;
    on->adopted = true;
    return PAL_ERR_OK;
}

static pal_err open_vhost(pal_loop *loop, pal_transport *t, const pal_listen_address *address, pal_diagnostic *diag)
{
    struct lws_context_creation_info info = {.port = CONTEXT_PORT_NO_LISTEN_SERVER,
                                             .vhost_name = "palpate",
                                             .server_string = "palpate",
                                             .protocols = protocols,
                                             .user = t,
                                             .timeout_secs = 5,
                                             .timeout_secs_ah_idle = 5,
                                             .keepalive_timeout = 7,
                                             .retry_and_idle_policy = &alive};
    if (address->tls_certificate) {
        info.options = LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
        info.ssl_cert_filepath = address->tls_certificate;
        info.ssl_private_key_filepath = address->tls_key;
        info.ssl_options_set = SSL_OP_NO_TLSv1 | SSL_OP_NO_TLSv1_1;
        info.alpn = "http/1.1";
        PAL_TRY(pal_tls_files_check(address->tls_certificate, address->tls_key, diag));
    }
    t->vhost = lws_create_vhost(pal_loop_context(loop), &info);
    return t->vhost ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_IO, "the network context has no host");
}

static pal_err ws_open(pal_loop *loop, pal_listen_address *address, const pal_peer_events *events, pal_diagnostic *diag,
                       pal_transport **out)
{
    pal_transport *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    t->events = *events;
    t->remote = address->remote;
    t->max_socket = address->max_socket;
    t->hosts = strdup(address->hosts ? address->hosts : "");
    for (int k = 0; k < 2; k++) t->on[k] = (pal_listening){.listener = {-1, -1}, .health = k == 1};
    pal_err err = t->hosts ? open_vhost(loop, t, address, diag) : PAL_ERR_MEMORY;
    if (!err) err = listen_on(t, &t->on[0], address->ip, &address->port, diag);
    if (!err && address->health_ip) err = listen_on(t, &t->on[1], address->health_ip, &address->health_port, diag);
    if (err) return ws_close(t), err;
    *out = t;
    return PAL_ERR_OK;
}

/* an acknowledgement asks whether more may go, and mostly nothing waits: that spares a turn of the loop */
static void ws_ready(pal_peer *peer)
{
    connection *c = (connection *)(void *)peer;
    const pal_transport *t = transport_of(c->wsi);
    if (t->events.waiting(t->events.user, peer)) lws_callback_on_writable(c->wsi);
}

/* asks for the writable callback, which closes; a peer that takes nothing more is cut off after DROP_S */
static void ws_drop(pal_peer *peer)
{
    connection *c = (connection *)(void *)peer;
    lws_set_timeout(c->wsi, PENDING_TIMEOUT_USER_REASON_BASE, DROP_S);
    lws_callback_on_writable(c->wsi);
}

const pal_transport_ops pal_ws_transport = {true, ws_open, ws_ready, ws_drop, ws_close};
