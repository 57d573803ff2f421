/* A listening socket of our own, whose connections libwebsockets adopts: so a port in use has a clear sentence, and
 * socket options are set before the first byte. Thread: [net]. */
#ifndef PAL_NET_TRANSPORT_LISTENER_H
#define PAL_NET_TRANSPORT_LISTENER_H
#include "server/base/err.h"

typedef struct pal_listener {
    int fd, spare_fd; /* spare: given up to turn a caller away when descriptors run out; -1: closed */
} pal_listener;

/* port 0: any, and *port is the one chosen. REFUSED names address and reason. [load] */
pal_err pal_listener_open(pal_listener *listener, const char *ip, int *port, pal_diagnostic *diag);
void pal_listener_close(pal_listener *listener);
/* the next connection that waits; -1: none, or none that can be taken */
int pal_listener_accept(pal_listener *listener);
#endif
