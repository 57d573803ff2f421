/* Component tet_elastic: both elements, all laws. */
#include "tests/fixtures/elastic_bench.h"

static const char *const laws[] = {"corotational", "linear", "neo_hookean"};

#define EACH_KIND(ten, law)                                                                                            \
    for (int ten = 0; ten < 2; ten++)                                                                                  \
        for (int law = 0; law < 3; law++)

static bool open_box(elastic_bench *b, int nx, int ny, int nz, double off, int ten, int law, bool recover)
{
    pal_prepared box;
    elastic_seed = 7;
    return !elastic_box(nx, ny, nz, 0.01, off, &box) && elastic_open(b, &box, ten, laws[law], recover);
}

/* E h^2 */
static double scale_N(const elastic_bench *b)
{
    return b->scene->body[0].material.young_Pa * b->body.edge_m * b->body.edge_m;
}

static void is_silent_at_rest(void)
{
    EACH_KIND(ten, law)
    {
        elastic_bench b;
        REQUIRE(open_box(&b, 4, 3, 3, 0.2, ten, law, true));
        elastic_force(&b);
        CHECK_LE(elastic_max(b.body.f, 3 * b.n), 1e-13 * scale_N(&b));
        CHECK_LE(fabs(elastic_energy(&b)), 1e-20 * scale_N(&b) * b.body.edge_m);
        elastic_close(&b);
    }
}

/* in the direction p at the present place */
static double energy_slope(elastic_bench *b, const double *p, double step)
{
    double *keep = malloc(3 * sizeof *keep * (size_t)b->n), e[4];
    memcpy(keep, b->body.x, 3 * sizeof *keep * (size_t)b->n);
    static const double at[4] = {-2, -1, 1, 2};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 3 * b->n; i++) b->body.x[i] = keep[i] + at[k] * step * p[i];
        e[k] = elastic_energy(b);
    }
    memcpy(b->body.x, keep, 3 * sizeof *keep * (size_t)b->n);
    free(keep);
    return (8 * (e[2] - e[1]) - (e[3] - e[0])) / (12 * step);
}

static void force_is_the_gradient_of_the_energy(void)
{
    static const double amount[] = {0.02, 0.3, 1};
    EACH_KIND(ten, law)
    for (int turn = 0; turn < 3; turn++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 2, 2, 0.1, ten, law, false));
        double r[9];
        elastic_turn((double[3]){1, 2, 3}, 0.7, r);
        elastic_place(&b, r, 0.003);
        elastic_shake(&b, amount[turn]);
        double *p = malloc(3 * sizeof *p * (size_t)b.n);
        elastic_force(&b);
        if (turn == 2) CHECK(b.tets->n_inverted > 0);
        /* every node by itself, so that no error hides behind another's size */
        double max = elastic_max(b.body.f, 3 * b.n);
        double *f = malloc(3 * sizeof *f * (size_t)b.n);
        memcpy(f, b.body.f, 3 * sizeof *f * (size_t)b.n);
        for (int i = 0; i < 3 * b.n; i += 7) {
            memset(p, 0, 3 * sizeof *p * (size_t)b.n);
            p[i] = 1;
            CHECK_NEAR(-energy_slope(&b, p, 2e-4 * b.body.edge_m), f[i], 1e-6 * max);
        }
        free(f);
        free(p);
        elastic_close(&b);
    }
}

/* net force always; net torque for laws that do not mind rotation */
static void has_no_net_force_or_torque(void)
{
    static const double amount[] = {0.1, 0.5, 3};
    EACH_KIND(ten, law)
    for (int turn = 0; turn < 6; turn++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 4, 3, 3, 0, ten, law, turn >= 3));
        elastic_shake(&b, amount[turn % 3]);
        elastic_force(&b);
        double force[3] = {0}, torque[3] = {0}, sum = 0, arms = 0;
        for (int i = 0; i < b.n; i++) {
            double t[3];
            pal_cross3(t, b.body.x + 3 * i, b.body.f + 3 * i);
            pal_add3(force, force, b.body.f + 3 * i);
            pal_add3(torque, torque, t);
            sum += pal_norm3(b.body.f + 3 * i), arms += pal_norm3(t);
        }
        CHECK(sum > 0);
        CHECK_LE(pal_norm3(force), 1e-13 * sum);
        if (law == 1)
            CHECK(pal_norm3(torque) > 1e-6 * arms);
        else
            CHECK_LE(pal_norm3(torque), 1e-12 * arms);
        elastic_close(&b);
    }
}

