/* Lowest modes of chains, whose frequencies are known: lambda_1 = 4 sin^2(pi / (2 (n + 1))) for n equal masses between
 * two walls. */
#include "server/num/lowest_mode.h"
#include "server/num/random.h"
#include "tests/check.h"

enum { N = 200 };

typedef struct chain {
    double wall;     /* stiffness of the springs to both walls; 1: as between masses, 0: free */
    double mass[N];  /* kg */
    bool exact;      /* precondition with the inverse of the chain between walls; else with its diagonal */
    int n_stiffness; /* products so far */
} chain;

static void stiffness(void *user, const double *v, double *out)
{
    chain *c = user;
    for (int i = 0; i < N; i++) {
        const double left = i > 0 ? v[i] - v[i - 1] : c->wall * v[i],
                     right = i < N - 1 ? v[i] - v[i + 1] : c->wall * v[i];
        out[i] = left + right;
    }
    c->n_stiffness++;
}

static void mass(void *user, const double *v, double *out)
{
    for (int i = 0; i < N; i++) out[i] = ((chain *)user)->mass[i] * v[i];
}

/* elimination in a chain with walls of stiffness 1 */
static void precondition(void *user, const double *r, double *out)
{
    double d[N];
    for (int i = 0; i < N; i++) out[i] = ((chain *)user)->exact ? r[i] : r[i] / 2;
    if (!((chain *)user)->exact) return;
    d[0] = 2;
    for (int i = 1; i < N; i++) d[i] = 2 - 1 / d[i - 1], out[i] += out[i - 1] / d[i - 1];
    out[N - 1] /= d[N - 1];
    for (int i = N - 2; i >= 0; i--) out[i] = (out[i] + out[i + 1]) / d[i];
}

static pal_lowest_mode search(chain *c, double x[N], double tolerance, int max)
{
    static double work[9 * N];
    pal_lowest_mode m = {
        .n = N, .stiffness = stiffness, .mass = mass, .precondition = precondition, .user = c, .x = x, .work = work};
    for (int i = 0; i < N; i++) x[i] = pal_random_unit(3, (uint64_t)i) - 0.5;
    pal_lowest_mode_run(&m, tolerance, max);
    return m;
}

static void fill(chain *c, double wall, bool exact)
{
    *c = (chain){.wall = wall, .exact = exact};
    for (int i = 0; i < N; i++) c->mass[i] = 1;
}

static void a_chain_between_walls_has_the_known_frequency(void)
{
    chain c;
    double x[N], wanted = pow(2 * sin(M_PI / (2 * (N + 1))), 2), norm = 0;
    fill(&c, 1, true);
    pal_lowest_mode m = search(&c, x, 1e-12, 60);
    printf("  %d iterations, %.3g of the eigenvalue off\n", m.done, m.lambda / wanted - 1);
    CHECK_NEAR(m.lambda / wanted, 1, 1e-10);
    CHECK_LE(m.done, 20);
    for (int i = 0; i < N; i++) norm += x[i] * x[i];
    CHECK_NEAR(norm, 1, 1e-12);
    /* a half sine */
    for (int i = 0; i < N; i++) CHECK_NEAR(fabs(x[i]), sqrt(2.0 / (N + 1)) * sin(M_PI * (i + 1) / (N + 1)), 1e-5);
    /* never below, and as near as it says: to the tolerance that was asked for */
    for (int k = 1; k < 5; k++) {
        m = search(&c, x, pow(10, -k), 60);
        CHECK(m.lambda >= wanted * (1 - 1e-12) && m.error <= pow(10, -k));
        CHECK_LE(m.lambda / wanted - 1, pow(10, -k));
    }
    /* the diagonal alone: as slow as conjugate gradients, to the same value */
    c.exact = false;
    m = search(&c, x, 1e-9, 2000);
    CHECK_NEAR(m.lambda / wanted, 1, 1e-6);
    CHECK(m.done > 60);
}

static void masses_count_in_the_quotient(void)
{
    chain c;
    double x[N], wanted = pow(2 * sin(M_PI / (2 * (N + 1))), 2);
    fill(&c, 1, true);
    for (int i = 0; i < N; i++) c.mass[i] = 4;
    CHECK_NEAR(search(&c, x, 1e-12, 60).lambda * 4 / wanted, 1, 1e-9);
    /* one heavy mass in the middle of light ones, on two springs of (N + 1) / 2 links */
    for (int i = 0; i < N; i++) c.mass[i] = i == N / 2 ? 1e9 : 1;
    const double links = N / 2 + 1, other = N - N / 2;
    CHECK_NEAR(search(&c, x, 1e-12, 60).lambda * 1e9 / (1 / links + 1 / other), 1, 1e-5);
}

static void a_motion_without_energy_has_eigenvalue_0(void)
{
    chain c;
    double x[N];
    fill(&c, 0, true);
    pal_lowest_mode m = search(&c, x, 1e-6, 200);
    CHECK(fabs(m.lambda) < 1e-9);
    /* and a first vector of zeros has none at all */
    for (int i = 0; i < N; i++) c.mass[i] = 0;
    m = search(&c, x, 1e-6, 200);
    CHECK(isnan(m.lambda));
}

static void its_work_is_bounded(void)
{
    chain c;
    double x[N];
    fill(&c, 1, false);
    pal_lowest_mode m = search(&c, x, 1e-12, 10);
    CHECK_INT(m.done, 10);
    CHECK_LE(c.n_stiffness, 12);
    CHECK(m.error > 1e-12 && isfinite(m.lambda));
}

int main(void)
{
    RUN(a_chain_between_walls_has_the_known_frequency);
    RUN(masses_count_in_the_quotient);
    RUN(a_motion_without_energy_has_eigenvalue_0);
    RUN(its_work_is_bounded);
    return check_report();
}
