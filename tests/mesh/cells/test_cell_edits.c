/* Sculpting edits (paper A section 4.1) but division: counts, volumes and holes of each, what carries a state over,
 * refusals. */
#include "tests/fixtures/cell_check.h"
#include "tests/fixtures/edits.h"

/* ---- one edit each ---- */

static void deleting_the_heart_leaves_a_cavity_and_a_row_a_hole(void)
{
    pal_cells c = edited(solid_block(3, 3, 3), (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 13});
    check_counts(&c, 64, 144, 108, 26);
    check_holes(&c, 1, 1, 0);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 26, 1e-12);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = cell_near(&c, 0, 0, -1)});
    check_holes(&c, 1, 0, 0);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = cell_near(&c, 0, 0, 1)});
    check_holes(&c, 1, 0, 1);
    /* all edges stay: of the faces go both mouths and the two between */
    check_counts(&c, 64, 144, 108 - 4, 24);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 24, 1e-12);
    pal_cells_free(&c);
}

/* boundary faces that were not on the boundary of the first complex */
static int n_inside(const pal_cells *c)
{
    int n = 0;
    for (int32_t f = 0; f < c->n_face; f++) n += pal_cells_face_boundary(c, f) && c->face[f].inside;
    return n;
}

static pal_cells without_a_corner(void)
{
    return edited(solid_block(3, 3, 3), (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 0});
}

/* 54 faces of a block are outside, whatever happens to others; what an edit opens or makes is inside */
static void faces_that_edits_open_or_make_are_inside(void)
{
    pal_cells c = solid_block(3, 3, 3);
    CHECK_INT(n_inside(&c), 0);
    pal_cells_free(&c);
    c = without_a_corner();
    CHECK_INT(c.n_boundary_face, 54);
    CHECK_INT(n_inside(&c), 3);
    /* the neighbour has one of the three, of which there are four parts then, and two outer ones */
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = cell_near(&c, 0, -1, -1)});
    CHECK_INT(c.n_boundary_face, 54 + 3 * 3);
    CHECK_INT(n_inside(&c), 3 + 3);
    pal_cells_free(&c);
    /* dividing and sharpening open nothing */
    c = edited(solid_block(3, 3, 3), (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 0});
    CHECK_INT(n_inside(&c), 0);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_SHARPEN_FACE, .face = 0, .sharp = 2});
    CHECK_INT(n_inside(&c), 0);
    /* and one of the parts leaves three */
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = cell_near(&c, -9, -9, -9)});
    CHECK_INT(n_inside(&c), 3);
    pal_cells_free(&c);
    /* sides and end of a cell that grows, and of one between two faces */
    c = solid_block(3, 3, 3);
    c = edited(
        c, (pal_cells_command){.kind = PAL_CELLS_EXTRUDE, .face = face_near(&c, 0, 0, 9), .distance_m = 1, .scale = 1});
    CHECK_INT(c.n_boundary_face, 53 + 5);
    CHECK_INT(n_inside(&c), 5);
    pal_cells_free(&c);
    c = edited(solid_block(3, 1, 1), (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 1});
    CHECK_INT(n_inside(&c), 2);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_BRIDGE,
                                      .face = face_near(&c, -0.5, 0, 0),
                                      .other_face = face_near(&c, 0.5, 0, 0)});
    CHECK_INT(n_inside(&c), 4);
    pal_cells_free(&c);
}

static void what_is_left_after_a_deletion_knows_where_it_comes_from(void)
{
    pal_cells c = solid_block(3, 1, 1);
    pal_cells_edit e;
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 1}, &e, &diag));
    check_carrying(&e, &c);
    check_counts(&e.cells, 16, 24, 12, 2);
    check_holes(&e.cells, 2, 0, 0);
    CHECK(e.cell_from[0] == 0 && e.cell_from[1] == 2 && e.face == -1);
    pal_cells_edit_free(&e);
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 0}, &e, &diag));
    CHECK_INT(e.cells.n_vertex, 12);
    CHECK(e.cell_from[0] == 1 && e.cell_from[1] == 2);
    pal_cells_edit_free(&e);
    pal_cells_free(&c);
    c = solid_block(1, 1, 1);
    CHECK_INT(pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 0}, &e, &diag),
              PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "delete cell 0: it is the last one, a solid needs a cell");
    pal_cells_free(&c);
}

