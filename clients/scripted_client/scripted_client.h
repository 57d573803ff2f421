/* One headless trainee: joins, moves its tool by a script, checks every message, measures.
 *
 * Checked: every FRAME decodes, belongs to a known part and epoch, its seq grows, its positions are finite and within
 * the scene's box grown by its own size, its quantisation keeps the stated error (coarser steps for a client that does
 * not keep up are counted); cycles never go back, no frame comes before its cycle; assets have the hash of their name;
 * nothing malformed. A field that was asked for is of a known part, of its number of vertices, of the kind asked for,
 * in a range of no negative numbers, and no other field comes. A TOPOLOGY_DELTA is of a known part that adapts, its
 * revision grows, it fits the table of triangles that the asset and the patches before it gave, and a frame of the part
 * follows in the same cycle, before any other part's. What is of an older epoch is nobody's until the first frame of
 * the newer one has come. A wish broken is counted under its name. Measured: pose to frame = own clock now minus the
 * own stamp echoed in TOOLS, once per new pose. Thread: [net]. */
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
    X(PATCH, "a patch of triangles does not fit or comes without its frame")                                           \
    X(ASSET, "an asset is missing, damaged or not what its name says")                                                 \
    X(CLOSED, "the server closed the connection for a fault of ours")
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
    const char *field;               /* to ask for, of every part that gives it; NULL: none     */
    int tool;                        /* index or PAL_WIRE_TOOL_ANY                              */
    double rate_hz;                  /* of poses                                                */
    double depth_m;                  /* of press and pull; 0: 8 % of the box, at most 10 mm     */
    double up[3];
    int index, n_client;      /* which of several: each touches its own place            */
    double read_bytes_s;      /* > 0: slow reader                                        */
    double stall_s;           /* > 0: reads nothing for this long, one second after the first cycle */
    const pal_orders *orders; /* to be given, as an instructor; borrowed; NULL: none               */
    void (*reported)(void *user, const pal_order_result *reported); /* what came of each; NULL: nobody         */
    void *user;
} pal_scripted_client_options;

typedef struct pal_scripted_client_result {
    bool joined, stall_done;
    int tool;                          /* held at the end, PAL_WIRE_TOOL_NONE        */
    uint32_t joins, n_old_after_stall; /* cycles after a stall whose pose is older than half of it */
    uint64_t n_frame, n_coarse, n_cycle, n_pose, bytes_in;
    uint64_t fault[PAL_FAULT_COUNT];
    char first_fault[256], closed[160];
    double seconds; /* from hello to now                          */
    double moved_m; /* largest distance of a vertex from its place in the first frame */
    double force_N; /* largest force on the own tool              */
    uint64_t asset_bytes;
    uint64_t n_field, field_bytes;
    double field_low, field_high; /* of all values that came, SI                */
    double field_s;               /* from the first field to the last           */
    uint64_t n_patch, patch_bytes;
    uint32_t n_triangle, n_place;              /* drawn now, and places, of all parts that adapt */
    bool field_given;                          /* a part of the session gives what was asked for */
    uint32_t n_member;                         /* of the session, itself too                   */
    uint32_t n_topology;                       /* other topologies that came                   */
    uint64_t n_cycle_since_topology;           /* cycles since a frame of the last one, or join, was seen */
    int n_order, n_refused;                    /* answered, and those of them that might not fail and did */
    char refused[256];                         /* the first of these                           */
    pal_samples latency_ms, decode_ms, gap_ms; /* owned by the trainee */
} pal_scripted_client_result;

/* borrows loop and store until destroy; REFUSED: URL or script */
pal_err pal_scripted_client_open(pal_link_loop *loop, pal_asset_store *store,
                                 const pal_scripted_client_options *options, pal_diagnostic *diag,
                                 pal_scripted_client **out);
void pal_scripted_client_destroy(pal_scripted_client *t); /* after the loop is destroyed; NULL is fine */
/* an asset of the store became ready or failed */
void pal_scripted_client_asset_changed(pal_scripted_client *t, const pal_stored_asset *asset);
const pal_scripted_client_result *pal_scripted_client_get_result(pal_scripted_client *t);
/* has the script been able to run: joined and (unless idle) holds a tool */
bool pal_scripted_client_is_active(const pal_scripted_client *t);
bool pal_scripted_client_has_ended(const pal_scripted_client *t); /* the link will not come back */
#endif
