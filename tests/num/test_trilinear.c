/* Trilinear interpolation: weights by hand, fields it reproduces, the border, the sparse matrix and its transpose, the
 * nodes dropped of the paper's bar. */
#include "server/num/trilinear.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

static uint64_t seed = 5;

static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

/* paper B section 3.5: the products of v_rel and 1 - v_rel, here (0.25, 0.5, 0.75) of one cell */
static void weights_are_those_of_the_paper(void)
{
    const pal_grid grid = {{3, 3, 3}, {0, 0, 0}, {2, 4, 8}};
    const double x[3] = {1.25, 1, 7}, part[3][2] = {{0.75, 0.25}, {0.5, 0.5}, {0.25, 0.75}};
    int64_t node[8];
    double weight[8];
    pal_trilinear(&grid, x, node, weight);
    for (int k = 0; k < 8; k++) {
        int i = k & 1, j = k >> 1 & 1, l = k >> 2;
        CHECK_INT(node[k], (1 + i) + 3 * (0 + j) + 9 * (1 + l));
        CHECK_NEAR(weight[k], part[0][i] * part[1][j] * part[2][l], 1e-15);
    }
}

/* 1 + x - 2y + 3z + xy + yz - zx + 5xyz is trilinear in every cell of any grid */
static double field(const double x[3])
{
    return 1 + x[0] - 2 * x[1] + 3 * x[2] + x[0] * x[1] + x[1] * x[2] - x[2] * x[0] + 5 * x[0] * x[1] * x[2];
}

static void trilinear_fields_are_reproduced_inside_and_end_at_the_border(void)
{
    const pal_grid grid = {{4, 3, 5}, {-1, 0.5, -2}, {2, 1, 0.25}};
    double value[60];
    for (int i = 0; i < 60; i++) {
        const int at[3] = {i % 4, i / 4 % 3, i / 12};
        double x[3];
        for (int c = 0; c < 3; c++) x[c] = grid.low[c] + (grid.high[c] - grid.low[c]) * at[c] / (grid.n[c] - 1);
        value[i] = field(x);
        CHECK_NEAR(pal_trilinear_at(&grid, value, x), value[i], 1e-13);
    }
    for (int turn = 0; turn < 500; turn++) {
        double x[3], inside[3], weight[8], sum = 0;
        int64_t node[8];
        for (int c = 0; c < 3; c++) {
            x[c] = 3 * uniform();
            inside[c] = fmax(grid.low[c], fmin(grid.high[c], x[c]));
        }
        CHECK_NEAR(pal_trilinear_at(&grid, value, x), field(inside), 1e-13);
        pal_trilinear(&grid, x, node, weight);
        for (int k = 0; k < 8; k++) {
            sum += weight[k];
            CHECK(weight[k] >= 0 && node[k] >= 0 && node[k] < 60);
        }
        CHECK_NEAR(sum, 1, 1e-15);
    }
}

/* erratum B12: on the last plane of nodes floor and ceil are the same plane, and the paper divides by zero */
static void nodes_on_a_plane_of_the_grid_have_one_cell(void)
{
    const pal_grid grid = {{3, 2, 2}, {0, 0, 0}, {1, 1, 1}};
    for (int i = 0; i < 12; i++) {
        double value[12] = {0};
        const double x[3] = {0.5 * (i % 3), i / 3 % 2, i / 6};
        value[i] = 7;
        CHECK_NEAR(pal_trilinear_at(&grid, value, x), 7, 0);
    }
}

static void one_node_along_an_axis_is_constant_along_it(void)
{
    const pal_grid grid = {{1, 2, 1}, {5, 0, 5}, {5, 1, 5}};
    const double value[2] = {10, 20};
    const double far[][3] = {{-1e300, 0.25, 1e300}, {0, 0.25, -7}, {NAN, 0.25, INFINITY}};
    int64_t node[8];
    double weight[8];
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(pal_trilinear_at(&grid, value, far[i]), 12.5, 0);
        pal_trilinear(&grid, far[i], node, weight);
        for (int k = 0; k < 8; k++) {
            CHECK(node[k] == 0 || node[k] == 1);
            if (k & 1 || k & 4) CHECK_NEAR(weight[k], 0, 0);
        }
    }
    /* what is no position is at the border */
    const double nowhere[3] = {NAN, NAN, NAN};
    CHECK_NEAR(pal_trilinear_at(&grid, value, nowhere), 10, 0);
}

