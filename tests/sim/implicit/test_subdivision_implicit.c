/* Worlds of model subdivision_fem under implicit solvers: against model fem where both are the same elements, what a
 * factor that turns is worth, tools, edits, and that a run repeats. */
#include "server/mesh/cells/cell_shapes.h"
#include "server/sim/subdivision/subdivision_mass.h"
#include "tests/fixtures/tool_scene.h"

/* a block of nx x ny x nz control cells of h, lowest corner at the origin; no gravity; not yet open */
static bool clay_scene(tool_scene *s, pal_cells *cells, const int32_t n[3], double edge_m, int level, int n_tool)
{
    const double size[3] = {n[0] * edge_m, n[1] * edge_m, n[2] * edge_m};
    pal_surface surface = {0};
    pal_diagnostic diag = {""};
    memset(s, 0, sizeof *s);
    if (pal_cells_block(n, size, cells, &diag)) return false;
    for (int i = 0; i < 3 * cells->n_vertex; i++) cells->x[i] += size[i % 3] / 2;
    if (pal_cells_boundary(cells, &surface, NULL, NULL) || pal_prepared_surface(&surface, &s->mesh)) return false;
    pal_surface_free(&surface);
    s->skinned = true;
    tool_scene_fill(s, "surface_output", false, n_tool, 0.015, 15);
    pal_body_def *def = &s->scene->body[0];
    pal_body_default_cells(def, "clay", &s->mesh, cells);
    for (int i = 1; i < def->n_effect; i++) def->effect[i - 1] = def->effect[i];
    def->n_effect--;
    def->n_support = 0;
    def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.3, .density_kg_m3 = 1000, .damping_1_s = 4};
    pal_entry_init(&def->solver, "solver", "implicit_euler");
    return !pal_entry_put_number(&def->model, "levels", level, &diag);
}

static void clay_close(tool_scene *s, pal_cells *cells)
{
    tool_scene_close(s);
    pal_cells_free(cells);
}

static void hold_box(pal_body_def *def, int axis, double high_m)
{
    pal_support_def *support = &def->support[def->n_support++];
    *support = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 1}};
    support->high_m[axis] = high_m;
}

/* a load across on the nodes beyond x_m, in all force_N */
static int load_end(tool_scene *s, double x_m, double force_N)
{
    int n = 0;
    for (int i = 0; i < s->body->n_node; i++) n += s->body->node_rest[3 * i] > x_m;
    double force[3] = {0, 0, n > 0 ? -force_N / n : 0};
    for (int i = 0; i < s->body->n_node; i++)
        if (s->body->node_rest[3 * i] > x_m) (void)pal_world_load(s->world, 0, i, force);
    return n;
}

static double end_m(const tool_scene *s, double x_m)
{
    double sum = 0;
    int n = 0;
    for (int i = 0; i < s->body->n_node; i++) {
        if (!(s->body->node_rest[3 * i] > x_m)) continue;
        sum += s->body->d[3 * i + 2] - s->body->node_rest[3 * i + 2];
        n++;
    }
    return sum / n;
}

static pal_solve_report report_of(const tool_scene *s)
{
    pal_solve_report out;
    (void)pal_world_solve_report(s->world, 0, &out);
    return out;
}

/* without subdivision the elements are plain hexahedra, as those of model fem with mean dilatation */
static void bends_as_the_same_elements_of_model_fem(void)
{
    double end[2];
    for (int fem = 0; fem < 2; fem++) {
        tool_scene s;
        pal_cells cells = {0};
        if (fem) {
            memset(&s, 0, sizeof s);
            REQUIRE(!box_make(8, 2, 2, 0.01, &s.mesh));
            tool_scene_fill(&s, "surface_output", false, 0, 0.01, 15);
            pal_diagnostic diag = {""};
            REQUIRE(!pal_hexes_find(&s.mesh.tets, &s.mesh.hexes, &diag));
            pal_entry_init(&s.scene->body[0].model, "model", "fem");
            pal_entry_put_text(&s.scene->body[0].model, "element", "hex8_bbar", NULL);
            s.scene->body[0].material.young_Pa = 1e4, s.scene->body[0].material.poisson = 0.3;
        } else
            REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){8, 2, 2}, 0.01, 0, 0));
        hold_box(&s.scene->body[0], 0, 1e-6);
        pal_entry_init(&s.scene->body[0].solver, "solver", "static_newton");
        REQUIRE(tool_scene_open(&s));
        CHECK_INT(load_end(&s, 0.08 - 1e-6, 2e-4), 9);
        REQUIRE(step_world(&s, 1));
        CHECK(report_of(&s).converged);
        end[fem] = end_m(&s, 0.08 - 1e-6);
        if (fem) pal_hexes_free(&s.mesh.hexes);
        if (fem)
            tool_scene_close(&s);
        else
            clay_close(&s, &cells);
    }
    printf("  end of the bar: %.9g m, of model fem %.9g m\n", end[0], end[1]);
    CHECK(end[1] < -1e-4);
    CHECK_LE(fabs(end[0] / end[1] - 1), 1e-6);
}

