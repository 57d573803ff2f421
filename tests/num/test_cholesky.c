/* Sparse Cholesky factors: against a dense solve, with held points, of every scale, refused, refreshed beside. */
#include "server/num/cholesky.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/incomplete_cholesky.h"
#include "server/num/shape_functions.h"
#include "tests/check.h"
#include "tests/fixtures/count_threads.h"
#include "tests/fixtures/hex_stiffness.h"
#include "tests/fixtures/random.h"

#include <SuiteSparse_config.h>
#include <float.h>
#include <signal.h>

/* requests for memory of the room (wrapped by the linker) and of CHOLMOD (by its own hook) are counted; the one with
 * number refuse is not met */
static long requests, refuse;

static bool refused(void)
{
    return ++requests == refuse;
}

void *__real_malloc(size_t n);
void *__real_calloc(size_t n, size_t m);
void *__real_aligned_alloc(size_t a, size_t n);
void *__wrap_malloc(size_t n);
void *__wrap_calloc(size_t n, size_t m);
void *__wrap_aligned_alloc(size_t a, size_t n);

void *__wrap_malloc(size_t n)
{
    return refused() ? NULL : __real_malloc(n);
}
void *__wrap_calloc(size_t n, size_t m)
{
    return refused() ? NULL : __real_calloc(n, m);
}
void *__wrap_aligned_alloc(size_t a, size_t n)
{
    return refused() ? NULL : __real_aligned_alloc(a, n);
}

static double draw(void)
{
    static uint64_t state = 88172645463325252u;
    return random_signed(&state);
}

/* a body of voxels, nx * ny * nz of them, its stiffness and inertia */
typedef struct grid {
    int n, n_hex;
    int32_t *node;
    uint8_t *fixed; /* the end x = 0 */
    pal_arena *arena;
    pal_block_matrix a;
} grid;

static grid make_grid(int nx, int ny, int nz)
{
    grid g = {.n = (nx + 1) * (ny + 1) * (nz + 1), .n_hex = nx * ny * nz, .arena = pal_arena_create(1 << 16, true)};
    g.node = PAL_NEW(g.arena, int32_t, 8 * g.n_hex);
    g.fixed = PAL_NEW(g.arena, uint8_t, g.n);
    for (int i = 0; i < g.n; i++) g.fixed[i] = i % (nx + 1) == 0;
    for (int e = 0; e < g.n_hex; e++)
        for (int c = 0; c < 8; c++)
            g.node[8 * e + c] =
                e % nx + (c & 1) + (nx + 1) * (e / nx % ny + (c >> 1 & 1) + (ny + 1) * (e / nx / ny + (c >> 2)));
    if (pal_block_matrix_make(g.n, &(pal_cliques){g.n_hex, 8, g.node}, 1, g.arena, &g.a)) abort();
    return g;
}

/* a = size (K + inertia I), K for mu 1 and kappa of that Poisson's ratio, each hexahedron by its factor */
static void fill_grid(grid *g, double size, double inertia, double kappa, double (*factor)(int hex))
{
    static double shear[576], volume[576];
    hex_stiffness(1, shear, volume);
    pal_block_matrix_zero(&g->a);
    for (int e = 0; e < g->n_hex; e++) {
        double s = size * (factor ? factor(e) : 1);
        const int32_t *node = g->node + 8 * (size_t)e;
        for (int i = 0; i < 8; i++)
            for (int j = 0; j < 8; j++) {
                if (node[i] < node[j]) continue;
                double *v = g->a.value + 9 * pal_block_matrix_find(&g->a, node[i], node[j]);
                for (int r = 0; r < 9; r++) {
                    int at = (3 * i + r / 3) * 24 + 3 * j + r % 3;
                    v[r] += s * (shear[at] + kappa * volume[at]);
                }
            }
    }
    for (int i = 0; i < g->n; i++)
        for (int k = 0; k < 3; k++) g->a.value[9 * g->a.start[i] + 4 * k] += size * inertia;
}

