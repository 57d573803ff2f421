/* The triangles of one part that adapts: what upstream tells of them, and the table from which viewers are served, as a
 * server serves its clients (server/net/transport/triangle_slots.h).
 *
 * A TOPOLOGY_DELTA is relative to the one before, and upstream begins at the asset with every connection. So the relay
 * applies each to a table of its own, and compares that with what is shown when the FRAME that belongs to it is shown:
 * viewers that skip cycles, come later, or outlive a connection of the relay get one message with all they lack. */
#ifndef PAL_RELAY_TRIANGLES_H
#define PAL_RELAY_TRIANGLES_H
#include "clients/link/triangle_table.h"
#include "protocol/control.h"
#include "server/net/transport/triangle_slots.h"

typedef struct pal_relay_triangles {
    pal_triangle_slots *slots; /* as shown; NULL: none yet, or the part does not adapt. Under the caller's lock */
    /* [up] */
    bool adaptive; /* as announced last, with its epoch, which every part has, and the path of its asset */
    uint32_t epoch;
    char asset[PAL_WIRE_NAME_BYTES];
    pal_triangle_table table;   /* of that epoch */
    uint64_t revision;          /* grows with every change of table */
    pal_triangle_slots *coming; /* as in that asset, until the epoch is shown; NULL: shown, or the asset is not here */
} pal_relay_triangles;

/* upstream names the part: anew with each connection, and else where its epoch is another one. MEMORY, REFUSED: too
 * large; the part then keeps the triangles of its asset. [up] */
pal_err pal_relay_triangles_announce(pal_relay_triangles *t, const pal_wire_part_info *part, bool connection);
bool pal_relay_triangles_lack_asset(const pal_relay_triangles *t); /* [up] */
/* REFUSED: it is no asset, or not of this part. [up] */
pal_err pal_relay_triangles_set_asset(pal_relay_triangles *t, int part, const uint8_t *bytes, size_t n_byte);
/* a TOPOLOGY_DELTA; of another epoch it is ignored. The result is why it is refused (refusal.h). [up] */
int pal_relay_triangles_take(pal_relay_triangles *t, const uint8_t *bytes, size_t n_byte);
void pal_relay_triangles_show_epoch(pal_relay_triangles *t, uint32_t epoch); /* [up], under the lock */
/* the newest FRAME of that epoch is shown, and what was told before it. [up], under the lock */
void pal_relay_triangles_show(pal_relay_triangles *t, uint32_t epoch);
void pal_relay_triangles_free(pal_relay_triangles *t); /* frees and zeroes */
#endif
