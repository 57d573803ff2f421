/* Subdivision of solids: masks on lattices, the boundary against Catmull-Clark surfaces written out here, holes,
 * creases, refusals. */
#include "server/mesh/cells/maccracken_joy.h"
#include "tests/check.h"
#include "tests/fixtures/solids.h"

#include <float.h>

/* a subdivision that must succeed */
static pal_subdivision of(const pal_cells *c, int n_level, pal_subdivision_rule rule)
{
    pal_subdivision s = {0};
    pal_diagnostic diag = {"no note"};
    const pal_subdivision_options o = {.n_level = n_level, .rule = rule};
    if (pal_subdivision_make(c, &o, &s, &diag)) CHECK_FAIL("%s", diag.text);
    return s;
}

static double weight_of(const pal_interpolation *r, int32_t row, int32_t point)
{
    for (int32_t k = r->start[row]; k < r->start[row + 1]; k++)
        if (r->point[k] == point) return r->weight[k];
    return 0;
}

/* control vertices of new vertex i, which stands in the mean of them before anything is smoothed */
static int origin_of(const pal_cells *c, int32_t i, int32_t out[PAL_CELL_LOOP_MAX], bool *boundary)
{
    int32_t first, n;
    *boundary = false;
    if (i < c->n_vertex) {
        *boundary = c->vertex_boundary[i];
        out[0] = i;
        return 1;
    }
    i -= c->n_vertex;
    if (i < c->n_edge) {
        *boundary = c->edge[i].boundary;
        memcpy(out, c->edge[i].vertex, 2 * sizeof *out);
        return 2;
    }
    i -= c->n_edge;
    if (i < c->n_face) {
        *boundary = pal_cells_face_boundary(c, i);
        n = pal_cells_face_loop(c, i, &first);
        for (int32_t k = 0; k < n; k++) out[k] = c->edge_use[first + k].vertex;
        return n;
    }
    i -= c->n_face;
    first = c->cell_vertex.start[i], n = c->cell_vertex.start[i + 1] - first;
    memcpy(out, c->cell_vertex.item + first, (size_t)n * sizeof *out);
    return n;
}

/* one axis of the cubic B-spline's refinement, new place at twice its lattice number: 1/8 (1,6,1) or 1/2 (1,1) */
static double mask(int place, int old)
{
    int d = place - 2 * old;
    if (place % 2 == 0) return d == 0 ? 0.75 : abs(d) == 2 ? 0.125 : 0;
    return abs(d) == 1 ? 0.5 : 0;
}

enum { SIDE = 5, ROW = SIDE + 1, LATTICE = ROW * ROW * ROW };

static void lattice_place(int32_t v, int out[3])
{
    out[0] = v % ROW, out[1] = v / ROW % ROW, out[2] = v / (ROW * ROW);
}

/* largest difference of a row from the product of masks along the axes that are true */
static double row_error(const pal_interpolation *rows, int32_t row, const int32_t *old, int n_old, const bool axis[3],
                        int *max)
{
    int place[3] = {0, 0, 0}, at[3], wanted = 0;
    double worst = 0;
    for (int k = 0; k < n_old; k++) {
        lattice_place(old[k], at);
        for (int a = 0; a < 3; a++) place[a] += 2 * at[a];
    }
    for (int32_t v = 0; v < LATTICE; v++) {
        double want = 1;
        lattice_place(v, at);
        for (int a = 0; a < 3; a++) want *= axis[a] ? mask(place[a] / n_old, at[a]) : place[a] / n_old == 2 * at[a];
        wanted += want != 0;
        worst = fmax(worst, fabs(want - weight_of(rows, row, v)));
    }
    if (rows->start[row + 1] - rows->start[row] != wanted) return 1e9;
    if (wanted > *max) *max = wanted;
    return worst;
}

/* the axes that a face of the block spans at a place, false: an edge or a corner of the block */
static bool spans(const int32_t *old, int n_old, bool axis[3])
{
    int n = 3, at[3];
    for (int a = 0; a < 3; a++) {
        bool low = true, high = true;
        for (int k = 0; k < n_old; k++) {
            lattice_place(old[k], at);
            low = low && at[a] == 0, high = high && at[a] == SIDE;
        }
        axis[a] = !low && !high;
        n -= !axis[a];
    }
    return n >= 2;
}