/* |A x - b| / (|A| |x| + |b|) over points that are not held, |A| the largest diagonal entry; x = 0 at the held ones */
static double residual(const grid *g, const uint8_t *fixed, const double *x, const double *b)
{
    double *r = calloc(3 * (size_t)g->n, sizeof *r), max = 0, top = 0, rr = 0, bb = 0, xx = 0;
    for (int i = 0; i < 3 * g->n; i++) max = fmax(max, fabs(b[i]));
    for (int i = 0; i < 3 * g->n; i++) top = fmax(top, g->a.value[9 * g->a.start[i / 3] + i % 3 * 4]);
    pal_block_matrix_multiply(&g->a, 1 / max, x, r);
    bool moved = false;
    for (int i = 0; i < 3 * g->n; i++) {
        if (fixed && fixed[i / 3]) {
            moved |= x[i] != 0;
            continue;
        }
        double c = b[i] / max, d = r[i] - c, e = top / max * x[i];
        rr += d * d, bb += c * c, xx += e * e;
    }
    free(r);
    return moved ? INFINITY : sqrt(rr) / (sqrt(xx) + sqrt(bb));
}

static void draw_vector(double *b, int n, double size)
{
    for (int i = 0; i < n; i++) b[i] = size * draw();
}

/* dense Cholesky solve of the points that are not held */
static void solve_dense(const pal_block_matrix *a, const uint8_t *fixed, const double *b, double *x)
{
    int n = 3 * a->n;
    double *l = calloc((size_t)n * (size_t)n, sizeof *l);
    for (int j = 0; j < a->n; j++)
        for (int k = a->start[j]; k < a->start[j + 1]; k++)
            for (int r = 0; r < 9; r++)
                if (!fixed[j] && !fixed[a->row[k]])
                    l[(3 * a->row[k] + r / 3) * n + 3 * j + r % 3] = a->value[9 * k + r];
    for (int i = 0; i < n; i++) {
        if (fixed[i / 3]) l[i * n + i] = 1;
        for (int j = 0; j <= i; j++) {
            double sum = l[i * n + j];
            for (int k = 0; k < j; k++) sum -= l[i * n + k] * l[j * n + k];
            l[i * n + j] = i == j ? sqrt(sum) : sum / l[j * n + j];
        }
    }
    for (int i = 0; i < n; i++) {
        x[i] = fixed[i / 3] ? 0 : b[i];
        for (int j = 0; j < i; j++) x[i] -= l[i * n + j] * x[j];
        x[i] /= l[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) x[i] -= l[j * n + i] * x[j];
        x[i] /= l[i * n + i];
    }
    free(l);
}

enum { R = 50, R_PAIR = 110 };

static void agrees_with_a_dense_solve_of_random_matrices(void)
{
    for (int t = 0; t < 30; t++) {
        int32_t pair[2 * R_PAIR];
        uint8_t fixed[R];
        int n_pair = t < 5 ? 0 : 4 * t - 10, n_fixed = 0;
        for (int i = 0; i < 2 * n_pair; i++) pair[i] = (int)((draw() + 1) / 2 * R) % R;
        for (int i = 0; i < R; i++) fixed[i] = draw() > 0.7, n_fixed += fixed[i];
        pal_arena *arena = pal_arena_create(1 << 16, true);
        pal_block_matrix a;
        pal_cholesky *c;
        REQUIRE(pal_block_matrix_make(R, &(pal_cliques){n_pair, 2, pair}, 1, arena, &a) == PAL_ERR_OK);
        for (int j = 0; j < R; j++)
            for (int k = a.start[j]; k < a.start[j + 1]; k++)
                for (int r = 0; r < 3; r++)
                    for (int s = 0; s < 3; s++) {
                        if (k > a.start[j])
                            a.value[9 * k + 3 * r + s] = draw();
                        else if (s <= r)
                            a.value[9 * k + 3 * r + s] = a.value[9 * k + 3 * s + r] = r == s ? 60 : draw();
                    }
        REQUIRE(pal_cholesky_create(&a, fixed, &c) == PAL_ERR_OK);
        double b[3 * R], x[3 * R], wanted[3 * R], single = 0, both = 0;
        draw_vector(b, 3 * R, 1);
        solve_dense(&a, fixed, b, wanted);
        CHECK_INT(pal_cholesky_factor(c, &a, false), PAL_ERR_OK);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        for (int i = 0; i < 3 * R; i++) both = fmax(both, fabs(x[i] - wanted[i]));
        CHECK_LE(both, 1e-15);
        CHECK_INT(pal_cholesky_factor(c, &a, true), PAL_ERR_OK);
        CHECK_INT(pal_cholesky_solve(c, b, b), PAL_ERR_OK); /* in place */
        for (int i = 0; i < 3 * R; i++) single = fmax(single, fabs(b[i] - wanted[i]));
        CHECK_LE(single, 1e-7);
        CHECK(single > 1e-12); /* it is the single precision factor that is used */
        for (int i = 0; i < 3 * R; i++) CHECK(!fixed[i / 3] || (x[i] == 0 && b[i] == 0));
        CHECK(pal_cholesky_nonzeros(c) >= 6 * (R - n_fixed));
        pal_cholesky_destroy(c);
        pal_arena_destroy(arena);
    }
}