/* a bar bent until its end points down: conjugate gradients with the factor of rest, turned or not */
static void a_factor_that_turns_saves_iterations(void)
{
    int n_cg[2] = {0}, max[2] = {0};
    double end[2];
    for (int warp = 0; warp < 2; warp++) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){6, 2, 2}, 0.02, 1, 0));
        pal_config_entry *solver = &s.scene->body[0].solver;
        hold_box(&s.scene->body[0], 0, 1e-6);
        pal_entry_put_bool(solver, "warp", warp, NULL);
        pal_entry_put_number(solver, "tolerance", 1e-4, NULL);
        pal_entry_put_number(solver, "iterations", 500, NULL);
        REQUIRE(tool_scene_open(&s));
        load_end(&s, 0.1, 0.4);
        for (int i = 0; i < 50; i++) {
            REQUIRE(step_world(&s, 1));
            n_cg[warp] += report_of(&s).n_cg;
            max[warp] = report_of(&s).n_cg > max[warp] ? report_of(&s).n_cg : max[warp];
        }
        end[warp] = end_m(&s, 0.1);
        clay_close(&s, &cells);
    }
    printf("  end %.4g m; iterations of 50 steps to 1e-4: %d, at most %d; without turning %d, at most %d\n", end[1],
           n_cg[1], max[1], n_cg[0], max[0]);
    CHECK(end[1] < -0.04);
    CHECK_NEAR(end[0], end[1], 1e-3 * fabs(end[1]));
    CHECK_LE(n_cg[1], 0.5 * n_cg[0]);
    CHECK_LE(max[1], 12);
}

/* of masses between points */
static void momentum_of(const pal_body *body, double sum[3])
{
    double *q = calloc(3 * (size_t)body->n_dof, sizeof *q);
    pal_set3(sum, 0, 0, 0);
    if (!q) return;
    pal_mass_operator_multiply(body->mass_operator, 1, 0, NULL, body->v, q);
    for (int i = 0; i < body->n_dof; i++) pal_add3(sum, sum, q + 3 * i);
    free(q);
}

/* a body that floats: its momentum changes by what the tool gives, and the tool feels the opposite */
static void the_force_on_the_tool_is_equal_and_opposite(void)
{
    for (int grasp = 0; grasp < 2; grasp++) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){3, 3, 2}, 0.03, 1, 1));
        s.scene->body[0].material.damping_1_s = 0;
        pal_entry_put_number(&s.scene->body[0].solver, "tolerance", 1e-13, NULL);
        pal_entry_put_number(&s.scene->body[0].solver, "iterations", 500, NULL);
        REQUIRE(tool_scene_open(&s));
        double worst = 0, max = 0;
        for (int i = 0; i < 40; i++) {
            double before[3], after[3], down = 0.0008 * i;
            momentum_of(s.body, before);
            if (grasp)
                move_tool(&s, 0, 0.046, 0.044, i < 10 ? 0.0755 : 0.0755 + 0.0005 * (i - 10), i >= 10);
            else
                move_tool(&s, 0, 0.046, 0.044, 0.078 - down, false);
            REQUIRE(step_world(&s, 1));
            momentum_of(s.body, after);
            pal_sub3(after, after, before);
            pal_axpy3(after, s.scene->step_s, tool_of(&s, 0)->force_N);
            worst = fmax(worst, pal_norm3(after) / s.scene->step_s);
            max = fmax(max, pal_norm3(tool_of(&s, 0)->force_N));
        }
        printf("  %s: most force %.4g N, momentum off by %.2g of it in a step\n", grasp ? "pulled" : "pressed", max,
               worst / max);
        CHECK(max > 0.05);
        CHECK_LE(worst, 1e-9 * max);
        CHECK(grasp ? mean_move(s.body, 2) > 1e-3 : mean_move(s.body, 2) < -1e-3);
        clay_close(&s, &cells);
    }
}

static double kinetic_share(tool_scene *s)
{
    double kinetic = pal_body_kinetic_J(s->body);
    return kinetic / (pal_world_energy_J(s->world) - kinetic);
}

