/* Asset container: a 40-byte header, then one LZ4-HC block of byte planes.
 *
 * Every section is an array of u32 or u16 written as planes (all low bytes, then the next, ...): indices are first
 * turned into small differences, so that the high planes are runs which LZ4 removes. protocol/README.md, "Assets", has
 * the tables. */
#include "protocol/asset.h"

#include "protocol/bytes.h"
#include "protocol/planes.h"

#include <lz4.h>
#include <lz4hc.h>
#include <math.h>
#include <openssl/sha.h>
#include <stdio.h>
#include <stdlib.h>

/* VERSION_LOOK has looks and image coordinates behind all else */
enum { HEAD_BYTES = 40, VERSION = 1, VERSION_LOOK = 2, LEVEL_MAX = 4096, HC_LEVEL = 9 };
#define ASSET_MAGIC 0x314D4C50u /* the bytes P L M 1 */

/* bytes of the planes: rest 12, vertex_of 4, neighbours 16, weights 8, image coordinates 8, look 1 per vertex, 12 per
 * triangle, 4 per level */
static size_t planes_bytes(uint32_t version, uint32_t n_vertex, uint32_t n_triangle, uint32_t n_level)
{
    return (version == VERSION_LOOK ? 49 : 40) * (size_t)n_vertex + 12 * (size_t)n_triangle + 4 * (size_t)n_level;
}

static uint32_t fnv1a(const uint8_t *bytes, size_t n)
{
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < n; i++) hash = (hash ^ bytes[i]) * 16777619u;
    return hash;
}

/* the planes of number c of n rows of n_number; returns where they end */
static uint8_t *write_floats(uint8_t *at, const float *from, size_t n, size_t n_number, size_t c)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &from[n_number * i + c], sizeof bits);
        pal_put_plane(at, n, i, bits);
    }
    return at + 4 * n;
}

static const uint8_t *read_floats(const uint8_t *at, float *to, size_t n, size_t n_number, size_t c)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t bits = pal_get_plane(at, n, i);
        memcpy(&to[n_number * i + c], &bits, sizeof bits);
    }
    return at + 4 * n;
}

static void write_planes(uint8_t *at, const float *rest_m, const uint8_t *look, const float *uv,
                         const pal_frame_order *o, const uint32_t *triangle, uint32_t n_triangle)
{
    size_t n = o->n_vertex;
    uint32_t before = 0;
    for (size_t c = 0; c < 3; c++) at = write_floats(at, rest_m, n, 3, c);
    for (size_t i = 0; i < n; before = o->vertex_of[i++]) pal_put_plane(at, n, i, pal_fold(o->vertex_of[i] - before));
    at += 4 * n;
    /* a neighbour as the difference to the one before it, the first as the distance from the own index */
    for (size_t j = 0; j < 4; j++, at += 4 * n)
        for (size_t i = 0; i < n; i++) {
            const uint32_t *neighbour = o->neighbour + 4 * i;
            pal_put_plane(at, n, i, pal_fold(neighbour[j] - (j ? neighbour[j - 1] : (uint32_t)i)));
        }
    for (size_t j = 0; j < 4; j++, at += 2 * n)
        for (size_t i = 0; i < n; i++) {
            uint16_t w = (uint16_t)o->weight[4 * i + j];
            at[i] = (uint8_t)w;
            at[n + i] = (uint8_t)(w >> 8);
        }
    /* corners as differences to the same corner of the triangle before */
    size_t n_corner = 3 * (size_t)n_triangle;
    for (size_t e = 0; e < n_corner; e++)
        pal_put_plane(at, n_corner, e, pal_fold(triangle[e] - (e < 3 ? 0 : triangle[e - 3])));
    at += 4 * n_corner;
    for (size_t l = 0; l < o->n_level; l++) pal_put_plane(at, o->n_level, l, o->level_begin[l]);
    at += 4 * o->n_level;
    for (size_t c = 0; c < 2 && look; c++) at = write_floats(at, uv, n, 2, c);
    if (look) memcpy(at, look, n);
}

