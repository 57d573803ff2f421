/* Hard cases (catalogue.txt) for model fem: cases from outside. Long steps, a meganewton, resting for long,
 * turns of body and support, numbers that are none, tools that jump, appear inside or press against one another. */
#include "server/num/polar.h"
#include "tests/fixtures/random.h"
#include "tests/stability/fem_case.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;

static bool open_kind(fem_beam *b, const hard_kind *kind, int nx, int ny, int nz)
{
    hard_make(b, kind, nx, ny, nz, true);
    return !beam_open(b, &diag);
}

/* a bent and kicked body at 10 and 100 times the step */
static void long_steps_stay_bounded(void)
{
    for (int k = 0; k < HARD_KINDS; k++)
        for (int times = 10; times <= 100; times *= 10) {
            fem_beam b;
            REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2));
            uint64_t seed = 9;
            for (int i = 0; i < 3 * b.body->n_dof; i++)
                if (!b.body->support[i / 3]) b.body->v[i] = 2 * random_unit(&seed) - 0.5;
            hard_run run;
            hard_steps(&b, times * 60.0 / 60, times / 60.0, &run);
            CHECK(run.finite);
            HARD_CASE("long_step", "fem", "x 10, x 100: energy over the first", run.max, 1.01, "");
            CHECK_LE(run.rise, 1e-6);
            HARD_CASE("long_step", "fem", "at rest after steps", run.return_s / (times / 60.0), 10, "");
            CHECK_INT(hard_inverted(&b), 0);
            beam_free(&b);
        }
}

/* for a second, then gone: finite, capped, nothing turned over 2 s later, at rest within 10 s */
static void a_meganewton_on_a_vertex_is_capped_and_forgotten(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2));
        const int n[3] = {4, 2, 2};
        int node = box_node(n, 4, 1, 2);
        double far = 0, back = 0;
        for (int axis = 0; axis < CHECK_REPEATS(6, 1); axis++) {
            pal_world_reset(b.world);
            double force[3] = {0, 0, 0};
            force[axis % 3] = axis < 3 ? 1e6 : -1e6;
            REQUIRE(!pal_world_load(b.world, 0, node, force));
            for (int i = 0; i < 60; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                REQUIRE(pal_body_finite(b.body));
                far = fmax(far, pal_dist3(b.body->x + 3 * node, b.body->x_rest + 3 * node));
            }
            CHECK(b.body->safeguards.n_capped > 0);
            REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 0}));
            hard_run run;
            hard_steps(&b, 2, 1.0 / 60, &run);
            CHECK(run.finite);
            CHECK_LE(run.max, 1.01);
            HARD_CASE("meganewton", "fem", "turned over 2 s after", hard_inverted(&b), 0, "");
            hard_steps(&b, 8, 1.0 / 60, &run);
            CHECK_LE(hard_rms(b.body), 1e-3 * b.body->length_scale_m);
            back = fmax(back, hard_rms(b.body));
        }
        HARD_CASE("meganewton", "fem", "off rest 10 s after", 100 * back / b.body->length_scale_m, 0.1, "% S");
        printf("  %-11s pulled %.2g S away, back within %.2g S\n", hard_kinds[k].shown, far / b.body->length_scale_m,
               back / b.body->length_scale_m);
        beam_free(&b);
    }
}

