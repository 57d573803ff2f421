/* The event loop of the network thread: sockets (one libwebsockets context), one timer, a regular tick, and wakes from
 * other threads. Without sockets the caller drives the loop; tests do so with a clock of their own
 * (tests/net/mem_transport.h). Thread: [net] unless noted. */
#ifndef PAL_NET_TRANSPORT_LOOP_H
#define PAL_NET_TRANSPORT_LOOP_H
#include "server/base/clock.h"
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

#define PAL_LOOP_TICK_NS 333333333u /* housekeeping interval, about three per second */

typedef struct pal_loop pal_loop;

typedef struct pal_loop_events {
    void (*wake)(void *user); /* woken by another thread, or the timer has expired */
    void (*tick)(void *user);
    void *user;
} pal_loop_events;

/* sockets false: a loop driven by pal_loop_advance; max_socket bounds the descriptors of the context;
 * tls: its transport speaks TLS. Borrows the clock, which must be pal_clock_monotonic with sockets. [load] */
pal_err pal_loop_create(bool sockets, int max_socket, bool tls, const pal_clock *clock, pal_diagnostic *diag,
                        pal_loop **out);
/* closes every socket; transports then report the last events of their peers and may be closed. [load] */
void pal_loop_shut(pal_loop *loop);
void pal_loop_destroy(pal_loop *loop);                               /* after its transports; NULL is fine. [load] */
void pal_loop_listen(pal_loop *loop, const pal_loop_events *events); /* copies; one listener */

uint64_t pal_loop_now_ns(const pal_loop *loop);          /* of its clock */
void pal_loop_set_due(pal_loop *loop, uint64_t when_ns); /* also wakes at that time; a later call replaces it */
/* [any] with pal_loop_stop, the only functions for other threads; without sockets, it also wakes the clock */
void pal_loop_wake(pal_loop *loop);
void pal_loop_stop(pal_loop *loop);                       /* [any] */
pal_err pal_loop_run(pal_loop *loop);                     /* runs until stop; sockets only */
pal_err pal_loop_step(pal_loop *loop, uint64_t until_ns); /* one service, until until_ns at the latest; sockets only */
void pal_loop_advance(pal_loop *loop);                    /* runs everything due by now without waiting; no sockets */
struct lws_context *pal_loop_context(pal_loop *loop);     /* for transports; NULL without sockets */
#endif