int pal_asset_encode(const float *rest_m, const uint8_t *look, const float *uv, const pal_frame_order *order,
                     const uint32_t *triangle, uint32_t n_triangle, uint8_t **bytes, size_t *n_byte)
{
    const uint32_t version = look ? VERSION_LOOK : VERSION;
    if (order->n_level > LEVEL_MAX || n_triangle > PAL_ORDER_TRIANGLE_MAX) return PAL_REFUSAL_COUNT;
    size_t n_raw = planes_bytes(version, order->n_vertex, n_triangle, order->n_level);
    if (n_raw > PAL_ASSET_BYTES_MAX) return PAL_REFUSAL_LONG;
    size_t bound = (size_t)LZ4_compressBound((int)n_raw);
    uint8_t *raw = malloc(n_raw), *packed = malloc(HEAD_BYTES + bound);
    int refusal = raw && packed ? PAL_REFUSAL_NONE : PAL_REFUSAL_MEMORY;
    if (!refusal) {
        write_planes(raw, rest_m, look, uv, order, triangle, n_triangle);
        int n_lz4 = LZ4_compress_HC((const char *)raw, (char *)packed + HEAD_BYTES, (int)n_raw, (int)bound, HC_LEVEL);
        if (n_lz4 <= 0) refusal = PAL_REFUSAL_MEMORY;
        const uint32_t head[10] = {ASSET_MAGIC,
                                   version,
                                   order->n_vertex,
                                   n_triangle,
                                   order->n_level,
                                   (uint32_t)n_raw,
                                   (uint32_t)n_lz4,
                                   refusal ? 0 : fnv1a(packed + HEAD_BYTES, (size_t)n_lz4),
                                   0,
                                   0};
        for (int i = 0; i < 10; i++) pal_put_u32(packed + 4 * i, head[i]);
        *n_byte = HEAD_BYTES + (size_t)n_lz4;
    }
    free(raw);
    if (refusal)
        free(packed);
    else
        *bytes = packed;
    return refusal;
}

/* counts of the header, checked against one another and against the bytes that are there */
static int read_head(const uint8_t *bytes, size_t n_byte, uint32_t head[10])
{
    if (n_byte < HEAD_BYTES) return PAL_REFUSAL_SHORT;
    for (int i = 0; i < 10; i++) head[i] = pal_get_u32(bytes + 4 * i);
    if (head[0] != ASSET_MAGIC) return PAL_REFUSAL_MAGIC;
    if (head[1] != VERSION && head[1] != VERSION_LOOK) return PAL_REFUSAL_KIND;
    if (head[8] || head[9]) return PAL_REFUSAL_FLAGS;
    uint32_t n_vertex = head[2], n_triangle = head[3], n_level = head[4];
    if (n_vertex == 0 || n_vertex > PAL_ORDER_VERTEX_MAX || n_triangle > PAL_ORDER_TRIANGLE_MAX || n_level == 0 ||
        n_level > LEVEL_MAX || n_level > n_vertex)
        return PAL_REFUSAL_COUNT;
    if (planes_bytes(head[1], n_vertex, n_triangle, n_level) != head[5] || head[5] > PAL_ASSET_BYTES_MAX)
        return PAL_REFUSAL_COUNT;
    if (head[6] > n_byte - HEAD_BYTES) return PAL_REFUSAL_SHORT;
    if (head[6] < n_byte - HEAD_BYTES) return PAL_REFUSAL_LONG;
    /* one byte of LZ4 gives at most 255 bytes */
    if (head[5] / 255 > head[6]) return PAL_REFUSAL_COUNT;
    if (fnv1a(bytes + HEAD_BYTES, head[6]) != head[7]) return PAL_REFUSAL_CHECKSUM;
    return 0;
}

static int allocate(const uint32_t head[10], pal_asset **out)
{
    pal_asset *a = calloc(1, sizeof *a);
    if (!a) return PAL_REFUSAL_MEMORY;
    a->n_triangle = head[3];
    a->order = pal_frame_order_allocate(head[2], head[4]);
    a->rest_m = malloc(3 * (size_t)head[2] * sizeof *a->rest_m);
    a->triangle = malloc((3 * (size_t)head[3] + 1) * sizeof *a->triangle);
    if (head[1] == VERSION_LOOK) {
        a->uv = malloc(2 * (size_t)head[2] * sizeof *a->uv);
        a->look = malloc(head[2]);
    }
    *out = a;
    return a->order && a->rest_m && a->triangle && ((a->uv && a->look) || head[1] == VERSION) ? PAL_REFUSAL_NONE
                                                                                              : PAL_REFUSAL_MEMORY;
}