static double contrast(int hex)
{
    return hex / 4 % 2 ? 1e6 : 1;
}

static void leaves_a_small_residual(void)
{
    static const struct {
        int nx, ny, nz;
        double inertia, kappa;
        double (*factor)(int);
    } body[] = {{12, 4, 4, 0, 2, NULL},     {9, 9, 9, 0, 500, NULL}, {30, 2, 2, 0, 10, NULL},
                {4, 4, 20, 0, 2, contrast}, {7, 6, 5, 3, 10, NULL},  {1, 1, 1, 0, 2, NULL}};
    for (int t = 0; t < 6; t++) {
        grid g = make_grid(body[t].nx, body[t].ny, body[t].nz);
        double *b = malloc(sizeof *b * 3 * (size_t)g.n), *x = malloc(sizeof *x * 3 * (size_t)g.n);
        fill_grid(&g, 1, body[t].inertia, body[t].kappa, body[t].factor);
        pal_cholesky *c;
        REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
        draw_vector(b, 3 * g.n, 1);
        for (int single = 0; single < 2; single++) {
            REQUIRE(pal_cholesky_factor(c, &g.a, single) == PAL_ERR_OK);
            CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
            CHECK_LE(residual(&g, g.fixed, x, b), single ? 1e-6 : 1e-14);
        }
        pal_cholesky_destroy(c);
        free(b), free(x);
        pal_arena_destroy(g.arena);
    }
}

static void does_not_mind_the_units(void)
{
    static const double size[] = {1e-12, 1e12, 1e-30, 1e30, 1e-300, 1e300},
                        load[] = {1, 1e-9, 1e-20, 1e20, 1e-300, 1e2};
    grid g = make_grid(6, 3, 3);
    double *b = malloc(sizeof *b * 3 * (size_t)g.n), *x = malloc(sizeof *x * 3 * (size_t)g.n);
    pal_cholesky *c;
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    for (int t = 0; t < 12; t++) {
        fill_grid(&g, size[t / 2], 0, 5, NULL);
        CHECK_INT(pal_cholesky_factor(c, &g.a, t % 2), PAL_ERR_OK);
        draw_vector(b, 3 * g.n, load[t / 2]);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        CHECK_LE(residual(&g, g.fixed, x, b), t % 2 ? 1e-5 : 1e-12);
    }
    pal_cholesky_destroy(c);
    free(b), free(x);
    pal_arena_destroy(g.arena);
}

/* far from the load the answer falls below every normal number; the mode of the processor is put back */
static void answers_that_decay_to_nothing_are_zero(void)
{
    grid g = make_grid(120, 1, 1);
    double *b = calloc(3 * (size_t)g.n, sizeof *b), *x = malloc(sizeof *x * 3 * (size_t)g.n);
    pal_cholesky *c;
    fill_grid(&g, 1, 1e6, 1, NULL);
    REQUIRE(pal_cholesky_create(&g.a, NULL, &c) == PAL_ERR_OK);
    b[0] = 1;
    for (int single = 0; single < 2; single++) {
        REQUIRE(pal_cholesky_factor(c, &g.a, single) == PAL_ERR_OK);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        CHECK_NEAR(x[0], 1e-6, 1e-11);
        CHECK_LE(residual(&g, NULL, x, b), single ? 1e-6 : 1e-13);
        CHECK_NEAR(x[3 * g.n - 1], 0, 0);
        int subnormal = 0;
        for (int i = 0; i < 3 * g.n; i++) subnormal += x[i] != 0 && fabs(x[i]) < DBL_MIN;
        CHECK_INT(subnormal, 0);
        volatile double min = DBL_MIN, half = min / 2;
        CHECK(half > 0);
    }
    pal_cholesky_destroy(c);
    free(b), free(x);
    pal_arena_destroy(g.arena);
}

