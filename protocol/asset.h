/* The static asset of one part and epoch: rest pose, triangles, wire order, predictor; one LZ4-HC container, served by
 * HTTP under its content hash (/asset/<hash>) and therefore cacheable for ever.
 *
 * The hash is SHA-256 cut to 128 bits: surfaces come from users, caches and relays are shared, and whoever can make two
 * files with one name of a short checksum can show one member another organ than the rest. */
#ifndef PAL_PROTOCOL_ASSET_H
#define PAL_PROTOCOL_ASSET_H
#include "protocol/frame_order.h"

#include <stddef.h>
#include <stdint.h>

#define PAL_ASSET_HASH_CHARS 33 /* 32 hexadecimal digits and the zero */
#define PAL_ASSET_BYTES_MAX  (256u << 20)

typedef struct pal_asset {
    uint32_t n_triangle;
    float *rest_m; /* shown vertices at rest m, finite   [order->n_vertex][3] */
    /* what the vertices look like, 0 the outside of tissue, 1 its inside, 2 + k image k of the part, and where they lie
     * in their image, finite; NULL: all are outside */
    uint8_t *look;          /* [order->n_vertex]                                       */
    float *uv;              /* [order->n_vertex][2]                                    */
    uint32_t *triangle;     /* vertex indices                     [n_triangle][3]      */
    pal_frame_order *order; /* checked by pal_frame_order_check                        */
} pal_asset;

/* [load] encodes (all borrowed for the call; look and uv NULL: none); the caller frees *bytes with free() */
int pal_asset_encode(const float *rest_m, const uint8_t *look, const float *uv, const pal_frame_order *order,
                     const uint32_t *triangle, uint32_t n_triangle, uint8_t **bytes, size_t *n_byte);
/* [load] decodes untrusted bytes and validates everything a frame decoder or a renderer trusts; refuses from the header
 * alone when the stated counts cannot come from so few bytes. The caller frees *out with pal_asset_destroy. */
int pal_asset_decode(const uint8_t *bytes, size_t n_byte, pal_asset **out);
void pal_asset_destroy(pal_asset *asset); /* NULL allowed */

/* the name of an encoded asset: SHA-256 (FIPS 180-4, by OpenSSL), its first 128 bits in hexadecimal digits */
void pal_asset_hash(const uint8_t *bytes, size_t n_byte, char hash[PAL_ASSET_HASH_CHARS]);
#endif
