/* Datagrams of LCM between two multicast groups through two network paths: servers on one group, clients on the other.
 *
 * Multicast cannot be taken away from those who listen to its group, so each side has a group (or port) of its own and
 * only the rig hears both. What the rig itself has sent to a group comes back to it and is dropped by its address. Each
 * sender that it hears gets a socket of its own on the other side, because LCM puts the fragments of long messages
 * together by the address of their sender. Datagrams stay on this host (TTL 0), as with `?ttl=0`.
 * Never blocks: the caller polls. Thread: one. */
#ifndef TESTS_RIG_LCM_PROXY_H
#define TESTS_RIG_LCM_PROXY_H
#include "tests/rig/network_path.h"
#include "tests/rig/rig_clock.h"

#include <poll.h>

typedef struct lcm_proxy lcm_proxy;

enum { LCM_PROXY_SENDERS = 64, LCM_PROXY_FDS = 2 };

/* route: "GROUP:PORT,GROUP:PORT", the servers' and the clients'. up, down: to and from the servers; borrowed.
 * REFUSED: route. IO: sockets */
pal_err lcm_proxy_open(const char *route, network_path *up, network_path *down, rig_lateness *lateness,
                       pal_diagnostic *diag, lcm_proxy **out);
void lcm_proxy_close(lcm_proxy *proxy); /* NULL is fine */

/* fills fd [LCM_PROXY_FDS] with what to wait for; the result is their number */
int lcm_proxy_watch(const lcm_proxy *proxy, struct pollfd *fd);
/* when to call lcm_proxy_run although no descriptor is ready; NETWORK_LOST: never */
uint64_t lcm_proxy_next_ns(const lcm_proxy *proxy);
void lcm_proxy_run(lcm_proxy *proxy, uint64_t now_ns);

int lcm_proxy_senders(const lcm_proxy *proxy); /* heard since the start, of both sides */
/* datagrams that were not passed on: of senders beyond LCM_PROXY_SENDERS, or refused by the system */
uint64_t lcm_proxy_failed(const lcm_proxy *proxy);
#endif
