/* The network side of a server: one loop, one hub, the websocket transport with the viewer's files, the mem transport
 * for tests. All of it runs on the one [net] thread that calls pal_server_run. */
#ifndef PAL_NET_SERVER_H
#define PAL_NET_SERVER_H
#include "server/session/session.h"
#include "server/sim/core/configuration.h"

typedef struct pal_server pal_server;
struct pal_verb;

typedef struct pal_server_options {
    const char *listen; /* "127.0.0.1"; any other address needs allow_remote                         */
    int port;           /* 8090; 0: any free port, see pal_server_port                               */
    bool allow_remote;  /* also: take requests under any Host name (a proxy before us), not only loopback names */
    const char *viewer_folder; /* files served at /; NULL: none                                             */
    double error_m;            /* bound of streamed positions per axis; 0: 1/3000 of the box, at most 0.05 mm */
    int max_clients;           /* 0: 200                                                                    */
    const char *transport;     /* "ws" (default) or "mem" (tests)                                           */
    /* what a study of each session's scene found, for those who pick a point of it live: lists by ascending ms and the
     * body they are of, in the order of the sessions; borrowed until close. NULL, or n_configuration 0: no study */
    const pal_measured_configuration *const *setting; /* [n_session][n_configuration] */
    const int *n_configuration, *setting_body;        /* [n_session]            */
    const struct pal_verb *verb; /* commands that clients may give [n_verb], borrowed; NULL: pal_verb_table */
    int n_verb;
    const double *reference_m; /* error of each study's own reference [n_session]; NULL: not known */
} pal_server_options;

/* REFUSED: address needs allow_remote, port in use (the sentence names it); borrows sessions until close. [load] */
pal_err pal_server_open(const pal_server_options *options, pal_session **session, int n_session, pal_diagnostic *diag,
                        pal_server **out);
/* the wake callback that sessions are opened with: user is a pal_server_gate, made before the sessions because they
 * start before the server exists; waking an unconnected gate does nothing. A server that closes disconnects its gate
 * first, so that sessions may be closed before or after it. */
typedef struct pal_server_gate pal_server_gate;
pal_server_gate *pal_server_gate_create(void);                      /* NULL: out of memory */
void pal_server_gate_destroy(pal_server_gate *gate);                /* after the sessions that wake it */
void pal_server_gate_wake(void *gate);                              /* [any] */
void pal_server_connect(pal_server *server, pal_server_gate *gate); /* [load] */

pal_err pal_server_run(pal_server *server); /* returns after pal_server_stop; this thread is [net] */
void pal_server_stop(pal_server *server);   /* [any], also from a signal handler's thread */
int pal_server_port(const pal_server *server);
void pal_server_close(pal_server *server); /* [load] */

/* transport "mem" only: the transport for pal_mem_connect, and one turn of the loop at a time of the caller's choosing
 * (instead of pal_server_run). This thread is [net]. */
struct pal_transport *pal_server_transport(pal_server *server);
void pal_server_advance(pal_server *server, uint64_t now_ns);
#endif
