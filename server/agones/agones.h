/* A server as an Agones GameServer (agones.dev), by the REST interface of the sidecar that Agones puts beside it. A
 * thread of its own looks at the server three times in each health period and tells the sidecar what has changed:
 *
 *   ready     once the server serves, and again after a sidecar has forgotten it
 *   health    while the simulation steps: a server that stalls is replaced
 *   allocate  when somebody joins, so that no autoscaler takes the server away
 *   labels    agones.dev/sdk-sessions and -clients; the counter `sessions` where the fleet has one
 *   shutdown  when an allocated server has had nobody for PAL_AGONES_EMPTY_S
 *
 * The sidecar may start later and may go away: every turn tries again. Shutdown comes back as SIGTERM. */
#ifndef PAL_AGONES_AGONES_H
#define PAL_AGONES_AGONES_H
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_agones pal_agones;

typedef struct pal_agones_server {
    bool alive; /* every simulation steps, and the network thread turns */
    int n_session, n_client;
} pal_agones_server;

typedef struct pal_agones_options {
    int port;                                            /* of the sidecar on this machine */
    void (*look)(void *user, pal_agones_server *server); /* [agones] */
    void *user;
    int turn_ms;    /* between two turns; 0: a third of the health period */
    double empty_s; /* 0: PAL_AGONES_EMPTY_S */
} pal_agones_options;

/* the port that Agones gives in AGONES_SDK_HTTP_PORT; 0: none. REFUSED: not a port. [load] */
pal_err pal_agones_port(pal_diagnostic *diag, int *port);
/* IO, MEMORY: no thread or no descriptor. [load] */
pal_err pal_agones_start(const pal_agones_options *options, pal_agones **out);
void pal_agones_stop(pal_agones *agones); /* joins the thread at once; NULL is fine. [load] */
#endif
