/* Conjugate gradients: against known answers, with good, bad and changing preconditioners, and where they must stop. */
#include "server/num/conjugate_gradient.h"
#include "tests/check.h"

#include <string.h>

enum { N = 60 };

typedef struct chain {
    double diagonal[N]; /* of the matrix whose neighbours are coupled by -1 */
    int kind;           /* of the preconditioner: 0 none, 1 diagonal, 2 diagonal with 1e-4 noise, 3 NaN, 4 uphill */
    int n_multiply, n_precondition;
    const pal_conjugate_gradient *cg; /* NULL: no answer is careful */
} chain;

static void multiply(void *user, const double *p, double *out)
{
    chain *c = user;
    c->n_multiply++;
    for (int i = 0; i < N; i++) out[i] = c->diagonal[i] * p[i] - (i > 0 ? p[i - 1] : 0) - (i < N - 1 ? p[i + 1] : 0);
}

static void precondition(void *user, const double *r, double *out)
{
    chain *c = user;
    c->n_precondition++;
    for (int i = 0; i < N; i++) {
        out[i] = c->kind ? r[i] / c->diagonal[i] : r[i];
        if (c->kind == 2) out[i] *= 1 + 1e-4 * sin(12.9898 * i + 78.233 * c->n_precondition);
        if (c->kind == 3) out[i] = NAN;
        if (c->kind == 4 && !(c->cg && c->cg->careful)) out[i] *= -1;
    }
}

/* diagonal from 2.1 (contrast 0) to 2.1 * 10^contrast */
static void make(chain *c, double contrast, int kind)
{
    *c = (chain){.kind = kind};
    for (int i = 0; i < N; i++) c->diagonal[i] = 2.1 * pow(10, contrast * (i * 7 % N) / N);
}

/* solves A x = A w from x = 0; the largest error is in *error */
static int solve(chain *c, double target, int min, int max, double *error, double *residual)
{
    double w[N], x[N] = {0}, r[N], z[N], p[N], q[N];
    for (int i = 0; i < N; i++) w[i] = 1 + i % 5;
    multiply(c, w, r);
    pal_conjugate_gradient cg = {
        .n = N, .multiply = multiply, .precondition = precondition, .user = c, .r = r, .z = z, .p = p, .q = q};
    int n = pal_conjugate_gradient_run(&cg, x, target, min, max);
    *error = 0;
    for (int i = 0; i < N; i++) *error = fmax(*error, fabs(x[i] - w[i]));
    *residual = cg.residual;
    /* the residual carried along is that of x */
    double ax[N], sum = 0;
    multiply(c, x, ax), multiply(c, w, q);
    for (int i = 0; i < N; i++) sum += (q[i] - ax[i]) * (q[i] - ax[i]);
    CHECK_NEAR(cg.residual, sqrt(sum), 1e-9 * (1 + sqrt(sum)));
    return n;
}

static void finds_the_solution_within_as_many_turns_as_unknowns(void)
{
    double error, residual;
    chain c;
    for (int kind = 0; kind < 2; kind++) {
        make(&c, 0, kind);
        CHECK_LE(solve(&c, 1e-10, 0, 200, &error, &residual), N);
        CHECK_LE(residual, 1e-10);
        CHECK_LE(error, 1e-9);
    }
}

static void gains_from_the_preconditioner(void)
{
    double error, residual;
    chain c;
    make(&c, 4, 0);
    int plain = solve(&c, 1e-6, 0, 2000, &error, &residual);
    make(&c, 4, 1);
    int good = solve(&c, 1e-6, 0, 2000, &error, &residual);
    CHECK_LE(error, 1e-6);
    CHECK_LE(3 * good, plain);
    make(&c, 4, 2);
    int noisy = solve(&c, 1e-6, 0, 2000, &error, &residual);
    CHECK_LE(error, 1e-6);
    CHECK_LE(noisy, good + 5);
}

static void keeps_to_its_budget_and_to_the_least(void)
{
    double error, residual, first;
    chain c;
    make(&c, 3, 1);
    CHECK_INT(solve(&c, 0, 0, 4, &error, &residual), 4);
    CHECK_INT(c.n_precondition, 4);
    CHECK_INT(solve(&c, 1e300, 0, 50, &error, &first), 0);
    CHECK(first > residual);
    CHECK_INT(solve(&c, 1e300, 3, 50, &error, &residual), 3);
    CHECK(residual > 0 && residual < first);
}

