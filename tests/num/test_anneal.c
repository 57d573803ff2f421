/* Adaptive simulated annealing: its schedule against numbers by hand and distributions, the same walk for every batch
 * and team, known minima, and costs that have no value. */
#include "server/num/anneal.h"

#include "server/base/team.h"
#include "server/num/random.h"
#include "tests/check.h"

#include <float.h>

enum { MAX = 4, TRAIL = 20000 };

typedef struct task task;
struct task {
    double (*cost)(task *t, const double *p);
    int n;
    pal_team *team;        /* NULL: the caller alone                       */
    const double *p;       /* of the batch under way                       */
    double *out;           /* its costs                                    */
    int max_at_once;       /* largest batch                                */
    int64_t stop_at;       /* the step that ends the walk; 0: none         */
    int64_t fail_at, seen; /* evaluate fails when so many were asked for   */
    double scale, shift;   /* units: cost of (p - shift) / scale           */
    /* the walk */
    double trail[TRAIL], trail_p[TRAIL][MAX], trail_best[TRAIL];
    uint8_t kind[TRAIL]; /* 1 accepted, 2 improved, 4 start, 8 probe     */
    int n_trail, bad;
};

static double cost_of(task *t, const double *p)
{
    double x[MAX];
    for (int i = 0; i < t->n; i++) x[i] = (p[i] - t->shift) / t->scale;
    return t->cost(t, x);
}

static void piece(void *user, int worker, int i)
{
    (void)worker;
    task *t = user;
    t->out[i] = cost_of(t, t->p + i * t->n);
}

static pal_err evaluate(void *user, const double *p, int n, double *cost)
{
    task *t = user;
    t->seen += n;
    if (t->fail_at && t->seen >= t->fail_at) return PAL_ERR_FROZEN;
    if (n > t->max_at_once) t->max_at_once = n;
    t->p = p;
    t->out = cost;
    if (t->team) pal_team_run(t->team, n, piece, t);
    for (int i = 0; i < n && !t->team; i++) piece(t, 0, i);
    return PAL_ERR_OK;
}

static bool step(void *user, const pal_anneal_step *s)
{
    task *t = user;
    t->bad += s->generation != t->n_trail; /* every evaluation of the walk, in order */
    if (t->n_trail < TRAIL) {
        t->trail[t->n_trail] = s->cost;
        t->trail_best[t->n_trail] = s->best;
        memcpy(t->trail_p[t->n_trail], s->p, sizeof(double) * (size_t)t->n);
        t->kind[t->n_trail] = (uint8_t)(s->accepted + 2 * s->improved + 4 * s->start + 8 * s->probe);
    }
    t->n_trail++;
    return t->n_trail != t->stop_at;
}

static double low[MAX], high[MAX];

/* a task and options in the cube [a, b]^n, no re-annealing by generations */
static pal_anneal_options begin(task *t, double (*cost)(task *, const double *), int n, double a, double b)
{
    memset(t, 0, sizeof *t);
    t->cost = cost;
    t->n = n;
    t->scale = 1;
    for (int i = 0; i < n; i++) low[i] = a, high[i] = b;
    pal_anneal_options o;
    pal_anneal_default(&o);
    o.n_parameter = n;
    o.low = low;
    o.high = high;
    o.evaluate = evaluate;
    o.step = step;
    o.user = t;
    return o;
}

static double rosenbrock(task *t, const double *p)
{
    (void)t;
    return 100 * pow(p[1] - p[0] * p[0], 2) + pow(1 - p[0], 2);
}

static double rastrigin(task *t, const double *p)
{
    double sum = 0;
    for (int i = 0; i < t->n; i++) sum += p[i] * p[i] + 10 - 10 * cos(6.283185307179586 * p[i]);
    return sum;
}

