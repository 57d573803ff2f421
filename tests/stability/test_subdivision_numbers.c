/* Hard cases (catalogue.txt) for model subdivision_fem: numbers. Poisson's ratio close to a half, stiffness of
 * very different sizes side by side, steps that are too long, lengths and moduli of any size, one element, all held. */
#include "tests/fixtures/fem_beam.h"
#include "tests/stability/hard_case.h"
#include "tests/stability/subdivision_case.h"

static bool open_kind(solid_scene *s, int kind, int nx, int ny, int nz, bool fixed)
{
    solid_make(s, &solid_kinds[kind], nx, ny, nz, fixed);
    return solid_scene_open(s);
}

/* a cube of 729 nodes, held below, its top drawn sideways and down: mean displacement of the top */
static double cube_top_m(double poisson, bool fem, bool *good)
{
    const double size[3] = {0.1, 0.1, 0.1}, h = 0.1 / 8;
    double sum = 0;
    pal_solve_report report = {0};
    fem_beam f;
    solid_scene s;
    pal_diagnostic diag = {""};
    *good = false;
    if (fem) {
        beam_make(&f, 8, 8, 8, h, true);
        beam_element(&f, "hex8_bbar", "corotational");
        beam_solver(&f, "static_newton");
        f.def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 1e-6}};
        f.def->material = (pal_material){.young_Pa = 1e4, .poisson = poisson, .density_kg_m3 = 1000};
        if (beam_open(&f, &diag)) return NAN;
    } else {
        solid_scene_take(&s, solid_scene_box((const int32_t[3]){4, 4, 4}, size, true), 1, "static_newton", "polar");
        solid_scene_hold(&s, 2, 1e-6);
        s.def->material.poisson = poisson;
        if (!solid_scene_open(&s)) return NAN;
    }
    pal_world *world = fem ? f.world : s.world;
    pal_body *body = pal_world_body(world, 0);
    const double *rest = fem ? body->x_rest : body->node_rest;
    body->load_cap_N = INFINITY;
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < body->n_node; i++) {
            double share = 200 * h * h;
            if (fabs(rest[3 * i + 2] - 0.1) > 1e-6) continue;
            for (int c = 0; c < 2; c++) share *= rest[3 * i + c] < 1e-6 || rest[3 * i + c] > 0.1 - 1e-6 ? 0.5 : 1;
            if (turn)
                sum += body->d[3 * i] - rest[3 * i] + rest[3 * i + 2] - body->d[3 * i + 2];
            else
                (void)pal_world_load(world, 0, i, (double[3]){share, 0, -share});
        }
        for (int i = 0; i < 20 && !report.converged && !turn; i++) {
            if (pal_world_step(world, 0.01)) break;
            pal_world_solve_report(world, 0, &report);
        }
    }
    *good = report.converged;
    if (fem)
        beam_free(&f);
    else
        solid_scene_close(&s);
    return sum / 81;
}

/* up to nu 0.3 each element keeps its volume; beyond, where that is more than few control points can, whole control
 * cells keep a part of it (cell_volume.c) */
static void hardly_compressible_cubes_are_as_soft_as_those_of_model_fem(void)
{
    static const double poisson[] = {0.3, 0.45, 0.47, 0.49, 0.499}, max[] = {0.015, 0.012, 0.015, 0.02, 0.02};
    for (int q = 0; q < CHECK_REPEATS(5, 1); q++) {
        bool good[2];
        double fem = cube_top_m(poisson[q], true, &good[0]), solid = cube_top_m(poisson[q], false, &good[1]);
        printf("  nu %.3f: %.4f mm, of model fem %.4f mm, %+.2f %%\n", poisson[q], 1e3 * solid, 1e3 * fem,
               100 * (solid / fem - 1));
        CHECK(good[0] && good[1]);
        CHECK_LE(fabs(solid / fem - 1), max[q]);
        if (q > 2)
            HARD_CASE("poisson_static", "subdivision_fem", "729 nodes, off model fem by", 100 * fabs(solid / fem - 1),
                      3, "%");
    }
}