static void refuses_what_is_not_positive_and_keeps_the_old_factor(void)
{
    grid g = make_grid(5, 3, 3);
    size_t n_byte = sizeof(double) * 3 * (size_t)g.n;
    double *b = malloc(n_byte), *x = malloc(n_byte), *again = malloc(n_byte);
    pal_cholesky *c;
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    draw_vector(b, 3 * g.n, 1);
    CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_STATE);
    CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_STATE);
    CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_STATE);
    REQUIRE(pal_cholesky_factor(c, &g.a, false) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
    double *diagonal = g.a.value + 9 * g.a.start[g.n / 2 + 1]; /* of a point that is not held */
    static const double bad[] = {-1, NAN, INFINITY, -INFINITY, 0};
    for (int t = 0; t < 5; t++) {
        double old = diagonal[4];
        diagonal[4] = bad[t];
        CHECK_INT(pal_cholesky_factor(c, &g.a, t % 2), PAL_ERR_NUMERIC);
        diagonal[4] = old;
        memset(again, 0, n_byte);
        CHECK_INT(pal_cholesky_solve(c, b, again), PAL_ERR_OK);
        CHECK(!memcmp(again, x, n_byte));
    }
    /* negative everywhere, and zero */
    fill_grid(&g, -1, 0, 5, NULL);
    CHECK_INT(pal_cholesky_factor(c, &g.a, false), PAL_ERR_NUMERIC);
    pal_block_matrix_zero(&g.a);
    CHECK_INT(pal_cholesky_factor(c, &g.a, false), PAL_ERR_NUMERIC);
    b[7 * 3] = NAN; /* a point that is not held */
    memcpy(again, x, n_byte);
    CHECK_INT(pal_cholesky_solve(c, b, again), PAL_ERR_NUMERIC);
    CHECK(!memcmp(again, x, n_byte));
    pal_cholesky_destroy(c);
    free(b), free(x), free(again);
    pal_arena_destroy(g.arena);
}

/* a free body's stiffness has six zero pivots, which rounding may make positive */
static void refuses_the_stiffness_of_a_body_without_supports(void)
{
    int shape[][3] = {{1, 1, 1}, {4, 4, 4}, {12, 3, 3}, {7, 6, 5}};
    for (int t = 0; t < 4; t++) {
        grid g = make_grid(shape[t][0], shape[t][1], shape[t][2]);
        pal_cholesky *c;
        fill_grid(&g, 3, 0, 5, NULL);
        REQUIRE(pal_cholesky_create(&g.a, NULL, &c) == PAL_ERR_OK);
        CHECK_INT(pal_cholesky_factor(c, &g.a, false), PAL_ERR_NUMERIC);
        fill_grid(&g, 3, 1e-6, 5, NULL);
        CHECK_INT(pal_cholesky_factor(c, &g.a, false), PAL_ERR_OK);
        pal_cholesky_destroy(c);
        pal_arena_destroy(g.arena);
    }
}

static void takes_bodies_with_every_point_held_and_with_none(void)
{
    grid g = make_grid(2, 1, 1);
    pal_cholesky *c;
    double b[36], x[36];
    fill_grid(&g, 1, 0, 5, NULL);
    memset(g.fixed, 1, (size_t)g.n);
    draw_vector(b, 36, 1), draw_vector(x, 36, 1);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_factor(c, &g.a, true), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
    for (int i = 0; i < 36; i++) CHECK(x[i] == 0);
    CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_nonzeros(c), 0);
    pal_cholesky_destroy(c);
    pal_block_matrix none = {.n = 0, .start = (int32_t[1]){0}};
    REQUIRE(pal_cholesky_create(&none, NULL, &c) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_factor(c, &none, false), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_solve(c, NULL, NULL), PAL_ERR_OK);
    pal_cholesky_destroy(c);
    pal_cholesky_destroy(NULL);
    pal_arena_destroy(g.arena);
}

