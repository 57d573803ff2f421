/* Choice of elements: counts of the paper's blocks, the 64 labels on lattices and on shuffled ones, volumes, virtual
 * nodes. */
#include "server/mesh/cells/cell_elements.h"
#include "server/mesh/cells/maccracken_joy.h"
#include "tests/check.h"
#include "tests/fixtures/solids.h"

/* elements of a complex that must have some */
static pal_cell_elements of(const pal_cells *c)
{
    pal_cell_elements e = {0};
    pal_diagnostic diag = {"no note"};
    if (pal_cell_elements_make(c, &e, &diag)) CHECK_FAIL("%s", diag.text);
    return e;
}

/* a solid and what it becomes, control cells freed */
static pal_subdivision refined(pal_cells c, int n_level)
{
    pal_subdivision s = {0};
    pal_diagnostic diag = {"no note"};
    const pal_subdivision_options o = {.n_level = n_level};
    if (pal_subdivision_make(&c, &o, &s, &diag)) CHECK_FAIL("%s", diag.text);
    pal_cells_free(&c);
    return s;
}

/* Table 1, with erratum A14 */
static void blocks_have_the_counts_of_table_1(void)
{
    pal_subdivision s = refined(solid_block(3, 3, 3), 2);
    pal_cell_elements e = of(&s.cells);
    CHECK_INT(pal_cell_elements_count(&e), 1728);
    CHECK_INT(e.n[PAL_CELL_CUBIC], 1000);
    CHECK_INT(e.n[PAL_CELL_HEX], 728);
    CHECK_INT(e.n[PAL_CELL_PYRAMID], 0);
    CHECK_NEAR(pal_cell_elements_percent(&e, PAL_CELL_CUBIC), 58, 0.5);
    CHECK_NEAR(pal_cell_elements_percent(&e, PAL_CELL_HEX), 42, 0.5);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
    s = refined(solid_block(4, 4, 4), 1);
    e = of(&s.cells);
    CHECK_INT(pal_cell_elements_count(&e), 512);
    CHECK_INT(e.n[PAL_CELL_CUBIC], 216);
    CHECK_INT(e.n[PAL_CELL_HEX], 296);
    CHECK_NEAR(pal_cell_elements_percent(&e, PAL_CELL_CUBIC), 42, 0.5);
    CHECK_NEAR(pal_cell_elements_percent(&e, PAL_CELL_HEX), 58, 0.5);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
}

/* the same complex with vertices renumbered, cells in another order, their loops too, and begun at other corners */
static pal_cells shuffled(pal_cells from, uint64_t seed)
{
    pal_cells out = {0};
    pal_cell_loops l = {0}, t = {0};
    pal_diagnostic diag = {"no note"};
    uint64_t draw = 0;
    if (pal_cells_loops(&from, NULL, &l, NULL) || pal_cells_loops(&from, NULL, &t, NULL)) CHECK_FAIL("%s", "no loops");
    int32_t *order = malloc((size_t)(l.n_vertex + l.n_cell) * sizeof *order), *cell = order + l.n_vertex;
    if (!order) abort();
    for (int32_t v = 0; v < l.n_vertex; v++) {
        int32_t k = (int32_t)(pal_random_bits(seed, draw++) % (uint64_t)(v + 1));
        order[v] = order[k], order[k] = v;
    }
    for (int32_t c = 0; c < l.n_cell; c++) {
        int32_t k = (int32_t)(pal_random_bits(seed, draw++) % (uint64_t)(c + 1));
        cell[c] = cell[k], cell[k] = c;
    }
    for (int32_t v = 0; v < l.n_vertex; v++) memcpy(t.x + 3 * order[v], l.x + 3 * v, 3 * sizeof *l.x);
    /* all cells have six loops of four corners */
    for (int32_t c = 0, n = 0; c < l.n_cell; c++) {
        int first = (int)(pal_random_bits(seed, draw++) % 6);
        for (int f = 0; f < 6; f++) {
            const int32_t *loop = l.corner + 24 * cell[c] + 4 * ((5 * f + first) % 6);
            int begin = (int)(pal_random_bits(seed, draw++) % 4);
            for (int k = 0; k < 4; k++) t.corner[n++] = order[loop[(k + begin) % 4]];
        }
    }
    if (pal_cells_make(&t, &out, &diag)) CHECK_FAIL("%s", diag.text);
    free(order);
    pal_cell_loops_free(&l);
    pal_cell_loops_free(&t);
    pal_cells_free(&from);
    return out;
}

