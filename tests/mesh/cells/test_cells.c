/* Polyhedral complexes: counts, walks, holes, boundary, edits, and what is refused. */
#include "server/mesh/cells/cells.h"

#include "server/mesh/cells/cell_shapes.h"
#include "tests/check.h"
#include "tests/fixtures/cell_check.h"
#include "tests/fixtures/random.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;

static pal_cells block(int x, int y, int z)
{
    pal_cells c = {0};
    const int32_t n[3] = {x, y, z};
    const double size[3] = {x, y, z};
    if (pal_cells_block(n, size, &c, &diag)) abort();
    return c;
}

/* n x n x n unit cubes of which keep says which stay */
static pal_cells cubes(int n, bool (*keep)(int, int, int), pal_err *err)
{
    pal_cells whole = block(n, n, n), c = {0};
    pal_cell_loops loops;
    bool flag[1000];
    for (int i = 0; i < n * n * n; i++) flag[i] = keep(i % n, i / n % n, i / n / n);
    if (pal_cells_loops(&whole, flag, &loops, NULL)) abort();
    *err = pal_cells_make(&loops, &c, &diag);
    pal_cell_loops_free(&loops);
    pal_cells_free(&whole);
    return c;
}

static void a_block_has_the_counts_of_a_grid(void)
{
    pal_cells c = block(2, 3, 4);
    CHECK_INT(c.n_vertex, 3 * 4 * 5);
    CHECK_INT(c.n_edge, 2 * 4 * 5 + 3 * 3 * 5 + 3 * 4 * 4);
    CHECK_INT(c.n_face, 3 * 3 * 4 + 2 * 4 * 4 + 2 * 3 * 5);
    CHECK_INT(c.n_cell, 24);
    CHECK_INT(c.n_boundary_face, 2 * (6 + 8 + 12));
    CHECK_INT(c.cell_vertex.start[24], 8 * 24);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 24, 1e-12);
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
    int inner = 0;
    for (int v = 0; v < c.n_vertex; v++) {
        if (c.vertex_boundary[v]) continue;
        inner++;
        CHECK_INT(c.vertex_cell.start[v + 1] - c.vertex_cell.start[v], 8);
        CHECK_INT(c.vertex_face.start[v + 1] - c.vertex_face.start[v], 12);
        CHECK_INT(c.vertex_edge.start[v + 1] - c.vertex_edge.start[v], 6);
    }
    CHECK_INT(inner, 1 * 2 * 3);
    pal_cells_free(&c);
}

static void radial_mate_radial_mate_visits_every_cell_round_an_edge_once(void)
{
    pal_cells c;
    REQUIRE(!pal_cells_torus(5, 2, 1, .4, &c, &diag));
    int n_inner = 0, n_extraordinary = 0;
    for (int first = 0; first < c.n_edge_use; first++) {
        int e = c.edge_use[first].edge, n = c.edge_cell.start[e + 1] - c.edge_cell.start[e], seen[64], n_seen = 0;
        if (c.edge[e].boundary) continue;
        int u = first;
        do {
            int cell = cell_of_use(&c, u);
            for (int k = 0; k < n_seen; k++) CHECK(seen[k] != cell);
            seen[n_seen++] = cell;
            CHECK_INT(c.edge_use[u].edge, e);
            u = c.edge_use[c.edge_use[u].radial].mate;
        } while (u != first && n_seen < 64);
        CHECK_INT(n_seen, n);
        n_inner++, n_extraordinary += n != 4;
    }
    CHECK(n_inner > 0 && n_extraordinary > 0);
    pal_cells_free(&c);
}

static void turning_round_a_corner_meets_its_faces_counter_clockwise(void)
{
    pal_cells c = block(1, 1, 1);
    for (int k = 0; k < 8; k++) {
        int u = c.corner_use[k], v = c.cell_vertex.item[k], n = 0, at = u;
        double way[3][3] = {{0}};
        do {
            REQUIRE(n < 3 && c.edge_use[at].vertex == v);
            for (int a = 0; a < 3; a++) way[n][a] = c.x[3 * pal_cells_end_vertex(&c, at) + a] - c.x[3 * v + a];
            n++;
            at = pal_cells_next_around(&c, at);
        } while (at != u);
        CHECK_INT(n, 3);
        /* seen from outside counter-clockwise: the three ways into the cube are a left-handed set */
        double det = way[0][0] * (way[1][1] * way[2][2] - way[1][2] * way[2][1]) -
                     way[0][1] * (way[1][0] * way[2][2] - way[1][2] * way[2][0]) +
                     way[0][2] * (way[1][0] * way[2][1] - way[1][1] * way[2][0]);
        CHECK_NEAR(det, -1, 1e-12);
    }
    pal_cells_free(&c);
}

