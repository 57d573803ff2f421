/* Recovery from inversion (recovery/recovery.h): the energy of regions, the clocks, the tank, a switch of supports. */
#include "server/sim/recovery/recovery.h"

#include "server/base/vec3.h"
#include "server/sim/transfer/transfer_world.h"
#include "server/sim/world/world.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/hex_bodies.h"
#include "tests/sim/recovery/recovery_world.h"

/* a box of voxels without a world */
static void open_box(hex_body *b, int nx, int ny, int nz)
{
    hex_body_begin(b, (const int[]){nx, ny, nz}, NULL, 0.01);
    REQUIRE(hex_body_make(b) == PAL_ERR_OK);
    b->body.length_scale_m = 0.01 * nx;
}

static unsigned look(hex_body *b, double time_s)
{
    b->step.time_s = time_s;
    return hex_effect->recovery.recover(b->row, &b->step);
}

static int in_regions(const pal_recovery *r)
{
    int n = 0;
    for (int e = 0; e < r->model.n_element; e++) n += r->region[e] >= 0;
    return n;
}

/* turns the voxel at the box's first corner over */
static void turn_over(hex_body *b)
{
    double *x = b->body.x + 3 * b->hexes.node[0];
    for (int c = 0; c < 3; c++) x[c] = b->body.x_rest[3 * b->hexes.node[0] + c] + 0.025;
}

/* the energy is quartic at most in a step e, so central differences of step e err by e^2 and rounding / e */
static void the_force_of_regions_is_minus_the_gradient(void)
{
    for (int fixed = 0; fixed < 2; fixed++)
        for (uint64_t seed = 1; seed <= 4; seed++) {
            hex_body b;
            open_box(&b, 3, 2, 2);
            const int n = 3 * b.body.n_node;
            for (int i = 0; i < b.body.n_node && fixed; i++) b.body.support[i] = b.body.x_rest[3 * i] == 0;
            hex_shake(&b, 1.5, seed);
            REQUIRE(look(&b, 0) & PAL_INVERTED);
            pal_recovery *r = b.row->recovery;
            REQUIRE(r->n_region > 0);
            double *f = hex_zeros(n), *p = hex_zeros(n), *kp = hex_zeros(n), *kq = hex_zeros(n), *q = hex_zeros(n);
            (void)pal_recovery_energy(r, b.body.d, f);
            const double size = hex_largest(f, n), e = 1e-6 * 0.01;
            for (int i = 0; i < n; i++) {
                const double keep = b.body.x[i];
                b.body.x[i] = keep + e;
                const double up = pal_recovery_energy(r, b.body.d, NULL);
                b.body.x[i] = keep - e;
                const double down = pal_recovery_energy(r, b.body.d, NULL);
                b.body.x[i] = keep;
                CHECK_NEAR(-(up - down) / (2 * e), f[i], 1e-5 * size);
            }
            /* no net force; without supports no net torque */
            double net[3] = {0}, torque[3] = {0}, one[3];
            for (int i = 0; i < b.body.n_node; i++) {
                pal_add3(net, net, f + 3 * i);
                pal_cross3(one, b.body.x + 3 * i, f + 3 * i);
                pal_add3(torque, torque, one);
            }
            CHECK_LE(pal_norm3(net), 1e-12 * size * n);
            if (!fixed) CHECK_LE(pal_norm3(torque), 1e-10 * size * 0.03 * n);
            /* symmetric, positive semi-definite, and with a fixed rotation the derivative of the force */
            for (int i = 0; i < n; i++) p[i] = hex_random(&seed), q[i] = hex_random(&seed);
            pal_recovery_multiply(r, 1, p, kp), pal_recovery_multiply(r, 1, q, kq);
            double pkq = 0, qkp = 0, pkp = 0;
            for (int i = 0; i < n; i++) pkq += p[i] * kq[i], qkp += q[i] * kp[i], pkp += p[i] * kp[i];
            CHECK_NEAR(pkq, qkp, 1e-12 * pkp);
            CHECK(pkp > 0);
            bool all_fixed = true;
            for (int k = 0; k < r->n_region; k++) all_fixed &= r->of[k].fixed;
            memset(q, 0, sizeof *q * (size_t)n);
            for (int i = 0; i < n; i++) b.body.x[i] += e * p[i];
            (void)pal_recovery_energy(r, b.body.d, q);
            for (int i = 0; i < n && all_fixed; i++) CHECK_NEAR((f[i] - q[i]) / e, kp[i], 1e-6 * hex_largest(kp, n));
            free(f), free(p), free(kp), free(kq), free(q);
            hex_body_free(&b);
        }
}

static double no_energy(void *self, const pal_body *body)
{
    (void)self, (void)body;
    return 0;
}

enum { GROWS_FREE, GROWS_STIFF_UNDER_WEIGHT, STAYS_UNDER_LOAD, STAYS_SOFT_UNDER_WEIGHT, N_GROWTH };

