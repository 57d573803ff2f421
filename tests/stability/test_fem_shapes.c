/* Hard cases (catalogue.txt) for model fem: shapes. Whatever a body's nodes are put to (one element turned over,
 * all in a plane, on a point, mirrored, shuffled, blown up), it comes back to rest with no element turned over, its
 * state stays finite and its energy does not rise above what the case put in. */
#include "tests/fixtures/random.h"
#include "tests/stability/fem_case.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;
static const char *const case_cases[] = {"plane", "point", "mirror", "blown_up"};
static const char *const case_names[] = {"plane", "point", "mirror", "x 100", "shuffle", "swap"};

static bool open_kind(fem_beam *b, const hard_kind *kind, int nx, int ny, int nz, double poisson)
{
    hard_make(b, kind, nx, ny, nz, true);
    b->def->material.poisson = poisson;
    return !beam_open(b, &diag);
}

/* the outermost corner goes through its voxel; the same for one whole element alone */
static void an_element_that_is_turned_over_turns_back(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        REQUIRE(open_kind(&b, &hard_kinds[k], 3, 3, 3, 0.45));
        const int n[3] = {3, 3, 3};
        double *x = b.body->x + 3 * box_node(n, 3, 3, 3);
        pal_add3(x, x, (const double[3]){-0.014, -0.014, -0.014});
        pal_world_invalidate_limits(b.world, 0);
        REQUIRE(hard_inverted(&b) > 0);
        hard_run run;
        hard_steps(&b, 2, 1.0 / 60, &run);
        printf("  %s: back after %.2f s, energy up to %.3f\n", hard_kinds[k].shown, run.return_s, run.max);
        CHECK(run.finite);
        CHECK_LE(run.max, 1.01);
        HARD_CASE("inverted", "fem", "within 0.1 % S of rest after", run.return_s, 2, "s");
        HARD_CASE("inverted", "fem", "energy over that put in", run.max, 1.01, "");
        CHECK_INT(hard_inverted(&b), 0);
        beam_free(&b);
    }
}

/* within 10 s; a single seed of the cases that have none */
static void flat_collapsed_mirrored_and_blown_up_bodies_come_back(void)
{
    static const double poisson[] = {0.3, 0.45, 0.499};
    for (int k = 0; k < HARD_KINDS; k++)
        for (int q = 0; q < 3; q++) {
            fem_beam b;
            REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2, poisson[q]));
            printf("  %-11s nu %.3f:", hard_kinds[k].shown, poisson[q]);
            for (int trial_case = HARD_PLANE; trial_case <= HARD_BLOWN; trial_case++) {
                pal_world_reset(b.world);
                hard_case(&b, trial_case, 0);
                hard_run run;
                /* 9.9 s for the slowest of them in release, and more with the rounding of sanitizers' builds */
                const bool slowest = k == HARD_TET && q == 2 && trial_case == HARD_BLOWN;
                const double max_simulated_s = slowest ? CHECK_REPEATS(10, 11) : 10;
                hard_steps(&b, max_simulated_s, 1.0 / 60, &run);
                printf(" %s %.2f s (energy %.2f)", case_names[trial_case], run.return_s, run.max);
                CHECK(run.finite);
                HARD_CASE(case_cases[trial_case], "fem", "energy over that put in", run.max, 1.01, "");
                HARD_CASE(case_cases[trial_case], "fem", "within 0.1 % S of rest after", run.return_s, max_simulated_s,
                          "s");
            }
            printf("\n");
            beam_free(&b);
        }
}

static void shuffled_bodies_come_back_for_every_seed(void)
{
    static const double poisson[] = {0.3, 0.45, 0.499};
    for (int k = 0; k < HARD_KINDS; k++)
        for (int q = 0; q < 3; q++) {
            fem_beam b;
            int back = 0, n_seed = CHECK_REPEATS(k >= HARD_TET10 ? 4 : 20, 2), n = 0;
            double max = 0, last = 0, rise = 0;
            REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2, poisson[q]));
            for (int seed = 0; seed < 2 * n_seed; seed++, n++) {
                pal_world_reset(b.world);
                hard_case(&b, seed & 1 ? HARD_SWAP : HARD_SHUFFLE, (uint64_t)seed / 2);
                hard_run run;
                hard_steps(&b, 10, 1.0 / 60, &run);
                REQUIRE(run.finite);
                back += run.return_s <= 10;
                max = fmax(max, run.max), rise = fmax(rise, run.rise);
                if (run.return_s <= 10) last = fmax(last, run.return_s);
            }
            printf("  %-11s nu %.3f: %d of %d back, the last after %.2f s; energy up to %.3f, largest rise %.2g\n",
                   hard_kinds[k].shown, poisson[q], back, n, last, max, rise);
            HARD_CASE_ALL("shuffle", "fem", "shuffled or exchanged: back within 10 s", back, n);
            HARD_CASE("shuffle", "fem", "energy over that put in", max, 1.01, "");
            beam_free(&b);
        }
}

/* the counters tell of it, and the energy of the shape the switch happens at bounds what follows */
static void mirrored_hexahedra_are_found_recovered_and_counted(void)
{
    for (int k = HARD_HEX; k <= HARD_NEO_HEX; k += HARD_NEO_HEX - HARD_HEX) {
        fem_beam b;
        REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2, 0.45));
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK_INT(b.body->safeguards.n_inversion, 0);
        hard_case(&b, HARD_MIRROR, 0);
        double first = hard_energy_J(&b);
        CHECK(first > 0);
        CHECK(!hard_recovers(&b));
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK(hard_recovers(&b) && b.body->safeguards.n_inversion > 0);
        CHECK_LE(pal_world_energy_J(b.world), 1.01 * first);
        hard_run run;
        hard_steps(&b, 3, 1.0 / 60, &run);
        CHECK_LE(run.max, 1.01);
        CHECK_LE(run.return_s, 3);
        CHECK(b.body->safeguards.n_inversion > 0 && b.body->safeguards.n_change >= 2 &&
              b.body->safeguards.n_change % 2 == 0);
        CHECK(!hard_recovers(&b));
        beam_free(&b);
    }
}

