/* Local subdivision (paper A section 4.1), and thousands of edits one after the other: results are whole, and subdivide
 * into elements or are refused. */
#include "tests/fixtures/cell_check.h"
#include "tests/fixtures/edits.h"

/* ---- divide ---- */

/* a cube becomes 2 x 2 x 2; in a block its neighbours get the corners, and are what they were in shape */
static void dividing_a_cell_keeps_the_volume_and_its_neighbours_whole(void)
{
    pal_cells c = edited(solid_block(1, 1, 1), (pal_cells_command){.kind = PAL_CELLS_DIVIDE});
    check_counts(&c, 27, 54, 36, 8);
    CHECK_NEAR(pal_cells_volume(&c, NULL), 1, 1e-12);
    pal_cells_free(&c);
    c = solid_block(3, 3, 3);
    double before = pal_cells_volume(&c, NULL);
    for (int32_t i = 0; i < c.n_edge; i++) c.edge[i].sharp = i == solid_edge(&c, 21, 22) ? 2 : 0;
    pal_cells_edit e;
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 13, .rings = 0}, &e, &diag));
    check_carrying(&e, &c);
    /* 12 halves more and 24 + 6 inside; 24 - 6 quads more and 12 inside */
    check_counts(&e.cells, 64 + 19, 144 + 12 + 24 + 6, 108 + 18 + 12, 27 + 7);
    check_holes(&e.cells, 1, 0, 0);
    CHECK_NEAR(pal_cells_volume(&e.cells, NULL), before, 1e-12);
    int n_sharp = 0, n_part = 0;
    for (int32_t i = 0; i < e.cells.n_edge; i++) n_sharp += e.cells.edge[i].sharp == 2;
    CHECK_INT(n_sharp, 2);
    for (int32_t i = 0; i < e.cells.n_cell; i++) {
        double v = pal_cells_cell_volume(&e.cells, NULL, i);
        n_part += e.cell_from[i] == 13;
        CHECK_NEAR(v, e.cell_from[i] == 13 ? .125 : 1, 1e-12);
        CHECK_INT(e.cell_from[i], i < 27 ? i : 13);
    }
    CHECK_INT(n_part, 8);
    /* the neighbour across a face has nine more corners there than 4, so five more faces by three */
    int32_t beside = cell_near(&e.cells, -1, 0, 0);
    CHECK_INT(e.cells.cell_use[beside + 1] - e.cells.cell_use[beside], 9);
    CHECK_INT(e.cells.cell_vertex.start[beside + 1] - e.cells.cell_vertex.start[beside], 13);
    pal_cells_edit_free(&e);
    pal_cells_free(&c);
}

static void parts_of_any_polyhedron_fill_it(void)
{
    for (int which = 0; which < 4; which++) {
        pal_cells c = which == 0   ? solid_prism(7)
                      : which == 1 ? solid_pyramids()
                      : which == 2 ? solid_tube(5, 2, 2)
                                   : solid_torus(6, 1);
        double volume = pal_cells_volume(&c, NULL);
        int32_t n_corner = c.cell_vertex.start[1], n_cell = c.n_cell;
        c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE});
        CHECK_INT(c.n_cell, n_cell + n_corner - 1);
        CHECK_NEAR(pal_cells_volume(&c, NULL), volume, 1e-12 * volume);
        /* and a part, and a neighbour that has been cut into */
        for (int32_t i = c.n_cell; i > 0; i -= (c.n_cell + 2) / 3) {
            c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = i - 1});
            CHECK_NEAR(pal_cells_volume(&c, NULL), volume, 1e-12 * volume);
            CHECK_INT(cells_check(&c, NULL, &diag), PAL_ERR_OK);
        }
        pal_cells_free(&c);
    }
}

static void divided_solids_subdivide_into_elements_that_are_not_turned(void)
{
    for (int which = 0; which < 5; which++) {
        pal_cells c = which == 4 ? solid_tube(12, 1, 2) : solid_block(which == 0 ? 2 : 3, which < 2 ? 2 : 3, 2);
        c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = which});
        for (int level = 1; level <= 2; level++)
            for (int rule = 0; rule < 2; rule++) CHECK_INT(quality(&c, level, (pal_subdivision_rule)rule), 2);
        pal_cells_free(&c);
    }
    /* some cell of a divided block divided again, sharp at a corner, with a wart */
    pal_cells c = solid_block(2, 2, 2);
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 7});
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = cell_near(&c, .8, .8, .8)});
    c = edited(c, (pal_cells_command){.kind = PAL_CELLS_SHARPEN_VERTEX, .vertex = 0, .sharp = 2});
    pal_cells_command k = {.kind = PAL_CELLS_EXTRUDE, .distance_m = .2, .scale = .9};
    k.face = face_near(&c, 1, .8, .8);
    c = edited(c, k);
    CHECK_INT(c.n_cell, 8 + 7 + 7 + 1);
    CHECK_INT(quality(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY), 2);
    pal_cells_free(&c);
}

