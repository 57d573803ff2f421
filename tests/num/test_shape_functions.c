/* Shape functions, Gauss points and the stiffness of a cube. */
#include "server/num/shape_functions.h"
#include "tests/check.h"
#include "tests/fixtures/hex_stiffness.h"
#include "tests/fixtures/random.h"

#include <stdint.h>

static double draw(void)
{
    static uint64_t state = 88172645463325252u;
    return random_signed(&state);
}

static const double tet_node[10][4] = {{1, 0, 0, 0},   {0, 1, 0, 0},   {0, 0, 1, 0},   {0, 0, 0, 1},   {.5, .5, 0, 0},
                                       {0, .5, .5, 0}, {.5, 0, .5, 0}, {.5, 0, 0, .5}, {0, .5, 0, .5}, {0, 0, .5, .5}};

static void is_one_at_its_own_corner_and_zero_at_others(void)
{
    double n[10];
    for (int a = 0; a < 8; a++) {
        pal_hex_shape((double[3]){a & 1 ? 1 : -1, a & 2 ? 1 : -1, a & 4 ? 1 : -1}, n, NULL);
        for (int b = 0; b < 8; b++) CHECK_NEAR(n[b], a == b, 1e-15);
    }
    for (int a = 0; a < 10; a++) {
        pal_tet10_shape(tet_node[a], n, NULL);
        for (int b = 0; b < 10; b++) CHECK_NEAR(n[b], a == b, 1e-15);
    }
    for (int e = 0; e < 6; e++)
        for (int c = 0; c < 4; c++)
            CHECK_NEAR(tet_node[4 + e][c], c == pal_tet10_edge[e][0] || c == pal_tet10_edge[e][1] ? .5 : 0, 0);
}

static void sums_to_one_with_gradients_of_finite_differences(void)
{
    const double step = 1e-6;
    for (int t = 0; t < 50; t++) {
        double n[10], g[10][3], up[10], down[10], sum = 0, l[4], x[3] = {draw(), draw(), draw()};
        pal_hex_shape(x, n, g);
        for (int c = 0; c < 8; c++) sum += n[c];
        CHECK_NEAR(sum, 1, 1e-15);
        for (int k = 0; k < 3; k++) {
            double y[3] = {x[0], x[1], x[2]}, zero = 0;
            y[k] += step, pal_hex_shape(y, up, NULL);
            y[k] -= 2 * step, pal_hex_shape(y, down, NULL);
            for (int c = 0; c < 8; c++) {
                CHECK_NEAR(g[c][k], (up[c] - down[c]) / (2 * step), 1e-9);
                zero += g[c][k];
            }
            CHECK_NEAR(zero, 0, 1e-15);
        }
        for (int k = 0; k < 3; k++) l[k + 1] = (draw() + 1) / 6;
        l[0] = 1 - l[1] - l[2] - l[3], sum = 0;
        pal_tet10_shape(l, n, g);
        for (int c = 0; c < 10; c++) sum += n[c];
        CHECK_NEAR(sum, 1, 1e-15);
        for (int k = 0; k < 3; k++) {
            double m[4] = {l[0] - step, l[1], l[2], l[3]}, zero = 0;
            m[k + 1] += step, pal_tet10_shape(m, up, NULL);
            m[k + 1] -= 2 * step, m[0] += 2 * step, pal_tet10_shape(m, down, NULL);
            for (int c = 0; c < 10; c++) {
                CHECK_NEAR(g[c][k], (up[c] - down[c]) / (2 * step), 1e-8);
                zero += g[c][k];
            }
            CHECK_NEAR(zero, 0, 1e-14);
        }
    }
}

static void carries_quadratic_fields_in_ten_nodes(void)
{
    for (int t = 0; t < 20; t++) {
        double q[4][4], l[4], n[10], sum = 0, wanted = 0;
        for (int i = 0; i < 16; i++) q[i / 4][i % 4] = draw();
        for (int k = 0; k < 3; k++) l[k + 1] = (draw() + 1) / 6;
        l[0] = 1 - l[1] - l[2] - l[3];
        pal_tet10_shape(l, n, NULL);
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++) {
                wanted += q[i][j] * l[i] * l[j];
                for (int a = 0; a < 10; a++) sum += n[a] * q[i][j] * tet_node[a][i] * tet_node[a][j];
            }
        CHECK_NEAR(sum, wanted, 1e-14);
    }
}

