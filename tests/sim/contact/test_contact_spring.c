/* Springs between tools and tissue, as an implicit solver takes them. */
#include "server/base/arena.h"
#include "server/sim/contact/contact_spring.h"
#include "server/sim/contact/tuning.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/tool_scene.h"

enum { MAX_CONTACTS = 64 };

typedef struct spring_scene {
    tool_scene s;
    pal_arena *arena;
    pal_contact_points points;
    pal_contact_springs springs;
    pal_contact contact[MAX_CONTACTS];
    double x[MAX_CONTACTS][3];
    int n;
    double centre[3];
} spring_scene;

static double *field(const pal_body *body, uint64_t seed, double size)
{
    double *u = calloc(3 * (size_t)body->n_node, sizeof *u);
    if (!u) abort();
    for (int i = 0; i < 3 * body->n_node; i++) u[i] = 0.5 * size * random_signed(&seed);
    return u;
}

/* a ball or slab, a little deformed, and springs for what a sphere at its top would meet */
static bool open_springs(spring_scene *t, bool skinned)
{
    memset(t, 0, sizeof *t);
    bool made = skinned ? ball_scene(&t->s, 8, true, 1, 0.012, 15) : slab_scene(&t->s, 8, 8, 4, 0.01, 1, 0.02, 15);
    if (!made || !tool_scene_open(&t->s)) return false;
    pal_body *body = t->s.body;
    for (int i = 0; i < body->n_node; i++) {
        double *x = body->x + 3 * (size_t)i, z = x[2];
        x[0] += 0.05 * z * z / 0.05, x[2] += 0.02 * x[0] - 0.1 * z * x[1];
    }
    const pal_component *out = NULL;
    for (int i = 0; i < pal_world_component_count(t->s.world); i++)
        if (pal_world_component(t->s.world, i)->effect->stage == PAL_STAGE_OUTPUT)
            out = pal_world_component(t->s.world, i);
    pal_step step = {.body = body};
    if (!out || out->effect->run(out->self, &step)) return false;
    t->arena = pal_arena_create(1 << 20, true);
    if (!t->arena || pal_contact_points_make(body, 0.006, 10000, t->arena, &t->points)) return false;
    if (pal_contact_springs_make(&t->points, body, MAX_CONTACTS + 2, t->arena, &t->springs)) return false;
    double top = -1;
    for (int i = 0; i < body->display.n_shown; i++)
        if ((double)body->display.shown[3 * i + 2] > top) {
            top = (double)body->display.shown[3 * i + 2];
            for (int c = 0; c < 3; c++)
                t->centre[c] = (double)body->display.shown[3 * i + c] + (c == 2 ? 0.008 : 0.001);
        }
    int32_t *list = PAL_NEW(t->arena, int32_t, t->points.sample.max_point);
    pal_contact_points_begin(&t->points);
    int n = pal_contact_points_collect(&t->points, body, t->centre, t->centre, 0.02, list);
    pal_contact_points_update(&t->points, body, 1);
    pal_contact_springs_begin(&t->springs);
    for (int i = 0; i < n && t->n < MAX_CONTACTS; i++) {
        pal_contact *c = &t->contact[t->n];
        c->point = list[i];
        pal_contact_points_at(&t->points, list[i], t->points.x, t->x[t->n]);
        pal_sub3(c->away, t->x[t->n], t->centre);
        c->depth_m = 0.02 - pal_norm3(c->away);
        c->k_N_m = 10 + i;
        if (!pal_unit3(c->away, c->away, 1e-6)) continue;
        if (pal_contact_springs_add(&t->springs, c->point, c->away, c->k_N_m) != t->n) return false;
        t->n++;
    }
    return t->n > 5;
}

static void close_springs(spring_scene *t)
{
    pal_arena_destroy(t->arena);
    tool_scene_close(&t->s);
}

