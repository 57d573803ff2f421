/* Springs at rest under loads: against sums done by hand, against the live world's own rows, with the slopes of the
 * adjoint against differences; and what has no rest is said to have none. */
#include "server/calibrate/equilibrium.h"

#include "server/base/vec3.h"
#include "server/num/random.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"

enum { ROWS = 8 };
static const char *const k_key[PAL_SPRING_KINDS] = {"k_distance_J", "k_area_J", "k_volume_J"};
static const double length_m = 0.04, given_J = 1e-3;
static pal_diagnostic diag;

/* a body of springs with a seat, constants of every spring, loads, and a place for its rest */
typedef struct bench {
    pal_prepared box;
    pal_scene *scene;
    pal_world *world;
    pal_lattice lattice;
    pal_equilibrium_workspace *workspace;
    double *k[PAL_SPRING_KINDS];
    double *f, *x;
} bench;

static const double *const *constants(const bench *b)
{
    return (const double *const *)b->k;
}

static size_t bytes(const bench *b)
{
    return 3 * sizeof(double) * (size_t)b->lattice.n_node;
}

static double uniform(uint64_t key, uint64_t counter) /* in (-1, 1) */
{
    return 2 * pal_random_unit(key, counter) - 1;
}

static bool bench_world(bench *b, const double k_J[PAL_SPRING_KINDS], const char *weights)
{
    pal_body_def *def = &b->scene->body[0];
    def->n_effect = 0;
    def->material.damping_1_s = 0;
    for (int k = 0; k < PAL_SPRING_KINDS; k++) pal_entry_put_number(&def->model, k_key[k], k_J[k], NULL);
    pal_entry_put_text(&def->model, "weights", weights, NULL);
    if (!pal_world_create(b->scene, &diag, &b->world)) return true;
    printf("  %s\n", diag.text);
    return false;
}

/* seat and constants: those of the scene */
static bool bench_take(bench *b, const double k_J[PAL_SPRING_KINDS])
{
    if (pal_lattice_make(b->world, 0, &b->lattice, &diag) ||
        pal_equilibrium_workspace_create(&b->lattice, &b->workspace))
        return false;
    for (int k = 0; k < PAL_SPRING_KINDS; k++) {
        int n = b->lattice.kind[k].n_item;
        b->k[k] = calloc((size_t)n + 1, sizeof(double));
        for (int i = 0; i < n && b->k[k]; i++) b->k[k][i] = k_J[k];
    }
    b->f = calloc(3, bytes(b)), b->x = calloc(1, bytes(b));
    if (!b->k[0] || !b->k[1] || !b->k[2] || !b->f || !b->x) return false;
    memcpy(b->x, b->lattice.x_rest, bytes(b));
    return true;
}

/* 4 x 2 x 2 voxels of 1 cm, held at x = 0 */
static bool bench_bar(bench *b, const char *weights)
{
    const double k_J[PAL_SPRING_KINDS] = {given_J, 2 * given_J, 3 * given_J};
    memset(b, 0, sizeof *b);
    if (box_make(4, 2, 2, length_m / 4, &b->box)) return false;
    b->scene = box_scene(&b->box, true, false);
    b->scene->body[0].support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1e-6, 1, 1}};
    return bench_world(b, k_J, weights) && bench_take(b, k_J);
}

/* constants of the bar's springs an order of magnitude apart */
static void vary(bench *b)
{
    for (int k = 0; k < PAL_SPRING_KINDS; k++)
        for (int i = 0; i < b->lattice.kind[k].n_item; i++)
            b->k[k][i] = given_J * pow(10, 0.5 * uniform((uint64_t)k + 5, (uint64_t)i));
}

/* `size` newtons spread over the bar's end, across it and along it */
static void load_end(bench *b, double size)
{
    static const double part[3] = {0.5, 0.1, -1};
    memset(b->f, 0, bytes(b));
    for (int i = 0; i < b->lattice.n_node; i++)
        for (int c = 0; c < 3 && b->lattice.x_rest[3 * i] > 0.99 * length_m; c++) b->f[3 * i + c] = size / 9 * part[c];
}

