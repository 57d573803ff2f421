/* Rotations of 3x3 matrices: polar turns, singular values, eigenvalues, however broken the matrix. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <stdint.h>

static double draw(void)
{
    static uint64_t state = 362436069u;
    return random_signed(&state);
}

static void draw_quat(double q[4])
{
    double n = 0;
    for (int i = 0; i < 4; i++) q[i] = draw(), n += q[i] * q[i];
    for (int i = 0; i < 4; i++) q[i] /= sqrt(n);
}

static void product(const double a[9], const double b[9], double r[9])
{
    double t[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) t[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    memcpy(r, t, sizeof t);
}

static void transpose(const double a[9], double r[9])
{
    double t[9];
    for (int i = 0; i < 9; i++) t[i] = a[i % 3 * 3 + i / 3];
    memcpy(r, t, sizeof t);
}

static double distance(const double *a, const double *b, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, fabs(a[i] - b[i]));
    return isfinite(max) ? max : INFINITY;
}

/* how far a is from a rotation */
static double off_rotation(const double a[9])
{
    double t[9], one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    transpose(a, t);
    product(a, t, t);
    return fmax(distance(t, one, 9), fabs(pal_det3(a) - 1));
}

/* f = r1 diag(s) r2', r1 and r2 drawn */
static void draw_with(const double s[3], double f[9])
{
    double q[4], r1[9], r2[9], d[9] = {s[0], 0, 0, 0, s[1], 0, 0, 0, s[2]};
    draw_quat(q);
    pal_quat_matrix(q, r1);
    draw_quat(q);
    pal_quat_matrix(q, r2);
    product(r1, d, f);
    product(f, r2, f);
}

/* U diag(s) V' */
static double svd_error(const double f[9], const double u[9], const double s[3], const double v[9])
{
    double d[9] = {s[0], 0, 0, 0, s[1], 0, 0, 0, s[2]}, t[9];
    transpose(v, t);
    product(u, d, d);
    product(d, t, d);
    return distance(d, f, 9);
}

/* singular values with ranks of 0 to 3, repeated, of either sense, and far apart */
static const double values[][3] = {
    {0, 0, 0},        {1, 0, 0},       {1, 1, 0},          {1, 1, 1},        {1, 1, -1},        {2, 1, 1},
    {2, 2, 1},        {2, 2, -1},      {2, 1, -1},         {3, 2, 1},        {3, 2, -1},        {1, 1e-8, 1e-9},
    {1, 1e-8, -1e-8}, {1, 1, 1e-12},   {1, 1e-16, 1e-16},  {1, 1e-200, 0},   {1, 1 - 1e-9, .5}, {1 + 1e-15, 1, 1},
    {1e3, 1, 1e-3},   {1, .9, -1e-14}, {1, 1e-12, -1e-13}, {1, 1e-13, 1e-20}};
enum { N_VALUES = sizeof values / sizeof values[0] };

static void takes_matrices_apart_into_two_rotations_and_three_values(void)
{
    for (int t = 0; t < 40 * N_VALUES; t++) {
        const double *wanted = values[t % N_VALUES];
        double f[9], u[9], s[3], v[9], top = wanted[0] + 1e-300;
        draw_with(wanted, f);
        pal_svd3(f, u, s, v);
        CHECK_LE(svd_error(f, u, s, v), 4e-15 * top);
        CHECK_LE(distance(s, wanted, 3), 4e-15 * top);
        CHECK_LE(off_rotation(u), 4e-15);
        CHECK_LE(off_rotation(v), 4e-15);
        CHECK(s[0] >= s[1] && s[1] >= fabs(s[2]));
    }
    for (int t = 0; t < 2000; t++) {
        double f[9], u[9], s[3], v[9], top = 0;
        for (int i = 0; i < 9; i++) f[i] = draw() * (t % 3 ? 1 : pow(10, 12 * draw())), top = fmax(top, fabs(f[i]));
        pal_svd3(f, u, s, v);
        CHECK_LE(svd_error(f, u, s, v), 5e-15 * top);
        CHECK(s[0] >= s[1] && s[1] >= fabs(s[2]));
        CHECK_LE(fmax(off_rotation(u), off_rotation(v)), 4e-15);
        CHECK((pal_det3(f) < 0) == (s[2] < 0) || fabs(s[2]) < 1e-13 * top);
    }
}

static void takes_matrices_of_any_size_apart(void)
{
    static const double size[] = {5e-324, 1e-310, 1e-300, 1e-200, 1e-100, 1e100, 1e200, 1e300};
    for (int t = 0; t < 8; t++) {
        double f[9], u[9], s[3], v[9], wanted[3] = {1, 0.5, -0.25}, scale = size[t];
        draw_with(wanted, f);
        for (int i = 0; i < 9; i++) f[i] *= scale;
        pal_svd3(f, u, s, v);
        for (int k = 0; k < 3; k++) CHECK_NEAR(s[k], scale * wanted[k], 1e-14 * scale + 2e-323);
        CHECK_LE(off_rotation(u), 4e-15);
        CHECK_LE(off_rotation(v), 4e-15);
    }
    double f[9] = {1, 2, 3, NAN, 4, 5, 6, 7, 8}, u[9], s[3], v[9];
    pal_svd3(f, u, s, v);
    CHECK(isnan(s[0]) && isnan(s[2]));
    CHECK_LE(off_rotation(u), 0);
}