/* loads on a single point skip what they cannot reach: the columns of the inverse are those of the dense solve */
static void gives_columns_of_the_inverse(void)
{
    grid g = make_grid(5, 2, 2);
    double b[162], x[162], wanted[162];
    pal_cholesky *c;
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(g.n == 54 && pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    for (int t = 0; t < 3 * g.n; t++) {
        REQUIRE(pal_cholesky_factor(c, &g.a, t % 2) == PAL_ERR_OK);
        memset(b, 0, sizeof b);
        b[t] = 1;
        solve_dense(&g.a, g.fixed, b, wanted);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        double max = 0, off = 0;
        for (int i = 0; i < 3 * g.n; i++) max = fmax(max, fabs(wanted[i])), off = fmax(off, fabs(x[i] - wanted[i]));
        CHECK_LE(off, (t % 2 ? 2e-5 : 1e-13) * max);
    }
    pal_cholesky_destroy(c);
    pal_arena_destroy(g.arena);
}

static void counts_the_same_work_every_time(void)
{
    grid g = make_grid(8, 5, 4);
    double flops = 0;
    int64_t nonzeros = 0;
    for (int t = 0; t < 3; t++) {
        pal_cholesky *c;
        fill_grid(&g, 1 + t, 0, 5, NULL);
        REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
        if (t == 0) flops = pal_cholesky_flops(c), nonzeros = pal_cholesky_nonzeros(c);
        CHECK(pal_cholesky_flops(c) == flops);
        CHECK_INT(pal_cholesky_nonzeros(c), nonzeros);
        pal_cholesky_destroy(c);
    }
    int64_t lower = 0; /* of the matrix, without held points */
    for (int j = 0; j < g.n; j++)
        for (int k = g.a.start[j]; k < g.a.start[j + 1]; k++)
            if (!g.fixed[j] && !g.fixed[g.a.row[k]]) lower += g.a.row[k] == j ? 6 : 9;
    CHECK(nonzeros >= lower && nonzeros < 10 * lower);
    CHECK(flops > (double)nonzeros);
    pal_arena_destroy(g.arena);
}

static void refreshes_beside_the_factor_in_use(void)
{
    grid g = make_grid(10, 4, 4);
    size_t n_byte = sizeof(double) * 3 * (size_t)g.n;
    double *b = malloc(n_byte), *x = malloc(n_byte), *old = malloc(n_byte), *wanted = malloc(n_byte);
    pal_cholesky *c, *other;
    draw_vector(b, 3 * g.n, 1);
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &other) == PAL_ERR_OK);
    for (int t = 0; t < 6; t++) {
        bool single = t % 3 != 0;
        fill_grid(&g, 1, t, 5, NULL);
        REQUIRE(pal_cholesky_factor(c, &g.a, single) == PAL_ERR_OK);
        CHECK_INT(pal_cholesky_solve(c, b, old), PAL_ERR_OK);
        fill_grid(&g, 2, t + 1, 7, NULL);
        REQUIRE(pal_cholesky_factor(other, &g.a, single) == PAL_ERR_OK);
        CHECK_INT(pal_cholesky_solve(other, b, wanted), PAL_ERR_OK);
        REQUIRE(pal_cholesky_refresh(c, &g.a) == PAL_ERR_OK);
        CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_STATE);
        CHECK_INT(pal_cholesky_factor(c, &g.a, single), PAL_ERR_STATE);
        pal_block_matrix_zero(&g.a); /* the values were copied */
        for (int k = 0; k < 20; k++) {
            CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
            CHECK(!memcmp(x, old, n_byte));
        }
        CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_OK);
        CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_STATE);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        CHECK(!memcmp(x, wanted, n_byte));
    }
    pal_cholesky_destroy(c);
    pal_cholesky_destroy(other);
    free(b), free(x), free(old), free(wanted);
    pal_arena_destroy(g.arena);
}