static void multiply_is_the_assembled_matrix(void)
{
    EACH_KIND(ten, law)
    for (int off = 0; off < 2; off++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 4, 3, 2, 0.2 * off, ten, law, true));
        elastic_shake(&b, 0.4);
        const pal_tangent *t = b.row.effect->tangent;
        pal_cliques cliques;
        pal_block_matrix k;
        REQUIRE(t->couple(b.row.self, &cliques));
        REQUIRE(pal_block_matrix_make(b.n, &cliques, 1, b.arena, &k) == 0);
        t->linearise(b.row.self, &b.body);
        t->assemble(b.row.self, 2, &k);
        size_t n = 3 * (size_t)b.n;
        double *p = malloc(n * sizeof *p), *one = calloc(n, sizeof *one), *two = calloc(n, sizeof *two), pkp = 0;
        for (size_t i = 0; i < n; i++) p[i] = uniform();
        t->multiply(b.row.self, &b.body, 2, p, one);
        pal_block_matrix_multiply(&k, 1, p, two);
        double max = elastic_max(two, (int)n);
        CHECK(max > 0);
        for (size_t i = 0; i < n; i++) {
            CHECK_NEAR(one[i], two[i], 1e-12 * max);
            pkp += p[i] * one[i];
        }
        CHECK(pkp > 0);
        free(p), free(one), free(two);
        elastic_close(&b);
    }
}

static void multiply_rows(elastic_bench *b, const double *p, double *out)
{
    memset(out, 0, 3 * sizeof *out * (size_t)b->n);
    b->row.effect->tangent->multiply(b->row.self, &b->body, 1, p, out);
}

/* -df/dx along p by differences */
static void force_slope(elastic_bench *b, const double *p, double step, double *out)
{
    size_t n = 3 * (size_t)b->n;
    double *keep = malloc(n * sizeof *keep);
    memcpy(keep, b->body.x, n * sizeof *keep);
    memset(out, 0, n * sizeof *out);
    for (int s = -1; s <= 1; s += 2) {
        for (size_t i = 0; i < n; i++) b->body.x[i] = keep[i] + s * step * p[i];
        elastic_force(b);
        for (size_t i = 0; i < n; i++) out[i] -= s * b->body.f[i] / (2 * step);
    }
    memcpy(b->body.x, keep, n * sizeof *keep);
    free(keep);
}

/* where nothing is dropped or projected: corotational at rest, turned; neo-Hookean blown up by 5 %; linear anywhere */
static void tangent_is_the_slope_of_the_force(void)
{
    EACH_KIND(ten, law)
    {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 2, 2, 0.1, ten, law, true));
        double r[9];
        elastic_turn((double[3]){3, -1, 2}, 2.1, r);
        for (int i = 0; i < 9 && law == 2; i++) r[i] *= 1.05;
        elastic_place(&b, r, 0.01);
        if (law > 0) elastic_shake(&b, 1e-3);
        size_t n = 3 * (size_t)b.n;
        double *p = malloc(n * sizeof *p), *one = malloc(n * sizeof *one), *two = malloc(n * sizeof *two);
        for (size_t i = 0; i < n; i++) p[i] = uniform();
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        multiply_rows(&b, p, one);
        force_slope(&b, p, 1e-5 * b.body.edge_m, two);
        double max = elastic_max(two, (int)n);
        CHECK(max > 0);
        for (size_t i = 0; i < n; i++) CHECK_NEAR(one[i], two[i], 1e-6 * max);
        free(p), free(one), free(two);
        elastic_close(&b);
    }
}

