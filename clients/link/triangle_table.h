/* A client's triangle table of an adaptive part: the triangles of the asset, updated by every TOPOLOGY_DELTA. Updates
 * may arrive before the asset. Thread: [net]. */
#ifndef PAL_LINK_TRIANGLE_TABLE_H
#define PAL_LINK_TRIANGLE_TABLE_H
#include "protocol/asset.h"
#include "protocol/topology_delta_codec.h"
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_triangle_table {
    uint32_t n_slot, n_vertex;
    uint32_t *tri;     /* 0 0 0: empty [n_slot][3] */
    uint8_t *work;     /* scratch of the codec            */
    bool based;        /* the asset's triangles are present */
    uint64_t revision; /* of the last update; 0: none yet */
} pal_triangle_table;

/* n_slot, n_vertex: from hello. Starts without asset and updates. The table must be zeroed or freed. REFUSED: more
 * entries or vertices than the protocol allows; MEMORY */
pal_err pal_triangle_table_init(pal_triangle_table *table, uint32_t n_slot, uint32_t n_vertex);
void pal_triangle_table_free(pal_triangle_table *table); /* frees and zeroes */
/* sets the asset's triangle in every entry that no update has written; REFUSED: another number of entries or
 * vertices */
pal_err pal_triangle_table_set_base(pal_triangle_table *table, const pal_asset *asset);
/* Applies an untrusted TOPOLOGY_DELTA of this part; a refusal leaves the table unchanged. Refusals: those of
 * pal_topology_delta_get; ORDER: its revision does not exceed the last one's. */
int pal_triangle_table_apply(pal_triangle_table *table, const uint8_t *bytes, size_t n_byte,
                             pal_topology_delta_head *head);
/* number of non-empty triangles; 0 before the asset is present */
uint32_t pal_triangle_table_count(const pal_triangle_table *table);
#endif
