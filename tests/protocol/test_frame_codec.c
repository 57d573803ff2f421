/* FRAME codec: bound, size, closed loop, hostile messages. */
#include "protocol/asset.h"
#include "protocol/frame_codec.h"
#include "tests/check.h"
#include "tests/protocol/frame_shapes.h"

typedef struct trial { /* a surface with encoder and decoder */
    shape s;
    pal_frame_order *order;
    pal_asset asset;
    pal_frame_encoder *e;
    pal_frame_decoder *d;
    float *given, *shown;
    uint8_t *bytes;
    size_t cap;
} trial;

static bool rig_create(trial *r, int fineness)
{
    *r = (trial){.s = shape_create(fineness)};
    if (pal_frame_order_create(r->s.rest_m, r->s.n_vertex, r->s.triangle, r->s.n_triangle, &r->order)) return false;
    r->asset = (pal_asset){r->s.n_triangle, r->s.rest_m, NULL, NULL, r->s.triangle, r->order};
    if (pal_frame_encoder_create(r->s.rest_m, r->order, &r->e)) return false;
    if (pal_frame_decoder_create(&r->asset, &r->d)) return false;
    r->cap = pal_frame_bound(r->s.n_vertex);
    r->given = malloc(3 * (size_t)r->s.n_vertex * sizeof *r->given);
    r->shown = malloc(3 * (size_t)r->s.n_vertex * sizeof *r->shown);
    r->bytes = malloc(r->cap);
    return r->given && r->shown && r->bytes;
}

static void rig_release(trial *r)
{
    pal_frame_encoder_destroy(r->e);
    pal_frame_decoder_destroy(r->d);
    pal_frame_order_destroy(r->order);
    shape_release(&r->s);
    free(r->given);
    free(r->shown);
    free(r->bytes);
}

static double largest_error(const trial *r)
{
    double max = 0;
    for (size_t i = 0; i < 3 * (size_t)r->s.n_vertex; i++) {
        double error = fabs((double)r->given[i] - (double)r->shown[i]);
        if (!(error <= max)) max = error;
    }
    return max;
}

static pal_frame_input given_of(const trial *r, double error_m)
{
    return (pal_frame_input){.part = 1,
                             .epoch = 3,
                             .seq = 7,
                             .cycle = 9,
                             .sim_time_us = 1234567,
                             .error_m = error_m,
                             .position_m = r->given};
}

static void error_stays_within_its_bound_in_every_frame(void)
{
    static const double bound[] = {1e-5, 5e-5, 2.5e-4};
    trial r;
    REQUIRE(rig_create(&r, 24));
    for (size_t b = 0; b < 3; b++) {
        pal_frame_input given = given_of(&r, bound[b]);
        for (int motion = 0; motion < MOTION_COUNT; motion++) {
            for (int k = 0; k < 25; k++) {
                pal_frame_result result;
                pal_frame_head head;
                shape_move(&r.s, (shape_motion)motion, k * 4, r.given);
                REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
                REQUIRE(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown) == 0);
                CHECK_LE(largest_error(&r), result.error_m);
                if (motion != MOTION_TELEPORT) CHECK_LE(result.error_m, bound[b]);
                CHECK_INT(head.epoch, 3);
            }
        }
    }
    rig_release(&r);
}

static void live_deformation_costs_less_than_half_a_byte_per_vertex(void)
{
    static const double max[MOTION_COUNT] = {0.01, 0.25, 0.3, 0.45, 0.1, 0, 0, 0};
    trial r;
    REQUIRE(rig_create(&r, 70));
    pal_frame_input given = given_of(&r, 5e-5);
    for (int motion = 0; motion < MOTION_TELEPORT; motion++) {
        double n_byte = 0;
        for (int k = 0; k < 10; k++) {
            pal_frame_result result;
            shape_move(&r.s, (shape_motion)motion, k * 10, r.given);
            REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
            n_byte += (double)result.n_byte / 10;
        }
        printf("  motion %d: %.0f bytes a frame, %.3f a vertex\n", motion, n_byte, n_byte / r.s.n_vertex);
        CHECK_LE(n_byte / r.s.n_vertex, max[motion]);
    }
    rig_release(&r);
}