static void steps_stay_finite_at_the_largest_poisson_ratio(void)
{
    for (int k = 0; k < SOLID_KINDS; k++) {
        solid_scene s;
        solid_run run;
        solid_make(&s, &solid_kinds[k], 2, 2, 2, true);
        s.def->material.poisson = 0.4999;
        REQUIRE(solid_scene_open(&s));
        solid_kick(&s, 0.2, 3);
        solid_steps(&s, 0.25, solid_step_s, &run);
        CHECK(run.finite);
        if (solid_kinds[k].energy)
            HARD_CASE("poisson_step", "subdivision_fem", "nu 0.4999: energy over the first", run.max, 1.01, "");
        solid_scene_close(&s);
    }
}

/* one half painted a million times as stiff: iterations, and what moves */
static void a_contrast_of_a_million_costs_few_iterations(void)
{
    solid_scene s;
    int max = 0;
    double hard = 0, soft = 0;
    const pal_stroke stroke = {
        .at_m = {0.02, 0.02, 0}, .radius_m = 0.045, .softness = 0, .young_factor = 1e6, .density_factor = 1};
    solid_make(&s, &solid_kinds[SOLID_IMPLICIT], 2, 2, 4, true);
    s.def->n_stroke = 1, s.def->stroke = &stroke;
    pal_entry_put_number(&s.def->solver, "tolerance", 1e-6, NULL);
    REQUIRE(solid_scene_open(&s));
    for (int i = 0; i < s.body->n_node; i++)
        if (s.body->node_rest[3 * i + 2] > 0.06) (void)pal_world_load(s.world, 0, i, (double[3]){1.2e-3, 0, 0});
    for (int i = 0; i < 60; i++) {
        REQUIRE(solid_scene_step(&s, 1, solid_step_s));
        max = solid_scene_report(&s).n_cg > max ? solid_scene_report(&s).n_cg : max;
    }
    for (int i = 0; i < s.body->n_node; i++) {
        const double *rest = s.body->node_rest + 3 * i, moved = pal_dist3(s.body->d + 3 * i, rest);
        if (rest[2] < 0.015) hard = fmax(hard, moved);
        soft = fmax(soft, moved);
    }
    printf("  %d iterations at most, hard part moves %.2g of the soft one\n", max, hard / soft);
    CHECK(soft > 1e-4);
    HARD_CASE("contrast", "subdivision_fem", "painted: iterations to 1e-6", max, 30, "");
    HARD_CASE("contrast", "subdivision_fem", "hard part moves, over the soft one", hard / soft, 1e-4, "");
    solid_scene_close(&s);
    /* explicit steps are a thousand times as many: refused with the number */
    solid_make(&s, &solid_kinds[SOLID_EXPLICIT], 2, 2, 4, true);
    s.def->n_stroke = 1, s.def->stroke = &stroke;
    CHECK_INT(pal_world_create(s.scene, &s.diag, &s.world), PAL_ERR_BUDGET);
    CHECK(strstr(s.diag.text, "sub-steps"));
    solid_scene_close(&s);
}

/* ten and a hundred times the step; the explicit solver cuts it up */
static void long_steps_stay_bounded(void)
{
    for (int k = 0; k < SOLID_KINDS; k++)
        for (int times = 10; times <= 100; times *= 10) {
            solid_scene s;
            const double dt_s = times * solid_step_s;
            REQUIRE(open_kind(&s, k, 2, 2, 2, true));
            solid_kick(&s, 0.5, 9);
            double first = pal_world_energy_J(s.world), max = 0;
            for (int i = 0; i < (times == 10 ? 12 : 2); i++) {
                REQUIRE(solid_scene_step(&s, 1, dt_s));
                CHECK(pal_body_finite(s.body) && !s.body->frozen && s.body->safeguards.n_mass_scaled == 0);
                max = fmax(max, pal_world_energy_J(s.world));
                if (solid_kinds[k].explicit)
                    CHECK_LE(dt_s / pal_world_substeps(s.world), 1.05 * pal_world_limit_s(s.world));
            }
            HARD_CASE("long_step", "subdivision_fem", "x 10, x 100: energy over the first", max / first, 1.01, "");
            CHECK_LE(solid_rms(s.body), 1e-2 * s.body->length_scale_m);
            solid_scene_close(&s);
        }
}

