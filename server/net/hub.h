/* The hub: peers to sessions. It knows what messages mean, who may do what, and what each peer is to be sent next.
 *
 * Sending, in this order: control (hello, errors, pongs, members, status), contact models, then fields and cycles as
 * far as credit goes. Per client there wait at most 32 queued control messages, one contact model and the cycle that is
 * being sent; all else is made when the road asks for it from the newest that the session's stream holds. Thread:
 * [net]. */
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
    /* settings of a study of each session's scene, as in pal_server_options; borrowed; NULL: none */
    const pal_measured_configuration *const *setting;
    const int *n_configuration, *setting_body;
    const double *reference_m;   /* NULL: not known */
    const struct pal_verb *verb; /* commands that are known [n_verb]; borrowed; NULL: pal_verb_table */
    int n_verb;
} pal_hub_options;

/* builds the streams; borrows loop, sessions and their array; listens to the loop. A session that a command of
 * sculpting has replaced is closed, and its place in the array is NULL: the hub closes the new one when it is
 * destroyed. [load] */
pal_err pal_hub_create(pal_loop *loop, const pal_hub_options *options, pal_session **session, int n_session,
                       pal_diagnostic *diag, pal_hub **out);
void pal_hub_destroy(pal_hub *hub);                      /* after its roads; NULL is fine. [load] */
void pal_hub_events(pal_hub *hub, pal_peer_events *out); /* for pal_transport_ops.open */
void pal_hub_goodbye(pal_hub *hub);                      /* drops every peer with 1001; no new ones */
int pal_hub_clients(const pal_hub *hub);
#endif