/* corotational: K of a stretched and turned body is R K R' */
static void corotational_tangent_is_the_turned_one(void)
{
    for (int ten = 0; ten < 2; ten++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 2, 2, 0.1, ten, 0, true));
        double r[9], rs[9];
        const double s[9] = {1.3, 0.1, 0, 0.1, 0.8, -0.1, 0, -0.1, 1.1};
        elastic_turn((double[3]){1, 1, -2}, 2.5, r);
        for (int i = 0; i < 9; i++)
            rs[i] = r[3 * (i / 3)] * s[i % 3] + r[3 * (i / 3) + 1] * s[3 + i % 3] + r[3 * (i / 3) + 2] * s[6 + i % 3];
        size_t n = 3 * (size_t)b.n;
        double *p = malloc(n * sizeof *p), *back = malloc(n * sizeof *back), *one = malloc(n * sizeof *one),
               *two = malloc(n * sizeof *two);
        for (size_t i = 0; i < n; i++) p[i] = uniform();
        for (int i = 0; i < b.n; i++) pal_tmul33(back + 3 * i, r, p + 3 * i);
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        multiply_rows(&b, back, two);
        elastic_place(&b, rs, 0);
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        multiply_rows(&b, p, one);
        double max = elastic_max(two, (int)n);
        for (int i = 0; i < b.n; i++) {
            pal_mul33(back + 3 * i, r, two + 3 * i);
            for (int c = 0; c < 3; c++) CHECK_NEAR(one[3 * i + c], back[3 * i + c], 1e-9 * max);
        }
        /* rotations around nodes: all R */
        double *turn = calloc(9 * (size_t)b.n, sizeof *turn);
        b.row.effect->tangent->rotate(b.row.self, &b.body, turn);
        for (int i = 0; i < b.n; i++) {
            double length = 0;
            for (int k = 0; k < 9; k++) length += turn[9 * i + k] * turn[9 * i + k] / 3;
            for (int k = 0; k < 9; k++) CHECK_NEAR(turn[9 * i + k] / sqrt(length), r[k], 1e-9);
        }
        free(p), free(back), free(one), free(two), free(turn);
        elastic_close(&b);
    }
}

static bool inside(const elastic_bench *b, int i, const int n[3])
{
    for (int c = 0; c < 3; c++) {
        double g = b->body.x_rest[3 * i + c] / b->body.edge_m;
        if (!(g > 1e-6 && g < n[c] - 1e-6)) return false;
    }
    return true;
}

/* border nodes follow a linear field, the others are solved for by conjugate gradients: they follow it too */
static void patch_test_is_exact(void)
{
    static const int n[3] = {4, 3, 3};
    const double a[9] = {0.03, 0.02, -0.01, 0.04, -0.02, 0.03, 0.01, -0.05, 0.02};
    EACH_KIND(ten, law)
    {
        pal_prepared box;
        elastic_bench b;
        elastic_seed = 7;
        REQUIRE(box_make(n[0], n[1], n[2], 0.01, &box) == 0);
        for (int i = 0; i < box.tets.n_node; i++)
            for (int c = 0; c < 3; c++)
                if (!box.tets.on_surface[i]) box.tets.x[3 * i + c] += 0.002 * uniform();
        REQUIRE(elastic_open(&b, &box, ten, laws[law], true));
        double f[9];
        for (int i = 0; i < 9; i++) f[i] = a[i] + (i % 4 == 0);
        elastic_place(&b, f, 0);
        /* the field itself is in balance */
        elastic_force(&b);
        double max = elastic_max(b.body.f, 3 * b.n);
        int n_free = 0;
        for (int i = 0; i < b.n; i++)
            for (int c = 0; c < 3 && inside(&b, i, n); c++, n_free++) CHECK_LE(fabs(b.body.f[3 * i + c]), 1e-9 * max);
        CHECK(n_free > 3 * 12 - 1);
        /* Newton from a start that is off, each step by conjugate gradients */
        for (int i = 0; i < b.n; i++)
            for (int c = 0; c < 3 && inside(&b, i, n); c++) b.body.x[3 * i + c] += 1e-4 * uniform();
        size_t m = 3 * (size_t)b.n;
        double *u = calloc(m, sizeof *u), *g = calloc(m, sizeof *g), *p = calloc(m, sizeof *p),
               *q = calloc(m, sizeof *q);
        for (int newton = 0; newton < 40; newton++) {
            elastic_force(&b);
            b.row.effect->tangent->linearise(b.row.self, &b.body);
            double rho = 0, first;
            for (int i = 0; i < b.n; i++)
                for (int c = 0; c < 3; c++) {
                    size_t k = 3 * (size_t)i + (size_t)c;
                    g[k] = p[k] = inside(&b, i, n) ? b.body.f[k] : 0;
                    u[k] = 0, rho += g[k] * g[k];
                }
            if (rho < 1e-30 * max * max) break;
            first = rho;
            for (int k = 0; k < 600 && rho > 1e-24 * first; k++) {
                double pq = 0, last = rho;
                multiply_rows(&b, p, q);
                for (size_t i = 0; i < m; i++) q[i] *= inside(&b, (int)(i / 3), n), pq += p[i] * q[i];
                rho = 0;
                for (size_t i = 0; i < m; i++) u[i] += last / pq * p[i], g[i] -= last / pq * q[i], rho += g[i] * g[i];
                for (size_t i = 0; i < m; i++) p[i] = g[i] + rho / last * p[i];
            }
            for (size_t i = 0; i < m; i++) b.body.x[i] += u[i];
        }
        for (int i = 0; i < b.n; i++) {
            double want[3];
            pal_mul33(want, f, b.body.x_rest + 3 * i);
            CHECK_LE(pal_dist3(want, b.body.x + 3 * i), 1e-9 * 0.05 * 0.04);
        }
        free(u), free(g), free(p), free(q);
        elastic_close(&b);
    }
}

