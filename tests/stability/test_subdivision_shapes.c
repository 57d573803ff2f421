/* Hard cases (catalogue.txt) for model subdivision_fem: shapes. Whatever the control points are put to (a corner
 * through its cell, all in a plane, on a point, mirrored, blown up, shuffled, swapped), the solid comes back to rest
 * with no element turned over, and its energy does not rise above what the case put in. No point moves more than 0.2
 * S in a step of the implicit solver, so that the way back from x 100 alone takes 8 s. Operator edges is no gradient of
 * an energy: it comes back up to nu 0.45, with the implicit solver from any shape, with the explicit one from a corner
 * turned over. */
#include "server/num/polar.h"
#include "tests/stability/hard_case.h"
#include "tests/stability/subdivision_case.h"

static bool open_kind(solid_scene *s, int kind, int n, double poisson)
{
    solid_make(s, &solid_kinds[kind], n, n, n, true);
    s->def->material.poisson = poisson, s->def->material.damping_1_s = 8;
    return solid_scene_open(s);
}

static int outermost(const pal_body *body)
{
    int far = 0;
    double max = -INFINITY;
    for (int i = 0; i < body->n_dof; i++) {
        const double *x = body->x_rest + 3 * i, at = x[0] + x[1] + x[2];
        if (at > max) max = at, far = i;
    }
    return far;
}

static void a_corner_that_is_turned_over_turns_back(void)
{
    static const double poisson[] = {0.45, 0.1, 0.499};
    for (int i = 0; i < SOLID_KINDS + CHECK_REPEATS(4, 0); i++) {
        const int k = i < SOLID_KINDS ? i : i % 2, q = i < SOLID_KINDS ? 0 : 1 + (i - SOLID_KINDS) / 2;
        solid_scene s;
        solid_run run;
        REQUIRE(open_kind(&s, k, 2, poisson[q]));
        double *x = s.body->x + 3 * outermost(s.body);
        pal_add3(x, x, (const double[3]){-0.06, -0.06, -0.06});
        pal_body_update_nodes(s.body);
        pal_world_invalidate_limits(s.world, 0);
        REQUIRE(solid_inverted(&s) > 0);
        solid_steps(&s, 2, solid_step_s, &run);
        printf("  %s, nu %.3f: back after %.2f s, energy up to %.3f\n", solid_kinds[k].shown, poisson[q], run.return_s,
               run.max);
        CHECK(run.finite);
        HARD_CASE("inverted", "subdivision_fem", "energy over that put in", run.max, 1.01, "");
        HARD_CASE("inverted", "subdivision_fem", "within 0.1 % S of rest after", run.return_s, 2, "s");
        CHECK(s.body->safeguards.n_inversion > 0);
        solid_scene_close(&s);
    }
}

static const char *const solid_cases[] = {"plane", "point", "mirror", "blown_up", "shuffle", "shuffle"};

/* returns after how long all were back; INFINITY: one was not */
static double case_all(int kind, double poisson, int n_seed, double *max)
{
    solid_scene s;
    double last = 0;
    if (!open_kind(&s, kind, 2, poisson)) return INFINITY;
    printf("  %s, nu %.3f:", solid_kinds[kind].shown, poisson);
    for (int trial_case = 0; trial_case < SOLID_CASES; trial_case++) {
        int n = trial_case < SOLID_SHUFFLE ? 1 : n_seed, back = 0;
        double late = 0;
        for (int seed = 0; seed < n; seed++) {
            solid_run run;
            pal_world_reset(s.world);
            solid_case(&s, trial_case, (uint64_t)seed);
            solid_steps(&s, 10, solid_step_s, &run);
            CHECK(run.finite);
            back += run.return_s <= 10;
            late = fmax(late, run.return_s), *max = fmax(*max, run.max);
        }
        const char *id = solid_cases[trial_case];
        if (n > 1) HARD_CASE_ALL(id, "subdivision_fem", "shuffled or exchanged: back within 10 s", back, n);
        HARD_CASE(id, "subdivision_fem", "energy over that put in", *max, 1.01, "");
        HARD_CASE(id, "subdivision_fem", "within 0.1 % S of rest after", late, 10, "s");
        printf(" %s %d of %d (%.2f s)", subdivision_case_names[trial_case], back, n, late);
        last = fmax(last, late);
    }
    printf(", energy up to %.3f\n", *max);
    solid_scene_close(&s);
    return last;
}