/* two simulated minutes after it came to rest, instead of an hour: no drift, no energy from nowhere */
static void a_loaded_body_rests(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2));
        beam_load_end(&b, 60);
        for (int i = 0; i < 600; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        size_t n_byte = 3 * sizeof(double) * (size_t)b.body->n_node;
        double *x = malloc(n_byte), drift = 0, kinetic = 0, rest = pal_world_energy_J(b.world), energy = 0;
        memcpy(x, b.body->x, n_byte);
        for (int i = 0; i < 3600 / HARD_SLOW; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 30));
            kinetic = fmax(kinetic, pal_body_kinetic_J(b.body));
            energy = fmax(energy, fabs(pal_world_energy_J(b.world) - rest));
        }
        for (int i = 0; i < 3 * b.body->n_node; i++) drift = fmax(drift, fabs(b.body->x[i] - x[i]));
        printf("  %-11s drift %.2g S, kinetic energy %.2g and change of energy %.2g of what is stored\n",
               hard_kinds[k].shown, drift / b.body->length_scale_m, kinetic / rest, energy / rest);
        HARD_CASE("hour", "fem", "two minutes in steps of 1/30 s: drift", drift / b.body->length_scale_m, 1e-6,
                  "S in 2 min");
        CHECK_LE(kinetic, 1e-9 * rest);
        CHECK_LE(energy, 1e-6 * rest);
        free(x);
        beam_free(&b);
    }
}

/* the whole body turned at once: next to no energy beside that of 1 % of strain, and no motion */
static void quarter_and_half_turns_store_nothing(void)
{
    static const double axes[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, -2, 3}};
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        hard_make(&b, &hard_kinds[k], 3, 2, 2, false);
        REQUIRE(!beam_open(&b, &diag));
        for (int i = 0; i < b.body->n_node; i++) b.body->x[3 * i] *= 1.01;
        double strained = pal_world_energy_J(b.world), max = 0, moved = 0;
        for (int turn = 0; turn < 10; turn++) {
            double angle = (turn & 1 ? 1 : 0.5) * M_PI, r[9];
            const double *axis = axes[turn / 2];
            double s = sin(0.5 * angle) / pal_norm3(axis);
            pal_quat_matrix((const double[4]){cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]}, r);
            pal_world_reset(b.world);
            for (int i = 0; i < b.body->n_node; i++) pal_mul33(b.body->x + 3 * i, r, b.body->x_rest + 3 * i);
            pal_world_invalidate_limits(b.world, 0);
            max = fmax(max, pal_world_energy_J(b.world));
            for (int i = 0; i < 30; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            max = fmax(max, pal_world_energy_J(b.world));
            for (int i = 0; i < b.body->n_node; i++) {
                double to[3];
                pal_mul33(to, r, b.body->x_rest + 3 * i);
                moved = fmax(moved, pal_dist3(b.body->x + 3 * i, to));
            }
        }
        HARD_CASE("turns", "fem", "energy over that of 1 % strain", max / strained, 1e-6, "");
        HARD_CASE("turns", "fem", "not rigid by", moved / b.body->length_scale_m, 1e-5, "S");
        beam_free(&b);
    }
}

/* the support turned by a quarter and by a half, in half a second or within one step: the body follows, is all of one
 * turn in the end and stores next to nothing */
static void a_support_that_turns_takes_the_body_along(void)
{
    for (int k = 0; k < HARD_KINDS; k++)
        for (int way = 0; way < CHECK_REPEATS(4, 1); way++) {
            double degrees = way & 1 ? 180 : 90, rise_s = way & 2 ? 0 : 0.5;
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 4, 2, 2, false);
            const double low[3] = {-1, -1, -1}, high[3] = {1e-9, 1, 1}, axis[3] = {0, 1, 0};
            pal_config_entry *item = &b.def->effect[b.def->n_effect++];
            pal_entry_init(item, "effects[0]", "moving_support");
            pal_entry_put_numbers(item, "low_m", low, 3, NULL);
            pal_entry_put_numbers(item, "high_m", high, 3, NULL);
            pal_entry_put_numbers(item, "turn_axis", axis, 3, NULL);
            pal_entry_put_number(item, "turn_deg", degrees, NULL);
            pal_entry_put_number(item, "rise_s", rise_s, NULL);
            REQUIRE(!beam_open(&b, &diag));
            for (int i = 0; i < b.body->n_node; i++) b.body->x[3 * i] *= 1.01;
            double strained = pal_world_energy_J(b.world), centre[3] = {0, 0.01, 0.01}, worst = 0;
            pal_world_reset(b.world);
            for (int i = 0; i < 480; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                REQUIRE(pal_body_finite(b.body));
            }
            double s = degrees < 100 ? 1 : 0, c = degrees < 100 ? 0 : -1;
            for (int i = 0; i < b.body->n_node; i++) {
                double from[3], to[3];
                pal_sub3(from, b.body->x_rest + 3 * i, centre);
                pal_set3(to, c * from[0] + s * from[2], from[1], -s * from[0] + c * from[2]);
                pal_add3(to, to, centre);
                worst = fmax(worst, pal_dist3(b.body->x + 3 * i, to));
            }
            printf("  %-11s %3.0f degrees in %.1f s: energy %.2g of 1 %% strain, off by %.2g S\n", hard_kinds[k].shown,
                   degrees, rise_s, pal_world_energy_J(b.world) / strained, worst / b.body->length_scale_m);
            CHECK_LE(pal_world_energy_J(b.world), 1e-6 * strained);
            HARD_CASE("anchors", "fem", "a support that turns at once or in 0.5 s: off a rigid turn",
                      worst / b.body->length_scale_m, 1e-5, "S");
            CHECK_INT(hard_inverted(&b), 0);
            beam_free(&b);
        }
}

