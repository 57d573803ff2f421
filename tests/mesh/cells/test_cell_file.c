/* Cells in files: back to the bit in our text, the same cells in VTK, and what is refused, with its line. */
#include "server/mesh/cells/cell_file.h"

#include "server/mesh/cells/cell_shapes.h"
#include "server/mesh/files/mesh_file.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <locale.h>

static pal_diagnostic diag;
static char path[64];

static pal_err parse(const char *text, pal_cells *c)
{
    return pal_cell_file_parse("a", (const uint8_t *)text, strlen(text), c, &diag);
}

/* odd positions, and sharpnesses of every kind */
static pal_cells odd_torus(void)
{
    pal_cells c;
    uint64_t state = 3;
    if (pal_cells_torus(7, 2, 1, .4, &c, &diag)) abort();
    for (int i = 0; i < 3 * c.n_vertex; i++) {
        c.x[i] += (double)(random_bits(&state) >> 32) * 1e-12 + (i % 5 == 0) * 5e-324;
    }
    c.x[1] = -0.0;
    for (int v = 0; v < c.n_vertex; v += 3) c.vertex_sharpness[v] = (float)v / 7;
    for (int e = 0; e < c.n_edge; e += 4) c.edge[e].sharp = 1 / (float)(1 + e);
    for (int f = 0; f < c.n_face; f += 5) c.face[f].sharp = (float)f * 0.3f;
    c.edge[0].sharp = PAL_SHARPNESS_MAX, c.face[0].sharp = 1e-45f;
    return c;
}

static void our_text_gives_every_bit_back(void)
{
    pal_cells c = odd_torus(), back;
    snprintf(path, sizeof path, "/tmp/palpate_test_cells_%d.palcells", (int)getpid());
    setlocale(LC_NUMERIC, "de_DE.UTF-8"); /* where there is one: the point stays a point */
    REQUIRE(!pal_cell_file_save(&c, path, &diag));
    REQUIRE(!pal_cell_file_load(path, &back, &diag));
    setlocale(LC_NUMERIC, "C");
    CHECK(pal_cells_equal(&c, &back));
    CHECK(!memcmp(c.x, back.x, (size_t)c.n_vertex * 24));
    CHECK(!memcmp(c.edge_use, back.edge_use, (size_t)c.n_edge_use * sizeof *c.edge_use));
    CHECK(back.face[0].sharp == 1e-45f && back.edge[0].sharp == PAL_SHARPNESS_MAX);
    CHECK_INT(pal_cells_check(&back, NULL, &diag), PAL_ERR_OK);
    pal_cells_free(&c);
    pal_cells_free(&back);
}

/* sorted corners of a cell, which name it */
static int compare_ints(const void *a, const void *b)
{
    const int32_t *p = a, *q = b;
    return (*p > *q) - (*p < *q);
}

static bool same_cell(const pal_cells *a, const pal_cells *b, int cell)
{
    int32_t p[64], q[64];
    int from = a->cell_vertex.start[cell], n = a->cell_vertex.start[cell + 1] - from;
    if (b->cell_vertex.start[cell] != from || b->cell_vertex.start[cell + 1] - from != n || n > 64) return false;
    memcpy(p, a->cell_vertex.item + from, (size_t)n * 4);
    memcpy(q, b->cell_vertex.item + from, (size_t)n * 4);
    qsort(p, (size_t)n, 4, compare_ints);
    qsort(q, (size_t)n, 4, compare_ints);
    return !memcmp(p, q, (size_t)n * 4) &&
           fabs(pal_cells_cell_volume(a, NULL, cell) - pal_cells_cell_volume(b, NULL, cell)) < 1e-12;
}