static void stops_where_there_is_no_way_down(void)
{
    double error, residual;
    chain c;
    make(&c, 0, 3);
    CHECK_INT(solve(&c, 1e-9, 0, 50, &error, &residual), 0);
    make(&c, 0, 0);
    for (int i = 0; i < N; i++) c.diagonal[i] = -5;
    CHECK_INT(solve(&c, 1e-9, 0, 50, &error, &residual), 0);
    CHECK_NEAR(error, 5, 0); /* x is as it was */
    double zero[N] = {0}, x[N] = {0}, z[N], p[N], q[N];
    pal_conjugate_gradient cg = {
        .n = N, .multiply = multiply, .precondition = precondition, .user = &c, .r = zero, .z = z, .p = p, .q = q};
    CHECK_INT(pal_conjugate_gradient_run(&cg, x, 0, 5, 50), 0);
    CHECK_NEAR(cg.residual, 0, 0);
}

/* an answer that leads uphill, as of a cycle that is not symmetric, is asked for again and ends nothing */
static void asks_again_where_an_answer_leads_uphill(void)
{
    double r[N], z[N], p[N], q[N];
    for (int kind = 1; kind <= 4; kind += 3) {
        chain c;
        double x[N] = {0};
        make(&c, 2, kind);
        pal_conjugate_gradient cg = {
            .n = N, .multiply = multiply, .precondition = precondition, .user = &c, .r = r, .z = z, .p = p, .q = q};
        c.cg = &cg;
        for (int i = 0; i < N; i++) r[i] = 1 + i % 5;
        const int n = pal_conjugate_gradient_run(&cg, x, 1e-9, 0, 200);
        CHECK_LE(cg.residual, 1e-9);
        CHECK_INT(c.n_precondition, kind == 4 ? 2 * n : n);
        CHECK(!cg.careful || kind == 4);
    }
    double error, residual;
    chain c;
    make(&c, 2, 4);
    CHECK_INT(solve(&c, 1e-9, 0, 50, &error, &residual), 0);
    CHECK_INT(c.n_precondition, 2);
}

/* the search for x'b ends at a share of it, from no guess and from a good one */
static void ends_once_the_energy_is_known(void)
{
    double w[N], b[N], x[N] = {0}, r[N], z[N], p[N], q[N];
    chain c;
    make(&c, 1, 1);
    for (int i = 0; i < N; i++) w[i] = 1 + i % 5;
    multiply(&c, w, b);
    const double wanted = pal_dot_product(N, w, b);
    pal_conjugate_gradient cg = {.n = N,
                                 .multiply = multiply,
                                 .precondition = precondition,
                                 .user = &c,
                                 .r = r,
                                 .z = z,
                                 .p = p,
                                 .q = q,
                                 .gain = 1e-3};
    memcpy(r, b, sizeof r);
    const int n = pal_conjugate_gradient_run(&cg, x, 0, 1, 50);
    CHECK_NEAR(cg.energy, pal_dot_product(N, x, b), 1e-9 * wanted);
    CHECK_NEAR(cg.energy, wanted, 3e-3 * wanted);
    CHECK(n > 1 && n < 20);
    /* nothing is left to do */
    CHECK_INT(pal_conjugate_gradient_run(&cg, x, 0, 0, 50), 0);
}

static void sums_in_a_fixed_order(void)
{
    double a[29], b[29], wanted = 0;
    for (int n = 0; n <= 29; n++) {
        wanted = 0;
        for (int i = 0; i < n; i++) a[i] = i + 1, b[i] = 2 - i, wanted += a[i] * b[i];
        CHECK_NEAR(pal_dot_product(n, a, b), wanted, 0); /* whole numbers: exact in any order */
    }
}

int main(void)
{
    RUN(finds_the_solution_within_as_many_turns_as_unknowns);
    RUN(gains_from_the_preconditioner);
    RUN(keeps_to_its_budget_and_to_the_least);
    RUN(stops_where_there_is_no_way_down);
    RUN(asks_again_where_an_answer_leads_uphill);
    RUN(ends_once_the_energy_is_known);
    RUN(sums_in_a_fixed_order);
    return check_report();
}
