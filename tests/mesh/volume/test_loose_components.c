/* Components that nothing holds: what is joined by faces is one, small ones without support go, larger ones are
 * refused, and what is left is a whole mesh. */
#include "server/mesh/cells/cell_lattice.h"
#include "server/mesh/volume/loose_components.h"
#include "tests/check.h"
#include "tests/fixtures/cell_check.h"
#include "tests/fixtures/shapes.h"

static pal_diagnostic diag;

/* boxes of whole millimetres as voxels of 1 mm that are measured; x, y, z, then the other corner */
static bool make_boxes(int n, const double box[][6], int resolution, pal_prepared *out)
{
    pal_surface s = {0};
    for (int k = 0; k < n; k++) {
        double low[3], high[3];
        for (int c = 0; c < 3; c++) low[c] = 1e-3 * box[k][c], high[c] = 1e-3 * box[k][c + 3];
        s = k ? shape_join(s, shape_box(low, high)) : shape_box(low, high);
    }
    pal_voxel_options options = {.resolution = resolution, .border = true, .min_fill = 0.1};
    bool good = !pal_prepared_make(&s, &options, out, NULL, &diag);
    if (!good) CHECK_FAIL("%s", diag.text);
    pal_surface_free(&s);
    return good;
}

/* holds the nodes from low to high, millimetres */
static uint8_t *hold(const pal_prepared *mesh, int axis, double low, double high)
{
    uint8_t *fixed = calloc((size_t)mesh->tets.n_node, 1);
    for (int i = 0; fixed && i < mesh->tets.n_node; i++) {
        double at = 1e3 * mesh->tets.x[3 * i + axis];
        fixed[i] = at > low - 1e-6 && at < high + 1e-6;
    }
    return fixed;
}

/* the mesh is a whole one of n voxels that hang together in n_component components, and can be saved */
static void check_whole(const pal_prepared *mesh, int n_hex, int n_component)
{
    int n = 0;
    uint8_t *bytes = NULL;
    size_t n_byte = 0;
    pal_prepared again;
    CHECK_INT(mesh->hexes.n_hex, n_hex);
    CHECK_INT(mesh->tets.n_tet, 5 * n_hex);
    CHECK_INT(pal_tets_check(&mesh->tets, &diag), PAL_ERR_OK);
    int32_t *label = calloc((size_t)mesh->tets.n_tet, sizeof *label);
    REQUIRE(label && !pal_tets_components(&mesh->tets, label, &n));
    free(label);
    CHECK_INT(n, n_component);
    CHECK_NEAR(pal_tets_volume(&mesh->tets), n_hex * 1e-9, 1e-15);
    CHECK_INT(mesh->skin.n_vertex, mesh->surface.n_vertex);
    for (int e = 0; e < mesh->hexes.n_hex; e++) CHECK_NEAR(mesh->hexes.fill[e], 1, 1e-5);
    /* reads the hexahedra from the tetrahedra again */
    REQUIRE(!pal_prepared_bytes(mesh, &bytes, &n_byte) && !pal_prepared_parse("again", bytes, n_byte, &again, &diag));
    CHECK(!memcmp(again.hexes.node, mesh->hexes.node, (size_t)n_hex * 32));
    pal_prepared_free(&again);
    free(bytes);
}

static void parts_that_share_an_edge_or_a_corner_only_are_separate(void)
{
    /* beside a cube of four voxels: in a face, along an edge, in a corner */
    static const double box[3][2][6] = {{{0, 0, 0, 4, 4, 4}, {4, 0, 0, 8, 4, 4}},
                                        {{0, 0, 0, 4, 4, 4}, {4, 4, 0, 8, 8, 4}},
                                        {{0, 0, 0, 4, 4, 4}, {4, 4, 4, 8, 8, 8}}};
    for (int k = 0; k < 3; k++) {
        pal_prepared mesh;
        pal_loose_components parts;
        REQUIRE(make_boxes(2, box[k], 8, &mesh));
        uint8_t *fixed = calloc((size_t)mesh.tets.n_node, 1);
        REQUIRE(fixed && !pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag));
        CHECK_INT(parts.n_component, k == 0 ? 1 : 2);
        CHECK_INT(parts.n_dropped, 0);
        free(fixed);
        pal_prepared_free(&mesh);
    }
}

/* a voxel that meets the body of 1000 in an edge: six motions of its own but for the hinge */
static const double speck[2][6] = {{0, 0, 0, 10, 10, 10}, {10, 10, 4, 11, 11, 5}};