static double cells_at_rest(const pal_cells *c)
{
    double sum = 0;
    for (int32_t i = 0; i < 3 * c->n_vertex; i++) sum += c->x[i] * c->x[i];
    return sum;
}

/* cell after cell in any order, or all at once: a level of subdivision that moves nothing */
static void dividing_every_cell_is_a_level_of_subdivision(void)
{
    for (int which = 0; which < 4; which++) {
        pal_cells from = which == 0   ? solid_block(3, 2, 2)
                         : which == 1 ? solid_torus(6, 1)
                         : which == 2 ? solid_pyramids()
                                      : solid_tube(5, 2, 2);
        pal_subdivision s = {0};
        const pal_subdivision_options o = {.n_level = 1};
        REQUIRE(!pal_subdivision_make(&from, &o, &s, &diag));
        int32_t list[64], n = from.n_cell;
        for (int32_t i = 0; i < n; i++) list[i] = i;
        for (int32_t i = n - 1; i > 0; i--) {
            int32_t k = (int32_t)(pal_random_bits(3, (uint64_t)i) % (uint64_t)(i + 1)), t = list[i];
            list[i] = list[k], list[k] = t;
        }
        pal_cells_edit e;
        REQUIRE(!pal_cells_divide(&from, n, list, &e, &diag));
        check_carrying(&e, &from);
        check_counts(&e.cells, s.cells.n_vertex, s.cells.n_edge, s.cells.n_face, s.cells.n_cell);
        CHECK_INT(e.cells.n_edge_use, s.cells.n_edge_use);
        CHECK_INT(e.cells.n_boundary_face, s.cells.n_boundary_face);
        pal_cells c = {0};
        if (pal_cells_copy(&from, &c)) abort();
        for (int32_t i = 0; i < n; i++) c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = i});
        check_counts(&c, s.cells.n_vertex, s.cells.n_edge, s.cells.n_face, s.cells.n_cell);
        CHECK_NEAR(cells_at_rest(&c), cells_at_rest(&e.cells), 1e-12 * cells_at_rest(&c));
        CHECK_NEAR(pal_cells_volume(&c, NULL), pal_cells_volume(&from, NULL), 1e-12);
        pal_cells_free(&c);
        pal_cells_edit_free(&e);
        pal_subdivision_free(&s);
        pal_cells_free(&from);
    }
}

