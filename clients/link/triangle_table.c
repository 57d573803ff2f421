/* Before the asset is there, a corner that no table has marks a slot that no delta has named. */
#include "clients/link/triangle_table.h"
#include "server/base/heap.h"

#define UNNAMED UINT32_MAX

pal_err pal_triangle_table_init(pal_triangle_table *table, uint32_t n_slot, uint32_t n_vertex)
{
    memset(table, 0, sizeof *table);
    if (n_slot > PAL_TRIANGLE_SLOT_MAX || n_vertex > PAL_WIRE_VERTEX_MAX) return PAL_ERR_REFUSED;
    pal_err err = PAL_ERR_OK;
    table->n_slot = n_slot;
    table->n_vertex = n_vertex;
    PAL_ARRAY(&err, table->tri, 3 * (size_t)n_slot);
    PAL_ARRAY(&err, table->work, PAL_TOPOLOGY_DELTA_WORK_BYTES(n_slot));
    for (size_t i = 0; i < 3 * (size_t)n_slot && !err; i++) table->tri[i] = UNNAMED;
    if (err) pal_triangle_table_free(table);
    return err;
}

void pal_triangle_table_free(pal_triangle_table *table)
{
    PAL_FREE(table->tri, table->work);
    memset(table, 0, sizeof *table);
}

pal_err pal_triangle_table_set_base(pal_triangle_table *table, const pal_asset *asset)
{
    if (asset->n_triangle != table->n_slot || asset->order->n_vertex != table->n_vertex) return PAL_ERR_REFUSED;
    for (size_t i = 0; i < 3 * (size_t)table->n_slot && !table->based; i++)
        if (table->tri[i] == UNNAMED) table->tri[i] = asset->triangle[i];
    table->based = true;
    return PAL_ERR_OK;
}

int pal_triangle_table_apply(pal_triangle_table *table, const uint8_t *bytes, size_t n_byte,
                             pal_topology_delta_head *head)
{
    pal_topology_delta_head h;
    int refusal = pal_topology_delta_get_head(bytes, n_byte, &h);
    if (!refusal && table->revision && h.revision <= table->revision) refusal = PAL_REFUSAL_ORDER;
    if (!refusal)
        refusal = pal_topology_delta_get(bytes, n_byte, table->n_slot, table->n_vertex, table->work, &h, table->tri);
    if (refusal) return refusal;
    table->revision = h.revision;
    *head = h;
    return 0;
}

uint32_t pal_triangle_table_count(const pal_triangle_table *table)
{
    uint32_t n = 0;
    for (size_t i = 0; i < table->n_slot && table->based; i++)
        n += (table->tri[3 * i] | table->tri[3 * i + 1] | table->tri[3 * i + 2]) != 0;
    return n;
}