/* hexahedron, pyramid, wedge and tetrahedron that share faces, and a polyhedron: a prism of five sides */
static const char zoo[] = "palcells 1\n"
                          "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1 # a cube\n"
                          "v .5 .5 2\nv .5 3 .5\nv 2 .5 0\nv 2 .5 1\n"
                          "v 5 0 0\nv 6 0 0\nv 6.5 1 0\nv 5.5 2 0\nv 4.5 1 0\n"
                          "v 5 0 1\nv 6 0 1\nv 6.5 1 1\nv 5.5 2 1\nv 4.5 1 1\n"
                          "c\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
                          "c\nf 8 7 6 5\nf 5 6 9\nf 6 7 9\nf 7 8 9\nf 8 5 9\n"
                          "c\nf 6 7 3 2\nf 2 11 12 6\nf 3 7 12 11\nf 2 3 11\nf 6 12 7\n"
                          "c\nf 7 9 8\nf 7 8 10\nf 8 9 10\nf 9 7 10\n"
                          "c\nf 17 16 15 14 13\nf 18 19 20 21 22\nf 13 14 19 18\nf 14 15 20 19\nf 15 16 21 20\n"
                          "f 16 17 22 21\nf 17 13 18 22\n"
                          "sv 3 0.5\nse 1 2 7\nsf 2 1 1\n";

static void vtk_gives_the_same_cells_back(void)
{
    pal_cells c, back, ours;
    REQUIRE(!parse(zoo, &c));
    CHECK_INT(c.n_cell, 5);
    CHECK(c.vertex_sharpness[2] == .5f && c.vertex_sharpness[0] == 0);
    CHECK(c.face[c.face_use[c.cell_use[1]].face].sharp == 1);
    snprintf(path, sizeof path, "/tmp/palpate_test_cells_%d.vtk", (int)getpid());
    REQUIRE(!pal_cell_file_save(&c, path, &diag));
    REQUIRE(!pal_cell_file_load(path, &back, &diag));
    CHECK_INT(back.n_face, c.n_face);
    CHECK_INT(back.n_edge, c.n_edge);
    CHECK_INT(back.n_boundary_face, c.n_boundary_face);
    CHECK(!memcmp(c.x, back.x, (size_t)c.n_vertex * 24));
    CHECK(!memcmp(c.vertex_sharpness, back.vertex_sharpness, (size_t)c.n_vertex * 4));
    for (int i = 0; i < c.n_cell; i++) CHECK(same_cell(&c, &back, i));
    uint8_t *bytes;
    size_t n;
    REQUIRE(!pal_cell_file_bytes(&c, true, &bytes, &n));
    CHECK(memmem(bytes, n, "\nCELL_TYPES 5\n12\n14\n13\n10\n42\n", 29));
    /* VTK's corners: bases counter-clockwise seen from the top or apex, a wedge's the other way round */
    static const char order[] = "\n8 0 1 2 3 4 5 6 7\n5 7 4 5 6 8\n6 1 2 10 5 6 11\n4 6 7 8 9\n";
    CHECK(memmem(bytes, n, order, sizeof order - 1));
    CHECK(memmem(bytes, n, "\nCELLS 5 66\n", 12)); /* 9 + 6 + 7 + 5 + 39 */
    free(bytes);
    pal_cells_free(&back);
    pal_cells_free(&c);

    c = odd_torus();
    REQUIRE(!pal_cell_file_bytes(&c, true, &bytes, &n));
    REQUIRE(!pal_cell_file_parse("t", bytes, n, &back, &diag));
    CHECK(!memcmp(c.x, back.x, (size_t)c.n_vertex * 24));
    for (int i = 0; i < c.n_cell; i++) CHECK(same_cell(&c, &back, i));
    free(bytes);
    REQUIRE(!pal_cell_file_bytes(&back, false, &bytes, &n));
    REQUIRE(!pal_cell_file_parse("t", bytes, n, &ours, &diag));
    CHECK(pal_cells_equal(&back, &ours));
    free(bytes);
    pal_cells_free(&c);
    pal_cells_free(&back);
    pal_cells_free(&ours);
}

static const char vtk_head[] = "# vtk DataFile Version 3.0\na title\nASCII\nDATASET UNSTRUCTURED_GRID\n";

static pal_err parse_vtk(const char *body, pal_cells *c)
{
    char text[2048];
    snprintf(text, sizeof text, "%s%s", vtk_head, body);
    return parse(text, c);
}

