#include "tests/rig/lcm_proxy.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { SERVERS, CLIENTS, DATAGRAM_MAX = 65536 };

typedef struct lcm_sender {
    struct sockaddr_in heard, sends; /* its address, and that of the socket that stands for it on the other side */
    int fd;
    int side; /* where it was heard */
} lcm_sender;

struct lcm_proxy {
    struct sockaddr_in group[2];
    int fd[2];            /* hear each group */
    network_flow flow[2]; /* of what was heard on each side: down, up */
    network_queue queue;
    rig_lateness *lateness;
    int n_sender;
    lcm_sender sender[LCM_PROXY_SENDERS];
    uint64_t n_failed;
    uint8_t bytes[DATAGRAM_MAX];
};

static bool lcm_group(const char *text, size_t n, struct sockaddr_in *out)
{
    char host[32], *end;
    const size_t n_host = strcspn(text, ":,");
    if (text[n_host] != ':' || n_host >= sizeof host || n_host > n) return false;
    memcpy(host, text, n_host);
    host[n_host] = 0;
    const long port = strtol(text + n_host + 1, &end, 10);
    *out = (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    return end == text + n && port > 0 && port <= 65535 && inet_pton(AF_INET, host, &out->sin_addr) == 1 &&
           IN_MULTICAST(ntohl(out->sin_addr.s_addr));
}

static bool lcm_same(const struct sockaddr_in *a, const struct sockaddr_in *b)
{
    return a->sin_port == b->sin_port && a->sin_addr.s_addr == b->sin_addr.s_addr;
}

static pal_err lcm_listen(lcm_proxy *p, int side, pal_diagnostic *diag)
{
    const int on = 1;
    const struct ip_mreq join = {.imr_multiaddr = p->group[side].sin_addr};
    const int fd = p->fd[side] = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    /* bound to the group, it hears no other one of the same port */
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) ||
        setsockopt(fd, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) ||
        bind(fd, (struct sockaddr *)&p->group[side], sizeof p->group[side]) ||
        setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &join, sizeof join)) {
        char host[INET_ADDRSTRLEN];
        const char *reason =
            errno == ENODEV ? "no multicast route; add one with `ip route add 224.0.0.0/4 dev lo`" : strerror(errno);
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s:%u: %s",
                                  inet_ntop(AF_INET, &p->group[side].sin_addr, host, sizeof host),
                                  ntohs(p->group[side].sin_port), reason);
    }
    return PAL_ERR_OK;
}

pal_err lcm_proxy_open(const char *route, network_path *up, network_path *down, rig_lateness *lateness,
                       pal_diagnostic *diag, lcm_proxy **out)
{
    lcm_proxy *p = calloc(1, sizeof *p);
    if (!p) return PAL_ERR_MEMORY;
    p->fd[SERVERS] = p->fd[CLIENTS] = -1;
    p->lateness = lateness;
    const size_t n = strcspn(route, ",");
    pal_err err = PAL_ERR_OK;
    if (!route[n] || !lcm_group(route, n, &p->group[SERVERS]) ||
        !lcm_group(route + n + 1, strlen(route + n + 1), &p->group[CLIENTS]))
        err = PAL_REFUSE(diag, "--lcm \"%.80s\" is not GROUP:PORT,GROUP:PORT, as 239.255.76.67:7667,239.255.76.67:7668",
                         route);
    else if (lcm_same(&p->group[SERVERS], &p->group[CLIENTS]))
        err = PAL_REFUSE(diag,
                         "--lcm \"%.80s\": both sides are the same group: clients would hear servers without the "
                         "rig",
                         route);
    for (int side = 0; side < 2 && !err; side++) err = lcm_listen(p, side, diag);
    if (err) {
        lcm_proxy_close(p);
        return err;
    }
    p->flow[SERVERS] = network_flow_make(down);
    p->flow[CLIENTS] = network_flow_make(up);
    *out = p;
    return PAL_ERR_OK;
}

void lcm_proxy_close(lcm_proxy *p)
{
    if (!p) return;
    for (int side = 0; side < 2; side++)
        if (p->fd[side] >= 0) close(p->fd[side]);
    for (int i = 0; i < p->n_sender; i++) close(p->sender[i].fd);
    network_queue_clear(&p->queue);
    free(p);
}

int lcm_proxy_watch(const lcm_proxy *p, struct pollfd *fd)
{
    for (int side = 0; side < 2; side++) fd[side] = (struct pollfd){.fd = p->fd[side], .events = POLLIN};
    return 2;
}

uint64_t lcm_proxy_next_ns(const lcm_proxy *p)
{
    return network_queue_next_ns(&p->queue);
}

/* has the rig sent what comes from there on that side? */
static bool lcm_own(const lcm_proxy *p, int side, const struct sockaddr_in *from)
{
    for (int i = 0; i < p->n_sender; i++)
        if (p->sender[i].side != side && lcm_same(&p->sender[i].sends, from)) return true;
    return false;
}

/* the socket that stands for that sender on the other side; -1: there is none */
static int lcm_sender_fd(lcm_proxy *p, int side, const struct sockaddr_in *from)
{
    for (int i = 0; i < p->n_sender; i++)
        if (p->sender[i].side == side && lcm_same(&p->sender[i].heard, from)) return p->sender[i].fd;
    if (p->n_sender == LCM_PROXY_SENDERS) return -1;
    lcm_sender *s = &p->sender[p->n_sender];
    const struct sockaddr_in *to = &p->group[1 - side];
    const unsigned char ttl = 0;
    socklen_t size = sizeof s->sends;
    *s = (lcm_sender){.heard = *from, .side = side, .fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
    if (s->fd < 0) return -1;
    if (setsockopt(s->fd, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl) ||
        connect(s->fd, (const struct sockaddr *)to, sizeof *to) ||
        getsockname(s->fd, (struct sockaddr *)&s->sends, &size)) {
        close(s->fd);
        return -1;
    }
    p->n_sender++;
    return s->fd;
}

static void lcm_hear(lcm_proxy *p, int side, uint64_t now_ns)
{
    for (;;) {
        struct sockaddr_in from;
        socklen_t size = sizeof from;
        const ssize_t n = recvfrom(p->fd[side], p->bytes, sizeof p->bytes, 0, (struct sockaddr *)&from, &size);
        if (n < 0) return;
        if (lcm_own(p, side, &from)) continue;
        const int to = lcm_sender_fd(p, side, &from);
        if (to < 0) {
            p->n_failed++;
            continue;
        }
        const uint64_t arrival = network_send_datagram(&p->flow[side], now_ns, (size_t)n);
        if (arrival != NETWORK_LOST) p->n_failed += network_queue_add(&p->queue, arrival, to, p->bytes, (size_t)n) != 0;
    }
}

void lcm_proxy_run(lcm_proxy *p, uint64_t now_ns)
{
    for (int side = 0; side < 2; side++) lcm_hear(p, side, now_ns);
    while (network_queue_next_ns(&p->queue) <= now_ns) {
        const network_packet *packet = p->queue.first;
        p->n_failed += send(packet->to, packet->bytes, packet->n_byte, MSG_DONTWAIT) < 0;
        rig_lateness_add(p->lateness, packet->arrival_ns, now_ns);
        network_queue_remove_first(&p->queue);
    }
}

int lcm_proxy_senders(const lcm_proxy *p)
{
    return p->n_sender;
}

uint64_t lcm_proxy_failed(const lcm_proxy *p)
{
    return p->n_failed;
}