static void next_and_prev_undo_each_other_and_over_walks_the_boundary(void)
{
    pal_cells c = block(3, 2, 2);
    int n_over = 0;
    for (int u = 0; u < c.n_edge_use; u++) {
        CHECK_INT(pal_cells_next(&c, pal_cells_prev(&c, u)), u);
        CHECK_INT(pal_cells_end_vertex(&c, u), c.edge_use[pal_cells_next(&c, u)].vertex);
        if (c.edge_use[u].mate >= 0) continue;
        int over = pal_cells_across_edge(&c, u);
        n_over++;
        CHECK_INT(pal_cells_across_edge(&c, over), u);
        CHECK_INT(c.edge_use[over].vertex, pal_cells_end_vertex(&c, u));
        CHECK(c.edge_use[over].mate < 0 && over != u);
    }
    CHECK_INT(n_over, 4 * c.n_boundary_face);
    pal_cells_free(&c);
}

static void check_genus(const pal_cells *c, int piece, int sheet, int genus)
{
    pal_cells_topology t;
    REQUIRE(!pal_cells_find_topology(c, &t));
    CHECK_INT(t.n_piece, piece);
    CHECK_INT(t.n_sheet, sheet);
    CHECK_INT(t.n_cavity, sheet - piece);
    HARD_CASE_ALL("cavities", "subdivision_fem", "pieces and hollows are as many as there are",
                  t.n_piece == piece && t.n_cavity == sheet - piece, 1);
    CHECK_INT(t.genus, genus);
    CHECK_INT(t.sheet_euler, 2 * (sheet - genus));
    /* a solid's Euler number is half that of its boundary */
    if (c->n_pinched_vertex == 0) CHECK_INT(2 * t.euler, t.sheet_euler);
}

static bool no_middle_column(int x, int y, int z)
{
    return (void)z, x != 1 || y != 1;
}
static bool no_three_columns(int x, int y, int z)
{
    return (x != 1) + (y != 1) + (z != 1) >= 2;
}
static bool no_heart(int x, int y, int z)
{
    return x != 1 || y != 1 || z != 1;
}

static void holes_and_hollows_are_counted(void)
{
    pal_err err;
    pal_cells c = block(3, 3, 3);
    check_genus(&c, 1, 1, 0);
    pal_cells_free(&c);
    c = cubes(3, no_middle_column, &err);
    REQUIRE(!err);
    check_genus(&c, 1, 1, 1);
    CHECK_INT(c.n_cell, 24);
    pal_cells_free(&c);
    c = cubes(3, no_three_columns, &err); /* Menger's sponge */
    REQUIRE(!err);
    CHECK_INT(c.n_cell, 20);
    check_genus(&c, 1, 1, 5);
    pal_cells_free(&c);
    c = cubes(3, no_heart, &err);
    REQUIRE(!err);
    check_genus(&c, 1, 2, 0);
    pal_cells_free(&c);
    REQUIRE(!pal_cells_ring(8, 1, .2, &c, &diag));
    CHECK_INT(c.n_cell, 8);
    check_genus(&c, 1, 1, 1);
    pal_cells_free(&c);
}

static bool two_by_an_edge(int x, int y, int z)
{
    return z == 0 && x == y;
}
static bool two_by_a_corner(int x, int y, int z)
{
    return x == y && y == z;
}
static bool two_apart(int x, int y, int z)
{
    return y == 0 && z == 0 && x != 1;
}

