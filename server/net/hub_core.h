/* The records of the hub: clients, rooms, counts. Every file of the hub knows them; they know no file. Thread: [net].
 */
#ifndef PAL_NET_HUB_CORE_H
#define PAL_NET_HUB_CORE_H
#include "server/net/stream.h"
#include "server/net/transport/credit.h"
#include "server/net/transport/site.h"
#include "server/net/transport/transport.h"
#include "server/sim/core/configuration.h"

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
    bool topology_deltas;               /* takes TOPOLOGY_DELTA                                     */
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
    bool reported_far;  /* that an estimate is beyond what the scene asks for */
    int tier_users[PAL_STREAM_TIER];
    int n_look[PAL_BODY_MAX][PAL_FIELD_COUNT];    /* clients that look at a field   */
    bool reported[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* the session knows that some do */
} pal_hub_room;

typedef struct pal_hub_count {
    uint64_t n_frame, n_field, n_patch, n_skipped, n_byte, n_joined, n_refused_join;
    uint64_t n_pose, n_ack, n_control;
    uint64_t n_pose_ignored, n_pose_refused, n_malformed, n_flood, n_stalled, n_overflow;
} pal_hub_count;

typedef struct pal_hub_jobs pal_hub_jobs;
typedef struct pal_verb pal_verb;

typedef struct pal_hub {
    pal_loop *loop;
    pal_session **session; /* the caller's array [n_room] */
    pal_hub_jobs *jobs;    /* NULL until a command needs them */
    const pal_verb *verb;  /* commands that are known [n_verb], borrowed */
    int n_verb;
    double error_m;
    pal_site *site;
    int n_room, max_clients, n_client;
    bool leaving;
    pal_hub_room *room;   /* [n_room] */
    pal_client *client;   /* [max_clients] */
    pal_control *control; /* scratch: it is large */
    char *text;           /* scratch [PAL_CONTROL_OUT_MAX] */
    pal_hub_count count;
} pal_hub;
#endif
