#include "tests/rig/tcp_proxy.h"

#include "tests/rig/tuning.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* one direction of a connection */
typedef struct tcp_stream {
    network_flow flow;
    network_queue queue;
    int from, to;
    size_t n_written; /* of the first packet */
    bool ended;       /* no more is read: the end of the stream is on its way */
    bool given_up;    /* the path gave a segment up: at network_ready_ns the connection is reset */
    bool done;        /* the receiver has the end of the stream */
    bool blocked;     /* the receiver has no room */
} tcp_stream;

typedef struct tcp_connection {
    tcp_stream stream[2]; /* to the server, from it */
    int client, server;   /* client -1: this place is free */
    bool connected;
} tcp_connection;

struct tcp_proxy {
    network_path *path[2];
    rig_lateness *lateness;
    struct sockaddr_in server;
    int listener, port, n_accepted, n_refused;
    tcp_connection connection[TCP_PROXY_CONNECTIONS];
};

static bool tcp_port(const char *text, long min, uint16_t *out)
{
    char *end;
    const long port = strtol(text, &end, 10);
    if (end == text || *end || port < min || port > 65535) return false;
    *out = (uint16_t)port;
    return true;
}

static pal_err tcp_route(const char *route, uint16_t *port, struct sockaddr_in *server, pal_diagnostic *diag)
{
    char text[64];
    uint16_t server_port;
    if (strlen(route) < sizeof text) {
        strcpy(text, route);
        char *host = strchr(text, ':'), *last = strrchr(text, ':');
        if (host && last > host) {
            *host = *last = 0;
            server->sin_family = AF_INET;
            if (tcp_port(text, 0, port) && tcp_port(last + 1, 1, &server_port) &&
                inet_pton(AF_INET, host + 1, &server->sin_addr) == 1) {
                server->sin_port = htons(server_port);
                return PAL_ERR_OK;
            }
        }
    }
    return PAL_REFUSE(diag, "--tcp \"%.60s\" is not PORT:ADDRESS:PORT, as 9090:127.0.0.1:8090", route);
}

/* segments of the size that the path has, and little room for what has not left yet */
static void tcp_prepare(int fd)
{
    const int segment = RIG_SEGMENT, room = RIG_RECEIVE_BUFFER, on = 1;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_MAXSEG, &segment, sizeof segment);
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

pal_err tcp_proxy_open(const char *route, network_path *up, network_path *down, rig_lateness *lateness,
                       pal_diagnostic *diag, tcp_proxy **out)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)}, server = {0};
    uint16_t port = 0;
    PAL_TRY(tcp_route(route, &port, &server, diag));
    tcp_proxy *p = calloc(1, sizeof *p);
    if (!p) return PAL_ERR_MEMORY;
    *p = (tcp_proxy){.path = {up, down}, .lateness = lateness, .server = server};
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) p->connection[i].client = -1;
    at.sin_port = htons(port);
    p->listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const int on = 1;
    (void)setsockopt(p->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (p->listener >= 0) tcp_prepare(p->listener);
    socklen_t size = sizeof at;
    if (p->listener < 0 || bind(p->listener, (struct sockaddr *)&at, size) ||
        listen(p->listener, TCP_PROXY_CONNECTIONS) || getsockname(p->listener, (struct sockaddr *)&at, &size)) {
        const pal_err err = pal_diagnostic_set(diag, PAL_ERR_IO, "port %u: %s", port, strerror(errno));
        tcp_proxy_close(p);
        return err;
    }
    p->port = ntohs(at.sin_port);
    *out = p;
    return PAL_ERR_OK;
}

/* reset: the peers see that the connection broke, not that it ended */
static void tcp_end(tcp_connection *c, bool reset)
{
    const struct linger now = {.l_onoff = 1};
    for (int d = 0; d < 2; d++) {
        if (reset) (void)setsockopt(c->stream[d].from, SOL_SOCKET, SO_LINGER, &now, sizeof now);
        close(c->stream[d].from);
        network_queue_clear(&c->stream[d].queue);
    }
    c->client = -1;
}

void tcp_proxy_close(tcp_proxy *p)
{
    if (!p) return;
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++)
        if (p->connection[i].client >= 0) tcp_end(&p->connection[i], false);
    if (p->listener >= 0) close(p->listener);
    free(p);
}

static bool tcp_may_send(const tcp_stream *s, uint64_t now_ns)
{
    return !s->ended && !s->given_up && s->queue.n_byte < RIG_WINDOW && network_ready_ns(&s->flow) <= now_ns;
}

int tcp_proxy_watch(const tcp_proxy *p, uint64_t now_ns, struct pollfd *fd)
{
    int n = 0;
    bool room = false;
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) room = room || p->connection[i].client < 0;
    if (room) fd[n++] = (struct pollfd){.fd = p->listener, .events = POLLIN};
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) {
        const tcp_connection *c = &p->connection[i];
        for (int d = 0; d < 2 && c->client >= 0; d++) {
            /* the other direction writes to where this one reads */
            const bool reads = c->connected && tcp_may_send(&c->stream[d], now_ns);
            const bool writes = c->stream[1 - d].blocked || (d == 1 && !c->connected);
            const short events = (short)((reads ? POLLIN : 0) | (writes ? POLLOUT : 0));
            /* without events poll would still return for an error, again and again: it is seen when there is traffic */
            if (events) fd[n++] = (struct pollfd){.fd = c->stream[d].from, .events = events};
        }
    }
    return n;
}

