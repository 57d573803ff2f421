/* TOPOLOGY_DELTA: tables follow their changes exactly, everything that is not exactly one message is refused and
 * changes nothing. */
#include "protocol/bytes.h"
#include "protocol/planes.h"
#include "protocol/topology_delta_codec.h"
#include "tests/check.h"
#include "tests/protocol/golden.h"

#include <lz4.h>

enum { SLOTS = 5000, VERTICES = 2600, CAP = 20 * SLOTS };
static uint32_t table[SLOTS][3], kept[SLOTS][3], slot[SLOTS];
static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)], bytes[CAP];

static uint32_t draw_below(uint64_t *state, uint32_t n)
{
    return (uint32_t)((shape_random(state) + 1) / 2 * n);
}

static size_t put(uint32_t n, uint64_t revision)
{
    pal_topology_delta_head head = {.part = 3, .epoch = 9, .n_changed = n, .revision = revision};
    size_t n_byte = 0;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n_byte), 0);
    CHECK_LE((double)n_byte, (double)pal_topology_delta_bound(n));
    return n_byte;
}

static void a_table_follows_random_changes_exactly(void)
{
    uint64_t state = 1;
    memset(table, 0, sizeof table);
    memset(kept, 0, sizeof kept);
    for (int round = 0; round < CHECK_REPEATS(200, 20); round++) {
        uint32_t n = 0, gap = 1 + draw_below(&state, round % 7 ? 400 : 1);
        for (uint32_t p = draw_below(&state, gap); p < SLOTS; p += 1 + draw_below(&state, gap)) {
            for (int c = 0; c < 3; c++) table[p][c] = draw_below(&state, 3) ? draw_below(&state, VERTICES) : 0;
            slot[n++] = p;
        }
        if (n == 0) continue;
        pal_topology_delta_head got;
        size_t n_byte = put(n, 100 + (uint64_t)round);
        REQUIRE(pal_topology_delta_get(bytes, n_byte, SLOTS, VERTICES, work, &got, kept[0]) == 0);
        CHECK(got.part == 3 && got.epoch == 9 && got.n_changed == n && got.revision == 100 + (uint64_t)round);
        CHECK(memcmp(table, kept, sizeof table) == 0);
    }
}

/* a hundred faces that were split beside one another: their corners are neighbours in number */
static void a_change_in_one_region_costs_a_few_bytes_a_triangle(void)
{
    for (uint32_t i = 0; i < 400; i++) {
        slot[i] = 1200 + i;
        table[slot[i]][0] = 900 + i / 2;
        table[slot[i]][1] = 901 + i / 2;
        table[slot[i]][2] = 1700 + i % 2 + i / 2;
    }
    size_t n_byte = put(400, 5);
    printf("  400 triangles in %zu bytes\n", n_byte);
    CHECK_LE((double)n_byte, 400);
}

static void all_slots_and_the_largest_numbers_go_through(void)
{
    static uint32_t last[3];
    uint32_t *huge = calloc(3 * (size_t)PAL_TRIANGLE_SLOT_MAX, sizeof *huge);
    uint8_t *room = malloc(PAL_TOPOLOGY_DELTA_WORK_BYTES(2));
    REQUIRE(huge && room);
    pal_topology_delta_head head = {.part = PAL_WIRE_PART_MAX - 1, .n_changed = 2, .revision = ((uint64_t)1 << 53) - 1};
    size_t n_byte = 0, end = 3 * (size_t)(PAL_TRIANGLE_SLOT_MAX - 1);
    slot[0] = 0;
    slot[1] = PAL_TRIANGLE_SLOT_MAX - 1;
    huge[end] = PAL_WIRE_VERTEX_MAX - 1;
    huge[end + 2] = 1;
    REQUIRE(pal_topology_delta_put(slot, huge, &head, room, bytes, CAP, &n_byte) == 0);
    memcpy(last, huge + end, sizeof last);
    memset(huge + end, 0, sizeof last);
    free(room);
    room = malloc(PAL_TOPOLOGY_DELTA_WORK_BYTES(PAL_TRIANGLE_SLOT_MAX)); /* only what the message needs is touched */
    REQUIRE(room &&
            pal_topology_delta_get(bytes, n_byte, PAL_TRIANGLE_SLOT_MAX, PAL_WIRE_VERTEX_MAX, room, &head, huge) == 0);
    CHECK(memcmp(huge + end, last, sizeof last) == 0);
    CHECK_INT(pal_topology_delta_get(bytes, n_byte, PAL_TRIANGLE_SLOT_MAX - 1, PAL_WIRE_VERTEX_MAX, room, &head, huge),
              PAL_REFUSAL_RANGE);
    CHECK_INT(pal_topology_delta_get(bytes, n_byte, PAL_TRIANGLE_SLOT_MAX, PAL_WIRE_VERTEX_MAX - 1, room, &head, huge),
              PAL_REFUSAL_RANGE);
    free(room);
    free(huge);
}