static void finds_eigenvalues_in_order_with_their_vectors(void)
{
    static const double wanted[][3] = {{0, 0, 0},
                                       {-1, 2, 3},
                                       {1, 1, 1},
                                       {-1, -1, 4},
                                       {-5, 2, 2},
                                       {0, 0, 1},
                                       {-1, 0, 1},
                                       {1e-9, 1e-9, 1},
                                       {1, 1 + 1e-9, 2},
                                       {-1e200, 1e10, 1e200},
                                       {1e-300, 2e-300, 3e-300}};
    for (int t = 0; t < 440; t++) {
        const double *e = wanted[t % 11];
        double a[9], w[3], v[9], q[4], r[9], back[9], d[9] = {e[0], 0, 0, 0, e[1], 0, 0, 0, e[2]};
        double top = fmax(fabs(e[0]), fabs(e[2]));
        draw_quat(q);
        pal_quat_matrix(q, r);
        product(r, d, a);
        transpose(r, r);
        product(a, r, a);
        pal_eigen3(a, w, v);
        CHECK_LE(distance(w, e, 3), 4e-15 * top);
        CHECK(w[0] <= w[1] && w[1] <= w[2]);
        CHECK_LE(off_rotation(v), 4e-15);
        double m[9] = {w[0], 0, 0, 0, w[1], 0, 0, 0, w[2]};
        transpose(v, back);
        product(back, m, back);
        product(back, v, back);
        CHECK_LE(distance(back, a, 9), 4e-15 * top);
    }
}

static void turns_quaternions_to_matrices_and_back(void)
{
    for (int t = 0; t < 500; t++) {
        double q[4], r[9], p[4], x[3] = {draw(), draw(), draw()}, y[3], z[3];
        draw_quat(q);
        if (t < 8) q[0] = t & 1, q[1] = t & 2 ? 1 : 0, q[2] = t & 4 ? 1 : 0, q[3] = t == 0;
        double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int i = 0; i < 4; i++) q[i] /= n;
        pal_quat_matrix(q, r);
        CHECK_LE(off_rotation(r), 2e-15);
        pal_quat_rotate(y, q, x);
        pal_mul33(z, r, x);
        CHECK_LE(distance(y, z, 3), 2e-15);
        pal_matrix_quat(r, p);
        double dot = q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3];
        CHECK_NEAR(fabs(dot), 1, 2e-15);
    }
}

/* R : F at the answer against the largest there is, s0 + s1 + s2; f has largest value about 1 */
static double shortfall(const double f[9], const double q[4])
{
    double u[9], s[3], v[9], r[9], sum = 0;
    pal_svd3(f, u, s, v);
    pal_quat_matrix(q, r);
    for (int i = 0; i < 9; i++) sum += r[i] * f[i];
    return fabs(s[0] + s[1] + s[2] - sum);
}

static void finds_the_rotation_of_a_stretched_and_turned_matrix(void)
{
    for (int t = 0; t < 2000; t++) {
        double q[4], r[9], p[4], a[9], at[9], f[9], found[9];
        draw_quat(q);
        pal_quat_matrix(q, r);
        draw_with((double[3]){1, 0.1 + 0.4 * (draw() + 1), 0.05}, a);
        transpose(a, at);
        product(at, a, a); /* a stretch */
        product(r, a, f);
        draw_quat(p);
        pal_polar_rotation(f, p, 100);
        pal_quat_matrix(p, found);
        CHECK_LE(distance(found, r, 9), 1e-10);
        CHECK_NEAR(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3], 1, 1e-15);
    }
}

static void needs_three_turns_from_a_warm_start(void)
{
    int max = 0;
    for (int t = 0; t < 1000; t++) {
        double f[9], q[4] = {1, 0, 0, 0}, r[9], old[9];
        draw_quat(q);
        pal_quat_matrix(q, old);
        for (int i = 0; i < 9; i++) f[i] = (i % 4 == 0) + 0.1 * draw(); /* strains of 10 %, turned by up to 0.1 */
        product(old, f, f);
        int n = pal_polar_rotation(f, q, 100);
        if (n > max) max = n;
        CHECK_LE(shortfall(f, q), 1e-14);
        pal_quat_matrix(q, r);
        CHECK(distance(r, old, 9) < 0.4);
        CHECK_INT(pal_polar_rotation(f, q, 100), 1); /* there already */
    }
    CHECK_LE(max, 4);
}