static double factorial(int n)
{
    return n < 2 ? 1 : n * factorial(n - 1);
}

static double power(double a, int n)
{
    return n == 0 ? 1 : a * power(a, n - 1);
}

static void integrates_to_the_stated_degree(void)
{
    /* means over the simplex: n! a! b! c! d! / (n + a + b + c + d)! */
    for (int a = 0; a <= 3; a++)
        for (int b = 0; b <= 3; b++)
            for (int c = 0; c <= 3; c++) {
                double sum = 0;
                for (int p = 0; p < 8; p++)
                    sum +=
                        power(pal_hex_gauss[p][0], a) * power(pal_hex_gauss[p][1], b) * power(pal_hex_gauss[p][2], c);
                CHECK_NEAR(sum, (a % 2 ? 0 : 2.0 / (a + 1)) * (b % 2 ? 0 : 2.0 / (b + 1)) * (c % 2 ? 0 : 2.0 / (c + 1)),
                           1e-14);
            }
    for (int a = 0; a <= 2; a++)
        for (int b = 0; a + b <= 2; b++)
            for (int c = 0; a + b + c <= 2; c++) {
                double sum = 0;
                for (int p = 0; p < 4; p++)
                    sum += power(pal_tet_gauss[p][1], a) * power(pal_tet_gauss[p][2], b) *
                           power(pal_tet_gauss[p][3], c) / 4;
                CHECK_NEAR(sum, 6 * factorial(a) * factorial(b) * factorial(c) / factorial(3 + a + b + c), 1e-15);
            }
    for (int a = 0; a <= 4; a++)
        for (int b = 0; a + b <= 4; b++)
            for (int c = 0; a + b + c <= 4; c++) {
                double sum = 0;
                for (int p = 0; p < 6; p++) {
                    const double *l = pal_tri_gauss[p];
                    sum += l[3] * power(l[0], a) * power(l[1], b) * power(l[2], c);
                }
                CHECK_NEAR(sum, 2 * factorial(a) * factorial(b) * factorial(c) / factorial(2 + a + b + c), 1e-15);
            }
    for (int p = 0; p < 4; p++) {
        const double *l = pal_tet_gauss[p];
        CHECK_NEAR(l[0] + l[1] + l[2] + l[3], 1, 1e-15);
    }
}

/* displacements of the corners of the unit cube under u = G x + t */
static void affine(const double g[9], const double t[3], double u[24])
{
    for (int c = 0; c < 8; c++)
        for (int i = 0; i < 3; i++)
            u[3 * c + i] = g[3 * i] * (c & 1) + g[3 * i + 1] * (c >> 1 & 1) + g[3 * i + 2] * (c >> 2) + t[i];
}

static double energy(const double *k, const double *u)
{
    double sum = 0;
    for (int i = 0; i < 24; i++)
        for (int j = 0; j < 24; j++) sum += 0.5 * u[i] * k[24 * i + j] * u[j];
    return sum;
}

static void has_the_analytic_energy_under_uniform_strain(void)
{
    static double shear[576], volume[576];
    for (int bbar = 0; bbar < 2; bbar++) {
        hex_stiffness(bbar, shear, volume);
        for (int t = 0; t < 20; t++) {
            double g[9], u[24], shift[3] = {draw(), draw(), draw()}, ee = 0;
            for (int i = 0; i < 9; i++) g[i] = draw();
            affine(g, shift, u);
            double tr = g[0] + g[4] + g[8];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    double e = 0.5 * (g[3 * i + j] + g[3 * j + i]) - (bbar && i == j ? tr / 3 : 0);
                    ee += e * e;
                }
            CHECK_NEAR(energy(shear, u), ee, 1e-14);
            CHECK_NEAR(energy(volume, u), tr * tr / 2, 1e-14);
        }
    }
}