static void a_small_component_without_support_is_dropped_and_reported(void)
{
    pal_prepared mesh;
    pal_loose_components parts;
    REQUIRE(make_boxes(2, speck, 11, &mesh));
    CHECK_INT(mesh.hexes.n_hex, 1001);
    uint8_t *fixed = hold(&mesh, 2, 0, 0);
    REQUIRE(fixed && !pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag));
    free(fixed);
    CHECK_INT(parts.n_component, 2);
    CHECK_INT(parts.n_dropped, 1);
    CHECK_NEAR(parts.volume_m3, 1001e-9, 1e-15);
    CHECK_NEAR(parts.dropped_m3, 1e-9, 1e-15);
    CHECK_NEAR(parts.max_dropped_m3, 1e-9, 1e-15);
    /* one component, and it is held: every node reaches a support through shared faces */
    check_whole(&mesh, 1000, 1);
    pal_loose_components_describe(&parts, "b", &diag);
    CHECK_TEXT(diag.text, "body \"b\": dropped 1 of 2 components, 0.001 ml of 1 ml (0.1 %): small and without support");
    /* again there is nothing to drop */
    fixed = hold(&mesh, 2, 0, 0);
    REQUIRE(fixed && !pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag));
    CHECK_INT(parts.n_dropped, 0);
    pal_loose_components_describe(&parts, "b", &diag);
    CHECK_TEXT(diag.text, "");
    free(fixed);
    pal_prepared_free(&mesh);
}

static void a_small_component_that_is_held_stays(void)
{
    pal_prepared mesh;
    pal_loose_components parts;
    REQUIRE(make_boxes(2, speck, 11, &mesh));
    uint8_t *fixed = hold(&mesh, 0, 11, 11);
    for (int i = 0; fixed && i < mesh.tets.n_node; i++) fixed[i] |= mesh.tets.x[3 * i + 2] < 1e-6;
    REQUIRE(fixed && !pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag));
    CHECK_INT(parts.n_dropped, 0);
    check_whole(&mesh, 1001, 2);
    free(fixed);
    pal_prepared_free(&mesh);
}

/* beside the 1000 voxels of the body, 9 go and 11 do not */
static void the_limit_is_one_in_a_hundred_of_the_largest(void)
{
    for (int n = 9; n <= 11; n += 2) {
        const double box[2][6] = {{0, 0, 0, 10, 10, 10}, {12, 0, 5, 13, n, 6}};
        pal_prepared mesh;
        pal_loose_components parts;
        REQUIRE(make_boxes(2, box, 13, &mesh));
        uint8_t *fixed = hold(&mesh, 2, 0, 0);
        CHECK_INT(pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag),
                  n < 10 ? PAL_ERR_OK : PAL_ERR_REFUSED);
        check_whole(&mesh, n < 10 ? 1000 : 1011, n < 10 ? 1 : 2);
        free(fixed);
        pal_prepared_free(&mesh);
    }
}

/* two large ones side by side and one above them, which is not held */
static const double three[3][6] = {{0, 0, 0, 4, 4, 4}, {8, 0, 0, 12, 4, 4}, {0, 0, 6, 5, 4, 10}};

static void a_large_component_without_support_is_refused(void)
{
    pal_prepared mesh;
    pal_loose_components parts;
    REQUIRE(make_boxes(3, three, 12, &mesh));
    uint8_t *fixed = hold(&mesh, 2, 0, 0);
    CHECK_INT(pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "body \"b\": 1 of 3 components has no support, the largest of 0.08 ml (38.5 % of the body) "
                          "around (0.0025, 0.0020, 0.0080) m: hold each component by a support");
    check_whole(&mesh, 64 + 64 + 80, 3);
    free(fixed);
    fixed = hold(&mesh, 2, 10, 10);
    CHECK_INT(pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "2 of 3 components have no support, the largest of 0.064 ml"));
    free(fixed);
    /* a support on each */
    fixed = calloc((size_t)mesh.tets.n_node, 1);
    REQUIRE(fixed != NULL);
    memset(fixed, 1, (size_t)mesh.tets.n_node);
    CHECK_INT(pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag), PAL_ERR_OK);
    CHECK_INT(parts.n_dropped, 0);
    /* or the largest alone, held or not */
    memset(fixed, 0, (size_t)mesh.tets.n_node);
    REQUIRE(!pal_loose_components_drop("b", fixed, true, &mesh, &parts, &diag));
    CHECK_INT(parts.n_dropped, 2);
    CHECK_NEAR(parts.dropped_m3, 128e-9, 1e-15);
    check_whole(&mesh, 80, 1);
    pal_loose_components_describe(&parts, "b", &diag);
    CHECK(strstr(diag.text, "dropped 2 of 3 components") && strstr(diag.text, "only the largest is kept"));
    free(fixed);
    pal_prepared_free(&mesh);
}