static void cells_that_touch_in_an_edge_or_a_corner_are_marked(void)
{
    pal_err err;
    pal_cells c = cubes(2, two_by_an_edge, &err);
    REQUIRE(!err);
    CHECK_INT(c.n_pinched_edge, 1);
    CHECK_INT(c.n_pinched_vertex, 2);
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
    check_genus(&c, 2, 2, 0);
    pal_cells_free(&c);
    c = cubes(2, two_by_a_corner, &err);
    REQUIRE(!err);
    CHECK_INT(c.n_pinched_edge, 0);
    CHECK_INT(c.n_pinched_vertex, 1);
    check_genus(&c, 2, 2, 0);
    pal_cells_free(&c);
    c = cubes(3, two_apart, &err);
    REQUIRE(!err);
    CHECK_INT(c.n_pinched_vertex, 0);
    check_genus(&c, 2, 2, 0);
    pal_cells_free(&c);
}

static void the_boundary_is_closed_and_outward(void)
{
    pal_cells shape[4];
    const int32_t n[3] = {7, 2, 3};
    shape[0] = block(2, 3, 2);
    REQUIRE(!pal_cells_ring(6, 1, .3, &shape[1], &diag));
    REQUIRE(!pal_cells_tube(n, .5, .8, 2, &shape[2], &diag));
    REQUIRE(!pal_cells_torus(9, 2, 1, .4, &shape[3], &diag));
    for (int k = 0; k < 4; k++) {
        pal_surface s;
        pal_surface_topology t;
        int32_t *vertex, *face;
        pal_cells *c = &shape[k];
        REQUIRE(!pal_cells_boundary(c, &s, &vertex, &face));
        REQUIRE(!pal_surface_check(&s, &t));
        CHECK(t.closed && t.manifold && t.oriented);
        CHECK_INT(s.n_tri, 2 * c->n_boundary_face);
        CHECK_NEAR(pal_surface_volume(&s) / pal_cells_volume(c, NULL), 1, 1e-12);
        for (int v = 0; v < s.n_vertex; v++) CHECK(!memcmp(s.x + 3 * v, c->x + 3 * vertex[v], 3 * sizeof *s.x));
        for (int t3 = 0; t3 < 3 * s.n_tri; t3++) {
            int first, m = pal_cells_face_loop(c, face[t3 / 3], &first), found = 0;
            for (int u = first; u < first + m; u++) found += c->edge_use[u].vertex == vertex[s.tri[t3]];
            CHECK_INT(found, 1);
            CHECK(pal_cells_face_boundary(c, face[t3 / 3]));
        }
        free(vertex);
        free(face);
        pal_surface_free(&s);
        pal_cells_free(c);
    }
}