/* hides a share of the vertices and makes their positions nonsense */
static void hide(trial *r, uint64_t *random, double share, uint8_t *hidden)
{
    for (uint32_t i = 0; i < r->s.n_vertex; i++) {
        hidden[i] = (shape_random(random) + 1) / 2 < share;
        for (size_t c = 0; c < 3 && hidden[i]; c++) r->given[3 * (size_t)i + c] = c ? NAN : 1e30f;
    }
}

static void hidden_vertices_may_stand_anywhere_and_the_bound_holds_for_the_others(void)
{
    static const float turned[12] = {0, -1, 0, 0.5f, 1, 0, 0, 0, 0, 0, 1, 0.1f};
    trial r;
    uint64_t random = 3;
    REQUIRE(rig_create(&r, 16));
    uint8_t *hidden = malloc(r.s.n_vertex);
    pal_frame_input given = given_of(&r, 5e-5);
    given.hidden = hidden;
    for (int motion = 0; motion < MOTION_COUNT; motion++)
        for (int k = 0; k < 12; k++) {
            pal_frame_result result;
            pal_frame_head head;
            shape_move(&r.s, (shape_motion)motion, k * 8, r.given);
            hide(&r, &random, k / 11.0, hidden);
            given.affine = k % 3 == 2 ? turned : NULL;
            REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
            REQUIRE(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown) == 0);
            for (uint32_t i = 0; i < r.s.n_vertex; i++)
                for (size_t c = 0; c < 3; c++)
                    if (hidden[i])
                        CHECK(isfinite(r.shown[3 * (size_t)i + c]));
                    else
                        CHECK_LE(fabs((double)r.given[3 * (size_t)i + c] - (double)r.shown[3 * (size_t)i + c]),
                                 result.error_m);
            if (k == 11) CHECK_LE((double)result.n_byte, 150); /* nothing is seen, nothing is said */
        }
    /* only what is seen must be a number */
    memset(hidden, 0, r.s.n_vertex);
    shape_move(&r.s, MOTION_BEND, 0, r.given);
    pal_frame_result result;
    r.given[4] = NAN;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_NAN);
    hidden[1] = 1;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), 0);
    free(hidden);
    rig_release(&r);
}

static void a_move_of_hidden_vertices_alone_is_no_change(void)
{
    trial r;
    REQUIRE(rig_create(&r, 8));
    uint8_t *hidden = calloc(r.s.n_vertex, 1);
    pal_frame_input given = given_of(&r, 5e-5);
    pal_frame_result result;
    given.hidden = hidden;
    hidden[5] = hidden[77] = 1;
    shape_move(&r.s, MOTION_BEND, 20, r.given);
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0 && result.changed);
    for (int c = 0; c < 3; c++) r.given[15 + c] = 3, r.given[231 + c] = -0.5f;
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    CHECK(!result.changed);
    r.given[18] += 0.001f;
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    CHECK(result.changed);
    free(hidden);
    rig_release(&r);
}

/* a predictor that extrapolates along a line, hidden all the way: X stays in the range that decoders take */
static void chains_of_hidden_extrapolations_stay_in_range(void)
{
    enum { N = 64 };
    uint32_t vertex_of[N], neighbour[4 * N] = {0}, level[N + 1];
    int16_t weight[4 * N] = {0};
    float rest[3 * N] = {0}, given_m[3 * N] = {0}, shown[3 * N];
    uint8_t hidden[N], *bytes = malloc(pal_frame_bound(N));
    for (uint32_t i = 0; i < N; i++) {
        vertex_of[i] = level[i] = i;
        hidden[i] = i > 1;
        if (i < 2) continue;
        neighbour[4 * i] = i - 1, neighbour[4 * i + 1] = i - 2;
        weight[4 * i] = 6100, weight[4 * i + 1] = -2004;
    }
    level[N] = N;
    pal_frame_order order = {N, N, level, vertex_of, neighbour, weight};
    const pal_asset asset = {0, rest, NULL, NULL, NULL, &order};
    pal_frame_encoder *e = NULL;
    pal_frame_decoder *d = NULL;
    pal_frame_head head;
    pal_frame_result result;
    given_m[0] = -1;
    given_m[3] = 1;
    REQUIRE(bytes && !pal_frame_encoder_create(rest, &order, &e) && !pal_frame_decoder_create(&asset, &d));
    const pal_frame_input given = {.error_m = 1e-6, .position_m = given_m, .hidden = hidden};
    REQUIRE(pal_frame_put(e, &given, bytes, pal_frame_bound(N), &result) == 0);
    CHECK_INT(pal_frame_get(d, bytes, result.n_byte, &head, shown), 0);
    CHECK_NEAR((double)shown[3], 1, result.error_m);
    CHECK_NEAR((double)shown[3 * N - 3], 1, 1e-3); /* 1 is the end of the range, the prediction lies beyond */
    pal_frame_encoder_destroy(e);
    pal_frame_decoder_destroy(d);
    free(bytes);
}

