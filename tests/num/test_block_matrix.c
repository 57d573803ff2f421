/* Block matrices: the pattern of cliques, look-up, products. */
#include "server/num/block_matrix.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

static double draw(void)
{
    static uint64_t state = 0x9e3779b97f4a7c15u;
    return random_signed(&state);
}

static int draw_int(int n)
{
    return (int)((draw() + 1) / 2 * n) % n;
}

enum { N = 40, N_PAIR = 30, N_FOUR = 12 };

/* two lists, pairs and quadruples with a node named twice, over the first N - 1 nodes: the last touches nothing */
static void draw_cliques(int32_t *pair, int32_t *four)
{
    for (int i = 0; i < 2 * N_PAIR; i++) pair[i] = draw_int(N - 1);
    for (int i = 0; i < 4 * N_FOUR; i++) four[i] = draw_int(N - 1);
    four[3] = four[0];
}

static void has_every_pair_of_the_cliques_and_no_other(void)
{
    int32_t pair[2 * N_PAIR], four[4 * N_FOUR];
    draw_cliques(pair, four);
    bool in[N][N] = {{false}};
    for (int i = 0; i < N; i++) in[i][i] = true;
    for (int e = 0; e < N_PAIR; e++)
        for (int a = 0; a < 4; a++) in[pair[2 * e + a / 2]][pair[2 * e + a % 2]] = true;
    for (int e = 0; e < N_FOUR; e++)
        for (int a = 0; a < 16; a++) in[four[4 * e + a / 4]][four[4 * e + a % 4]] = true;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_block_matrix a;
    pal_cliques list[2] = {{N_PAIR, 2, pair}, {N_FOUR, 4, four}};
    CHECK_INT(pal_block_matrix_make(N, list, 2, arena, &a), PAL_ERR_OK);
    int wanted = 0, wrong = 0, unordered = 0;
    for (int j = 0; j < N; j++) {
        CHECK_INT(a.row[a.start[j]], j);
        for (int k = a.start[j] + 1; k < a.start[j + 1]; k++) unordered += a.row[k] <= a.row[k - 1];
        for (int i = j; i < N; i++) {
            int k = pal_block_matrix_find(&a, i, j);
            wanted += in[i][j];
            if (in[i][j] != (k >= 0)) wrong++;
            if (k >= 0 && (a.row[k] != i || k < a.start[j] || k >= a.start[j + 1])) wrong++;
        }
    }
    CHECK_INT(a.start[N], wanted);
    CHECK_INT(wrong, 0);
    CHECK_INT(unordered, 0);
    CHECK_INT(a.start[N] - a.start[N - 1], 1); /* the lone node's diagonal */
    for (int i = 0; i < 9 * a.start[N]; i++) wrong += a.value[i] != 0;
    CHECK_INT(wrong, 0);
    pal_arena_destroy(arena);
}

static void multiplies_as_the_full_symmetric_matrix(void)
{
    int32_t pair[2 * N_PAIR], four[4 * N_FOUR];
    draw_cliques(pair, four);
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_block_matrix a;
    pal_cliques list[2] = {{N_PAIR, 2, pair}, {N_FOUR, 4, four}};
    REQUIRE(pal_block_matrix_make(N, list, 2, arena, &a) == PAL_ERR_OK);
    static double full[3 * N][3 * N];
    memset(full, 0, sizeof full);
    for (int j = 0; j < N; j++)
        for (int k = a.start[j]; k < a.start[j + 1]; k++)
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) {
                    if (a.row[k] == j && c > r) continue;
                    double v = draw();
                    a.value[9 * k + 3 * r + c] = v;
                    if (a.row[k] == j) a.value[9 * k + 3 * c + r] = v;
                    full[3 * a.row[k] + r][3 * j + c] = full[3 * j + c][3 * a.row[k] + r] = v;
                }
    double x[3 * N], y[3 * N], wanted[3 * N];
    for (int i = 0; i < 3 * N; i++) x[i] = draw(), y[i] = wanted[i] = draw();
    for (int i = 0; i < 3 * N; i++)
        for (int j = 0; j < 3 * N; j++) wanted[i] += -0.7 * full[i][j] * x[j];
    pal_block_matrix_multiply(&a, -0.7, x, y);
    for (int i = 0; i < 3 * N; i++) CHECK_NEAR(y[i], wanted[i], 1e-13);
    pal_block_matrix_zero(&a);
    memcpy(wanted, y, sizeof y);
    pal_block_matrix_multiply(&a, 1, x, y);
    CHECK(!memcmp(wanted, y, sizeof y));
    pal_arena_destroy(arena);
}