/* Corana et al. 1987, the function of Ingber's own test: 1e5^4 local minima, the least, 0, where all |p| < 0.05 */
static double corana(task *t, const double *p)
{
    const double d[4] = {1, 1000, 10, 100}, s = 0.2;
    double sum = 0;
    for (int i = 0; i < t->n; i++) {
        double z = floor(fabs(p[i] / s) + 0.49999) * (p[i] < 0 ? -s : s);
        sum += d[i] * (fabs(p[i] - z) < 0.05 ? 0.15 * pow(z - (z < 0 ? -0.05 : z > 0 ? 0.05 : 0), 2) : p[i] * p[i]);
    }
    return sum;
}

/* the half x0 < 0 has no value; elsewhere Rosenbrock's */
static double half(task *t, const double *p)
{
    return p[0] < 0 ? DBL_MAX : rosenbrock(t, p);
}

static double no_value(task *t, const double *p)
{
    (void)t;
    return p[0] < -0.3 ? DBL_MAX : p[0] < 0.3 ? NAN : p[1] < 0 ? INFINITY : -INFINITY;
}

static double sinking(task *t, const double *p)
{
    (void)p;
    return 1000.0 - (double)t->n_trail;
}

static void temperature_follows_ingbers_schedule(void)
{
    pal_anneal_options o;
    pal_anneal_default(&o);
    o.n_parameter = 1; /* c = 11.512925465 exp(-4.605170186) = 0.11512925465: one power of ten every 20 */
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 0), 1, 0);
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 1), 0.8912509381, 1e-10);
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 20), 0.1, 1e-12);
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 100), 1e-5, 1e-15);
    o.n_parameter = 3; /* c = 11.512925465 / 100^(1/3) = 2.4803846 */
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 1), 0.0837110241, 1e-10);
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 8), 0.0837110241 * 0.0837110241, 1e-10);
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 100), 1e-5, 1e-15);
    /* neither falls to nothing */
    CHECK_NEAR(pal_anneal_temperature_ratio(&o, 1e300), 1e-10, 0);
    CHECK_NEAR(pal_anneal_jump(1e-18, 0.75), 1e-9, 1e-17);
    /* y at T = 1: sgn (2^|2u - 1| - 1) */
    CHECK_NEAR(pal_anneal_jump(1, 0.5), 0, 0);
    CHECK_NEAR(pal_anneal_jump(1, 0.75), 0.41421356237, 1e-11);
    CHECK_NEAR(pal_anneal_jump(1, 0.25), -0.41421356237, 1e-11);
    CHECK_NEAR(pal_anneal_jump(0.01, 0.75), 0.01 * (sqrt(101) - 1), 1e-15);
    CHECK_NEAR(pal_anneal_jump(1e-5, 1 - 0x1p-54), 1, 1e-12);
}

/* P(y < size) of Ingber's generating function at temperature T */
static double chance(double y, double t)
{
    double part = log1p(fabs(y) / t) / log1p(1 / t);
    return 0.5 + (y < 0 ? -0.5 : 0.5) * part;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

/* largest distance of the empirical distribution from the uniform one, times sqrt(n): above 1.95 once in 1000 */
static double kolmogorov(double *u, int n)
{
    double max = 0;
    qsort(u, (size_t)n, sizeof *u, by_size);
    for (int i = 0; i < n; i++) max = fmax(max, fmax((i + 1.0) / n - u[i], u[i] - (double)i / n));
    return max * sqrt(n);
}

static void draws_from_ingbers_distribution(void)
{
    static double u[50000];
    const double t[3] = {1, 1e-2, 1e-9};
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 50000; i++)
            u[i] = chance(pal_anneal_jump(t[k], pal_random_unit(7, (uint64_t)(k * 50000 + i))), t[k]);
        CHECK_LE(kolmogorov(u, 50000), 1.95);
    }
}

