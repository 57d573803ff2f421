/* What hub.c, hub_input.c, hub_fields.c, hub_jobs.c, hub_sculpt.c, hub_switch.c, hub_plan.c, hub_accuracy.c and
 * http_pages.c share: the hub's records. Private to these. Thread: [net]. */
#ifndef PAL_NET_HUB_CORE_H
#define PAL_NET_HUB_CORE_H
#include "server/net/credit.h"
#include "server/net/hub.h"

enum { PAL_HUB_QUEUE = 32, PAL_HUB_OLD_ASSETS = 8 };

struct pal_hub_room;

/* one peer that has come; a free place has peer NULL */
typedef struct pal_client {
    pal_peer *peer;
    struct pal_hub_room *room;
    int id; /* member, 0: has not joined */
    uint64_t opened_ns;
    pal_bucket bucket;
    pal_credit credit;
    int tier;
    /* control that waits, oldest first, and what is made when asked for */
    pal_packet *queue[PAL_HUB_QUEUE];
    int queue_begin, n_queue;
    bool members_due, status_due;
    pal_packet *haptic; /* newest, unsent */
    /* the cycle that is being sent: of each part a patch if its triangles changed, and a frame; then tools */
    pal_packet *out[2 * PAL_BODY_MAX + 1];
    int n_out, out_begin;
    uint32_t out_cycle, sent_cycle;
    uint32_t sent_frame[PAL_BODY_MAX];  /* number of the frame of each part sent last */
    bool topology_deltas;               /* takes PATCH                                     */
    uint32_t sent_change[PAL_BODY_MAX]; /* triangles that it has of each part, of pal_triangle_slots.change */
    uint8_t view[PAL_BODY_MAX];         /* pal_field looked at, of each part         */
    uint64_t sent_field[PAL_BODY_MAX];  /* number of the values sent last            */
    bool estimate[PAL_BODY_MAX], estimate_due[PAL_BODY_MAX]; /* looked at; to be sent */
    /* figures */
    uint64_t n_byte, n_cycle, n_skipped;
    uint64_t status_byte, status_ns;                      /* at the last status                   */
    uint64_t tier_cycle, tier_skipped, tier_ns, clean_ns; /* of the tier's window   */
    /* an order about a row that is not answered yet, until when; 0: none; what the session had refused before */
    uint64_t component_until_ns, component_refused;
    uint64_t pose_error_ns; /* last error about poses               */
} pal_client;

/* an asset that was shown before: who was told of it may still be asking for it */
typedef struct pal_hub_old_asset {
    char path[PAL_WIRE_NAME_BYTES];
    pal_packet *asset; /* NULL: none */
} pal_hub_old_asset;