static void encoder_refuses_what_no_table_has(void)
{
    pal_topology_delta_head head = {.part = 3, .n_changed = 3, .revision = 1};
    size_t n = 77;
    slot[0] = 1, slot[1] = 2, slot[2] = 4;
    memset(table, 0, sizeof table);
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, pal_topology_delta_bound(3) - 1, &n),
              PAL_REFUSAL_SPACE);
    slot[2] = 2;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    slot[2] = PAL_TRIANGLE_SLOT_MAX;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    slot[2] = 4;
    table[4][1] = PAL_WIRE_VERTEX_MAX;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    table[4][1] = 0;
    head.revision = (uint64_t)1 << 53;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    head.revision = 1;
    head.part = PAL_WIRE_PART_MAX;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_RANGE);
    head.part = 0;
    head.n_changed = 0;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_COUNT);
    head.n_changed = PAL_TRIANGLE_SLOT_MAX + 1;
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, CAP, &n), PAL_REFUSAL_COUNT);
    CHECK_INT(n, 77);
}

/* ---- hostile messages: the golden one, changed ---- */

enum { GOLDEN_SLOTS = 108, GOLDEN_VERTICES = 56 };
static uint32_t golden_table[GOLDEN_SLOTS][3];

static size_t golden_bytes(uint8_t *dst)
{
    pal_topology_delta_head head = golden_topology_delta();
    size_t n = 0;
    memset(golden_table, 0, sizeof golden_table);
    for (int i = 0; i < GOLDEN_DELTA_SLOTS; i++)
        memcpy(golden_table[golden_slot[i]], golden_corner[i], sizeof golden_corner[i]);
    CHECK_INT(pal_topology_delta_put(golden_slot, golden_table[0], &head, work, dst, CAP, &n), 0);
    return n;
}

/* reads a copy of exactly that length; a refusal leaves head and table as they were */
static int read_exact(const uint8_t *from, size_t n, uint32_t n_slot, uint32_t n_vertex)
{
    uint8_t *exact = malloc(n + 1), *room = malloc(PAL_TOPOLOGY_DELTA_WORK_BYTES(n_slot) + 1);
    uint32_t(*mine)[3] = calloc((size_t)n_slot + 1, sizeof *mine);
    pal_topology_delta_head head = {.part = 99};
    memcpy(exact, from, n);
    memset(mine, 0x11, ((size_t)n_slot + 1) * sizeof *mine);
    int refusal = pal_topology_delta_get(exact, n, n_slot, n_vertex, room, &head, mine[0]);
    bool same = head.part == 99, within = true;
    for (uint32_t i = 0; i <= n_slot; i++)
        for (int c = 0; c < 3; c++) {
            same = same && mine[i][c] == 0x11111111u;
            within = within && (mine[i][c] == 0x11111111u || (mine[i][c] < n_vertex && i < n_slot));
        }
    CHECK(refusal ? same : within);
    free(exact);
    free(room);
    free(mine);
    return refusal;
}

static void decoder_refuses_every_cut_and_every_longer_message(void)
{
    size_t n = golden_bytes(bytes);
    CHECK_INT(read_exact(bytes, n, GOLDEN_SLOTS, GOLDEN_VERTICES), 0);
    for (size_t cut = 0; cut < n; cut++)
        CHECK_INT(read_exact(bytes, cut, GOLDEN_SLOTS, GOLDEN_VERTICES), PAL_REFUSAL_SHORT);
    bytes[n] = 0;
    CHECK_INT(read_exact(bytes, n + 1, GOLDEN_SLOTS, GOLDEN_VERTICES), PAL_REFUSAL_LONG);
    CHECK_INT(read_exact(bytes, n, GOLDEN_DELTA_SLOTS - 1, GOLDEN_VERTICES), PAL_REFUSAL_COUNT);
    CHECK_INT(read_exact(bytes, n, GOLDEN_SLOTS - 1, GOLDEN_VERTICES), PAL_REFUSAL_RANGE);
    CHECK_INT(read_exact(bytes, n, GOLDEN_SLOTS, GOLDEN_VERTICES - 1), PAL_REFUSAL_RANGE);
}

static void every_byte_changed_to_anything_is_refused_or_stays_within_the_table(void)
{
    size_t n = golden_bytes(bytes);
    int taken = 0;
    for (size_t at = 0; at < n; at++)
        for (int value = 0; value < 256; value += CHECK_REPEATS(1, 5)) {
            uint8_t before = bytes[at];
            bytes[at] = (uint8_t)value;
            taken += read_exact(bytes, n, GOLDEN_SLOTS, GOLDEN_VERTICES) == 0;
            bytes[at] = before;
        }
    CHECK(taken > 0);
}

static int with(size_t at, const void *change, size_t n)
{
    size_t n_byte = golden_bytes(bytes);
    memcpy(bytes + at, change, n);
    return read_exact(bytes, n_byte, GOLDEN_SLOTS, GOLDEN_VERTICES);
}