/* nothing moves: a region that begins soft stays so, since nothing fills the tank */
static void a_region_grows_with_time_and_not_under_a_load_or_softly_under_weight(void)
{
    static const pal_effect weight = {.name = "weight", .energy = no_energy};
    for (int growth = 0; growth < N_GROWTH; growth++) {
        hex_body b;
        open_box(&b, 8, 1, 1);
        pal_recovery *r = b.row->recovery;
        pal_component component = {.effect = &weight};
        const bool stays = growth >= STAYS_UNDER_LOAD;
        b.body.load_cap_N = 1;
        if (growth == STAYS_UNDER_LOAD) b.body.load[3 * b.hexes.node[60] + 1] = 0.01;
        if (growth == GROWS_STIFF_UNDER_WEIGHT || growth == STAYS_SOFT_UNDER_WEIGHT)
            b.step.force = &component, b.step.n_force = 1;
        CHECK_INT(look(&b, 0), 0);
        turn_over(&b);
        CHECK(look(&b, 10) & PAL_INVERSION_CHANGED);
        CHECK_INT(in_regions(r), 1);
        const double after_s[] = {0.9 * PAL_RECOVERY_WAIT_S, PAL_RECOVERY_WAIT_S,
                                  PAL_RECOVERY_WAIT_S + 0.9 * PAL_RECOVERY_GROW_S,
                                  PAL_RECOVERY_WAIT_S + PAL_RECOVERY_GROW_S, PAL_RECOVERY_WHOLE_S};
        static const int grown[] = {1, 2, 2, 3, 8};
        for (int k = 0; k < 5; k++) {
            r->of[0].scale = growth == STAYS_SOFT_UNDER_WEIGHT ? 0.5 : 1, r->tank_J = 0;
            const unsigned seen = look(&b, 10 + after_s[k]);
            if (k == 0) CHECK_INT(seen, PAL_INVERTED | PAL_INVERSION_AT_REST);
            CHECK_INT(in_regions(r), stays ? 1 : grown[k]);
        }
        /* s never exceeds 1 and nothing is paid that nobody has */
        CHECK(r->of[0].scale <= 1 && r->tank_J >= 0);
        memcpy(b.body.x, b.body.x_rest, 3 * sizeof(double) * (size_t)b.body.n_node);
        CHECK(look(&b, 20) & PAL_INVERSION_CHANGED);
        CHECK_INT(in_regions(r), 0);
        hex_body_free(&b);
    }
}

static pal_recovery_model real;
static int n_range, n_other;
static void count_range(void *self, const pal_body *body, double out[2])
{
    n_range++;
    real.range(self, body, out);
}
static void count_ratios(void *self, const pal_body *body, float *low, float *high, float *middle)
{
    n_other++;
    real.ratios(self, body, low, high, middle);
}
static double count_energy(void *self, const pal_body *body)
{
    n_other++;
    return real.energy(self, body);
}

static void with_nothing_inverted_there_is_one_pass_and_no_other_work(void)
{
    hex_body b;
    open_box(&b, 3, 2, 2);
    pal_recovery *r = b.row->recovery;
    real = r->model;
    r->model.range = count_range, r->model.ratios = count_ratios, r->model.energy = count_energy;
    for (int i = 0; i < 10; i++) {
        hex_shake(&b, 0.1, (uint64_t)i);
        CHECK_INT(look(&b, i), 0);
    }
    CHECK_INT(n_range, 10);
    CHECK_INT(n_other, 0);
    CHECK(b.body.safeguards.n_inversion == 0 && b.body.safeguards.ns == 0);
    hex_body_free(&b);
}

/* without loads the account only goes down: of motion, elements, regions and tank, less what the floor has put in */
static void energy_and_tank_never_rise_without_loads(void)
{
    for (int k = 0; k < RECOVERY_KINDS; k++)
        for (int shape = 0; shape < 3; shape++) {
            fem_beam b;
            recovery_open(&b, &recovery_kinds[k], 6, 2, 2);
            const pal_recovery *r = recovery_state(&b);
            REQUIRE(r != NULL);
            recovery_distort(&b, shape, 5);
            const double first = pal_world_energy_J(b.world), noise = recovery_kinds[k].implicit ? 1e-9 : 2e-2;
            double before = INFINITY, min = 0;
            bool acted = false;
            for (int i = 0; i < 600; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                if (r->n_region > 0) {
                    CHECK_LE(recovery_book_J(r), before + noise * first);
                    CHECK_LE(pal_world_energy_J(b.world), r->counted_J + noise * first);
                    acted = true;
                }
                before = r->n_region > 0 ? recovery_book_J(r) : INFINITY;
                min = fmin(min, r->tank_J);
            }
            CHECK(acted && min >= 0);
            CHECK_INT(r->n_region, 0);
            CHECK_LE(recovery_rms(b.body), 2e-3 * b.body->length_scale_m);
            beam_free(&b);
        }
}