static void keeps_the_old_factor_when_a_refresh_fails(void)
{
    grid g = make_grid(6, 3, 3);
    size_t n_byte = sizeof(double) * 3 * (size_t)g.n;
    double *b = malloc(n_byte), *x = malloc(n_byte), *old = malloc(n_byte);
    pal_cholesky *c;
    draw_vector(b, 3 * g.n, 1);
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    REQUIRE(pal_cholesky_factor(c, &g.a, true) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_solve(c, b, old), PAL_ERR_OK);
    for (int t = 0; t < 3; t++) {
        fill_grid(&g, t ? -1 : NAN, 0, 5, NULL);
        CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_OK);
        CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_NUMERIC);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        CHECK(!memcmp(x, old, n_byte));
    }
    fill_grid(&g, 1, 0, 5, NULL);
    CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_OK);
    CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
    CHECK(!memcmp(x, old, n_byte));
    /* destroyed while the spare thread is at work */
    CHECK_INT(pal_cholesky_refresh(c, &g.a), PAL_ERR_OK);
    pal_cholesky_destroy(c);
    free(b), free(x), free(old);
    pal_arena_destroy(g.arena);
}

static void factors_on_the_threads_it_was_called_on(void)
{
    grid g = make_grid(12, 12, 12);
    pal_cholesky *c;
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(pal_cholesky_create(&g.a, g.fixed, &c) == PAL_ERR_OK);
    int n = count_threads();
    REQUIRE(pal_cholesky_factor(c, &g.a, false) == PAL_ERR_OK);
    CHECK_INT(count_threads(), n);
    REQUIRE(pal_cholesky_refresh(c, &g.a) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_OK);
    CHECK_INT(count_threads(), n + 1);
    pal_cholesky_destroy(c);
    pal_arena_destroy(g.arena);
}

/* the k-th request for memory fails, for every k: an error code, nothing lost (the address sanitizer looks) and the old
 * factor at work */
static void on_signal(int number)
{
    (void)number;
}

/* a handler that is called for every signal, not once, is still there when METIS has ordered the nodes */
static void leaves_signals_alone(void)
{
    grid g = make_grid(12, 12, 12);
    fill_grid(&g, 1e4, 1, 5, NULL);
    const struct sigaction mine = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
    struct sigaction before, after;
    pal_cholesky *f = NULL;
    REQUIRE(!sigaction(SIGTERM, &mine, &before));
    REQUIRE(!pal_cholesky_create(&g.a, g.fixed, &f));
    sigaction(SIGTERM, &before, &after);
    CHECK(after.sa_handler == on_signal);
    CHECK_INT(after.sa_flags & (SA_RESETHAND | SA_NODEFER), 0);
    pal_cholesky_destroy(f);
    pal_arena_destroy(g.arena);
}

