/* A headless scripted client: joins, moves its tool by a script, checks every message, and measures. A violation is
 * counted under the name of its fault.
 *
 * Checks:
 *   - Every FRAME decodes and belongs to a known part and epoch; its seq increases. Positions are finite and within the
 *     scene's box enlarged by its own size. The quantisation keeps the stated error. Coarser steps, sent to a client
 *     that falls behind, are counted.
 *   - Cycles never decrease; no frame precedes its cycle. Assets match the hash in their name. No message is malformed.
 *   - A field belongs to a known part, has its number of vertices and the requested kind, and a range without negative
 *     numbers. Unrequested fields are faults.
 *   - A TOPOLOGY_DELTA belongs to a known adaptive part, its revision increases, and it fits the triangle table built
 *     from the asset and the earlier updates. A frame of the part follows in the same cycle, before any other part's.
 *   - Messages of an older epoch are ignored until the first frame of the newer epoch.
 *
 * Measures the latency from pose to frame: own clock minus own stamp echoed in TOOLS, once per new pose. Thread:
 * [net]. */
#ifndef PAL_SCRIPTED_CLIENT_SCRIPTED_CLIENT_H
#define PAL_SCRIPTED_CLIENT_SCRIPTED_CLIENT_H
#include "clients/link/asset_store.h"
#include "clients/link/triangle_table.h"
#include "clients/scripted_client/orders.h"
#include "clients/scripted_client/samples.h"
#include "clients/scripted_client/script.h"

/* X(name, sentence) */
#define PAL_FAULT_TABLE(X)                                                                                             \
    X(MALFORMED, "a message is not well-formed")                                                                       \
    X(DECODE, "a frame does not decode")                                                                               \
    X(PART, "a frame of an unknown part")                                                                              \
    X(EPOCH, "a frame of an older epoch after a newer one")                                                            \
    X(SEQ, "a part's seq does not grow")                                                                               \
    X(CYCLE, "a cycle number goes back or a frame comes before its cycle")                                             \
    X(BOUND, "a frame's step is too coarse for the stated error")                                                      \
    X(PLACE, "a vertex lies far outside the scene or is not finite")                                                   \
    X(FIELD, "a field is not what was asked for")                                                                      \
    X(TOPOLOGY_DELTA, "a topology delta does not fit or comes without its frame")                                      \
    X(ASSET, "an asset is missing, damaged or not what its name says")                                                 \
    X(CLOSED, "the server refused the client")
typedef enum pal_fault {
#define X(code, text) PAL_FAULT_##code,
    PAL_FAULT_TABLE(X)
#undef X
        PAL_FAULT_COUNT
} pal_fault;
const char *pal_fault_name(pal_fault fault);

typedef struct pal_scripted_client pal_scripted_client;

typedef struct pal_scripted_client_options {
    const char *url, *name, *script; /* borrowed                                                */
    const char *field;               /* to request, of every part that has it; NULL: none */
    int tool;                        /* index or PAL_WIRE_TOOL_ANY                              */
    double rate_hz;                  /* of poses                                                */
    double depth_m;                  /* of press and pull; 0: 8 % of the box, at most 10 mm */
    double up[3];
    int index, n_client;      /* number of this client among n_client; each touches its own point */
    double read_bytes_s;      /* > 0: read limit, bytes per second */
    double stall_s;           /* > 0: stops reading for this time, one second after the first cycle */
    const pal_orders *orders; /* commands to send, as an instructor; borrowed; NULL: none */
    void (*reported)(void *user, const pal_order_result *reported); /* called with each result; NULL: none */
    void *user;
} pal_scripted_client_options;

typedef struct pal_scripted_client_result {
    bool joined, stall_done;
    int tool;                          /* at the end; PAL_WIRE_TOOL_NONE: none */
    uint32_t joins, n_old_after_stall; /* n_old_after_stall: cycles after a stall with a pose older than half of it */
    uint64_t n_frame, n_coarse, n_cycle, n_cycle_after_stall, n_pose, bytes_in;
    uint64_t fault[PAL_FAULT_COUNT];
    char first_fault[256], closed[160];
    double seconds; /* from hello to now */
    double moved_m; /* largest displacement of a vertex since the first frame */
    double force_N; /* largest force on the own tool */
    uint64_t asset_bytes;
    uint64_t n_field, field_bytes;
    double field_low, field_high; /* range of all values received, SI */
    double field_s;               /* from the first field to the last */
    uint64_t n_delta, delta_bytes;
    uint32_t n_triangle, n_slot;     /* non-empty triangles now, and slots, of all adaptive parts */
    bool field_given;                /* a part of the session has the requested field */
    uint32_t n_member;               /* in the session, including itself */
    uint32_t n_topology;             /* topologies received after the first */
    uint64_t n_cycle_since_topology; /* cycles since the first frame of the last topology, or since the join */
    int n_order, n_refused;          /* answered; unexpected refusals among them */
    char refused[256];               /* the first unexpected refusal */
    pal_samples latency_ms, decode_ms, gap_ms; /* owned by the client */
} pal_scripted_client_result;

/* borrows loop and store until destroy; REFUSED: URL or script */
pal_err pal_scripted_client_open(pal_link_loop *loop, pal_asset_store *store,
                                 const pal_scripted_client_options *options, pal_diagnostic *diag,
                                 pal_scripted_client **out);
void pal_scripted_client_destroy(pal_scripted_client *t); /* after the loop is destroyed; NULL is fine */
/* an asset of the store became ready or failed */
void pal_scripted_client_asset_changed(pal_scripted_client *t, const pal_stored_asset *asset);
const pal_scripted_client_result *pal_scripted_client_get_result(pal_scripted_client *t);
/* What a client has seen, for end_condition.h: NAME, amount. SI units except moved_mm */
#define PAL_CLIENT_SEEN_TABLE(X)                                                                                       \
    X(cycles, (double)r->n_cycle)                                                                                      \
    X(frames, (double)r->n_frame)                                                                                      \
    X(answered, (double)r->latency_ms.n) /* poses echoed in frames */                                                  \
    X(fields, (double)r->n_field)                                                                                      \
    X(deltas, (double)r->n_delta)                                                                                      \
    X(triangles, (double)r->n_triangle)                                                                                \
    X(field_high, r->field_high)                                                                                       \
    X(orders, (double)r->n_order)                                                                                      \
    X(topologies, (double)r->n_topology)                                                                               \
    X(cycles_of_it, (double)r->n_cycle_since_topology) /* since the last topology or join */                           \
    X(members, (double)r->n_member)                    /* in the session */                                            \
    X(joins, (double)r->joins)                                                                                         \
    X(stalls, (double)r->stall_done)                                                                                   \
    X(cycles_after_stall, (double)r->n_cycle_after_stall)                                                              \
    X(moved_mm, r->moved_m * 1e3)                                                                                      \
    X(force_N, r->force_N)
enum {
#define X(name, amount) PAL_CLIENT_SEEN_##name,
    PAL_CLIENT_SEEN_TABLE(X)
#undef X
        PAL_CLIENT_SEEN_COUNT
};
extern const char *const pal_client_seen_name[PAL_CLIENT_SEEN_COUNT];
void pal_client_seen(const pal_scripted_client_result *r, double seen[PAL_CLIENT_SEEN_COUNT]);
bool pal_scripted_client_has_ended(const pal_scripted_client *t); /* the link will not reconnect */
#endif
