/* Assets of a server. Each path is fetched once, checked against the content hash in its name, decoded and cached.
 * Also finds the point where a client first touches an organ. Thread: [net]. */
#ifndef PAL_LINK_ASSET_STORE_H
#define PAL_LINK_ASSET_STORE_H
#include "clients/link/link.h"
#include "protocol/frame_codec.h"

typedef struct pal_asset_store pal_asset_store;

/* one asset; owned by the store */
typedef struct pal_stored_asset {
    char path[PAL_WIRE_NAME_BYTES];
    bool ready, failed;
    char reason[128]; /* of a failure: one sentence */
    size_t n_byte;    /* as received */
    pal_asset *asset; /* when ready */
    pal_frame_decoder *decoder;
} pal_stored_asset;

/* changed: called when an asset becomes ready or has failed. Borrows loop. url: of the server. NULL: out of memory */
pal_asset_store *pal_asset_store_create(pal_link_loop *loop, const char *url,
                                        void (*changed)(void *user, const pal_stored_asset *a), void *user);
/* what is fetched from now on comes from another server, with the same names; address and session: of a `move` */
void pal_asset_store_move(pal_asset_store *store, const char *address, const char *session);
void pal_asset_store_destroy(pal_asset_store *store); /* after the loop is destroyed; NULL is fine */
/* the asset of a path, fetched at the first call and again after a failure to connect; NULL: out of memory */
pal_stored_asset *pal_asset_store_request(pal_asset_store *store, const char *path);

/* vertex of the rest pose furthest along up; false: the asset has no vertex */
bool pal_asset_extreme_vertex(const pal_asset *asset, const double up[3], double point_m[3]);
/* the same among the vertices within reach_m of the axis along up through `near`; reach_m infinite: all */
bool pal_asset_extreme_vertex_near(const pal_asset *asset, const double up[3], const double near[3], double reach_m,
                                   double point_m[3]);
#endif
