/* The network side of a server: one loop, one hub, and the websocket transport with the viewer's files. All of it runs
 * on the [net] thread that calls pal_server_run, by the clock of the sessions. */
#ifndef PAL_NET_SERVER_H
#define PAL_NET_SERVER_H
#include "server/net/hub.h"

#include <stdatomic.h>

typedef struct pal_server pal_server;

/* REFUSED: the address needs allow_remote, or the port is in use (the diagnostic names it). Borrows sessions until
 * close. n_session may be 0 where a source opens others, with websockets. [load] */
pal_err pal_server_open(const pal_server_options *options, pal_session **session, int n_session, pal_diagnostic *diag,
                        pal_server **out);
/* The wake callback of sessions; user: a zeroed pal_server_gate. It exists before the sessions, because they start
 * before the server exists. Waking an unconnected gate does nothing. A closing server disconnects its gate first, so
 * sessions and server may be closed in either order; the gate outlives both. */
typedef struct pal_server_gate {
    _Atomic(pal_loop *) loop; /* NULL: unconnected */
    /* threads inside wake: disconnecting waits for them, wake waits for nobody */
    _Atomic int users;
} pal_server_gate;
void pal_server_gate_wake(void *gate);                              /* [any] */
void pal_server_connect(pal_server *server, pal_server_gate *gate); /* [load] */

pal_err pal_server_run(pal_server *server); /* returns after pal_server_stop; this thread is [net] */
void pal_server_stop(pal_server *server);   /* [any], also from a signal-handling thread */
/* a ticket of this server for any session and tool, as long as it runs */
void pal_server_start_ticket(const pal_server *server, pal_wire_role role, char text[PAL_TICKET_TEXT]);
int pal_server_record_error(const pal_server *server);      /* errno of a recording that has ended; 0: none. [load] */
bool pal_server_has_ended(const pal_server *server, int i); /* session i of open, by an instructor? [any] */
pal_hub_pulse pal_server_pulse(const pal_server *server);   /* [any] */
int pal_server_port(const pal_server *server);
int pal_server_health_port(const pal_server *server); /* -1: no listener of its own */
void pal_server_close(pal_server *server);            /* [load] */

/* For a transport without sockets: the transport, and one turn of the loop instead of pal_server_run. The calling
 * thread is [net]. */
struct pal_transport *pal_server_transport(pal_server *server);
void pal_server_advance(pal_server *server);
/* what pal_server_run does at its end: completes recordings and tells members where to go; drops them (hub.h) */
void pal_server_drain(pal_server *server);
void pal_server_goodbye(pal_server *server);
#endif
