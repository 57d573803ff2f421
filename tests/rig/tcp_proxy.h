/* TCP connections through two network paths: each connection that is accepted gets one to the server, and their bytes
 * go on when the paths let them arrive. The end of a stream arrives as its bytes do; a connection that the path gives
 * up is reset on both sides. The handshake is not delayed: what is sent first is.
 *
 * A segment is read when it leaves, so what waits for the line stays in the sender's socket, where the sender sees it.
 * Never blocks: the caller polls the descriptors and calls tcp_proxy_run at network_queue times. Thread: one. */
#ifndef TESTS_RIG_TCP_PROXY_H
#define TESTS_RIG_TCP_PROXY_H
#include "tests/rig/network_path.h"
#include "tests/rig/rig_clock.h"

#include <poll.h>

typedef struct tcp_proxy tcp_proxy;

enum { TCP_PROXY_CONNECTIONS = 64, TCP_PROXY_FDS = 1 + 2 * TCP_PROXY_CONNECTIONS };

/* route: "PORT:HOST:PORT", of the rig on 127.0.0.1 (0: any) and of the server. up, down: to and from the server;
 * borrowed. REFUSED: route. IO: port */
pal_err tcp_proxy_open(const char *route, network_path *up, network_path *down, rig_lateness *lateness,
                       pal_diagnostic *diag, tcp_proxy **out);
void tcp_proxy_close(tcp_proxy *proxy); /* NULL is fine */

/* fills fd [TCP_PROXY_FDS] with what to wait for; the result is their number */
int tcp_proxy_watch(const tcp_proxy *proxy, uint64_t now_ns, struct pollfd *fd);
/* when to call tcp_proxy_run although no descriptor is ready; NETWORK_LOST: never */
uint64_t tcp_proxy_next_ns(const tcp_proxy *proxy, uint64_t now_ns);
/* accepts, reads and writes what can be */
void tcp_proxy_run(tcp_proxy *proxy, uint64_t now_ns);

int tcp_proxy_port(const tcp_proxy *proxy);
int tcp_proxy_accepted(const tcp_proxy *proxy); /* connections since the start */
int tcp_proxy_refused(const tcp_proxy *proxy);  /* of them, those that the server refused */
#endif
