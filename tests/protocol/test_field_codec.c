/* FIELD: the error of a value, refusals of everything that is not exactly one message. */
#include "protocol/bytes.h"
#include "protocol/field_codec.h"
#include "tests/check.h"
#include "tests/protocol/golden.h"

enum { N = 4000, CAP = 8192 };
static float value[N];
static uint8_t level[N], work[N], bytes[CAP];

static pal_field_head head_of(uint32_t n)
{
    return (pal_field_head){.part = 3, .field = PAL_WIRE_FIELD_ENERGY_J_M3, .epoch = 2, .n_vertex = n};
}

static size_t put(pal_field_head *head)
{
    size_t n = 0;
    CHECK_INT(pal_field_put(value, head, work, bytes, CAP, &n), 0);
    return n;
}

static void values_come_back_within_half_a_level(void)
{
    static const float range[][2] = {{0, 0.035f}, {-2e5f, 7e5f}, {1e-30f, 2e-30f}, {-3e38f, 3e38f}};
    for (size_t r = 0; r < sizeof range / sizeof *range; r++) {
        double low = (double)range[r][0], wide = (double)range[r][1] - low;
        for (int i = 0; i < N; i++) value[i] = (float)(low + wide * ((i * 2654435761u) % 65536u) / 65535.0);
        pal_field_head head = head_of(N), got;
        size_t n = put(&head);
        CHECK_LE((double)n, (double)pal_field_bound(N));
        REQUIRE(pal_field_get(bytes, n, N, &got, level) == 0);
        CHECK(got.part == 3 && got.field == PAL_WIRE_FIELD_ENERGY_J_M3 && got.epoch == 2);
        double worst = 0;
        for (int i = 0; i < N; i++) worst = fmax(worst, fabs(pal_field_value(&got, level[i]) - (double)value[i]));
        CHECK_LE(worst, (0.5 / 255 + 1e-6) * wide);
        CHECK(worst > 0.3 / 255 * wide);
    }
}

static void the_same_number_everywhere_costs_few_bytes(void)
{
    for (int i = 0; i < N; i++) value[i] = 17.5f;
    pal_field_head head = head_of(N), got;
    size_t n = put(&head);
    CHECK_LE((double)n, 80);
    REQUIRE(pal_field_get(bytes, n, N, &got, level) == 0);
    CHECK(got.low == 17.5f && got.high == 17.5f);
    for (int i = 0; i < N; i++) CHECK_NEAR(pal_field_value(&got, level[i]), 17.5, 0);
}

static void encoder_refuses_what_cannot_be_shown(void)
{
    size_t n = 77;
    for (int i = 0; i < N; i++) value[i] = (float)i;
    pal_field_head head = head_of(N);
    CHECK_INT(pal_field_put(value, &head, work, bytes, pal_field_bound(N) - 1, &n), PAL_REFUSAL_SPACE);
    head.field = PAL_WIRE_FIELD_NONE;
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    head.field = PAL_WIRE_FIELD_COUNT;
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    head = head_of(N);
    head.part = PAL_WIRE_PART_MAX;
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    head = head_of(0);
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_COUNT);
    head = head_of(N);
    value[N - 1] = NAN;
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_NAN);
    value[N - 1] = INFINITY;
    CHECK_INT(pal_field_put(value, &head, work, bytes, CAP, &n), PAL_REFUSAL_NAN);
    CHECK_INT(n, 77);
}

static void decoder_refuses_every_cut_and_every_longer_message(void)
{
    static float golden[GOLDEN_FIELD_VERTICES];
    pal_field_head head = golden_field(golden), got;
    size_t n = 0;
    REQUIRE(pal_field_put(golden, &head, work, bytes, CAP, &n) == 0);
    for (size_t cut = 0; cut < n; cut++) {
        uint8_t *exact = malloc(cut + 1);
        memcpy(exact, bytes, cut);
        CHECK_INT(pal_field_get(exact, cut, GOLDEN_FIELD_VERTICES, &got, level), PAL_REFUSAL_SHORT);
        free(exact);
    }
    bytes[n] = 0;
    CHECK_INT(pal_field_get(bytes, n + 1, GOLDEN_FIELD_VERTICES, &got, level), PAL_REFUSAL_LONG);
    CHECK_INT(pal_field_get(bytes, n, GOLDEN_FIELD_VERTICES + 1, &got, level), PAL_REFUSAL_COUNT);
    CHECK_INT(pal_field_get(bytes, n, GOLDEN_FIELD_VERTICES - 1, &got, level), PAL_REFUSAL_COUNT);
}