/* a bar pulled along x: E A e on the end, nothing across, von Mises E e, energy E e^2 / 2 */
static void uniaxial_strain_has_the_moduli(void)
{
    EACH_KIND(ten, law)
    {
        elastic_bench b;
        REQUIRE(open_box(&b, 4, 2, 2, 0, ten, law, true));
        double e = 1e-7, young = b.scene->body[0].material.young_Pa, nu = b.scene->body[0].material.poisson;
        const double f[9] = {1 + e, 0, 0, 0, 1 - nu * e, 0, 0, 0, 1 - nu * e};
        elastic_place(&b, f, 0);
        elastic_force(&b);
        double pull = 0, side = 0, area = 4 * b.body.edge_m * b.body.edge_m;
        for (int i = 0; i < b.n; i++) {
            if (b.body.x_rest[3 * i] > 3.999 * b.body.edge_m) pull -= b.body.f[3 * i];
            side = fmax(side, fmax(fabs(b.body.f[3 * i + 1]), fabs(b.body.f[3 * i + 2])));
        }
        CHECK_NEAR(pull / (young * e * area), 1, 1e-6);
        CHECK_LE(side, 1e-6 * young * e * area);
        CHECK_NEAR(elastic_energy(&b) / (0.5 * young * e * e * area * 4 * b.body.edge_m), 1, 1e-6);
        for (int field = PAL_FIELD_VON_MISES_PA; field <= PAL_FIELD_ENERGY_J_M3; field++) {
            double *sum = calloc(2 * (size_t)b.n, sizeof *sum), volume = 0;
            b.row.effect->inspect.measure(b.row.self, &b.body, (pal_field)field, sum, sum + b.n);
            for (int i = 0; i < b.n; i++) {
                CHECK_NEAR(sum[i] / sum[b.n + i] / (field == PAL_FIELD_VON_MISES_PA ? young * e : 0.5 * young * e * e),
                           1, 1e-6);
                volume += sum[b.n + i];
            }
            CHECK_NEAR(volume / elastic_volume(&b), 1, 1e-12);
            free(sum);
        }
        elastic_close(&b);
    }
}

/* in steps of about a fifth of a turn, no power of two, so that no error repeats itself */
static void ten_thousand_turns_leave_no_energy(void)
{
    for (int ten = 0; ten < 2; ten++)
        for (int law = 0; law < 3; law += 2) {
            /* the neo-Hookean law keeps nothing from step to step */
            elastic_bench b;
            REQUIRE(open_box(&b, 1, 1, 1, 0, ten, law, true));
            double one_percent = 0.5 * b.scene->body[0].material.young_Pa * 1e-4 * elastic_volume(&b), max = 0;
            const int n_step = law || ten ? 10007 : 53000;
            for (int k = 1; k <= n_step; k++) {
                double r[9], turns = law || ten ? 2000 : 10000;
                elastic_turn((double[3]){1, 2, 3}, 2 * M_PI * turns / n_step * k, r);
                elastic_place(&b, r, 0);
                elastic_force(&b);
                if (k % 100 == 0) max = fmax(max, fabs(elastic_energy(&b)));
            }
            CHECK_LE(max, 1e-6 * one_percent);
            CHECK_LE(elastic_max(b.body.f, 3 * b.n), 1e-9 * scale_N(&b));
            elastic_close(&b);
        }
}