static void an_extruded_cube_has_twice_the_volume_and_grows_on(void)
{
    pal_cells c = solid_block(1, 1, 1);
    c.edge[0].sharp = 3, c.face[2].sharp = 2, c.vertex_sharpness[5] = 1;
    pal_cells_edit e;
    for (int32_t f = 0; f < 6; f++) {
        REQUIRE(!pal_cells_apply(
            &c, &(pal_cells_command){.kind = PAL_CELLS_EXTRUDE, .face = f, .distance_m = 1, .scale = 1}, &e, &diag));
        CHECK_NEAR(pal_cells_volume(&e.cells, NULL), 2, 1e-12);
        check_counts(&e.cells, 12, 20, 11, 2);
        check_carrying(&e, &c);
        CHECK(e.cell_from[1] == 0 && e.rotated_face == f);
        /* the face to go on with lies opposite, a metre out */
        double o[3], p[3], n[3];
        pal_cells_face_centre(&c, NULL, f, o);
        pal_cells_face_centre(&e.cells, NULL, e.face, p);
        pal_cells_face_area(&e.cells, NULL, e.face, n);
        CHECK(pal_cells_face_boundary(&e.cells, e.face));
        for (int a = 0; a < 3; a++) CHECK_NEAR(p[a] - o[a], n[a], 1e-15);
        for (int32_t v = 8; v < 12; v++) CHECK(e.cells.vertex_sharpness[v] == 0);
        CHECK(e.cells.vertex_sharpness[5] == 1);
        float edge = 0, face = 0;
        for (int32_t i = 0; i < e.cells.n_edge; i++) edge += e.cells.edge[i].sharp;
        for (int32_t i = 0; i < e.cells.n_face; i++) face += e.cells.face[i].sharp;
        CHECK(edge == 3 && face == 2);
        pal_cells_edit_free(&e);
    }
    pal_cells_free(&c);
}

/* a frustum of areas A and s^2 A has h A (1 + s + s^2)/3; a prism's top of n corners gives n more quads */
static void an_extrusion_is_scaled_about_the_middle_of_its_face(void)
{
    for (int n = 3; n <= 9; n += 2) {
        pal_cells c = solid_prism(n);
        double area = n / 2. * sin(6.283185307179586 / n), s = .25 * n;
        pal_cells_edit e;
        REQUIRE(!pal_cells_apply(
            &c,
            &(pal_cells_command){
                .kind = PAL_CELLS_EXTRUDE, .face = face_near(&c, 0, 0, 1), .distance_m = .5, .scale = s},
            &e, &diag));
        CHECK_NEAR(pal_cells_volume(&e.cells, NULL), area * (1 + .5 * (1 + s + s * s) / 3), 1e-12);
        check_counts(&e.cells, 3 * n, 5 * n, 3 + 2 * n, 2);
        check_carrying(&e, &c);
        pal_cells_edit_free(&e);
        pal_cells_free(&c);
    }
}

/* a body that has turned as a whole grows the same thing, turned */
static void an_extrusion_of_a_turned_body_is_the_turned_extrusion(void)
{
    pal_cells c = solid_block(2, 1, 1);
    solid_jitter(&c, .1, 4);
    pal_cells_edit e;
    double x[36], to[48], worst = 0;
    const double r[9] = {2. / 3, -1. / 3, 2. / 3, 2. / 3, 2. / 3, -1. / 3, -1. / 3, 2. / 3, 2. / 3};
    REQUIRE(c.n_vertex == 12 && !pal_cells_apply(&c,
                                                 &(pal_cells_command){.kind = PAL_CELLS_EXTRUDE,
                                                                      .face = face_near(&c, -.5, 0, .5),
                                                                      .distance_m = .7,
                                                                      .scale = .8},
                                                 &e, &diag));
    for (int i = 0; i < 36; i++) {
        const double *p = c.x + i / 3 * 3, *row = r + i % 3 * 3;
        x[i] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + 5;
    }
    pal_cells_edit_positions(&e, &c, x, to);
    for (int i = 0; i < 48; i++) {
        const double *p = e.cells.x + i / 3 * 3, *row = r + i % 3 * 3;
        worst = fmax(worst, fabs(to[i] - 5 - (row[0] * p[0] + row[1] * p[1] + row[2] * p[2])));
    }
    CHECK_LE(worst, 1e-9);
    pal_cells_edit_free(&e);
    pal_cells_free(&c);
}