#define FOUR "POINTS 5 float\n0 0 0 1 0 0 0 1 0\n0 0 1\n9 9 9\n"

static void vtk_by_hand_is_turned_over_and_freed_of_loose_points(void)
{
    pal_cells c;
    REQUIRE(!parse_vtk(FOUR "CELLS 1 5\n4 0 2 1 3\nCELL_TYPES 1\n10\nCELL_DATA 1\nSCALARS sharp double\n"
                            "LOOKUP_TABLE default\n4\n",
                       &c));
    CHECK_INT(c.n_vertex, 4);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 1. / 6, 1e-15);
    CHECK(c.vertex_sharpness[0] == 0);
    pal_cells_free(&c);
    REQUIRE(!parse_vtk(FOUR "CELLS 1 18\n17 4 3 0 1 2 3 0 3 1 3 1 3 2 3 0 2 3\nCELL_TYPES 1\n42\nPOINT_DATA 5\n"
                            "VECTORS v float\n1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\nSCALARS sharp float 1\n"
                            "LOOKUP_TABLE default\n0 1 2 3 4\n",
                       &c));
    CHECK_NEAR(pal_cells_volume(&c, NULL), 1. / 6, 1e-15);
    CHECK(c.vertex_sharpness[1] == 1 && c.vertex_sharpness[3] == 3);
    pal_cells_free(&c);
}

static void refused(const char *text, const char *sentence)
{
    pal_cells c = {.n_vertex = -7};
    CHECK_INT(parse(text, &c), PAL_ERR_REFUSED);
    CHECK_INT(c.n_vertex, -7);
    if (strncmp(diag.text, sentence, strlen(sentence))) CHECK_TEXT(diag.text, sentence);
}

static void refused_vtk(const char *body, const char *sentence)
{
    char text[2048];
    snprintf(text, sizeof text, "%s%s", vtk_head, body);
    refused(text, sentence);
}

#define TET  "palcells 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nc\n"
#define REST "f 1 2 4\nf 2 3 4\nf 3 1 4\n"