/* only the first point has a value, and those one difference of 1e-3 away: steep along 0, flat along 2 */
static double only_first(task *t, const double *p)
{
    const double slope[3] = {8, 1, 0.25};
    if (p[0] == 0.25 && p[1] == 0.5 && p[2] == 1) return 3;
    for (int i = 0; i < t->n; i++) {
        double at[3] = {0.25, 0.5, 1};
        at[i] += i == 2 ? -1e-3 : 1e-3; /* the third begins at the box's end */
        if (p[0] == at[0] && p[1] == at[1] && p[2] == at[2]) return 3 + slope[i] * 1e-3;
    }
    return NAN;
}

/* the walk stands at its first point: the k-th candidate's values, put through the distribution at T(k) cut to the box,
 * are uniform; after each 50 candidates T is stretched by 8, 8/8 and 32 against the steepest: by 1, 8 and 32 */
static void cools_by_candidate_and_is_stretched_by_sensitivity(void)
{
    static task t;
    static double u[3][20000];
    const double first[3] = {0.25, 0.5, 1}, stretch[3] = {1, 8, 32};
    int n = 0, n_probe = 0;
    for (uint64_t seed = 1; seed <= 80; seed++) {
        pal_anneal_options o = begin(&t, only_first, 3, 0, 1);
        o.first = first;
        o.seed = seed;
        o.n_start = 0;
        o.reanneal_generated = 50;
        o.max_evaluation = 1 + 4 * 53;
        double p[3], k[3] = {0, 0, 0};
        pal_anneal_result r;
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        REQUIRE(r.n_evaluation == 213);
        CHECK_INT(r.n_spent, 213); /* nothing accepted, nothing thrown away, nothing beyond the limit */
        CHECK_INT(r.n_accepted, 0);
        CHECK_INT(r.n_failed, 200);
        CHECK_NEAR(r.best, 3, 0);
        for (int g = 1; g < 213; g++) {
            if (t.kind[g] & 8) { /* three in a row, then the new temperatures */
                n_probe++;
                if ((g % 53) != 0) continue;
                const double c = -log(1e-5) * exp(-log(100) / 3);
                for (int i = 0; i < 3; i++) k[i] = pow(fmax(0, -log(exp(-c * cbrt(k[i])) * stretch[i]) / c), 3);
                continue;
            }
            for (int i = 0; i < 3; i++) {
                double temperature = pal_anneal_temperature_ratio(&o, k[i]), min = chance(-first[i], temperature);
                double y = t.trail_p[g][i] - first[i], max = chance(1 - first[i], temperature);
                u[i][n] = (chance(y, temperature) - min) / (max - min);
                k[i]++;
            }
            n++;
        }
    }
    CHECK_INT(n, 80 * 200);
    CHECK_INT(n_probe, 80 * 12);
    for (int i = 0; i < 3; i++) CHECK_LE(kolmogorov(u[i], n), 1.95);
}

/* T_acc after the given number of evaluations of a cost that sinks by 1 each time, from 1000 */
static double cooled(double cost_scale, const double *first, int reanneal_accepted, int64_t max)
{
    static task t;
    pal_anneal_options o = begin(&t, sinking, 2, -1, 1);
    o.n_batch = 1; /* this cost counts its calls */
    o.n_start = 10;
    o.first = first;
    o.cost_scale = cost_scale;
    o.reanneal_accepted = reanneal_accepted;
    o.max_evaluation = max;
    double p[2];
    pal_anneal_result r;
    if (pal_anneal(&o, p, &r, NULL)) return -1;
    CHECK_INT(r.n_accepted + 2 * r.n_reanneal, max - 10 - (first != NULL));
    CHECK_NEAR(r.best, 1001 - (double)max, 0);
    return r.temperature;
}