/* ring of eight without one cell: a bent bar whose ends may be joined */
static pal_cells open_ring(double *whole, int32_t face[2])
{
    pal_cells c = {0};
    if (pal_cells_ring(8, 1, .3, &c, &diag)) abort();
    *whole = pal_cells_volume(&c, NULL);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 0});
    /* the ends are the two faces that have no neighbour over any edge in a plane through the axis */
    int n = 0;
    for (int32_t f = 0; f < c.n_face; f++) {
        double o[3], a[3];
        if (!pal_cells_face_boundary(&c, f)) continue;
        pal_cells_face_centre(&c, NULL, f, o);
        pal_cells_face_area(&c, NULL, f, a);
        if (fabs(o[2]) < 1e-9 && fabs(o[0] * a[0] + o[1] * a[1]) < 1e-9 && n < 2) face[n++] = f;
    }
    CHECK_INT(n, 2);
    return c;
}

static void merging_the_ends_of_a_bent_bar_makes_a_handle(void)
{
    int32_t face[2];
    double whole;
    pal_cells c = open_ring(&whole, face);
    pal_cells_edit e;
    check_holes(&c, 1, 0, 0);
    check_counts(&c, 32, 60, 36, 7);
    int32_t first, corner;
    pal_cells_face_loop(&c, face[1], &first);
    corner = c.edge_use[first].vertex, c.vertex_sharpness[corner] = 2, c.edge[c.edge_use[first].edge].sharp = 3;
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_MERGE, .face = face[0], .other_face = face[1]},
                             &e, &diag));
    check_carrying(&e, &c);
    check_holes(&e.cells, 1, 0, 1);
    check_counts(&e.cells, 28, 56, 35, 7);
    CHECK(e.face >= 0 && !pal_cells_face_boundary(&e.cells, e.face));
    double moved = 0;
    for (int32_t i = 0; i < e.rows.n_row; i++) moved += e.rows.start[i + 1] - e.rows.start[i] == 2;
    CHECK_NEAR(moved, 4, 0);
    /* a joined corner and edge are as sharp as the sharper of the two */
    float vertex = 0, edge = 0;
    for (int32_t i = 0; i < e.cells.n_vertex; i++) vertex += e.cells.vertex_sharpness[i];
    for (int32_t i = 0; i < e.cells.n_edge; i++) edge += e.cells.edge[i].sharp;
    CHECK(vertex == 2 && edge == 3);
    pal_cells_edit_free(&e);
    /* smooth again: joined to elements that are not turned */
    c.vertex_sharpness[corner] = 0, c.edge[c.edge_use[first].edge].sharp = 0;
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_MERGE, .face = face[0], .other_face = face[1]},
                             &e, &diag));
    CHECK_INT(quality(&e.cells, 2, PAL_SUBDIVISION_MACCRACKEN_JOY), 2);
    pal_cells_edit_free(&e);
    /* a bridge is the cell that went */
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_BRIDGE, .face = face[1], .other_face = face[0]},
                             &e, &diag));
    check_carrying(&e, &c);
    check_holes(&e.cells, 1, 0, 1);
    check_counts(&e.cells, 32, 64, 40, 8);
    CHECK_NEAR(pal_cells_volume(&e.cells, NULL), whole, 1e-12);
    CHECK_INT(quality(&e.cells, 2, PAL_SUBDIVISION_MACCRACKEN_JOY), 2);
    pal_cells_edit_free(&e);
    pal_cells_free(&c);
}

static void two_pieces_become_one_and_a_hollow_is_filled(void)
{
    pal_cells c = edited(solid_block(3, 1, 1), (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 1});
    pal_cells_command k = {.kind = PAL_CELLS_MERGE};
    k.face = face_near(&c, -.5, 0, 0), k.other_face = face_near(&c, .5, 0, 0);
    c = edited(c, k);
    check_holes(&c, 1, 0, 0);
    check_counts(&c, 12, 20, 11, 2);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 3, 1e-12);
    pal_cells_free(&c);
    c = edited(solid_block(3, 3, 3), (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = 13});
    k.kind = PAL_CELLS_BRIDGE;
    k.face = face_near(&c, -.5, 0, 0), k.other_face = face_near(&c, .5, 0, 0);
    c = edited(c, k);
    check_holes(&c, 1, 0, 0);
    check_counts(&c, 64, 144, 108, 27);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 27, 1e-12);
    CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
    pal_cells_free(&c);
}