/* the coarse vertices bend, every midpoint is the mean of its parents: hidden or not, the fine ones cost next to
 * nothing, and hidden ones come out where they would be */
static void families_predict_what_is_linear_on_coarse_triangles(void)
{
    shape s = shape_create(6);
    shape_family f = shape_family_create(6, 3);
    const uint32_t n = f.fine.n_vertex;
    pal_frame_order *order = NULL;
    pal_frame_encoder *e = NULL;
    pal_frame_decoder *d = NULL;
    pal_frame_result result, seen;
    pal_frame_head head;
    float *given_m = malloc(3 * (size_t)n * sizeof(float)), *shown = malloc(3 * (size_t)n * sizeof(float));
    uint8_t *bytes = malloc(pal_frame_bound(n)), *hidden = calloc(n, 1);
    REQUIRE(!pal_frame_order_hierarchy(f.fine.rest_m, n, f.n_coarse, f.parent, s.triangle, s.n_triangle, &order));
    const pal_asset asset = {0, f.fine.rest_m, NULL, NULL, NULL, order};
    REQUIRE(!pal_frame_encoder_create(f.fine.rest_m, order, &e) && !pal_frame_decoder_create(&asset, &d));
    shape_move(&s, MOTION_BEND, 30, given_m);
    for (uint32_t i = f.n_coarse; i < n; i++) {
        const uint32_t *p = f.parent + 2 * (size_t)(i - f.n_coarse);
        for (size_t c = 0; c < 3; c++)
            given_m[3 * (size_t)i + c] = 0.5f * (given_m[3 * (size_t)p[0] + c] + given_m[3 * (size_t)p[1] + c]);
    }
    pal_frame_input given = {.error_m = 5e-5, .position_m = given_m};
    REQUIRE(pal_frame_put(e, &given, bytes, pal_frame_bound(n), &seen) == 0);
    for (uint32_t i = f.n_coarse; i < n; i++) hidden[i] = 1;
    given.hidden = hidden;
    REQUIRE(pal_frame_put(e, &given, bytes, pal_frame_bound(n), &result) == 0);
    REQUIRE(pal_frame_get(d, bytes, result.n_byte, &head, shown) == 0);
    printf("  %u coarse of %u vertices: %zu bytes, all shown %zu\n", f.n_coarse, n, result.n_byte, seen.n_byte);
    CHECK_LE((double)seen.n_byte, 1.6 * (double)result.n_byte);
    double worst = 0;
    for (size_t i = 0; i < 3 * (size_t)n; i++) worst = fmax(worst, fabs((double)shown[i] - (double)given_m[i]));
    CHECK_LE(worst, 1.2 * result.error_m);
    pal_frame_encoder_destroy(e);
    pal_frame_decoder_destroy(d);
    pal_frame_order_destroy(order);
    shape_release(&f.fine);
    shape_release(&s);
    free(f.parent);
    free(given_m);
    free(shown);
    free(bytes);
    free(hidden);
}

/* encodes motion k and decodes it with a new decoder: frames need no history */
static void any_frame_serves_a_client_that_joins(void)
{
    trial r;
    REQUIRE(rig_create(&r, 12));
    pal_frame_input given = given_of(&r, 5e-5);
    for (int k = 0; k < 40; k++) {
        pal_frame_result result;
        pal_frame_head head;
        pal_frame_decoder *joined = NULL;
        shape_move(&r.s, (shape_motion)(k % MOTION_COUNT), k, r.given);
        REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
        REQUIRE(pal_frame_decoder_create(&r.asset, &joined) == 0);
        CHECK_INT(pal_frame_get(joined, r.bytes, result.n_byte, &head, r.shown), 0);
        CHECK_LE(largest_error(&r), result.error_m);
        pal_frame_decoder_destroy(joined);
    }
    rig_release(&r);
}