static int with_u32(size_t at, uint32_t v)
{
    uint8_t b[4];
    pal_put_u32(b, v);
    return with(at, b, 4);
}

static void decoder_refuses_bad_heads_and_blocks(void)
{
    CHECK_INT(with(0, "X", 1), PAL_REFUSAL_MAGIC);
    CHECK_INT(with(4, "\x04", 1), PAL_REFUSAL_KIND); /* a FIELD */
    CHECK_INT(with(4, "\x06", 1), PAL_REFUSAL_KIND);
    CHECK_INT(with(5, "\x01", 1), PAL_REFUSAL_FLAGS);
    CHECK_INT(with(6, "\x10", 1), PAL_REFUSAL_RANGE); /* part 16 */
    CHECK_INT(with_u32(12, 0), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(12, GOLDEN_DELTA_SLOTS + 1), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(12, PAL_TRIANGLE_SLOT_MAX + 1), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(20, 1u << 21), PAL_REFUSAL_RANGE); /* revision beyond 2^53 */
    CHECK_INT(with_u32(24, 16 * GOLDEN_DELTA_SLOTS - 1), PAL_REFUSAL_COUNT);
    CHECK_INT(with_u32(28, 1), PAL_REFUSAL_LONG);
    CHECK_INT(with_u32(28, 0xFFFFFFFFu), PAL_REFUSAL_SHORT);
    CHECK_INT(with(32, "\xFF\xFF\xFF", 3), PAL_REFUSAL_LZ4);
    /* a short block that promises much is refused before anything is expanded */
    uint8_t small[PAL_TOPOLOGY_DELTA_HEAD_BYTES + 1] = {'P', 'A', 'L', '1', PAL_WIRE_TOPOLOGY_DELTA};
    pal_put_u32(small + 12, PAL_TRIANGLE_SLOT_MAX);
    pal_put_u32(small + 24, (uint32_t)PAL_TOPOLOGY_DELTA_WORK_BYTES(PAL_TRIANGLE_SLOT_MAX));
    pal_put_u32(small + 28, 1);
    pal_topology_delta_head head;
    CHECK_INT(pal_topology_delta_get_head(small, sizeof small, &head), PAL_REFUSAL_COUNT);
}

/* a message of two slots as a hostile server would write it */
static int two(uint32_t first, uint32_t second, uint32_t corner)
{
    uint8_t planes[PAL_TOPOLOGY_DELTA_WORK_BYTES(2)] = {0};
    pal_put_plane(planes, 2, 0, pal_fold(first));
    pal_put_plane(planes, 2, 1, pal_fold(second - first));
    pal_put_plane(planes + 8, 6, 4, pal_fold(corner)); /* second slot, second corner */
    size_t n = golden_bytes(bytes);
    int n_lz4 = LZ4_compress_default((const char *)planes, (char *)bytes + PAL_TOPOLOGY_DELTA_HEAD_BYTES, sizeof planes,
                                     CAP - PAL_TOPOLOGY_DELTA_HEAD_BYTES);
    CHECK(n > 0 && n_lz4 > 0);
    pal_put_u32(bytes + 12, 2);
    pal_put_u32(bytes + 24, sizeof planes);
    pal_put_u32(bytes + 28, (uint32_t)n_lz4);
    return read_exact(bytes, PAL_TOPOLOGY_DELTA_HEAD_BYTES + (size_t)n_lz4, GOLDEN_SLOTS, GOLDEN_VERTICES);
}

static void decoder_refuses_slots_and_corners_outside_the_table(void)
{
    CHECK_INT(two(0, 1, 0), 0);
    CHECK_INT(two(0, GOLDEN_SLOTS - 1, GOLDEN_VERTICES - 1), 0);
    CHECK_INT(two(0, 0, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(7, 6, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(0, GOLDEN_SLOTS, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(GOLDEN_SLOTS, GOLDEN_SLOTS + 1, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(0xFFFFFFFFu, 0, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(1, 0xFFFFFFFFu, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(two(0, 1, GOLDEN_VERTICES), PAL_REFUSAL_RANGE);
    CHECK_INT(two(0, 1, 0xFFFFFFFFu), PAL_REFUSAL_RANGE);
}

int main(void)
{
    RUN(a_table_follows_random_changes_exactly);
    RUN(a_change_in_one_region_costs_a_few_bytes_a_triangle);
    RUN(all_slots_and_the_largest_numbers_go_through);
    RUN(encoder_refuses_what_no_table_has);
    RUN(decoder_refuses_every_cut_and_every_longer_message);
    RUN(every_byte_changed_to_anything_is_refused_or_stays_within_the_table);
    RUN(decoder_refuses_bad_heads_and_blocks);
    RUN(decoder_refuses_slots_and_corners_outside_the_table);
    return check_report();
}
