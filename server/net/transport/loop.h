/* The one loop of the network thread: sockets (one libwebsockets context), a due time, a regular tick, and the wake
 * from other threads. Without sockets the loop is driven by hand with a time of the caller's choosing: that is what
 * mem:// uses, so its tests are deterministic. Thread: [net] unless said otherwise. */
#ifndef PAL_NET_TRANSPORT_LOOP_H
#define PAL_NET_TRANSPORT_LOOP_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

#define PAL_LOOP_TICK_NS 333333333u /* housekeeping about three times a second */

typedef struct pal_loop pal_loop;

typedef struct pal_loop_events {
    void (*wake)(void *user); /* somebody woke the loop, or the due time has come */
    void (*tick)(void *user);
    void *user;
} pal_loop_events;

/* sockets: false makes a loop driven by pal_loop_advance; max_socket bounds the descriptors of the context. [load] */
pal_err pal_loop_create(bool sockets, int max_socket, pal_diagnostic *diag, pal_loop **out);
/* closes every socket; roads then hear of their peers for the last time, and may be closed. [load] */
void pal_loop_shut(pal_loop *loop);
void pal_loop_destroy(pal_loop *loop);                               /* after its roads; NULL is fine. [load] */
void pal_loop_listen(pal_loop *loop, const pal_loop_events *events); /* copies; one listener */

uint64_t pal_loop_now_ns(const pal_loop *loop);           /* pal_clock_ns, or the time of the last turn */
void pal_loop_set_due(pal_loop *loop, uint64_t when_ns);  /* wake at that time as well; a later call replaces it */
void pal_loop_wake(pal_loop *loop);                       /* [any] the only cross-thread calls: wake and stop */
void pal_loop_stop(pal_loop *loop);                       /* [any] */
pal_err pal_loop_run(pal_loop *loop);                     /* until stop; sockets only */
pal_err pal_loop_step(pal_loop *loop, uint64_t until_ns); /* one service, at the latest at until_ns; sockets only */
void pal_loop_advance(pal_loop *loop, uint64_t now_ns);   /* what is due by now_ns, without waiting; no sockets */
struct lws_context *pal_loop_context(pal_loop *loop);     /* for roads; NULL without sockets */
#endif
