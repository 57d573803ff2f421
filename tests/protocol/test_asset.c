/* Assets: round trip, size, hash, hostile containers. */
#include "protocol/asset.h"
#include "protocol/frame_codec.h"
#include "tests/check.h"
#include "tests/protocol/frame_shapes.h"

typedef struct packed {
    shape s;
    pal_frame_order *order;
    uint8_t *bytes;
    size_t n_byte;
} packed;

static bool pack(packed *p, int fineness)
{
    *p = (packed){.s = shape_create(fineness)};
    return !pal_frame_order_create(p->s.rest_m, p->s.n_vertex, p->s.triangle, p->s.n_triangle, &p->order) &&
           !pal_asset_encode(p->s.rest_m, NULL, NULL, p->order, p->s.triangle, p->s.n_triangle, &p->bytes, &p->n_byte);
}

static void unpack(packed *p)
{
    pal_frame_order_destroy(p->order);
    shape_release(&p->s);
    free(p->bytes);
}

/* the checksum of a changed container */
static void mend(packed *p)
{
    uint32_t hash = 2166136261u;
    for (size_t i = 40; i < p->n_byte; i++) hash = (hash ^ p->bytes[i]) * 16777619u;
    for (int i = 0; i < 4; i++) p->bytes[28 + i] = (uint8_t)(hash >> (8 * i));
}

static int decode(const uint8_t *bytes, size_t n_byte)
{
    pal_asset *asset = NULL;
    uint8_t *exact = malloc(n_byte + 1);
    memcpy(exact, bytes, n_byte);
    int refusal = pal_asset_decode(exact, n_byte, &asset);
    CHECK((asset != NULL) == (refusal == 0));
    pal_asset_destroy(asset);
    free(exact);
    return refusal;
}

static void comes_back_bit_for_bit(void)
{
    packed p;
    pal_asset *asset = NULL;
    REQUIRE(pack(&p, 40) && pal_asset_decode(p.bytes, p.n_byte, &asset) == 0);
    size_t n = p.s.n_vertex;
    CHECK_INT(asset->order->n_vertex, n);
    CHECK_INT(asset->n_triangle, p.s.n_triangle);
    CHECK_INT(asset->order->n_level, p.order->n_level);
    CHECK(!memcmp(asset->rest_m, p.s.rest_m, 3 * n * sizeof(float)));
    CHECK(!memcmp(asset->triangle, p.s.triangle, 3 * (size_t)p.s.n_triangle * sizeof(uint32_t)));
    CHECK(!memcmp(asset->order->vertex_of, p.order->vertex_of, n * sizeof(uint32_t)));
    CHECK(!memcmp(asset->order->neighbour, p.order->neighbour, 4 * n * sizeof(uint32_t)));
    CHECK(!memcmp(asset->order->weight, p.order->weight, 4 * n * sizeof(int16_t)));
    CHECK(!memcmp(asset->order->level_begin, p.order->level_begin, (p.order->n_level + 1) * sizeof(uint32_t)));
    printf("  %zu vertices, %u triangles: %zu bytes, %.1f a vertex\n", n, p.s.n_triangle, p.n_byte,
           (double)p.n_byte / (double)n);
    CHECK_LE((double)p.n_byte / (double)n, 30);
    pal_asset_destroy(asset);
    unpack(&p);
}

static void looks_and_image_coordinates_come_back_and_must_be_finite(void)
{
    packed p;
    REQUIRE(pack(&p, 10));
    const size_t n = p.s.n_vertex, plain = p.n_byte;
    float *uv = malloc(2 * n * sizeof *uv);
    uint8_t *look = malloc(n);
    REQUIRE(uv && look);
    for (size_t i = 0; i < n; i++) look[i] = (uint8_t)(i % 5);
    for (size_t i = 0; i < 2 * n; i++) uv[i] = 0.37f * (float)i - 11;
    for (int bad = 0; bad < 2; bad++) {
        pal_asset *asset = NULL;
        uint8_t *bytes;
        size_t n_byte;
        if (bad) uv[2 * n - 1] = NAN;
        REQUIRE(!pal_asset_encode(p.s.rest_m, look, uv, p.order, p.s.triangle, p.s.n_triangle, &bytes, &n_byte));
        CHECK(n_byte > plain);
        CHECK_INT(pal_asset_decode(bytes, n_byte, &asset), bad ? PAL_REFUSAL_NAN : PAL_REFUSAL_NONE);
        if (asset) {
            CHECK(asset->uv && !memcmp(asset->uv, uv, 2 * n * sizeof *uv));
            CHECK(asset->look && !memcmp(asset->look, look, n));
            CHECK(!memcmp(asset->rest_m, p.s.rest_m, 3 * n * sizeof(float)));
            CHECK(!memcmp(asset->order->level_begin, p.order->level_begin, (p.order->n_level + 1) * sizeof(uint32_t)));
        }
        pal_asset_destroy(asset);
        /* the counts of one version do not fit the length of the other */
        bytes[4] = 1;
        CHECK_INT(decode(bytes, n_byte), PAL_REFUSAL_COUNT);
        free(bytes);
    }
    free(uv);
    free(look);
    unpack(&p);
}

