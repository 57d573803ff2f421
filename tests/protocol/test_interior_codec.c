/* INTERIOR: displacements and values within their bounds, and what is refused. */
#include "protocol/bytes.h"
#include "protocol/interior_codec.h"
#include "tests/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = 3000, CAP = 64000 };
static float node[4 * N], move[3 * N];
static uint8_t work[7 * N], bytes[CAP], level[N];

static pal_interior_head head_of(uint32_t n)
{
    return (pal_interior_head){.part = 3,
                               .field = PAL_WIRE_FIELD_VON_MISES_PA,
                               .epoch = 4000000000u,
                               .sim_time_us = 123456789012,
                               .q_m = 1e-4f,
                               .n_node = n};
}

/* a smooth motion of 3 cm, and one that jumps from end to end */
static void fill(double size_m, bool jumps)
{
    for (int i = 0; i < N; i++) {
        const double t = jumps ? (i % 2 ? 1 : -1) * 1.57 : 0.003 * i;
        node[4 * i] = (float)(size_m * sin(t));
        node[4 * i + 1] = (float)(-size_m * sin(0.7 * t));
        node[4 * i + 2] = (float)(0.1 * size_m * t);
        node[4 * i + 3] = (float)(500 * (1 + cos(t)));
    }
}

static void displacements_and_values_come_back_within_half_a_step(void)
{
    static const double size[] = {0.03, 0.03, 50, 1e-7};
    for (int k = 0; k < 4; k++) {
        size_t n = 0;
        fill(size[k], k == 1);
        pal_interior_head put = head_of(N), got;
        CHECK_INT(pal_interior_put(node, &put, work, bytes, sizeof bytes, &n), 0);
        CHECK(n <= pal_interior_bound(N));
        CHECK_INT(pal_interior_get(bytes, n, N, work, &got, move, level), 0);
        CHECK(got.part == put.part && got.field == put.field && got.epoch == put.epoch && got.n_node == put.n_node);
        CHECK(got.sim_time_us == put.sim_time_us && got.low == put.low && got.high == put.high && got.q_m == put.q_m);
        /* the step grows only where 16 bits are too few */
        if (k == 2)
            CHECK(got.q_m > 1e-4f);
        else
            CHECK_NEAR((double)got.q_m, 1e-4, 1e-10);
        double worst = 0, value = 0;
        for (int i = 0; i < N; i++) {
            for (int c = 0; c < 3; c++) worst = fmax(worst, fabs((double)move[3 * i + c] - (double)node[4 * i + c]));
            const double back = (double)got.low + ((double)got.high - (double)got.low) * level[i] / 255;
            value = fmax(value, fabs(back - (double)node[4 * i + 3]));
        }
        CHECK_LE(worst, 0.501 * (double)got.q_m + 1e-6 * size[k]);
        CHECK_LE(value, 0.502 * ((double)got.high - (double)got.low) / 255);
    }
}

static void a_smooth_motion_takes_few_bytes(void)
{
    size_t n = 0;
    fill(0.03, false);
    pal_interior_head put = head_of(N);
    CHECK_INT(pal_interior_put(node, &put, work, bytes, sizeof bytes, &n), 0);
    CHECK_LE((double)n / N, 2.5);
}

static size_t good(void)
{
    size_t n = 0;
    fill(0.03, false);
    pal_interior_head put = head_of(N);
    if (pal_interior_put(node, &put, work, bytes, sizeof bytes, &n)) abort();
    return n;
}

static int with(size_t at, uint32_t value)
{
    size_t n = good();
    pal_interior_head got;
    pal_put_u32(bytes + at, value);
    return pal_interior_get(bytes, n, N, work, &got, move, level);
}

static uint32_t bits(float v)
{
    uint32_t u;
    memcpy(&u, &v, sizeof u);
    return u;
}

static void damaged_messages_are_refused(void)
{
    pal_interior_head got;
    const size_t n = good();
    for (size_t cut = 0; cut < n; cut += cut < 60 ? 1 : 97)
        CHECK(pal_interior_get(bytes, cut, N, work, &got, move, level) != 0);
    CHECK_INT(pal_interior_get(bytes, n, N - 1, work, &got, move, level), PAL_REFUSAL_COUNT);
    CHECK_INT(with(12, 0), PAL_REFUSAL_RANGE);
    CHECK_INT(with(12, PAL_WIRE_FIELD_COUNT), PAL_REFUSAL_RANGE);
    CHECK_INT(with(20, 1u << 21), PAL_REFUSAL_RANGE);
    CHECK_INT(with(24, bits(NAN)), PAL_REFUSAL_NAN);
    CHECK_INT(with(28, bits(-1)), PAL_REFUSAL_RANGE);
    CHECK_INT(with(32, bits(0)), PAL_REFUSAL_RANGE);
    CHECK_INT(with(32, bits(-1)), PAL_REFUSAL_RANGE);
    CHECK_INT(with(32, bits(INFINITY)), PAL_REFUSAL_NAN);
    CHECK_INT(with(32, bits(1e31f)), PAL_REFUSAL_RANGE);
    CHECK_INT(with(36, 0), PAL_REFUSAL_COUNT);
    CHECK_INT(with(36, PAL_WIRE_VERTEX_MAX + 1), PAL_REFUSAL_COUNT);
    CHECK_INT(with(40, 1), PAL_REFUSAL_LONG);
    CHECK_INT(with(40, 0xFFFFFFFFu), PAL_REFUSAL_SHORT);
    CHECK_INT(with(44, 0xFFFFFFFFu), PAL_REFUSAL_LZ4);
}

static void what_no_reader_takes_is_not_written(void)
{
    size_t n = 77;
    fill(0.03, false);
    pal_interior_head h = head_of(0);
    CHECK_INT(pal_interior_put(node, &h, work, bytes, sizeof bytes, &n), PAL_REFUSAL_COUNT);
    h = head_of(N), h.field = PAL_WIRE_FIELD_NONE;
    CHECK_INT(pal_interior_put(node, &h, work, bytes, sizeof bytes, &n), PAL_REFUSAL_RANGE);
    h = head_of(N), h.q_m = 0;
    CHECK_INT(pal_interior_put(node, &h, work, bytes, sizeof bytes, &n), PAL_REFUSAL_RANGE);
    h = head_of(N);
    CHECK_INT(pal_interior_put(node, &h, work, bytes, pal_interior_bound(N) - 1, &n), PAL_REFUSAL_SPACE);
    node[4 * 17 + 2] = NAN;
    CHECK_INT(pal_interior_put(node, &h, work, bytes, sizeof bytes, &n), PAL_REFUSAL_NAN);
    CHECK_INT(n, 77);
}

int main(void)
{
    RUN(displacements_and_values_come_back_within_half_a_step);
    RUN(a_smooth_motion_takes_few_bytes);
    RUN(damaged_messages_are_refused);
    RUN(what_no_reader_takes_is_not_written);
    return check_report();
}
