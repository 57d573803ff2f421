/* The hub connects peers to sessions. It interprets messages, checks permissions, and chooses the next message to each
 * peer. At a wake or tick it updates the stream of each room (at most 120 times a second), fields and jobs, and calls
 * `ready` of the peers (hub.c, hub_wake). server/README.md, "Sending", has their order. Per client, at most 32 control
 * messages, one contact model and the cycle in transmission are queued. Frames, contact models and fields are encoded
 * once, in that update; which of them a peer gets is chosen when its transport asks. Thread: [net]. */
#ifndef PAL_NET_HUB_H
#define PAL_NET_HUB_H
#include "server/net/hub_core.h"

typedef struct pal_server_options {
    const char *listen; /* "127.0.0.1"; any other address needs allow_remote                         */
    int port;           /* 8090; 0: any free port, see pal_server_port                               */
    bool allow_remote;  /* other machines may connect */
    const char *hosts;  /* names by which they reach it, "a,b", beside its addresses and its own name; NULL: none */
    const char *tls_certificate, *tls_key; /* PEM files; NULL: no TLS */
    const char *health; /* "9090", "0.0.0.0:9090": where health and metrics are served, and nowhere else; NULL: on the
                           main port, unless other machines may connect */
    const char *viewer_folder; /* files served at /; NULL: none                                             */
    const struct pal_transport_ops *transport; /* NULL: websockets */
    /* of the hub */
    bool open;                    /* whoever comes is what it asks to be; else a client without a ticket is a viewer */
    const char *key_file;         /* of tickets (ticket_keys.h); NULL: none */
    const char *drain_to;         /* where members go when the server ends (pal_hub_drain), borrowed; NULL: nowhere */
    double error_m;               /* bound of streamed positions per axis; 0: 1/3000 of the box, at most 0.05 mm */
    int max_clients, max_viewers; /* members, and who only watches; 0: 200, 1000 */
    const char *relays;           /* to which who watches is sent when there is no place (relay_list.h), borrowed until
                                     close; NULL: none */
    struct pal_resume **resume;   /* of sessions that go on after a crash: their edits, taken [n_session]; NULL, or an
                                     entry of it: none */
    const pal_session_study *study;         /* [n_session], borrowed until close; NULL: none */
    const pal_session_recording *recording; /* that they play [n_session], copied; NULL: none */
    const pal_session_source *source; /* borrowed until close; NULL: sessions are neither opened nor ended later */
    const pal_failed_scene *failed;   /* scenes of the start that could not be opened: listed [n_failed] */
    int n_failed;
    const pal_verb *verb; /* commands that clients may give [n_verb], borrowed; NULL: pal_verb_table */
    int n_verb;
} pal_server_options;

/* Builds the streams and listens to the loop. Borrows loop, sessions and their array. When a job replaces a session,
 * the hub closes it and sets its place in the array to NULL; the hub owns the new session and closes it in destroy.
 * site: borrowed; NULL: no files. [load] */
pal_err pal_hub_create(pal_loop *loop, const pal_server_options *options, pal_site *site, pal_session **session,
                       int n_session, pal_diagnostic *diag, pal_hub **out);
void pal_hub_destroy(pal_hub *hub);                      /* after its transports; NULL is fine. [load] */
void pal_hub_events(pal_hub *hub, pal_peer_events *out); /* for pal_transport_ops.open */
/* Accepts nobody and runs no command from now on. Every session stops, and its recording is complete and on the disk
 * before a member learns of it, or is sent to drain_to: whoever arrives there finds its last state. Takes as long as
 * the job that a session has under way, a step and a write of each session */
void pal_hub_drain(pal_hub *hub);
bool pal_hub_moves_sent(const pal_hub *hub); /* nobody's `move` waits for its transport */
void pal_hub_goodbye(pal_hub *hub);          /* drops every peer with code 1001 */
/* what other threads may know of it, as of the last tick */
typedef struct pal_hub_pulse {
    bool alive; /* every simulation steps, and the loop has turned within PAL_PULSE_NS */
    int n_session, n_client;
} pal_hub_pulse;
pal_hub_pulse pal_hub_read_pulse(const pal_hub *hub); /* [any] */
/* a ticket for who has started the server (admission.h). [load] */
void pal_hub_start_ticket(const pal_hub *hub, pal_wire_role role, char text[PAL_TICKET_TEXT]);
int pal_hub_record_error(const pal_hub *hub); /* errno of a recording that has ended; 0: none */
int pal_hub_clients(const pal_hub *hub);
bool pal_hub_has_ended(const pal_hub *hub, int i); /* was session i of those that it was given ended? [any] */
#endif