static void rings_take_the_neighbours_along(void)
{
    pal_cells c = solid_block(5, 3, 3);
    pal_cells_edit e;
    REQUIRE(!pal_cells_apply(
        &c, &(pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = cell_near(&c, 0, 0, 0), .rings = 1}, &e, &diag));
    CHECK_INT(e.cells.n_cell, 18 + 27 * 8);
    check_carrying(&e, &c);
    for (int level = 1; level <= 2; level++) CHECK_INT(quality(&e.cells, level, PAL_SUBDIVISION_MACCRACKEN_JOY), 2);
    pal_cells_edit_free(&e);
    REQUIRE(!pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 0, .rings = 99}, &e, &diag));
    check_counts(&e.cells, 11 * 7 * 7, 10 * 49 + 2 * 11 * 6 * 7, 11 * 36 + 2 * 10 * 42, 360);
    pal_cells_edit_free(&e);
    CHECK_INT(pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 0, .rings = -1}, &e, &diag),
              PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "divide cell 0: -1 rings, must be 0 to 1000");
    const int32_t twice[2] = {4, 4};
    CHECK_INT(pal_cells_divide(&c, 2, twice, &e, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "divide: cell 4 is given twice");
    CHECK_INT(pal_cells_divide(&c, 0, twice, &e, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "divide: 0 cells, must be 1 to 45");
    CHECK(!e.cells.x && !e.rows.start && !e.offset);
    pal_cells_free(&c);
    c = solid_block(9, 8, 8);
    CHECK_INT(pal_cells_apply(&c, &(pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = 0, .rings = 99}, &e, &diag),
              PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "divide: 576 cells, must be 1 to 512");
    pal_cells_free(&c);
}

/* a sharp face between the divided cell and one that was deleted or divided before keeps its sharpness in all parts */
static void parts_of_sharp_faces_stay_sharp_in_any_order(void)
{
    for (int order = 0; order < 3; order++) {
        pal_cells c = solid_block(2, 1, 1);
        for (int32_t f = 0; f < c.n_face; f++) c.face[f].sharp = pal_cells_face_boundary(&c, f) ? 0 : 3;
        c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = order == 1});
        if (order == 2) {
            /* the boundary has the quads then, and the cell their middle */
            for (int i = 0; i < 8; i++)
                c = edited(c, (pal_cells_command){.kind = PAL_CELLS_DELETE, .cell = cell_near(&c, -.5, 0, 0)});
            CHECK_INT(c.n_cell, 1);
        }
        c = edited(c,
                   (pal_cells_command){.kind = PAL_CELLS_DIVIDE, .cell = cell_near(&c, order == 1 ? -.5 : .5, 0, 0)});
        int n_sharp = 0;
        for (int32_t f = 0; f < c.n_face; f++) n_sharp += c.face[f].sharp == 3;
        CHECK_INT(n_sharp, 4);
        CHECK_INT(c.n_cell, order == 2 ? 8 : 16);
        pal_cells_free(&c);
    }
}

/* ---- thousands ---- */

typedef struct dice {
    uint64_t seed, n;
} dice;

static double draw(dice *d, double low, double high)
{
    return low + (high - low) * pal_random_unit(d->seed, d->n++);
}

static int32_t pick(dice *d, int32_t n)
{
    return (int32_t)(pal_random_bits(d->seed, d->n++) % (uint64_t)n);
}

/* a face to pair with one: as many corners, none in common, nearest and not facing the same way; -1: none */
static int32_t partner(const pal_cells *c, int32_t face, bool merge)
{
    int32_t first, n = pal_cells_face_loop(c, face, &first), best = -1;
    double min = INFINITY, o[3], p[3], a[3], b[3];
    pal_cells_face_centre(c, NULL, face, o);
    pal_cells_face_area(c, NULL, face, a);
    for (int32_t f = 0; f < c->n_face; f++) {
        int32_t at, common = 0;
        if (!pal_cells_face_boundary(c, f) || pal_cells_face_loop(c, f, &at) != n) continue;
        for (int32_t i = first; i < first + n; i++)
            for (int32_t k = at; k < at + n; k++) common += c->edge_use[i].vertex == c->edge_use[k].vertex;
        for (int32_t i = first; i < first + n && merge; i++)
            for (int32_t k = at; k < at + n; k++)
                common += solid_edge(c, c->edge_use[i].vertex, c->edge_use[k].vertex) >= 0;
        pal_cells_face_centre(c, NULL, f, p);
        pal_cells_face_area(c, NULL, f, b);
        double d = hypot(hypot(o[0] - p[0], o[1] - p[1]), o[2] - p[2]);
        double out = (p[0] - o[0]) * a[0] + (p[1] - o[1]) * a[1] + (p[2] - o[2]) * a[2];
        if (common || a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > 0 || out < 0 || d >= min) continue;
        min = d, best = f;
    }
    return best;
}

