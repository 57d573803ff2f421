/* The network side of a server: one loop, one hub, the websocket transport with the viewer's files, and the mem
 * transport for tests. All of it runs on the [net] thread that calls pal_server_run. */
#ifndef PAL_NET_SERVER_H
#define PAL_NET_SERVER_H
#include "server/session/session.h"
#include "server/sim/core/configuration.h"

typedef struct pal_server pal_server;
struct pal_verb;

typedef struct pal_server_options {
    const char *listen;        /* "127.0.0.1"; any other address needs allow_remote                         */
    int port;                  /* 8090; 0: any free port, see pal_server_port                               */
    bool allow_remote;         /* also accepts any Host name (for a proxy), not only loopback names */
    const char *viewer_folder; /* files served at /; NULL: none                                             */
    double error_m;            /* bound of streamed positions per axis; 0: 1/3000 of the box, at most 0.05 mm */
    int max_clients;           /* 0: 200                                                                    */
    const char *transport;     /* transport: "ws" (default) or "mem" (tests) */
    /* Study of each session's scene, for a live choice among its points: configurations by ascending ms, and their
     * body, in the order of the sessions; borrowed until close. NULL, or n_configuration 0: no study */
    const pal_measured_configuration *const *setting; /* [n_session][n_configuration] */
    const int *n_configuration, *setting_body;        /* [n_session]            */
    const struct pal_verb *verb; /* commands that clients may give [n_verb], borrowed; NULL: pal_verb_table */
    int n_verb;
    const double *reference_m; /* error of each study's reference itself [n_session]; NULL: unknown */
} pal_server_options;

/* REFUSED: the address needs allow_remote, or the port is in use (the diagnostic names it). Borrows sessions until
 * close. [load] */
pal_err pal_server_open(const pal_server_options *options, pal_session **session, int n_session, pal_diagnostic *diag,
                        pal_server **out);
/* The wake callback of sessions; user: a pal_server_gate. It is created before the sessions, because they start before
 * the server exists. Waking an unconnected gate does nothing. A closing server disconnects its gate first, so sessions
 * may be closed before or after it. */
typedef struct pal_server_gate pal_server_gate;
pal_server_gate *pal_server_gate_create(void);                      /* NULL: out of memory */
void pal_server_gate_destroy(pal_server_gate *gate);                /* after the sessions that wake it */
void pal_server_gate_wake(void *gate);                              /* [any] */
void pal_server_connect(pal_server *server, pal_server_gate *gate); /* [load] */

pal_err pal_server_run(pal_server *server); /* returns after pal_server_stop; this thread is [net] */
void pal_server_stop(pal_server *server);   /* [any], also from a signal-handling thread */
int pal_server_port(const pal_server *server);
void pal_server_close(pal_server *server); /* [load] */

/* Transport "mem" only: the transport for pal_mem_connect, and one turn of the loop at a given time, instead of
 * pal_server_run. The calling thread is [net]. */
struct pal_transport *pal_server_transport(pal_server *server);
void pal_server_advance(pal_server *server, uint64_t now_ns);
#endif