static void survives_every_request_for_memory_that_fails(void)
{
    grid g = make_grid(4, 2, 2);
    double b[135], x[135], old[135];
    int n_create = 0, n_factor = 0, n_refresh = 0;
    fill_grid(&g, 1, 0, 5, NULL);
    draw_vector(b, 3 * g.n, 1);
    pal_cholesky *c = NULL;
    SuiteSparse_config.malloc_func = __wrap_malloc;
    SuiteSparse_config.calloc_func = __wrap_calloc;
    do { /* where the partitioner of graphs has no memory, another order serves */
        pal_cholesky_destroy(c);
        c = NULL;
        requests = 0, refuse = ++n_create;
        pal_err err = pal_cholesky_create(&g.a, g.fixed, &c);
        CHECK(!err || err == PAL_ERR_MEMORY);
    } while (requests >= refuse && n_create < 2000);
    refuse = 0;
    REQUIRE(c);
    bool done = false;
    for (int k = 1; !done && k < 2000; k++) {
        requests = 0, refuse = k;
        pal_err err = pal_cholesky_factor(c, &g.a, true);
        refuse = 0;
        done = !err;
        if (err) {
            n_factor++;
            CHECK_INT(err, PAL_ERR_MEMORY);
            CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_STATE);
        }
    }
    CHECK_INT(pal_cholesky_solve(c, b, old), PAL_ERR_OK);
    done = false;
    for (int k = 1; !done && k < 2000; k++) {
        requests = 0, refuse = k;
        pal_err err = pal_cholesky_refresh(c, &g.a);
        if (!err) err = pal_cholesky_adopt(c);
        refuse = 0;
        done = !err;
        n_refresh += err != 0;
        CHECK(!err || err == PAL_ERR_MEMORY);
        CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
        CHECK(!memcmp(x, old, sizeof(double) * 3 * (size_t)g.n));
    }
    CHECK(n_create > 20 && n_factor > 5 && n_refresh > 5);
    printf("  requests refused: %d to create, %d to factor, %d to refresh\n", n_create, n_factor, n_refresh);
    /* solving and adopting ask for none */
    REQUIRE(pal_cholesky_refresh(c, &g.a) == PAL_ERR_OK);
    CHECK_INT(pal_cholesky_adopt(c), PAL_ERR_OK);
    requests = 0;
    CHECK_INT(pal_cholesky_solve(c, b, x), PAL_ERR_OK);
    CHECK_INT(requests, 0);
    pal_cholesky_destroy(c);
    SuiteSparse_config.malloc_func = malloc;
    SuiteSparse_config.calloc_func = calloc;
    pal_arena_destroy(g.arena);
}

/* without its matrix' blocks left and right of the diagonal's neighbours there is no fill: the incomplete factor is one
 */
static void an_incomplete_factor_without_fill_is_whole(void)
{
    grid g = make_grid(40, 1, 1);
    fill_grid(&g, 1e9, 0.1, 5, NULL);
    /* lines of nodes along x alone */
    for (int j = 0; j < g.n; j++)
        for (int k = g.a.start[j]; k < g.a.start[j + 1]; k++)
            for (int c = 0; c < 9 && g.a.row[k] > j + 1; c++) g.a.value[9 * (size_t)k + (size_t)c] = 0;
    double *b = calloc(3 * (size_t)g.n, sizeof *b), *x = calloc(3 * (size_t)g.n, sizeof *x);
    for (int i = 0; i < 3 * g.n; i++) b[i] = draw();
    pal_incomplete_cholesky f;
    REQUIRE(!pal_incomplete_cholesky_make(&g.a, g.fixed, g.arena, &f) && !pal_incomplete_cholesky_factor(&f, &g.a));
    CHECK_NEAR(f.shift, 0, 0);
    pal_incomplete_cholesky_solve(&f, b, x);
    CHECK_LE(residual(&g, g.fixed, x, b), 1e-6);
    free(b), free(x);
    pal_arena_destroy(g.arena);
}

typedef struct gradients {
    const grid *g;
    const pal_incomplete_cholesky *f; /* NULL: the diagonal alone */
} gradients;

static void multiply(void *user, const double *p, double *out)
{
    const gradients *of = user;
    memset(out, 0, 3 * sizeof *out * (size_t)of->g->n);
    pal_block_matrix_multiply(&of->g->a, 1, p, out);
    for (int i = 0; i < 3 * of->g->n; i++) out[i] = of->g->fixed[i / 3] ? 0 : out[i];
}

static void precondition(void *user, const double *r, double *out)
{
    const gradients *of = user;
    if (of->f) {
        pal_incomplete_cholesky_solve(of->f, r, out);
        return;
    }
    for (int i = 0; i < 3 * of->g->n; i++)
        out[i] =
            of->g->fixed[i / 3] ? 0 : r[i] / of->g->a.value[9 * (size_t)of->g->a.start[i / 3] + 4 * (size_t)(i % 3)];
}

static int iterations(const grid *g, const pal_incomplete_cholesky *f, const double *b, double *x)
{
    double *room = calloc(12 * (size_t)g->n, sizeof *room), *r = room, size = 0;
    const size_t n = 3 * (size_t)g->n;
    for (size_t i = 0; i < n; i++) r[i] = g->fixed[i / 3] ? 0 : b[i], size += r[i] * r[i], x[i] = 0;
    gradients of = {g, f};
    pal_conjugate_gradient cg = {.n = (int)n,
                                 .multiply = multiply,
                                 .precondition = precondition,
                                 .user = &of,
                                 .r = r,
                                 .z = room + n,
                                 .p = room + 2 * n,
                                 .q = room + 3 * n};
    const int turns = pal_conjugate_gradient_run(&cg, x, 1e-8 * sqrt(size), 1, 5000);
    free(room);
    return turns;
}