/* free bodies come back to their shape, wherever they are: all distances of rest */
static void free_bodies_come_back_to_their_shape(void)
{
    for (int k = HARD_HEX; k <= HARD_TET; k++)
        for (int trial_case = HARD_PLANE; trial_case < HARD_CASES; trial_case++) {
            if (trial_case == HARD_POINT || trial_case == HARD_BLOWN) continue;
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 3, 2, 2, false);
            REQUIRE(!beam_open(&b, &diag));
            hard_case(&b, trial_case, 3);
            double first = hard_energy_J(&b), max = 0, worst = 0;
            for (int i = 0; i < 600; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                max = fmax(max, pal_world_energy_J(b.world));
            }
            for (int i = 0; i < b.body->n_node; i++)
                for (int j = 0; j < i; j++)
                    worst = fmax(worst, fabs(pal_dist3(b.body->x + 3 * i, b.body->x + 3 * j) -
                                             pal_dist3(b.body->x_rest + 3 * i, b.body->x_rest + 3 * j)));
            CHECK_LE(max, 1.01 * first);
            HARD_CASE(trial_case < HARD_SHUFFLE ? case_cases[trial_case] : "shuffle", "fem",
                      "free bodies: distances off those at rest after 10 s", 100 * worst / b.body->length_scale_m, 0.1,
                      "% S");
            CHECK_INT(hard_inverted(&b), 0);
            beam_free(&b);
        }
}

/* Voxels that are hardly filled are light and turn over at a touch. There the second stage of sdirk2 gained energy for
 * long (9.7 s until rest here, for ever in a liver of 6 voxels); after gains it goes on by backward Euler until there
 * is peace. Under implicit_euler one of the shuffled bodies stayed folded until such were straightened */
static void hardly_filled_voxels_come_to_rest(void)
{
    static const char *const solvers[] = {"implicit_euler", "sdirk2"};
    for (int run_of = 0; run_of < CHECK_REPEATS(6, 2); run_of++) {
        const int fill = run_of / 2;
        fem_beam b;
        uint64_t seed = 11 + (uint64_t)fill;
        beam_make(&b, 4, 3, 2, 0.034, true);
        b.def->material = (pal_material){.young_Pa = 5e3, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
        beam_solver(&b, solvers[run_of % 2]);
        for (int h = 0; h < b.mesh.hexes.n_hex; h++) b.mesh.hexes.fill[h] = random_unit(&seed) < 0.5 ? 0.02F : 1;
        REQUIRE(!beam_open(&b, &diag));
        for (int trial_case = HARD_PLANE; trial_case < HARD_CASES; trial_case++) {
            if (trial_case == HARD_BLOWN) continue;
            pal_world_reset(b.world);
            hard_case(&b, trial_case, (uint64_t)fill);
            hard_run run;
            hard_steps(&b, 10, 1.0 / 60, &run);
            printf("  %s, %s: back after %.2f s, energy up to %.3f\n", solvers[run_of % 2], case_names[trial_case],
                   run.return_s, run.max);
            CHECK(run.finite);
            CHECK_LE(run.max, 1.01);
            HARD_CASE(trial_case < HARD_SHUFFLE ? case_cases[trial_case] : "shuffle", "fem",
                      "every second voxel hardly filled: within 0.1 % S of rest after", run.return_s, 10, "s");
            if (run_of % 2) CHECK_LE(run.return_s, 5);
        }
        beam_free(&b);
    }
}

/* what is turned over under a load is not made straight, which would change the whole body for the sake of a corner;
 * once the load is gone it comes back */
static void a_pressed_body_is_not_straightened(void)
{
    fem_beam b;
    hard_run run;
    REQUIRE(open_kind(&b, &hard_kinds[HARD_HEX], 4, 2, 2, 0.45));
    const int n[3] = {4, 2, 2}, node = box_node(n, 4, 2, 2);
    const double force_N = 0.3 * b.body->load_cap_N;
    int max = 0;
    REQUIRE(!pal_world_load(b.world, 0, node, (double[3]){-force_N, -force_N, -force_N}));
    for (int i = 0; i < 300; i++) {
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        max = hard_in_regions(&b) > max ? hard_in_regions(&b) : max;
    }
    CHECK(hard_inverted(&b) > 0);
    CHECK(max > 0);
    CHECK_LE(max, 12);
    CHECK(b.body->safeguards.n_inversion > 200);
    REQUIRE(!pal_world_load(b.world, 0, node, (double[3]){0, 0, 0}));
    hard_steps(&b, 10, 1.0 / 60, &run);
    CHECK_LE(run.return_s, 10);
    beam_free(&b);
}

int main(void)
{
    RUN(an_element_that_is_turned_over_turns_back);
    RUN(flat_collapsed_mirrored_and_blown_up_bodies_come_back);
    RUN(shuffled_bodies_come_back_for_every_seed);
    RUN(mirrored_hexahedra_are_found_recovered_and_counted);
    RUN(free_bodies_come_back_to_their_shape);
    RUN(hardly_filled_voxels_come_to_rest);
    RUN(a_pressed_body_is_not_straightened);
    return check_report();
}
