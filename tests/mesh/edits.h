/* Helpers of the tests of sculpting edits: applying, finding places, what every edit must hold, quality of elements. */
#ifndef TESTS_MESH_EDITS_H
#define TESTS_MESH_EDITS_H
#include "server/mesh/cell_edits.h"
#include "server/mesh/cell_elements.h"
#include "server/mesh/maccracken_joy.h"
#include "server/num/spline.h"
#include "tests/check.h"
#include "tests/mesh/solids.h"

static pal_note note;

/* a complex after a command, which it must take; frees the complex before */
static inline pal_cells edited(pal_cells from, pal_cells_command command)
{
    pal_cells_edit e;
    if (pal_cells_apply(&from, &command, &e, &note)) {
        CHECK_FAIL("%s", note.text);
        return from;
    }
    pal_cells out = e.cells;
    memset(&e.cells, 0, sizeof e.cells);
    pal_cells_edit_free(&e);
    pal_cells_free(&from);
    return out;
}

/* the boundary face whose corners' mean is nearest to a place */
static inline int32_t face_near(const pal_cells *c, double x, double y, double z)
{
    double least = INFINITY, o[3];
    int32_t face = -1;
    for (int32_t f = 0; f < c->n_face; f++) {
        if (!pal_cells_face_boundary(c, f)) continue;
        pal_cells_face_centre(c, NULL, f, o);
        double d = hypot(hypot(o[0] - x, o[1] - y), o[2] - z);
        if (d < least) least = d, face = f;
    }
    return face;
}

static inline int32_t cell_near(const pal_cells *c, double x, double y, double z)
{
    double least = INFINITY, o[3];
    int32_t cell = -1;
    for (int32_t i = 0; i < c->n_cell; i++) {
        pal_cells_cell_centre(c, NULL, i, o);
        double d = hypot(hypot(o[0] - x, o[1] - y), o[2] - z);
        if (d < least) least = d, cell = i;
    }
    return cell;
}

static inline void check_counts(const pal_cells *c, int vertex, int edge, int face, int cell)
{
    CHECK_INT(c->n_vertex, vertex);
    CHECK_INT(c->n_edge, edge);
    CHECK_INT(c->n_face, face);
    CHECK_INT(c->n_cell, cell);
}

static inline void check_holes(const pal_cells *c, int piece, int cavity, int genus)
{
    pal_cells_topology t;
    REQUIRE(!pal_cells_find_topology(c, &t));
    CHECK_INT(t.n_piece, piece);
    CHECK_INT(t.n_cavity, cavity);
    CHECK_INT(t.genus, genus);
}

/* rows sum to 1 and, with the offsets, place the new rest positions to the bit */
static inline void check_carrying(const pal_cells_edit *e, const pal_cells *from)
{
    REQUIRE(e->rows.n_row == e->cells.n_vertex && e->rows.n_point == from->n_vertex);
    double *x = malloc(3 * (size_t)e->cells.n_vertex * sizeof *x), worst = 0;
    REQUIRE(x);
    for (int32_t i = 0; i < e->rows.n_row; i++) {
        double sum = 0;
        for (int32_t k = e->rows.start[i]; k < e->rows.start[i + 1]; k++) sum += e->rows.weight[k];
        worst = fmax(worst, fabs(sum - 1));
    }
    CHECK_LE(worst, 1e-14);
    pal_point_rows_place(&e->rows, from->x, x);
    worst = 0;
    for (int32_t i = 0; i < 3 * e->cells.n_vertex; i++) worst = fmax(worst, fabs(x[i] + e->offset[i] - e->cells.x[i]));
    CHECK_LE(worst, 1e-15 * (1 + fabs(x[0])));
    pal_cells_edit_place(e, from, from->x, x);
    for (int32_t i = 0; i < 3 * e->cells.n_vertex; i++) worst = fmax(worst, fabs(x[i] - e->cells.x[i]));
    CHECK_LE(worst, 1e-9);
    int wrong = 0;
    for (int32_t i = 0; i < e->cells.n_cell; i++) wrong += e->cell_from[i] < 0 || e->cell_from[i] >= from->n_cell;
    CHECK_INT(wrong, 0);
    free(x);
}

/* shape gradients at the 64 Gauss points, of 64, 8 and 5 nodes */
static double slopes[PAL_CELL_KINDS][64][64][3];

static inline void tabulate_slopes(void)
{
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int p = 0; p < 64; p++) {
            double at[3];
            pal_cell_point(p, at);
            pal_cell_shape(pal_cell_kind_nodes((pal_cell_kind)kind), at, NULL, slopes[kind][p]);
        }
}

/* least det J at the Gauss points of the elements of a subdivided solid, by the element's largest; volume out */
static inline double least_det(const pal_cell_elements *e, const double *d, double *volume)
{
    double least = INFINITY;
    *volume = 0;
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int32_t i = 0; i < e->n[kind]; i++) {
            int n = pal_cell_kind_nodes((pal_cell_kind)kind);
            const int32_t *node = e->node[kind] + n * i;
            double low = INFINITY, high = 0;
            for (int p = 0; p < 64; p++) {
                double j[3][3] = {{0}}, at[3], w = pal_cell_point(p, at);
                for (int m = 0; m < n; m++) {
                    const double *x = d + 3 * (size_t)node[m], *g = slopes[kind][p][m];
                    for (int r = 0; r < 3; r++)
                        for (int s = 0; s < 3; s++) j[r][s] += x[r] * g[s];
                }
                double det = j[0][0] * (j[1][1] * j[2][2] - j[1][2] * j[2][1]) -
                             j[0][1] * (j[1][0] * j[2][2] - j[1][2] * j[2][0]) +
                             j[0][2] * (j[1][0] * j[2][1] - j[1][1] * j[2][0]);
                low = fmin(low, det), high = fmax(high, fabs(det)), *volume += w * det;
            }
            least = fmin(least, low / high);
        }
    return least;
}

/* subdivides so many levels: refused (0), elements with a turned Gauss point (1), or all positive (2) */
static inline int quality(const pal_cells *c, int n_level, pal_subdivision_rule rule)
{
    pal_subdivision s = {0};
    pal_cell_elements e = {0};
    pal_point_rows rows = {0};
    const pal_subdivision_options o = {.n_level = n_level, .rule = rule};
    note.text[0] = 0;
    if (pal_subdivision_make(c, &o, &s, &note)) {
        CHECK(note.text[0] && !s.cells.x && !s.rows.start);
        return 0;
    }
    if (pal_cell_elements_make(&s.cells, &e, &note) || pal_cell_elements_rows(&e, &s.rows, &rows)) {
        CHECK_FAIL("%s", note.text);
        pal_subdivision_free(&s);
        return 0;
    }
    double *d = malloc(3 * (size_t)rows.n_row * sizeof *d), volume;
    if (!d) abort();
    pal_point_rows_place(&rows, c->x, d);
    int good = least_det(&e, d, &volume) > 0 ? 2 : 1;
    free(d);
    pal_point_rows_free(&rows);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
    return good;
}
#endif
