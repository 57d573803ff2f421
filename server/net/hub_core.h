/* Structs of the hub: clients, rooms, counters. Shared by all files of the hub. Thread: [net]. */
#ifndef PAL_NET_HUB_CORE_H
#define PAL_NET_HUB_CORE_H
#include "server/net/admission/admission.h"
#include "server/net/stream.h"
#include "server/net/transport/credit.h"
#include "server/net/transport/site.h"
#include "server/net/transport/transport.h"
#include "server/session/configuration_switch.h"
#include "server/session/recording.h"
#include "server/session/sculpt.h"

enum {
    PAL_HUB_QUEUE = 32,
    PAL_HUB_OLD_ASSETS = 8,
    PAL_HUB_CLIENTS = 200,
    PAL_HUB_VIEWERS = 1000,
    PAL_SESSIONS_MAX = 64
};

typedef struct pal_hub pal_hub;

/* study of a session's scene, for a live choice among its points */
typedef struct pal_session_study {
    const pal_measured_configuration *configuration; /* by ascending ms [n]; NULL: no study */
    int n, body;
    double reference_m; /* error of the study's reference itself; NaN: unknown */
} pal_session_study;

/* a recording that a session plays until it goes on live */
typedef struct pal_session_recording {
    const pal_recording *recording; /* NULL: none */
    const char *record_path; /* of what goes on live, a name that input_log.h numbers; NULL: it is not recorded */
} pal_session_recording;

/* a session as its source has opened it */
typedef struct pal_opened_session {
    pal_session *session;
    pal_session_study study;
    pal_session_recording recording;
    pal_resume *resume; /* whose edits are taken; NULL: none */
    void *keep;         /* of the source: lives as long as the session; NULL: nothing */
} pal_opened_session;
/* a scene that could not be opened, by the name of its file, and why */
typedef struct pal_failed_scene {
    char scene[PAL_NAME];
    pal_diagnostic diag;
} pal_failed_scene;
/* opens sessions while the server runs */
typedef struct pal_session_source {
    void *user;
    /* names of scenes that can be opened, at most max; NULL: none. [net] */
    int (*list)(void *user, char (*name)[PAL_NAME], int max);
    /* opens a scene as a session of that name; errors of loading it, with one sentence. A thread of the hub */
    pal_err (*open)(void *user, const char *scene, const char *session, pal_diagnostic *diag, pal_opened_session *out);
    void (*close)(void *user, void *keep); /* frees what it kept, after the session. A thread of the hub, or [load] */
} pal_session_source;

/* one connected peer; in a free entry, peer is NULL */
typedef struct pal_client {
    pal_hub *hub;
    pal_peer *peer;
    struct pal_hub_room *room;
    int id;                   /* member id; 0: not joined */
    pal_member_entry *member; /* of the room's members, or viewer; NULL: not joined */
    pal_member_entry viewer;  /* of who only watches and is counted apart */
    bool listed;              /* a viewer that the room's members_message names */
    uint64_t opened_ns;
    pal_grant grant;
    pal_bucket poses, orders; /* what it may send: poses and acknowledgements; control messages */
    pal_credit credit;
    int tier;
    /* control messages: a queue, oldest first, and flags for messages encoded on demand */
    pal_packet *queue[PAL_HUB_QUEUE];
    int n_queue;
    bool members_due, status_due;
    uint64_t reported_order; /* orders of the room that it has been told */
    pal_packet *haptic;      /* newest contact model, unsent */
    /* cycle in transmission: per part a TOPOLOGY_DELTA if its triangles changed, and a FRAME; then TOOLS */
    pal_packet *out[2 * PAL_BODY_MAX + 1];
    int n_out, out_begin;
    uint32_t out_cycle, sent_cycle;
    uint32_t sent_frame[PAL_BODY_MAX];  /* number of the last frame sent, per part */
    bool topology_deltas;               /* accepts TOPOLOGY_DELTA */
    bool moves;                         /* goes where a `move` sends it */
    uint32_t sent_change[PAL_BODY_MAX]; /* last triangle change sent, per part (pal_triangle_slots.change) */
    uint32_t view[PAL_BODY_MAX];        /* subscribed fields, per part: bits 1 << pal_field */
    bool interior[PAL_BODY_MAX];        /* with the values inside */
    bool energy[PAL_BODY_MAX];          /* subscribed to its energies in the status */
    uint64_t sent_values[PAL_BODY_MAX]; /* number of the last values sent (pal_stream_values.made) */
    bool estimate[PAL_BODY_MAX], estimate_due[PAL_BODY_MAX]; /* subscribed; due */
    /* statistics */
    uint64_t n_byte, n_cycle, n_skipped;
    uint64_t status_byte, status_ns;                      /* at the last status */
    uint64_t tier_cycle, tier_skipped, tier_ns, clean_ns; /* window of the tier control */
    /* a command that the world may refuse, without an answer yet: deadline, 0: none; refusals of the session before it;
     * its verb */
    uint64_t answer_until_ns, answer_refused;
    char answer_verb[32];
    uint64_t jobs_until_ns; /* when the time that its edits took is made up for */
    uint64_t pose_error_ns; /* last error about poses */
    uint64_t waits_ns;      /* since when it waits for any tool; 0: it does not */
} pal_client;