uint64_t tcp_proxy_next_ns(const tcp_proxy *p, uint64_t now_ns)
{
    uint64_t next = NETWORK_LOST;
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) {
        const tcp_connection *c = &p->connection[i];
        for (int d = 0; d < 2 && c->client >= 0; d++) {
            const tcp_stream *s = &c->stream[d];
            const uint64_t arrival = s->blocked ? NETWORK_LOST : network_queue_next_ns(&s->queue);
            const uint64_t ready = network_ready_ns(&s->flow);
            if (arrival < next) next = arrival;
            if (ready > now_ns && ready < next) next = ready;
        }
    }
    return next;
}

static void tcp_accept(tcp_proxy *p)
{
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) {
        tcp_connection *c = &p->connection[i];
        if (c->client >= 0) continue;
        const int client = accept4(p->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (client < 0) return;
        const int server = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        p->n_accepted++;
        tcp_prepare(client);
        if (server >= 0) tcp_prepare(server);
        if (server < 0 ||
            (connect(server, (const struct sockaddr *)&p->server, sizeof p->server) && errno != EINPROGRESS)) {
            if (server >= 0) close(server);
            close(client);
            p->n_refused++;
            continue;
        }
        *c = (tcp_connection){.client = client, .server = server};
        for (int d = 0; d < 2; d++)
            c->stream[d] = (tcp_stream){.flow = network_flow_make(p->path[d]),
                                        .from = d == 0 ? client : server,
                                        .to = d == 0 ? server : client};
    }
}

/* false: the connection broke */
static bool tcp_read(tcp_stream *s, uint64_t now_ns)
{
    uint8_t bytes[RIG_SEGMENT];
    while (tcp_may_send(s, now_ns)) {
        const ssize_t n = read(s->from, bytes, sizeof bytes);
        if (n < 0) return errno == EAGAIN || errno == EINTR;
        s->ended = n == 0;
        const uint64_t arrival = network_send_segment(&s->flow, now_ns, (size_t)n);
        s->given_up = arrival == NETWORK_LOST;
        if (!s->given_up && network_queue_add(&s->queue, arrival, s->to, bytes, (size_t)n)) return false;
    }
    return !s->given_up || now_ns < network_ready_ns(&s->flow);
}

/* false: the connection broke */
static bool tcp_write(tcp_stream *s, uint64_t now_ns, rig_lateness *lateness)
{
    s->blocked = false;
    while (network_queue_next_ns(&s->queue) <= now_ns) {
        const network_packet *packet = s->queue.first;
        if (packet->n_byte == 0) {
            (void)shutdown(s->to, SHUT_WR);
            s->done = true;
        } else {
            const ssize_t n = send(s->to, packet->bytes + s->n_written, packet->n_byte - s->n_written, MSG_NOSIGNAL);
            if (n < 0 && errno != EAGAIN && errno != EINTR) return false;
            if (n > 0) s->n_written += (size_t)n;
            s->blocked = s->n_written < packet->n_byte;
            if (s->blocked) return true;
        }
        rig_lateness_add(lateness, packet->arrival_ns, now_ns);
        s->n_written = 0;
        network_queue_remove_first(&s->queue);
    }
    return true;
}

/* 1: connected, 0: not yet, -1: refused */
static int tcp_connected(const tcp_connection *c)
{
    struct pollfd fd = {.fd = c->server, .events = POLLOUT};
    int error = 0;
    socklen_t size = sizeof error;
    if (poll(&fd, 1, 0) <= 0) return 0;
    return getsockopt(c->server, SOL_SOCKET, SO_ERROR, &error, &size) || error ? -1 : 1;
}

void tcp_proxy_run(tcp_proxy *p, uint64_t now_ns)
{
    tcp_accept(p);
    for (int i = 0; i < TCP_PROXY_CONNECTIONS; i++) {
        tcp_connection *c = &p->connection[i];
        if (c->client < 0) continue;
        if (!c->connected) {
            const int state = tcp_connected(c);
            c->connected = state > 0;
            p->n_refused += state < 0;
            if (state < 0) tcp_end(c, false);
            if (state <= 0) continue;
        }
        bool good = true;
        for (int d = 0; d < 2 && good; d++)
            good = tcp_read(&c->stream[d], now_ns) && tcp_write(&c->stream[d], now_ns, p->lateness);
        if (!good || (c->stream[0].done && c->stream[1].done)) tcp_end(c, !good);
    }
}

int tcp_proxy_port(const tcp_proxy *p)
{
    return p->port;
}

int tcp_proxy_accepted(const tcp_proxy *p)
{
    return p->n_accepted;
}

int tcp_proxy_refused(const tcp_proxy *p)
{
    return p->n_refused;
}
