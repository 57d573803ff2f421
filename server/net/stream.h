/* The outgoing side of one session. Assets are built once, every frame is encoded once, and the newest messages are
 * kept.
 *
 * A cycle is one output of the simulation (protocol/README.md, "Cycles and credit"): a FRAME per changed part, then
 * one TOOLS message. A frame is self-contained, so the newest messages serve every client: one that keeps up, one that
 * skipped cycles, and one that has just joined. Triangles of adaptive parts are not self-contained: they are sent as
 * differences from the client's table (triangle_slots.h), with the frame of their vertices. A tier is one accuracy of
 * all parts. Tiers without clients and parts without new positions are not encoded. Thread: [net], except open and
 * close [load]. */
#ifndef PAL_NET_STREAM_H
#define PAL_NET_STREAM_H
#include "protocol/control.h"
#include "protocol/frame_codec.h"
#include "server/net/transport/packet.h"
#include "server/net/transport/triangle_slots.h"
#include "server/session/members.h"
#include "server/session/session.h"

enum { PAL_STREAM_TIER_COUNT = 3 }; /* bounds of positions: error_m times PAL_TIER_FACTORS */

/* newest values of a field; of its vertices (FIELD) or of its interior (INTERIOR) */
typedef struct pal_stream_values {
    pal_packet *packet; /* NULL: no subscriber or none yet          */
    uint64_t made;      /* a new number for every message           */
    uint64_t revision;  /* of the last encoding                     */
    uint64_t due_ns;    /* earliest time of the next encoding       */
} pal_stream_values;

typedef struct pal_stream_part {
    pal_wire_part_info info;
    pal_packet *asset;
    pal_packet *image[PAL_IMAGES_MAX];            /* [info.n_image] */
    pal_packet *control_cells;                    /* of a sculptable part, else NULL */
    pal_packet *frame[PAL_STREAM_TIER_COUNT];     /* newest; NULL before the first */
    uint32_t frame_seq[PAL_STREAM_TIER_COUNT];    /* its number: increases per part, across all tiers */
    uint32_t frame_cycle[PAL_STREAM_TIER_COUNT];  /* cycle that it belongs to */
    uint32_t frame_change[PAL_STREAM_TIER_COUNT]; /* triangle table that it belongs to (pal_triangle_slots.change) */
    uint64_t frame_output[PAL_STREAM_TIER_COUNT]; /* pal_frame_part.n_output of the last encoding */
    pal_triangle_slots *slots;                    /* of an adaptive part, else NULL */
    pal_stream_values field[PAL_FIELD_COUNT], interior[PAL_FIELD_COUNT];
    pal_packet *interior_asset; /* NULL: no interior */
    uint32_t n_node;            /* of the interior */
} pal_stream_part;

typedef struct pal_stream_count { /* totals for metrics */
    uint64_t n_encode, encode_ns, n_frame_byte, n_refused_frame;
    uint64_t n_field;
} pal_stream_count;

enum { PAL_STEP_BOUNDS = 9 };
extern const double pal_step_bound_s[PAL_STEP_BOUNDS]; /* of the histogram of steps in /metrics */