static void cools_the_acceptance_by_what_was_accepted(void)
{
    /* T0 = mean of 1000, 999, 998, 997, 996; c = 1.15129; k = 9: T0 exp(-3 c) */
    const double c = 1.1512925465, first[2] = {0, 0};
    CHECK_NEAR(cooled(1, NULL, 0, 19), 998 * exp(-3 * c), 1e-6);
    CHECK_NEAR(cooled(2, NULL, 0, 19), 998 * exp(-6 * c), 1e-6);
    CHECK_NEAR(cooled(1, first, 0, 20), 997 * exp(-3 * c), 1e-6); /* the first point is no sample */
    /* after five accepted, the last 986, two differences, the best 984: T0 = 986, T_acc as it was, its count from it */
    double k = pow(log(986 / (998 * exp(-sqrt(5) * c))) / c, 2);
    CHECK_NEAR(cooled(1, NULL, 5, 20), 986 * exp(-sqrt(k + 3) * c), 1e-6);
    /* colder than last - best = 2: T_acc = 2 */
    double cold = 998 * exp(-6 * sqrt(5) * c), from = pow(log(986 / fmax(2, cold)) / (6 * c), 2);
    CHECK(cold < 2);
    CHECK_NEAR(cooled(6, NULL, 5, 20), 986 * exp(-6 * sqrt(from + 3) * c), 1e-9);
}

/* two levels, 1 in the left half, 2 in the right one */
static double two_levels(task *t, const double *p)
{
    (void)t;
    return p[0] < 0 ? 1 : 2;
}

/* with T_acc = T0 held (cost_scale so small), a rise of 1 is accepted with exp(-1/T0) */
static void accepts_a_rise_as_often_as_metropolis(void)
{
    static task t;
    int energy_rose = 0, offered = 0;
    double wanted = 0;
    for (uint64_t seed = 0; seed < 200; seed++) {
        pal_anneal_options o = begin(&t, two_levels, 1, -1, 1);
        o.seed = seed;
        o.cost_scale = 1e-9;
        o.reanneal_accepted = 0;
        o.max_evaluation = 120; /* while jumps are large */
        double p[1], last = 1;
        pal_anneal_result r;
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        for (int g = 100; g < t.n_trail; g++) {
            if (t.trail[g] > last) {
                offered++;
                energy_rose += t.kind[g] & 1;
                wanted += exp(-1 / r.temperature);
            } else {
                CHECK_INT(t.kind[g] & 1, 1); /* not worse: always */
            }
            if (t.kind[g] & 1) last = t.trail[g];
        }
    }
    CHECK(offered > 500);
    CHECK_NEAR(energy_rose, wanted, 3.5 * sqrt(0.25 * offered));
}

static bool same_walk(const task *a, const task *b)
{
    size_t n = (size_t)a->n_trail;
    return a->n_trail == b->n_trail && n < TRAIL && !memcmp(a->trail, b->trail, n * sizeof a->trail[0]) &&
           !memcmp(a->trail_p, b->trail_p, n * sizeof a->trail_p[0]) && !memcmp(a->kind, b->kind, n);
}

static void walks_the_same_way_for_every_batch_and_team(void)
{
    static task alone, t;
    double (*const costs[3])(task *, const double *) = {rastrigin, half, corana};
    const int batches[] = {1, 2, 8, 64, 3, 8}, teams[] = {0, 0, 0, 0, 1, 3};
    for (int c = 0; c < 3; c++) {
        pal_anneal_result kept = {0};
        double wanted[4] = {0};
        for (int b = 0; b < 6; b++) {
            task *now = b ? &t : &alone;
            pal_anneal_options o = begin(now, costs[c], c == 1 ? 2 : 4, -5, 4);
            const double first[4] = {-4, 3, 2, 1};
            o.first = c == 0 ? first : NULL;
            o.seed = 11;
            o.n_batch = batches[b];
            o.reanneal_accepted = 30;
            o.reanneal_generated = 333;
            o.max_evaluation = 3000;
            double p[4];
            pal_anneal_result r;
            if (teams[b]) REQUIRE(pal_team_create(teams[b], &now->team) == PAL_ERR_OK);
            pal_err err = pal_anneal(&o, p, &r, NULL);
            pal_team_destroy(now->team);
            REQUIRE(err == PAL_ERR_OK);
            CHECK_INT(now->bad, 0);
            CHECK_INT(r.n_evaluation, 3000);
            CHECK_INT(now->n_trail, 3000);
            CHECK_LE(now->max_at_once, batches[b]);
            CHECK_INT(r.n_spent, now->seen);
            if (b == 0) {
                kept = r;
                memcpy(wanted, p, sizeof p);
                CHECK_INT(r.n_spent, 3000);
                CHECK(r.n_reanneal > 5);
                CHECK(r.n_accepted > 50);
                continue;
            }
            CHECK(r.n_spent > 3000);
            CHECK(same_walk(now, &alone));
            CHECK(memcmp(p, wanted, sizeof(double) * (size_t)now->n) == 0);
            CHECK(r.best == kept.best && r.temperature == kept.temperature);
            CHECK(r.n_accepted == kept.n_accepted && r.n_failed == kept.n_failed && r.n_reanneal == kept.n_reanneal);
        }
    }
}

