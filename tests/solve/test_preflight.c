/* Preflight: limits, weak places, modes and refusals of scenes whose answers are known. */
#include "server/solve/preflight.h"
#include "server/solve/tuning.h"
#include "tests/check.h"
#include "tests/fixtures/fem_beam.h"

static pal_diagnostic diag;

static void the_limit_is_the_bodys_and_its_node_is_found(void)
{
    pal_prepared box;
    pal_preflight p;
    REQUIRE(!box_make(4, 3, 3, 0.01, &box));
    /* one node comes within a tenth of a millimetre of its neighbour */
    const int n[3] = {4, 3, 3};
    int near = box_node(n, 2, 1, 2);
    box.tets.x[3 * near] = box.tets.x[3 * box_node(n, 1, 1, 2)] + 1e-4;
    pal_scene *scene = box_scene(&box, true, false);
    REQUIRE(!pal_preflight_run(scene, &p, &diag));
    const pal_preflight_body *b = &p.body[0];
    CHECK_INT(b->n_point, 80);
    CHECK_INT(b->n_element, 180);
    CHECK_INT(b->n_fixed, 20);
    CHECK(b->limit_node == near || b->limit_node == box_node(n, 1, 1, 2));
    CHECK_NEAR(b->limit_edge_m, 1e-4, 1e-9);
    CHECK_NEAR(b->limit_at_m[2], 0.02, 1e-12);
    CHECK_INT(b->n_sub, (int)ceil(scene->step_s / b->limit_s));
    /* the rows' bound is on the safe side of the fastest motion, as the solver's safety is of the bound */
    CHECK_LE(b->limit_s, 2 / b->omega_max_1_s);
    CHECK(b->flat.n > 0 && b->flat.value < 0.1);
    CHECK(fabs(b->flat.at_m[0] - 0.01) < 0.011 && fabs(b->flat.at_m[2] - 0.02) < 0.011);
    char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE], name[24];
    int n_line = pal_preflight_describe(b, line);
    snprintf(name, sizeof name, "node %d at (", b->limit_node);
    CHECK(n_line >= 3 && strstr(line[0], name) == line[0] && strstr(line[0], "an edge of 0.1 mm") != NULL);
    /* both ends at one place: no length is told too */
    box.tets.x[3 * near] = box.tets.x[3 * box_node(n, 1, 1, 2)] + 1e-9;
    scene->max_substep = 1000000;
    REQUIRE(!pal_preflight_run(scene, &p, &diag));
    CHECK(p.body[0].edge.n > 0 && p.body[0].edge.value < 2e-9);
    /* slivers are counted and told, and set no sub-step */
    box.tets.x[3 * near] = box.tets.x[3 * box_node(n, 1, 1, 2)] + 1e-5;
    REQUIRE(!pal_preflight_run(scene, &p, &diag));
    CHECK(p.body[0].n_sliver > 0 && p.body[0].n_sliver <= p.body[0].flat.n);
    n_line = pal_preflight_describe(b, line);
    bool reported = false;
    for (int i = 0; i < n_line; i++) reported |= strstr(line[i], "springs leave the volume out") != NULL;
    CHECK(reported);
    /* without a row of volumes they are no slivers to anybody */
    pal_entry_put_number(&scene->body[0].model, "k_volume_J", 0, NULL);
    REQUIRE(!pal_preflight_run(scene, &p, &diag));
    CHECK(p.body[0].n_sliver == 0 && p.body[0].flat.n > 0);
    free(scene);
    box_free(&box);
}

/* the slowest bending of a cantilever, Euler and Bernoulli: 1.875^2 sqrt(E I / (rho A L^4)); shear and rotation lower
 * it by some percent, two elements across raise it */