static void leaves_the_saddle_half_a_turn_off(void)
{
    for (int t = 0; t < 300; t++) {
        double q[4], p[4], r[9], found[9], f[9], half[9], k[3] = {draw(), draw(), draw()};
        pal_unit3(k, k, 0);
        draw_quat(q);
        pal_quat_matrix(q, r);
        /* exactly half a turn about a drawn axis, or about an axis of coordinates */
        if (t % 4) pal_set3(k, t % 4 == 1, t % 4 == 2, t % 4 == 3);
        for (int i = 0; i < 9; i++) half[i] = 2 * k[i / 3] * k[i % 3] - (i % 4 == 0);
        product(r, half, f);
        memcpy(p, q, sizeof p);
        pal_polar_rotation(f, p, 100);
        pal_quat_matrix(p, found);
        CHECK_LE(distance(found, f, 9), 1e-12);
        /* stretched along the axis and beside it: a saddle whose skew part is zero */
        double s[9] = {3, 0, 0, 0, 2, 0, 0, 0, 0.5};
        product(f, s, f);
        memcpy(p, q, sizeof p);
        pal_polar_rotation(f, p, 100);
        CHECK_LE(shortfall(f, p), 1e-12);
    }
}

static void never_fails_where_the_determinant_is_zero_or_negative(void)
{
    for (int t = 0; t < 100 * N_VALUES; t++) {
        double f[9], q[4], again[4];
        draw_with(values[t % N_VALUES], f);
        draw_quat(q);
        int n = pal_polar_rotation(f, q, 100);
        CHECK(n <= 20);
        CHECK_LE(shortfall(f, q), 1e-11 * values[t % N_VALUES][0]);
        CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-14);
        /* where many rotations serve, the one at hand stays */
        memcpy(again, q, sizeof q);
        pal_polar_rotation(f, again, 100);
        if (t % N_VALUES != 4) CHECK_LE(distance(again, q, 4), 1e-7);
    }
}

static void stays_where_there_is_nothing_to_follow(void)
{
    double zero[9] = {0}, bad[9] = {1, 0, 0, 0, NAN, 0, 0, 0, 1}, huge[9] = {1, 0, 0, 0, INFINITY, 0, 0, 0, 1};
    double q[4] = {0.5, -0.5, 0.5, 0.5}, old[4];
    memcpy(old, q, sizeof q);
    CHECK_INT(pal_polar_rotation(zero, q, 100), 0);
    CHECK_INT(pal_polar_rotation(bad, q, 100), 0);
    CHECK_INT(pal_polar_rotation(huge, q, 100), 0);
    CHECK(!memcmp(q, old, sizeof q));
    CHECK_INT(pal_polar_rotation((double[9]){0, -1, 0, 1, 0, 0, 0, 0, 1}, q, 0), 0);
    CHECK(!memcmp(q, old, sizeof q));
}

static void does_not_mind_the_size_of_the_matrix(void)
{
    double size[] = {1e-307, 1e-200, 1e-100, 1e-12, 1e12, 1e100, 1e200, 1e307};
    for (int t = 0; t < 8; t++) {
        double q[4], p[4] = {1, 0, 0, 0}, r[9], f[9], found[9];
        draw_quat(q);
        pal_quat_matrix(q, r);
        for (int i = 0; i < 9; i++) f[i] = size[t] * r[i];
        pal_polar_rotation(f, p, 100);
        pal_quat_matrix(p, found);
        CHECK_LE(distance(found, r, 9), 1e-12);
    }
}

/* 10,000 turns in steps of a tenth: no drift off the rotation, none off unit length */
static void follows_ten_thousand_turns(void)
{
    double q[4] = {1, 0, 0, 0}, worst = 0;
    const double tau = 6.283185307179586;
    for (int i = 0; i < 100000; i++) {
        double a = tau * (i % 10) / 10, c = cos(a), s = sin(a), r[9];
        double f[9] = {1.1 * c, -0.9 * s, 0, 1.1 * s, 0.9 * c, 0, 0, 0, 1.02};
        double wanted[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
        pal_polar_rotation(f, q, 20);
        pal_quat_matrix(q, r);
        worst = fmax(worst, distance(r, wanted, 9));
    }
    CHECK_LE(worst, 1e-11);
    CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-15);
}

int main(void)
{
    RUN(takes_matrices_apart_into_two_rotations_and_three_values);
    RUN(takes_matrices_of_any_size_apart);
    RUN(finds_eigenvalues_in_order_with_their_vectors);
    RUN(turns_quaternions_to_matrices_and_back);
    RUN(finds_the_rotation_of_a_stretched_and_turned_matrix);
    RUN(needs_three_turns_from_a_warm_start);
    RUN(leaves_the_saddle_half_a_turn_off);
    RUN(never_fails_where_the_determinant_is_zero_or_negative);
    RUN(stays_where_there_is_nothing_to_follow);
    RUN(does_not_mind_the_size_of_the_matrix);
    RUN(follows_ten_thousand_turns);
    return check_report();
}