static double every_third_is_soft(int hex)
{
    return hex % 3 ? 1 : 0.02;
}

/* bars, nearly incompressible too, and with soft voxels in them as cut ones are */
static void conjugate_gradients_gain_from_an_incomplete_factor(void)
{
    static const struct {
        double kappa;
        double (*factor)(int hex);
    } body[] = {{2, NULL}, {50, NULL}, {5, every_third_is_soft}};
    grid g = make_grid(24, 6, 6);
    double *b = calloc(3 * (size_t)g.n, sizeof *b), *x = calloc(3 * (size_t)g.n, sizeof *x);
    for (int i = 0; i < 3 * g.n; i++) b[i] = 1e-5 * draw();
    for (size_t k = 0; k < sizeof body / sizeof *body; k++) {
        pal_incomplete_cholesky f;
        fill_grid(&g, 3e4, 0, body[k].kappa, body[k].factor);
        REQUIRE(!pal_incomplete_cholesky_make(&g.a, g.fixed, g.arena, &f) && !pal_incomplete_cholesky_factor(&f, &g.a));
        const int diagonal = iterations(&g, NULL, b, x), incomplete = iterations(&g, &f, b, x);
        printf("  kappa %g%s: %d iterations, %d by the diagonal; shift %.2g\n", body[k].kappa,
               body[k].factor ? ", soft voxels" : "", incomplete, diagonal, f.shift);
        CHECK_LE(residual(&g, g.fixed, x, b), 1e-8);
        CHECK_LE(2 * incomplete, diagonal);
    }
    free(b), free(x);
    pal_arena_destroy(g.arena);
}

static void an_incomplete_factor_refuses_what_has_none(void)
{
    grid g = make_grid(3, 2, 2);
    pal_incomplete_cholesky f;
    fill_grid(&g, 1, 0, 5, NULL);
    REQUIRE(!pal_incomplete_cholesky_make(&g.a, g.fixed, g.arena, &f) && !pal_incomplete_cholesky_factor(&f, &g.a));
    const int last = g.n - 1; /* not held */
    double *v = g.a.value + 9 * (size_t)g.a.start[last], was = v[4];
    v[4] = -1;
    CHECK_INT(pal_incomplete_cholesky_factor(&f, &g.a), PAL_ERR_NUMERIC);
    v[4] = NAN;
    CHECK_INT(pal_incomplete_cholesky_factor(&f, &g.a), PAL_ERR_NUMERIC);
    v[4] = was;
    CHECK_INT(pal_incomplete_cholesky_factor(&f, &g.a), PAL_ERR_OK);
    pal_arena_destroy(g.arena);
}

int main(void)
{
    RUN(agrees_with_a_dense_solve_of_random_matrices);
    RUN(leaves_a_small_residual);
    RUN(does_not_mind_the_units);
    RUN(answers_that_decay_to_nothing_are_zero);
    RUN(refuses_what_is_not_positive_and_keeps_the_old_factor);
    RUN(refuses_the_stiffness_of_a_body_without_supports);
    RUN(takes_bodies_with_every_point_held_and_with_none);
    RUN(gives_columns_of_the_inverse);
    RUN(counts_the_same_work_every_time);
    RUN(refreshes_beside_the_factor_in_use);
    RUN(keeps_the_old_factor_when_a_refresh_fails);
    RUN(factors_on_the_threads_it_was_called_on);
    RUN(leaves_signals_alone);
    RUN(survives_every_request_for_memory_that_fails);
    RUN(an_incomplete_factor_without_fill_is_whole);
    RUN_SERIAL(conjugate_gradients_gain_from_an_incomplete_factor); /* no thread of its own */
    RUN(an_incomplete_factor_refuses_what_has_none);
    return check_report();
}