static void bench_close(bench *b)
{
    pal_equilibrium_workspace_destroy(b->workspace);
    pal_lattice_free(&b->lattice);
    for (int k = 0; k < PAL_SPRING_KINDS; k++) free(b->k[k]);
    free(b->f);
    free(b->x);
    pal_world_destroy(b->world);
    free(b->scene);
    box_free(&b->box);
}

static pal_err rest(bench *b, bool linear, double tolerance, double *x, pal_equilibrium_report *report)
{
    pal_equilibrium_options o = {.linear = false};
    o.linear = linear;
    if (tolerance > 0) o.tolerance = tolerance;
    diag.text[0] = 0;
    return pal_equilibrium(b->workspace, constants(b), b->f, &o, x, report, &diag);
}

/* ---- against sums by hand ---- */

/* force of the spring between a and b at b, k in J: -k (l/l0 - 1)/l0 along it */
static void add_edge_force(double k, const double rest_a[3], const double rest_b[3], const double x[3], double f[3])
{
    double d[3], l0 = pal_dist3(rest_a, rest_b), l = pal_dist3(rest_a, x);
    pal_sub3(d, x, rest_a);
    pal_axpy3(f, -k * (l / l0 - 1) / l0 / l, d);
}

/* of the triangle with the corners a, b at rest and x: -k (A/A0 - 1)/A0 times dA/dx = (b - a) x N / 2 */
static void add_face_force(double k, const double a[3], const double b[3], const double apex[3], const double x[3],
                           double f[3])
{
    double u[3], v[3], n[3], e[3], g[3], rest_n[3];
    pal_sub3(e, b, a);
    pal_sub3(u, apex, a);
    pal_cross3(rest_n, e, u);
    pal_sub3(v, x, a);
    pal_cross3(n, e, v);
    double area0 = 0.5 * pal_norm3(rest_n), area = 0.5 * pal_norm3(n);
    pal_cross3(g, n, e);
    pal_axpy3(f, -k * (area / area0 - 1) / area0 * 0.5 / pal_norm3(n), g);
}

static void one_tetrahedron_bears_what_its_springs_do(void)
{
    const double h = 0.01, k_J[PAL_SPRING_KINDS] = {2e-3, 3e-3, 5e-3};
    static const double corner[4][3] = {{0, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}, {0, 0, 0.01}};
    static const double at[3] = {0.0011, -0.0007, 0.0126};
    bench b = {0};
    pal_equilibrium_report r;
    REQUIRE(!box_one_tet(h, &b.box));
    b.scene = box_scene(&b.box, true, false);
    b.scene->body[0].support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 0.5 * h}};
    REQUIRE(bench_world(&b, k_J, "equal") && bench_take(&b, k_J));
    CHECK_INT(b.lattice.n_free, 1);
    CHECK_INT(b.lattice.kind[PAL_SPRING_DISTANCE].n_item, 6);
    CHECK_INT(b.lattice.kind[PAL_SPRING_AREA].n_item, 4);
    double f[3] = {0}, energy = 0.5 * k_J[2] * pow(at[2] / h - 1, 2);
    for (int c = 0; c < 3; c++) {
        add_edge_force(k_J[0], corner[c], corner[3], at, f);
        add_face_force(k_J[1], corner[c], corner[(c + 1) % 3], corner[3], at, f);
        energy += 0.5 * k_J[0] * pow(pal_dist3(corner[c], at) / pal_dist3(corner[c], corner[3]) - 1, 2);
    }
    f[2] -= k_J[2] * (at[2] / h - 1) / h; /* V = z h^2/6 */
    for (int c = 0; c < 3; c++) {
        double n[3], n0[3], e[3], u[3], v[3];
        pal_sub3(e, corner[(c + 1) % 3], corner[c]);
        pal_sub3(u, at, corner[c]);
        pal_sub3(v, corner[3], corner[c]);
        pal_cross3(n, e, u);
        pal_cross3(n0, e, v);
        energy += 0.5 * k_J[1] * pow(pal_norm3(n) / pal_norm3(n0) - 1, 2);
    }
    pal_scale3(b.f + 9, -1, f);
    REQUIRE(!rest(&b, false, 1e-13, b.x, &r));
    for (int c = 0; c < 3; c++) CHECK_NEAR(b.x[9 + c], at[c], 1e-12 * h);
    for (int c = 0; c < 9; c++) CHECK_NEAR(b.x[c], corner[c / 3][c % 3], 0);
    CHECK_NEAR(r.energy_J, energy, 1e-12 * energy);
    CHECK_LE(r.residual, 1e-13);
    bench_close(&b);
}

