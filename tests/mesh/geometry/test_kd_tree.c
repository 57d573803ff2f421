/* The kd-tree against looking at every point. */
#include "server/mesh/geometry/kd_tree.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

/* k nearest by looking at all, ties by index */
static int look_at_all(const double *x, int n, const double p[3], int k, int32_t *index, double *distance2)
{
    int found = 0;
    for (int i = 0; i < n; i++) {
        double d = 0;
        for (int a = 0; a < 3; a++) d += (x[3 * i + a] - p[a]) * (x[3 * i + a] - p[a]);
        int at = found;
        while (at > 0 && d < distance2[at - 1]) at--;
        if (at >= k) continue;
        if (found < k) found++;
        for (int j = found - 1; j > at; j--) index[j] = index[j - 1], distance2[j] = distance2[j - 1];
        index[at] = i, distance2[at] = d;
    }
    return found;
}

static void compare(const double *x, int n, int n_query, uint64_t *state)
{
    pal_kd_tree *tree;
    REQUIRE(!pal_kd_tree_create(x, n, &tree));
    for (int q = 0; q < n_query; q++) {
        double p[3], d2[8], want2[8];
        int32_t index[8], want[8];
        for (int k = 0; k < 3; k++) p[k] = 1.2 * random_signed(state);
        if (q & 1) memcpy(p, x + 3 * (random_below(state, (uint64_t)n)), sizeof p);
        int k = 1 + q % 8, found = pal_kd_tree_nearest(tree, p, k, index, d2);
        CHECK_INT(found, look_at_all(x, n, p, k, want, want2));
        for (int i = 0; i < found; i++) {
            CHECK_INT(index[i], want[i]);
            CHECK_NEAR(d2[i], want2[i], 0);
        }
        CHECK_INT(index[0], want[0]);
    }
    pal_kd_tree_destroy(tree);
}

static void random_points_give_the_same_as_looking_at_all(void)
{
    uint64_t state = 1;
    for (int n = 1; n < 3000; n = n * 2 + 1) {
        double *x = malloc((size_t)n * 3 * sizeof *x);
        REQUIRE(x);
        for (int i = 0; i < 3 * n; i++) x[i] = random_signed(&state);
        compare(x, n, 40, &state);
        free(x);
    }
}

static void lattice_points_with_ties_go_to_the_smaller_index(void)
{
    uint64_t state = 2;
    enum { N = 9 * 9 * 9 };
    double x[3 * N];
    for (int i = 0; i < N; i++)
        x[3 * i] = i % 9 / 4.0 - 1, x[3 * i + 1] = i / 9 % 9 / 4.0 - 1, x[3 * i + 2] = i / 81 / 4.0 - 1;
    compare(x, N, 200, &state);
}

static void equal_points_are_all_found(void)
{
    double x[300] = {0}, d2[5];
    pal_kd_tree *tree;
    int32_t index[5];
    REQUIRE(!pal_kd_tree_create(x, 100, &tree));
    CHECK_INT(pal_kd_tree_nearest(tree, x, 5, index, d2), 5);
    for (int k = 0; k < 5; k++) CHECK_INT(index[k], k);
    pal_kd_tree_destroy(tree);
}

static void fewer_points_than_asked_for(void)
{
    double x[6] = {0, 0, 0, 1, 0, 0}, d2[4];
    int32_t index[4];
    pal_kd_tree *tree;
    REQUIRE(!pal_kd_tree_create(x, 2, &tree));
    CHECK_INT(pal_kd_tree_nearest(tree, x, 4, index, d2), 2);
    CHECK_NEAR(d2[1], 1, 0);
    pal_kd_tree_destroy(tree);
    REQUIRE(!pal_kd_tree_create(x, 0, &tree));
    CHECK_INT(pal_kd_tree_nearest(tree, x, 4, index, d2), 0);
    pal_kd_tree_destroy(tree);
    pal_kd_tree_destroy(NULL);
}

int main(void)
{
    RUN(random_points_give_the_same_as_looking_at_all);
    RUN(lattice_points_with_ties_go_to_the_smaller_index);
    RUN(equal_points_are_all_found);
    RUN(fewer_points_than_asked_for);
    return check_report();
}