static void flat_collapsed_mirrored_blown_up_and_shuffled_solids_come_back(void)
{
    static const double poisson[] = {0.45, 0.499, 0.3};
    for (int q = 0; q < CHECK_REPEATS(3, 1); q++) {
        double max = 0;
        CHECK_LE(case_all(SOLID_IMPLICIT, poisson[q], CHECK_REPEATS(10, 1), &max), 10);
        CHECK_LE(max, 1.01);
    }
    for (int q = 0; q < CHECK_REPEATS(2, 0); q++) {
        double max = 0;
        CHECK_LE(case_all(SOLID_EXPLICIT, poisson[q], 3, &max), 10);
        CHECK_LE(max, 1.01);
    }
}

static void operator_edges_comes_back_with_the_implicit_solver(void)
{
    double max = 0;
    CHECK_LE(case_all(SOLID_IMPLICIT + 2, 0.45, CHECK_REPEATS(4, 1), &max), 10);
    CHECK_LE(max, 1.01);
}

/* energy of all of it turned beside that of 1 % of strain; steps leave it where it is */
static void turns_store_nothing(void)
{
    static const double axes[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, -2, 3}};
    for (int k = 0; k < SOLID_KINDS; k++) {
        solid_scene s;
        double max = 0, moved = 0, to[3], r[9];
        solid_make(&s, &solid_kinds[k], 2, 2, 2, false);
        REQUIRE(solid_scene_open(&s));
        for (int i = 0; i < s.body->n_dof; i++) s.body->x[3 * i] *= 1.01;
        pal_body_update_nodes(s.body);
        const double strained = pal_world_energy_J(s.world);
        for (int turn = 0; turn < 10; turn++) {
            const double angle = (turn & 1 ? 1 : 0.5) * M_PI, *axis = axes[turn / 2];
            const double sine = sin(0.5 * angle) / pal_norm3(axis);
            pal_quat_matrix((const double[4]){cos(0.5 * angle), sine * axis[0], sine * axis[1], sine * axis[2]}, r);
            pal_world_reset(s.world);
            for (int i = 0; i < s.body->n_dof; i++) pal_mul33(s.body->x + 3 * i, r, s.body->x_rest + 3 * i);
            pal_body_update_nodes(s.body);
            pal_world_invalidate_limits(s.world, 0);
            max = fmax(max, pal_world_energy_J(s.world));
            REQUIRE(solid_scene_step(&s, 6, solid_step_s));
            max = fmax(max, pal_world_energy_J(s.world));
            for (int i = 0; i < s.body->n_dof; i++) {
                pal_mul33(to, r, s.body->x_rest + 3 * i);
                moved = fmax(moved, pal_dist3(s.body->x + 3 * i, to));
            }
        }
        printf("  %s: energy %.2g of 1 %% strain's, off by %.2g S\n", solid_kinds[k].shown, max / strained,
               moved / s.body->length_scale_m);
        HARD_CASE("turns", "subdivision_fem", "energy over that of 1 % strain", max / strained, 1e-6, "");
        HARD_CASE("turns", "subdivision_fem", "not rigid by", moved / s.body->length_scale_m, 1e-5, "S");
        solid_scene_close(&s);
    }
}

/* set spinning ten thousand times round, a third of a turn at once */
static void ten_thousand_turns_leave_no_energy(void)
{
    solid_scene s;
    double max = 0, r[9];
    solid_make(&s, &solid_kinds[0], 1, 1, 1, false);
    REQUIRE(solid_scene_open(&s));
    for (int i = 0; i < s.body->n_dof; i++) s.body->x[3 * i] *= 1.01;
    pal_body_update_nodes(s.body);
    const double strained = pal_world_energy_J(s.world);
    for (int k = 0; k < CHECK_REPEATS(30001, 301); k++) {
        const double half = M_PI * (k % 3) / 3, sine = sin(half) / sqrt(14);
        pal_quat_matrix((const double[4]){cos(half), sine, 2 * sine, 3 * sine}, r);
        for (int i = 0; i < s.body->n_dof; i++) pal_mul33(s.body->x + 3 * i, r, s.body->x_rest + 3 * i);
        pal_body_update_nodes(s.body);
        max = fmax(max, pal_world_energy_J(s.world));
    }
    HARD_CASE("many_turns", "subdivision_fem", "energy over that of 1 % strain", max / strained, 1e-6, "");
    REQUIRE(solid_scene_step(&s, 10, solid_step_s));
    CHECK_LE(pal_world_energy_J(s.world), 1e-6 * strained);
    solid_scene_close(&s);
}

int main(void)
{
    RUN(a_corner_that_is_turned_over_turns_back);
    RUN(flat_collapsed_mirrored_blown_up_and_shuffled_solids_come_back);
    RUN(operator_edges_comes_back_with_the_implicit_solver);
    RUN(turns_store_nothing);
    RUN(ten_thousand_turns_leave_no_energy);
    return check_report();
}