/* a cube with one free corner: three edges and three face diagonals meet there, K = k/h^2 (5/4 I + 1/4 J) */
static void the_corner_of_a_cube_gives_way_as_its_edges_let_it(void)
{
    const double h = 0.02, k_J[PAL_SPRING_KINDS] = {4e-3, 0, 0}, force = 1e-3;
    bench b = {0};
    REQUIRE(!box_make(1, 1, 1, h, &b.box));
    b.scene = box_scene(&b.box, true, false);
    b.scene->body[0].n_support = 3;
    for (int a = 0; a < 3; a++) {
        b.scene->body[0].support[a] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 1}};
        b.scene->body[0].support[a].high_m[a] = 0.5 * h;
    }
    REQUIRE(bench_world(&b, k_J, "equal") && bench_take(&b, k_J));
    CHECK_INT(b.lattice.n_free, 1);
    b.f[21] = force;
    REQUIRE(!rest(&b, true, 0, b.x, NULL));
    double unit = force * h * h / k_J[0];
    CHECK_NEAR(b.x[21] - h, 0.7 * unit, 1e-12 * unit);
    CHECK_NEAR(b.x[22] - h, -0.1 * unit, 1e-12 * unit);
    CHECK_NEAR(b.x[23] - h, -0.1 * unit, 1e-12 * unit);
    bench_close(&b);
}

/* ---- a bar ---- */

static void at_rest_no_free_node_is_pushed(void)
{
    for (int turn = 0; turn < 2; turn++) {
        bench b;
        pal_equilibrium_report r;
        double reaction[3] = {0}, load[3] = {0};
        REQUIRE(bench_bar(&b, turn ? "volume" : "equal"));
        vary(&b);
        load_end(&b, 0.02);
        REQUIRE(!rest(&b, false, 0, b.x, &r));
        double *f = b.f + 3 * b.lattice.n_node, max = 0, moved = 0;
        CHECK_NEAR(pal_lattice_force(&b.lattice, constants(&b), b.x, f), r.energy_J, 0);
        for (int i = 0; i < b.lattice.n_node; i++) {
            double sum[3];
            pal_add3(sum, f + 3 * i, b.f + 3 * i);
            if (!b.lattice.fixed[i]) max = fmax(max, pal_norm3(sum));
            if (b.lattice.fixed[i]) pal_axpy3(reaction, 1, f + 3 * i);
            pal_axpy3(load, 1, b.f + 3 * i);
            moved = fmax(moved, pal_dist3(b.x + 3 * i, b.lattice.x_rest + 3 * i));
        }
        printf("  moved %.3g of the length, net force %.2g N, %d iterations\n", moved / length_m, max, r.n_newton);
        CHECK(moved > 0.05 * length_m);
        CHECK_LE(max, 1e-9 * pal_norm3(load));
        CHECK_LE(pal_dist3(reaction, load), 1e-9 * pal_norm3(load) * b.lattice.n_node);
        bench_close(&b);
    }
}

static void forces_are_those_of_the_live_rows(void)
{
    for (int turn = 0; turn < 2; turn++) {
        bench b;
        pal_component row[ROWS];
        pal_step step = {.force = row};
        REQUIRE(bench_bar(&b, turn ? "volume" : "equal"));
        pal_body *body = step.body = pal_world_body(b.world, 0);
        for (int r = 0; r < pal_world_component_count(b.world) && step.n_force < ROWS; r++)
            if (pal_world_component(b.world, r)->effect->stage == PAL_STAGE_FORCE)
                row[step.n_force++] = *pal_world_component(b.world, r);
        CHECK_INT(step.n_force, 3);
        for (int i = 0; i < 3 * b.lattice.n_node; i++)
            body->x[i] = b.x[i] += 0.2 * 0.25 * length_m * uniform(9, (uint64_t)i);
        REQUIRE(!pal_assemble_forces(&step));
        double energy = 0, max = 0, worst = 0;
        for (int r = 0; r < 3; r++) energy += row[r].effect->energy(row[r].self, body);
        CHECK_NEAR(pal_lattice_force(&b.lattice, constants(&b), b.x, b.f), energy, 1e-13 * energy);
        for (int i = 0; i < 3 * b.lattice.n_node; i++) {
            max = fmax(max, fabs(body->f[i]));
            worst = fmax(worst, fabs(body->f[i] - b.f[i]));
        }
        CHECK(max > 0);
        CHECK_LE(worst, 1e-12 * max);
        bench_close(&b);
    }
}