static void refusals_name_the_line(void)
{
    refused("", "a: line 1: the first line must be 'palcells 1'");
    refused("palcells 2\n", "a: line 1: the first line must be");
    refused("palcells 1\n", "a: line 2: the file ends with 0 vertices and 0 cells");
    refused("palcells 1\nv 1 2\n", "a: line 2: a position needs three numbers, found nothing");
    refused("palcells 1\nv 1 2 3 4\n", "a: line 2: '4' at the end of the line");
    refused("palcells 1\nx\n", "a: line 2: a line begins with 'x', known are v, c, f, sv, se, sf");
    refused("palcells 1\nv 0 0 0\nf 1 1 1\n", "a: line 3: a face before the first cell");
    refused(TET "f 1 3 5\n", "a: line 7: vertex 5, there are 4 before this line");
    refused(TET "f 1 3 two\n", "a: line 7: vertex must be a number, found 'two'");
    refused(TET "f 1 3 3\n" REST, "a: line 7: cell 1, face 1: has vertex 3 twice");
    refused(TET "f 1 3\n" REST, "a: line 7: cell 1, face 1: 2 corners, must be 3 to 256");
    refused(TET "f 1 2 3\n" REST, "a: line 8: cell 1, face 2: runs from vertex 1 to 2 as face 1 of the cell does");
    refused(TET REST, "a: line 7: cell 1, face 1: no other face of the cell at the edge of vertices 1 and 2");
    refused(TET "f 1 3 2\n" REST "c\n", "a: cell 2 has no faces");
    refused(TET "c\n", "a: line 7: cell 1 has no faces");
    refused(TET "f 1 3 2\n" REST "sv 5 1\n", "a: line 11: vertex 5, there are 4");
    refused(TET "f 1 3 2\n" REST "sv 1 nan\n", "a: line 11: sharpness nan, must be 0 to 1e+06");
    refused(TET "f 1 3 2\n" REST "v 5 5 5\nse 1 5 1\n", "a: line 11: vertex 5 belongs to no cell");
    refused(TET "f 1 3 2\n" REST "se 1 1 1\n", "a: line 11: sharpness 1 of an edge of vertices 1 and 1: no cell");
    refused(TET "f 1 3 2\n" REST "sf 1 5 1\n", "a: line 11: face 5, there are 4");
    refused("palcells 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 -1\nc\nf 1 3 2\n" REST,
            "a: line 7: cell 1 has no positive volume (-0.167 m^3");
    refused("palcells 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1e12\nc\nf 1 3 2\n" REST, "a: line 5: vertex 4 is at");
    refused("# vtk DataFile Version 5.1\n", "a: line 1: VTK version 5.1, versions 1 to 4.2 are read");
    refused("# vtk DataFile Version 3.0\nt\nBINARY\n", "a: line 3: a binary VTK file");
    refused("# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n",
            "a: line 4: UNSTRUCTURED_GRID should be here, found 'POLYDATA'");
    refused_vtk("POINTS 1000000 float\n0 0 0\n", "a: line 5: the number of points is 1000000, must be 1 to");
    refused_vtk("POINTS 2 float\n0 0 0\n1\n", "a: line 8: the file ends where a coordinate should be");
    refused_vtk(FOUR "CELLS 1 5\n4 0 2 1 5\nCELL_TYPES 1\n10\n", "a: line 10: cell 0: there is no point 5");
    refused_vtk(FOUR "CELLS 1 5\n4 0 2 1 -1\nCELL_TYPES 1\n10\n", "a: line 10: a corner is -1, must be 0 to");
    refused_vtk(FOUR "CELLS 1 5\n5 0 2 1 3 4\n", "a: line 10: cells have more numbers than CELLS says");
    refused_vtk(FOUR "CELLS 1 5\n4 0 2 1 3\nCELL_TYPES 1\n11\n",
                "a: line 10: cell 0: types 10, 12, 13, 14 and 42 are read, not 11");
    refused_vtk(FOUR "CELLS 1 5\n4 0 2 1 3\nCELL_TYPES 1\n12\n",
                "a: line 10: cell 0: its type does not go with this number of corners: 4");
    refused_vtk(FOUR "CELLS 1 5\n4 2 3 0 1\nCELL_TYPES 1\n42\n",
                "a: line 10: cell 0: a polyhedron whose numbers end within face 0");
    refused_vtk(FOUR "CELLS 1 5\n4 0 2 1 2\nCELL_TYPES 1\n10\n", "a: line 10: cell 0, face ");
}

static void files_that_cannot_be_are_refused(void)
{
    pal_cells c = odd_torus(), back;
    CHECK_INT(pal_cell_file_save(&c, "/tmp/a.obj", &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "/tmp/a.obj: cells are written to .palcells or .vtk files");
    CHECK_INT(pal_cell_file_save(&c, "/nonexistent/a.vtk", &diag), PAL_ERR_IO);
    CHECK_INT(pal_cell_file_load("/nonexistent/a.vtk", &back, &diag), PAL_ERR_IO);
    pal_cells_free(&c);
}

static void every_file_cut_short_is_refused_or_good(void)
{
    pal_cells c;
    size_t n = strlen(zoo);
    for (size_t cut = 0; cut < n; cut += (size_t)CHECK_REPEATS(1, 7))
        if (!pal_cell_file_parse("a", (const uint8_t *)zoo, cut, &c, &diag)) {
            CHECK_INT(pal_cells_check(&c, NULL, &diag), PAL_ERR_OK);
            pal_cells_free(&c);
        } else {
            CHECK(!strncmp(diag.text, "a: ", 3));
        }
}

int main(void)
{
    RUN(our_text_gives_every_bit_back);
    unlink(path);
    RUN(vtk_gives_the_same_cells_back);
    unlink(path);
    RUN(vtk_by_hand_is_turned_over_and_freed_of_loose_points);
    RUN(refusals_name_the_line);
    RUN(files_that_cannot_be_are_refused);
    RUN(every_file_cut_short_is_refused_or_good);
    return check_report();
}