static void read_planes(const uint8_t *at, pal_asset *a)
{
    pal_frame_order *o = a->order;
    size_t n = o->n_vertex;
    uint32_t before = 0;
    for (size_t c = 0; c < 3; c++) at = read_floats(at, a->rest_m, n, 3, c);
    for (size_t i = 0; i < n; i++) o->vertex_of[i] = before += pal_unfold(pal_get_plane(at, n, i));
    at += 4 * n;
    for (size_t j = 0; j < 4; j++, at += 4 * n)
        for (size_t i = 0; i < n; i++) {
            uint32_t *neighbour = o->neighbour + 4 * i;
            neighbour[j] = pal_unfold(pal_get_plane(at, n, i)) + (j ? neighbour[j - 1] : (uint32_t)i);
        }
    for (size_t j = 0; j < 4; j++, at += 2 * n)
        for (size_t i = 0; i < n; i++) o->weight[4 * i + j] = (int16_t)(uint16_t)(at[i] | at[n + i] << 8);
    size_t n_corner = 3 * (size_t)a->n_triangle;
    for (size_t e = 0; e < n_corner; e++)
        a->triangle[e] = pal_unfold(pal_get_plane(at, n_corner, e)) + (e < 3 ? 0 : a->triangle[e - 3]);
    at += 4 * n_corner;
    for (size_t l = 0; l < o->n_level; l++) o->level_begin[l] = pal_get_plane(at, o->n_level, l);
    o->level_begin[o->n_level] = o->n_vertex;
    at += 4 * o->n_level;
    for (size_t c = 0; c < 2 && a->look; c++) at = read_floats(at, a->uv, n, 2, c);
    if (a->look) memcpy(a->look, at, n);
}

/* everything a frame decoder or a renderer trusts */
static int check(const pal_asset *a)
{
    const pal_frame_order *o = a->order;
    for (size_t i = 0; i < 3 * (size_t)o->n_vertex; i++)
        if (!isfinite(a->rest_m[i])) return PAL_REFUSAL_NAN;
    for (size_t i = 0; i < 2 * (size_t)o->n_vertex && a->uv; i++)
        if (!isfinite(a->uv[i])) return PAL_REFUSAL_NAN;
    for (size_t e = 0; e < 3 * (size_t)a->n_triangle; e++)
        if (a->triangle[e] >= o->n_vertex) return PAL_REFUSAL_RANGE;
    for (size_t l = 0; l < o->n_level; l++)
        if ((l == 0 && o->level_begin[0] != 0) || o->level_begin[l] >= o->level_begin[l + 1]) return PAL_REFUSAL_ORDER;
    return pal_frame_order_check(o);
}

int pal_asset_decode(const uint8_t *bytes, size_t n_byte, pal_asset **out)
{
    uint32_t head[10];
    int refusal = read_head(bytes, n_byte, head);
    if (refusal) return refusal;
    pal_asset *a = NULL;
    uint8_t *raw = malloc(head[5]);
    refusal = raw ? PAL_REFUSAL_NONE : PAL_REFUSAL_MEMORY;
    if (!refusal &&
        LZ4_decompress_safe((const char *)bytes + HEAD_BYTES, (char *)raw, (int)head[6], (int)head[5]) != (int)head[5])
        refusal = PAL_REFUSAL_LZ4;
    if (!refusal) refusal = allocate(head, &a);
    if (!refusal) {
        read_planes(raw, a);
        refusal = check(a);
    }
    free(raw);
    if (refusal)
        pal_asset_destroy(a);
    else
        *out = a;
    return refusal;
}

void pal_asset_destroy(pal_asset *asset)
{
    if (!asset) return;
    free(asset->rest_m);
    free(asset->look);
    free(asset->uv);
    free(asset->triangle);
    pal_frame_order_destroy(asset->order);
    free(asset);
}

void pal_asset_hash(const uint8_t *bytes, size_t n_byte, char hash[PAL_ASSET_HASH_CHARS])
{
    uint8_t digest[SHA256_DIGEST_LENGTH];
    SHA256(bytes, n_byte, digest);
    for (int i = 0; i < PAL_ASSET_HASH_CHARS / 2; i++) snprintf(hash + 2 * i, 3, "%02x", digest[i]);
}
