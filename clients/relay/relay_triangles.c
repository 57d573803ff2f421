#include "clients/relay/relay_triangles.h"

#include <stdio.h>
#include <string.h>

static void drop(pal_triangle_slots **slots)
{
    pal_triangle_slots_free(*slots);
    *slots = NULL;
}

pal_err pal_relay_triangles_announce(pal_relay_triangles *t, const pal_wire_part_info *part, bool connection)
{
    if (!connection && part->epoch == t->epoch) return PAL_ERR_OK;
    pal_triangle_table_free(&t->table);
    drop(&t->coming);
    t->adaptive = false;
    t->epoch = part->epoch;
    t->revision++;
    if (!part->is_adaptive) return PAL_ERR_OK;
    PAL_TRY(pal_triangle_table_init(&t->table, part->n_triangle, part->n_vertex));
    t->adaptive = true;
    snprintf(t->asset, sizeof t->asset, "%s", part->asset);
    return PAL_ERR_OK;
}

bool pal_relay_triangles_lack_asset(const pal_relay_triangles *t)
{
    return t->adaptive && !t->table.based;
}

pal_err pal_relay_triangles_set_asset(pal_relay_triangles *t, int part, const uint8_t *bytes, size_t n_byte)
{
    pal_asset *asset = NULL;
    pal_err err = pal_asset_decode(bytes, n_byte, &asset) ? PAL_ERR_REFUSED : PAL_ERR_OK;
    if (!err) err = pal_triangle_table_set_base(&t->table, asset);
    t->revision++;
    /* the table that is shown goes on where only the connection is new */
    if (!err && !(t->slots && t->slots->epoch == t->epoch))
        err = pal_triangle_slots_make(part, t->asset, t->epoch, (const int32_t *)asset->triangle, asset->n_triangle,
                                      asset->order->n_vertex, NULL, &t->coming);
    pal_asset_destroy(asset);
    t->adaptive = !err;
    return err;
}

int pal_relay_triangles_take(pal_relay_triangles *t, const uint8_t *bytes, size_t n_byte)
{
    pal_topology_delta_head head;
    int refusal = pal_topology_delta_get_head(bytes, n_byte, &head);
    if (refusal || !t->adaptive || head.epoch != t->epoch) return refusal;
    t->revision++;
    return pal_triangle_table_apply(&t->table, bytes, n_byte, &head);
}

void pal_relay_triangles_show_epoch(pal_relay_triangles *t, uint32_t epoch)
{
    if (t->slots && t->slots->epoch != epoch) drop(&t->slots);
    if (!t->coming || t->coming->epoch != epoch) return;
    drop(&t->slots);
    t->slots = t->coming;
    t->coming = NULL;
}

void pal_relay_triangles_show(pal_relay_triangles *t, uint32_t epoch)
{
    if (t->slots && t->adaptive && t->table.based && t->epoch == epoch && t->slots->epoch == epoch)
        (void)pal_triangle_slots_update(t->slots, (const int32_t *)t->table.tri, t->revision);
}

void pal_relay_triangles_free(pal_relay_triangles *t)
{
    drop(&t->slots);
    drop(&t->coming);
    pal_triangle_table_free(&t->table);
    memset(t, 0, sizeof *t);
}