/* as far as one step can: half a turn, any axis */
static void a_sudden_half_turn_is_found(void)
{
    for (int ten = 0; ten < 2; ten++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 2, 2, 2, 0, ten, 0, true));
        for (int k = 0; k < 20; k++) {
            double r[9];
            const double axis[3] = {uniform(), uniform(), uniform()};
            elastic_turn(axis, M_PI, r);
            elastic_place(&b, r, 0.1);
            elastic_force(&b);
            CHECK_LE(elastic_max(b.body.f, 3 * b.n), 1e-9 * scale_N(&b));
            b.row.effect->reset(b.row.self, &b.body);
        }
        elastic_close(&b);
    }
}

/* the largest eigenvalue of bound^-1 K by power iteration is at most 1, at rest and deformed */
static void stiffness_bounds_the_tangent(void)
{
    EACH_KIND(ten, law)
    for (int turn = 0; turn < 2; turn++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 3, 2, 0, ten, law, true));
        if (turn) elastic_shake(&b, 0.3);
        size_t n = 3 * (size_t)b.n;
        double *bound = calloc(n, sizeof *bound), *p = malloc(n * sizeof *p), *q = malloc(n * sizeof *q), value = 0;
        b.row.effect->bounds.stiffness(b.row.self, &b.body, bound);
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        for (size_t i = 0; i < n; i++) p[i] = uniform();
        for (int k = 0; k < 100; k++) {
            double up = 0, down = 0;
            multiply_rows(&b, p, q);
            for (size_t i = 0; i < n; i++) up += p[i] * q[i], down += p[i] * p[i] * bound[i / 3];
            value = up / down;
            double max = 0;
            for (size_t i = 0; i < n; i++) p[i] = q[i] / bound[i / 3], max = fmax(max, fabs(p[i]));
            for (size_t i = 0; i < n; i++) p[i] /= max;
        }
        CHECK_LE(value, 1);
        CHECK(value > 0.05);
        free(bound), free(p), free(q);
        elastic_close(&b);
    }
}

static void other_constants_are_those_of_a_component_made_with_them(void)
{
    EACH_KIND(ten, law)
    {
        elastic_bench b, c;
        REQUIRE(open_box(&b, 3, 2, 2, 0, ten, law, true) && open_box(&c, 3, 2, 2, 0, ten, law, true));
        pal_material to = b.scene->body[0].material;
        to.young_Pa = 12345, to.poisson = 0.31;
        elastic_shake(&b, 0.2);
        memcpy(c.body.x, b.body.x, 3 * sizeof(double) * (size_t)b.n);
        CHECK_INT(b.row.effect->material(b.row.self, &b.body, &to, NULL), 0);
        CHECK_INT(c.row.effect->material(c.row.self, &c.body, &to, NULL), 0);
        elastic_force(&b);
        double *f = malloc(3 * sizeof *f * (size_t)b.n);
        memcpy(f, b.body.f, 3 * sizeof *f * (size_t)b.n);
        /* half as stiff: half the force */
        to.young_Pa /= 2;
        CHECK_INT(c.row.effect->material(c.row.self, &c.body, &to, NULL), 0);
        elastic_force(&c);
        double max = elastic_max(f, 3 * b.n);
        for (int i = 0; i < 3 * b.n; i++) CHECK_NEAR(c.body.f[i], 0.5 * f[i], 1e-12 * max);
        free(f);
        elastic_close(&b);
        elastic_close(&c);
    }
}

/* down the force, with recovery at work where the body has it */
static void go_down(elastic_bench *b, int n_step)
{
    double *bound = calloc((size_t)b->n, sizeof *bound);
    pal_step step = {.body = &b->body, .force = &b->row, .n_force = 1, .dt_s = 1e-3};
    b->row.effect->bounds.stiffness(b->row.self, &b->body, bound);
    for (int k = 0; k < n_step; k++) {
        step.time_s += step.dt_s;
        (void)b->row.effect->recovery.recover(b->row.self, &step);
        elastic_force(b);
        for (int i = 0; i < 3 * b->n; i++) b->body.x[i] += b->body.f[i] / bound[i / 3];
    }
    free(bound);
}

