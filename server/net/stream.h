/* The outgoing side of one session: assets built once, every frame encoded once, the newest messages kept.
 *
 * A cycle is one simulation output (protocol/README.md, "Cycles and credit"): FRAME messages of the parts that look
 * different, one TOOLS message. Frames stand alone, so the newest messages serve everybody: the client that keeps up,
 * the one that skipped cycles, and the one that has just come. Triangles of parts that adapt do not stand alone: they
 * go as differences to what the client has (triangle_slots.h), with the frame of their vertices. Tiers are accuracies
 * of the same part; a tier that nobody uses is not encoded, nor is a part whose positions were not computed anew.
 * Thread: [net], except open and close [load]. */
#ifndef PAL_NET_STREAM_H
#define PAL_NET_STREAM_H
#include "protocol/control.h"
#include "server/net/transport/packet.h"
#include "server/net/triangle_slots.h"
#include "server/session/members.h"
#include "server/session/session.h"

enum { PAL_STREAM_TIER = 3 };     /* 0: error_m; then 2 and 5 times that */
#define PAL_STREAM_RATE_HZ  120.0 /* cycles per second at most */
#define PAL_STREAM_FIELD_HZ 10.0  /* values of a field per second at most */

typedef struct pal_stream_part {
    pal_wire_part_info info;
    pal_packet *asset;
    pal_packet *frame[PAL_STREAM_TIER];       /* newest, NULL before the first          */
    uint32_t frame_seq[PAL_STREAM_TIER];      /* its number: grows per part, all tiers together */
    uint32_t frame_cycle[PAL_STREAM_TIER];    /* cycle that made it                     */
    uint32_t frame_change[PAL_STREAM_TIER];   /* table of triangles that it belongs to, of pal_triangle_slots.change */
    uint64_t frame_output[PAL_STREAM_TIER];   /* pal_frame_part.n_output that was encoded last */
    pal_triangle_slots *places;               /* of a part that adapts, else NULL       */
    pal_packet *field[PAL_FIELD_COUNT];       /* newest values, NULL: nobody looks or none yet */
    uint64_t field_made[PAL_FIELD_COUNT];     /* another number for every message       */
    uint64_t field_revision[PAL_FIELD_COUNT]; /* of what was encoded last            */
    uint64_t field_due_ns[PAL_FIELD_COUNT];   /* not before then again               */
} pal_stream_part;

typedef struct pal_stream_count { /* totals for metrics */
    uint64_t n_encode, encode_ns, n_frame_byte, n_refused_frame;
    uint64_t n_field, n_field_byte;
} pal_stream_count;

typedef struct pal_stream {
    pal_session *session;
    const pal_scene *scene;
    const pal_frame *frame; /* newest taken, NULL before the first; the session's memory */
    uint32_t cycle;         /* grows by one per frame taken; 0: none yet                  */
    uint64_t cycle_ns;      /* when the last cycle was made                               */
    int n_part;
    pal_stream_part *part;            /* [n_part] */
    pal_packet *tools;                /* closes the newest cycle */
    pal_packet *haptic[PAL_TOOL_MAX]; /* newest contact model of each tool in the scene, NULL: none */
    double box_min_m[3], box_max_m[3];
    double error_m;
    /* smoothed figures for status */
    double component_ms[PAL_FRAME_COMPONENT_MAX], step_ms, step_rate_hz;
    pal_stream_count count;
    struct pal_stream_coder *coder; /* encoders and their buffer */
} pal_stream;

/* builds assets (about a second for 50,000 shown vertices) and encoders; borrows the session; error_m 0: 1/3000 of the
 * longest side of the box, at most 0.05 mm. [load] */
pal_err pal_stream_open(pal_session *session, double error_m, pal_diagnostic *diag, pal_stream **out);
void pal_stream_close(pal_stream *stream); /* NULL is fine. [load] */

/* a stream that has sent nothing yet goes on where another of the same session's bodies is: cycles and numbers count
 * on, epochs are one higher; the other only closes. [net] */
void pal_stream_transfer(pal_stream *stream, const pal_stream *before);

/* what the hub knows of a tool and a step does not */
typedef struct pal_stream_tool {
    int holder; /* member id, 0: nobody                                                       */
    uint32_t colour;
    uint64_t taken_ns; /* pal_clock_ns when the holder took it: older poses are not his to echo     */
} pal_stream_tool;

/* member ids grow for ever, on the wire they have 16 bits; 0 stays 0 */
uint16_t pal_stream_wire_id(int member);
/* takes the session's newest frame, if there is a new one, and makes a cycle of it: encodes the tiers of which used[]
 * is true, tools, contact models. false: nothing new. */
bool pal_stream_update(pal_stream *stream, uint64_t now_ns, const bool used[PAL_STREAM_TIER],
                       const pal_stream_tool tool[PAL_TOOL_MAX]);
/* encodes the newest values of every field that n_look clients look at, drops those of the others. true: there is
 * something new; *due_ns: when values that came too soon may be encoded, 0: none wait */
bool pal_stream_fields(pal_stream *stream, uint64_t now_ns, int n_look[PAL_BODY_MAX][PAL_FIELD_COUNT],
                       uint64_t *due_ns);
/* somebody comes to a tier: its frames are encoded anew from the newest positions (same cycle), under numbers that are
 * higher than those of every tier, for a client's numbers grow (protocol/README.md, "FRAME") */
void pal_stream_begin_tier(pal_stream *stream, int tier);
double pal_stream_tier_error_m(const pal_stream *stream, int tier);
double pal_stream_rate_hz(const pal_stream *stream); /* of cycles: the scene's steps, at most PAL_STREAM_RATE_HZ */
/* measured steps per second; call about three times a second */
void pal_stream_measure(pal_stream *stream, uint64_t now_ns);
/* fills hello but for `you`, credit and rows */
void pal_stream_hello(const pal_stream *stream, pal_wire_hello *out);
#endif