static void a_free_body_keeps_its_large_components_alone(void)
{
    const double box[3][6] = {{0, 0, 0, 10, 10, 10}, {12, 0, 0, 16, 10, 10}, {10, 10, 4, 11, 11, 5}};
    pal_prepared mesh;
    pal_loose_components parts;
    REQUIRE(make_boxes(3, box, 16, &mesh));
    uint8_t *fixed = calloc((size_t)mesh.tets.n_node, 1);
    REQUIRE(fixed && !pal_loose_components_drop("b", fixed, false, &mesh, &parts, &diag));
    CHECK_INT(parts.n_component, 3);
    CHECK_INT(parts.n_dropped, 1);
    check_whole(&mesh, 1400, 2);
    free(fixed);
    pal_prepared_free(&mesh);
}

/* ---- control cells ---- */

/* the last column is as narrow as `last_width` says */
static double last_width;
static void narrow(const double at[3], double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = 0.01 * at[c];
    if (at[0] > 2) x[0] = 0.01 * (2 + last_width * (at[0] - 2));
}

static bool make_cells(const char *rows, pal_cells *out)
{
    pal_cell_lattice lattice = {.n = {3, 2, 1}, .rows = rows, .place = narrow};
    return !pal_cell_lattice_make(&lattice, out, &diag);
}

static void control_cells_are_kept_by_the_same_rule(void)
{
    static const char apart[] = "##./..#"; /* in an edge */
    static const struct {
        double width;
        bool largest_only, fixed[2];
        pal_err err;
        int n_cell;
    } turn[] = {{1, false, {true, false}, PAL_ERR_REFUSED, 3},  {1, false, {true, true}, PAL_ERR_OK, 3},
                {1, false, {false, false}, PAL_ERR_OK, 3},      {1, true, {true, false}, PAL_ERR_OK, 2},
                {0.0199, false, {true, false}, PAL_ERR_OK, 2},  {0.0201, false, {true, false}, PAL_ERR_REFUSED, 3},
                {0.0199, false, {false, false}, PAL_ERR_OK, 2}, {0.0199, false, {true, true}, PAL_ERR_OK, 3},
                {0.0201, false, {false, false}, PAL_ERR_OK, 3}};
    for (size_t k = 0; k < sizeof turn / sizeof *turn; k++) {
        pal_cells cells;
        pal_loose_components parts;
        last_width = turn[k].width;
        REQUIRE(make_cells(apart, &cells));
        uint8_t *fixed = calloc((size_t)cells.n_vertex, 1);
        REQUIRE(fixed != NULL);
        for (int i = 0; i < cells.n_vertex; i++) {
            const double *x = cells.x + 3 * i;
            fixed[i] = (turn[k].fixed[0] && x[0] < 1e-9) || (turn[k].fixed[1] && x[1] > 0.02 - 1e-9);
        }
        CHECK_INT(pal_loose_cells_drop("c", fixed, turn[k].largest_only, &cells, &parts, &diag), turn[k].err);
        CHECK_INT(cells.n_cell, turn[k].n_cell);
        CHECK_INT(cells_check(&cells, NULL, &diag), PAL_ERR_OK);
        pal_cells_topology facts;
        REQUIRE(!pal_cells_find_topology(&cells, &facts));
        CHECK_INT(facts.n_piece, turn[k].n_cell == 2 ? 1 : 2);
        if (!turn[k].err) CHECK_NEAR(pal_cells_volume(&cells, NULL), parts.volume_m3 - parts.dropped_m3, 1e-15);
        free(fixed);
        pal_cells_free(&cells);
    }
}

int main(void)
{
    RUN(parts_that_share_an_edge_or_a_corner_only_are_separate);
    RUN(a_small_component_without_support_is_dropped_and_reported);
    RUN(a_small_component_that_is_held_stays);
    RUN(the_limit_is_one_in_a_hundred_of_the_largest);
    RUN(a_large_component_without_support_is_refused);
    RUN(a_free_body_keeps_its_large_components_alone);
    RUN(control_cells_are_kept_by_the_same_rule);
    return check_report();
}