static void part_at_rest_is_reported_unchanged(void)
{
    trial r;
    pal_frame_result result;
    REQUIRE(rig_create(&r, 12));
    pal_frame_input given = given_of(&r, 5e-5);
    static const struct {
        int frame;
        bool changed;
    } step[] = {{0, true}, {0, false}, {5, true}, {5, false}, {0, true}};
    for (size_t k = 0; k < 5; k++) {
        shape_move(&r.s, MOTION_BUMP, step[k].frame, r.given);
        REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
        CHECK_INT(result.changed, step[k].changed);
    }
    /* far below the bound nothing is seen; another accuracy is another frame */
    for (size_t i = 0; i < 3 * (size_t)r.s.n_vertex; i++) r.given[i] += 1e-9f;
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    CHECK_INT(result.changed, false);
    given.error_m = 1e-4;
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    CHECK_INT(result.changed, true);
    rig_release(&r);
}

static void refuses_positions_that_are_none_and_goes_on(void)
{
    static const float bad[] = {NAN, INFINITY, -INFINITY};
    trial r;
    pal_frame_result result;
    pal_frame_head head;
    REQUIRE(rig_create(&r, 12));
    pal_frame_input given = given_of(&r, 5e-5);
    shape_move(&r.s, MOTION_BEND, 9, r.given);
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    size_t n_byte = result.n_byte;
    for (size_t i = 0; i < 3 * (size_t)r.s.n_vertex; i += 101) {
        float kept = r.given[i];
        r.given[i] = bad[i % 3];
        CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_NAN);
        r.given[i] = kept;
    }
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    CHECK_INT(result.changed, false);
    CHECK_INT(result.n_byte, n_byte);
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap - 1, &result), PAL_REFUSAL_SPACE);
    given.error_m = 0;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_RANGE);
    given.error_m = NAN;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_RANGE);
    given.error_m = 5e-5;
    for (size_t i = 0; i < 3 * (size_t)r.s.n_vertex; i++) r.given[i] = i % 2 ? 3e38f : -3e38f;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_RANGE);
    shape_move(&r.s, MOTION_STORM, 9, r.given);
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), 0);
    CHECK_INT(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown), 0);
    CHECK_LE(largest_error(&r), 5e-5);
    rig_release(&r);
}

static void raises_the_step_for_far_jumps_and_says_so(void)
{
    trial r;
    pal_frame_result result;
    pal_frame_head head;
    REQUIRE(rig_create(&r, 12));
    pal_frame_input given = given_of(&r, 1e-6);
    for (double jump = 0.001; jump < 1e5; jump *= 7) {
        for (size_t i = 0; i < 3 * (size_t)r.s.n_vertex; i++)
            r.given[i] = r.s.rest_m[i] + (float)(i % 5 == 0 ? jump : -jump);
        REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
        REQUIRE(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown) == 0);
        CHECK_LE(largest_error(&r), result.error_m);
        CHECK((result.error_m > 1e-6) == (jump > 0.015));
        CHECK_LE(result.error_m, 1e-6 + jump * 5e-5);
    }
    rig_release(&r);
}

static void affine_map_carries_large_motion(void)
{
    static const float turn[12] = {0.8f, -0.6f, 0, 0.3f, 0.6f, 0.8f, 0, -0.2f, 0, 0, 1, 0.1f};
    static const float flat[12] = {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0};
    trial r;
    pal_frame_result result;
    pal_frame_head head;
    REQUIRE(rig_create(&r, 24));
    pal_frame_input given = given_of(&r, 5e-5);
    shape_move(&r.s, MOTION_BUMP, 9, r.given);
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    size_t still = result.n_byte;
    for (size_t i = 0; i < r.s.n_vertex; i++) {
        float *p = r.given + 3 * i, x = p[0], y = p[1];
        p[0] = 0.8f * x - 0.6f * y + 0.3f;
        p[1] = 0.6f * x + 0.8f * y - 0.2f;
        p[2] += 0.1f;
    }
    given.affine = turn;
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    REQUIRE(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown) == 0);
    CHECK_LE(largest_error(&r), result.error_m);
    CHECK_LE(result.error_m, 5e-5);
    CHECK_LE((double)result.n_byte, 1.4 * (double)still + 48);
    CHECK(!memcmp(head.affine, turn, sizeof turn));
    given.affine = flat;
    CHECK_INT(pal_frame_put(r.e, &given, r.bytes, r.cap, &result), PAL_REFUSAL_RANGE);
    rig_release(&r);
}

