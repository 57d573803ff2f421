/* Elastic laws at a point: stress = gradient of the energy, Hessian = gradient of the stress, projection, constants. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/elements/elastic_law.h"
#include "tests/check.h"
#include "tests/fixtures/neo_hessian.h"
#include "tests/fixtures/random.h"

#include <string.h>

static uint64_t seed = 5;
static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

static const double mu = 1.3, k1 = 7.1;

/* near I; any, half of them inverted; flat; on a line; zero */
static void some_gradient(int kind, double f[9])
{
    for (int i = 0; i < 9; i++) f[i] = (kind == 0 ? 0.2 : 1.2) * uniform() + (kind == 0 && i % 4 == 0);
    if (kind == 2)
        for (int i = 0; i < 3; i++) f[6 + i] = f[i] - 2 * f[3 + i];
    if (kind == 3)
        for (int i = 0; i < 6; i++) f[3 + i] = (i < 3 ? 2 : -1) * f[i % 3];
    if (kind == 4) memset(f, 0, 9 * sizeof *f);
}

static double energy(double pressure, const double f[9])
{
    return pal_neo_energy(mu, k1, f) + pressure * (pal_det3(f) - 1);
}

static void stress_is_the_gradient_of_the_energy(void)
{
    for (int n = 0; n < 50; n++) {
        double f[9], p[9], pressure = n & 1 ? 0 : 2;
        some_gradient(n % 5, f);
        pal_neo_stress(mu, k1, pressure, f, p);
        for (int i = 0; i < 9; i++) {
            double e[2], step = 1e-5, keep = f[i];
            for (int s = 0; s < 2; s++) f[i] = keep + (s ? step : -step), e[s] = energy(pressure, f);
            f[i] = keep;
            CHECK_NEAR(p[i], (e[1] - e[0]) / (2 * step), 1e-8);
        }
    }
}

static void hessian_is_the_gradient_of_the_stress(void)
{
    for (int n = 0; n < 50; n++) {
        double f[9], h[81], pressure = n & 1 ? 0 : 2;
        some_gradient(n % 5, f);
        neo_hessian(mu, k1, pressure, f, h);
        for (int j = 0; j < 9; j++) {
            double p[2][9], step = 1e-5, keep = f[j];
            for (int s = 0; s < 2; s++) f[j] = keep + (s ? step : -step), pal_neo_stress(mu, k1, pressure, f, p[s]);
            f[j] = keep;
            for (int i = 0; i < 9; i++) CHECK_NEAR(h[9 * i + j], (p[1][i] - p[0][i]) / (2 * step), 1e-8);
        }
    }
}

/* eigenvalues and vectors (rows of v) of a symmetric 9x9 matrix by Jacobi */
static void eigen9(const double in[81], double w[9], double v[81])
{
    double a[81];
    memcpy(a, in, sizeof a);
    for (int i = 0; i < 81; i++) v[i] = i % 10 == 0;
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < 9; p++)
            for (int q = p + 1; q < 9; q++) {
                double apq = a[9 * p + q];
                if (fabs(apq) < 1e-300) continue;
                double theta = (a[10 * q] - a[10 * p]) / (2 * apq);
                double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1);
                double s = t * c;
                for (int k = 0; k < 9; k++) {
                    double x = a[9 * k + p], y = a[9 * k + q];
                    a[9 * k + p] = c * x - s * y, a[9 * k + q] = s * x + c * y;
                }
                for (int k = 0; k < 9; k++) {
                    double x = a[9 * p + k], y = a[9 * q + k];
                    a[9 * p + k] = c * x - s * y, a[9 * q + k] = s * x + c * y;
                    x = v[9 * p + k], y = v[9 * q + k];
                    v[9 * p + k] = c * x - s * y, v[9 * q + k] = s * x + c * y;
                }
            }
    for (int i = 0; i < 9; i++) w[i] = a[10 * i];
}

/* the closed form against a projection by brute force */
static void projection_is_that_of_the_eigenvalues(void)
{
    int n_projected = 0, n_whole = 0;
    for (int n = 0; n < 100; n++) {
        double f[9], h[81], w[9], v[81], closed[81], pressure = n & 1 ? 0 : 2;
        some_gradient(n % 5, f);
        neo_hessian(mu, k1, pressure, f, h);
        eigen9(h, w, v);
        double min = 0, max = 0;
        for (int m = 0; m < 9; m++) min = fmin(min, w[m]), max = fmax(max, fabs(w[m]));
        neo_modes modes;
        neo_modes_compute(mu, k1, pressure, f, &modes);
        neo_modes_hessian(&modes, closed);
        for (int i = 0; i < 9; i++)
            for (int j = 0; j < 9; j++) {
                double sum = 0;
                for (int m = 0; m < 9; m++) sum += fmax(w[m], 0) * v[9 * m + i] * v[9 * m + j];
                CHECK_NEAR(closed[9 * i + j], sum, 1e-10 * max);
            }
        n_projected += min < -1e-9, n_whole += min >= 0;
    }
    CHECK(n_projected > 20);
    CHECK(n_whole > 3);
}