/* a load for good that crushes the corner it pulls at: the elements there turn over and borrow rotations, and such
 * forces can lead in a circle. The body stands still in the end, whatever it looks like, and gains nothing from then on
 */
static void a_body_that_is_crushed_for_good_stands_still(void)
{
    static const double way[][3] = {{1, 1, 0}, {-1, -1, -1}, {-2, -2, -2}};
    enum { SECONDS = 7, LAST = 120 };
    double fastest = 0, max_rise = 0;
    for (int k = 0; k < 2; k++)
        for (size_t w = (size_t)k; w < sizeof way / sizeof way[0]; w++) {
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 3, 3, 3, true);
            pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "gravity");
            b.def->material.damping_1_s = 10;
            REQUIRE(!beam_open(&b, &diag));
            double unit = b.def->material.young_Pa * 1e-4, force[3], before = INFINITY, speed = 0, rise = 0;
            pal_scale3(force, unit, way[w]);
            REQUIRE(!pal_world_load(b.world, 0, b.body->n_node - 1, force));
            for (int i = 0; i < 60 * SECONDS; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                REQUIRE(pal_body_finite(b.body));
                if (i < 60 * SECONDS - LAST) continue;
                double now = pal_world_energy_J(b.world) - hard_work_J(b.body), v = 0;
                for (int n = 0; n < 3 * b.body->n_dof; n++) v += b.body->v[n] * b.body->v[n];
                speed = fmax(speed, sqrt(v / b.body->n_dof) / b.body->length_scale_m);
                rise = fmax(rise, (now - before) / fabs(hard_work_J(b.body)));
                before = now;
            }
            printf("  %-11s crushed %zu: %d turned over, %.2g S/s, rises by %.2g, %llu searches\n", hard_kinds[k].shown,
                   w, hard_inverted(&b), speed, rise, (unsigned long long)b.body->safeguards.n_search);
            fastest = fmax(fastest, speed), max_rise = fmax(max_rise, rise);
            beam_free(&b);
        }
    HARD_CASE("meganewton", "fem", "crushed for good: speed after 5 s", fastest, 1e-3, "S/s");
    HARD_CASE("meganewton", "fem", "crushed for good: rise of energy in a step after 5 s", 100 * max_rise, 1e-4, "%");
}

int main(void)
{
    RUN(long_steps_stay_bounded);
    RUN(a_meganewton_on_a_vertex_is_capped_and_forgotten);
    RUN(a_loaded_body_rests);
    RUN(quarter_and_half_turns_store_nothing);
    RUN(a_support_that_turns_takes_the_body_along);
    RUN_LONG(a_body_that_is_crushed_for_good_stands_still);
    return check_report();
}