/* a replaced asset; a client that knows its path may still request it */
typedef struct pal_hub_old_asset {
    char path[PAL_WIRE_NAME_BYTES];
    pal_packet *asset; /* NULL: none */
} pal_hub_old_asset;

/* edits and switches of one body of a room */
typedef struct pal_hub_body_edits {
    pal_sculptor *sculptor;
    pal_sculpt_edit *edit;            /* edit that made the body's control cells; NULL: the original ones */
    pal_configuration_switch *change; /* switch that made the body's mesh; NULL: the original, or that of edit */
    pal_body_def *base;               /* owned: the body before its first switch; NULL: as it is now */
} pal_hub_body_edits;

/* the last brush requested by a tool's holder */
typedef struct pal_hub_tool_brush {
    int member, body;
    double asked_m[6]; /* positions as received */
    pal_brush brush;   /* kind NONE: none     */
} pal_hub_tool_brush;

/* a command that was carried out */
typedef struct pal_hub_order {
    pal_wire_order order; /* age_s: unused */
    uint64_t at_ns;
} pal_hub_order;

/* how to take back an order that may have made the session slow */
enum { PAL_UNDO_ORDERS = 8 };
typedef struct pal_hub_undo {
    enum { PAL_UNDO_COMMAND, PAL_UNDO_SWITCH, PAL_UNDO_EDIT } kind;
    pal_command command;             /* COMMAND: the former material or state of a component */
    pal_configuration configuration; /* SWITCH: the former one */
    int body, member;
    uint64_t at_ns; /* when it took effect */
    char verb[32], name[PAL_MEMBER_NAME];
} pal_hub_undo;

/* what keep_real_time has given up (hub_watch.c) */
enum { PAL_QUALITY_LEVELS = 4 };
typedef struct pal_hub_quality {
    int n_lowered;
    pal_configuration was[PAL_QUALITY_LEVELS]; /* configurations before each change, the oldest first */
    double cost[PAL_QUALITY_LEVELS];           /* cost of each over that of the cheaper one that replaced it */
    int n_fall;                                /* times that quality has risen, to fall again */
    bool refused;                              /* the session could not be changed: until a member changes it */
    uint64_t slow_ns, spare_ns;                /* since when the session is slow, or has time to spare; 0: it is not */
} pal_hub_quality;

