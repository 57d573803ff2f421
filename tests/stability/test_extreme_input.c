/* Hard cases (catalogue.txt) that every model meets at load or at its door: materials, densities, poses and loads
 * that are no numbers, elements in the wrong order, of no volume or none at all, a contrast of a million, statics of
 * what nothing holds. */
#include "tests/stability/four_models.h"

enum { N_BAD = 5 };

/* at load and live, both with a sentence that names the key; the live one changes nothing */
static void materials_that_are_none_are_refused(void)
{
    static const double bad[3][N_BAD] = {
        {0.5, 0.51, -1, NAN, 1e300}, {0, -1, NAN, INFINITY, 1e300}, {0, -1, NAN, INFINITY, -1e300}};
    static const char *const key[3] = {"material.poisson", "material.young_Pa", "material.density_kg_m3"};
    for (int m = 0; m < FOUR_MODELS; m++)
        for (int k = 0; k < 3; k++) {
            four s;
            int good = 0;
            four_take(&s, m, true);
            REQUIRE(four_open(&s));
            const uint64_t hash = pal_world_hash(s.world);
            const pal_material keep = s.def->material;
            for (int q = 0; q < N_BAD; q++) {
                pal_world *none = NULL;
                pal_material to = keep;
                *(k == 0 ? &to.poisson : k == 1 ? &to.young_Pa : &to.density_kg_m3) = bad[k][q];
                good += pal_world_material(s.world, 0, &to, &s.diag) == PAL_ERR_REFUSED;
                good += strstr(s.diag.text, key[k]) != NULL;
                s.def->material = to;
                good += pal_world_create(s.scene, &s.diag, &none) == PAL_ERR_REFUSED && !none;
                good += strstr(s.diag.text, key[k]) != NULL;
                s.def->material = keep;
            }
            CHECK(hash == pal_world_hash(s.world));
            HARD_CASE_ALL(k < 2 ? "no_material" : "no_density", four_name[m], "refused by key, nothing changed", good,
                          4 * N_BAD);
            four_close(&s);
        }
}

static void poses_and_loads_that_are_no_numbers_leave_all_as_it_was(void)
{
    static const double bad[N_BAD] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    for (int m = 0; m < FOUR_MODELS; m++) {
        four s;
        int good = 0, n = 0;
        four_take(&s, m, true);
        four_effect(&s, "tool_push");
        pal_tools_default(s.scene, 1);
        REQUIRE(four_open(&s));
        const pal_pose fine = {.position_m = {0.015, 0.015, 0.04}, .quat = {1, 0, 0, 0}};
        REQUIRE(!pal_world_pose(s.world, 0, &fine) && four_step(&s, 5, 1.0 / 60));
        const uint64_t hash = pal_world_hash(s.world);
        for (int q = 0; q < N_BAD; q++)
            for (int c = 0; c < 3; c++, n += 4) {
                pal_pose pose = fine, turned = fine;
                double force[3] = {0, 0, 0};
                pose.position_m[c] = bad[q], turned.quat[c + 1] = q < 3 ? bad[q] : NAN;
                force[c] = q < 3 ? bad[q] : NAN;
                good += pal_world_pose(s.world, 0, &pose) == PAL_ERR_REFUSED;
                good += pal_world_pose(s.world, 0, &turned) == PAL_ERR_REFUSED;
                good += pal_world_load(s.world, 0, four_top(&s), force) == PAL_ERR_REFUSED;
                good += pal_world_step(s.world, q < 3 ? bad[q] : -1e300) == PAL_ERR_REFUSED;
            }
        CHECK(hash == pal_world_hash(s.world));
        HARD_CASE_ALL("no_numbers", four_name[m], "poses, loads and steps refused, state the same to the bit", good, n);
        /* 1e300 N is a number: it is shortened */
        REQUIRE(!pal_world_load(s.world, 0, four_top(&s), (double[3]){0, 0, 1e300}));
        CHECK(four_step(&s, 10, 1.0 / 60));
        CHECK(s.body->safeguards.n_capped > 0);
        four_close(&s);
    }
}