typedef struct pal_stream {
    pal_session *session;
    const pal_scene *scene;
    const pal_frame *frame; /* newest taken, owned by the session; NULL before the first */
    uint32_t cycle;         /* increases by one per frame taken; 0: none yet */
    uint64_t cycle_ns;      /* time of the last cycle */
    int n_part;
    pal_stream_part part[PAL_BODY_MAX]; /* [n_part] */
    pal_packet *tools;                  /* completes the newest cycle */
    pal_packet *haptic[PAL_TOOL_MAX];   /* newest contact model of each tool in the scene; NULL: none */
    double box_min_m[3], box_max_m[3];
    double error_m;
    /* smoothed, for status */
    double component_ms[PAL_FRAME_COMPONENT_MAX], step_ms, step_rate_hz;
    /* processor time of the steps that were seen: how many took at most each bound and more than the one before, and
     * the sum, s */
    uint64_t n_step[PAL_STEP_BOUNDS + 1];
    double step_sum_s;
    uint64_t counted_tick; /* of the last of them */
    pal_stream_count count;
    /* encoders and their buffer */
    pal_frame_encoder *encoder[PAL_BODY_MAX][PAL_STREAM_TIER_COUNT];
    uint32_t seq[PAL_BODY_MAX]; /* of the last frame, per part, across all tiers */
    uint8_t *buffer;            /* [cap] */
    size_t cap;
    double force_error2_N2[PAL_TOOL_MAX]; /* mean square of a device's force less the server's, of a second */
    uint32_t haptic_seq[PAL_TOOL_MAX];    /* of the newest contact model of each tool */
    uint64_t field_seq;
    uint64_t rate_tick, rate_ns;
    int n_component; /* of the last frame */
} pal_stream;

/* Builds the assets (about 0.2 s for 50,000 displayed vertices) and the encoders. Borrows the session. error_m 0:
 * 1/3000 of the longest side of the box, at most 0.05 mm. [load] */
pal_err pal_stream_open(pal_session *session, double error_m, pal_diagnostic *diag, pal_stream **out);
void pal_stream_close(pal_stream *stream); /* NULL is fine. [load] */

/* Lets a new stream, which has sent nothing, replace another with the same bodies: cycles and numbers continue, epochs
 * increase by one. The other can only be closed. [net] */
void pal_stream_transfer(pal_stream *stream, const pal_stream *before);

/* properties of a tool that only the hub knows */
typedef struct pal_stream_tool {
    int holder; /* member id; 0: none */
    uint32_t colour;
    uint64_t taken_ns; /* when the holder took it; older poses are not echoed */
} pal_stream_tool;

/* what the server knows of the devices of held tools; device [PAL_TOOL_MAX], returns how many */
int pal_stream_devices(const pal_stream *stream, const pal_stream_tool tool[PAL_TOOL_MAX], pal_wire_device *device);
/* Takes the session's newest frame and makes a cycle of it: encodes the tiers with used[] true, tools, and contact
 * models. now_ns: time of the session's clock. false: no new frame. */
bool pal_stream_update(pal_stream *stream, uint64_t now_ns, const bool used[PAL_STREAM_TIER_COUNT],
                       const pal_stream_tool tool[PAL_TOOL_MAX]);
/* clients subscribed to a field, and those of them that take its interior */
typedef struct pal_stream_subscribers {
    int n_field[PAL_BODY_MAX][PAL_FIELD_COUNT], n_interior[PAL_BODY_MAX][PAL_FIELD_COUNT];
    int n_energy[PAL_BODY_MAX]; /* clients that take its energies: of the field energy, without its values */
} pal_stream_subscribers;
/* Encodes the newest values that have subscribers and drops the others. true: new values; *due_ns: time of the next
 * call for values that came too early, 0: none. */
bool pal_stream_fields(pal_stream *stream, uint64_t now_ns, const pal_stream_subscribers *of, uint64_t *due_ns);
/* Starts a tier for its first client: re-encodes its frames from the newest positions (same cycle). Their numbers
 * exceed those of every tier, because a client requires increasing numbers (protocol/README.md, "FRAME"). */
void pal_stream_begin_tier(pal_stream *stream, int tier);
double pal_stream_tier_error_m(const pal_stream *stream, int tier);
double pal_stream_rate_hz(const pal_stream *stream); /* of cycles: the scene's step rate, at most PAL_STREAM_RATE_HZ */
/* measures steps per second; call about three times a second */
void pal_stream_measure(pal_stream *stream, uint64_t now_ns);
/* fills hello except `you`, credit and components */
void pal_stream_hello(const pal_stream *stream, pal_wire_hello *out);
#endif
