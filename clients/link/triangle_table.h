/* A client's table of triangles of a part that adapts: the asset's, brought on by every TOPOLOGY_DELTA. Patches may
 * come before the asset does. Thread: [net]. */
#ifndef PAL_LINK_TRIANGLE_TABLE_H
#define PAL_LINK_TRIANGLE_TABLE_H
#include "protocol/asset.h"
#include "protocol/topology_delta_codec.h"
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_triangle_table {
    uint32_t n_place, n_vertex;
    uint32_t *tri;     /* 0 0 0: empty                    [n_place][3] */
    uint8_t *work;     /* scratch of the codec            */
    bool based;        /* the asset's triangles are in it */
    uint64_t revision; /* of the last patch; 0: none yet  */
} pal_triangle_table;

/* n_place, n_vertex as hello says; neither an asset nor a patch has come. The table is zeroed or freed before. REFUSED:
 * more places or vertices than the protocol allows; MEMORY */
pal_err pal_triangle_table_init(pal_triangle_table *table, uint32_t n_place, uint32_t n_vertex);
void pal_triangle_table_free(pal_triangle_table *table); /* and zeroes it */
/* places that no patch has named yet get the asset's triangle; REFUSED: another number of places or vertices */
pal_err pal_triangle_table_set_base(pal_triangle_table *table, const pal_asset *asset);
/* takes an untrusted TOPOLOGY_DELTA of this part; a refusal leaves the table as it was. Refusals are those of
 * pal_topology_delta_get; ORDER: its revision is not above the last one's */
int pal_triangle_table_apply(pal_triangle_table *table, const uint8_t *bytes, size_t n_byte,
                             pal_topology_delta_head *head);
/* triangles that are drawn: not empty. 0 before the asset is there */
uint32_t pal_triangle_table_count(const pal_triangle_table *table);
#endif