/* to = W value */
static void apply(const pal_grid_weights *w, const double *value, double *to)
{
    for (int i = 0; i < w->n_point; i++) {
        to[i] = 0;
        for (int k = w->start[i]; k < w->start[i + 1]; k++) to[i] += w->weight[k] * value[w->node[k]];
    }
}

static void matrix_is_the_interpolation_of_its_points(void)
{
    enum { N = 300 };
    const pal_grid grid = {{5, 5, 3}, {-1, -1, -1}, {1, 1, 1}};
    double x[3 * N], value[75], used[75], at[N], back[75] = {0}, random[N], left = 0, right = 0;
    pal_grid_weights w;
    for (int i = 0; i < 3 * N; i++) x[i] = 1.2 * uniform();
    for (int i = 0; i < 75; i++) value[i] = uniform();
    for (int i = 0; i < N; i++) random[i] = uniform();
    REQUIRE(pal_grid_weights_make(&grid, x, N, &w) == PAL_ERR_OK);
    CHECK_INT(w.n_point, N);
    CHECK_LE(w.start[N], 8 * N);
    for (int k = 0; k < w.n_used; k++) {
        used[k] = value[w.used[k]];
        CHECK(k == 0 || w.used[k] > w.used[k - 1]);
    }
    apply(&w, used, at);
    for (int i = 0; i < N; i++) CHECK_NEAR(at[i], pal_trilinear_at(&grid, value, x + 3 * i), 1e-15);
    /* (W a).b = a.(W' b), and W' adds */
    pal_grid_weights_apply_transpose(&w, random, back);
    for (int i = 0; i < N; i++) left += at[i] * random[i];
    for (int k = 0; k < w.n_used; k++) right += back[k] * used[k];
    CHECK_NEAR(left, right, 1e-12);
    double once = back[0];
    pal_grid_weights_apply_transpose(&w, random, back);
    CHECK_NEAR(back[0], 2 * once, 1e-15);
    pal_grid_weights_free(&w);
    CHECK(w.used == NULL && w.n_point == 0);
    pal_grid_weights_free(&w);
}

/* points in the lower half along x of a 9x3x3 grid touch its first five planes only: 45 of 81 nodes, and those exactly
 * on a plane touch no node beyond it (the paper states 54 for such a grid: erratum B13) */
static void nodes_that_touch_no_point_are_dropped(void)
{
    const pal_grid grid = {{9, 3, 3}, {0, 0, 0}, {8, 2, 2}};
    double x[3 * 5 * 5 * 5];
    int n = 0;
    pal_grid_weights w;
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++)
            for (int k = 0; k < 5; k++, n++) x[3 * n] = i, x[3 * n + 1] = 0.5 * j, x[3 * n + 2] = 0.5 * k;
    REQUIRE(pal_grid_weights_make(&grid, x, n, &w) == PAL_ERR_OK);
    CHECK_INT(w.n_used, 45);
    for (int k = 0; k < w.n_used; k++) {
        CHECK_INT(w.used[k] % 9, k % 5);
        CHECK_INT(w.used[k] / 9, k / 5);
    }
    for (int k = 0; k < w.start[n]; k++) CHECK(w.weight[k] > 0 && w.node[k] >= 0 && w.node[k] < w.n_used);
    pal_grid_weights_free(&w);
    REQUIRE(pal_grid_weights_make(&grid, x, 0, &w) == PAL_ERR_OK);
    CHECK_INT(w.n_used, 0);
    CHECK_INT(w.start[0], 0);
    pal_grid_weights_free(&w);
}

int main(void)
{
    RUN(weights_are_those_of_the_paper);
    RUN(trilinear_fields_are_reproduced_inside_and_end_at_the_border);
    RUN(nodes_on_a_plane_of_the_grid_have_one_cell);
    RUN(one_node_along_an_axis_is_constant_along_it);
    RUN(matrix_is_the_interpolation_of_its_points);
    RUN(nodes_that_touch_no_point_are_dropped);
    return check_report();
}