/* the same answer scaled: lengths of 1e-6 and 1e6 m, E 1e-3 and 1e12 Pa */
static void any_unit_gives_the_same_answer(void)
{
    static const double length[] = {1, 1e-6, 1, 1, 1e6}, young[] = {1e4, 1e4, 1, 1e12, 1e14};
    for (int k = 0; k < 2; k++) {
        double *first = NULL, worst = 0;
        int n_same = 0;
        for (int q = 0; q < 5; q++) {
            solid_scene s;
            const double size[3] = {2 * length[q], length[q], 2 * length[q]},
                         time_s = length[q] * sqrt(1000 / young[q]);
            solid_scene_take(&s, solid_scene_box((const int32_t[3]){2, 1, 2}, size, false), 1, solid_kinds[k].solver,
                             "polar");
            s.def->material.young_Pa = young[q], s.def->material.damping_1_s = 0;
            s.scene->max_substep = 1000000;
            s.scene->step_s = fmin(fmax(0.1 * time_s, 1e-4), 0.1);
            solid_scene_hold(&s, 2, 1e-6 * length[q]);
            pal_entry_put_number(&s.def->solver, "tolerance", 1e-9, NULL);
            if (k == SOLID_IMPLICIT) pal_entry_put_number(&s.def->solver, "substep_s", fmin(0.05 * time_s, 10), NULL);
            REQUIRE(solid_scene_open(&s));
            for (int i = 0; i < s.body->n_dof; i++) {
                double *x = s.body->x + 3 * i;
                x[0] += 0.2 * x[2] * x[2] / length[q], x[1] += 0.1 * x[2];
            }
            pal_body_update_nodes(s.body);
            pal_world_invalidate_limits(s.world, 0);
            REQUIRE(solid_scene_step(&s, 30, 0.05 * time_s));
            if (!first) first = malloc(3 * sizeof *first * (size_t)s.body->n_dof);
            for (int i = 0; i < 3 * s.body->n_dof && q > 0; i++)
                worst = fmax(worst, fabs(s.body->x[i] / length[q] - first[i]));
            for (int i = 0; i < 3 * s.body->n_dof && q == 0; i++) first[i] = s.body->x[i];
            n_same += q > 0;
            solid_scene_close(&s);
        }
        printf("  %s: %d others within %.2g of the length\n", solid_kinds[k].shown, n_same, worst);
        HARD_CASE("scales", "subdivision_fem", "scaled answers differ by", worst, 1e-4, "of the length");
        free(first);
    }
}

static void all_held_and_one_element_are_fine(void)
{
    for (int k = 0; k < SOLID_KINDS; k++)
        for (int fixed = 0; fixed < 2; fixed++)
            for (int level = 0; level < CHECK_REPEATS(2, 1); level++) {
                solid_scene s;
                const double size[3] = {0.02, 0.02, 0.02};
                solid_scene_take(&s, solid_scene_box((const int32_t[3]){1, 1, 1}, size, false), level,
                                 solid_kinds[k].solver, solid_kinds[k].operator);
                if (fixed) solid_scene_hold(&s, 2, 1);
                REQUIRE(solid_scene_open(&s));
                double far = 0;
                if (!fixed) s.body->v[0] = 0.1;
                REQUIRE(solid_scene_step(&s, 60, solid_step_s));
                CHECK(pal_body_finite(s.body) && !s.body->frozen);
                for (int i = 0; i < s.body->n_dof; i++)
                    far = fmax(far, pal_dist3(s.body->x + 3 * i, s.body->x_rest + 3 * i));
                if (fixed)
                    HARD_CASE("all_held", "subdivision_fem", "moves by", far, 0, "m");
                else
                    HARD_CASE("one_element", "subdivision_fem", "flies on by, in 1 s at 0.1 m/s", far, 0.2, "m");
                CHECK_LE(far, 0.2);
                solid_scene_close(&s);
            }
}

int main(void)
{
    RUN(hardly_compressible_cubes_are_as_soft_as_those_of_model_fem);
    RUN(steps_stay_finite_at_the_largest_poisson_ratio);
    RUN(a_contrast_of_a_million_costs_few_iterations);
    RUN(long_steps_stay_bounded);
    RUN(any_unit_gives_the_same_answer);
    RUN(all_held_and_one_element_are_fine);
    return check_report();
}