static void measures_what_points_do(void)
{
    for (int skinned = 0; skinned < 2; skinned++) {
        spring_scene t;
        REQUIRE(open_springs(&t, skinned));
        pal_body *body = t.s.body;
        double worst = 0, largest = 0, *motion = calloc((size_t)t.n, sizeof(double));
        for (uint64_t seed = 1; seed < 6; seed++) {
            double step = 2e-4 * body->edge_m, *u = field(body, seed, 1), x[3];
            pal_contact_springs_motion(&t.springs, u);
            for (int side = 0; side < 2; side++) {
                for (int i = 0; i < 3 * body->n_node; i++) body->x[i] += (side ? -2 : 1) * step * u[i];
                pal_contact_points_update(&t.points, body, 1);
                for (int i = 0; i < t.n; i++) {
                    pal_contact_points_at(&t.points, t.contact[i].point, t.points.x, x);
                    pal_sub3(x, x, t.x[i]);
                    motion[i] = (side ? -0.5 : 0.5) * pal_dot3(x, t.contact[i].away) / step + (side ? motion[i] : 0);
                }
            }
            for (int i = 0; i < 3 * body->n_node; i++) body->x[i] += step * u[i];
            for (int i = 0; i < t.n; i++) {
                worst = fmax(worst, fabs(motion[i] - t.springs.motion_m[i]));
                largest = fmax(largest, fabs(motion[i]));
            }
            free(u);
        }
        printf("  %s: %d springs on %d slots, motion up to %.3g, off by %.2g\n", skinned ? "ball" : "slab", t.n,
               t.points.n_slot, largest, worst);
        /* a skin's axes are single precision */
        CHECK(largest > 0.1);
        CHECK_LE(worst, (skinned ? 2e-3 : 1e-9) * largest);
        free(motion);
        close_springs(&t);
    }
}

static void stiffness_is_symmetric_and_sums_squares(void)
{
    spring_scene t;
    REQUIRE(open_springs(&t, true));
    const pal_body *body = t.s.body;
    size_t n3 = 3 * (size_t)body->n_node;
    for (uint64_t seed = 1; seed < 4; seed++) {
        double *p = field(body, seed, 1), *q = field(body, 100 + seed, 1), *kp = calloc(n3, 8), *kq = calloc(n3, 8);
        double pkq = 0, qkp = 0, pkp = 0, wanted = 0;
        pal_contact_springs_multiply(&t.springs, 1, p, kp);
        for (int i = 0; i < t.n; i++) wanted += t.contact[i].k_N_m * t.springs.motion_m[i] * t.springs.motion_m[i];
        pal_contact_springs_multiply(&t.springs, 1, q, kq);
        for (size_t i = 0; i < n3; i++) pkq += p[i] * kq[i], qkp += q[i] * kp[i], pkp += p[i] * kp[i];
        CHECK(wanted > 0);
        CHECK_NEAR(pkq, qkp, 1e-12 * wanted);
        CHECK_NEAR(pkp, wanted, 1e-12 * wanted);
        free(p), free(q), free(kp), free(kq);
    }
    close_springs(&t);
}

static void loads_have_the_contacts_force_and_torque(void)
{
    for (int skinned = 0; skinned < 2; skinned++) {
        spring_scene t;
        REQUIRE(open_springs(&t, skinned));
        const pal_body *body = t.s.body;
        double force[MAX_CONTACTS], *load = calloc(3 * (size_t)body->n_node, sizeof(double)), sum[3] = {0},
                                    torque[3] = {0};
        double m[3], size = 0, largest = 0;
        for (int i = 0; i < t.n; i++) force[i] = 0.1 + 0.01 * i;
        pal_contact_springs_load(&t.springs, 2, force, 0, t.n, load);
        for (size_t i = 0; i < (size_t)body->n_node; i++) {
            pal_add3(sum, sum, load + 3 * i);
            pal_cross3(m, body->x + 3 * i, load + 3 * i);
            pal_add3(torque, torque, m);
            largest = fmax(largest, 0.5 * pal_norm3(load + 3 * i));
        }
        for (int i = 0; i < t.n; i++) {
            double f[3];
            pal_scale3(f, 2 * force[i], t.contact[i].away);
            pal_sub3(sum, sum, f);
            pal_cross3(m, t.x[i], f);
            pal_sub3(torque, torque, m);
            size += 2 * force[i];
        }
        CHECK_LE(pal_norm3(sum), 1e-12 * size);
        /* a skin's places are single precision */
        CHECK_LE(pal_norm3(torque), (skinned ? 1e-5 : 1e-12) * size * 0.05);
        CHECK_NEAR(pal_contact_springs_max_force_N(&t.springs, force, 0, t.n), largest, 1e-12 * largest);
        free(load);
        close_springs(&t);
    }
}