/* one session, as the hub sees it */
typedef struct pal_hub_room {
    pal_hub *hub;
    pal_session *session;
    bool own;            /* the hub closes it: it was opened later, or replaces the given one after an edit or switch */
    pal_session **given; /* where the caller has the session that it gave, and closes; NULL: it is the hub's */
    void *keep;          /* of the source */
    int number;          /* no other room of the hub has or had it */
    struct pal_hub_room *next_closing;
    pal_stream *stream;
    pal_hub_old_asset past[PAL_HUB_OLD_ASSETS]; /* ring buffer, the oldest at oldest_asset */
    int oldest_asset;
    pal_hub_body_edits edits[PAL_BODY_MAX];
    pal_hub_tool_brush brush[PAL_TOOL_MAX];
    pal_member_list members;
    int n_viewer; /* who only watch: not among the members */
    bool members_changed;
    pal_packet *members_message;             /* encoded once for all; NULL: none yet */
    pal_packet *status;                      /* of this tick, without the numbers of a client; NULL: none yet */
    uint64_t news_ns;                        /* when members or orders were told last */
    pal_hub_order order[PAL_WIRE_ORDER_MAX]; /* ring buffer */
    uint64_t n_order, reported_order;
    pal_stream_tool tool[PAL_TOOL_MAX];
    double moved_m[PAL_TOOL_MAX][3]; /* where each tool was, and its buttons, when it last moved, at moved_ns */
    uint32_t moved_buttons[PAL_TOOL_MAX];
    uint64_t moved_ns[PAL_TOOL_MAX];
    struct pal_hub_jobs *jobs; /* NULL until a command needs it */
    double max_load; /* time of a step over that of its length, at most, as predicted, after what a trainee orders */
    pal_hub_undo undo[PAL_UNDO_ORDERS]; /* the oldest first [n_undo] */
    int n_undo;
    pal_hub_quality quality;
    uint64_t slow_ns;   /* since when the session is much slower than real time by its own steps; 0: it is not */
    uint64_t undone_ns; /* when an order was last taken back */
    /* steps without output for lack of observers; tick and OUTPUT runs at the last count */
    uint64_t n_unobserved, seen_tick, seen_output;
    bool was_unobserved;                   /* no observers at the last count */
    int n_estimate[PAL_BODY_MAX];          /* clients subscribed to an estimate */
    bool estimate_requested[PAL_BODY_MAX]; /* the session has been asked for it */
    double step_s;                         /* of the scene as opened: the reference of all costs */
    pal_session_study study;
    pal_session_recording recording;
    uint64_t passed_step; /* of the last edit or switch in the recording that the server went past, or tried to;
                             UINT64_MAX: none since a seek */
    uint64_t left_step;   /* where the session went on live */
    bool reported_far;    /* an estimate above the scene's tolerance has been reported */
    int tier_users[PAL_STREAM_TIER_COUNT];
    pal_stream_subscribers subscribers;
    bool reported[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* the session has been asked for it */
} pal_hub_room;

typedef struct pal_hub_count {
    uint64_t n_frame, n_field, n_delta, n_skipped, n_byte, n_joined, n_refused_join;
    uint64_t n_pose, n_ack, n_control;
    uint64_t n_pose_ignored, n_pose_refused, n_malformed, n_flood, n_stalled, n_overflow;
} pal_hub_count;

typedef struct pal_verb pal_verb;

struct pal_hub {
    pal_loop *loop;
    const pal_session_source *source;  /* NULL: no sessions are opened or ended while it runs */
    struct pal_hub_sessions *sessions; /* NULL: nor did one fail at the start */
    bool open;                         /* whoever comes is what it asks to be */
    const pal_verb *verb;              /* known commands [n_verb], borrowed */
    int n_verb;
    double error_m;
    struct {
        _Atomic uint64_t alive_ns; /* when all was alive */
        _Atomic int n_session, n_client;
    } pulse;              /* written at each tick, read by any thread */
    const char *drain_to; /* "": nowhere */
    pal_site *site;
    pal_admission *admission;
    int n_room, n_numbered, n_client;
    const char *relays;                        /* for who watches and finds no place (relay_list.h); NULL: none */
    int max_members, max_viewers, max_clients; /* max_clients: both, and those who have not joined yet */
    uint32_t n_viewed;                         /* viewers that have joined, in all */
    _Atomic uint64_t ended; /* bit i: session i of those that it was given was ended by an instructor */
    bool leaving;
    uint32_t started_s;                   /* Unix time */
    bool health_on_main;                  /* health and metrics are served beside the rest */
    pal_hub_room *room[PAL_SESSIONS_MAX]; /* [n_room] */
    pal_client *client;                   /* [max_clients] */
    pal_control *control;                 /* scratch, too large for the stack */
    char *text;                           /* scratch [PAL_CONTROL_OUT_MAX] */
    pal_hub_count count;
};
#endif