/* a command that may well be taken; large solids shrink */
static pal_cells_command invent(const pal_cells *c, dice *d)
{
    /* kinds by their share of 16 */
    static const int8_t kind_of[16] = {0, 0, 0, 1, 1, 1, 2, 2, 3, 3, 4, 5, 6, 7, 8, 8};
    pal_cells_command k = {.kind = (pal_cells_command_kind)kind_of[pick(d, 16)], .scale = draw(d, .6, 1.2)};
    double area[3];
    if (c->n_cell > 24) k.kind = PAL_CELLS_DELETE;
    k.cell = pick(d, c->n_cell), k.edge = pick(d, c->n_edge), k.vertex = pick(d, c->n_vertex);
    do k.face = pick(d, c->n_face);
    while (!pal_cells_face_boundary(c, k.face));
    if (k.kind == PAL_CELLS_MERGE || k.kind == PAL_CELLS_BRIDGE)
        for (int i = 0; i < 12 && (k.other_face = partner(c, k.face, k.kind == PAL_CELLS_MERGE)) < 0; i++) do
                k.face = pick(d, c->n_face);
            while (!pal_cells_face_boundary(c, k.face));
    /* nothing to pair with: grow something */
    if ((k.kind == PAL_CELLS_MERGE || k.kind == PAL_CELLS_BRIDGE) && k.other_face < 0) k.kind = PAL_CELLS_EXTRUDE;
    pal_cells_face_area(c, NULL, k.face, area);
    k.distance_m = draw(d, .3, 1.2) * sqrt(sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2]));
    k.sharp = (float)pick(d, 5) / 2;
    int32_t e = c->vertex_edge.item[c->vertex_edge.start[k.vertex]];
    const double *a = c->x + 3 * c->edge[e].vertex[0], *b = c->x + 3 * c->edge[e].vertex[1];
    double length = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    for (int i = 0; i < 3; i++) k.to_m[i] = c->x[3 * k.vertex + i] + draw(d, -.2, .2) * length;
    return k;
}

static pal_cells beginning(int which)
{
    return which == 0   ? solid_block(2, 2, 1)
           : which == 1 ? solid_tube(6, 1, 1)
           : which == 2 ? solid_pyramids()
           : which == 3 ? solid_prism(5)
                        : solid_torus(8, 1);
}

static void thousands_of_edits_leave_whole_solids(void)
{
    const int n_command = CHECK_REPEATS(5000, 1000);
    int taken[PAL_CELLS_COMMAND_KINDS] = {0}, asked[PAL_CELLS_COMMAND_KINDS] = {0}, outcome[3] = {0}, n_taken = 0;
    dice d = {.seed = 66};
    pal_cells c = {0};
    for (int i = 0; i < n_command; i++) {
        if (i % 50 == 0) {
            pal_cells_free(&c);
            c = beginning(i / 50 % 5);
        }
        pal_cells_command k = invent(&c, &d);
        pal_cells_edit e;
        int32_t n_vertex = c.n_vertex, n_cell = c.n_cell;
        diag.text[0] = 0;
        asked[k.kind]++;
        pal_err err = pal_cells_apply(&c, &k, &e, &diag);
        if (err) {
            if (err != PAL_ERR_REFUSED || !diag.text[0] || e.cells.x || e.rows.start || c.n_vertex != n_vertex ||
                c.n_cell != n_cell)
                CHECK_FAIL("edit %d: %s: %s", i, pal_err_name(err), diag.text);
            continue;
        }
        taken[k.kind]++;
        if (cells_check(&e.cells, NULL, &diag)) CHECK_FAIL("edit %d: %s", i, diag.text);
        if (!(pal_cells_volume(&e.cells, NULL) > 0)) CHECK_FAIL("edit %d: no volume", i);
        if (n_taken % 7 == 0) check_carrying(&e, &c);
        pal_cells_free(&c);
        c = e.cells;
        memset(&e.cells, 0, sizeof e.cells);
        pal_cells_edit_free(&e);
        if (n_taken++ % 50 == 0) outcome[quality(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY)]++;
    }
    pal_cells_free(&c);
    for (int k = 0; k < PAL_CELLS_COMMAND_KINDS; k++) {
        printf("  %-14s %4d of %4d taken\n", pal_cells_command_name((pal_cells_command_kind)k), taken[k], asked[k]);
        CHECK(taken[k] * 10 > asked[k] && taken[k] >= n_command / 200);
    }
    printf("  subdivided twice: %d refused, %d with a turned Gauss point, %d good\n", outcome[0], outcome[1],
           outcome[2]);
    /* a solid of elements refuses turned ones, with a sentence of its own */
    CHECK(outcome[2] * 4 > outcome[0] + outcome[1]);
}

int main(void)
{
    tabulate_slopes();
    RUN(dividing_a_cell_keeps_the_volume_and_its_neighbours_whole);
    RUN(parts_of_any_polyhedron_fill_it);
    RUN(dividing_every_cell_is_a_level_of_subdivision);
    RUN(rings_take_the_neighbours_along);
    RUN(parts_of_sharp_faces_stay_sharp_in_any_order);
    RUN(divided_solids_subdivide_into_elements_that_are_not_turned);
    RUN(thousands_of_edits_leave_whole_solids);
    return check_report();
}
