#include "server/net/transport/listener.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { SEND_QUEUE = 16 << 10, UNACKED_MS = 15000, BACKLOG = 128 };

static void tune(int fd)
{
    int on = 1, low = SEND_QUEUE, unacked_ms = UNACKED_MS;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    /* what is not on the wire yet can still be replaced by something newer */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &low, sizeof low);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &unacked_ms, sizeof unacked_ms);
}

int pal_listener_accept(pal_listener *l)
{
    for (int i = 0; i < BACKLOG; i++) {
        int fd = accept4(l->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd >= 0) {
            tune(fd);
            return fd;
        }
        if (errno == EINTR || errno == ECONNABORTED) continue;
        if ((errno != EMFILE && errno != ENFILE) || l->spare_fd < 0) return -1;
        close(l->spare_fd);
        fd = accept4(l->fd, NULL, NULL, SOCK_CLOEXEC);
        if (fd >= 0) close(fd);
        l->spare_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    }
    return -1;
}

pal_err pal_listener_open(pal_listener *l, const char *ip_text, int *port_out, pal_diagnostic *diag)
{
    const bool is_v6 = strchr(ip_text, ':') != NULL;
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
    *l = (pal_listener){-1, -1};
    snprintf(name, sizeof name, is_v6 ? "[%s]:%d" : "%s:%d", ip_text, *port_out);
    if (*port_out < 0 || *port_out > UINT16_MAX || inet_pton(address.any.sa_family, ip_text, ip) != 1)
        return PAL_REFUSE(diag, "%s is not an address to listen on", name);
    *port = htons((uint16_t)*port_out);
    l->spare_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    l->fd = socket(address.any.sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (l->fd < 0) return pal_diagnostic_set(diag, PAL_ERR_IO, "no socket: %s", strerror(errno));
    (void)setsockopt(l->fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(l->fd, &address.any, n) || listen(l->fd, BACKLOG)) {
        if (errno == EADDRINUSE)
            return PAL_REFUSE(
                diag,
                "%s is in use, perhaps by another palpate serve; choose another port with --port (0: any free one)",
                name);
        return PAL_REFUSE(diag, "cannot listen on %s: %s", name, strerror(errno));
    }
    if (getsockname(l->fd, &address.any, &n)) return PAL_ERR_IO;
    *port_out = ntohs(*port);
    return PAL_ERR_OK;
}

void pal_listener_close(pal_listener *l)
{
    if (l->fd >= 0) close(l->fd);
    if (l->spare_fd >= 0) close(l->spare_fd);
    *l = (pal_listener){-1, -1};
}