static void the_slowest_motion_of_a_bar_is_that_of_beams(void)
{
    fem_beam b;
    pal_preflight p;
    beam_make(&b, 16, 2, 2, 0.01, true);
    beam_element(&b, "hex8_bbar", "corotational");
    b.def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.3, .density_kg_m3 = 1000, .damping_1_s = 4};
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    double wanted = 1.8751 * 1.8751 * sqrt(1e4 * 0.02 * 0.02 / 12 / 1000) / (0.16 * 0.16);
    printf("  slowest %.4g of %.4g 1/s, fastest %.4g 1/s\n", p.body[0].omega_min_1_s, wanted, p.body[0].omega_max_1_s);
    CHECK_NEAR(p.body[0].omega_min_1_s / wanted, 1, 0.05);
    CHECK_NEAR(p.body[0].condition, pow(p.body[0].omega_max_1_s / p.body[0].omega_min_1_s, 2),
               1e-6 * p.body[0].condition);
    CHECK(isinf(p.body[0].limit_s) && p.body[0].n_sub == 1);
    CHECK(p.body[0].flat.n == 0 && p.body[0].edge.n == 0 && p.body[0].light.n == 0 && p.body[0].thin.n == 0);
    CHECK(p.body[0].predicted_ms > 0 && isfinite(p.body[0].predicted_ms));
    CHECK(p.n_byte > 100000);
    /* four times as stiff: twice as fast, the same condition */
    double slow = p.body[0].omega_min_1_s, condition = p.body[0].condition;
    b.def->material.young_Pa *= 4;
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    CHECK_NEAR(p.body[0].omega_min_1_s / slow, 2, 0.01);
    CHECK_NEAR(p.body[0].condition / condition, 1, 0.02);
    beam_free(&b);
}

/* the textbook's element at the ratio of soft tissue is told at load, with the way out */
static void elements_that_lock_are_named_with_one_that_does_not(void)
{
    static const struct {
        const char *element;
        double poisson;
        const char *instead; /* NULL: nothing is said */
    } of[] = {{"hex8", 0.499, "hex8_bbar"},
              {"tet4", 0.49, "hex8_bbar"},
              {"hex8", 0.3, NULL},
              {"hex8_bbar", 0.499, NULL},
              {"tet10", 0.499, NULL}};
    for (int i = 0; i < 5; i++)
        for (int in_region = 0; in_region < (of[i].instead ? 2 : 1); in_region++) {
            fem_beam b;
            pal_preflight p;
            char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE];
            bool reported = false;
            beam_make(&b, 4, 2, 2, 0.01, true);
            beam_element(&b, of[i].element, "corotational");
            b.def->material.poisson = in_region ? 0.3 : of[i].poisson;
            pal_region region = {.kind = PAL_REGION_BOX, .high_m = {0.02, 1, 1}};
            region.young_Pa = 1e5, region.poisson = of[i].poisson, region.density_kg_m3 = 1000;
            if (in_region) b.def->region[b.def->n_region++] = region;
            REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
            for (int k = pal_preflight_describe(&p.body[0], line) - 1; k >= 0; k--)
                reported |= strstr(line[k], "locks at Poisson's ratio") && of[i].instead &&
                            strstr(line[k], of[i].element) && strstr(line[k], of[i].instead);
            CHECK_INT(reported, of[i].instead != NULL);
            CHECK((p.body[0].locks != NULL) == (of[i].instead != NULL));
            beam_free(&b);
        }
}

/* the cost of forces is measured, so that a component of any kind is in the prediction */
static void components_of_every_kind_are_in_the_predicted_cost(void)
{
    fem_beam b;
    pal_preflight p;
    beam_make(&b, 4, 2, 2, 0.01, true);
    beam_element(&b, "tet4", "corotational");
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    CHECK(p.body[0].predicted_ms > 0 && p.predicted_ms > 0);
    pal_entry_init(&b.def->effect[b.def->n_effect], "effects", "penalty");
    b.def->n_effect++;
    const pal_err err = pal_preflight_run(b.scene, &p, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK(p.body[0].predicted_ms > 0 && isfinite(p.body[0].predicted_ms) && isfinite(p.predicted_ms));
    /* a static solver has no steps whose cost could be meant */
    pal_entry_init(&b.def->solver, "solver", "static_newton");
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    CHECK(isnan(p.body[0].predicted_ms) && isnan(p.predicted_ms));
    beam_free(&b);
}

/* a soft slender body under a drag of 4 1/s takes a minute to come back, and that is said; at its critical damping it
 * is faster; a stiff one is not worth a sentence */
static void a_slow_return_is_told(void)
{
    static const struct {
        double young_Pa, damping_1_s;
        bool slow;
    } of[] = {{1e3, 4, true}, {1e3, PAL_DAMPING_DERIVED, false}, {20, PAL_DAMPING_DERIVED, true}, {1e5, 4, false}};
    for (int i = 0; i < 4; i++) {
        fem_beam b;
        pal_preflight p;
        char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE], number[40];
        bool reported = false;
        beam_make(&b, 20, 2, 2, 0.01, true);
        b.def->material.young_Pa = of[i].young_Pa;
        b.def->material.damping_1_s = of[i].damping_1_s, b.def->material.damping_ratio = 1;
        REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
        const double w = p.body[0].omega_min_1_s, c = of[i].damping_1_s > 0 ? 4 : fmin(4, 2 * w);
        printf("  E %g Pa: w1 %.4g 1/s, drag %.3g 1/s, returns in %.3g s\n", of[i].young_Pa, w, c, p.body[0].return_s);
        CHECK_NEAR(p.body[0].return_s, fmax(c / (w * w), 1 / w), 1e-9 * p.body[0].return_s);
        CHECK_INT(p.body[0].return_s > PAL_SLOW_RETURN_S, of[i].slow);
        snprintf(number, sizeof number, "in %.3g s", p.body[0].return_s);
        for (int k = pal_preflight_describe(&p.body[0], line) - 1; k >= 0; k--)
            reported |= strstr(line[k], "returns to rest slowly") && strstr(line[k], number);
        CHECK_INT(reported, of[i].slow);
        beam_free(&b);
    }
}

