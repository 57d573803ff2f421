/* Load cases solved: bars whose answer is known by hand, for every element, law and kind of load; the shipped beam; and
 * the sentence of every fault. */
#include "server/solve/solve.h"
#include "tests/check.h"

static const char *const elements[4] = {"hex8_bbar", "hex8", "tet4", "tet10"};

/* a bar of 4 x 1 x 1 dm, its end at x = 0 held, without lateral contraction, so that every answer is one-dimensional */
static const double length_m = 0.4, side_m = 0.1, young_Pa = 20000, density_kg_m3 = 1000;

static bool make_bar(pal_surface *out)
{
    static const int32_t tri[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    *out = (pal_surface){.n_vertex = 8, .n_tri = 12, .x = malloc(24 * sizeof(double)), .tri = malloc(sizeof tri)};
    if (!out->x || !out->tri) return false;
    for (int k = 0; k < 8; k++) {
        out->x[3 * k] = 3 + length_m * (k & 1); /* away from the origin: frames must be minded */
        out->x[3 * k + 1] = side_m * (k >> 1 & 1);
        out->x[3 * k + 2] = side_m * (k >> 2);
    }
    memcpy(out->tri, tri, sizeof tri);
    pal_surface_recentre(out);
    return true;
}

static pal_box box_of(double x0, double x1)
{
    return (pal_box){.low_m = {x0, -1, -1}, .high_m = {x1, 1, 1}};
}

static pal_problem bar_problem(void)
{
    pal_problem p = {.unit_m = 1, .n_material = 1, .n_support = 1, .n_case = 1};
    p.material[0] = (pal_problem_material){
        .id = "m", .region = {.all = true}, .young_Pa = young_Pa, .poisson = 0, .density_kg_m3 = density_kg_m3};
    p.support[0].region = box_of(2.9, 3.000001);
    p.load_case[0].n_load = 1;
    p.load_case[0].load[0] = (pal_problem_load){.kind = PAL_LOAD_TRACTION,
                                                .region = box_of(3.399999, 3.5),
                                                .has_normal = true,
                                                .normal = {1, 0, 0},
                                                .has_traction = true,
                                                .traction_Pa = {200, 0, 0}};
    for (int c = 0; c < 3; c++) p.material[0].region.low_m[c] = -1e9, p.material[0].region.high_m[c] = 1e9;
    return p;
}

static pal_solve_options options_of(const char *element, const char *law)
{
    return (pal_solve_options){.element = element,
                               .law = law,
                               .voxel.resolution = 8,
                               .voxel.fill = true,
                               .voxel.align = true,
                               .tolerance = 1e-11,
                               .young_Pa = NAN,
                               .poisson = NAN};
}

static pal_err solve(const pal_problem *p, const pal_solve_options *o, pal_solution **out, pal_solve_result *r,
                     pal_diagnostic *diag)
{
    pal_surface bar;
    if (!make_bar(&bar)) return PAL_ERR_MEMORY;
    pal_err err = pal_solve(p, &p->load_case[0], &bar, o, out, r, diag);
    pal_surface_free(&bar);
    return err;
}

static double ux(const pal_solution *s, double x, double y, double z)
{
    double u[3];
    pal_solution_at(s, (double[3]){x, y, z}, u);
    return u[0];
}

static void traction_stretches_a_bar_exactly(void)
{
    pal_problem p = bar_problem();
    for (int e = 0; e < 4; e++) {
        pal_solve_options o = options_of(elements[e], "linear");
        pal_solution *s = NULL;
        pal_solve_result r;
        pal_diagnostic diag = {""};
        pal_err err = solve(&p, &o, &s, &r, &diag);
        if (err) CHECK_FAIL("%s: %s", elements[e], diag.text);
        REQUIRE(!err);
        double strain = 200 / young_Pa, force = 200 * side_m * side_m;
        CHECK_NEAR(ux(s, 3.4, 0.05, 0.05), strain * length_m, 1e-10);
        CHECK_NEAR(ux(s, 3.1234, 0.013, 0.077), strain * 0.1234, 1e-10);
        CHECK_NEAR(r.area_m2[0], side_m * side_m, 1e-12);
        CHECK_NEAR(r.load_N[0], force, 1e-10);
        CHECK_NEAR(r.reaction_N[0], -force, 1e-8);
        CHECK_NEAR(r.work_J, force * strain * length_m, 1e-9);
        CHECK_NEAR(r.energy_J, 0.5 * force * strain * length_m, 1e-9);
        CHECK_NEAR(r.max_m, strain * length_m, 1e-10);
        CHECK_NEAR(r.volume_m3, length_m * side_m * side_m, 1e-9);
        CHECK_INT(r.n_element, e < 2 ? 8 * 2 * 2 : 5 * 8 * 2 * 2);
        if (e < 3) CHECK_INT(r.n_node, 9 * 3 * 3);
        if (e < 3) CHECK_INT(r.n_dof, 3 * (9 * 9 - 9));
        CHECK_INT(r.n_newton, 1);
        pal_solution_free(s);
    }
}

/* stretch of the stable neo-Hookean law at nu = 0 under the nominal stress P = share mu: the lateral stretch l that
 * leaves the sides free is l^2 = (2 L - 1) / L^2, and then P = mu (L - (2 L - 1) / L^3) */
static double neo_stretch(double share)
{
    double low = 1, high = 2;
    for (int k = 0; k < 60; k++) {
        double middle = 0.5 * (low + high);
        *(middle - (2 * middle - 1) / (middle * middle * middle) < share ? &low : &high) = middle;
    }
    return low;
}

static void laws_stretch_a_bar_as_they_say(void)
{
    const double traction = 6000, share = traction / (young_Pa / 2);
    /* the held end keeps its width, which the neo-Hookean bar feels over its first decimetre */
    double want[2] = {traction / young_Pa, neo_stretch(share) - 1}, off[2] = {1e-8, 0.004};
    static const char *const law[2] = {"corotational", "neo_hookean"};
    pal_problem p = bar_problem();
    p.load_case[0].load[0].traction_Pa[0] = traction;
    for (int k = 0; k < 2; k++)
        for (int e = 0; e < 4; e++) {
            pal_solve_options o = options_of(elements[e], law[k]);
            pal_solution *s = NULL;
            pal_solve_result r;
            pal_diagnostic diag = {""};
            o.tolerance = 1e-10;
            pal_err err = solve(&p, &o, &s, &r, &diag);
            if (err) CHECK_FAIL("%s %s: %s", law[k], elements[e], diag.text);
            REQUIRE(!err);
            CHECK_NEAR(ux(s, 3.4, 0.05, 0.05), want[k] * length_m, off[k] * length_m);
            CHECK_NEAR(r.reaction_N[0], -traction * side_m * side_m, 1e-6);
            pal_solution_free(s);
        }
}

static void total_force_is_spread_over_what_the_region_holds(void)
{
    pal_problem p = bar_problem();
    pal_problem_load *l = &p.load_case[0].load[0];
    l->has_traction = false;
    l->has_total = true;
    l->total_N[0] = 2;
    pal_solve_options o = options_of("hex8_bbar", "linear");
    pal_solution *s = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {""};
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    CHECK_NEAR(r.load_N[0], 2, 1e-10);
    CHECK_NEAR(ux(s, 3.4, 0.05, 0.05), 2 / (side_m * side_m) / young_Pa * length_m, 1e-10);
    pal_solution_free(s);
    /* half of the end: the same force all the same */
    l->region.high_m[1] = 0.05;
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    CHECK_NEAR(r.area_m2[0], side_m * side_m / 2, 1e-12);
    CHECK_NEAR(r.load_N[0], 2, 1e-10);
    CHECK_NEAR(r.reaction_N[0], -2, 1e-8);
    CHECK(ux(s, 3.4, 0, 0.05) > ux(s, 3.4, 0.1, 0.05) * 1.1);
    pal_solution_free(s);
}

static void weight_points_and_moved_supports_are_exact(void)
{
    pal_problem p = bar_problem();
    pal_problem_load *l = &p.load_case[0].load[0];
    pal_solve_options o = options_of("hex8", "linear");
    pal_solution *s = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {""};
    *l = (pal_problem_load){.kind = PAL_LOAD_GRAVITY, .gravity_m_s2 = {3, 0, 0}};
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    /* nodes of linear elements are exact under a uniform load: rho g (L x - x^2 / 2) / E */
    CHECK_NEAR(ux(s, 3.4, 0, 0), density_kg_m3 * 3 * length_m * length_m / 2 / young_Pa, 1e-9);
    CHECK_NEAR(ux(s, 3.2, 0, 0), density_kg_m3 * 3 * (length_m * 0.2 - 0.02) / young_Pa, 1e-9);
    CHECK_NEAR(r.load_N[0], 3 * density_kg_m3 * length_m * side_m * side_m, 1e-9);
    pal_solution_free(s);

    *l = (pal_problem_load){.kind = PAL_LOAD_POINT, .point_m = {3.4, 0.05, 0.05}, .force_N = {1, 0, 0}};
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    CHECK_NEAR(r.load_N[0], 1, 1e-12);
    CHECK_NEAR(r.reaction_N[0], -1, 1e-8);
    CHECK_NEAR(r.work_J, ux(s, 3.4, 0.05, 0.05), 1e-9);
    CHECK_NEAR(ux(s, 3.2, 0.05, 0.05), 1 / (side_m * side_m) / young_Pa * 0.2, 2e-5);
    pal_solution_free(s);

    /* both ends held, the far one pulled by three voxels */
    p.n_support = 2;
    p.support[1] = (pal_problem_support){.region = box_of(3.399999, 3.5), .moved = true, .move_m = {0.15, 0, 0}};
    l->force_N[0] = 0;
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    CHECK_NEAR(ux(s, 3.4, 0.02, 0.03), 0.15, 1e-12);
    CHECK_NEAR(ux(s, 3.11, 0.02, 0.03), 0.15 / length_m * 0.11, 1e-9);
    CHECK_NEAR(r.energy_J, 0.5 * young_Pa * side_m * side_m / length_m * 0.15 * 0.15, 1e-6);
    CHECK_NEAR(r.reaction_N[0], 0, 1e-7);
    pal_solution_free(s);
}

static void materials_hold_in_their_boxes(void)
{
    pal_problem p = bar_problem();
    pal_solve_options o = options_of("hex8_bbar", "linear");
    pal_solution *s = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {""};
    p.n_material = 2;
    p.material[0].region = box_of(2.9, 3.2);
    p.material[1] = p.material[0];
    snprintf(p.material[1].id, PAL_NAME, "n");
    p.material[1].region = box_of(3.2, 3.5);
    p.material[1].young_Pa = 4 * young_Pa;
    pal_err err = solve(&p, &o, &s, &r, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    double strain = 200 / young_Pa;
    CHECK_NEAR(ux(s, 3.2, 0.05, 0.05), strain * 0.2, 1e-10);
    CHECK_NEAR(ux(s, 3.4, 0.05, 0.05), strain * (0.2 + 0.2 / 4), 1e-10);
    pal_solution_free(s);
    p.material[1].region = box_of(3.3, 3.5);
    CHECK_INT(solve(&p, &o, &s, &r, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "materials: none of the 2 regions holds (3.2") != NULL);
    o.young_Pa = 5;
    CHECK_INT(solve(&p, &o, &s, &r, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "the problem has 2 materials") != NULL);
}

static void files_hold_what_was_solved(void)
{
    pal_problem p = bar_problem();
    pal_solve_options o = options_of("hex8_bbar", "linear");
    pal_solution *s = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {""};
    pal_samples back = {0};
    char csv[] = "/tmp/palpate_solve_XXXXXX", vtk[64], line[128] = "";
    int fd = mkstemp(csv);
    REQUIRE(fd >= 0);
    close(fd);
    snprintf(vtk, sizeof vtk, "%s.vtk", csv);
    REQUIRE(!solve(&p, &o, &s, &r, &diag));
    CHECK_INT(pal_solution_csv(s, csv, &diag), 0);
    CHECK_INT(pal_samples_read(csv, &back, &diag), 0);
    CHECK_INT(back.n, r.n_node);
    for (int k = 0; k < back.n; k++)
        CHECK_NEAR(ux(s, back.x[3 * k], back.x[3 * k + 1], back.x[3 * k + 2]), back.u[3 * k], 1e-12);
    pal_samples_free(&back);
    CHECK_INT(pal_solution_vtk(s, vtk, &diag), 0);
    FILE *file = fopen(vtk, "r");
    int n_point = 0, n_cell = 0, n_vector = 0, n_scalar = 0;
    double stress[4] = {0}, min = INFINITY, max = 0;
    while (file && fgets(line, sizeof line, file)) {
        sscanf(line, "POINTS %d", &n_point);
        sscanf(line, "CELLS %d", &n_cell);
        n_vector += !strncmp(line, "VECTORS displacement_m", 22);
        if (n_scalar > 0 && sscanf(line, "%lf", &stress[0]) == 1)
            min = fmin(min, stress[0]), max = fmax(max, stress[0]);
        n_scalar += !strncmp(line, "SCALARS von_mises_Pa", 20);
    }
    if (file) fclose(file);
    CHECK_INT(n_point, r.n_node);
    CHECK_INT(n_cell, r.n_element);
    CHECK_INT(n_vector, 1);
    CHECK_INT(n_scalar, 1);
    CHECK_NEAR(min, 200, 1e-6); /* uniaxial: the traction itself */
    CHECK_NEAR(max, 200, 1e-6);
    CHECK_INT(pal_solution_csv(s, "/nowhere/at/all.csv", &diag), PAL_ERR_IO);
    CHECK_INT(pal_solution_vtk(s, "/nowhere/at/all.vtk", &diag), PAL_ERR_IO);
    pal_solution_free(s);
    unlink(csv);
    unlink(vtk);
}

static bool stop(const char *what, double fraction, void *user)
{
    (void)what, (void)fraction;
    return --*(int *)user > 0;
}

static void faults_are_named_with_their_entry(void)
{
    static const struct {
        const char *sentence;
        pal_err err;
    } want[] = {
        {"supports: none, so the body is free", PAL_ERR_REFUSED},
        {"supports[0]: (5, -1, -1) .. (6, 1, 1) meets nothing of the body", PAL_ERR_REFUSED},
        {"load_cases[0].loads[0]: the region (3.5, -1, -1) .. (3.6, 1, 1) meets no surface", PAL_ERR_REFUSED},
        {"loads[0]: the region (3.4, -1, -1) .. (3.5, 1, 1) meets no surface that faces (-1, 0, 0)", PAL_ERR_REFUSED},
        {"loads[0]: the point (3.4, 0.05, 0.3) lies 0.2 m outside the body", PAL_ERR_REFUSED},
        {"material \"m\": nu 0.5 is not a Poisson ratio", PAL_ERR_REFUSED},
        {"material \"m\": nu -1 is not a Poisson ratio", PAL_ERR_REFUSED},
        {"material \"m\": E 0 Pa is not a stiffness", PAL_ERR_REFUSED},
        {"stopped", PAL_ERR_STATE},
        {"twist 0.5: it is for hex8_bbar of linear or corotational law, not for tet4 of law", PAL_ERR_REFUSED}};
    for (int k = 0; k < 10; k++) {
        pal_problem p = bar_problem();
        pal_solve_options o = options_of("hex8_bbar", "corotational");
        pal_problem_load *l = &p.load_case[0].load[0];
        pal_solution *s = NULL;
        pal_solve_result r;
        pal_diagnostic diag = {""};
        int left = 2;
        if (k == 0) p.n_support = 0;
        if (k == 1) p.support[0].region = box_of(5, 6);
        if (k == 2) l->region = box_of(3.5, 3.6);
        if (k == 3) l->normal[0] = -1;
        if (k == 4) *l = (pal_problem_load){.kind = PAL_LOAD_POINT, .point_m = {3.4, 0.05, 0.3}, .force_N = {1, 0, 0}};
        if (k == 5) o.poisson = 0.5;
        if (k == 6) o.poisson = -1;
        if (k == 7) o.young_Pa = 0;
        if (k == 8) o.progress = stop, o.user = &left;
        if (k == 9) o.element = "tet4", o.twist = 0.5;
        CHECK_INT(solve(&p, &o, &s, &r, &diag), want[k].err);
        CHECK(s == NULL);
        if (!strstr(diag.text, want[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, want[k].sentence);
    }
}

static void inertia_relief_balances_a_free_body(void)
{
    pal_problem p = bar_problem();
    pal_solve_options o = options_of("hex8", "linear");
    pal_solution *s = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {""};
    p.n_support = 0;
    o.inertia_relief = true;
    o.tolerance = 1e-10;
    pal_err err = solve(&p, &o, &s, &r, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    /* stress grows linearly from the free end: strain t x / (E L) */
    double strain = 200 / young_Pa;
    CHECK_NEAR(ux(s, 3.4, 0.05, 0.05) - ux(s, 3, 0.05, 0.05), 0.5 * strain * length_m, 1e-8);
    CHECK_NEAR(ux(s, 3.2, 0.05, 0.05) - ux(s, 3, 0.05, 0.05), 0.125 * strain * length_m, 1e-8);
    pal_solution_free(s);
}

int main(void)
{
    RUN(traction_stretches_a_bar_exactly);
    RUN(laws_stretch_a_bar_as_they_say);
    RUN(total_force_is_spread_over_what_the_region_holds);
    RUN(weight_points_and_moved_supports_are_exact);
    RUN(materials_hold_in_their_boxes);
    RUN(files_hold_what_was_solved);
    RUN(faults_are_named_with_their_entry);
    RUN(inertia_relief_balances_a_free_body);
    return check_report();
}
