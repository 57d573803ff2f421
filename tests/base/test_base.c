/* The base room: arenas, mailbox, queue, error table. */
#include "server/base/arena.h"
#include "server/base/clock.h"
#include "server/base/command_queue.h"
#include "server/base/err.h"
#include "server/base/machine.h"
#include "server/base/triple_buffer.h"
#include "server/base/vec3.h"
#include "tests/check.h"

#include <pthread.h>
#include <stdint.h>

static void every_error_has_name_and_text(void)
{
    for (int e = 0; e < PAL_ERR_COUNT; e++) CHECK(strlen(pal_err_name(e)) > 0 && strlen(pal_err_text(e)) > 0);
    CHECK_TEXT(pal_err_name(PAL_ERR_REFUSED), "REFUSED");
    CHECK_TEXT(pal_err_name((pal_err)999), "UNKNOWN");
}

static void diagnostic_is_cut_at_the_end_of_its_buffer(void)
{
    pal_diagnostic diag;
    char longer[2000];
    memset(longer, 'x', sizeof longer - 1);
    longer[sizeof longer - 1] = 0;
    CHECK_INT(pal_diagnostic_set(&diag, PAL_ERR_IO, "%s", longer), PAL_ERR_IO);
    CHECK_INT(strlen(diag.text), sizeof diag.text - 1);
    CHECK_INT(pal_diagnostic_set(NULL, PAL_ERR_IO, "%s", longer), PAL_ERR_IO);
}

static void prefix_stands_before_the_sentence_or_that_of_the_code(void)
{
    pal_diagnostic diag = {"no such file"};
    CHECK_INT(pal_diagnostic_prefix(&diag, PAL_ERR_OK, "a.json"), PAL_ERR_OK);
    CHECK_TEXT(diag.text, "no such file");
    CHECK_INT(pal_diagnostic_prefix(&diag, PAL_ERR_IO, "a.json"), PAL_ERR_IO);
    CHECK_TEXT(diag.text, "a.json: no such file");
    diag.text[0] = 0;
    CHECK_INT(pal_diagnostic_prefix(&diag, PAL_ERR_MEMORY, "a.json"), PAL_ERR_MEMORY);
    CHECK_TEXT(diag.text, "a.json: out of memory, nothing changed");
    CHECK_INT(pal_diagnostic_prefix(NULL, PAL_ERR_IO, "a.json"), PAL_ERR_IO);
}

static void arena_gives_zeroed_aligned_bytes_and_refuses_overflow(void)
{
    pal_arena *arena = pal_arena_create(1000, true);
    REQUIRE(arena);
    for (int i = 0; i < 100; i++) {
        uint8_t *bytes = pal_arena_alloc(arena, 177);
        REQUIRE(bytes && (uintptr_t)bytes % 64 == 0);
        int sum = 0;
        for (int k = 0; k < 177; k++) sum += bytes[k];
        CHECK_INT(sum, 0);
        memset(bytes, 255, 177);
    }
    CHECK(!pal_arena_array(arena, SIZE_MAX / 2, 3));
    CHECK(!pal_arena_alloc(arena, SIZE_MAX));
    pal_arena_destroy(arena);
}

static void fixed_arena_refuses_beyond_its_size_and_empties(void)
{
    pal_arena *arena = pal_arena_create(256, false);
    REQUIRE(arena);
    CHECK(pal_arena_alloc(arena, 200));
    CHECK(!pal_arena_alloc(arena, 1));
    pal_arena_reset(arena);
    CHECK_INT(pal_arena_used(arena), 0);
    size_t mark = pal_arena_used(arena);
    CHECK(pal_arena_alloc(arena, 64));
    pal_arena_rewind(arena, mark);
    uint8_t *again = pal_arena_alloc(arena, 256);
    CHECK(again && again[0] == 0);
    pal_arena_destroy(arena);
}

/* the value is written twice, so that a torn read shows */
typedef struct pair {
    uint64_t a, b;
} pair;
enum { PASSED = 200000 };

static void *write_pairs(void *user)
{
    pal_triple_buffer *buffer = user;
    for (uint64_t i = 1; i <= PASSED; i++) {
        pair *slot = pal_triple_buffer_slot(buffer);
        slot->a = slot->b = i;
        pal_triple_buffer_publish(buffer);
    }
    return NULL;
}

