/* The hub connects peers to sessions. It interprets messages, checks permissions, and chooses the next message to each
 * peer.
 *
 * Order of sending: control (hello, errors, pongs, members, status), contact models, then fields and cycles as far as
 * credit allows. Per client, at most 32 control messages, one contact model and the cycle in transmission are queued.
 * All else is encoded when the transport asks for it, from the newest data of the session's stream. Thread: [net]. */
#ifndef PAL_NET_HUB_H
#define PAL_NET_HUB_H
#include "server/net/stream.h"
#include "server/net/transport/site.h"
#include "server/net/transport/transport.h"
#include "server/sim/core/configuration.h"

typedef struct pal_hub pal_hub;
struct pal_verb;

typedef struct pal_hub_options {
    double error_m;
    int max_clients;
    pal_site *site; /* borrowed; NULL: no files */
    /* configurations of a study of each session's scene, as in pal_server_options; borrowed; NULL: none */
    const pal_measured_configuration *const *setting;
    const int *n_configuration, *setting_body;
    const double *reference_m;   /* NULL: unknown */
    const struct pal_verb *verb; /* known commands [n_verb]; borrowed; NULL: pal_verb_table */
    int n_verb;
} pal_hub_options;

/* Builds the streams and listens to the loop. Borrows loop, sessions and their array. When a job replaces a session,
 * the hub closes it and sets its place in the array to NULL; the hub owns the new session and closes it in destroy.
 * [load] */
pal_err pal_hub_create(pal_loop *loop, const pal_hub_options *options, pal_session **session, int n_session,
                       pal_diagnostic *diag, pal_hub **out);
void pal_hub_destroy(pal_hub *hub);                      /* after its transports; NULL is fine. [load] */
void pal_hub_events(pal_hub *hub, pal_peer_events *out); /* for pal_transport_ops.open */
void pal_hub_goodbye(pal_hub *hub);                      /* drops every peer with code 1001 and accepts no new ones */
int pal_hub_clients(const pal_hub *hub);
#endif