static void sharpening_sets_one_number_and_nothing_else(void)
{
    pal_cells c = solid_block(2, 2, 1), same;
    pal_cells_edit e;
    REQUIRE(!pal_cells_copy(&c, &same));
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_SHARPEN_VERTEX, .vertex = 17, .sharp = 1.5f},
                             &e, &diag));
    CHECK(e.cells.vertex_sharpness[17] == 1.5f);
    check_carrying(&e, &c);
    e.cells.vertex_sharpness[17] = 0;
    CHECK(cells_equal(&e.cells, &same));
    pal_cells_edit_free(&e);
    REQUIRE(!pal_cells_apply(
        &c, &(pal_cells_command){.kind = PAL_CELLS_SHARPEN_EDGE, .edge = 3, .sharp = PAL_SHARPNESS_MAX}, &e, &diag));
    CHECK(e.cells.edge[3].sharp == PAL_SHARPNESS_MAX);
    e.cells.edge[3].sharp = 0;
    CHECK(cells_equal(&e.cells, &same));
    pal_cells_edit_free(&e);
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_SHARPEN_FACE, .face = 5, .sharp = .25f}, &e,
                             &diag));
    CHECK(e.cells.face[5].sharp == .25f);
    e.cells.face[5].sharp = 0;
    CHECK(cells_equal(&e.cells, &same) && cells_equal(&c, &same));
    pal_cells_edit_free(&e);
    pal_cells_free(&same);
    pal_cells_free(&c);
}

static void moving_vertices_moves_them_and_a_fold_is_refused(void)
{
    pal_cells c = solid_block(2, 2, 2);
    pal_cells_edit e;
    double x[3] = {.1, .2, -.1}, corner[3] = {-1.5, -1, -1};
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_MOVE, .vertex = 13, .to_m = {x[0], x[1], x[2]}},
                             &e, &diag));
    check_carrying(&e, &c);
    CHECK(!memcmp(e.cells.x + 39, x, 24));
    CHECK_INT(cells_check(&e.cells, NULL, &diag), PAL_ERR_OK);
    pal_cells_edit_free(&e);
    REQUIRE(!pal_cells_apply(
        &c, &(pal_cells_command){.kind = PAL_CELLS_MOVE, .vertex = 0, .to_m = {corner[0], corner[1], corner[2]}}, &e,
        &diag));
    check_carrying(&e, &c);
    CHECK(!memcmp(e.cells.x, corner, 24));
    CHECK_NEAR(e.offset[0], -.5, 1e-15);
    CHECK_INT(cells_check(&e.cells, NULL, &diag), PAL_ERR_OK);
    pal_cells_edit_free(&e);
    /* the middle beyond a face: cells behind it still have volume, but not all their faces are seen from inside */
    x[0] = .95, x[1] = .95, x[2] = .95;
    CHECK_INT(pal_cells_apply(&c,
                              &(pal_cells_command){.kind = PAL_CELLS_MOVE, .vertex = 13, .to_m = {x[0], x[1], x[2]}},
                              &e, &diag),
              PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "move: cell 3 folds: a face of it faces its centroid");
    x[0] = 1.3;
    CHECK_INT(pal_cells_apply(&c,
                              &(pal_cells_command){.kind = PAL_CELLS_MOVE, .vertex = 13, .to_m = {x[0], x[1], x[2]}},
                              &e, &diag),
              PAL_ERR_REFUSED);
    pal_cells_free(&c);
}

/* ---- refusals ---- */

static void refused(const pal_cells *c, pal_cells_command k, const char *words)
{
    pal_cells same;
    pal_cells_edit e, zero;
    memset(&e, 0x5a, sizeof e);
    memset(&zero, 0, sizeof zero);
    REQUIRE(!pal_cells_copy(c, &same));
    CHECK_INT(pal_cells_apply(c, &k, &e, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, words)) CHECK_TEXT(diag.text, words);
    CHECK(!memcmp(&e, &zero, sizeof e));
    CHECK(cells_equal(c, &same) && !memcmp(c->x, same.x, 24 * (size_t)c->n_vertex));
    CHECK_INT(pal_cells_apply(c, &k, &e, NULL), PAL_ERR_REFUSED);
    pal_cells_free(&same);
}