static double det3(const double a[3], const double b[3], const double c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* steps from a node along u, v, w as the nodes at the ends say */
static void axes_of(const double *x, int32_t at, const int32_t to[3], double axis[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) axis[i][a] = x[3 * to[i] + a] - x[3 * at + a];
}

/* On bricks of 2 x 3 x 5 every cubic element's nodes are a lattice in order: right-handed, of whole bricks. */
static void the_64_labels_are_the_lattice_in_order(void)
{
    for (int mixed = 0; mixed < 4; mixed++) {
        pal_cells c = solid_bricks(5, 4, 5, 2, 3, 5);
        if (mixed) c = shuffled(c, (uint64_t)mixed);
        pal_cell_elements e = of(&c);
        CHECK_INT(e.n[PAL_CELL_CUBIC], 3 * 2 * 3);
        for (int32_t i = 0; i < e.n[PAL_CELL_CUBIC]; i++) {
            const int32_t *node = e.node[PAL_CELL_CUBIC] + 64 * i, ends[3] = {node[16], node[4], node[1]};
            double axis[3][3], worst = 0, centre[3];
            axes_of(c.x, node[0], ends, axis);
            CHECK_NEAR(det3(axis[0], axis[1], axis[2]), 30, 1e-12);
            for (int k = 0; k < 3; k++)
                CHECK_NEAR(fabs(axis[k][0]) / 2 + fabs(axis[k][1]) / 3 + fabs(axis[k][2]) / 5, 1, 1e-12);
            for (int m = 0; m < 64; m++)
                for (int a = 0; a < 3; a++) {
                    double want =
                        c.x[3 * node[0] + a] + m / 16 * axis[0][a] + m / 4 % 4 * axis[1][a] + m % 4 * axis[2][a];
                    worst = fmax(worst, fabs(c.x[3 * node[m] + a] - want));
                }
            CHECK_LE(worst, 1e-12);
            /* the own cell is the middle one */
            pal_cells_cell_centre(&c, NULL, e.cell[PAL_CELL_CUBIC][i], centre);
            for (int a = 0; a < 3; a++)
                CHECK_NEAR(centre[a], (c.x[3 * node[21] + a] + c.x[3 * node[42] + a]) / 2, 1e-12);
        }
        pal_cell_elements_free(&e);
        pal_cells_free(&c);
    }
}

/* corners that two cells have in common */
static int shared(const pal_cells *c, int32_t a, int32_t b)
{
    int n = 0;
    for (int32_t i = c->cell_vertex.start[a]; i < c->cell_vertex.start[a + 1]; i++)
        for (int32_t k = c->cell_vertex.start[b]; k < c->cell_vertex.start[b + 1]; k++)
            n += c->cell_vertex.item[i] == c->cell_vertex.item[k];
    return n;
}

/* most corners that any cell with vertex v shares with a cell */
static int nearness(const pal_cells *c, int32_t v, int32_t cell)
{
    int max = 0;
    for (int32_t k = c->vertex_cell.start[v]; k < c->vertex_cell.start[v + 1]; k++) {
        int n = shared(c, c->vertex_cell.item[k], cell);
        if (n > max) max = n;
    }
    return max;
}

/* Fig. 6: 8 own, 24 across faces, 24 across edges, 8 across corners; 28 and 44 are across the edge 25-41, 60 across 41
 */
static void nodes_lie_across_faces_edges_and_corners_as_figure_6_says(void)
{
    pal_cells c = shuffled(solid_block(3, 3, 3), 7);
    pal_cell_elements e = of(&c);
    REQUIRE(e.n[PAL_CELL_CUBIC] == 1);
    const int32_t *node = e.node[PAL_CELL_CUBIC], own = e.cell[PAL_CELL_CUBIC][0];
    int count[9] = {0};
    for (int m = 0; m < 64; m++) count[nearness(&c, node[m], own)]++;
    CHECK_INT(count[8], 8);
    CHECK_INT(count[4], 24);
    CHECK_INT(count[2], 24);
    CHECK_INT(count[1], 8);
    CHECK_INT(nearness(&c, node[28], own), 2);
    CHECK_INT(nearness(&c, node[44], own), 2);
    CHECK_INT(nearness(&c, node[60], own), 1);
    CHECK(solid_edge(&c, node[25], node[41]) >= 0 && solid_edge(&c, node[28], node[44]) >= 0);
    /* the cell with 25, 41, 28, 44 exists, and so does the one with 41 and 60 */
    int with_edge = 0, with_corner = 0;
    for (int32_t i = 0; i < c.n_cell; i++) {
        int edge = 0, corner = 0;
        for (int32_t k = c.cell_vertex.start[i]; k < c.cell_vertex.start[i + 1]; k++) {
            int32_t v = c.cell_vertex.item[k];
            edge += v == node[25] || v == node[41] || v == node[28] || v == node[44];
            corner += v == node[41] || v == node[60];
        }
        with_edge += edge == 4, with_corner += corner == 2;
    }
    CHECK_INT(with_edge, 1);
    CHECK_INT(with_corner, 1);
    pal_cell_elements_free(&e);
    pal_cells_free(&c);
}

/* ---- volumes ---- */

/* volume of the trilinear hexahedron of positions p at corner bits, 2 x 2 x 2 Gauss points; least det J there */
static double hex_volume(double p[8][3], double *min)
{
    static const double g = 0.5773502691896257;
    double sum = 0;
    for (int q = 0; q < 8; q++) {
        double at[3], j[3][3] = {{0}};
        for (int a = 0; a < 3; a++) at[a] = q >> a & 1 ? g : -g;
        for (int k = 0; k < 8; k++)
            for (int a = 0; a < 3; a++) {
                double slope = 1;
                for (int b = 0; b < 3; b++) {
                    double sign = k >> b & 1 ? 1 : -1;
                    slope *= b == a ? sign / 2 : (1 + sign * at[b]) / 2;
                }
                for (int x = 0; x < 3; x++) j[a][x] += slope * p[k][x];
            }
        double d = det3(j[0], j[1], j[2]);
        sum += d, *min = fmin(*min, d);
    }
    return sum;
}

/* volume of all elements: hexahedra, the own corners of cubic ones, pyramids as hexahedra with four corners in one */
static double volume_of(const pal_cell_elements *e, const double *x, double *min)
{
    static const int own[8] = {21, 37, 25, 41, 22, 38, 26, 42}, base[8] = {0, 1, 3, 2, 4, 4, 4, 4};
    double sum = 0, p[8][3];
    *min = 1e9;
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int32_t i = 0; i < e->n[kind]; i++) {
            const int32_t *node = e->node[kind] + pal_cell_kind_nodes((pal_cell_kind)kind) * i;
            for (int k = 0; k < 8; k++) {
                int32_t v = node[kind == PAL_CELL_CUBIC ? own[k] : kind == PAL_CELL_HEX ? k : base[k]];
                memcpy(p[k], x + 3 * v, sizeof p[k]);
            }
            sum += hex_volume(p, min);
        }
    return sum;
}