static void shapes_have_the_volume_and_the_size_they_should(void)
{
    pal_cells c;
    const double pi = 3.14159265358979323846;
    const int32_t n[3] = {200, 1, 1};
    /* a regular polygon of n corners has the area n/2 sin(2 pi / n) of its circle's square */
    double polygon = 100 * sin(2 * pi / 200);
    REQUIRE(!pal_cells_tube(n, 1, 2, 5, &c, &diag));
    CHECK_NEAR(pal_cells_volume(&c, NULL), polygon * 3 * 5, 1e-9);
    pal_cells_free(&c);
    /* Pappus: n sections of area A whose middle goes round a polygon; the section is one of 12 corners */
    REQUIRE(!pal_cells_torus(200, 3, 2, .5, &c, &diag));
    CHECK_INT(c.n_cell, 200 * 45);
    CHECK_NEAR(pal_cells_volume(&c, NULL), polygon * 2 * 2 * (6 * sin(pi / 6) * .25), 1e-9);
    check_genus(&c, 1, 1, 1);
    pal_cells_free(&c);
    REQUIRE(!pal_cells_ring(3, 1, .2, &c, &diag));
    CHECK_INT(c.n_vertex, 12);
    pal_cells_free(&c);
    const int32_t none[3] = {2, 0, 2}, many[3] = {1000, 1000, 2};
    const double size[3] = {1, 1, 1}, flat[3] = {1, 1, 0};
    CHECK_INT(pal_cells_block(none, size, &c, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "cells: number of cells along y is 0, must be 1 to 1000000");
    CHECK_INT(pal_cells_block(many, size, &c, &diag), PAL_ERR_BUDGET);
    CHECK_INT(pal_cells_block(n, flat, &c, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "cells: size along z is 0 m, must be above 0 and at most 1e8");
    CHECK_INT(pal_cells_ring(2, 1, .2, &c, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_cells_ring(8, .1, .2, &c, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_cells_torus(8, 1, .2, .2, &c, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_cells_torus(INT32_MAX, INT32_MAX, 1, .2, &c, &diag), PAL_ERR_BUDGET);
}

static void loops_give_the_same_complex_again(void)
{
    pal_cells c = block(2, 2, 1), again, copy;
    pal_cell_loops loops;
    c.vertex_sharpness[3] = 2, c.edge[5].sharp = .5f, c.face[7].sharp = PAL_SHARPNESS_MAX;
    c.x[4] = nextafter(c.x[4], 9);
    REQUIRE(!pal_cells_loops(&c, NULL, &loops, NULL));
    REQUIRE(!pal_cells_make(&loops, &again, &diag));
    CHECK(cells_equal(&c, &again));
    CHECK(again.edge[5].sharp == .5f && again.face[7].sharp == PAL_SHARPNESS_MAX && again.vertex_sharpness[3] == 2);
    REQUIRE(!pal_cells_copy(&again, &copy));
    CHECK(cells_equal(&copy, &again));
    CHECK_INT(cells_check(&copy, NULL, &diag), PAL_ERR_OK);
    copy.x[0] = nextafter(copy.x[0], 9);
    CHECK(!cells_equal(&copy, &again));
    again.edge[1].sharp = .25f;
    CHECK(!cells_equal(&c, &again));
    pal_cell_loops_free(&loops);
    pal_cells_free(&c);
    pal_cells_free(&again);
    pal_cells_free(&copy);
}

static void deleting_cells_keeps_what_is_left_as_it_was(void)
{
    pal_cells c = block(3, 1, 1), left;
    pal_cell_loops loops;
    bool keep[3] = {false, true, true};
    int32_t kept[16];
    for (int v = 0; v < c.n_vertex; v++) c.vertex_sharpness[v] = (float)v;
    for (int e = 0; e < c.n_edge; e++) c.edge[e].sharp = (float)(1 + e);
    for (int f = 0; f < c.n_face; f++) c.face[f].sharp = (float)(1 + f);
    REQUIRE(!pal_cells_loops(&c, keep, &loops, kept));
    REQUIRE(!pal_cells_make(&loops, &left, &diag));
    CHECK_INT(left.n_cell, 2);
    CHECK_INT(left.n_vertex, 12);
    CHECK_NEAR(pal_cells_volume(&left, NULL), 2, 1e-12);
    for (int v = 0; v < left.n_vertex; v++) {
        CHECK(left.x[3 * v] == c.x[3 * kept[v]]);
        CHECK(left.vertex_sharpness[v] == (float)kept[v]);
    }
    /* sharpnesses are numbers of the old edges and faces: compare their places */
    for (int e = 0; e < left.n_edge; e++) {
        const pal_cell_edge *was = &c.edge[(int)left.edge[e].sharp - 1];
        int a = kept[left.edge[e].vertex[0]], b = kept[left.edge[e].vertex[1]];
        CHECK((was->vertex[0] == a && was->vertex[1] == b) || (was->vertex[0] == b && was->vertex[1] == a));
    }
    for (int f = 0; f < left.n_face; f++) {
        double p[3], q[3];
        pal_cells_face_centre(&left, NULL, f, p);
        pal_cells_face_centre(&c, NULL, (int)left.face[f].sharp - 1, q);
        CHECK(fabs(p[0] - q[0]) + fabs(p[1] - q[1]) + fabs(p[2] - q[2]) < 1e-12);
    }
    pal_cell_loops_free(&loops);
    pal_cells_free(&c);
    pal_cells_free(&left);
}

/* a prism over a polygon of n corners, and one pyramid on its top that shares the polygon */
static void any_polyhedra_go_together(void)
{
    enum { N = 7 };
    double x[3 * (2 * N + 1)];
    int32_t cell[3] = {0, N + 2, 2 * N + 3}, loop[2 * N + 4], corner[12 * N], n = 0, l = 0;
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 2; k++) {
            double *to = x + 3 * (i + k * N), a = 2 * 3.14159265358979323846 * i / N;
            to[0] = cos(a), to[1] = sin(a), to[2] = k;
        }
    x[6 * N] = x[6 * N + 1] = 0, x[6 * N + 2] = 2;
    loop[l++] = n;
    for (int i = 0; i < N; i++) corner[n++] = N - 1 - i;
    loop[l++] = n;
    for (int i = 0; i < N; i++) corner[n++] = N + i;
    for (int i = 0; i < N; i++) {
        int32_t side[4] = {i, (i + 1) % N, N + (i + 1) % N, N + i};
        loop[l++] = n;
        for (int k = 0; k < 4; k++) corner[n++] = side[k];
    }
    loop[l++] = n;
    for (int i = 0; i < N; i++) corner[n++] = 2 * N - 1 - i;
    for (int i = 0; i < N; i++) {
        int32_t side[3] = {N + i, N + (i + 1) % N, 2 * N};
        loop[l++] = n;
        for (int k = 0; k < 3; k++) corner[n++] = side[k];
    }
    loop[l] = n;
    pal_cell_loops loops = {.n_vertex = 2 * N + 1, .n_cell = 2, .x = x, .cell = cell, .loop = loop, .corner = corner};
    pal_cells c;
    REQUIRE(!pal_cells_make(&loops, &c, &diag));
    double area = N / 2. * sin(2 * 3.14159265358979323846 / N);
    CHECK_NEAR(pal_cells_volume(&c, NULL), area * (1 + 1. / 3), 1e-12);
    CHECK_INT(c.n_face, 2 * N + 2);
    CHECK_INT(c.n_boundary_face, 2 * N + 1);
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
    check_genus(&c, 1, 1, 0);
    pal_surface s;
    REQUIRE(!pal_cells_boundary(&c, &s, NULL, NULL));
    CHECK_NEAR(pal_surface_volume(&s), area * (1 + 1. / 3), 1e-12);
    pal_surface_free(&s);
    pal_cells_free(&c);
}

/* loops of a block to break */
static pal_cell_loops open_block(int x, int y, int z)
{
    pal_cells c = block(x, y, z);
    pal_cell_loops l;
    if (pal_cells_loops(&c, NULL, &l, NULL)) abort();
    pal_cells_free(&c);
    return l;
}

static void reverse_loop(pal_cell_loops *l, int k)
{
    for (int a = l->loop[k], b = l->loop[k + 1] - 1; a < b; a++, b--) {
        int32_t keep = l->corner[a];
        l->corner[a] = l->corner[b], l->corner[b] = keep;
    }
}

static void refused(pal_cell_loops l, const char *words)
{
    pal_cells c = {.n_vertex = -7};
    CHECK_INT(pal_cells_make(&l, &c, &diag), PAL_ERR_REFUSED);
    CHECK_INT(c.n_vertex, -7);
    if (!strstr(diag.text, words)) CHECK_TEXT(diag.text, words);
    HARD_CASE_ALL("broken_surface", "subdivision_fem", "no complex of cells, flat, NaN: refused by number",
                  strstr(diag.text, words) != NULL, 1);
    CHECK(!strchr(diag.text, '\n'));
    CHECK_INT(pal_cells_make(&l, &c, NULL), PAL_ERR_REFUSED);
    pal_cell_loops_free(&l);
}

static void what_is_no_complex_is_refused_in_a_sentence(void)
{
    pal_cell_loops l = open_block(2, 1, 1);
    reverse_loop(&l, 2);
    refused(l, "cells: cell 0, face 2: runs from vertex");
    l = open_block(2, 1, 1);
    for (int k = 6; k < 12; k++) reverse_loop(&l, k);
    refused(l, "cells: cell 1, face 0: runs the same way round in cell 0: one of the two is inside out");
    l = open_block(1, 1, 1);
    for (int k = 0; k < 6; k++) reverse_loop(&l, k);
    refused(l, "cells: cell 0 has no positive volume (-1 m^3");
    l = open_block(1, 1, 1);
    l.cell[1] = 5;
    refused(l, "the cell at the edge of vertices");
    l = open_block(2, 1, 1);
    l.corner[3] = l.corner[1];
    refused(l, "cells: cell 0, face 0: has vertex 6 twice");
    l = open_block(2, 1, 1);
    l.corner[29] = 12;
    refused(l, "cells: cell 1, face 1: vertex 12, there are 12");
    l = open_block(2, 1, 1);
    l.corner[5] = -1;
    refused(l, "cells: cell 0, face 1: vertex -1, there are 12");
    l = open_block(2, 1, 1);
    l.n_cell = 1;
    refused(l, "cells: vertex 2 belongs to no cell");
    l = open_block(2, 1, 1);
    l.x[5] = (double)NAN;
    refused(l, "cells: vertex 1 is at");
    l = open_block(1, 1, 1);
    for (int v = 0; v < 8; v++) l.x[3 * v + 2] = 0;
    refused(l, "has no area (0 m^2, longest edge 1 m)");
    l = open_block(1, 1, 1);
    for (int v = 4; v < 8; v++) l.x[3 * v + 2] = -1.5 - l.x[3 * v + 2] * 2;
    refused(l, "cells: cell 0 has no positive volume");
    l = open_block(1, 1, 1);
    l.loop[2] = 6;
    refused(l, "cells: cell 0, face 1: 2 corners, must be 3 to 256");
    l = open_block(1, 1, 1);
    l.vertex_sharpness[4] = -1;
    refused(l, "cells: vertex 4 has sharpness -1, must be 0 to 1e+06");
    l = open_block(1, 1, 1);
    pal_cell_loops_edge(&l, 0, 7, 1);
    refused(l, "cells: sharpness 1 of an edge of vertices 0 and 7: no cell has it");
    l = open_block(1, 1, 1);
    pal_cell_loops_edge(&l, 0, 1, 1);
    l.edge_tag[0].sharp = (float)NAN;
    refused(l, "of vertices 0 and 1: must be 0 to 1000000");
    l = open_block(1, 1, 1);
    l.face_tag = malloc(sizeof *l.face_tag);
    l.face_tag[0] = (pal_cell_tag){6, 0, 1}, l.n_face_tag = 1;
    refused(l, "cells: sharpness of loop 6, there are 6");
}

/* cells of tetrahedra given by four corners each */
static pal_err make_tets(const double *x, int n_vertex, const int32_t *corner, int n_tet, pal_cells *c)
{
    static const int FACE[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    int32_t cell[9], loop[40], list[120];
    double copy[64];
    memcpy(copy, x, (size_t)n_vertex * 24);
    for (int t = 0; t <= n_tet; t++) cell[t] = 4 * t;
    for (int f = 0; f <= 4 * n_tet; f++) loop[f] = 3 * f;
    for (int i = 0; i < 12 * n_tet; i++) list[i] = corner[i / 12 * 4 + FACE[i % 12 / 3][i % 3]];
    pal_cell_loops l = {.n_vertex = n_vertex, .n_cell = n_tet, .x = copy, .cell = cell, .loop = loop, .corner = list};
    return pal_cells_make(&l, c, &diag);
}

static void faces_of_three_cells_and_cells_twice_round_are_refused(void)
{
    static const double x[18] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1, 1, 1, 2};
    static const int32_t three[12] = {0, 1, 2, 3, 0, 2, 1, 4, 0, 1, 2, 5};
    pal_cells c;
    CHECK_INT(make_tets(x, 6, three, 3, &c), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "cells: cell 2, face 0: is a face of cells 0 and 1 already, a face has two cells at most");
    CHECK_INT(make_tets(x, 5, three, 2, &c), PAL_ERR_OK);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 1. / 3, 1e-15);
    pal_cells_free(&c);
    /* six tetrahedra that go twice round the edge 0 1 */
    static const double ring[24] = {0,   0,   -1, 0,   0, 1, 1,   0,  0, -.5, .8,  0,
                                    -.5, -.8, 0,  1.1, 0, 0, -.6, .9, 0, -.6, -.9, 0};
    static const int32_t twice[24] = {0, 2, 3, 1, 0, 3, 4, 1, 0, 4, 2, 1, 0, 5, 6, 1, 0, 6, 7, 1, 0, 7, 5, 1};
    CHECK_INT(make_tets(ring, 8, twice, 6, &c), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "more than once round the edge of vertices"));
    CHECK_INT(make_tets(ring, 5, twice, 3, &c), PAL_ERR_OK);
    CHECK_INT(c.n_face - c.n_boundary_face, 3);
    pal_cells_free(&c);
    /* one cell of two cubes that share only a corner, or nothing */
    pal_cells eight = block(2, 2, 2);
    pal_cell_loops l;
    const bool keep[8] = {true, false, false, false, false, false, false, true};
    REQUIRE(!pal_cells_loops(&eight, keep, &l, NULL));
    pal_cells_free(&eight);
    l.cell[1] = 12, l.n_cell = 1;
    refused(l, "cells: cell 0 is in pieces");
    /* a cell that is a ring: three bricks in a circle as one, their common faces left out */
    pal_cells ring3;
    REQUIRE(!pal_cells_ring(3, 1, .3, &ring3, &diag));
    REQUIRE(!pal_cells_loops(&ring3, NULL, &l, NULL));
    int n = 0, n_corner = 0;
    for (int f = 0; f < ring3.n_face_use; f++) {
        if (ring3.face_use[f].mate >= 0) continue;
        memmove(l.corner + n_corner, l.corner + l.loop[f], 16);
        l.loop[n++] = n_corner, n_corner += 4;
    }
    l.loop[n] = n_corner, l.cell[1] = n, l.n_cell = 1;
    pal_cells_free(&ring3);
    refused(l, "cells: cell 0 is no ball: 12 vertices - 24 edges + 12 faces make 0, not 2");
}

static void every_broken_index_is_found_by_the_check(void)
{
    pal_cells c = block(2, 2, 2);
    uint64_t state = 5;
    int n_found = 0, n_try = 0;
    struct {
        int32_t *at;
        int n;
    } list[] = {{(int32_t *)(void *)c.edge_use, c.n_edge_use * 5},
                {(int32_t *)(void *)c.face_use, c.n_face_use * 5},
                {c.cell_use, c.n_cell + 1},
                {c.corner_use, 8 * c.n_cell},
                {c.vertex_edge.item, 2 * c.n_edge},
                {c.edge_face.item, c.edge_face.start[c.n_edge]},
                {c.vertex_cell.item, 8 * c.n_cell},
                {c.edge_cell.start, c.n_edge + 1},
                {c.cell_vertex.item, 8 * c.n_cell},
                {c.vertex_face.start, c.n_vertex + 1}};
    for (size_t k = 0; k < sizeof list / sizeof *list; k++)
        for (int i = 0; i < list[k].n; i += 1 + (int)(state >> 61)) {
            int32_t was = list[k].at[i], step = (int32_t)random_below(&state, 16) + 1;
            list[k].at[i] = was + step;
            n_try++;
            n_found += cells_check(&c, NULL, &diag) == PAL_ERR_REFUSED;
            /* another edge use of the same corner is as good */
            if (list[k].at == c.corner_use && cells_check(&c, NULL, &diag) == PAL_ERR_OK) n_found++;
            list[k].at[i] = was;
        }
    CHECK(n_try > 300);
    CHECK_INT(n_found, n_try);
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
    c.edge[3].boundary = !c.edge[3].boundary;
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_REFUSED);
    c.edge[3].boundary = !c.edge[3].boundary;
    double *x = malloc((size_t)c.n_vertex * 24);
    REQUIRE(x);
    memcpy(x, c.x, (size_t)c.n_vertex * 24);
    x[3 * 13] += 5; /* the inner vertex */
    CHECK_INT(cells_check(&c, x, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "has no positive volume"));
    free(x);
    pal_cells_free(&c);
}

int main(void)
{
    RUN(a_block_has_the_counts_of_a_grid);
    RUN(radial_mate_radial_mate_visits_every_cell_round_an_edge_once);
    RUN(turning_round_a_corner_meets_its_faces_counter_clockwise);
    RUN(next_and_prev_undo_each_other_and_over_walks_the_boundary);
    RUN(holes_and_hollows_are_counted);
    RUN(cells_that_touch_in_an_edge_or_a_corner_are_marked);
    RUN(the_boundary_is_closed_and_outward);
    RUN(shapes_have_the_volume_and_the_size_they_should);
    RUN(loops_give_the_same_complex_again);
    RUN(deleting_cells_keeps_what_is_left_as_it_was);
    RUN(any_polyhedra_go_together);
    RUN(what_is_no_complex_is_refused_in_a_sentence);
    RUN(faces_of_three_cells_and_cells_twice_round_are_refused);
    RUN(every_broken_index_is_found_by_the_check);
    return check_report();
}