static void counts_the_blocks_of_a_grid(void)
{
    enum { X = 16, Y = 12, Z = 9 };
    static int32_t node[8 * X * Y * Z];
    for (int e = 0; e < X * Y * Z; e++)
        for (int c = 0; c < 8; c++)
            node[8 * e + c] = e % X + (c & 1) + (X + 1) * (e / X % Y + (c >> 1 & 1) + (Y + 1) * (e / X / Y + (c >> 2)));
    pal_arena *arena = pal_arena_create(1 << 20, true);
    pal_block_matrix a;
    int n = (X + 1) * (Y + 1) * (Z + 1);
    REQUIRE(pal_block_matrix_make(n, &(pal_cliques){X * Y * Z, 8, node}, 1, arena, &a) == PAL_ERR_OK);
    /* neighbours along one axis: 3 of each point but 2 at the ends */
    CHECK_INT(a.start[n], ((3 * X + 1) * (3 * Y + 1) * (3 * Z + 1) + n) / 2);
    pal_arena_destroy(arena);
}

/* a star has n pairs; a walk over pairs of neighbours of the middle would have n^2 / 2 and never end */
static void does_not_blow_up_at_a_point_of_many_neighbours(void)
{
    enum { STAR = 500000 };
    int32_t *node = malloc(sizeof *node * 2 * STAR);
    pal_arena *arena = pal_arena_create(1 << 20, true);
    pal_block_matrix a;
    REQUIRE(node && arena);
    for (int i = 0; i < STAR; i++) node[2 * i] = STAR / 2, node[2 * i + 1] = i < STAR / 2 ? i : i + 1;
    REQUIRE(pal_block_matrix_make(STAR + 1, &(pal_cliques){STAR, 2, node}, 1, arena, &a) == PAL_ERR_OK);
    CHECK_INT(a.start[STAR + 1], 2 * STAR + 1);
    CHECK(pal_block_matrix_find(&a, STAR, STAR / 2) >= 0);
    CHECK_INT(pal_block_matrix_find(&a, STAR, 0), -1);
    pal_arena_destroy(arena);
    free(node);
}

static void takes_no_points_and_no_cliques(void)
{
    pal_arena *arena = pal_arena_create(1 << 12, true);
    pal_block_matrix a;
    REQUIRE(pal_block_matrix_make(0, NULL, 0, arena, &a) == PAL_ERR_OK);
    CHECK_INT(a.start[0], 0);
    pal_block_matrix_multiply(&a, 1, NULL, NULL);
    REQUIRE(pal_block_matrix_make(3, &(pal_cliques){0, 8, NULL}, 1, arena, &a) == PAL_ERR_OK);
    CHECK_INT(a.start[3], 3);
    pal_arena_destroy(arena);
}

static void says_so_when_the_arena_is_full(void)
{
    int32_t node[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    pal_arena *arena = pal_arena_create(1024, false);
    pal_block_matrix a = {.n = -7};
    CHECK_INT(pal_block_matrix_make(8, &(pal_cliques){1, 8, node}, 1, arena, &a), PAL_ERR_MEMORY);
    CHECK_INT(a.n, -7);
    pal_arena_destroy(arena);
}

int main(void)
{
    RUN(has_every_pair_of_the_cliques_and_no_other);
    RUN(multiplies_as_the_full_symmetric_matrix);
    RUN(counts_the_blocks_of_a_grid);
    RUN(does_not_blow_up_at_a_point_of_many_neighbours);
    RUN(takes_no_points_and_no_cliques);
    RUN(says_so_when_the_arena_is_full);
    return check_report();
}
