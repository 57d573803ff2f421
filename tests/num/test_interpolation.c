/* Sparse rows of points: made entry by entry, multiplied, pulled back. */
#include "server/num/interpolation.h"
#include "server/num/random.h"
#include "tests/check.h"

#include <stdlib.h>

enum { FINE = 40, MIDDLE = 17, COARSE = 9 };

/* rows of up to six random entries, given twice and out of order; dense [n_row][n_point] gets the same */
static pal_interpolation some(int32_t n_row, int32_t n_point, uint64_t seed, double *dense)
{
    pal_interpolation out = {0};
    pal_interpolation_builder b;
    uint64_t draw = 0;
    memset(dense, 0, (size_t)(n_row * n_point) * sizeof *dense);
    pal_interpolation_builder_begin(&b, n_row, n_point, INT32_MAX);
    for (int32_t i = 0; i < n_row; i++) {
        for (int k = 0; k < 6; k++) {
            int32_t point = (int32_t)(pal_random_bits(seed, draw++) % (uint64_t)n_point);
            double w = pal_random_unit(seed, draw++) - 0.3;
            dense[i * n_point + point] += w;
            pal_interpolation_builder_add(&b, point, w / 2);
            pal_interpolation_builder_add(&b, point, w / 2);
        }
        pal_interpolation_builder_end_row(&b);
    }
    if (pal_interpolation_builder_finish(&b, &out)) CHECK_FAIL("%s", "no rows");
    return out;
}

/* largest difference from a dense matrix; rows must be ascending */
static double difference(const pal_interpolation *r, const double *dense)
{
    double worst = 0;
    for (int32_t i = 0; i < r->n_row; i++) {
        int32_t k = r->start[i];
        for (int32_t p = 0; p < r->n_point; p++) {
            bool has = k < r->start[i + 1] && r->point[k] == p;
            worst = fmax(worst, fabs(dense[i * r->n_point + p] - (has ? r->weight[k] : 0)));
            k += has;
        }
        if (k != r->start[i + 1]) return 1e9;
    }
    return worst;
}

static void rows_are_the_sums_of_what_was_added(void)
{
    double dense[FINE * MIDDLE];
    pal_interpolation r = some(FINE, MIDDLE, 1, dense);
    CHECK_INT(r.n_row, FINE);
    CHECK_LE(difference(&r, dense), 1e-15);
    pal_interpolation_free(&r);
    CHECK(!r.start && !r.n_row);
}

static void what_cancels_leaves_no_entry(void)
{
    pal_interpolation r = {0};
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, 2, 5, 100);
    pal_interpolation_builder_add(&b, 3, 0.7);
    pal_interpolation_builder_add(&b, 1, 1);
    pal_interpolation_builder_add(&b, 3, -0.7);
    pal_interpolation_builder_end_row(&b);
    pal_interpolation_builder_add(&b, 3, 1);
    pal_interpolation_builder_end_row(&b);
    REQUIRE(pal_interpolation_builder_finish(&b, &r) == PAL_ERR_OK);
    CHECK_INT(r.start[1], 1);
    CHECK_INT(r.point[0], 1);
    CHECK_INT(r.start[2], 2);
    CHECK_NEAR(r.weight[1], 1, 0);
    pal_interpolation_free(&r);
}

static void products_are_those_of_matrices(void)
{
    double a[FINE * MIDDLE], b[MIDDLE * COARSE], want[FINE * COARSE] = {0};
    pal_interpolation outer = some(FINE, MIDDLE, 2, a), inner = some(MIDDLE, COARSE, 3, b), product = {0}, none = {0};
    for (int i = 0; i < FINE; i++)
        for (int k = 0; k < MIDDLE; k++)
            for (int j = 0; j < COARSE; j++) want[i * COARSE + j] += a[i * MIDDLE + k] * b[k * COARSE + j];
    REQUIRE(pal_interpolation_product(&outer, &inner, INT32_MAX, &product) == PAL_ERR_OK);
    CHECK_INT(product.n_row, FINE);
    CHECK_INT(product.n_point, COARSE);
    CHECK_LE(difference(&product, want), 1e-14);
    int32_t n = product.start[FINE];
    CHECK_INT(pal_interpolation_product(&outer, &inner, n / 2, &none), PAL_ERR_BUDGET);
    CHECK(!none.start && !none.point);
    pal_interpolation same = {0}, one = {0};
    REQUIRE(pal_interpolation_identity(MIDDLE, &one) == PAL_ERR_OK);
    CHECK(pal_interpolation_product(&outer, &one, INT32_MAX, &same) == PAL_ERR_OK);
    CHECK_LE(difference(&same, a), 1e-15);
    pal_interpolation_free(&outer);
    pal_interpolation_free(&inner);
    pal_interpolation_free(&product);
    pal_interpolation_free(&one);
    pal_interpolation_free(&same);
}

/* f . (A p) = (A' f) . p, and pulling adds to what is there */
static void forces_are_pulled_back_by_the_transpose(void)
{
    double dense[FINE * MIDDLE], p[3 * MIDDLE], d[3 * FINE], f[3 * FINE], g[3 * MIDDLE], left = 0, right = 0;
    pal_interpolation r = some(FINE, MIDDLE, 4, dense);
    for (int i = 0; i < 3 * MIDDLE; i++) p[i] = pal_random_unit(5, (uint64_t)i) - 0.5, g[i] = 2;
    for (int i = 0; i < 3 * FINE; i++) f[i] = pal_random_unit(6, (uint64_t)i) - 0.5;
    pal_interpolation_apply(&r, p, d);
    pal_interpolation_apply_transpose(&r, f, g);
    for (int i = 0; i < 3 * FINE; i++) left += f[i] * d[i];
    for (int i = 0; i < 3 * MIDDLE; i++) right += (g[i] - 2) * p[i];
    CHECK_NEAR(left, right, 1e-13);
    double want = 0;
    for (int k = 0; k < MIDDLE; k++) want += dense[7 * MIDDLE + k] * p[3 * k + 1];
    CHECK_NEAR(d[3 * 7 + 1], want, 1e-14);
    CHECK(fabs(left) > 1e-3);
    pal_interpolation_free(&r);
}

int main(void)
{
    RUN(rows_are_the_sums_of_what_was_added);
    RUN(what_cancels_leaves_no_entry);
    RUN(products_are_those_of_matrices);
    RUN(forces_are_pulled_back_by_the_transpose);
    return check_report();
}
