/* A client of palpate.v2 over libwebsockets and its event loop, shared by palpate-client, palpate-lcm and
 * palpate-bridge.
 *
 * A pal_link_loop is one libwebsockets context. Its links, gets, timers and watched descriptors call back on the
 * thread inside pal_link_run ([net]). Other threads may call only pal_link_stop.
 *
 * A link connects and joins. After a loss it reconnects by timer, with pauses that double from 0.25 s to 5 s, until it
 * is closed or the server refuses permanently (protocol/README.md, "Closing"). A server that ends may name another one
 * (`move`): the link goes there, and tells its user like any other message. Sending never blocks: the newest
 * pose, with the last ones at which its grasp changed, and the newest acknowledgement wait, control messages in a queue
 * of 16. One message is written each
 * time the socket is writable, control first. wss and https URLs use TLS: the server's certificate must be signed by an
 * authority of the system, or by that of the PEM file that the environment variable PALPATE_CA names; that of
 * this machine itself is not checked.
 *
 *     pal_link_loop *loop; pal_link *link;
 *     pal_link_loop_create(&loop);
 *     pal_link_open(loop, &(pal_link_options){.url = "ws://127.0.0.1:8090/ws", .events = &events, .user = me}, &diag,
 *                   &link);
 *     pal_link_run(loop);           // until pal_link_stop
 *     pal_link_loop_destroy(loop);  // closes and frees links, timers, watches */
#ifndef PAL_LINK_LINK_H
#define PAL_LINK_LINK_H
#include "protocol/control.h"
#include "protocol/wire.h"
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_link_loop pal_link_loop;
typedef struct pal_link pal_link;
typedef struct pal_link_timer pal_link_timer;

pal_err pal_link_loop_create(pal_link_loop **out);          /* [load] MEMORY */
void pal_link_loop_destroy(pal_link_loop *loop);            /* [load] after pal_link_run has returned; NULL is fine */
void pal_link_run(pal_link_loop *loop);                     /* the calling thread is [net] until pal_link_stop */
void pal_link_run_for(pal_link_loop *loop, double seconds); /* the same, for at most that time; 0: without limit */
pal_err pal_link_stop_on_signals(pal_link_loop *loop);      /* [load] SIGINT and SIGTERM stop the loop; MEMORY */
void pal_link_stop(pal_link_loop *loop);                    /* [any] */

typedef enum pal_link_state {
    PAL_LINK_CONNECTING,
    PAL_LINK_OPEN,   /* websocket is open, join was sent */
    PAL_LINK_JOINED, /* hello was received: poses may be sent */
    PAL_LINK_LOST,   /* connection lost, reconnecting */
    PAL_LINK_ENDED   /* refused or not to be retried */
} pal_link_state;

/* all called [net]; any may be NULL; bytes and messages are borrowed for the call */
typedef struct pal_link_events {
    /* reason: a sentence for the user; code: websocket close code, 0: none */
    void (*state)(void *user, pal_link_state state, int code, const char *reason);
    /* every well-formed text message of the server, decoded and as it came; before control */
    void (*text)(void *user, const pal_control *c, const char *text, size_t n_byte);
    /* the same without its text; hello too, before state JOINED */
    void (*control)(void *user, const pal_control *c);
    /* every whole binary message of a server kind with a valid header; the body is unchecked */
    void (*message)(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte);
    /* a malformed message of the server (pal_refusal); it is dropped, the connection stays open */
    void (*fault)(void *user, int refusal);
} pal_link_events;

typedef struct pal_link_options {
    const char *url;  /* ws[s]://host[:port][/path][?session=NAME][#TICKET]; http[s]:// is equivalent, so that the
                         address  that a server prints can be given; default path "/ws"; copied. Without a ticket there:
                         that of the environment variable PALPATE_TICKET */
    const char *name; /* of the member; copied                                             */
    pal_wire_role role;
    int tool;             /* requested: index, PAL_WIRE_TOOL_ANY or PAL_WIRE_TOOL_NONE */
    bool topology_deltas; /* accepts TOPOLOGY_DELTA (triangle_table.h); without it, adaptive parts keep the triangles of
                             their asset */
    double read_bytes_s;  /* > 0: read limit, bytes per second (a slow client) */
    const pal_link_events *events; /* borrowed while the link lives */
    void *user;
} pal_link_options;

/* starts connecting; REFUSED: invalid URL. [net] or before pal_link_run */
pal_err pal_link_open(pal_link_loop *loop, const pal_link_options *options, pal_diagnostic *diag, pal_link **out);
/* closes with 1000 and frees the link, no further events. [net] or after pal_link_run; NULL is fine */
void pal_link_close(pal_link *link);

pal_link_state pal_link_current_state(const pal_link *link);
/* tool that the member holds by the newest hello or members; PAL_WIRE_TOOL_NONE: none, or not connected */
int pal_link_tool(const pal_link *link);

/* the newest wins, but those at which the grasp changes or the tool leaves are sent too (signal_edges.h); STATE: not
 * joined; REFUSED: a number is not finite. [net] */
pal_err pal_link_send_pose(pal_link *link, const pal_wire_pose *pose);
pal_err pal_link_send_ack(pal_link *link, const pal_wire_ack *ack);
/* acknowledges the cycle that a TOOLS message closes; a malformed message is ignored */
void pal_link_acknowledge(pal_link *link, const uint8_t *bytes, size_t n_byte);
/* FULL: 16 are pending; STATE: not connected; REFUSED: does not fit the protocol */
pal_err pal_link_send_control(pal_link *link, const pal_control *c);
/* hold true: stops reading from the socket (a stalled client); false: resumes */
void pal_link_pause_reading(pal_link *link, bool hold);

typedef struct pal_link_counts {
    uint64_t bytes_in;
    uint32_t joins; /* hellos received */
} pal_link_counts;
pal_link_counts pal_link_count(const pal_link *link);

/* GET of a path on the server of url. done is called once: status 200 with the whole body (borrowed), else the status
 * or 0 with the reason. max: size limit of the body, bytes. REFUSED: URL. [net] or before pal_link_run */
typedef void (*pal_link_get_done)(void *user, int status, const uint8_t *bytes, size_t n_byte, const char *reason);
pal_err pal_link_get(pal_link_loop *loop, const char *url, const char *path, size_t max, pal_link_get_done done,
                     void *user, pal_diagnostic *diag);

/* Calls fn every period_us, counted from the return of the previous call, so never more often. Ends with the loop or
 * pal_link_remove_timer. NULL: out of memory. */
pal_link_timer *pal_link_add_timer(pal_link_loop *loop, uint64_t period_us, void (*fn)(void *user), void *user);
void pal_link_remove_timer(pal_link_timer *timer); /* stops and frees; not from its own fn; NULL is fine */
/* calls fn when the descriptor is readable; borrows fd (polls a duplicate). IO */
pal_err pal_link_poll_fd(pal_link_loop *loop, int fd, void (*fn)(void *user), void *user);
#endif