static void tiny_and_loose_meshes_stay_within_the_bound(void)
{
    const float rest[18] = {0, 0, 0, 0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0.05f, 0.05f, 0.05f};
    const uint32_t triangle[6] = {0, 1, 2, 0, 1, 3};
    uint64_t random = 9;
    for (uint32_t n = 1; n <= 6; n++) {
        pal_frame_order *order = NULL;
        pal_frame_encoder *e = NULL;
        pal_frame_decoder *d = NULL;
        uint8_t bytes[2048];
        float given_m[18], shown[18];
        uint32_t n_triangle = n < 3 ? 0 : n < 4 ? 1 : 2;
        REQUIRE(pal_frame_order_create(rest, n, triangle, n_triangle, &order) == 0);
        const pal_asset asset = {n_triangle, (float *)(uintptr_t)rest,        NULL,
                                 NULL,       (uint32_t *)(uintptr_t)triangle, order};
        REQUIRE(pal_frame_encoder_create(rest, order, &e) == 0 && pal_frame_decoder_create(&asset, &d) == 0);
        for (int k = 0; k < 200; k++) {
            pal_frame_result result;
            pal_frame_head head;
            for (size_t i = 0; i < 3 * n; i++) given_m[i] = rest[i] + 0.05f * (float)shape_random(&random);
            const pal_frame_input given = {.error_m = 5e-5, .position_m = given_m};
            REQUIRE(pal_frame_put(e, &given, bytes, sizeof bytes, &result) == 0);
            REQUIRE(pal_frame_get(d, bytes, result.n_byte, &head, shown) == 0);
            for (size_t i = 0; i < 3 * n; i++) CHECK_LE(fabs((double)given_m[i] - (double)shown[i]), 5e-5);
        }
        pal_frame_encoder_destroy(e);
        pal_frame_decoder_destroy(d);
        pal_frame_order_destroy(order);
    }
}

/* decodes a heap copy of exactly the right size */
static int decode_copy(trial *r, const uint8_t *bytes, size_t n_byte)
{
    pal_frame_head head;
    uint8_t *exact = malloc(n_byte + 1);
    memcpy(exact, bytes, n_byte);
    int refusal = pal_frame_get(r->d, exact, n_byte, &head, r->shown);
    free(exact);
    return refusal;
}

static void refuses_every_prefix_and_survives_every_changed_byte(void)
{
    static const float turn[12] = {0.8f, -0.6f, 0, 0.3f, 0.6f, 0.8f, 0, -0.2f, 0, 0, 1, 0.1f};
    trial r;
    REQUIRE(rig_create(&r, 5));
    for (int motion = MOTION_BUMP; motion < MOTION_COUNT; motion++) {
        pal_frame_input given = given_of(&r, 5e-5);
        pal_frame_result result;
        if (motion == MOTION_BEND) given.affine = turn;
        shape_move(&r.s, (shape_motion)motion, 11, r.given);
        REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
        for (size_t cut = 0; cut < result.n_byte; cut++) CHECK_INT(decode_copy(&r, r.bytes, cut), PAL_REFUSAL_SHORT);
        r.bytes[result.n_byte] = 0;
        CHECK_INT(decode_copy(&r, r.bytes, result.n_byte + 1), PAL_REFUSAL_LONG);
        for (size_t at = 0; at < result.n_byte; at++)
            for (int bit = 0; bit < 8; bit++) {
                r.bytes[at] ^= (uint8_t)(1 << bit);
                int refusal = decode_copy(&r, r.bytes, result.n_byte);
                CHECK(refusal >= 0 && refusal < PAL_REFUSAL_END);
                r.bytes[at] ^= (uint8_t)(1 << bit);
            }
        CHECK_INT(decode_copy(&r, r.bytes, result.n_byte), 0);
    }
    rig_release(&r);
}

