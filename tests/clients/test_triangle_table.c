/* A client's table of triangles: deltas before the asset and after it give the same, hostile ones nothing. */
#include "clients/link/triangle_table.h"
#include "tests/check.h"

enum { SLOTS = 60, VERTICES = 40 };

static uint32_t load_tri[SLOTS][3];
static float rest[VERTICES][3];
static pal_frame_order order = {.n_vertex = VERTICES};
static const pal_asset asset = {SLOTS, rest[0], NULL, NULL, load_tri[0], &order};
static uint8_t bytes[4096];

/* a patch that writes `value` into every step-th slot */
static size_t patch(uint32_t first, uint32_t step, uint32_t value, uint64_t revision)
{
    static uint32_t table[SLOTS][3];
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)];
    uint32_t slot[SLOTS], n = 0;
    size_t n_byte = 0;
    for (uint32_t p = first; p < SLOTS; p += step) {
        for (uint32_t c = 0; c < 3; c++) table[p][c] = value ? (value + c) % VERTICES : 0;
        slot[n++] = p;
    }
    pal_topology_delta_head head = {.part = 1, .epoch = 2, .n_changed = n, .revision = revision};
    CHECK_INT(pal_topology_delta_put(slot, table[0], &head, work, bytes, sizeof bytes, &n_byte), 0);
    return n_byte;
}

static void begin(pal_triangle_table *t)
{
    for (uint32_t i = 0; i < SLOTS; i++)
        for (uint32_t c = 0; c < 3; c++) load_tri[i][c] = i % 4 ? 0 : (i + c) % VERTICES;
    CHECK_INT(pal_triangle_table_init(t, SLOTS, VERTICES), PAL_ERR_OK);
}

static void patches_before_the_asset_count_as_much_as_after_it(void)
{
    pal_triangle_table early, late;
    pal_topology_delta_head head;
    begin(&early);
    begin(&late);
    CHECK_INT(pal_triangle_table_set_base(&late, &asset), PAL_ERR_OK);
    CHECK_INT(pal_triangle_table_count(&late), SLOTS / 4);
    for (uint64_t k = 1; k < 6; k++) {
        size_t n = patch((uint32_t)k, 7 * (uint32_t)k, k % 2 ? (uint32_t)k : 0, 10 * k);
        CHECK_INT(pal_triangle_table_apply(&early, bytes, n, &head), 0);
        CHECK_INT(pal_triangle_table_apply(&late, bytes, n, &head), 0);
    }
    CHECK_INT(pal_triangle_table_count(&early), 0);
    CHECK_INT(pal_triangle_table_set_base(&early, &asset), PAL_ERR_OK);
    CHECK(memcmp(early.tri, late.tri, sizeof load_tri) == 0);
    CHECK_INT(pal_triangle_table_count(&early), pal_triangle_table_count(&late));
    CHECK(memcmp(early.tri, load_tri, sizeof load_tri) != 0);
    /* the asset once more changes nothing */
    CHECK_INT(pal_triangle_table_set_base(&late, &asset), PAL_ERR_OK);
    CHECK(memcmp(early.tri, late.tri, sizeof load_tri) == 0);
    pal_triangle_table_free(&early);
    pal_triangle_table_free(&late);
}

static void what_does_not_fit_leaves_the_table_alone(void)
{
    pal_triangle_table t;
    pal_topology_delta_head head = {.part = 99};
    begin(&t);
    CHECK_INT(pal_triangle_table_set_base(&t, &asset), PAL_ERR_OK);
    size_t n = patch(0, 3, 5, 20);
    CHECK_INT(pal_triangle_table_apply(&t, bytes, n - 1, &head), PAL_REFUSAL_SHORT);
    bytes[12]++;
    CHECK_INT(pal_triangle_table_apply(&t, bytes, n, &head), PAL_REFUSAL_COUNT);
    bytes[12]--;
    CHECK(head.part == 99 && t.revision == 0 && memcmp(t.tri, load_tri, sizeof load_tri) == 0);
    CHECK_INT(pal_triangle_table_apply(&t, bytes, n, &head), 0);
    CHECK(head.part == 1 && t.revision == 20 && memcmp(t.tri, load_tri, sizeof load_tri) != 0);
    /* a patch that came before is none after */
    CHECK_INT(pal_triangle_table_apply(&t, bytes, n, &head), PAL_REFUSAL_ORDER);
    n = patch(0, 3, 6, 19);
    CHECK_INT(pal_triangle_table_apply(&t, bytes, n, &head), PAL_REFUSAL_ORDER);
    pal_triangle_table_free(&t);
    /* another asset than hello spoke of */
    CHECK_INT(pal_triangle_table_init(&t, SLOTS + 1, VERTICES), PAL_ERR_OK);
    CHECK_INT(pal_triangle_table_set_base(&t, &asset), PAL_ERR_REFUSED);
    CHECK_INT(pal_triangle_table_count(&t), 0);
    pal_triangle_table_free(&t);
    CHECK_INT(pal_triangle_table_init(&t, PAL_TRIANGLE_SLOT_MAX + 1, VERTICES), PAL_ERR_REFUSED);
    CHECK_INT(pal_triangle_table_init(&t, SLOTS, PAL_WIRE_VERTEX_MAX + 1), PAL_ERR_REFUSED);
    pal_triangle_table_free(&t);
}

int main(void)
{
    RUN(patches_before_the_asset_count_as_much_as_after_it);
    RUN(what_does_not_fit_leaves_the_table_alone);
    return check_report();
}