/* a tetrahedron pushed through its base relaxes along the forces; recovery changes nothing while nothing is inverted */
static void an_inverted_tetrahedron_turns_back(void)
{
    elastic_bench b, plain;
    REQUIRE(open_box(&b, 3, 3, 3, 0, 0, 0, true) && open_box(&plain, 3, 3, 3, 0, 0, 0, false));
    size_t n_byte = 3 * sizeof(double) * (size_t)b.n;
    elastic_shake(&b, 0.05);
    memcpy(plain.body.x, b.body.x, n_byte);
    elastic_force(&b);
    elastic_force(&plain);
    CHECK_INT(b.tets->n_inverted, 0);
    CHECK_INT(memcmp(b.body.f, plain.body.f, n_byte), 0);
    /* the whole body turned, its corner node pushed in by two edges */
    double r[9];
    elastic_turn((double[3]){0, 1, 2}, 1, r);
    elastic_place(&b, r, 0);
    double in[3] = {0.02, 0.02, 0.02};
    pal_mul33(in, r, in);
    pal_add3(b.body.x, b.body.x, in);
    go_down(&b, 1);
    CHECK(b.tets->n_inverted > 0 || pal_recovery_acts(b.tets->recovery));
    go_down(&b, 4000);
    CHECK_INT(b.tets->n_inverted, 0);
    CHECK(!pal_recovery_acts(b.tets->recovery));
    CHECK_LE(elastic_energy(&b), 1e-8 * scale_N(&b) * b.body.edge_m);
    elastic_close(&b);
    elastic_close(&plain);
}

/* every node of a free body anywhere in its box: down the forces it comes to rest whole with recovery, and sticks with
 * each inverted element's own rotation */
static void shuffled_bodies_recover(void)
{
    for (int rule = 0; rule < 2; rule++) {
        int n_whole = 0, n_seed = 6;
        for (int seed = 0; seed < n_seed; seed++) {
            elastic_bench b;
            REQUIRE(open_box(&b, 3, 2, 2, 0, 0, 0, rule));
            elastic_seed = 1000 + (uint64_t)seed;
            for (int i = 0; i < 300; i++) uniform();
            for (int i = 0; i < 3 * b.n; i++) b.body.x[i] = (0.5 + 0.5 * uniform()) * (i % 3 == 0 ? 0.03 : 0.02);
            go_down(&b, 4000);
            elastic_force(&b);
            n_whole += b.tets->n_inverted == 0 && !pal_recovery_acts(b.tets->recovery) &&
                       elastic_energy(&b) < 1e-6 * scale_N(&b) * b.body.edge_m;
            elastic_close(&b);
        }
        printf("  %s recovery: %d of %d whole\n", rule ? "with" : "without", n_whole, n_seed);
        if (rule)
            CHECK_INT(n_whole, n_seed);
        else
            CHECK_LE(n_whole, n_seed / 2);
    }
}

/* all nodes in a plane, on a line, in a point, mirrored: finite forces that end */
static void collapsed_bodies_have_finite_forces(void)
{
    static const double shape[4][9] = {
        {1, 0, 0, 0, 1, 0, 0, 0, 0}, {1, 0, 0, 0, 0, 0, 0, 0, 0}, {0}, {1, 0, 0, 0, 1, 0, 0, 0, -1}};
    EACH_KIND(ten, law)
    for (int k = 0; k < 4; k++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 2, 2, 0, ten, law, true));
        elastic_place(&b, shape[k], 0);
        elastic_force(&b);
        CHECK(isfinite(elastic_max(b.body.f, 3 * b.n)));
        CHECK(elastic_energy(&b) > 0);
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        double *p = malloc(3 * sizeof *p * (size_t)b.n), *q = malloc(3 * sizeof *q * (size_t)b.n), pq = 0;
        for (int i = 0; i < 3 * b.n; i++) p[i] = uniform();
        multiply_rows(&b, p, q);
        for (int i = 0; i < 3 * b.n; i++) pq += p[i] * q[i];
        CHECK(pq > 0 && isfinite(pq));
        free(p), free(q);
        elastic_close(&b);
    }
}