static void put32(uint8_t *at, uint32_t v)
{
    for (int i = 0; i < 4; i++) at[i] = (uint8_t)(v >> (8 * i));
}

static void refuses_lying_heads(void)
{
    trial r;
    pal_frame_result result;
    REQUIRE(rig_create(&r, 5));
    pal_frame_input given = given_of(&r, 5e-5);
    shape_move(&r.s, MOTION_BEND, 11, r.given);
    static const struct {
        size_t at;
        uint32_t value;
        int refusal;
    } lie[] = {{32, 151, PAL_REFUSAL_COUNT},
               {32, 0, PAL_REFUSAL_COUNT},
               {32, 0xFFFFFFFF, PAL_REFUSAL_COUNT},
               {36, 0, PAL_REFUSAL_COUNT},
               {36, 0xFFFFFFFF, PAL_REFUSAL_COUNT},
               {36, 700, PAL_REFUSAL_LZ4},
               {40, 0xFFFFFFFF, PAL_REFUSAL_SHORT},
               {40, 1, PAL_REFUSAL_LONG},
               {28, 0x7FC00000, PAL_REFUSAL_NAN},
               {28, 0x80000000, PAL_REFUSAL_RANGE},
               {28, 0xBF800000, PAL_REFUSAL_RANGE},
               {20, 0x00200000, PAL_REFUSAL_RANGE},
               {4, PAL_WIRE_TOOLS, PAL_REFUSAL_KIND},
               {4, PAL_WIRE_FRAME | 2 << 8, PAL_REFUSAL_FLAGS},
               {4, PAL_WIRE_FRAME | 16 << 16, PAL_REFUSAL_RANGE}};
    for (size_t k = 0; k < sizeof lie / sizeof *lie; k++) {
        REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
        put32(r.bytes + lie[k].at, lie[k].value);
        CHECK_INT(decode_copy(&r, r.bytes, result.n_byte), lie[k].refusal);
    }
    rig_release(&r);
}

static void refuses_blocks_that_expand_to_another_length(void)
{
    trial r;
    uint8_t bytes[400] = {0};
    pal_frame_result result;
    REQUIRE(rig_create(&r, 5));
    pal_frame_input given = given_of(&r, 5e-5);
    shape_move(&r.s, MOTION_REST, 0, r.given);
    REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
    /* a match of 255 bytes for each byte of the block: far more than the stated length */
    memcpy(bytes, r.bytes, PAL_FRAME_HEAD_BYTES);
    memset(bytes + PAL_FRAME_HEAD_BYTES, 255, sizeof bytes - PAL_FRAME_HEAD_BYTES);
    memcpy(bytes + PAL_FRAME_HEAD_BYTES, "\x1f\x00\x01\x00", 4);
    put32(bytes + 40, sizeof bytes - PAL_FRAME_HEAD_BYTES);
    CHECK_INT(decode_copy(&r, bytes, sizeof bytes), PAL_REFUSAL_LZ4);
    put32(bytes + 36, 10);
    CHECK_INT(decode_copy(&r, bytes, sizeof bytes), PAL_REFUSAL_COUNT);
    rig_release(&r);
}

int main(void)
{
    RUN(error_stays_within_its_bound_in_every_frame);
    RUN(live_deformation_costs_less_than_half_a_byte_per_vertex);
    RUN(hidden_vertices_may_stand_anywhere_and_the_bound_holds_for_the_others);
    RUN(a_move_of_hidden_vertices_alone_is_no_change);
    RUN(chains_of_hidden_extrapolations_stay_in_range);
    RUN(families_predict_what_is_linear_on_coarse_triangles);
    RUN(any_frame_serves_a_client_that_joins);
    RUN(part_at_rest_is_reported_unchanged);
    RUN(refuses_positions_that_are_none_and_goes_on);
    RUN(raises_the_step_for_far_jumps_and_says_so);
    RUN(affine_map_carries_large_motion);
    RUN(tiny_and_loose_meshes_stay_within_the_bound);
    RUN(refuses_every_prefix_and_survives_every_changed_byte);
    RUN(refuses_lying_heads);
    RUN(refuses_blocks_that_expand_to_another_length);
    return check_report();
}
