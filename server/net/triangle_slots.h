/* The table of triangles of a part that adapts, as its clients are told of it: what the newest frame has, which change
 * wrote each place last, and the patches that bring a client from any earlier change to now.
 *
 * Changes are numbered; 0 is the asset. A client needs no more than the number it has, so one that skipped cycles,
 * changed its accuracy or has just come is served alike, and clients at the same number share one packet.
 * Thread: [net], except make and free [load]. */
#ifndef PAL_NET_TRIANGLE_SLOTS_H
#define PAL_NET_TRIANGLE_SLOTS_H
#include "server/base/err.h"
#include "server/net/transport/packet.h"
#include "server/sim/world/world.h"

enum { PAL_TRIANGLE_DELTAS_KEPT = 4 }; /* patches to the newest change that are kept for the next client */

typedef struct pal_triangle_slots {
    uint16_t part;
    uint32_t epoch;
    uint32_t n_place, n_vertex;
    uint32_t *tri;     /* table as it is now                                 [n_place][3] */
    uint32_t *written; /* number of the change that wrote it last, 0: none   [n_place]    */
    uint32_t *n_use;   /* triangles at each vertex                           [n_vertex]  */
    uint8_t *hidden;   /* 1: no triangle has it                              [n_vertex]  */
    uint32_t change;   /* number of the newest */
    uint64_t revision; /* of the frame taken in last, and of the one that brought the newest change */
    uint64_t changed_revision;
    struct {
        uint32_t from;
        pal_packet *packet; /* NULL: none */
    } made[PAL_TRIANGLE_DELTAS_KEPT];
    int next;                 /* place in made for the next one */
    uint64_t n_patch, n_byte; /* encoded so far */
} pal_triangle_slots;

/* copies the table of the shown part, as in its asset. BUDGET: more places than can be streamed; MEMORY */
pal_err pal_triangle_slots_make(int part, uint32_t epoch, const pal_shown *shown, pal_diagnostic *diag,
                                pal_triangle_slots **out);
void pal_triangle_slots_free(pal_triangle_slots *places); /* NULL is fine */
/* takes in a frame's table [n_place][3]; nothing is compared when the revision is the last one's. true: it changed.
 * Corners that are no vertex are taken as an empty place */
bool pal_triangle_slots_update(pal_triangle_slots *places, const int32_t *slot, uint64_t revision);
/* the message with every place that changed after change `from`, held once for the caller; NULL: there is none, or out
 * of memory */
pal_packet *pal_triangle_slots_delta(pal_triangle_slots *places, uint32_t from);
#endif
