#include "clients/link/asset_store.h"
#include "server/base/vec3.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct store_entry {
    pal_stored_asset shown; /* first: entries are handed out by it */
    struct store_entry *next;
    pal_asset_store *store;
    bool asked;
} store_entry;

struct pal_asset_store {
    pal_link_loop *loop;
    char url[512];
    void (*changed)(void *user, const pal_stored_asset *a);
    void *user;
    store_entry *entries;
};

pal_asset_store *pal_asset_store_create(pal_link_loop *loop, const char *url,
                                        void (*changed)(void *user, const pal_stored_asset *a), void *user)
{
    pal_asset_store *store = calloc(1, sizeof *store);
    if (!store) return NULL;
    *store = (pal_asset_store){.loop = loop, .changed = changed, .user = user};
    strncpy(store->url, url, sizeof store->url - 1);
    return store;
}

void pal_asset_store_move(pal_asset_store *store, const char *address, const char *session)
{
    snprintf(store->url, sizeof store->url, "%s?session=%s", address, session);
}

void pal_asset_store_destroy(pal_asset_store *store)
{
    if (!store) return;
    for (store_entry *entry = store->entries, *next; entry; entry = next) {
        next = entry->next;
        pal_frame_decoder_destroy(entry->shown.decoder);
        pal_asset_destroy(entry->shown.asset);
        free(entry);
    }
    free(store);
}

static void store_fail(store_entry *entry, const char *reason)
{
    entry->shown.failed = true;
    strncpy(entry->shown.reason, reason, sizeof entry->shown.reason - 1);
}

/* the name must be the hash of the bytes, then the bytes must be an asset */
static void store_take(store_entry *entry, const uint8_t *bytes, size_t n_byte)
{
    char hash[PAL_ASSET_HASH_CHARS];
    pal_asset_hash(bytes, n_byte, hash);
    const char *name = strrchr(entry->shown.path, '/');
    name = name ? name + 1 : entry->shown.path;
    if (strcmp(name, hash)) {
        store_fail(entry, "content does not have the hash of its name");
        return;
    }
    int refusal = pal_asset_decode(bytes, n_byte, &entry->shown.asset);
    if (!refusal) refusal = pal_frame_decoder_create(entry->shown.asset, &entry->shown.decoder);
    if (refusal) {
        store_fail(entry, pal_refusal_text(refusal));
        return;
    }
    entry->shown.n_byte = n_byte;
    entry->shown.ready = true;
}

static void store_got(void *user, int status, const uint8_t *bytes, size_t n_byte, const char *reason)
{
    store_entry *entry = user;
    entry->asked = false;
    if (status == 200)
        store_take(entry, bytes, n_byte);
    else
        store_fail(entry, reason && reason[0] ? reason : "server does not have it");
    entry->store->changed(entry->store->user, &entry->shown);
}

pal_stored_asset *pal_asset_store_request(pal_asset_store *store, const char *path)
{
    store_entry *entry = store->entries;
    while (entry && strcmp(entry->shown.path, path)) entry = entry->next;
    if (!entry) {
        entry = calloc(1, sizeof *entry);
        if (!entry) return NULL;
        *entry = (store_entry){.next = store->entries, .store = store};
        strncpy(entry->shown.path, path, sizeof entry->shown.path - 1);
        store->entries = entry;
    }
    if (!entry->shown.ready && !entry->asked) {
        entry->asked = true;
        entry->shown.failed = false;
        if (pal_link_get(store->loop, store->url, path, PAL_ASSET_BYTES_MAX, store_got, entry, NULL)) {
            entry->asked = false;
            store_fail(entry, "address of the server is not understood");
        }
    }
    return &entry->shown;
}

bool pal_asset_extreme_vertex_near(const pal_asset *asset, const double up[3], const double near[3], double reach_m,
                                   double point_m[3])
{
    double best = -INFINITY;
    for (uint32_t i = 0; i < asset->order->n_vertex; i++) {
        const float *rest = asset->rest_m + 3 * (size_t)i;
        const double p[3] = {rest[0], rest[1], rest[2]};
        double across[3];
        pal_sub3(across, p, near);
        pal_axpy3(across, -pal_dot3(across, up), up);
        if (pal_norm3(across) > reach_m || pal_dot3(p, up) <= best) continue;
        best = pal_dot3(p, up);
        pal_copy3(point_m, p);
    }
    return best > -INFINITY;
}

bool pal_asset_extreme_vertex(const pal_asset *asset, const double up[3], double point_m[3])
{
    const double origin[3] = {0, 0, 0};
    return pal_asset_extreme_vertex_near(asset, up, origin, INFINITY, point_m);
}
