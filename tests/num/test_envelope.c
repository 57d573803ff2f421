/* Envelope factors: answers, order, skipped points, refusals. */
#include "server/num/envelope.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

enum { SIDE = 7, N = SIDE * SIDE * SIDE, MAX = 27 * N };

/* a lattice whose neighbours, 26 of each, are coupled at random; numbered at random too, `cut` leaves out all couplings
 * across the middle */
typedef struct lattice {
    int32_t start[N + 1], point[MAX], number[N];
    double value[MAX];
} lattice;

static uint64_t seed;
static double uniform(void)
{
    return random_unit(&seed);
}

/* the same number for both ways round */
static double coupling(int a, int b)
{
    return -0.03 * (1 + sin(a * 12.9898 + b * 12.9898 + 0.001 * a * b));
}

static int ascending(const void *a, const void *b)
{
    return *(const int32_t *)a - *(const int32_t *)b;
}

static void make(lattice *l, bool cut)
{
    int32_t place[N];
    seed = 5;
    for (int i = 0; i < N; i++) l->number[i] = i;
    for (int i = N - 1; i > 0; i--) {
        int j = (int)(uniform() * (i + 1)), kept = l->number[i];
        l->number[i] = l->number[j], l->number[j] = kept;
    }
    for (int i = 0; i < N; i++) place[l->number[i]] = i;
    l->start[0] = 0;
    for (int i = 0; i < N; i++) {
        int n = l->start[i], at = place[i], x = at % SIDE, y = at / SIDE % SIDE, z = at / SIDE / SIDE;
        for (int c = 0; c < 27; c++) {
            int u = x + c % 3 - 1, v = y + c / 3 % 3 - 1, w = z + c / 9 - 1;
            if (u < 0 || v < 0 || w < 0 || u >= SIDE || v >= SIDE || w >= SIDE) continue;
            if (cut && (z <= SIDE / 2) != (w <= SIDE / 2)) continue;
            l->point[n++] = l->number[u + SIDE * (v + SIDE * w)];
        }
        l->start[i + 1] = n;
        qsort(l->point + l->start[i], (size_t)(n - l->start[i]), sizeof *l->point, ascending);
        for (int k = l->start[i]; k < n; k++) {
            int j = l->point[k];
            l->value[k] = i == j ? 2 : coupling(i < j ? i : j, i < j ? j : i);
        }
    }
}

/* |A x - b| at its largest over the points that count */
static double residual(const lattice *l, const double *x, const double *b, const uint8_t *skip)
{
    double max = 0;
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++) {
            double sum = -b[3 * i + c];
            for (int k = l->start[i]; k < l->start[i + 1]; k++) sum += l->value[k] * x[3 * l->point[k] + c];
            if (!skip || !skip[i]) max = fmax(max, fabs(sum));
        }
    return max;
}

static void it_solves_in_one_and_in_two_pieces(void)
{
    static lattice l;
    static double b[3 * N], x[3 * N];
    for (int cut = 0; cut < 2; cut++) {
        pal_envelope e;
        pal_arena *arena = pal_arena_create(1 << 16, true);
        make(&l, cut);
        REQUIRE(!pal_envelope_make(N, l.start, l.point, 1 << 20, arena, &e));
        REQUIRE(!pal_envelope_factor(&e, l.start, l.point, l.value, NULL));
        for (int i = 0; i < 3 * N; i++) b[i] = x[i] = uniform() - 0.5;
        pal_envelope_solve(&e, x, x);
        CHECK_LE(residual(&l, x, b, NULL), 1e-13);
        pal_arena_destroy(arena);
    }
}

/* layer by layer a row of the lattice reaches back 49 + 7 + 1 places; numbered at random it would be hundreds */
static void the_order_keeps_the_envelope_small(void)
{
    static lattice l;
    pal_envelope e;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    make(&l, false);
    REQUIRE(!pal_envelope_make(N, l.start, l.point, 1 << 20, arena, &e));
    CHECK_LE((double)e.start[N], 1.8 * 58 * N);
    uint8_t seen[N] = {0};
    for (int i = 0; i < N; i++) seen[e.order[i]]++;
    for (int i = 0; i < N; i++) CHECK(seen[i] == 1 && e.position[e.order[i]] == i);
    pal_arena_destroy(arena);
}

static void skipped_points_are_left_out_and_come_back(void)
{
    static lattice l;
    static double b[3 * N], x[3 * N];
    uint8_t skip[N] = {0};
    pal_envelope e;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    make(&l, false);
    REQUIRE(!pal_envelope_make(N, l.start, l.point, 1 << 20, arena, &e));
    for (int i = 0; i < N; i += 3) skip[i] = (uint8_t)(1 + i % 2);
    for (int i = 0; i < 3 * N; i++) b[i] = skip[i / 3] ? 0 : uniform() - 0.5;
    REQUIRE(!pal_envelope_factor(&e, l.start, l.point, l.value, skip));
    pal_envelope_solve(&e, b, x);
    CHECK_LE(residual(&l, x, b, skip), 1e-13);
    for (int i = 0; i < 3 * N; i++) CHECK(!skip[i / 3] || x[i] == 0);
    REQUIRE(!pal_envelope_factor(&e, l.start, l.point, l.value, NULL));
    pal_envelope_solve(&e, b, x);
    CHECK_LE(residual(&l, x, b, NULL), 1e-13);
    pal_arena_destroy(arena);
}

static void it_refuses_what_it_cannot_factor_or_hold(void)
{
    static lattice l;
    pal_envelope e;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    make(&l, false);
    const size_t used = pal_arena_used(arena);
    CHECK_INT(pal_envelope_make(N, l.start, l.point, 10000, arena, &e), PAL_ERR_BUDGET);
    CHECK(pal_arena_used(arena) == used);
    REQUIRE(!pal_envelope_make(N, l.start, l.point, 1 << 20, arena, &e));
    const int last = l.start[N] - 1;
    for (int bad = 0; bad < 3; bad++) {
        const double kept = l.value[last];
        l.value[last] = (const double[]){-1, 1e-3, NAN}[bad];
        CHECK_INT(pal_envelope_factor(&e, l.start, l.point, l.value, NULL), PAL_ERR_NUMERIC);
        l.value[last] = kept;
    }
    CHECK_INT(pal_envelope_factor(&e, l.start, l.point, l.value, NULL), 0);
    pal_arena_destroy(arena);
}

int main(void)
{
    RUN(it_solves_in_one_and_in_two_pieces);
    RUN(the_order_keeps_the_envelope_small);
    RUN(skipped_points_are_left_out_and_come_back);
    RUN(it_refuses_what_it_cannot_factor_or_hold);
    return check_report();
}