static void bodies_without_elements_are_refused_in_a_sentence(void)
{
    for (int m = 0; m < FOUR_MODELS; m++) {
        four s;
        pal_world *none = NULL;
        four_take(&s, m, true);
        const int n_tet = s.mesh.tets.n_tet, n_tri = s.mesh.surface.n_tri, n_hex = s.mesh.hexes.n_hex,
                  n_cell = s.cells.n_cell;
        s.mesh.tets.n_tet = s.mesh.surface.n_tri = s.mesh.hexes.n_hex = s.cells.n_cell = 0;
        const pal_err err = pal_world_create(s.scene, &s.diag, &none);
        printf("  %s: %d %s\n", four_name[m], err, s.diag.text);
        HARD_CASE_ALL("no_element", four_name[m], "refused in a sentence",
                      err == PAL_ERR_REFUSED && strlen(s.diag.text) > 20, 1);
        s.mesh.tets.n_tet = n_tet, s.mesh.surface.n_tri = n_tri, s.mesh.hexes.n_hex = n_hex, s.cells.n_cell = n_cell;
        pal_world_destroy(none);
        four_close(&s);
    }
}

/* pressed for two seconds and let go: is it back? percent of S that is left */
static double pressed_and_left(four *s)
{
    const double more = s->model == FOUR_ADAPTIVE ? 10 : 1;
    four_load(s, (const double[3]){0.02 * more, 0, -0.03 * more});
    if (!four_step(s, 120, 1.0 / 60)) return NAN;
    const double pressed = four_off(s);
    four_load(s, (const double[3]){0, 0, 0});
    return pressed > 0.1 && pressed < 50 && four_step(s, 600, 1.0 / 60) ? four_off(s) : NAN;
}

/* bulletphysics/bullet3 issue 3882: one tetrahedron whose nodes are in the wrong order makes a body grow without bound
 */
static void one_element_in_the_wrong_order_is_refused_by_its_number(void)
{
    for (int m = 0; m < FOUR_MODELS; m++) {
        four s;
        pal_world *none = NULL;
        bool named;
        four_take(&s, m, true);
        int32_t *c = m == FOUR_ADAPTIVE ? s.mesh.surface.tri + 3 * 7 : m == FOUR_SOLID ? NULL : s.mesh.tets.tet + 4 * 7;
        if (c) {
            const int32_t swap = c[1];
            c[1] = c[2], c[2] = swap;
        }
        /* two corners of a cell exchanged */
        for (int k = 0; k < 3 && !c; k++) {
            const double swap = s.cells.x[k];
            s.cells.x[k] = s.cells.x[k + 3], s.cells.x[k + 3] = swap;
        }
        if (m == FOUR_SPRINGS || m == FOUR_FEM) {
            /* every prepared mesh that is read goes through this check */
            named = pal_tets_check(&s.mesh.tets, &s.diag) == PAL_ERR_REFUSED && strstr(s.diag.text, "the first is 7");
            if (m == FOUR_FEM) pal_entry_put_text(&s.def->model, "element", "tet4", NULL);
        } else {
            named = pal_world_create(s.scene, &s.diag, &none) == PAL_ERR_REFUSED;
            named = named && strstr(s.diag.text, m == FOUR_SOLID ? "control cell 0" : "triangles 0 and 7");
        }
        printf("  %s: %s\n", four_name[m], s.diag.text);
        HARD_CASE_ALL("wrong_order", four_name[m], "refused at load, by its number", named, 1);
        /* given to the model all the same, as a program might do, it does not grow */
        if (m == FOUR_SPRINGS || m == FOUR_FEM) {
            REQUIRE(four_open(&s));
            HARD_CASE("wrong_order", four_name[m], "given past the check, pressed and let go: off rest after 10 s",
                      pressed_and_left(&s), 0.1, "% S");
        }
        four_close(&s);
    }
}

/* an inner node of a box almost, or wholly, onto the plane of its neighbours */
static void flatten_tetrahedron(pal_tets *tets, double left)
{
    const int n[3] = {3, 3, 3}, node = box_node(n, 1, 1, 2);
    const int32_t *of = tets->tet;
    double middle[3] = {0, 0, 0}, *x = tets->x + 3 * node;
    while (of[0] != node && of[1] != node && of[2] != node && of[3] != node) of += 4;
    for (int c = 0; c < 4; c++)
        if (of[c] != node) pal_axpy3(middle, 1.0 / 3, tets->x + 3 * of[c]);
    for (int c = 0; c < 3; c++) x[c] = middle[c] + left * (x[c] - middle[c]);
}

/* a corner of a triangle onto the middle of the opposite edge */
static void flatten_triangle(pal_surface *surface, double left)
{
    const int32_t *c = surface->tri + 3 * 40;
    double *x = surface->x + 3 * c[0];
    for (int k = 0; k < 3; k++) {
        const double middle = 0.5 * (surface->x[3 * c[1] + k] + surface->x[3 * c[2] + k]);
        x[k] = middle + left * (x[k] - middle);
    }
}