static void what_cannot_be_done_is_refused_in_a_sentence(void)
{
    pal_cells c = solid_block(2, 1, 1);
    const double nan = (double)NAN;
    int32_t end = face_near(&c, 1, 0, 0), start = face_near(&c, -1, 0, 0), top = face_near(&c, .5, 0, .5), inner = 0;
    while (pal_cells_face_boundary(&c, inner)) inner++;
    pal_cells_command k = {.kind = PAL_CELLS_DELETE, .cell = 2};
    refused(&c, k, "delete cell 2: cell 2, there are 2");
    k = (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = -1};
    refused(&c, k, "divide cell -1: cell -1, there are 2");
    k = (pal_cells_command){.kind = PAL_CELLS_EXTRUDE, .face = INT32_MIN, .distance_m = 1, .scale = 1};
    refused(&c, k, "extrude face -2147483648: face -2147483648, there are 11");
    k.face = inner;
    refused(&c, k, "lies between cells 0 and 1, not on the boundary");
    k.face = end, k.distance_m = nan;
    refused(&c, k, "distance is nan m, must be above 0 and at most 1e+09");
    k.distance_m = -.5;
    refused(&c, k, "distance is -0.5 m, must be above 0");
    k.distance_m = 1, k.scale = nan;
    refused(&c, k, "scale is nan, must be above 0 and at most 1000");
    k.scale = 1, k.distance_m = 1e9;
    refused(&c, k, "must be within 1e+09 m of the origin");
    k.scale = 1e-13, k.distance_m = 1;
    refused(&c, k, "cell 2 folds");
    k = (pal_cells_command){.kind = PAL_CELLS_MERGE, .face = end, .other_face = end};
    refused(&c, k, "it is the same face twice");
    k.other_face = 99;
    refused(&c, k, "face 99, there are 11");
    k.other_face = top;
    refused(&c, k, "they have vertex");
    k.other_face = inner;
    refused(&c, k, "not on the boundary");
    k.other_face = start;
    refused(&c, k, "has no area");
    k.kind = PAL_CELLS_BRIDGE;
    refused(&c, k, "cells: cell 2");
    k = (pal_cells_command){.kind = PAL_CELLS_SHARPEN_EDGE, .edge = 20, .sharp = 1};
    refused(&c, k, "sharpen_edge 20: edge 20, there are 20");
    k = (pal_cells_command){.kind = PAL_CELLS_SHARPEN_FACE, .sharp = (float)NAN};
    refused(&c, k, "sharpen_face 0: sharpness is nan, must be 0 to 1e+06");
    k = (pal_cells_command){.kind = PAL_CELLS_SHARPEN_VERTEX, .sharp = -1};
    refused(&c, k, "sharpness is -1, must be 0 to 1e+06");
    k = (pal_cells_command){.kind = PAL_CELLS_MOVE, .to_m = {0, nan, 0}};
    refused(&c, k, "move: vertex 0 to 0 nan 0 m, must be within 1e+09 m of the origin");
    k = (pal_cells_command){.kind = (pal_cells_command_kind)77};
    refused(&c, k, "edit: kind 77, there are 9");
    pal_cells_free(&c);
    c = solid_block(1, 1, 1);
    k = (pal_cells_command){.kind = PAL_CELLS_MERGE, .other_face = face_near(&c, 0, 0, .5)};
    k.face = face_near(&c, 0, 0, -.5);
    refused(&c, k, "joins their vertices");
    pal_cells_free(&c);
    c = solid_prism(5);
    k = (pal_cells_command){.kind = PAL_CELLS_BRIDGE, .face = 0, .other_face = 3};
    refused(&c, k, "they have 5 and 4 corners, must have equally many");
    pal_cells_free(&c);
    c = solid_block(1, 1, 1);
    refused(&c, (pal_cells_command){.kind = PAL_CELLS_MOVE, .vertex = 9}, "move: vertex 9, there are 8");
    pal_cells_free(&c);
}

static void every_kind_has_a_name(void)
{
    CHECK_TEXT(pal_cells_command_name(PAL_CELLS_DIVIDE), "divide");
    CHECK(!pal_cells_command_name((pal_cells_command_kind)-1) && !pal_cells_command_name(PAL_CELLS_COMMAND_KINDS));
}

int main(void)
{
    tabulate_slopes();
    RUN(deleting_the_heart_leaves_a_cavity_and_a_row_a_hole);
    RUN(faces_that_edits_open_or_make_are_inside);
    RUN(what_is_left_after_a_deletion_knows_where_it_comes_from);
    RUN(an_extruded_cube_has_twice_the_volume_and_grows_on);
    RUN(an_extrusion_is_scaled_about_the_middle_of_its_face);
    RUN(an_extrusion_of_a_turned_body_is_the_turned_extrusion);
    RUN(merging_the_ends_of_a_bent_bar_makes_a_handle);
    RUN(two_pieces_become_one_and_a_hollow_is_filled);
    RUN(sharpening_sets_one_number_and_nothing_else);
    RUN(moving_vertices_moves_them_and_a_fold_is_refused);
    RUN(what_cannot_be_done_is_refused_in_a_sentence);
    RUN(every_kind_has_a_name);
    return check_report();
}