static void mean_moves_as_its_points_do(void)
{
    spring_scene t;
    REQUIRE(open_springs(&t, true));
    const pal_body *body = t.s.body;
    double weight[MAX_CONTACTS], axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, *u = field(body, 7, 1);
    int first = t.springs.n_row;
    for (int i = 0; i < t.n; i++) weight[i] = 1.0 / t.n;
    for (int c = 0; c < 2; c++)
        CHECK_INT(pal_contact_springs_add_mean(&t.springs, t.contact, weight, t.n, axis[c], 5), first + c);
    pal_contact_springs_motion(&t.springs, u);
    double mean[2] = {t.springs.motion_m[first], t.springs.motion_m[first + 1]}, wanted[2] = {0};
    pal_contact_springs_begin(&t.springs);
    for (int c = 0; c < 2; c++)
        for (int i = 0; i < t.n / 2; i++)
            CHECK(pal_contact_springs_add(&t.springs, t.contact[i].point, axis[c], 1) >= 0);
    pal_contact_springs_motion(&t.springs, u);
    for (int i = 0; i < t.springs.n_row; i++) wanted[i / (t.n / 2)] += t.springs.motion_m[i] / t.n;
    pal_contact_springs_begin(&t.springs);
    for (int c = 0; c < 2; c++)
        for (int i = t.n / 2; i < t.n; i++)
            CHECK(pal_contact_springs_add(&t.springs, t.contact[i].point, axis[c], 1) >= 0);
    pal_contact_springs_motion(&t.springs, u);
    for (int i = 0; i < t.springs.n_row; i++) wanted[i / (t.n - t.n / 2)] += t.springs.motion_m[i] / t.n;
    for (int c = 0; c < 2; c++) CHECK_NEAR(mean[c], wanted[c], 1e-12);
    /* and no row beyond the room there is */
    while (t.springs.n_row < t.springs.max_row)
        REQUIRE(pal_contact_springs_add(&t.springs, t.contact[0].point, axis[0], 1) >= 0);
    CHECK_INT(pal_contact_springs_add(&t.springs, t.contact[0].point, axis[0], 1), -1);
    free(u);
    close_springs(&t);
}

/* the largest eigenvalue of M^-1 K, 1/s^2, by many power iterations */
static double eigenvalue_1_s2(spring_scene *t, const double *mass_kg)
{
    const pal_body *body = t->s.body;
    double *u = field(body, 3, 1), *ku = calloc(3 * (size_t)body->n_node, sizeof *ku), rate = 0;
    for (int pass = 0; pass < 400; pass++) {
        double u2 = 0, uku = 0;
        memset(ku, 0, 3 * sizeof *ku * (size_t)body->n_node);
        pal_contact_springs_multiply(&t->springs, 1, u, ku);
        for (int i = 0; i < 3 * body->n_node; i++) {
            double m = mass_kg[i / 3];
            uku += u[i] * ku[i], u2 += m * u[i] * u[i];
            ku[i] = body->support[i / 3] || m == 0 ? 0 : ku[i] / m;
        }
        rate = uku / u2;
        for (int i = 0; i < 3 * body->n_node; i++) u[i] = ku[i] / rate;
    }
    free(u), free(ku);
    return rate;
}

/* explicit contact divides by this safety, and must not be unstable for it */
static void few_power_iterations_find_most_of_the_eigenvalue(void)
{
    for (int skinned = 0; skinned < 2; skinned++)
        for (int n = 1; n < MAX_CONTACTS; n *= 3) {
            spring_scene t;
            REQUIRE(open_springs(&t, skinned));
            if (n < t.n) t.n = n;
            pal_contact_springs_begin(&t.springs);
            for (int i = 0; i < t.n; i++)
                REQUIRE(pal_contact_springs_add(&t.springs, t.contact[i].point, t.contact[i].away,
                                                t.contact[i].k_N_m) == i);
            double exact = eigenvalue_1_s2(&t, t.s.body->mass_kg);
            double found = pal_contact_points_max_eigenvalue(&t.points, t.s.body, t.s.body->mass_kg, t.contact, t.n);
            printf("  %s, %d contacts: %.4g of %.4g 1/s^2, %.3f\n", skinned ? "ball" : "slab", t.n, found, exact,
                   exact / found);
            CHECK_LE(found, exact * (1 + 1e-9));
            CHECK_LE(exact, EIGENVALUE_SAFETY * found);
            close_springs(&t);
        }
}