static void what_nothing_holds_has_no_slowest_motion(void)
{
    fem_beam b;
    pal_preflight p;
    beam_make(&b, 4, 2, 2, 0.01, false);
    beam_element(&b, "tet4", "corotational");
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    CHECK(isnan(p.body[0].omega_min_1_s) && isnan(p.body[0].condition) && p.body[0].omega_max_1_s > 0);
    char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE];
    CHECK_INT(pal_preflight_describe(&p.body[0], line), 1);
    CHECK(strstr(line[0], "no support holds it") == line[0]);
    beam_free(&b);
}

/* two boxes of which one floats: its slowest motion takes for ever, which is no number */
static void a_loose_part_is_told(void)
{
    fem_beam b;
    pal_preflight p;
    char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE];
    bool reported = false;
    beam_make(&b, 4, 2, 2, 0.01, true);
    beam_element(&b, "tet4", "corotational");
    /* the tetrahedra of the second voxel along x are taken out, all four across */
    pal_tets *tets = &b.mesh.tets;
    int n = 0;
    for (int e = 0; e < tets->n_tet; e++) {
        double middle = 0;
        for (int c = 0; c < 4; c++) middle += 0.25 * tets->x[3 * tets->tet[4 * e + c]];
        if (middle > 0.01 && middle < 0.02) continue;
        memmove(tets->tet + 4 * n++, tets->tet + 4 * e, 4 * sizeof *tets->tet);
    }
    CHECK_INT(n, tets->n_tet * 3 / 4);
    tets->n_tet = n;
    REQUIRE(!pal_preflight_run(b.scene, &p, &diag));
    CHECK(isnan(p.body[0].omega_min_1_s) && isnan(p.body[0].return_s));
    for (int k = pal_preflight_describe(&p.body[0], line) - 1; k >= 0; k--)
        reported |= strstr(line[k], "slowest motion is not known") != NULL;
    CHECK(reported);
    beam_free(&b);
}

static void what_cannot_run_is_refused_with_the_node_that_is_to_blame(void)
{
    pal_prepared box;
    pal_preflight p;
    REQUIRE(!box_make(4, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, false);
    scene->body[0].material.young_Pa = 1e12;
    CHECK_INT(pal_preflight_run(scene, &p, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "max_substep allows 2000") != NULL);
    CHECK(strstr(diag.text, "node ") != NULL && strstr(diag.text, " mm sets it") != NULL);
    free(scene);
    box_free(&box);
}

int main(void)
{
    RUN(the_limit_is_the_bodys_and_its_node_is_found);
    RUN(the_slowest_motion_of_a_bar_is_that_of_beams);
    RUN(elements_that_lock_are_named_with_one_that_does_not);
    RUN(components_of_every_kind_are_in_the_predicted_cost);
    RUN(a_slow_return_is_told);
    RUN(what_nothing_holds_has_no_slowest_motion);
    RUN(a_loose_part_is_told);
    RUN(what_cannot_run_is_refused_with_the_node_that_is_to_blame);
    return check_report();
}