static void knows_no_units(void)
{
    static task a, b;
    double p[2], q[2];
    pal_anneal_result r, s;
    pal_anneal_options o = begin(&a, rosenbrock, 2, -2, 2);
    o.max_evaluation = 1500;
    REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
    /* powers of two: to the last bit */
    o = begin(&b, rosenbrock, 2, -2 * 0x1p40, 2 * 0x1p40);
    b.scale = 0x1p40;
    o.max_evaluation = 1500;
    REQUIRE(pal_anneal(&o, q, &s, NULL) == PAL_ERR_OK);
    CHECK(memcmp(a.trail, b.trail, sizeof a.trail) == 0);
    CHECK(memcmp(a.kind, b.kind, sizeof a.kind) == 0);
    for (int i = 0; i < 2; i++) CHECK_NEAR(q[i] * 0x1p-40, p[i], 0);
    /* another seed is another walk */
    o = begin(&b, rosenbrock, 2, -2, 2);
    o.max_evaluation = 1500;
    o.seed = 1;
    REQUIRE(pal_anneal(&o, q, &s, NULL) == PAL_ERR_OK);
    CHECK(a.trail[0] != b.trail[0] && a.trail[1400] != b.trail[1400]);
}

/* the largest number of evaluations until the cost is `enough`, over eight seeds; -1: one did not get there */
static int64_t slowest(double (*cost)(task *, const double *), int n, double box, double min_temperature_ratio,
                       double enough, int64_t max)
{
    static task t;
    int64_t worst = 0;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        pal_anneal_options o = begin(&t, cost, n, -box, 0.9 * box); /* the minimum is not the middle */
        o.seed = seed;
        o.min_temperature_ratio = min_temperature_ratio;
        o.enough = enough;
        o.max_evaluation = max;
        double p[MAX];
        pal_anneal_result r;
        if (pal_anneal(&o, p, &r, NULL) || !(r.best <= enough)) {
            printf("  seed %d: %g after %d\n", (int)seed, r.best, (int)r.n_evaluation);
            return -1;
        }
        if (r.best != cost(&t, p)) return -2;
        if (r.n_evaluation > worst) worst = r.n_evaluation;
    }
    printf("  slowest of eight: %d\n", (int)worst);
    return worst;
}

static void finds_known_minima(void)
{
    int64_t n = slowest(rosenbrock, 2, 2.048, 1e-6, 1e-4, 15000);
    CHECK(n > 0);
    n = slowest(rastrigin, 4, 5.12, 1e-10, 1e-3, 8000);
    CHECK(n > 0);
    n = slowest(corana, 4, 10000, 1e-10, 0, 15000);
    CHECK(n > 0);
}

