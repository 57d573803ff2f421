/* VTK files read back as text: every count, index and number. */
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/vtk_file.h"
#include "server/mesh/volume/hexes.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

#include <locale.h>
#include <sys/stat.h>

static char path[64];

/* the words of a file, one after the other */
typedef struct words {
    char *text, *at;
} words;

static bool open_words(words *w)
{
    uint8_t *bytes;
    size_t n;
    pal_diagnostic diag;
    memset(w, 0, sizeof *w);
    if (pal_file_read(path, 1 << 24, &bytes, &n, &diag)) return false;
    w->text = realloc(bytes, n + 1);
    if (!w->text) abort();
    w->text[n] = 0;
    w->at = w->text;
    return true;
}

static bool skip_to(words *w, const char *word)
{
    char *found = strstr(w->at, word);
    if (found) w->at = found + strlen(word);
    return found != NULL;
}

static double number(words *w)
{
    char *end;
    double value = strtod(w->at, &end);
    if (end == w->at) return NAN;
    w->at = end;
    return value;
}

/* volume of the cell by VTK's order of corners: lower face around, upper face around */
static double volume_of(const double *x, const int node[8])
{
    /* the hexahedron of VTK numbers as six tetrahedra around the diagonal 0-6 */
    static const int SIX[6][4] = {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}};
    double sum = 0;
    for (int t = 0; t < 6; t++) {
        double e[3][3];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) e[c][k] = x[3 * node[SIX[t][c + 1]] + k] - x[3 * node[0] + k];
        sum += (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) /
               6;
    }
    return sum;
}

static void hexahedra_and_fields_read_back_equal(void)
{
    pal_surface ball = shape_sphere(0.1);
    ball.origin_m[0] = 2.5;
    pal_voxel_options options = {.resolution = 6, .border = true};
    pal_voxels voxels;
    pal_voxel_report report;
    pal_tets tets;
    pal_hexes hexes;
    pal_diagnostic diag;
    REQUIRE(!pal_voxels_fill(&ball, &options, &voxels, &report, &diag) && !pal_voxels_split(&voxels, &tets));
    REQUIRE(!pal_hexes_find(&tets, &hexes, &diag) && !pal_hexes_fill(&hexes, &tets, &ball, &diag));
    double *u = malloc((size_t)tets.n_node * 24), *fill = malloc((size_t)hexes.n_hex * 8);
    uint64_t state = 4;
    for (int i = 0; i < 3 * tets.n_node; i++) u[i] = random_signed(&state) * pow(10, i % 20 - 10);
    for (int e = 0; e < hexes.n_hex; e++) fill[e] = (double)hexes.fill[e];
    pal_vtk_field point[2] = {{"displacement m", 3, u}, {"size", 1, u}}, cell = {"fill", 1, fill};
    pal_vtk_grid grid = {.title = "a ball\nof voxels",
                         .n_node = tets.n_node,
                         .n_element = hexes.n_hex,
                         .n_corner = 8,
                         .x = tets.x,
                         .origin_m = tets.origin_m,
                         .node = hexes.node,
                         .n_point = 2,
                         .n_cell = 1,
                         .point = point,
                         .cell = &cell};
    setlocale(LC_NUMERIC, "de_DE.UTF-8"); /* where there is one: the point stays a point */
    REQUIRE(!pal_mesh_write_vtk(path, &grid, &diag));
    setlocale(LC_NUMERIC, "C");

    words w;
    REQUIRE(open_words(&w));
    static const char head[] =
        "# vtk DataFile Version 3.0\na ball_of voxels\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS ";
    CHECK(!strncmp(w.text, head, sizeof head - 1));
    REQUIRE(skip_to(&w, "POINTS "));
    CHECK_INT(number(&w), tets.n_node);
    REQUIRE(skip_to(&w, " double\n"));
    int n_same = 0;
    for (int i = 0; i < 3 * tets.n_node; i++) n_same += number(&w) == tets.x[i] + tets.origin_m[i % 3];
    CHECK_INT(n_same, 3 * tets.n_node);
    REQUIRE(skip_to(&w, "\nCELLS "));
    CHECK_INT(number(&w), hexes.n_hex);
    CHECK_INT(number(&w), 9 * hexes.n_hex);
    double worst = 0, h3 = pow(tets.edge_m, 3);
    for (int e = 0; e < hexes.n_hex; e++) {
        int node[8];
        CHECK_INT(number(&w), 8);
        for (int c = 0; c < 8; c++) {
            node[c] = (int)number(&w);
            if (node[c] < 0 || node[c] >= tets.n_node) node[c] = 0;
        }
        worst = fmax(worst, fabs(volume_of(tets.x, node) / h3 - 1));
    }
    CHECK_LE(worst, 1e-9);
    REQUIRE(skip_to(&w, "\nCELL_TYPES "));
    CHECK_INT(number(&w), hexes.n_hex);
    for (int e = 0; e < hexes.n_hex; e++) CHECK_INT(number(&w), 12);
    REQUIRE(skip_to(&w, "\nPOINT_DATA "));
    CHECK_INT(number(&w), tets.n_node);
    REQUIRE(skip_to(&w, "VECTORS displacement_m double\n"));
    n_same = 0;
    for (int i = 0; i < 3 * tets.n_node; i++) n_same += number(&w) == u[i];
    CHECK_INT(n_same, 3 * tets.n_node);
    REQUIRE(skip_to(&w, "SCALARS size double 1\nLOOKUP_TABLE default\n"));
    n_same = 0;
    for (int i = 0; i < tets.n_node; i++) n_same += number(&w) == u[i];
    CHECK_INT(n_same, tets.n_node);
    REQUIRE(skip_to(&w, "\nCELL_DATA "));
    CHECK_INT(number(&w), hexes.n_hex);
    REQUIRE(skip_to(&w, "SCALARS fill double 1\nLOOKUP_TABLE default\n"));
    n_same = 0;
    for (int e = 0; e < hexes.n_hex; e++) n_same += number(&w) == fill[e];
    CHECK_INT(n_same, hexes.n_hex);
    CHECK(isnan(number(&w)));
    free(w.text);
    free(u);
    free(fill);
    pal_hexes_free(&hexes);
    pal_tets_free(&tets);
    pal_voxels_free(&voxels);
    pal_surface_free(&ball);
}