static void a_tool_rests_where_the_static_answer_is(void)
{
    tool_scene s;
    pal_cells cells;
    REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){4, 4, 2}, 0.025, 1, 1));
    hold_box(&s.scene->body[0], 2, 1e-6);
    REQUIRE(tool_scene_open(&s));
    CHECK(s.body->implicit && s.body->compliance);
    for (int i = 0; i <= 40; i++) {
        move_tool(&s, 0, 0.052, 0.048, 0.065 - 0.0002 * i, false);
        REQUIRE(step_world(&s, 1));
    }
    CHECK_INT(pal_world_substeps(s.world), 1);
    REQUIRE(step_world(&s, 150));
    double still = kinetic_share(&s), load[3], worst = 0, far = 0;
    sum_loads(s.body, load);
    pal_add3(load, load, tool_of(&s, 0)->force_N);
    double *move = calloc(3 * (size_t)s.body->n_node, sizeof *move);
    REQUIRE(move && s.body->compliance->solve(s.body->compliance->self, s.body, s.body->load, move));
    for (int i = 0; i < 3 * s.body->n_node; i++) {
        worst = fmax(worst, fabs(s.body->d[i] - s.body->node_rest[i] - move[i]));
        far = fmax(far, fabs(s.body->d[i] - s.body->node_rest[i]));
    }
    free(move);
    const pal_tool *tool = tool_of(&s, 0);
    printf("  %.4g N at %.3g mm, kinetic %.2g of elastic, %.2g off the static answer, k1 %.4g N/m\n",
           tool->mean_force_N[2], 1e3 * far, still, worst / far, tool->n_patch ? tool->patch[0].k1_N_m : 0);
    CHECK(tool->mean_force_N[2] > 0.03);
    CHECK_LE(still, 1e-6);
    CHECK_LE(worst, 0.15 * far);
    CHECK_LE(pal_norm3(load), 1e-3 * tool->mean_force_N[2]);
    /* and it comes back */
    move_tool(&s, 0, 0.052, 0.048, 0.2, false);
    REQUIRE(step_world(&s, 150));
    CHECK_LE(rms_displacement(s.body), 1e-3 * s.body->length_scale_m);
    clay_close(&s, &cells);
}

static void runs_repeat_and_a_reset_begins_anew(void)
{
    uint64_t hash[3] = {0};
    tool_scene s;
    pal_cells cells;
    for (int run = 0; run < 3; run++) {
        if (run < 2) REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){3, 3, 2}, 0.03, 1, 1));
        if (run < 2) hold_box(&s.scene->body[0], 2, 1e-6);
        if (run < 2) REQUIRE(tool_scene_open(&s));
        if (run == 2) pal_world_reset(s.world);
        for (int i = 0; i < 30; i++) {
            move_tool(&s, 0, 0.046, 0.044, 0.078 - 0.0006 * i, false);
            REQUIRE(step_world(&s, 1));
        }
        hash[run] = pal_world_hash(s.world);
        if (run == 0) clay_close(&s, &cells);
    }
    CHECK(hash[0] == hash[1]);
    CHECK(hash[0] == hash[2]);
    clay_close(&s, &cells);
}

/* a live edit costs no long step: columns of the matrix are found a few a step */
static void an_edit_of_the_material_brings_another_factor(void)
{
    tool_scene s;
    pal_cells cells;
    pal_diagnostic diag = {""};
    REQUIRE(clay_scene(&s, &cells, (const int32_t[3]){3, 3, 3}, 0.02, 1, 0));
    hold_box(&s.scene->body[0], 0, 1e-6);
    pal_entry_put_number(&s.scene->body[0].solver, "tolerance", 1e-6, NULL);
    REQUIRE(tool_scene_open(&s));
    load_end(&s, 0.05, 0.02);
    REQUIRE(step_world(&s, 5));
    int before = report_of(&s).n_cg, edited = 0;
    pal_material to = s.scene->body[0].material;
    to.young_Pa *= 30, to.poisson = 0.495, to.density_kg_m3 *= 0.5;
    REQUIRE(!pal_world_material(s.world, 0, &to, &diag));
    for (int i = 0; i < 5; i++) {
        REQUIRE(step_world(&s, 1));
        edited = report_of(&s).n_cg > edited ? report_of(&s).n_cg : edited;
    }
    /* 48 free points have 144 columns */
    REQUIRE(step_world(&s, 60));
    CHECK_INT(report_of(&s).n_factor, 2);
    load_end(&s, 0.05, 0.2);
    REQUIRE(step_world(&s, 1));
    printf("  iterations before, after the edit, with its factor: %d %d %d\n", before, edited, report_of(&s).n_cg);
    /* the old factor, of another stiffness, mass and Poisson ratio, serves meanwhile */
    CHECK_LE(edited, 20);
    CHECK_LE(report_of(&s).n_cg, before + 2);
    clay_close(&s, &cells);
}

int main(void)
{
    RUN(bends_as_the_same_elements_of_model_fem);
    RUN(a_factor_that_turns_saves_iterations);
    RUN(the_force_on_the_tool_is_equal_and_opposite);
    RUN(a_tool_rests_where_the_static_answer_is);
    RUN(runs_repeat_and_a_reset_begins_anew);
    RUN(an_edit_of_the_material_brings_another_factor);
    return check_report();
}
