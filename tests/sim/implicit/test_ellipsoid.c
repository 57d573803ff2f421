/* Preconditioners of an irregular body: iterations of multigrid, with lumps that are far stiffer than the rest, and
 * what edits of the material leave. Bounds on iterations are those measured, plus a quarter (tests/bench/README.md). */
#include "server/sim/implicit/preconditioner.h"
#include "tests/fixtures/fem_ellipsoid.h"

static pal_diagnostic diag;

/* a row of five stiff lumps in an ellipsoid, each some 8 voxels wide, apart from one another */
static void add_lumps(fem_beam *b, double young_Pa)
{
    for (int k = -2; k <= 2; k++) {
        const double x = 0.033 * k, half = 0.013;
        add_box(b, young_Pa, (double[3]){x - half, -half, -half}, (double[3]){x + half, half, half});
    }
}

/* iterations of multigrid for a static solve of an ellipsoid with lumps of this contrast, 1: none, linear, to 1e-6 */
static int solve_ellipsoid(double contrast)
{
    fem_beam b;
    ellipsoid_make(&b);
    if (contrast > 1) add_lumps(&b, contrast * b.def->material.young_Pa);
    beam_element(&b, "hex8_bbar", "linear");
    beam_solver(&b, "static_newton");
    pal_entry_put_text(&b.def->solver, "linear", "multigrid", NULL);
    beam_key(&b, "tolerance", 1e-6);
    CHECK(!beam_open(&b, &diag));
    ellipsoid_load(&b);
    CHECK(!pal_world_step(b.world, 1.0 / 60));
    const pal_solve_report report = report_of(&b);
    CHECK(report.converged);
    printf("  %d nodes, contrast %g: %d iterations to 1e-6\n", b.body->n_node, contrast, report.n_cg);
    ellipsoid_free(&b);
    return report.n_cg;
}

static void an_irregular_body_needs_few_iterations(void)
{
    CHECK_LE(solve_ellipsoid(1), 14);
}

/* in place of 36 and 164 iterations without a factor of the stiff nodes */
static void stiff_parts_need_few_iterations(void)
{
    CHECK_LE(solve_ellipsoid(1e2), 20);
    CHECK_LE(solve_ellipsoid(1e4), 55);
}

/* edits of the material that end and begin a contrast, live: the stiff nodes are found again */
static void an_edit_finds_the_stiff_parts(void)
{
    fem_beam b;
    double mean[3] = {0};
    ellipsoid_make(&b);
    add_lumps(&b, 1e9);
    beam_element(&b, "hex8_bbar", "corotational");
    beam_key(&b, "tolerance", 1e-2);
    REQUIRE(!beam_open(&b, &diag));
    ellipsoid_load(&b);
    pal_material material = b.def->material;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 5; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            mean[k] += report_of(&b).n_cg / 5.0;
        }
        printf("  contrast %g: %.1f iterations a step\n", 1e9 / material.young_Pa, mean[k]);
        CHECK_LE(mean[k], k == 1 ? 4.3 : 16.5);
        material.young_Pa = k == 0 ? 1e9 : 1e5;
        REQUIRE(!pal_world_material(b.world, 0, &material, &diag));
    }
    ellipsoid_free(&b);
}

/* hash after three steps from rest under a load */
static uint64_t run_from_rest(fem_beam *b)
{
    pal_world_reset(b->world);
    ellipsoid_load(b);
    for (int i = 0; i < 3; i++) CHECK(!pal_world_step(b->world, 1.0 / 60));
    return pal_world_hash(b->world);
}

/* Inverted elements are softer in products while they recover, which is no part of the eigenvalue that smoothers are
 * made for: a material that is edited then, and edited back, is the material that it was */
static void an_edit_during_recovery_leaves_no_trace(void)
{
    fem_beam b;
    ellipsoid_make(&b);
    pal_entry_put_text(&b.def->solver, "preconditioner", "multigrid", NULL);
    pal_entry_put_bool(&b.def->solver, "refresh", false, NULL);
    REQUIRE(!beam_open(&b, &diag));
    const uint64_t first = run_from_rest(&b);
    pal_world_reset(b.world);
    for (int i = 0; i < b.body->n_dof; i++)
        if (!b.body->support[i]) b.body->x[3 * i + 2] *= -0.8;
    pal_world_invalidate_limits(b.world, 0);
    CHECK(!pal_world_step(b.world, 1.0 / 60));
    for (int k = 0; k < 2; k++) {
        pal_material to = b.def->material;
        to.young_Pa *= k == 0 ? 2 : 1;
        CHECK(!pal_world_material(b.world, 0, &to, &diag));
    }
    CHECK(first != 0 && run_from_rest(&b) == first);
    ellipsoid_free(&b);
}

int main(void)
{
    RUN(an_irregular_body_needs_few_iterations);
    RUN(stiff_parts_need_few_iterations);
    RUN(an_edit_finds_the_stiff_parts);
    RUN(an_edit_during_recovery_leaves_no_trace);
    return check_report();
}