static void slivers_and_flat_tetrahedra_do_no_harm(void)
{
    EACH_KIND(ten, law)
    for (int k = 0; k < 2; k++) {
        pal_prepared box;
        elastic_bench b;
        REQUIRE(box_one_tet(0.01, &box) == 0);
        /* a height of 1e-4 of the edge: kept; none at all: left out */
        box.tets.x[3 * 3 + 2] *= k ? 0 : 1e-4;
        REQUIRE(elastic_open(&b, &box, ten, laws[law], true));
        elastic_shake(&b, 0.1);
        elastic_force(&b);
        double max = elastic_max(b.body.f, 3 * b.n);
        CHECK(k ? max == 0 : max > 0 && isfinite(max));
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        elastic_close(&b);
    }
}

/* one node that is no number: the call ends, and once the node is back nothing is left of it */
static void a_nan_ends_and_leaves_nothing(void)
{
    EACH_KIND(ten, law)
    for (int k = 0; k < 3; k++) {
        elastic_bench b;
        REQUIRE(open_box(&b, 3, 2, 2, 0, ten, law, true));
        elastic_shake(&b, 0.1);
        double keep = b.body.x[10];
        b.body.x[10] = k == 0 ? NAN : k == 1 ? INFINITY : 1e300;
        elastic_force(&b);
        elastic_energy(&b);
        b.row.effect->tangent->linearise(b.row.self, &b.body);
        CHECK(!isfinite(elastic_max(b.body.f, 3 * b.n)) || k == 2);
        b.body.x[10] = keep;
        elastic_force(&b);
        double *f = malloc(3 * sizeof *f * (size_t)b.n), max = elastic_max(b.body.f, 3 * b.n);
        memcpy(f, b.body.f, 3 * sizeof *f * (size_t)b.n);
        b.row.effect->reset(b.row.self, &b.body);
        elastic_force(&b);
        CHECK(isfinite(max));
        for (int i = 0; i < 3 * b.n; i++) CHECK_NEAR(b.body.f[i], f[i], 1e-9 * max);
        free(f);
        elastic_close(&b);
    }
}

static void refuses_what_it_cannot_make(void)
{
    pal_prepared box;
    elastic_bench b;
    REQUIRE(box_make(1, 1, 1, 0.01, &box) == 0);
    REQUIRE(elastic_open(&b, &box, false, "linear", true));
    pal_build build = {.scene = b.scene, .def = b.scene->body, .body = &b.body, .arena = b.arena, .diag = &b.diag};
    pal_config_entry item;
    void *self;
    static const char *const bad[][2] = {
        {"element", "tet10"}, {"element", "hex8"}, {"law", "rubber"}, {"lore", "linear"}};
    for (int k = 0; k < 4; k++) {
        pal_entry_init(&item, "model", "tet_elastic");
        pal_entry_put_text(&item, bad[k][0], bad[k][1], NULL);
        CHECK_INT(pal_effect_tet_elastic.make(&item, &build, &self), PAL_ERR_REFUSED);
        CHECK(strstr(b.diag.text, "model"));
    }
    elastic_close(&b);
}

int main(void)
{
    RUN(is_silent_at_rest);
    RUN(force_is_the_gradient_of_the_energy);
    RUN(has_no_net_force_or_torque);
    RUN(multiply_is_the_assembled_matrix);
    RUN(tangent_is_the_slope_of_the_force);
    RUN(corotational_tangent_is_the_turned_one);
    RUN(patch_test_is_exact);
    RUN(uniaxial_strain_has_the_moduli);
    RUN(ten_thousand_turns_leave_no_energy);
    RUN(a_sudden_half_turn_is_found);
    RUN(stiffness_bounds_the_tangent);
    RUN(other_constants_are_those_of_a_component_made_with_them);
    RUN(an_inverted_tetrahedron_turns_back);
    RUN(shuffled_bodies_recover);
    RUN(collapsed_bodies_have_finite_forces);
    RUN(slivers_and_flat_tetrahedra_do_no_harm);
    RUN(a_nan_ends_and_leaves_nothing);
    RUN(refuses_what_it_cannot_make);
    return check_report();
}
