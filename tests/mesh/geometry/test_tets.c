/* Tetrahedral meshes: boundary, edges, faces, components, faults, against counts known by hand and Euler's formula. */
#include "server/mesh/geometry/tets.h"
#include "server/mesh/voxel/voxels.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

static pal_diagnostic diag;

/* one voxel split into five */
static const double CUBE[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                  {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
static const int32_t FIVE[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};

static pal_tets make(int n_node, const double (*x)[3], int n_tet, const int32_t (*tet)[4])
{
    pal_tets t = {.n_node = n_node, .n_tet = n_tet, .edge_m = 1};
    t.x = malloc((size_t)n_node * sizeof *x);
    t.tet = malloc((size_t)n_tet * sizeof *tet);
    if (!t.x || !t.tet) abort();
    memcpy(t.x, x, (size_t)n_node * sizeof *x);
    memcpy(t.tet, tet, (size_t)n_tet * sizeof *tet);
    return t;
}

static void five_of_a_cube_have_18_edges_16_faces_12_outside(void)
{
    pal_tets t = make(8, CUBE, 5, FIVE);
    int32_t *edge, *face;
    int n_edge, n_face, n_part;
    CHECK_NEAR(pal_tets_volume(&t), 1, 1e-15);
    REQUIRE(!pal_tets_find_boundary(&t));
    CHECK_INT(t.n_face, 12);
    for (int i = 0; i < 8; i++) CHECK_INT(t.on_surface[i], 1);
    REQUIRE(!pal_tets_edges(&t, &edge, &n_edge));
    REQUIRE(!pal_tets_faces(&t, &face, &n_face));
    CHECK_INT(n_edge, 18);
    CHECK_INT(n_face, 16);
    for (int k = 0; k < n_edge; k++) {
        CHECK(edge[2 * k] < edge[2 * k + 1]);
        if (k > 0) CHECK(edge[2 * k] > edge[2 * k - 2] || edge[2 * k + 1] > edge[2 * k - 1]);
    }
    int32_t label[5];
    REQUIRE(!pal_tets_components(&t, label, &n_part));
    CHECK_INT(n_part, 1);
    pal_surface hull = {.n_vertex = 8, .n_tri = 12, .x = t.x, .tri = t.face};
    CHECK_NEAR(pal_surface_volume(&hull), 1, 1e-15);
    CHECK_INT(pal_tets_check(&t, &diag), PAL_ERR_OK);
    free(edge);
    free(face);
    pal_tets_free(&t);
}

static bool torus_mesh(pal_tets *out)
{
    pal_surface s = shape_torus(0.1, 0.04, 40, 20);
    pal_voxel_options options = {.resolution = 24, .border = true};
    pal_voxels v;
    bool ok = !pal_voxels_fill(&s, &options, &v, NULL, &diag);
    if (ok) {
        ok = !pal_voxels_split(&v, out);
        pal_voxels_free(&v);
    }
    pal_surface_free(&s);
    return ok;
}

static void torus_has_eulers_numbers(void)
{
    pal_tets t;
    REQUIRE(torus_mesh(&t));
    int32_t *edge, *face;
    int n_edge, n_face;
    REQUIRE(!pal_tets_edges(&t, &edge, &n_edge));
    REQUIRE(!pal_tets_faces(&t, &face, &n_face));
    /* solid torus 0, its surface 0 */
    CHECK_INT(t.n_node - n_edge + n_face - t.n_tet, 0);
    CHECK_INT(2 * n_face, 4 * t.n_tet + t.n_face);
    CHECK_INT(3 * t.n_face % 2, 0);
    int n_surface = 0;
    for (int i = 0; i < t.n_node; i++) n_surface += t.on_surface[i];
    CHECK_INT(n_surface - 3 * t.n_face / 2 + t.n_face, 0);
    free(edge);
    free(face);
    pal_tets_free(&t);
}

static void separate_pieces_are_labelled_in_order(void)
{
    double x[16][3];
    int32_t tet[10][4];
    for (int i = 0; i < 16; i++) {
        memcpy(x[i], CUBE[i % 8], sizeof x[i]);
        x[i][0] += i / 8 * 3;
    }
    for (int t = 0; t < 10; t++)
        for (int k = 0; k < 4; k++) tet[t][k] = FIVE[t % 5][k] + t / 5 * 8;
    pal_tets t = make(16, (const double(*)[3])x, 10, (const int32_t(*)[4])tet);
    int32_t label[10];
    int n;
    REQUIRE(!pal_tets_components(&t, label, &n));
    CHECK_INT(n, 2);
    for (int k = 0; k < 10; k++) CHECK_INT(label[k], k / 5);
    pal_tets_free(&t);
}

static void expect_fault(pal_tets *t, const char *words)
{
    diag.text[0] = 0;
    CHECK_INT(pal_tets_check(t, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, words)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, words);
    pal_tets_free(t);
}

static void every_fault_is_named(void)
{
    pal_tets t = make(8, CUBE, 5, FIVE);
    t.tet[7] = 8;
    expect_fault(&t, "out of range");
    t = make(8, CUBE, 5, FIVE);
    t.tet[7] = -1;
    expect_fault(&t, "out of range");
    t = make(8, CUBE, 5, FIVE);
    t.tet[1] = t.tet[2];
    expect_fault(&t, "used twice, the first is 0");
    t = make(8, CUBE, 5, FIVE);
    t.tet[4] = 2, t.tet[5] = 3;
    expect_fault(&t, "without positive volume, the first is 1");
    t = make(8, CUBE, 5, FIVE);
    t.x[3] = NAN;
    expect_fault(&t, "without positive volume");
    int32_t crowd[7][4];
    memcpy(crowd, FIVE, sizeof FIVE);
    memcpy(crowd[5], FIVE[4], sizeof crowd[5]);
    memcpy(crowd[6], FIVE[4], sizeof crowd[6]);
    t = make(8, CUBE, 7, (const int32_t(*)[4])crowd);
    expect_fault(&t, "more than two tetrahedra");
    t = make(8, CUBE, 5, FIVE);
    REQUIRE(!pal_tets_find_boundary(&t));
    t.n_face--;
    expect_fault(&t, "not closed: 3 edges");
    t = make(8, CUBE, 1, FIVE);
    expect_fault(&t, "4 nodes of no tetrahedron, the first is 3");
}

static void nothing_is_fine(void)
{
    pal_tets t = {0};
    int32_t *edge;
    int n;
    CHECK_INT(pal_tets_check(&t, &diag), PAL_ERR_OK);
    CHECK_NEAR(pal_tets_volume(&t), 0, 0);
    REQUIRE(!pal_tets_find_boundary(&t));
    CHECK_INT(t.n_face, 0);
    REQUIRE(!pal_tets_edges(&t, &edge, &n));
    CHECK_INT(n, 0);
    free(edge);
    pal_tets_free(&t);
}

/* thousands of tetrahedra around one edge: long buckets are sorted too */
static void a_fan_around_one_edge_is_sorted(void)
{
    enum { N = 3000 };
    pal_tets t = {.n_node = N + 2, .n_tet = N, .edge_m = 1};
    t.x = calloc((size_t)t.n_node * 3, sizeof *t.x);
    t.tet = malloc((size_t)N * 4 * sizeof *t.tet);
    REQUIRE(t.x && t.tet);
    t.x[5] = 1;
    for (int i = 0; i < N; i++) {
        double a = 2 * SHAPE_PI * i / N;
        t.x[3 * (i + 2)] = cos(a), t.x[3 * (i + 2) + 1] = sin(a);
        int32_t four[4] = {0, 2 + i, 2 + (i + 1) % N, 1};
        memcpy(t.tet + 4 * i, four, sizeof four);
    }
    REQUIRE(!pal_tets_find_boundary(&t));
    CHECK_INT(t.n_face, 2 * N);
    CHECK_INT(pal_tets_check(&t, &diag), PAL_ERR_OK);
    int32_t *edge;
    int n;
    REQUIRE(!pal_tets_edges(&t, &edge, &n));
    CHECK_INT(n, 3 * N + 1);
    free(edge);
    pal_tets_free(&t);
}

int main(void)
{
    RUN(five_of_a_cube_have_18_edges_16_faces_12_outside);
    RUN(torus_has_eulers_numbers);
    RUN(separate_pieces_are_labelled_in_order);
    RUN(every_fault_is_named);
    RUN(nothing_is_fine);
    RUN(a_fan_around_one_edge_is_sorted);
    return check_report();
}