static double *places(const pal_cell_elements *e, const pal_subdivision *s, const double *p)
{
    pal_interpolation rows = {0};
    double *d = malloc((size_t)(e->n_vertex + e->n_virtual) * 3 * sizeof *d);
    if (!d || pal_cell_elements_interpolation(e, &s->rows, &rows)) abort();
    CHECK_INT(rows.n_row, e->n_vertex + e->n_virtual);
    pal_interpolation_apply(&rows, p, d);
    pal_interpolation_free(&rows);
    return d;
}

static void elements_fill_the_solid_without_a_gap(void)
{
    for (int which = 0; which < 5; which++) {
        pal_cells c = which == 0   ? solid_block(3, 2, 3)
                      : which == 1 ? solid_torus(8, 2)
                      : which == 2 ? solid_tube(5, 2, 3)
                      : which == 3 ? solid_pyramids()
                                   : solid_prism(7);
        solid_jitter(&c, 0.05, 60 + (uint64_t)which);
        pal_subdivision s = {0};
        const pal_subdivision_options o = {.n_level = which == 3 ? 2 : 1};
        REQUIRE(pal_subdivision_make(&c, &o, &s, NULL) == PAL_ERR_OK);
        pal_cell_elements e = of(&s.cells);
        double *d = places(&e, &s, c.x), min, whole = pal_cells_volume(&s.cells, NULL);
        CHECK(memcmp(d, s.cells.x, (size_t)s.cells.n_vertex * 3 * sizeof *d) == 0);
        CHECK_NEAR(volume_of(&e, d, &min), whole, 1e-12 * (1 + whole));
        CHECK(min > 0);
        CHECK((e.n[PAL_CELL_PYRAMID] > 0) == (which == 3));
        free(d);
        pal_cell_elements_free(&e);
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

/* a pyramid's apex has four faces: 8 quads round the new cell there, and as many after another level in each of them */
static void cells_that_are_no_hexahedra_become_pyramids_to_their_middle(void)
{
    pal_cells c = solid_pyramids();
    for (int level = 1; level <= 2; level++) {
        pal_subdivision s = refined(solid_pyramids(), level);
        pal_cell_elements e = of(&s.cells);
        /* level 1: a cell of 8 quads per pyramid; its two vertices of four faces, the apex and C, keep one each */
        int32_t odd = 6 << (level - 1);
        CHECK_INT(e.n_virtual, odd);
        CHECK_INT(e.n[PAL_CELL_PYRAMID], 8 * odd);
        CHECK_INT(e.n[PAL_CELL_HEX] + e.n[PAL_CELL_CUBIC], s.cells.n_cell - odd);
        double *d = places(&e, &s, c.x);
        for (int32_t i = 0; i < e.n_virtual; i++) {
            double centre[3];
            pal_cells_cell_centre(&s.cells, NULL, e.virtual_cell[i], centre);
            for (int a = 0; a < 3; a++) CHECK_NEAR(d[3 * (e.n_vertex + i) + a], centre[a], 1e-14);
        }
        for (int32_t i = 0; i < e.n[PAL_CELL_PYRAMID]; i++) {
            int32_t apex = e.node[PAL_CELL_PYRAMID][5 * i + 4] - e.n_vertex;
            REQUIRE(apex >= 0 && apex < e.n_virtual);
            CHECK_INT(e.virtual_cell[apex], e.cell[PAL_CELL_PYRAMID][i]);
        }
        free(d);
        pal_cell_elements_free(&e);
        pal_subdivision_free(&s);
    }
    pal_cells_free(&c);
}

static void rows_of_all_nodes_sum_to_one(void)
{
    pal_subdivision s = refined(solid_pyramids(), 2);
    pal_cell_elements e = of(&s.cells);
    pal_interpolation rows = {0};
    REQUIRE(pal_cell_elements_interpolation(&e, &s.rows, &rows) == PAL_ERR_OK);
    CHECK_INT(rows.n_point, 9);
    double worst = 0;
    for (int32_t i = 0; i < rows.n_row; i++) {
        double sum = 0;
        for (int32_t k = rows.start[i]; k < rows.start[i + 1]; k++) sum += rows.weight[k];
        worst = fmax(worst, fabs(sum - 1));
    }
    CHECK_LE(worst, 1e-12);
    pal_interpolation_free(&rows);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
}

/* ---- where cubic ends ---- */

/* by brute force: 26 other cells with a vertex of it, all of 8 vertices, 64 vertices in all, its own inside */
static bool looks_cubic(const pal_cells *c, int32_t cell)
{
    const int32_t *list = c->cell_vertex.item, *start = c->cell_vertex.start;
    int32_t near[64], vertex[512];
    int n_near = 0, n_vertex = 0;
    for (int32_t i = start[cell]; i < start[cell + 1]; i++) {
        int32_t v = list[i];
        if (c->vertex_boundary[v]) return false;
        for (int32_t k = c->vertex_cell.start[v]; k < c->vertex_cell.start[v + 1]; k++) {
            int at = 0;
            while (at < n_near && near[at] != c->vertex_cell.item[k]) at++;
            if (at == 64) return false;
            if (at == n_near) near[n_near++] = c->vertex_cell.item[k];
        }
    }
    if (n_near != 27) return false;
    for (int n = 0; n < n_near; n++) {
        if (start[near[n] + 1] - start[near[n]] != 8) return false;
        for (int32_t i = start[near[n]]; i < start[near[n] + 1]; i++) {
            int at = 0;
            while (at < n_vertex && vertex[at] != list[i]) at++;
            if (at == n_vertex) vertex[n_vertex++] = list[i];
        }
    }
    return n_vertex == 64;
}

static void only_regular_neighbourhoods_are_cubic(void)
{
    int found = 0;
    for (int which = 0; which < 4; which++) {
        pal_subdivision s = which == 0   ? refined(solid_torus(6, 2), 1)
                            : which == 1 ? refined(solid_pyramids(), 3)
                            : which == 2 ? refined(solid_prism(5), 3)
                                         : refined(solid_torus(4, 1), 2);
        pal_cell_elements e = of(&s.cells);
        const int32_t *next = e.cell[PAL_CELL_CUBIC], *end = next + e.n[PAL_CELL_CUBIC];
        int wrong = 0;
        for (int32_t i = 0; i < s.cells.n_cell; i++) {
            bool cubic = next < end && *next == i;
            next += cubic;
            wrong += cubic != looks_cubic(&s.cells, i);
        }
        CHECK_INT(wrong, 0);
        CHECK(next == end);
        CHECK(e.n[PAL_CELL_CUBIC] > 0);
        found += e.n[PAL_CELL_CUBIC];
        /* every node of theirs is its own */
        for (int32_t i = 0; i < e.n[PAL_CELL_CUBIC]; i += 7)
            for (int m = 0; m < 64; m++)
                for (int n = 0; n < m; n++)
                    if (e.node[PAL_CELL_CUBIC][64 * i + m] == e.node[PAL_CELL_CUBIC][64 * i + n])
                        CHECK_FAIL("nodes %d and %d of element %d are the same", m, n, i);
        pal_cell_elements_free(&e);
        pal_subdivision_free(&s);
    }
    CHECK(found > 200);
}

/* three cells round a tube meet themselves again: not 64 nodes; six do not */
static void a_ring_of_three_is_not_cubic_until_it_is_cut(void)
{
    pal_cells c = solid_tube(3, 3, 3);
    pal_cell_elements e = of(&c);
    CHECK_INT(e.n[PAL_CELL_CUBIC], 0);
    CHECK_INT(e.n[PAL_CELL_HEX], 27);
    pal_cell_elements_free(&e);
    pal_cells_free(&c);
    pal_subdivision s = refined(solid_tube(3, 3, 3), 1);
    e = of(&s.cells);
    CHECK_INT(e.n[PAL_CELL_CUBIC], 6 * 4 * 4);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
}

static void a_cell_with_other_faces_than_quads_is_refused(void)
{
    pal_cells c = solid_prism(5);
    pal_cell_elements e = {0};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_cell_elements_make(&c, &e, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "elements: cell 0 is no hexahedron and its face 0 has 5 corners: subdivide once");
    CHECK(!e.virtual_cell && !e.node[PAL_CELL_HEX]);
    pal_cells_free(&c);
    c = solid_prism(4);
    e = of(&c);
    CHECK_INT(e.n[PAL_CELL_HEX], 1);
    double min;
    CHECK_NEAR(volume_of(&e, c.x, &min), 2, 1e-14);
    pal_cell_elements_free(&e);
    pal_cells_free(&c);
}

int main(void)
{
    RUN(blocks_have_the_counts_of_table_1);
    RUN(the_64_labels_are_the_lattice_in_order);
    RUN(nodes_lie_across_faces_edges_and_corners_as_figure_6_says);
    RUN(elements_fill_the_solid_without_a_gap);
    RUN(cells_that_are_no_hexahedra_become_pyramids_to_their_middle);
    RUN(rows_of_all_nodes_sum_to_one);
    RUN(only_regular_neighbourhoods_are_cubic);
    RUN(a_ring_of_three_is_not_cubic_until_it_is_cut);
    RUN(a_cell_with_other_faces_than_quads_is_refused);
    return check_report();
}