static void masks_of(pal_subdivision_rule rule)
{
    pal_cells c = solid_block(SIDE, SIDE, SIDE);
    pal_subdivision s = of(&c, 1, rule);
    int max_inner = 0, max_face = 0, n_inner = 0, n_face = 0;
    double inner = 0, face = 0;
    for (int32_t i = 0; i < s.rows.n_row; i++) {
        int32_t old[PAL_CELL_LOOP_MAX];
        bool boundary, axis[3];
        int n = origin_of(&c, i, old, &boundary);
        if (!spans(old, n, axis)) continue;
        CHECK(boundary == !(axis[0] && axis[1] && axis[2]));
        if (boundary)
            face = fmax(face, row_error(&s.rows, i, old, n, axis, &max_face)), n_face++;
        else
            inner = fmax(inner, row_error(&s.rows, i, old, n, axis, &max_inner)), n_inner++;
    }
    CHECK_LE(inner, 1e-12);
    CHECK_LE(face, 1e-12);
    CHECK_INT(max_inner, 27);
    CHECK_INT(max_face, 9);
    /* 11^3 new vertices, 9^3 of them inside, 6 9^2 inside the block's faces */
    CHECK_INT(s.rows.n_row, 1331);
    CHECK_INT(n_inner, 729);
    CHECK_INT(n_face, 486);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

static void lattices_are_refined_by_the_masks_of_cubic_b_splines(void)
{
    masks_of(PAL_SUBDIVISION_MACCRACKEN_JOY);
}

static void averaging_gives_the_same_masks_on_lattices(void)
{
    masks_of(PAL_SUBDIVISION_AVERAGING);
}

/* ---- complexes of all sorts, with tags ---- */

enum { N_SORT = 8 };

static pal_cells sort(int which)
{
    bool hollow[27], rest[27];
    for (int i = 0; i < 27; i++) hollow[i] = i != 13, rest[i] = i % 7 != 3;
    pal_cells c = which == 0   ? solid_block(2, 3, 4)
                  : which == 1 ? solid_torus(12, 1)
                  : which == 2 ? solid_tube(8, 2, 3)
                  : which == 3 ? solid_pyramids()
                  : which == 4 ? solid_prism(3)
                  : which == 5 ? solid_prism(7)
                  : which == 6 ? solid_keep(solid_block(3, 3, 3), hollow)
                               : solid_keep(solid_block(3, 3, 3), rest);
    solid_jitter(&c, 0.07, 10 + (uint64_t)which);
    return c;
}

/* some of everything, more or less; inner edges and vertices are left out, whose neighbours may fold over */
static void sharpen(pal_cells *c, uint64_t seed)
{
    static const float sharp[5] = {0.3f, 1, 1.6f, 3, PAL_SHARPNESS_MAX};
    for (int32_t v = 0; v < c->n_vertex; v++)
        if (c->vertex_boundary[v] && pal_random_bits(seed, (uint64_t)v) % 7 == 0) c->vertex_sharpness[v] = sharp[v % 5];
    for (int32_t e = 0; e < c->n_edge; e++)
        if (c->edge[e].boundary && pal_random_bits(seed + 1, (uint64_t)e) % 3 == 0) c->edge[e].sharp = sharp[e % 5];
    for (int32_t f = 0; f < c->n_face; f++)
        if (pal_random_bits(seed + 2, (uint64_t)f) % 5 == 0) c->face[f].sharp = sharp[f % 5];
}

static double worst_row(const pal_interpolation *r)
{
    double worst = 0;
    for (int32_t i = 0; i < r->n_row; i++) {
        double sum = 0;
        for (int32_t k = r->start[i]; k < r->start[i + 1]; k++) {
            sum += r->weight[k];
            if (r->point[k] < 0 || r->point[k] >= r->n_point) return 1e9;
            if (k > r->start[i] && r->point[k] <= r->point[k - 1]) return 1e9;
        }
        worst = fmax(worst, fabs(sum - 1));
    }
    return worst;
}

static void rows_sum_to_one_whatever_is_subdivided(void)
{
    for (int which = 0; which < N_SORT; which++)
        for (int rule = 0; rule < 2; rule++)
            for (int tags = 0; tags < 2; tags++) {
                pal_cells c = sort(which);
                if (tags) sharpen(&c, 3);
                pal_subdivision s = of(&c, 2, (pal_subdivision_rule)rule);
                REQUIRE(s.n_level == 2);
                CHECK_INT(s.rows.n_point, c.n_vertex);
                CHECK_INT(s.rows.n_row, s.cells.n_vertex);
                CHECK_LE(worst_row(&s.rows), 1e-12);
                pal_diagnostic diag = {"no note"};
                if (pal_cells_check(&s.cells, NULL, &diag)) CHECK_FAIL("%s", diag.text);
                pal_subdivision_free(&s);
                pal_cells_free(&c);
            }
}

static void positions_are_the_rows_of_the_control_points_and_follow_affine_maps(void)
{
    static const double map[9] = {1.3, 0.4, -0.2, 0.1, 0.9, 0.5, -0.3, 0.2, 1.1}, shift[3] = {20, -3, 7};
    for (int which = 0; which < N_SORT; which++) {
        pal_cells c = sort(which);
        sharpen(&c, 5);
        pal_subdivision s = of(&c, 2, which & 1 ? PAL_SUBDIVISION_AVERAGING : PAL_SUBDIVISION_MACCRACKEN_JOY);
        double *d = malloc((size_t)s.cells.n_vertex * 3 * sizeof *d), worst = 0;
        REQUIRE(d && s.n_level == 2);
        pal_interpolation_apply(&s.rows, c.x, d);
        CHECK(memcmp(d, s.cells.x, (size_t)s.cells.n_vertex * 3 * sizeof *d) == 0);
        for (int32_t v = 0; v < c.n_vertex; v++) {
            double y[3], *x = c.x + 3 * v;
            for (int a = 0; a < 3; a++)
                y[a] = map[3 * a] * x[0] + map[3 * a + 1] * x[1] + map[3 * a + 2] * x[2] + shift[a];
            memcpy(x, y, sizeof y);
        }
        pal_interpolation_apply(&s.rows, c.x, d);
        for (int32_t i = 0; i < s.cells.n_vertex; i++)
            for (int a = 0; a < 3; a++) {
                const double *x = s.cells.x + 3 * i;
                double want = map[3 * a] * x[0] + map[3 * a + 1] * x[1] + map[3 * a + 2] * x[2] + shift[a];
                worst = fmax(worst, fabs(want - d[3 * i + a]));
            }
        CHECK_LE(worst, 1e-12);
        free(d);
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

/* ---- the boundary ---- */

/* Catmull, Clark 1978 on the boundary faces of c, looked up by brute force: the point of new vertex i, which is of a
 * vertex, an edge or a face of the boundary */
static void catmull_clark(const pal_cells *c, const int32_t *old, int n_old, double out[3])
{
    double face[3] = {0}, mid[3] = {0}, one[3];
    int n_face = 0, n_mid = 0;
    for (int32_t f = 0; f < c->n_face; f++) {
        int32_t first, n = pal_cells_face_loop(c, f, &first);
        int have = 0;
        if (!pal_cells_face_boundary(c, f)) continue;
        for (int32_t k = 0; k < n; k++)
            for (int m = 0; m < n_old; m++) have += c->edge_use[first + k].vertex == old[m];
        if (have < n_old) continue;
        pal_cells_face_centre(c, NULL, f, one);
        n_face++;
        for (int a = 0; a < 3; a++) face[a] += one[a];
        /* each edge at the vertex is met in two faces */
        for (int32_t k = 0; k < n && n_old == 1; k++) {
            int32_t p = c->edge_use[first + k].vertex, q = c->edge_use[first + (k + 1) % n].vertex;
            if (p != old[0] && q != old[0]) continue;
            n_mid++;
            for (int a = 0; a < 3; a++) mid[a] += (c->x[3 * p + a] + c->x[3 * q + a]) / 2;
        }
    }
    for (int a = 0; a < 3; a++) {
        double p = c->x[3 * old[0] + a];
        if (n_old == 1)
            out[a] = (face[a] / n_face + 2 * mid[a] / n_mid + (n_face - 3) * p) / n_face;
        else if (n_old == 2)
            out[a] = (p + c->x[3 * old[1] + a] + face[a]) / 4;
        else
            out[a] = face[a];
    }
}

static void the_boundary_is_a_catmull_clark_surface_level_after_level(void)
{
    for (int which = 0; which < N_SORT - 1; which++) {
        pal_cells c = sort(which);
        for (int level = 0; level < 2; level++) {
            pal_subdivision now = of(&c, level, PAL_SUBDIVISION_MACCRACKEN_JOY);
            pal_subdivision then = of(&c, level + 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
            REQUIRE(then.n_level == level + 1);
            double worst = 0, inner = 0;
            int step = level ? 3 : 1, n = 0;
            for (int32_t i = 0; i < then.cells.n_vertex; i += step) {
                int32_t old[PAL_CELL_LOOP_MAX];
                bool boundary;
                double want[3];
                int n_old = origin_of(&now.cells, i, old, &boundary);
                CHECK(boundary == then.cells.vertex_boundary[i]);
                if (!boundary) continue;
                catmull_clark(&now.cells, old, n_old, want);
                for (int a = 0; a < 3; a++) worst = fmax(worst, fabs(want[a] - then.cells.x[3 * i + a]));
                for (int32_t k = then.rows.start[i]; k < then.rows.start[i + 1]; k++)
                    if (!c.vertex_boundary[then.rows.point[k]]) inner = fmax(inner, fabs(then.rows.weight[k]));
                n++;
            }
            CHECK(n > 10);
            CHECK_LE(worst, 1e-12);
            CHECK_NEAR(inner, 0, 0);
            pal_subdivision_free(&now);
            pal_subdivision_free(&then);
        }
        pal_cells_free(&c);
    }
}

/* the corner of a cube under Catmull-Clark: vertex (F + 2 M + 0 P)/3 of valence 3, by hand */
static void a_lone_cube_becomes_round_by_numbers_found_by_hand(void)
{
    pal_cells c = solid_block(1, 1, 1);
    pal_subdivision s = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
    REQUIRE(s.n_level == 1);
    /* faces' mean at 1/6 along each axis, midpoints' mean at 1/3: (1/6 + 2/3)/3 = 5/18; edges at (1/2 + 1/2 + 1/2)/4 */
    for (int a = 0; a < 3; a++) CHECK_NEAR(fabs(s.cells.x[a]), 5.0 / 18, 1e-15);
    double *mid = s.cells.x + 3 * (ptrdiff_t)c.n_vertex;
    CHECK_NEAR(fabs(mid[0]) + fabs(mid[1]) + fabs(mid[2]), 2 * 0.375, 1e-15);
    CHECK_NEAR(weight_of(&s.rows, s.cells.n_vertex - 1, 3), 0.125, 1e-15);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

/* ---- topology ---- */

static void holes_handles_and_cavities_stay(void)
{
    static const int32_t genus[N_SORT] = {0, 1, 1, 0, 0, 0, 0, -1}, cavity[N_SORT] = {0, 0, 0, 0, 0, 0, 1, -1};
    for (int which = 0; which < N_SORT; which++) {
        pal_cells c = sort(which);
        pal_cells_topology before = {0}, after = {0};
        CHECK(pal_cells_find_topology(&c, &before) == PAL_ERR_OK);
        if (genus[which] >= 0) CHECK_INT(before.genus, genus[which]);
        if (cavity[which] >= 0) CHECK_INT(before.n_cavity, cavity[which]);
        pal_subdivision s = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY);
        REQUIRE(s.n_level == 2);
        CHECK(pal_cells_find_topology(&s.cells, &after) == PAL_ERR_OK);
        CHECK_INT(after.genus, before.genus);
        CHECK_INT(after.n_cavity, before.n_cavity);
        CHECK_INT(after.n_piece, before.n_piece);
        CHECK_INT(after.euler, before.euler);
        CHECK_INT(s.cells.n_pinched_vertex > 0, c.n_pinched_vertex > 0);
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
    /* a plate of 5 x 3 cells without two of them: a double ring */
    bool keep[15];
    for (int i = 0; i < 15; i++) keep[i] = i != 6 && i != 8;
    pal_cells_topology t = {0};
    pal_cells c = solid_keep(solid_block(5, 3, 1), keep);
    pal_subdivision s = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY);
    CHECK(pal_cells_find_topology(&s.cells, &t) == PAL_ERR_OK);
    CHECK_INT(t.genus, 2);
    CHECK_INT(s.cells.n_cell, 13 * 64);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

/* cells, vertices and faces of a level follow from the level before; k faces at a vertex make 2 k quads */
static void a_level_has_the_cells_that_it_should(void)
{
    for (int which = 0; which < N_SORT; which++) {
        pal_cells c = sort(which);
        pal_subdivision s = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
        REQUIRE(s.n_level == 1);
        CHECK_INT(s.cells.n_vertex, c.n_vertex + c.n_edge + c.n_face + c.n_cell);
        CHECK_INT(s.cells.n_cell, c.cell_vertex.start[c.n_cell]);
        CHECK_INT(s.cells.n_face_use, 2 * c.n_edge_use);
        CHECK_INT(s.cells.n_edge_use, 8 * c.n_edge_use);
        for (int32_t i = 0; i < c.cell_vertex.start[c.n_cell]; i++) {
            int32_t use = c.corner_use[i], n = 0;
            do n++, use = pal_cells_next_around(&c, use);
            while (use != c.corner_use[i]);
            CHECK_INT(s.cells.cell_use[i + 1] - s.cells.cell_use[i], 2 * n);
            CHECK_INT(s.cells.cell_vertex.item[s.cells.cell_vertex.start[i]], c.cell_vertex.item[i]);
            CHECK_INT(c.cell_vertex.start[s.cell_origin[i]] <= i && i < c.cell_vertex.start[s.cell_origin[i] + 1], 1);
        }
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

static void every_cell_and_face_knows_where_it_came_from(void)
{
    pal_cells c = solid_block(2, 3, 2);
    for (int32_t e = 0; e < c.n_edge; e++) c.edge[e].sharp = c.edge[e].boundary ? PAL_SHARPNESS_MAX : 0;
    pal_subdivision s = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY);
    int n_cell[12] = {0}, n_face[64] = {0}, inside = 0;
    REQUIRE(s.n_level == 2 && c.n_cell == 12 && c.n_face <= 64);
    for (int32_t i = 0; i < s.cells.n_cell; i++) n_cell[s.cell_origin[i]]++;
    for (int32_t f = 0; f < s.cells.n_face; f++) {
        int32_t from = s.face_origin[f];
        if (from < 0) {
            inside++;
            CHECK(!pal_cells_face_boundary(&s.cells, f));
            continue;
        }
        n_face[from]++;
        CHECK(pal_cells_face_boundary(&s.cells, f) == pal_cells_face_boundary(&c, from));
        if (!pal_cells_face_boundary(&c, from)) continue;
        /* where the grid of the boundary is sharp, a part of a face lies in it */
        double part[3], whole[3], centre[3], off[3];
        pal_cells_face_area(&c, NULL, from, whole);
        pal_cells_face_centre(&c, NULL, from, centre);
        pal_cells_face_centre(&s.cells, NULL, f, part);
        for (int a = 0; a < 3; a++) off[a] = part[a] - centre[a];
        CHECK_NEAR(off[0] * whole[0] + off[1] * whole[1] + off[2] * whole[2], 0, 1e-12);
        CHECK_LE(fmax(fabs(off[0]), fmax(fabs(off[1]), fabs(off[2]))), 0.5);
    }
    for (int i = 0; i < 12; i++) CHECK_INT(n_cell[i], 64);
    for (int32_t f = 0; f < c.n_face; f++) CHECK_INT(n_face[f], 16);
    CHECK_INT(inside, s.cells.n_face - 16 * c.n_face);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

static void no_level_gives_the_control_cells(void)
{
    pal_cells c = sort(3);
    pal_subdivision s = of(&c, 0, PAL_SUBDIVISION_MACCRACKEN_JOY);
    CHECK(pal_cells_equal(&s.cells, &c));
    CHECK_INT(s.rows.start[s.rows.n_row], c.n_vertex);
    CHECK_INT(s.face_origin[c.n_face - 1], c.n_face - 1);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

static void twice_the_same_is_the_same_to_the_bit(void)
{
    pal_cells c = sort(1);
    sharpen(&c, 9);
    pal_subdivision s = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY), t = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY);
    REQUIRE(s.n_level == 2 && t.n_level == 2);
    int32_t n = s.rows.start[s.rows.n_row];
    CHECK(pal_cells_equal(&s.cells, &t.cells));
    REQUIRE(n == t.rows.start[t.rows.n_row]);
    CHECK(memcmp(s.rows.weight, t.rows.weight, (size_t)n * sizeof *s.rows.weight) == 0);
    CHECK(memcmp(s.rows.point, t.rows.point, (size_t)n * sizeof *s.rows.point) == 0);
    pal_subdivision_free(&s);
    pal_subdivision_free(&t);
    pal_cells_free(&c);
}

/* ---- sharp features ---- */

static void a_cube_with_sharp_edges_stays_a_cube(void)
{
    for (int rule = 0; rule < 2; rule++) {
        pal_cells c = solid_block(2, 2, 2);
        for (int32_t e = 0; e < c.n_edge; e++) {
            const double *p = c.x + 3 * c.edge[e].vertex[0], *q = c.x + 3 * c.edge[e].vertex[1];
            int on = 0;
            for (int a = 0; a < 3; a++) on += fabs(p[a]) == 1 && p[a] == q[a];
            c.edge[e].sharp = on == 2 ? PAL_SHARPNESS_MAX : 0;
        }
        pal_subdivision s = of(&c, 3, (pal_subdivision_rule)rule);
        REQUIRE(s.n_level == 3);
        CHECK_NEAR(pal_cells_volume(&s.cells, NULL), 8, 1e-12);
        double out = 0;
        for (int32_t v = 0; v < s.cells.n_vertex; v++) {
            const double *x = s.cells.x + 3 * v;
            double far = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
            if (s.cells.vertex_boundary[v]) out = fmax(out, fabs(far - 1));
        }
        CHECK_LE(out, 1e-12);
        pal_subdivision_free(&s);
        /* and without them it does not */
        for (int32_t e = 0; e < c.n_edge; e++) c.edge[e].sharp = 0;
        s = of(&c, 3, (pal_subdivision_rule)rule);
        CHECK_LE(pal_cells_volume(&s.cells, NULL), 7);
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

/* a sharp row of edges along the block's upper front edge, wherever the other vertices are, is refined as a cubic
 * B-spline curve of its own vertices */
static void a_crease_is_a_curve_of_its_own_and_straight_when_it_was(void)
{
    enum { N = 6 };
    for (int bent = 0; bent < 2; bent++) {
        pal_cells c = solid_block(N, 2, 2);
        const int32_t first = (N + 1) * 3 * 2; /* y low, z high */
        double line[3 * (N + 1)];
        memcpy(line, c.x + 3 * (ptrdiff_t)first, sizeof line);
        solid_jitter(&c, 0.1, 21);
        if (!bent) memcpy(c.x + 3 * (ptrdiff_t)first, line, sizeof line);
        for (int k = 0; k < N; k++) {
            int32_t e = solid_edge(&c, first + k, first + k + 1);
            REQUIRE(e >= 0);
            c.edge[e].sharp = PAL_SHARPNESS_MAX;
        }
        c.vertex_sharpness[first] = c.vertex_sharpness[first + N] = PAL_SHARPNESS_MAX;
        pal_subdivision s = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY), t = of(&c, 3, PAL_SUBDIVISION_AVERAGING);
        REQUIRE(s.n_level == 1 && t.n_level == 3);
        for (int k = 0; k <= N; k++)
            for (int a = 0; a < 3; a++) {
                const double *p = c.x + 3 * (first + k) + a;
                double want = k == 0 || k == N ? p[0] : (p[-3] + 6 * p[0] + p[3]) / 8;
                CHECK_NEAR(s.cells.x[3 * (first + k) + a], want, 1e-14);
                if (k == N) continue;
                int32_t e = solid_edge(&c, first + k, first + k + 1);
                CHECK_NEAR(s.cells.x[3 * (c.n_vertex + e) + a], (p[0] + p[3]) / 2, 1e-14);
            }
        int n_edge = 0;
        for (int32_t e = 0; e < t.cells.n_edge; e++) {
            if (t.cells.edge[e].sharp < PAL_SHARPNESS_MAX) continue;
            n_edge++;
            const double *x = t.cells.x + 3 * t.cells.edge[e].vertex[0];
            if (!bent) CHECK_LE(fabs(x[1] + 1) + fabs(x[2] - 1), 1e-13);
        }
        CHECK_INT(n_edge, 8 * N);
        pal_subdivision_free(&s);
        pal_subdivision_free(&t);
        pal_cells_free(&c);
    }
}

/* sharpness 0.3 lies at 0.3 between smooth and sharp; s is worth that many levels */
static void semi_sharp_blends_and_fades(void)
{
    pal_cells c = solid_block(3, 3, 3);
    solid_jitter(&c, 0.1, 31);
    /* an inner edge, an edge and a vertex of the boundary, an inner face */
    int32_t inner = solid_edge(&c, 21, 22), rim = solid_edge(&c, 1, 2), face = -1, vertex = 5;
    for (int32_t f = 0; f < c.n_face; f++)
        if (!pal_cells_face_boundary(&c, f)) face = f;
    REQUIRE(inner >= 0 && rim >= 0 && face >= 0 && !c.edge[inner].boundary && c.edge[rim].boundary);
    const float sharp[5] = {0, 1, 0.3f, 1.5f, PAL_SHARPNESS_MAX};
    pal_subdivision s[5];
    for (int k = 0; k < 5; k++) {
        c.edge[inner].sharp = c.edge[rim].sharp = c.face[face].sharp = c.vertex_sharpness[vertex] = sharp[k];
        s[k] = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
        REQUIRE(s[k].n_level == 1);
        CHECK_LE(worst_row(&s[k].rows), 1e-14);
    }
    const int32_t at[4] = {vertex, c.n_vertex + inner, c.n_vertex + rim, c.n_vertex + c.n_edge + face};
    for (int m = 0; m < 4; m++) {
        double apart = 0;
        for (int a = 0; a < 3; a++) {
            int32_t i = 3 * at[m] + a;
            double smooth = s[0].cells.x[i], full = s[1].cells.x[i], t = sharp[2];
            CHECK_NEAR(s[2].cells.x[i], t * full + (1 - t) * smooth, 1e-14);
            CHECK_NEAR(s[3].cells.x[i], full, 1e-15);
            CHECK_NEAR(s[4].cells.x[i], full, 1e-15);
            apart += fabs(full - smooth);
        }
        CHECK(apart > 1e-3);
    }
    for (int a = 0; a < 3; a++) CHECK_NEAR(s[1].cells.x[3 * vertex + a], c.x[3 * vertex + a], 0);
    /* one level less of each */
    const float left[5] = {0, 0, 0, 0.5f, PAL_SHARPNESS_MAX};
    for (int k = 0; k < 5; k++) {
        const pal_cells *t = &s[k].cells;
        int32_t half = solid_edge(t, c.edge[rim].vertex[0], c.n_vertex + rim);
        REQUIRE(half >= 0);
        CHECK_NEAR(t->edge[half].sharp, left[k], 0);
        CHECK_NEAR(t->vertex_sharpness[vertex], left[k], 0);
        int n = 0;
        for (int32_t f = 0; f < t->n_face; f++) {
            CHECK_NEAR(t->face[f].sharp, s[k].face_origin[f] == face ? left[k] : 0, 0);
            n += s[k].face_origin[f] == face;
        }
        CHECK_INT(n, 4);
        pal_subdivision_free(&s[k]);
    }
    pal_cells_free(&c);
}

/* where a third edge begins to be sharpened, the vertex begins to move: no jump */
static void a_third_sharp_edge_turns_a_crease_into_a_corner_without_a_jump(void)
{
    pal_cells c = solid_block(2, 2, 2);
    solid_jitter(&c, 0.1, 41);
    const int32_t v = 4; /* middle of the lowest face, its neighbours 1, 3, 5, 7 */
    int32_t a = solid_edge(&c, v, 1), b = solid_edge(&c, v, 7), third = solid_edge(&c, v, 3);
    REQUIRE(a >= 0 && b >= 0 && third >= 0);
    const float sharp[4] = {0, 1e-6f, 0.5f, 1};
    double x[4];
    c.edge[a].sharp = c.edge[b].sharp = 2;
    for (int k = 0; k < 4; k++) {
        c.edge[third].sharp = sharp[k];
        pal_subdivision s = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
        REQUIRE(s.n_level == 1);
        x[k] = s.cells.x[3 * v + 2];
        pal_subdivision_free(&s);
    }
    double crease = (c.x[3 * 1 + 2] + 6 * c.x[3 * v + 2] + c.x[3 * 7 + 2]) / 8, corner = c.x[3 * v + 2];
    CHECK_NEAR(x[0], crease, 1e-15);
    CHECK_NEAR(x[1], crease, 1e-6);
    CHECK_NEAR(x[2], (crease + corner) / 2, 1e-15);
    CHECK_NEAR(x[3], corner, 1e-15);
    /* an inner edge does not bend the boundary's crease */
    int32_t inner = solid_edge(&c, v, 13);
    REQUIRE(inner >= 0 && !c.edge[inner].boundary);
    c.edge[third].sharp = 0, c.edge[inner].sharp = 2;
    pal_subdivision s = of(&c, 1, PAL_SUBDIVISION_MACCRACKEN_JOY);
    CHECK_NEAR(s.cells.x[3 * v + 2], crease, 1e-15);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

static void cells_that_touch_in_an_edge_or_a_vertex_only_are_corners_there(void)
{
    const bool diagonal[4] = {true, false, false, true};
    const bool opposite[8] = {true, false, false, false, false, false, false, true};
    for (int edge = 0; edge < 2; edge++) {
        pal_cells c = edge ? solid_keep(solid_block(2, 2, 1), diagonal) : solid_keep(solid_block(2, 2, 2), opposite);
        CHECK_INT(c.n_pinched_edge, edge);
        CHECK_INT(c.n_pinched_vertex, edge ? 2 : 1);
        pal_subdivision s = of(&c, 2, PAL_SUBDIVISION_MACCRACKEN_JOY);
        REQUIRE(s.n_level == 2);
        CHECK_INT(s.cells.n_pinched_edge, edge ? 4 : 0);
        CHECK_INT(s.cells.n_pinched_vertex, edge ? 5 : 1);
        for (int32_t v = 0; v < s.cells.n_vertex; v++) {
            const double *x = s.cells.x + 3 * v;
            if (s.cells.vertex_pinched[v]) CHECK_LE(fabs(x[0]) + fabs(x[1]), 1e-15);
        }
        for (int32_t v = 0; v < c.n_vertex; v++) {
            double moved = 0;
            for (int a = 0; a < 3; a++) moved += fabs(s.cells.x[3 * v + a] - c.x[3 * v + a]);
            CHECK(c.vertex_pinched[v] ? moved == 0 : moved > 0.1);
        }
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

/* ---- refusals ---- */

static void budgets_and_folds_are_refused_by_name(void)
{
    pal_cells c = solid_block(4, 4, 4);
    pal_subdivision s = {0};
    pal_diagnostic diag = {""};
    pal_subdivision_options o = {.n_level = PAL_SUBDIVISION_MAX + 1};
    CHECK_INT(pal_subdivision_make(&c, &o, &s, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "subdivision: 9 levels asked for, 0 to 8 are made");
    o.n_level = -1;
    CHECK_INT(pal_subdivision_make(&c, &o, &s, &diag), PAL_ERR_REFUSED);
    o.n_level = PAL_SUBDIVISION_MAX;
    CHECK_INT(pal_subdivision_make(&c, &o, &s, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "subdivision: level ") == diag.text && strstr(diag.text, "the budget is 512 MiB"));
    for (size_t kib = 4; kib <= 4096; kib *= 4) {
        o = (pal_subdivision_options){.n_level = 2, .budget_byte = kib << 10};
        pal_err err = pal_subdivision_make(&c, &o, &s, &diag);
        CHECK(err == PAL_ERR_BUDGET && strstr(diag.text, "MiB"));
        CHECK(!s.rows.start && !s.cells.x);
    }
    o.budget_byte = (size_t)32 << 20;
    CHECK_INT(pal_subdivision_make(&c, &o, &s, &diag), PAL_ERR_OK);
    CHECK_LE((double)s.n_byte, (double)o.budget_byte);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
    /* a deep notch: the mean of the cell's vertices lies outside */
    static const double x[48] = {0, 0, 0, 9, 0, 0, 9, 9, 0, 8, 9, 0, 8, 1, 0, 1, 1, 0, 1, 9, 0, 0, 9, 0,
                                 0, 0, 1, 9, 0, 1, 9, 9, 1, 8, 9, 1, 8, 1, 1, 1, 1, 1, 1, 9, 1, 0, 9, 1};
    static const int32_t cell[] = {7,  6,  5,  4, 3, 2,  1,  0,  -1, 8, 9,  10, 11, 12, 13, 14, 15, -1, 0, 1,
                                   9,  8,  -1, 1, 2, 10, 9,  -1, 2,  3, 11, 10, -1, 3,  4,  12, 11, -1, 4, 5,
                                   13, 12, -1, 5, 6, 14, 13, -1, 6,  7, 15, 14, -1, 7,  0,  8,  15, -2};
    const int32_t *list[1] = {cell};
    c = solid_of(16, x, 1, list);
    o = (pal_subdivision_options){.n_level = 1};
    diag.text[0] = 0;
    CHECK_INT(pal_subdivision_make(&c, &o, &s, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "subdivision: level 1: ") == diag.text && strstr(diag.text, "volume"));
    CHECK(!s.rows.start && !s.cells.x);
    pal_cells_free(&c);
}

int main(void)
{
    RUN(lattices_are_refined_by_the_masks_of_cubic_b_splines);
    RUN(averaging_gives_the_same_masks_on_lattices);
    RUN(rows_sum_to_one_whatever_is_subdivided);
    RUN(positions_are_the_rows_of_the_control_points_and_follow_affine_maps);
    RUN(the_boundary_is_a_catmull_clark_surface_level_after_level);
    RUN(a_lone_cube_becomes_round_by_numbers_found_by_hand);
    RUN(holes_handles_and_cavities_stay);
    RUN(a_level_has_the_cells_that_it_should);
    RUN(every_cell_and_face_knows_where_it_came_from);
    RUN(no_level_gives_the_control_cells);
    RUN(twice_the_same_is_the_same_to_the_bit);
    RUN(a_cube_with_sharp_edges_stays_a_cube);
    RUN(a_crease_is_a_curve_of_its_own_and_straight_when_it_was);
    RUN(semi_sharp_blends_and_fades);
    RUN(a_third_sharp_edge_turns_a_crease_into_a_corner_without_a_jump);
    RUN(cells_that_touch_in_an_edge_or_a_vertex_only_are_corners_there);
    RUN(budgets_and_folds_are_refused_by_name);
    return check_report();
}
