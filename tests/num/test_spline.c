/* Shape functions of subdivided solids: partition of unity, polynomials reproduced, gradients, quadrature. */
#include "server/num/spline.h"
#include "tests/check.h"

#include <math.h>

static const int kinds[3] = {64, 8, 5};

static void values_sum_to_one_and_gradients_to_zero(void)
{
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 27; i++) {
            double x[3] = {0.5 * (i % 3), 0.5 * (i / 3 % 3), 0.5 * (i / 9)}, n[64], g[64][3];
            double sum = 0, slope[3] = {0, 0, 0};
            pal_cell_shape(kinds[k], x, n, g);
            for (int m = 0; m < kinds[k]; m++) {
                sum += n[m];
                for (int a = 0; a < 3; a++) slope[a] += g[m][a];
            }
            CHECK_NEAR(sum, 1, 1e-14);
            for (int a = 0; a < 3; a++) CHECK_NEAR(slope[a], 0, 1e-14);
        }
}

static void gradients_are_differences_of_values(void)
{
    const double at[3] = {0.31, 0.62, 0.17}, e = 1e-5;
    for (int k = 0; k < 3; k++) {
        double g[64][3];
        pal_cell_shape(kinds[k], at, NULL, g);
        for (int a = 0; a < 3; a++) {
            double x[3] = {at[0], at[1], at[2]}, high[64], low[64];
            x[a] = at[a] + e;
            pal_cell_shape(kinds[k], x, high, NULL);
            x[a] = at[a] - e;
            pal_cell_shape(kinds[k], x, low, NULL);
            for (int m = 0; m < kinds[k]; m++) CHECK_NEAR(g[m][a], (high[m] - low[m]) / (2 * e), 1e-9);
        }
    }
}

/* control points on the integer lattice give x back: B-splines reproduce linear functions */
static void the_lattice_gives_the_place_itself(void)
{
    const double at[3] = {0.2, 0.9, 0.45};
    double n[64], sum[3] = {0, 0, 0};
    pal_cell_shape(64, at, n, NULL);
    for (int m = 0; m < 64; m++) {
        const int own[3] = {m >> 4, m >> 2 & 3, m & 3};
        for (int a = 0; a < 3; a++) sum[a] += n[m] * (own[a] - 1);
    }
    for (int a = 0; a < 3; a++) CHECK_NEAR(sum[a], at[a], 1e-14);
}

/* x^7 y^6 z over the unit cube is 1/8 1/7 1/2; degree 8 is beyond it */
static void quadrature_is_exact_to_degree_seven(void)
{
    double sum = 0, ones = 0, beyond = 0;
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double x[3], w = pal_cell_gauss_point(p, x);
        ones += w;
        sum += w * pow(x[0], 7) * pow(x[1], 6) * x[2];
        beyond += w * pow(x[0], 8);
    }
    CHECK_NEAR(ones, 1, 1e-15);
    CHECK_NEAR(sum, 1.0 / 8 / 7 / 2, 1e-16);
    CHECK(fabs(beyond - 1.0 / 9) > 1e-7);
}

int main(void)
{
    RUN(values_sum_to_one_and_gradients_to_zero);
    RUN(gradients_are_differences_of_values);
    RUN(the_lattice_gives_the_place_itself);
    RUN(quadrature_is_exact_to_degree_seven);
    return check_report();
}