static void goes_around_points_without_a_value(void)
{
    static task t;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        pal_anneal_options o = begin(&t, half, 2, -2, 2);
        o.seed = seed;
        o.min_temperature_ratio = 1e-6;
        o.max_evaluation = 15000;
        double p[2];
        pal_anneal_result r;
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        CHECK_LE(r.best, 1e-2);
        int failed = 0, bad = 0;
        for (int g = 0; g < t.n_trail; g++) {
            failed += t.trail[g] == DBL_MAX;
            bad += t.trail[g] == DBL_MAX && (t.kind[g] & 3); /* never accepted, never the best */
        }
        CHECK_INT(failed, r.n_failed);
        CHECK(failed > 50);
        CHECK_INT(bad, 0);
        CHECK(isfinite(r.temperature) && r.temperature > 0 && r.temperature < 1e5); /* no DBL_MAX in a mean */
    }
}

/* a value in one part in 2500 of the box */
static double rare(task *t, const double *p)
{
    (void)t;
    return p[0] > 0.96 && p[1] > 0.96 ? 2 - p[0] - p[1] : NAN;
}

static void samples_on_until_a_point_has_a_value(void)
{
    static task t, alone;
    double p[2];
    pal_anneal_result r;
    for (int b = 1; b <= 64; b *= 8) {
        task *now = b == 1 ? &alone : &t;
        pal_anneal_options o = begin(now, rare, 2, -1, 1);
        o.seed = 5;
        o.n_batch = b;
        o.stall = 300;
        o.max_evaluation = 100;
        CHECK_INT(pal_anneal(&o, p, &r, NULL), PAL_ERR_NUMERIC); /* the samples have none */
        CHECK_INT(r.n_evaluation, 100);
        o.stall = 0;
        o.max_evaluation = TRAIL - 1;
        begin(now, rare, 2, -1, 1);
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        CHECK_LE(r.best, 1e-6);
        int first = 0;
        while (first < now->n_trail && now->trail[first] == DBL_MAX) first++;
        CHECK(first >= 100);
        CHECK_INT(now->kind[first], 4 + 2);
        CHECK_INT(now->kind[first + 1] & 4, 0); /* and the walk begins */
        if (b > 1) CHECK(same_walk(now, &alone));
    }
}

static void says_so_when_no_point_has_a_value(void)
{
    static task t;
    pal_anneal_options o = begin(&t, no_value, 2, -1, 1);
    o.max_evaluation = 777;
    double p[2] = {9, 9};
    pal_anneal_result r;
    pal_diagnostic diag;
    CHECK_INT(pal_anneal(&o, p, &r, &diag), PAL_ERR_NUMERIC);
    CHECK_TEXT(diag.text, "annealing: none of 777 points had a value");
    CHECK(r.n_evaluation == 777 && r.n_failed == 777);
    CHECK_INT(r.n_spent, 777); /* a batch ends with the limit */
    CHECK_NEAR(r.best, DBL_MAX, 0);
    CHECK(p[0] == 0 && p[1] == 0); /* the middle */
    o.max_evaluation = 0;
    o.stall = 250;
    CHECK_INT(pal_anneal(&o, p, &r, &diag), PAL_ERR_NUMERIC);
    CHECK_INT(r.n_evaluation, 250);
    o.stall = 0;
    begin(&t, no_value, 2, -1, 1);
    t.stop_at = 130;
    CHECK_INT(pal_anneal(&o, p, &r, &diag), PAL_ERR_NUMERIC);
    CHECK_INT(r.n_evaluation, 130);
}