static void the_linear_rest_is_the_limit_of_small_loads(void)
{
    bench b;
    double off[2];
    REQUIRE(bench_bar(&b, "volume"));
    vary(&b);
    double *x = malloc(bytes(&b));
    REQUIRE(x);
    for (int turn = 0; turn < 2; turn++) {
        double sum = 0;
        load_end(&b, turn ? 5e-5 : 1e-4);
        REQUIRE(!rest(&b, true, 0, x, NULL));
        memcpy(b.x, b.lattice.x_rest, bytes(&b));
        REQUIRE(!rest(&b, false, 1e-13, b.x, NULL));
        for (int i = 0; i < 3 * b.lattice.n_node; i++) sum += (x[i] - b.x[i]) * (x[i] - b.x[i]);
        off[turn] = sqrt(sum);
    }
    CHECK(off[1] > 0);
    CHECK_NEAR(log2(off[0] / off[1]), 2, 0.05);
    /* and it does not ask where the search begins */
    for (int i = 0; i < 3 * b.lattice.n_node; i++) b.x[i] = NAN;
    CHECK_INT(rest(&b, true, 0, b.x, NULL), 0);
    CHECK(!memcmp(b.x, x, bytes(&b)));
    free(x);
    bench_close(&b);
}

/* J = sum w u^2/2 + w' u of a rest; dJ_du may be NULL; NaN: no rest */
static double functional(bench *b, bool linear, double *dJ_du)
{
    double sum = 0;
    memcpy(b->x, b->lattice.x_rest, bytes(b));
    if (rest(b, linear, 1e-13, b->x, NULL)) return NAN;
    for (int i = 0; i < 3 * b->lattice.n_node; i++) {
        double u = b->x[i] - b->lattice.x_rest[i], w = uniform(3, (uint64_t)i), v = 0.01 * uniform(4, (uint64_t)i);
        sum += 0.5 * w * u * u + v * u;
        if (dJ_du) dJ_du[i] = w * u + v;
    }
    return sum;
}

static void slopes_are_those_of_differences(void)
{
    for (int turn = 0; turn < 2; turn++) {
        bench b;
        double *slope[PAL_SPRING_KINDS];
        pal_equilibrium_options o = {.linear = false};
        REQUIRE(bench_bar(&b, "volume"));
        vary(&b);
        load_end(&b, 0.01);
        o.linear = turn == 0;
        double *dJ_du = b.f + 3 * b.lattice.n_node;
        for (int k = 0; k < PAL_SPRING_KINDS; k++)
            slope[k] = calloc((size_t)b.lattice.kind[k].n_item + 1, sizeof(double));
        REQUIRE(slope[0] && slope[1] && slope[2] && isfinite(functional(&b, o.linear, dJ_du)));
        CHECK_INT(pal_equilibrium_adjoint(b.workspace, constants(&b), b.x, &o, dJ_du, slope, &diag), 0);
        for (int k = 0; k < PAL_SPRING_KINDS; k++) {
            int n = b.lattice.kind[k].n_item;
            double max = 0, worst = 0;
            for (int i = 0; i < n; i++) max = fmax(max, fabs(slope[k][i]) * given_J);
            for (int turns = 0; turns < 8; turns++) {
                int i = (int)(n * pal_random_unit(7, (uint64_t)(8 * k + turns)));
                double was = b.k[k][i], step = 1e-4 * was;
                b.k[k][i] = was + step;
                double up = functional(&b, o.linear, NULL);
                b.k[k][i] = was - step;
                double down = functional(&b, o.linear, NULL);
                b.k[k][i] = was;
                worst = fmax(worst, given_J * fabs((up - down) / (2 * step) - slope[k][i]));
                if (!isfinite(up) || !isfinite(down)) worst = INFINITY;
            }
            CHECK(max > 0);
            CHECK_LE(worst, 1e-5 * max);
            free(slope[k]);
        }
        bench_close(&b);
    }
}