/* D of verlet is no less than K: the eigenvalues of D^-1 K are at most 1, with whole row sums and with the share of
 * them that power iterations find. Where a contact is that of one node, they are one. A share is kept while contacts
 * come and go in a step: verlet is stable to an eigenvalue of 2 */
static void row_sums_bound_the_stiffness_of_contact(void)
{
    for (int skinned = 0; skinned < 2; skinned++) {
        double first = 0, last_share = 1;
        for (int n = 1; n < MAX_CONTACTS; n *= 3) {
            spring_scene t;
            REQUIRE(open_springs(&t, skinned));
            if (n < t.n) t.n = n;
            double *bound = calloc((size_t)t.s.body->n_node, sizeof *bound);
            pal_contact_points_begin_slots(&t.points);
            for (int i = 0; i < t.n; i++)
                pal_contact_points_add_bound(&t.points, t.s.body, &t.contact[i], t.contact[i].k_N_m);
            pal_contact_points_assemble_bound(&t.points, t.s.body, bound);
            pal_contact_springs_begin(&t.springs);
            for (int i = 0; i < t.n; i++)
                REQUIRE(pal_contact_springs_add(&t.springs, t.contact[i].point, t.contact[i].away,
                                                t.contact[i].k_N_m) == i);
            double largest = eigenvalue_1_s2(&t, bound);
            double found = pal_contact_points_max_eigenvalue(&t.points, t.s.body, bound, t.contact, t.n);
            double share = fmin(1, EIGENVALUE_SAFETY * found);
            printf("  %s, %d contacts: %.3f, %.3f of the share\n", skinned ? "ball" : "slab", t.n, largest,
                   largest / share);
            CHECK_LE(largest, 1 + 1e-9);
            CHECK_LE(0.05, largest);
            CHECK_LE(largest, share * (1 + 1e-9));
            if (n == 1) first = largest;
            last_share = share;
            free(bound);
            close_springs(&t);
        }
        CHECK_LE(first, 2 * last_share);
    }
}

/* springs to the ground instead of a body: the answer is known */
static double ground_N_m;
static bool ground(void *self, const pal_body *body, const double *force, double *move)
{
    (void)self;
    for (int i = 0; i < 3 * body->n_node; i++) move[i] = force[i] / ground_N_m;
    return true;
}

static void stiffness_is_that_of_springs_in_series_with_tissue(void)
{
    spring_scene t;
    REQUIRE(open_springs(&t, false));
    static const pal_compliance door = {.solve = ground};
    pal_arena *scratch = pal_arena_create(1 << 20, false);
    int32_t row[MAX_CONTACTS];
    double share[MAX_CONTACTS], wanted = 0;
    int n = 0;
    /* shown nodes of the slab itself: each spring has a node of its own */
    for (int i = 0; i < t.n; i++) {
        if (t.springs.start[i + 1] - t.springs.start[i] != 1) continue;
        double into = -t.contact[i].away[2];
        row[n] = i;
        share[n++] = into;
        wanted += into * into / (1 / t.contact[i].k_N_m + 1 / 50.0);
    }
    REQUIRE(n > 3);
    ground_N_m = 50;
    CHECK(pal_contact_springs_stiffness(&t.springs, NULL, row, share, n, 2, NULL, scratch) == 0);
    double one = pal_contact_springs_stiffness(&t.springs, &door, row, share, n, 1, NULL, scratch);
    double two = pal_contact_springs_stiffness(&t.springs, &door, row, share, n, 2, NULL, scratch);
    double all = pal_contact_springs_stiffness(&t.springs, &door, row, share, n, 12, NULL, scratch);
    printf("  %d springs: %.6g, %.6g, %.9g N/m with 1, 2, 12 passes, wanted %.9g\n", n, one, two, all, wanted);
    CHECK_LE(one, two);
    CHECK_NEAR(two, wanted, 0.01 * wanted);
    CHECK_NEAR(all, wanted, 1e-9 * wanted);
    pal_arena_destroy(scratch);
    close_springs(&t);
}

int main(void)
{
    RUN(measures_what_points_do);
    RUN(stiffness_is_symmetric_and_sums_squares);
    RUN(loads_have_the_contacts_force_and_torque);
    RUN(mean_moves_as_its_points_do);
    RUN(few_power_iterations_find_most_of_the_eigenvalue);
    RUN(row_sums_bound_the_stiffness_of_contact);
    RUN(stiffness_is_that_of_springs_in_series_with_tissue);
    return check_report();
}