static void is_never_worse_than_the_first_point(void)
{
    static task t;
    for (int n = 1; n < 400; n += 7) {
        pal_anneal_options o = begin(&t, rosenbrock, 2, -2, 2);
        const double first[2] = {0.9, 0.8};
        o.first = first;
        o.seed = (uint64_t)n;
        o.max_evaluation = n;
        double p[2];
        pal_anneal_result r;
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        CHECK(t.trail_p[0][0] == 0.9 && t.trail_p[0][1] == 0.8 && t.kind[0] == 4 + 2);
        CHECK_LE(r.best, rosenbrock(&t, first));
        CHECK_NEAR(rosenbrock(&t, p), r.best, 0);
        for (int g = 0; g < t.n_trail; g++) CHECK_LE(r.best, t.trail[g]);
        CHECK_NEAR(t.trail_best[t.n_trail - 1], r.best, 0);
    }
    /* a corner is a point of the box, and every candidate stays in it */
    pal_anneal_options o = begin(&t, rosenbrock, 2, -2, 2);
    const double corner[2] = {-2, 2};
    o.first = corner;
    o.n_start = 0;
    o.max_evaluation = 2000;
    double p[2];
    pal_anneal_result r;
    REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
    int out = 0;
    for (int g = 0; g < t.n_trail; g++)
        for (int i = 0; i < 2; i++) out += !(t.trail_p[g][i] >= -2 && t.trail_p[g][i] <= 2);
    CHECK_INT(out, 0);
    CHECK_LE(r.best, 1); /* from 409 */
}

static void keeps_the_best_when_it_is_ended(void)
{
    static task t;
    double p[2];
    pal_anneal_result r;
    pal_anneal_options o = begin(&t, rosenbrock, 2, -2, 2);
    t.stop_at = 321; /* by the caller, with no other end */
    REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
    CHECK_INT(r.n_evaluation, 321);
    CHECK_NEAR(rosenbrock(&t, p), r.best, 0);
    double best = DBL_MAX;
    for (int g = 0; g < 321; g++) best = fmin(best, t.trail[g]);
    CHECK_NEAR(r.best, best, 0);
    /* by an error of evaluate */
    o = begin(&t, rosenbrock, 2, -2, 2);
    t.fail_at = 500;
    CHECK_INT(pal_anneal(&o, p, &r, NULL), PAL_ERR_FROZEN);
    CHECK(r.n_evaluation > 100 && r.n_evaluation < 500);
    CHECK_NEAR(rosenbrock(&t, p), r.best, 0);
    /* by a stall, counted from the last sample */
    o = begin(&t, two_levels, 1, -1, 1);
    o.stall = 40;
    REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
    CHECK_INT(r.n_evaluation, 140);
    CHECK_NEAR(r.best, 1, 0);
    /* by what is enough */
    o = begin(&t, two_levels, 1, -1, 1);
    o.enough = 1;
    REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
    CHECK(r.n_evaluation < 20 && r.best == 1);
}

static double extreme(task *t, const double *p)
{
    (void)t;
    return p[0] < -0.5 ? -1.7e308 : p[0] < 0 ? 1.7e308 : p[0] < 0.5 ? 0 : 5e-324;
}

static void survives_extreme_costs(void)
{
    static task t;
    for (int n_temperature_sample = 1; n_temperature_sample <= 100; n_temperature_sample += 33) {
        pal_anneal_options o = begin(&t, extreme, 3, -1, 1);
        o.n_temperature_sample = n_temperature_sample;
        o.reanneal_generated = 20;
        o.max_evaluation = 3000;
        double p[3];
        pal_anneal_result r;
        REQUIRE(pal_anneal(&o, p, &r, NULL) == PAL_ERR_OK);
        CHECK_NEAR(r.best, -1.7e308, 0);
        CHECK(isfinite(r.temperature));
        int bad = 0;
        for (int g = 0; g < t.n_trail; g++)
            for (int i = 0; i < 3; i++) bad += !(t.trail_p[g][i] >= -1 && t.trail_p[g][i] <= 1);
        CHECK_INT(bad, 0);
    }
}

