/* The report of a solver: iterations are those of a whole step, times grow with the work that they name, and a
 * refreshed factor comes at the same simulated time whatever the step length. */
#include "tests/fixtures/fem_beam.h"

static pal_diagnostic diag;

static void open_beam(fem_beam *b, const char *solver, double substep_s)
{
    beam_make(b, 8, 2, 2, 0.025, true);
    beam_element(b, "hex8_bbar", "corotational");
    beam_solver(b, solver);
    if (substep_s > 0) beam_key(b, "substep_s", substep_s);
    /* more iterations follow where energy rises */
    if (strcmp(solver, "static_newton") != 0) pal_entry_put_bool(&b->def->solver, "watch", false, NULL);
    REQUIRE(!beam_open(b, &diag));
    beam_load_end(b, 400);
}

static void iterations_are_summed_over_the_sub_steps_of_a_step(void)
{
    static const char *const solver[] = {"implicit_euler", "sdirk2"};
    for (int s = 0; s < 2; s++)
        for (int n_sub = 1; n_sub <= 4; n_sub += 3) {
            fem_beam b;
            pal_solve_report first, second;
            open_beam(&b, solver[s], n_sub > 1 ? 1.0 / 240 : 0);
            REQUIRE(!pal_world_step(b.world, 1.0 / 60) && pal_world_solve_report(b.world, 0, &first));
            REQUIRE(!pal_world_step(b.world, 1.0 / 60) && pal_world_solve_report(b.world, 0, &second));
            CHECK_INT(pal_world_substeps(b.world), n_sub);
            /* one Newton iteration for each stage, of which sdirk2 has two */
            CHECK_INT(first.n_newton, n_sub * (s + 1));
            CHECK_INT(second.n_newton, n_sub * (s + 1));
            CHECK_LE(second.n_newton, second.n_cg);
            beam_free(&b);
        }
}

static void every_solver_reports_the_time_of_its_linear_solves(void)
{
    static const char *const solver[] = {"implicit_euler", "sdirk2", "static_newton"};
    for (int s = 0; s < 3; s++) {
        fem_beam b;
        pal_solve_report before, after;
        open_beam(&b, solver[s], 0);
        pal_world_solve_report(b.world, 0, &before);
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        pal_world_solve_report(b.world, 0, &after);
        CHECK(before.solve_s == 0);
        CHECK(after.solve_s > 0);
        CHECK(before.assemble_s > 0);
        beam_free(&b);
    }
}

static void the_time_of_assembly_includes_refreshed_factors(void)
{
    for (int refresh = 0; refresh < 2; refresh++) {
        fem_beam b;
        pal_solve_report before, after;
        beam_make(&b, 8, 2, 2, 0.025, true);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_key(&b, "refresh_iterations", 1);
        pal_entry_put_bool(&b.def->solver, "refresh", refresh, NULL);
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 400);
        pal_world_solve_report(b.world, 0, &before);
        for (int i = 0; i < 30; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        pal_world_solve_report(b.world, 0, &after);
        CHECK((after.n_factor > before.n_factor) == refresh);
        CHECK((after.assemble_s > before.assemble_s) == refresh);
        beam_free(&b);
    }
}

static void as_many_factors_in_a_second_at_every_step_length(void)
{
    static const int rate[] = {60, 240};
    int n_factor[2];
    for (int k = 0; k < 2; k++) {
        fem_beam b;
        pal_solve_report report;
        beam_make(&b, 8, 2, 2, 0.025, true);
        beam_element(&b, "hex8_bbar", "corotational");
        beam_key(&b, "refresh_iterations", 1);
        beam_key(&b, "tolerance", 1e-8);
        REQUIRE(!beam_open(&b, &diag));
        beam_load_end(&b, 400);
        for (int i = 0; i < 3 * rate[k]; i++) REQUIRE(!pal_world_step(b.world, 1.0 / rate[k]));
        pal_world_solve_report(b.world, 0, &report);
        n_factor[k] = report.n_factor;
        beam_free(&b);
    }
    printf("  factors in 3 s: %d at 60 steps a second, %d at 240\n", n_factor[0], n_factor[1]);
    /* a pause of 0.33 s and at least a step: 8.6 and 8.9 intervals in 3 s */
    CHECK(n_factor[0] >= 8);
    CHECK(abs(n_factor[1] - n_factor[0]) <= 1);
}

int main(void)
{
    RUN(iterations_are_summed_over_the_sub_steps_of_a_step);
    RUN(every_solver_reports_the_time_of_its_linear_solves);
    RUN(the_time_of_assembly_includes_refreshed_factors);
    RUN(as_many_factors_in_a_second_at_every_step_length);
    return check_report();
}