static void same_content_has_the_same_name_and_other_content_another(void)
{
    packed p, q;
    char name[2][PAL_ASSET_HASH_CHARS];
    REQUIRE(pack(&p, 5) && pack(&q, 5));
    pal_asset_hash(p.bytes, p.n_byte, name[0]);
    pal_asset_hash(q.bytes, q.n_byte, name[1]);
    CHECK_TEXT(name[0], name[1]);
    CHECK_INT(strlen(name[0]), 32);
    q.bytes[q.n_byte - 1] ^= 1;
    pal_asset_hash(q.bytes, q.n_byte, name[1]);
    CHECK(strcmp(name[0], name[1]));
    unpack(&p);
    unpack(&q);
}

static void refuses_every_prefix_and_every_changed_byte(void)
{
    packed p;
    REQUIRE(pack(&p, 3));
    CHECK_INT(decode(p.bytes, p.n_byte), 0);
    for (size_t cut = 0; cut < p.n_byte; cut++) CHECK_INT(decode(p.bytes, cut), PAL_REFUSAL_SHORT);
    uint8_t *more = calloc(p.n_byte + 1, 1);
    memcpy(more, p.bytes, p.n_byte);
    CHECK_INT(decode(more, p.n_byte + 1), PAL_REFUSAL_LONG);
    free(more);
    for (size_t at = 0; at < p.n_byte; at++) {
        p.bytes[at] ^= 0x10;
        CHECK(decode(p.bytes, p.n_byte) != 0);
        p.bytes[at] ^= 0x10;
    }
    unpack(&p);
}

static void refuses_counts_that_its_bytes_cannot_hold(void)
{
    /* 4,194,304 vertices stated by 60 bytes: 168 MB must not be asked for */
    uint8_t bytes[60] = {'P', 'L', 'M', '1', 1, 0, 0, 0, 0, 0, 0x40, 0, 0, 0, 0, 0, 1, 0, 0, 0};
    uint32_t n_raw = 40u * (1u << 22) + 4;
    for (int i = 0; i < 4; i++) bytes[20 + i] = (uint8_t)(n_raw >> (8 * i));
    bytes[24] = 20;
    packed p = {.bytes = bytes, .n_byte = sizeof bytes};
    mend(&p);
    CHECK_INT(decode(bytes, sizeof bytes), PAL_REFUSAL_COUNT);
    bytes[10] = 0x41; /* a vertex count beyond the limit */
    CHECK_INT(decode(bytes, sizeof bytes), PAL_REFUSAL_COUNT);
    memset(bytes + 8, 0, 4); /* no vertex */
    CHECK_INT(decode(bytes, sizeof bytes), PAL_REFUSAL_COUNT);
}

static void changed_content_behind_a_right_checksum_is_refused_or_valid(void)
{
    packed p;
    REQUIRE(pack(&p, 3));
    uint64_t random = 3;
    int n_refused = 0, n_valid = 0;
    for (int k = 0; k < 3000; k++) {
        size_t at = 40 + (size_t)((shape_random(&random) + 1) * 0.5 * (double)(p.n_byte - 40));
        uint8_t old = p.bytes[at];
        pal_asset *asset = NULL;
        p.bytes[at] ^= (uint8_t)(1 << (k & 7));
        mend(&p);
        if (pal_asset_decode(p.bytes, p.n_byte, &asset) == 0) {
            CHECK_INT(pal_frame_order_check(asset->order), 0);
            n_valid++;
        } else {
            n_refused++;
        }
        pal_asset_destroy(asset);
        p.bytes[at] = old;
    }
    printf("  %d refused, %d still valid (moved vertices)\n", n_refused, n_valid);
    CHECK(n_refused > 0 && n_valid > 0);
    unpack(&p);
}

int main(void)
{
    RUN(comes_back_bit_for_bit);
    RUN(looks_and_image_coordinates_come_back_and_must_be_finite);
    RUN(same_content_has_the_same_name_and_other_content_another);
    RUN(refuses_every_prefix_and_every_changed_byte);
    RUN(refuses_counts_that_its_bytes_cannot_hold);
    RUN(changed_content_behind_a_right_checksum_is_refused_or_valid);
    return check_report();
}
