/* Tables of triangles that change: whatever a client has missed, one patch brings it to now. */
#include "protocol/topology_delta_codec.h"
#include "server/net/transport/triangle_slots.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

enum { PLACES = 300, VERTICES = 170, CLIENTS = 6 };

static uint64_t state = 1;
static uint32_t below(uint32_t n)
{
    return (uint32_t)random_below(&state, n);
}

static int32_t table[PLACES][3];

static pal_err make(uint32_t n_slot, pal_diagnostic *diag, pal_triangle_slots **out)
{
    return pal_triangle_slots_make(3, "ball", 1, table[0], n_slot, VERTICES, diag, out);
}

static void change_some(int n)
{
    for (int i = 0; i < n; i++)
        for (int32_t c = 0, p = (int32_t)below(PLACES), empty = below(3) == 0; c < 3; c++)
            table[p][c] = empty ? 0 : (int32_t)below(VERTICES);
}

static void fill(void)
{
    memset(table, 0, sizeof table);
    change_some(200);
}

/* takes the patch from what the client has; returns its length, 0: none was needed */
static size_t follow(pal_triangle_slots *p, uint32_t has, uint32_t mine[PLACES][3], uint64_t revision)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(PLACES)];
    pal_topology_delta_head head;
    pal_packet *packet = pal_triangle_slots_delta(p, has);
    if (!packet) return 0;
    CHECK_INT(pal_topology_delta_get(packet->bytes, packet->n_byte, PLACES, VERTICES, work, &head, mine[0]), 0);
    CHECK(head.part == 3 && head.epoch == 1 && head.revision == revision);
    size_t n = packet->n_byte;
    pal_packet_drop(packet);
    return n;
}

static void clients_that_come_and_skip_as_they_like_have_the_newest_table(void)
{
    static uint32_t mine[CLIENTS][PLACES][3];
    uint32_t has[CLIENTS] = {0};
    uint64_t revision = 0; /* of the newest change */
    pal_triangle_slots *p = NULL;
    size_t fixed = pal_packet_total();
    fill();
    REQUIRE(make(PLACES, NULL, &p) == PAL_ERR_OK);
    for (int k = 0; k < CLIENTS; k++) memcpy(mine[k], table, sizeof table);
    for (int round = 0; round < CHECK_REPEATS(2000, 200); round++) {
        change_some((int)below(12));
        if (pal_triangle_slots_update(p, table[0], 8 + (uint64_t)round)) revision = 8 + (uint64_t)round;
        for (int k = 0; k < CLIENTS; k++) {
            if (k && below(1u << k)) continue; /* the first always keeps up */
            size_t n = follow(p, has[k], mine[k], revision);
            CHECK_INT(n > 0, has[k] != p->change);
            has[k] = p->change;
            CHECK(memcmp(mine[k], table, sizeof table) == 0);
        }
    }
    pal_triangle_slots_free(p);
    CHECK_INT(pal_packet_total(), fixed);
}

static void hidden_are_the_vertices_of_no_triangle(void)
{
    pal_triangle_slots *p = NULL;
    fill();
    REQUIRE(make(PLACES, NULL, &p) == PAL_ERR_OK);
    for (int round = 0; round < CHECK_REPEATS(300, 50); round++) {
        bool used[VERTICES] = {false};
        int wrong = 0;
        for (int i = 0; i < PLACES; i++)
            for (int c = 0; c < 3 && (table[i][0] || table[i][1] || table[i][2]); c++) used[table[i][c]] = true;
        for (int i = 0; i < VERTICES; i++) wrong += p->hidden[i] == used[i];
        CHECK_INT(wrong, 0);
        change_some((int)below(40));
        if (round % 50 == 49) memset(table, 0, sizeof table);
        pal_triangle_slots_update(p, table[0], 100 + (uint64_t)round);
    }
    pal_triangle_slots_free(p);
}

static void what_did_not_change_makes_no_delta(void)
{
    pal_triangle_slots *p = NULL;
    fill();
    REQUIRE(make(PLACES, NULL, &p) == PAL_ERR_OK);
    CHECK(!pal_triangle_slots_delta(p, 0));
    CHECK(!pal_triangle_slots_update(p, table[0], 9)); /* another revision, the same triangles */
    CHECK(!pal_triangle_slots_delta(p, 0));
    CHECK_INT(p->change, 0);
    table[17][0] ^= 1;
    CHECK(!pal_triangle_slots_update(p, table[0], 9)); /* the same revision: not even looked at */
    CHECK(pal_triangle_slots_update(p, table[0], 10));
    CHECK_INT(p->change, 1);
    CHECK(!pal_triangle_slots_delta(p, 1));
    pal_triangle_slots_free(p);
}

static void clients_at_the_same_change_share_one_packet(void)
{
    pal_triangle_slots *p = NULL;
    fill();
    REQUIRE(make(PLACES, NULL, &p) == PAL_ERR_OK);
    for (uint64_t round = 0; round < 9; round++) {
        table[round][1] ^= 1;
        CHECK(pal_triangle_slots_update(p, table[0], 50 + round));
    }
    pal_packet *a = pal_triangle_slots_delta(p, 8), *b = pal_triangle_slots_delta(p, 8),
               *c = pal_triangle_slots_delta(p, 0);
    REQUIRE(a && b && c);
    CHECK(a == b && a->n_user == 3 && c != a);
    CHECK_INT(p->n_delta, 2);
    CHECK(c->n_byte > a->n_byte);
    /* a few are kept for each table, not all there ever were */
    for (uint32_t from = 1; from < 8; from++) pal_packet_drop(pal_triangle_slots_delta(p, from));
    CHECK_INT(p->n_delta, 9);
    pal_packet_drop(pal_triangle_slots_delta(p, 7));
    CHECK_INT(p->n_delta, 9);
    pal_packet_drop(pal_triangle_slots_delta(p, 8));
    CHECK_INT(p->n_delta, 10);
    pal_packet_drop(a);
    pal_packet_drop(b);
    pal_packet_drop(c);
    pal_triangle_slots_free(p);
}

static void a_corner_that_is_no_vertex_empties_its_place(void)
{
    pal_triangle_slots *p = NULL;
    fill();
    REQUIRE(make(PLACES, NULL, &p) == PAL_ERR_OK);
    static const int32_t wrong[] = {VERTICES, -1, INT32_MAX, INT32_MIN};
    for (uint64_t k = 0; k < 4; k++) {
        table[5][0] = 3, table[5][1] = 4, table[5][2] = wrong[k];
        pal_triangle_slots_update(p, table[0], 20 + k);
        CHECK(p->tri[15] == 0 && p->tri[16] == 0 && p->tri[17] == 0);
    }
    pal_triangle_slots_free(p);
    p = NULL;
    pal_diagnostic diag = {""};
    CHECK_INT(make(PAL_TRIANGLE_SLOT_MAX + 1, &diag, &p), PAL_ERR_BUDGET);
    CHECK(!p && strstr(diag.text, "part ball: 4194305 triangles"));
}

int main(void)
{
    RUN(clients_that_come_and_skip_as_they_like_have_the_newest_table);
    RUN(hidden_are_the_vertices_of_no_triangle);
    RUN(what_did_not_change_makes_no_delta);
    RUN(clients_at_the_same_change_share_one_packet);
    RUN(a_corner_that_is_no_vertex_empties_its_place);
    return check_report();
}