/* a sub-step as long as that of the body without it is asked for */
static void slivers_are_borne_or_refused(void)
{
    for (int m = 0; m < FOUR_MODELS; m++)
        for (int flat = 0; flat < 2; flat++) {
            const double left = flat ? 0 : 1e-4;
            const char *what =
                flat ? "sub-steps for a flat one, of those without" : "sub-steps for a sliver, of those without";
            four s, plain;
            four_take(&s, m, true);
            four_take(&plain, m, true);
            if (m == FOUR_SPRINGS) flatten_tetrahedron(&s.mesh.tets, left);
            if (m == FOUR_FEM) flatten_tetrahedron(&s.mesh.tets, left);
            if (m == FOUR_FEM) pal_entry_put_text(&s.def->model, "element", "tet4", NULL);
            if (m == FOUR_ADAPTIVE) flatten_triangle(&s.mesh.surface, left);
            for (int i = 0; i < s.cells.n_vertex; i++)
                if (s.cells.x[3 * i + 2] > 0.01) s.cells.x[3 * i + 2] *= left;
            if (flat && (m == FOUR_ADAPTIVE || m == FOUR_SOLID)) {
                pal_world *none = NULL;
                const pal_err err = pal_world_create(s.scene, &s.diag, &none);
                printf("  %s: %s\n", four_name[m], s.diag.text);
                HARD_CASE_ALL(
                    "slivers", four_name[m], "a flat one is refused by its number",
                    err == PAL_ERR_REFUSED && strstr(s.diag.text, m == FOUR_SOLID ? "cell 33" : "triangle 40"), 1);
            } else {
                REQUIRE(four_open(&s) && four_open(&plain));
                REQUIRE(four_step(&s, 1, 1.0 / 60) && four_step(&plain, 1, 1.0 / 60));
                const double times = (double)pal_world_substeps(s.world) / pal_world_substeps(plain.world);
                HARD_CASE("slivers", four_name[m], what, times, 1.1, "");
                if (times < 2)
                    HARD_CASE("slivers", four_name[m], "pressed and let go: off rest after 10 s", pressed_and_left(&s),
                              0.1, "% S");
            }
            four_close(&s), four_close(&plain);
        }
}

/* constants on a grid, as calibration gives them; of a surface regions of its material */
static void a_contrast_of_a_million_is_too_much_for_explicit_steps_and_said_so(void)
{
    static const double k_J[2] = {2e3, 2e-3};
    for (int m = 0; m <= FOUR_ADAPTIVE; m++) {
        four s;
        pal_world *none = NULL;
        four_take(&s, m, true);
        if (m == FOUR_SPRINGS)
            s.def->spring_grid =
                (pal_spring_grid){.n = {1, 1, 2}, .high_m = {0.03, 0.03, 0.03}, .k_J = {k_J, NULL, k_J}};
        s.def->n_region = m == FOUR_ADAPTIVE;
        s.def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                        .young_Pa = 1e10,
                                        .poisson = NAN,
                                        .density_kg_m3 = NAN,
                                        .low_m = {-1, -1, -1},
                                        .high_m = {1, 1, 0}};
        const pal_err err = pal_world_create(s.scene, &s.diag, &none);
        printf("  %s: %s\n", four_name[m], s.diag.text);
        HARD_CASE_ALL("contrast", four_name[m], "refused with the number of sub-steps",
                      err == PAL_ERR_BUDGET && strstr(s.diag.text, "max_substep allows 2000"), 1);
        four_close(&s);
    }
}

static void statics_of_what_nothing_holds_are_refused(void)
{
    for (int m = 0; m < FOUR_MODELS; m++) {
        four s;
        pal_world *none = NULL;
        four_take(&s, m, false);
        pal_entry_init(&s.def->solver, "solver", "static_newton");
        const pal_err err = pal_world_create(s.scene, &s.diag, &none);
        printf("  %s: %s\n", four_name[m], s.diag.text);
        HARD_CASE_ALL("free_static", four_name[m],
                      m < FOUR_FEM ? "no static solver: refused in a sentence" : "refused in a sentence",
                      err == PAL_ERR_REFUSED && strlen(s.diag.text) > 20, 1);
        four_close(&s);
    }
}

int main(void)
{
    RUN(materials_that_are_none_are_refused);
    RUN(poses_and_loads_that_are_no_numbers_leave_all_as_it_was);
    RUN(bodies_without_elements_are_refused_in_a_sentence);
    RUN(one_element_in_the_wrong_order_is_refused_by_its_number);
    RUN_LONG(slivers_are_borne_or_refused);
    RUN(a_contrast_of_a_million_is_too_much_for_explicit_steps_and_said_so);
    RUN(statics_of_what_nothing_holds_are_refused);
    return check_report();
}