static void the_same_bits_come_again_and_on_another_seat(void)
{
    for (int linear = 0; linear < 2; linear++) {
        bench b;
        pal_equilibrium_workspace *other;
        REQUIRE(bench_bar(&b, "volume"));
        vary(&b);
        load_end(&b, 0.02);
        double *x = malloc(2 * bytes(&b));
        REQUIRE(x && !pal_equilibrium_workspace_create(&b.lattice, &other));
        REQUIRE(!rest(&b, linear, 0, b.x, NULL));
        /* a past that fails leaves no trace */
        load_end(&b, 1e9);
        memcpy(x, b.lattice.x_rest, bytes(&b));
        if (!linear) CHECK_INT(rest(&b, linear, 0, x, NULL), PAL_ERR_NUMERIC);
        load_end(&b, 0.02);
        for (int turn = 0; turn < 2; turn++) {
            pal_equilibrium_workspace *workspace = b.workspace;
            memcpy(x, b.lattice.x_rest, bytes(&b));
            if (turn) b.workspace = other;
            CHECK_INT(rest(&b, linear, 0, x, NULL), 0);
            CHECK(!memcmp(x, b.x, bytes(&b)));
            b.workspace = workspace;
        }
        free(x);
        pal_equilibrium_workspace_destroy(other);
        bench_close(&b);
    }
}

/* ---- what has no rest ---- */

static void what_is_not_finite_is_said_to_be_so(void)
{
    static const double bad[3] = {NAN, INFINITY, -INFINITY};
    bench b;
    REQUIRE(bench_bar(&b, "volume"));
    for (int linear = 0; linear < 2; linear++)
        for (int k = 0; k < 3; k++) {
            double *x = b.f + 3 * b.lattice.n_node;
            load_end(&b, 0.01);
            memcpy(b.x, b.lattice.x_rest, bytes(&b));
            b.f[3 * 44 + 1] = bad[k];
            memcpy(x, b.x, bytes(&b));
            CHECK_INT(rest(&b, linear, 0, b.x, NULL), PAL_ERR_NUMERIC);
            CHECK(strstr(diag.text, "node 44: its load"));
            CHECK(!memcmp(x, b.x, bytes(&b)));
            load_end(&b, 0.01);
            for (int kind = 0; kind < PAL_SPRING_KINDS; kind++) {
                double was = b.k[kind][3];
                b.k[kind][3] = bad[k];
                CHECK_INT(rest(&b, linear, 0, b.x, NULL), PAL_ERR_NUMERIC);
                b.k[kind][3] = was;
                CHECK(!memcmp(x, b.x, bytes(&b)));
            }
            if (linear) continue;
            b.x[70] = bad[k];
            CHECK_INT(rest(&b, linear, 0, b.x, NULL), PAL_ERR_NUMERIC);
            CHECK(strstr(diag.text, "node 23: its load or position"));
        }
    bench_close(&b);
}

static void loads_beyond_all_measure_end_the_search(void)
{
    bench b;
    pal_equilibrium_report r;
    REQUIRE(bench_bar(&b, "volume"));
    for (int turn = 0; turn < 5; turn++) {
        static const double load_N[5] = {1, 1e3, 1e9, 1e100, 1e300};
        load_end(&b, load_N[turn]);
        memcpy(b.x, b.lattice.x_rest, bytes(&b));
        CHECK_INT(rest(&b, false, 0, b.x, &r), PAL_ERR_NUMERIC);
        CHECK(!strncmp(diag.text, "no rest", 7));
        CHECK_LE(r.n_newton, 60);
        CHECK(!memcmp(b.x, b.lattice.x_rest, bytes(&b)));
    }
    bench_close(&b);
}

