/* The triangle table of one adaptive part, as a server or a relay sends it: the newest triangles, the change that last
 * wrote each entry, and the TOPOLOGY_DELTA messages that bring a client from any earlier change to the newest.
 *
 * Changes are numbered; 0 is the asset. A client is described by its change number alone, so clients that skipped
 * cycles, changed tier or just joined need no special case, and clients at the same number share one packet. Thread:
 * [net], except make and free [load]; of a relay whoever has its lock. */
#ifndef PAL_NET_TRIANGLE_SLOTS_H
#define PAL_NET_TRIANGLE_SLOTS_H
#include "server/base/err.h"
#include "server/net/transport/packet.h"

enum { PAL_TRIANGLE_DELTAS_KEPT = 4 }; /* messages to the newest change that are kept for reuse */

typedef struct pal_triangle_slots {
    uint16_t part;
    uint32_t epoch;
    uint32_t n_slot, n_vertex;
    uint32_t *tri;     /* current table [n_slot][3] */
    uint32_t *written; /* last change that wrote the entry; 0: none [n_slot] */
    uint32_t *n_use;   /* triangles at each vertex [n_vertex] */
    uint8_t *hidden;   /* 1: in no triangle [n_vertex] */
    uint32_t change;   /* number of the newest change */
    uint64_t revision; /* of the last frame, and of the frame that brought the newest change */
    uint64_t changed_revision;
    struct {
        uint32_t from;
        pal_packet *packet; /* NULL: none */
    } made[PAL_TRIANGLE_DELTAS_KEPT];
    int next;                 /* index in made of the next message */
    uint64_t n_delta, n_byte; /* encoded so far */
} pal_triangle_slots;

/* copies tri [n_slot][3], the table of the part's asset; name: of the part. BUDGET: more entries than can be streamed;
 * MEMORY */
pal_err pal_triangle_slots_make(int part, const char *name, uint32_t epoch, const int32_t *tri, uint32_t n_slot,
                                uint32_t n_vertex, pal_diagnostic *diag, pal_triangle_slots **out);
void pal_triangle_slots_free(pal_triangle_slots *slots); /* NULL is fine */
/* Applies the table of a frame [n_slot][3]; skips the comparison when the revision is unchanged. true: the table
 * changed. A triangle with a corner that is not a vertex counts as empty. */
bool pal_triangle_slots_update(pal_triangle_slots *slots, const int32_t *slot, uint64_t revision);
/* the message with every entry changed after change `from`; the caller owns one reference. NULL: none, or out of
 * memory */
pal_packet *pal_triangle_slots_delta(pal_triangle_slots *slots, uint32_t from);
#endif