/* n bytes of the golden message are changed at a place */
static int with(size_t at, const void *change, size_t n)
{
    static float golden[GOLDEN_FIELD_VERTICES];
    pal_field_head head = golden_field(golden), got = {.part = 99};
    size_t n_byte = 0;
    if (pal_field_put(golden, &head, work, bytes, CAP, &n_byte)) return -1;
    memcpy(bytes + at, change, n);
    int refusal = pal_field_get(bytes, n_byte, GOLDEN_FIELD_VERTICES, &got, level);
    CHECK(refusal == 0 || got.part == 99); /* the head is untouched by refusals */
    return refusal;
}

static int with_u32(size_t at, uint32_t v)
{
    uint8_t b[4];
    pal_put_u32(b, v);
    return with(at, b, 4);
}

static int with_float(size_t at, float v)
{
    uint8_t b[4];
    pal_put_f32(b, v);
    return with(at, b, 4);
}

static void decoder_refuses_bad_kinds_ranges_and_blocks(void)
{
    CHECK_INT(with(4, "\x01", 1), PAL_REFUSAL_KIND); /* a FRAME */
    CHECK_INT(with(4, "\x63", 1), PAL_REFUSAL_KIND);
    CHECK_INT(with(5, "\x01", 1), PAL_REFUSAL_FLAGS);
    CHECK_INT(with(0, "X", 1), PAL_REFUSAL_MAGIC);
    CHECK_INT(with(6, "\x10", 1), PAL_REFUSAL_RANGE); /* part 16 */
    CHECK_INT(with_u32(12, PAL_WIRE_FIELD_NONE), PAL_REFUSAL_RANGE);
    CHECK_INT(with_u32(12, PAL_WIRE_FIELD_COUNT), PAL_REFUSAL_RANGE);
    CHECK_INT(with_u32(12, 0x80000001u), PAL_REFUSAL_RANGE);
    CHECK_INT(with_u32(12, PAL_WIRE_FIELD_DISPLACEMENT_M), 0);
    CHECK_INT(with_u32(20, 1u << 21), PAL_REFUSAL_RANGE); /* time beyond 2^53 us */
    CHECK_INT(with_float(24, NAN), PAL_REFUSAL_NAN);
    CHECK_INT(with_float(28, INFINITY), PAL_REFUSAL_NAN);
    CHECK_INT(with_float(24, 3e6f), PAL_REFUSAL_RANGE); /* low above high */
    CHECK_INT(with_u32(32, 0), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(32, PAL_WIRE_VERTEX_MAX + 1), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(36, 1), PAL_REFUSAL_LONG);
    CHECK_INT(with_u32(36, 0xFFFFFFFFu), PAL_REFUSAL_SHORT);
    CHECK_INT(with(40, "\xFF\xFF\xFF", 3), PAL_REFUSAL_LZ4);
}

static void names_and_numbers_agree(void)
{
    static const char *const name[] = {"none",   "displacement", "von_mises", "energy",  "stiffness",
                                       "strain", "distortion",   "young",     "density", "damping"};
    for (int f = 0; f < PAL_WIRE_FIELD_COUNT; f++) CHECK_INT(pal_wire_field_find(name[f]), f);
    CHECK_INT(pal_wire_field_find("stress"), PAL_WIRE_FIELD_COUNT);
    CHECK_INT(pal_wire_field_find(""), PAL_WIRE_FIELD_COUNT);
}

/* every set of fields has one list of names, which fits */
static void sets_of_fields_are_named(void)
{
    static const char *const bad[] = {
        "", " ", "rainbow", "energy ", " energy", "energy  strain", "energy,strain", "energyenergyenergyenergyenergy"};
    char names[PAL_WIRE_FIELDS_BYTES];
    uint32_t got = 7;
    for (uint32_t set = 0; set < 1u << PAL_WIRE_FIELD_COUNT; set += 2) {
        pal_wire_field_put_set(set, names);
        CHECK(pal_wire_field_get_set(names, &got));
        CHECK_INT(got, set);
    }
    CHECK_LE((double)strlen(names), PAL_WIRE_FIELDS_BYTES - 1);
    pal_wire_field_put_set(0, names);
    CHECK_TEXT(names, "none");
    CHECK(pal_wire_field_get_set("strain energy", &got));
    CHECK_INT(got, 1u << PAL_WIRE_FIELD_ENERGY_J_M3 | 1u << PAL_WIRE_FIELD_STRAIN);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) CHECK(!pal_wire_field_get_set(bad[i], &got));
}

int main(void)
{
    RUN(values_come_back_within_half_a_level);
    RUN(the_same_number_everywhere_costs_few_bytes);
    RUN(encoder_refuses_what_cannot_be_shown);
    RUN(decoder_refuses_every_cut_and_every_longer_message);
    RUN(decoder_refuses_bad_kinds_ranges_and_blocks);
    RUN(names_and_numbers_agree);
    RUN(sets_of_fields_are_named);
    return check_report();
}