/* constants hundreds of orders of magnitude apart: a rest that balances its loads, or none */
static void constants_of_any_size_give_a_rest_or_none(void)
{
    static const double size[7] = {1e-300, 1e-100, 1e-12, 1, 1e12, 1e100, 1e300};
    bench b;
    int n_rest = 0, n_none = 0;
    REQUIRE(bench_bar(&b, "equal"));
    for (int linear = 0; linear < 2; linear++)
        for (int turn = 0; turn < 7 * 7 + 20; turn++) {
            load_end(&b, 1e-3);
            for (int k = 0; k < PAL_SPRING_KINDS; k++)
                for (int i = 0; i < b.lattice.kind[k].n_item; i++) {
                    int any = (int)(7 * pal_random_unit((uint64_t)turn, (uint64_t)(1000 * k + i)));
                    b.k[k][i] = turn < 49 ? size[k == 0 ? turn % 7 : turn / 7] : size[any];
                }
            memcpy(b.x, b.lattice.x_rest, bytes(&b));
            pal_err err = rest(&b, linear, 0, b.x, NULL);
            n_rest += !err, n_none += err == PAL_ERR_NUMERIC;
            if (err && err != PAL_ERR_NUMERIC) CHECK_FAIL("turn %d: %s", turn, pal_err_name(err));
            for (int i = 0; i < 3 * b.lattice.n_node && !err; i++)
                if (!isfinite(b.x[i])) CHECK_FAIL("turn %d: coordinate %d is not finite", turn, i);
        }
    printf("  %d rests, %d none\n", n_rest, n_none);
    CHECK_INT(n_rest + n_none, 2 * 69);
    CHECK(n_rest > 4 && n_none > 4);
    bench_close(&b);
}

static void springs_that_hold_nothing_have_no_rest(void)
{
    bench b;
    REQUIRE(bench_bar(&b, "volume"));
    for (int linear = 0; linear < 2; linear++) {
        load_end(&b, 1e-3);
        for (int turn = 0; turn < 2; turn++) {
            /* nothing at all; springs that push apart */
            for (int k = 0; k < PAL_SPRING_KINDS; k++)
                for (int i = 0; i < b.lattice.kind[k].n_item; i++) b.k[k][i] = turn ? -given_J : 0;
            memcpy(b.x, b.lattice.x_rest, bytes(&b));
            CHECK_INT(rest(&b, linear, 0, b.x, NULL), PAL_ERR_NUMERIC);
        }
    }
    /* without a load the body rests as it is, if it is stable there */
    memset(b.f, 0, bytes(&b));
    CHECK_INT(rest(&b, false, 0, b.x, NULL), PAL_ERR_NUMERIC);
    vary(&b);
    CHECK_INT(rest(&b, false, 0, b.x, NULL), 0);
    CHECK(!memcmp(b.x, b.lattice.x_rest, bytes(&b)));
    bench_close(&b);
}

static void bodies_that_nothing_holds_or_that_cannot_move_are_refused(void)
{
    static const char *const sentence[3] = {"body \"box\": nothing holds it against its loads",
                                            "body \"box\": all of its 8 nodes are held",
                                            "body \"box\": has no edge springs"};
    for (int turn = 0; turn < 3; turn++) {
        const double k_J[PAL_SPRING_KINDS] = {turn == 2 ? 0 : given_J, given_J, given_J};
        bench b = {0};
        REQUIRE(!box_make(1, 1, 1, 0.01, &b.box));
        b.scene = box_scene(&b.box, turn > 0, false);
        if (turn == 1) b.scene->body[0].support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 1}};
        REQUIRE(bench_world(&b, k_J, "equal"));
        CHECK_INT(pal_lattice_make(b.world, 0, &b.lattice, &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, sentence[turn]));
        CHECK(b.lattice.arena == NULL);
        bench_close(&b);
    }
}

int main(void)
{
    RUN(one_tetrahedron_bears_what_its_springs_do);
    RUN(the_corner_of_a_cube_gives_way_as_its_edges_let_it);
    RUN(at_rest_no_free_node_is_pushed);
    RUN(forces_are_those_of_the_live_rows);
    RUN(the_linear_rest_is_the_limit_of_small_loads);
    RUN(slopes_are_those_of_differences);
    RUN(the_same_bits_come_again_and_on_another_seat);
    RUN(what_is_not_finite_is_said_to_be_so);
    RUN(loads_beyond_all_measure_end_the_search);
    RUN(constants_of_any_size_give_a_rest_or_none);
    RUN(springs_that_hold_nothing_have_no_rest);
    RUN(bodies_that_nothing_holds_or_that_cannot_move_are_refused);
    return check_report();
}