static void gives_no_force_under_rigid_motion_and_is_symmetric(void)
{
    static double part[2][576];
    for (int bbar = 0; bbar < 2; bbar++) {
        hex_stiffness(bbar, part[0], part[1]);
        for (int m = 0; m < 2; m++)
            for (int t = 0; t < 6; t++) {
                double u[24], g[9] = {0}, shift[3] = {0}, max = 0;
                if (t < 3) {
                    shift[t] = 1;
                } else {
                    int a = t % 3, b = (t + 1) % 3;
                    g[3 * a + b] = 1, g[3 * b + a] = -1;
                }
                affine(g, shift, u);
                for (int i = 0; i < 24; i++) {
                    double f = 0;
                    for (int j = 0; j < 24; j++) f += part[m][24 * i + j] * u[j];
                    max = fmax(max, fabs(f));
                }
                CHECK_LE(max, 1e-15);
            }
        double skew = 0;
        for (int i = 0; i < 576; i++)
            for (int m = 0; m < 2; m++) skew = fmax(skew, fabs(part[m][i] - part[m][i % 24 * 24 + i / 24]));
        CHECK_LE(skew, 1e-16);
    }
}

/* eigenvalues of the symmetric k by cyclic Jacobi */
static void eigenvalues(double *k, double w[24])
{
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < 24; p++)
            for (int q = p + 1; q < 24; q++) {
                double g = k[24 * p + q];
                if (fabs(g) < 1e-18) continue;
                double d = (k[25 * q] - k[25 * p]) / (2 * g), t = (d < 0 ? -1 : 1) / (fabs(d) + sqrt(d * d + 1));
                double c = 1 / sqrt(t * t + 1), s = c * t;
                for (int i = 0; i < 24; i++) {
                    double a = k[24 * i + p], b = k[24 * i + q];
                    k[24 * i + p] = c * a - s * b, k[24 * i + q] = s * a + c * b;
                }
                for (int i = 0; i < 24; i++) {
                    double a = k[24 * p + i], b = k[24 * q + i];
                    k[24 * p + i] = c * a - s * b, k[24 * q + i] = s * a + c * b;
                }
            }
    for (int i = 0; i < 24; i++) w[i] = k[25 * i];
}

static void has_six_zero_modes_and_no_negative_one(void)
{
    static double shear[576], volume[576], k[576];
    for (int bbar = 0; bbar < 2; bbar++) {
        hex_stiffness(bbar, shear, volume);
        double w[24];
        int zero = 0, negative = 0;
        for (int i = 0; i < 576; i++) k[i] = 0.8 * shear[i] + 1.7 * volume[i];
        eigenvalues(k, w);
        for (int i = 0; i < 24; i++) zero += fabs(w[i]) < 1e-14, negative += w[i] < -1e-14;
        CHECK_INT(zero, 6);
        CHECK_INT(negative, 0);
    }
}

/* bending keeps the volume of the whole cube: with B-bar it costs no volume energy, so an almost incompressible cube
 * does not lock; with full integration it does */
static void does_not_lock_in_bending_with_mean_dilatation(void)
{
    static double shear[576], volume[576];
    double u[24] = {0};
    for (int c = 0; c < 8; c++) u[3 * c] = ((c & 1) - 0.5) * ((c >> 1 & 1) - 0.5);
    hex_stiffness(1, shear, volume);
    CHECK_NEAR(energy(volume, u), 0, 1e-17);
    CHECK(energy(shear, u) > 0.01);
    hex_stiffness(0, shear, volume);
    /* div u = y - 1/2: half the mean of its square, 1 / 24 */
    CHECK_NEAR(energy(volume, u), 1.0 / 24, 1e-15);
}

int main(void)
{
    RUN(is_one_at_its_own_corner_and_zero_at_others);
    RUN(sums_to_one_with_gradients_of_finite_differences);
    RUN(carries_quadratic_fields_in_ten_nodes);
    RUN(integrates_to_the_stated_degree);
    RUN(has_the_analytic_energy_under_uniform_strain);
    RUN(gives_no_force_under_rigid_motion_and_is_symmetric);
    RUN(has_six_zero_modes_and_no_negative_one);
    RUN(does_not_lock_in_bending_with_mean_dilatation);
    return check_report();
}