static void triple_buffer_passes_the_newest_value_whole_and_in_order(void)
{
    pair value[3] = {{0}};
    pal_triple_buffer buffer;
    pthread_t writer;
    pal_triple_buffer_init(&buffer, &value[0], &value[1], &value[2]);
    CHECK(!pal_triple_buffer_take(&buffer));
    REQUIRE(pthread_create(&writer, NULL, write_pairs, &buffer) == 0);
    uint64_t last = 0, torn = 0, back = 0;
    while (last < PASSED) {
        pair *p = pal_triple_buffer_take(&buffer);
        if (!p) continue;
        torn += p->a != p->b;
        back += p->a <= last;
        last = p->a;
    }
    pthread_join(writer, NULL);
    CHECK_INT(torn, 0);
    CHECK_INT(back, 0);
    CHECK(!pal_triple_buffer_take(&buffer));
}

typedef struct sender {
    pal_command_queue *queue;
    uint32_t id;
} sender;

static void *fill_queue(void *user)
{
    sender *s = user;
    for (uint32_t i = 0; i < 20000; i++) {
        uint32_t item[2] = {s->id, i};
        while (pal_command_queue_put(s->queue, item)) {
        }
    }
    return NULL;
}

static void command_queue_keeps_every_item_of_every_writer_in_order(void)
{
    pal_command_queue *queue = pal_command_queue_create(64, 8);
    pthread_t thread[3];
    sender who[3];
    REQUIRE(queue);
    for (uint32_t i = 0; i < 3; i++) {
        who[i] = (sender){queue, i};
        REQUIRE(pthread_create(&thread[i], NULL, fill_queue, &who[i]) == 0);
    }
    uint32_t next[3] = {0}, item[2], wrong = 0;
    for (int taken = 0; taken < 60000;) {
        if (!pal_command_queue_get(queue, item)) continue;
        wrong += item[0] > 2 || item[1] != next[item[0]]++;
        taken++;
    }
    for (int i = 0; i < 3; i++) pthread_join(thread[i], NULL);
    CHECK_INT(wrong, 0);
    CHECK(!pal_command_queue_get(queue, item));
    pal_command_queue_destroy(queue);
}

static void full_command_queue_refuses(void)
{
    pal_command_queue *queue = pal_command_queue_create(4, 4);
    uint32_t item = 7;
    REQUIRE(queue);
    for (int i = 0; i < 4; i++) CHECK_INT(pal_command_queue_put(queue, &item), PAL_ERR_OK);
    CHECK_INT(pal_command_queue_put(queue, &item), PAL_ERR_FULL);
    CHECK(pal_command_queue_get(queue, &item));
    CHECK_INT(pal_command_queue_put(queue, &item), PAL_ERR_OK);
    pal_command_queue_destroy(queue);
}

static void quaternion_rotates_as_its_matrix_does(void)
{
    /* a quarter turn about z takes x to y */
    double q[4] = {sqrt(0.5), 0, 0, sqrt(0.5)}, r[3];
    pal_quat_rotate(r, q, (double[3]){1, 0, 0});
    CHECK_NEAR(r[0], 0, 1e-15);
    CHECK_NEAR(r[1], 1, 1e-15);
    CHECK_NEAR(r[2], 0, 1e-15);
}

static void clock_sleeps_until_the_requested_time(void)
{
    uint64_t when = pal_clock_ns() + 3000000;
    pal_clock_sleep_until_ns(when);
    CHECK(pal_clock_ns() >= when);
}

static void machine_name_is_stable(void)
{
    char a[PAL_MACHINE_TEXT], b[PAL_MACHINE_TEXT];
    CHECK_TEXT(pal_machine_name(a), pal_machine_name(b));
    CHECK(strlen(a) > 4 && strstr(a, "core") != NULL);
    for (const char *c = a; *c; c++) CHECK(*c >= 0x20 && *c < 0x7f);
}

int main(void)
{
    RUN(every_error_has_name_and_text);
    RUN(diagnostic_is_cut_at_the_end_of_its_buffer);
    RUN(prefix_stands_before_the_sentence_or_that_of_the_code);
    RUN(arena_gives_zeroed_aligned_bytes_and_refuses_overflow);
    RUN(fixed_arena_refuses_beyond_its_size_and_empties);
    RUN(triple_buffer_passes_the_newest_value_whole_and_in_order);
    RUN(command_queue_keeps_every_item_of_every_writer_in_order);
    RUN(full_command_queue_refuses);
    RUN(quaternion_rotates_as_its_matrix_does);
    RUN(clock_sleeps_until_the_requested_time);
    RUN(machine_name_is_stable);
    return check_report();
}