static void small_strains_have_the_given_constants(void)
{
    double m, l;
    pal_lame(5000, 0.3, &m, &l);
    CHECK_NEAR(m * (3 * l + 2 * m) / (l + m), 5000, 1e-9);
    CHECK_NEAR(l / (2 * (l + m)), 0.3, 1e-14);
    double f[9], h[81], a[9], p[9];
    for (int i = 0; i < 9; i++) f[i] = i % 4 == 0, a[i] = uniform();
    neo_hessian(m, l + m, 0, f, h);
    pal_linear_stress(m, l, a, p);
    for (int i = 0; i < 9; i++) {
        double sum = 0;
        for (int j = 0; j < 9; j++) sum += h[9 * i + j] * a[j];
        CHECK_NEAR(sum, p[i], 1e-11 * m);
    }
    /* energy of a strain of 1e-9 is not lost in rounding: that of the linear law to 1e-6 */
    double work = 0;
    for (int i = 0; i < 9; i++) f[i] += 1e-9 * a[i], work += 0.5 * p[i] * a[i];
    CHECK_NEAR(pal_neo_energy(m, l + m, f) / (1e-18 * work), 1, 1e-6);
}

static void rotation_changes_nothing(void)
{
    for (int n = 0; n < 20; n++) {
        double f[9], g[9], r[9], q[4], p[9], s[9];
        some_gradient(n % 3, f);
        for (int i = 0; i < 4; i++) q[i] = uniform();
        double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int i = 0; i < 4; i++) q[i] /= length;
        pal_quat_matrix(q, r);
        for (int i = 0; i < 9; i++)
            g[i] = r[3 * (i / 3)] * f[i % 3] + r[3 * (i / 3) + 1] * f[3 + i % 3] + r[3 * (i / 3) + 2] * f[6 + i % 3];
        CHECK_NEAR(pal_neo_energy(mu, k1, f), pal_neo_energy(mu, k1, g), 1e-12);
        pal_neo_stress(mu, k1, 0, f, p);
        pal_neo_stress(mu, k1, 0, g, s);
        for (int i = 0; i < 9; i++)
            CHECK_NEAR(
                s[i], r[3 * (i / 3)] * p[i % 3] + r[3 * (i / 3) + 1] * p[3 + i % 3] + r[3 * (i / 3) + 2] * p[6 + i % 3],
                1e-12);
        /* corotational: P = R sigma; its energy and stress of a pure rotation are nothing */
        CHECK_NEAR(pal_corotational_stress(mu, k1 - mu, r, r, p), 0, 1e-28);
        for (int i = 0; i < 9; i++) CHECK_NEAR(p[i], 0, 1e-13);
    }
}

static void von_mises_of_known_stresses(void)
{
    CHECK_NEAR(pal_von_mises((double[9]){3, 0, 0, 0, 0, 0, 0, 0, 0}), 3, 1e-15);
    CHECK_NEAR(pal_von_mises((double[9]){2, 0, 0, 0, 2, 0, 0, 0, 2}), 0, 1e-15);
    CHECK_NEAR(pal_von_mises((double[9]){0, 1, 0, 1, 0, 0, 0, 0, 0}), sqrt(3), 1e-15);
}

static void refuses_an_unknown_law(void)
{
    pal_config_entry item;
    pal_diagnostic diag = {{0}};
    pal_elastic_law law = PAL_LAW_LINEAR;
    pal_entry_init(&item, "model", "fem");
    CHECK_INT(pal_elastic_law_read(&item, &law, &diag), 0);
    CHECK_INT(law, PAL_LAW_COROTATIONAL);
    pal_entry_put_text(&item, "law", "hooke", NULL);
    CHECK_INT(pal_elastic_law_read(&item, &law, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "model.law") && strstr(diag.text, "hooke"));
}

int main(void)
{
    RUN(stress_is_the_gradient_of_the_energy);
    RUN(hessian_is_the_gradient_of_the_stress);
    RUN(projection_is_that_of_the_eigenvalues);
    RUN(small_strains_have_the_given_constants);
    RUN(rotation_changes_nothing);
    RUN(von_mises_of_known_stresses);
    RUN(refuses_an_unknown_law);
    return check_report();
}