static void tetrahedra_keep_their_order(void)
{
    static const double x[30] = {0,  0,  0, 1, 0,  0, 0, 1, 0,  0,  0, 1,  .5, 0,  0,
                                 .5, .5, 0, 0, .5, 0, 0, 0, .5, .5, 0, .5, 0,  .5, .5};
    static const int32_t node[10] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
    static const int type[11] = {[4] = 10, [10] = 24};
    pal_diagnostic diag;
    for (int n_corner = 4; n_corner <= 10; n_corner += 6) {
        pal_vtk_grid grid = {.n_node = 10, .n_element = 1, .n_corner = n_corner, .x = x, .node = node};
        REQUIRE(!pal_mesh_write_vtk(path, &grid, &diag));
        words w;
        REQUIRE(open_words(&w));
        REQUIRE(skip_to(&w, "\nCELLS 1 "));
        CHECK_INT(number(&w), n_corner + 1);
        CHECK_INT(number(&w), n_corner);
        for (int c = 0; c < n_corner; c++) CHECK_INT(number(&w), c);
        REQUIRE(skip_to(&w, "CELL_TYPES 1\n"));
        CHECK_INT(number(&w), type[n_corner]);
        CHECK(!strstr(w.text, "POINT_DATA") && !strstr(w.text, "CELL_DATA"));
        free(w.text);
    }
}

static void what_cannot_be_written_leaves_nothing_behind(void)
{
    static const double x[12] = {0};
    static const int32_t node[4] = {0, 1, 2, 3};
    pal_diagnostic diag;
    pal_vtk_grid grid = {.n_node = 4, .n_element = 1, .n_corner = 5, .x = x, .node = node};
    unlink(path);
    CHECK_INT(pal_mesh_write_vtk(path, &grid, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "elements of 5 corners"));
    pal_vtk_field field = {"stress", 6, x};
    grid.n_corner = 4, grid.point = &field, grid.n_point = 1;
    CHECK_INT(pal_mesh_write_vtk(path, &grid, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "stress has 6 components"));
    CHECK(access(path, F_OK) != 0);
    field.n_component = 1;
    CHECK_INT(pal_mesh_write_vtk("/nonexistent/a.vtk", &grid, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/nonexistent/a.vtk"));
    /* a folder in the file's place: the file is written whole, cannot take its name and goes */
    mkdir(path, 0700);
    CHECK_INT(pal_mesh_write_vtk(path, &grid, &diag), PAL_ERR_IO);
    CHECK_INT(rmdir(path), 0);
    char listing[128];
    snprintf(listing, sizeof listing, "ls %s.* 2>/dev/null | wc -l", path);
    FILE *pipe = popen(listing, "r");
    int n_left = -1;
    CHECK(pipe && fscanf(pipe, "%d", &n_left) == 1);
    if (pipe) pclose(pipe);
    CHECK_INT(n_left, 0);
}

int main(void)
{
    snprintf(path, sizeof path, "/tmp/palpate_test_vtk_%d", (int)getpid());
    RUN(hexahedra_and_fields_read_back_equal);
    RUN(tetrahedra_keep_their_order);
    unlink(path);
    RUN(what_cannot_be_written_leaves_nothing_behind);
    return check_report();
}
