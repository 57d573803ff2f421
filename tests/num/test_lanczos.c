/* Lanczos' iteration: against known eigenvalues, from good, bad and no first vectors. */
#include "server/num/lanczos.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <stdint.h>

enum { N = 200 };

/* K is the chain 2, -1, M diagonal; with M = m the largest eigenvalue is (2 - 2 cos(pi N/(N+1))) / m */
typedef struct chain {
    double stiff, m[N];
    int n_multiply, broken; /* multiply gives up at this call; 0: never */
} chain;

static bool multiply(void *user, const double *v, double *out)
{
    chain *c = user;
    for (int i = 0; i < N; i++) out[i] = c->stiff * (2 * v[i] - (i > 0 ? v[i - 1] : 0) - (i < N - 1 ? v[i + 1] : 0));
    return ++c->n_multiply != c->broken;
}

static bool solve(void *user, const double *b, double *out)
{
    const chain *c = user;
    for (int i = 0; i < N; i++) out[i] = b[i] / c->m[i];
    return true;
}

typedef struct room {
    double z[N], basis[PAL_LANCZOS_MAX * N], w[N], u[N];
} room;

static pal_lanczos begin(chain *c, room *r, double stiff, double m)
{
    *c = (chain){.stiff = stiff};
    for (int i = 0; i < N; i++) c->m[i] = m;
    uint64_t seed = 3;
    for (int i = 0; i < N; i++) {
        r->z[i] = random_signed(&seed);
    }
    return (pal_lanczos){N, multiply, solve, c, r->z, r->basis, PAL_LANCZOS_MAX, r->w, r->u, 0, 0, 0};
}

static void it_bounds_the_largest_eigenvalue_from_above_and_closely(void)
{
    static chain c;
    static room r;
    for (int power = -6; power <= 6; power += 6) {
        const double m = pow(10, power), want = 3 * (2 - 2 * cos(M_PI * N / (N + 1))) / m;
        pal_lanczos l = begin(&c, &r, 3, m);
        const double bound = pal_lanczos_run(&l, 0.01, 3, PAL_LANCZOS_MAX);
        CHECK_LE(want * (1 - 1e-3), bound);
        CHECK_LE(bound, 1.02 * want);
        CHECK_LE(l.ritz, want * (1 + 1e-12));
        CHECK_LE(l.residual, 0.01 * l.ritz);
    }
}

/* one mass of a thousandth: a mode of its own, found to all digits; its Ritz vector then needs one iteration */
static void a_mode_apart_is_found_to_the_end_and_again_at_once(void)
{
    static chain c;
    static room r;
    pal_lanczos l = begin(&c, &r, 1, 1);
    c.m[77] = 1e-3;
    const double bound = pal_lanczos_run(&l, 1e-12, 3, 20);
    CHECK_NEAR(l.residual / l.ritz, 0, 1e-12);
    CHECK_LE(2000, bound);
    CHECK_LE(bound, 2002);
    const double again = pal_lanczos_run(&l, 1e-6, 1, 20);
    CHECK_INT(l.done, 1);
    CHECK_NEAR(again / bound, 1, 1e-6);
}

static void nothing_stiff_and_no_first_vector_give_zero(void)
{
    static chain c;
    static room r;
    pal_lanczos l = begin(&c, &r, 0, 1);
    CHECK(pal_lanczos_run(&l, 0.01, 3, 20) == 0);
    CHECK_LE(l.done, 3);
    l = begin(&c, &r, 1, 1);
    for (int i = 0; i < N; i++) r.z[i] = 0;
    CHECK(pal_lanczos_run(&l, 0.01, 3, 20) == 0);
}

static void what_is_no_number_and_giving_up_give_none(void)
{
    static chain c;
    static room r;
    pal_lanczos l = begin(&c, &r, NAN, 1);
    CHECK(isnan(pal_lanczos_run(&l, 0.01, 3, 20)));
    l = begin(&c, &r, 1, 1);
    c.broken = 4;
    CHECK(isnan(pal_lanczos_run(&l, 1e-9, 3, 20)));
    CHECK_INT(c.n_multiply, 4);
}

int main(void)
{
    RUN(it_bounds_the_largest_eigenvalue_from_above_and_closely);
    RUN(a_mode_apart_is_found_to_the_end_and_again_at_once);
    RUN(nothing_stiff_and_no_first_vector_give_zero);
    RUN(what_is_no_number_and_giving_up_give_none);
    return check_report();
}