/* one session as the hub sees it */
typedef struct pal_hub_room {
    pal_session *session;
    bool own; /* the hub made it: sculpting or a switch has replaced the one that was given */
    pal_stream *stream;
    pal_hub_old_asset past[PAL_HUB_OLD_ASSETS]; /* as a ring, the oldest at n_old_asset */
    int n_old_asset;
    pal_member_list members;
    pal_stream_tool tool[PAL_TOOL_MAX];
    pal_material material[PAL_BODY_MAX]; /* as last asked for */
    /* steps of which nothing was shown because nobody was here; tick and OUTPUT runs when they were counted last */
    uint64_t n_unobserved, seen_tick, seen_output;
    bool was_unobserved;                   /* nobody was here then */
    int n_estimate[PAL_BODY_MAX];          /* clients that look at an estimate */
    bool estimate_requested[PAL_BODY_MAX]; /* the session knows that some do */
    double step_s;                         /* of the scene as it was opened: what all prices are for */
    const pal_measured_configuration
        *setting; /* what a study found, for body setting_body [n_configuration]; NULL: no study */
    int n_configuration, setting_body;
    double reference_m; /* the study's reference's own error; NaN: not known */
    bool told_far;      /* that an estimate is beyond what the scene asks for */
    int tier_users[PAL_STREAM_TIER];
    int n_look[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* clients that look at a field   */
    bool told[PAL_BODY_MAX][PAL_FIELD_COUNT];  /* the session knows that some do */
} pal_hub_room;

typedef struct pal_hub_count {
    uint64_t n_frame, n_field, n_patch, n_skipped, n_byte, n_joined, n_refused_join;
    uint64_t n_pose, n_ack, n_control;
    uint64_t n_pose_ignored, n_pose_refused, n_malformed, n_flood, n_stalled, n_overflow;
} pal_hub_count;

typedef struct pal_hub_jobs pal_hub_jobs;

struct pal_hub {
    pal_loop *loop;
    pal_session **session; /* the caller's array [n_room] */
    pal_hub_jobs *jobs;    /* NULL until somebody sculpts or switches */
    double error_m;
    pal_site *site;
    int n_room, max_clients, n_client;
    bool leaving;
    pal_hub_room *room;   /* [n_room] */
    pal_client *client;   /* [max_clients] */
    pal_control *control; /* scratch: it is large */
    char *text;           /* scratch [PAL_CONTROL_OUT_MAX] */
    pal_hub_count count;
};

/* hub.c */
pal_packet *pal_hub_encode(pal_hub *hub, const pal_control *control);            /* NULL: it cannot be, logged */
void pal_hub_send(pal_hub *hub, pal_client *client, const pal_control *control); /* queues; overflow drops the client */
void pal_hub_send_error(pal_hub *hub, pal_client *client, const char *code, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void pal_hub_drop(pal_hub *hub, pal_client *client, int code, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void pal_hub_members_changed(pal_hub *hub, pal_hub_room *room);
void pal_hub_set_tier(pal_hub *hub, pal_client *client, int tier);
uint32_t pal_hub_colour(int id);
/* hub_input.c */
void pal_hub_received(void *hub, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text);
void pal_hub_release_tool(pal_hub_room *room, int tool); /* nobody holds it any more: it is lifted out */
/* hub_fields.c */
void pal_hub_subscribe_field(pal_hub *hub, pal_client *client,
                             const pal_wire_field_subscription *view); /* what a client asks to see */
void pal_hub_unsubscribe_fields(pal_client *client);                   /* it goes */
void pal_hub_update_fields(pal_hub_room *room);                        /* what the session does not know yet */
bool pal_hub_wants_field(const pal_client *client);
pal_packet *pal_hub_next_field(pal_hub *hub, pal_client *client); /* NULL: none to be sent now */
/* encodes what is new; the result is when to come again, 0: nothing waits */
uint64_t pal_hub_make_fields(pal_hub *hub, pal_hub_room *room, uint64_t now_ns);
/* hub_sculpt.c */
/* an order that is one of sculpting is dealt with, now or when its turn comes; false: it is none */
bool pal_hub_sculpt_command(pal_hub *hub, pal_client *client, const pal_wire_command *order);
/* hub_switch.c: the same for an order that asks for another setting */
bool pal_hub_switch_command(pal_hub *hub, pal_client *client, const pal_wire_command *order);
/* hub_jobs.c */
void pal_hub_jobs_update(pal_hub *hub); /* what the workshop has done, and the next order */
void pal_hub_jobs_end(pal_hub *hub);    /* closes the sessions that the hub made */
/* hub_accuracy.c */
#define PAL_HUB_ESTIMATE_OLD_S 1.0 /* of steps awake: an older estimate bounds no switch */
/* the order `estimate` is dealt with; false: it is another one */
bool pal_hub_estimate_command(pal_hub *hub, pal_client *client, const pal_wire_command *order);
void pal_hub_unsubscribe_estimates(pal_client *client); /* it goes */
void pal_hub_update_estimates(pal_hub_room *room);      /* what the session does not know yet */
void pal_hub_estimates_due(pal_client *client);         /* a tick */
bool pal_hub_wants_estimate(const pal_client *client);
pal_packet *pal_hub_next_estimate(pal_hub *hub, pal_client *client); /* NULL: none is due */
/* the errors that clients are shown of the setting that a body has (its estimate's, else its study's) and of the one
 * that it shall have (point: of the study; -1: its neighbour's, else the study's); NaN: none is shown. Neither of a
 * body whose estimate is now older than PAL_HUB_ESTIMATE_OLD_S of its steps, or that has woken since */
void pal_hub_shown_errors(const pal_hub_room *room, int body, int point, const pal_configuration *to, double *now_m,
                          double *then_m);
/* hub_plan.c */
void pal_hub_hello_components(const pal_hub_room *room, pal_wire_hello *out);
void pal_hub_topology_components(const pal_hub_room *room, pal_wire_topology *out);
void pal_hub_count_unobserved(pal_hub_room *room);
void pal_hub_status_plan(const pal_hub_room *room, const pal_frame *frame, pal_wire_status *out); /* rows and bodies */
/* what the world refused of the client's order about a row is told as an error */
void pal_hub_component_result(pal_hub *hub, pal_client *c);
/* an order about rows or single bodies is dealt with; false: it is another one */
bool pal_hub_plan_command(pal_hub *hub, pal_client *client, const pal_wire_command *order);
/* http_pages.c */
void pal_hub_get(void *hub, const char *path, pal_reply *reply);
#endif