/* a world held at its other end, or again at its first one, goes on from the state of the one before */
static void switch_supports(fem_beam *b, bool end)
{
    pal_diagnostic diag = {{0}};
    pal_world *next = NULL;
    b->def->support[0] =
        (pal_support_def){.low_m = {end ? b->length_m - 1e-9 : -1, -1e9, -1e9}, .high_m = {end ? 1 : 1e-9, 1e9, 1e9}};
    REQUIRE(!pal_world_create(b->scene, &diag, &next));
    pal_world_transfer(next, b->world, -1, NULL, NULL);
    pal_world_destroy(b->world);
    b->world = next, b->body = pal_world_body(next, 0);
}

/* the same regions and clocks before and after, an empty tank, and no energy from the switch */
static void a_switch_of_supports_carries_the_state(void)
{
    for (int k = 0; k < RECOVERY_KINDS; k++) {
        fem_beam b;
        recovery_open(&b, &recovery_kinds[k], 6, 2, 2);
        recovery_distort(&b, 1, 3);
        const double first = pal_world_energy_J(b.world), noise = recovery_kinds[k].implicit ? 1e-9 : 2e-2;
        for (int turn = 0; turn < 2; turn++) {
            for (int i = 0; i < 3; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            const pal_recovery *r = recovery_state(&b);
            REQUIRE(r->n_region > 0);
            const pal_recovery was = *r;
            const int n = in_regions(r);
            const double before = pal_world_energy_J(b.world);
            switch_supports(&b, turn == 0);
            r = recovery_state(&b);
            CHECK_INT(in_regions(r), n);
            CHECK_INT(r->n_region, was.n_region);
            CHECK(r->of[0].scale == was.of[0].scale && r->tank_J == 0 && r->bad_s == was.bad_s);
            /* nodes that are held now have lost their motion */
            CHECK_LE(pal_world_energy_J(b.world), before * (1 + 1e-9));
            double last = recovery_book_J(r);
            for (int i = 0; i < (turn ? 900 : 10); i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                if (r->n_region > 0) CHECK_LE(recovery_book_J(r), last + noise * first);
                last = r->n_region > 0 ? recovery_book_J(r) : INFINITY;
            }
        }
        CHECK_INT(recovery_state(&b)->n_region, 0);
        beam_free(&b);
    }
}

/* a beam is turned half around but near its held end, where it is inverted; then its other end is held: the region
 * keeps no rotation of supports, as that of the new ones would stretch it, and nothing has paid for that */
static void supports_turned_against_a_region_give_no_energy(void)
{
    int n_fixed = 0;
    for (int k = 0; k < RECOVERY_KINDS; k++) {
        fem_beam b;
        recovery_open(&b, &recovery_kinds[k], 8, 2, 2);
        for (int i = 0; i < b.body->n_node; i++) {
            double *x = b.body->x + 3 * i;
            if (b.body->support[i]) continue;
            if (x[0] < 0.35 * b.length_m)
                x[0] = 0.4 * b.length_m - x[0];
            else
                x[1] = b.width_m - x[1], x[2] = b.width_m - x[2];
        }
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        n_fixed += recovery_state(&b)->n_region > 0 && recovery_state(&b)->of[0].fixed;
        switch_supports(&b, true);
        const double before = pal_world_energy_J(b.world);
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK_LE(recovery_state(&b)->counted_J, before * (1 + 1e-9));
        for (int i = 0; i < 900; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK_INT(recovery_state(&b)->n_region, 0);
        beam_free(&b);
    }
    CHECK(n_fixed > 0); /* where the region has left the support at once nothing is asked */
}

/* the finest level of multigrid multiplies with the edges that act in regions, nearly: 4.1 iterations a step, 6.9 with
 * the elements' own stiffness */
static void regions_cost_multigrid_few_iterations(void)
{
    fem_beam b;
    pal_diagnostic diag;
    pal_solve_report report;
    double mean = 0;
    int n_region = 0;
    beam_reference(&b, 8);
    b.def->material.young_Pa = 500;
    pal_entry_put_text(&b.def->solver, "preconditioner", "multigrid", NULL);
    REQUIRE(!beam_open(&b, &diag));
    /* the outer half is mirrored, and so soft that it takes its time */
    for (int i = 0; i < b.body->n_node; i++)
        if (b.body->x[3 * i] > 0.5 * b.length_m) b.body->x[3 * i + 1] = b.width_m - b.body->x[3 * i + 1];
    for (int i = 0; i < 10; i++) {
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        REQUIRE(pal_world_solve_report(b.world, 0, &report));
        mean += report.n_cg / 10.0;
        n_region += recovery_state(&b)->n_region > 0;
    }
    printf("  %.1f iterations a step, regions in %d of 10 steps\n", mean, n_region);
    CHECK(n_region > 2);
    CHECK_LE(mean, 5);
    beam_free(&b);
}

int main(void)
{
    RUN(the_force_of_regions_is_minus_the_gradient);
    RUN(a_region_grows_with_time_and_not_under_a_load_or_softly_under_weight);
    RUN(with_nothing_inverted_there_is_one_pass_and_no_other_work);
    RUN(energy_and_tank_never_rise_without_loads);
    RUN(a_switch_of_supports_carries_the_state);
    RUN(supports_turned_against_a_region_give_no_energy);
    RUN(regions_cost_multigrid_few_iterations);
    return check_report();
}