/* refused with a sentence that has these words, and nothing was evaluated */
static void check_refused(task *t, const pal_anneal_options *o, const char *words)
{
    double p[2] = {7, 7};
    pal_anneal_result r;
    pal_diagnostic diag = {""};
    t->seen = 0;
    CHECK_INT(pal_anneal(o, p, &r, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, words)) CHECK_TEXT(diag.text, words);
    CHECK(p[0] == 7 && t->seen == 0 && r.n_spent == 0 && r.best == DBL_MAX);
    CHECK_INT(pal_anneal(o, p, &r, NULL), PAL_ERR_REFUSED);
}

static void refuses_what_is_no_box(void)
{
    static task t;
    pal_anneal_options good = begin(&t, rosenbrock, 2, -2, 2), o = good;
    const double outside[2] = {0, 2.5}, lost[2] = {NAN, 0};
    const double ends[][2] = {{2, 2}, {2, -2}, {0, NAN}, {NAN, 0}, {0, INFINITY}, {-INFINITY, 0}, {-1e308, 1e308}};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        low[1] = ends[i][0], high[1] = ends[i][1];
        check_refused(&t, &good, "parameter 1 lies between");
    }
    low[1] = -2, high[1] = 2;
    o.first = outside;
    check_refused(&t, &o, "parameter 1 begins at 2.5, outside of -2 to 2");
    o.first = lost;
    check_refused(&t, &o, "parameter 0 begins at");
    o = good, o.n_parameter = 0;
    check_refused(&t, &o, "0 parameters");
    o = good, o.low = NULL;
    check_refused(&t, &o, "parameters");
}

static void refuses_numbers_out_of_range(void)
{
    static task t;
    pal_anneal_options good = begin(&t, rosenbrock, 2, -2, 2), o;
    o = good, o.n_start = -1;
    check_refused(&t, &o, "n_start -1");
    o = good, o.n_temperature_sample = 0;
    check_refused(&t, &o, "n_temper 0");
    o = good, o.n_batch = 0;
    check_refused(&t, &o, "n_batch 0");
    o = good, o.n_batch = PAL_ANNEAL_MAX_BATCH + 1;
    check_refused(&t, &o, "at most 4096");
    const double bad[4] = {0, -1, NAN, INFINITY};
    for (int i = 0; i < 4; i++) {
        o = good, o.ratio_scale = bad[i];
        check_refused(&t, &o, "ratio_scale");
        o = good, o.anneal_scale = bad[i];
        check_refused(&t, &o, "anneal_scale");
        o = good, o.cost_scale = bad[i];
        check_refused(&t, &o, "cost_scale");
        o = good, o.difference = bad[i];
        check_refused(&t, &o, "difference");
    }
    o = good, o.min_temperature_ratio = 0;
    check_refused(&t, &o, "coldest 0");
    o = good, o.min_temperature_ratio = 1;
    check_refused(&t, &o, "coldest 1");
    o = good, o.ratio_scale = 1;
    check_refused(&t, &o, "ratio_scale 1");
    o = good, o.enough = NAN;
    check_refused(&t, &o, "enough");
    o = good, o.evaluate = NULL;
    check_refused(&t, &o, "evaluate");
    o = good, o.step = NULL;
    check_refused(&t, &o, "no end");
}

int main(void)
{
    RUN(temperature_follows_ingbers_schedule);
    RUN(draws_from_ingbers_distribution);
    RUN(cools_by_candidate_and_is_stretched_by_sensitivity);
    RUN(cools_the_acceptance_by_what_was_accepted);
    RUN(accepts_a_rise_as_often_as_metropolis);
    RUN(walks_the_same_way_for_every_batch_and_team);
    RUN(knows_no_units);
    RUN(finds_known_minima);
    RUN(goes_around_points_without_a_value);
    RUN(samples_on_until_a_point_has_a_value);
    RUN(says_so_when_no_point_has_a_value);
    RUN(is_never_worse_than_the_first_point);
    RUN(keeps_the_best_when_it_is_ended);
    RUN(survives_extreme_costs);
    RUN(refuses_what_is_no_box);
    RUN(refuses_numbers_out_of_range);
    return check_report();
}
