/* Consistency check of a polyhedral complex: every index, pair, list and mark, from the definitions in cells.h and
 * independent of how it was built. */
#include "server/mesh/cells/cells.h"

#include <stdlib.h>
#include <string.h>

typedef struct checker {
    const pal_cells *c;
    int32_t *stamp; /* scratch [n_vertex] */
    pal_diagnostic *diag;
} checker;

#define FAULT(...) return pal_diagnostic_set(k->diag, PAL_ERR_REFUSED, __VA_ARGS__)

static bool within(int32_t i, int32_t n)
{
    return i >= 0 && i < n;
}

static pal_err check_uses(const checker *k)
{
    const pal_cells *c = k->c;
    if (c->cell_use[0] != 0 || c->cell_use[c->n_cell] != c->n_face_use || c->face_use[0].first_use != 0 ||
        c->face_use[c->n_face_use].first_use != c->n_edge_use)
        FAULT("cells: the uses are not %d faces and %d edges", c->n_face_use, c->n_edge_use);
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (c->cell_use[i + 1] <= c->cell_use[i] || c->cell_use[i + 1] > c->n_face_use)
            FAULT("cells: cell %d has no faces", i);
        for (int32_t f = c->cell_use[i]; f < c->cell_use[i + 1]; f++)
            if (c->face_use[f].cell != i) FAULT("cells: face use %d is not of cell %d", f, i);
    }
    for (int32_t f = 0; f < c->n_face_use; f++) {
        const pal_face_use *use = &c->face_use[f];
        int32_t n = use[1].first_use - use->first_use;
        if (!within(use->face, c->n_face) || (use->sign != 1 && use->sign != -1) || n < 3 || n > PAL_CELL_LOOP_MAX ||
            use[1].first_use > c->n_edge_use || c->face[use->face].use[use->sign < 0] != f ||
            c->face[use->face].use[use->sign > 0] != use->mate)
            FAULT("cells: face use %d does not fit face %d", f, use->face);
        if (use->mate >= 0 && (use->mate >= c->n_face_use || c->face_use[use->mate].mate != f))
            FAULT("cells: face use %d is not the mate of its mate %d", f, use->mate);
        for (int32_t u = use->first_use; u < use[1].first_use; u++)
            if (c->edge_use[u].face_use != f) FAULT("cells: edge use %d is not of face use %d", u, f);
    }
    for (int32_t f = 0; f < c->n_face; f++)
        if (!within(c->face[f].use[0], c->n_face_use) || c->face_use[c->face[f].use[0]].face != f ||
            (c->face[f].use[1] >= 0 && c->face[f].use[1] <= c->face[f].use[0]) ||
            !(c->face[f].sharp >= 0 && c->face[f].sharp <= PAL_SHARPNESS_MAX))
            FAULT("cells: face %d does not fit its uses %d and %d, or its sharpness %g", f, c->face[f].use[0],
                  c->face[f].use[1], (double)c->face[f].sharp);
    return PAL_ERR_OK;
}

static pal_err check_edges(const checker *k)
{
    const pal_cells *c = k->c;
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        const pal_edge_use *use = &c->edge_use[u];
        if (!within(use->edge, c->n_edge) || !within(use->vertex, c->n_vertex) || !within(use->radial, c->n_edge_use) ||
            use->mate < -1 || use->mate >= c->n_edge_use)
            FAULT("cells: edge use %d has edge %d, vertex %d, radial %d, mate %d", u, use->edge, use->vertex,
                  use->radial, use->mate);
    }
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        const pal_edge_use *use = &c->edge_use[u], *radial = &c->edge_use[use->radial];
        const int32_t *end = c->edge[use->edge].vertex;
        int32_t to = c->edge_use[pal_cells_next(c, u)].vertex, mate = use->mate;
        if (!((end[0] == use->vertex && end[1] == to) || (end[1] == use->vertex && end[0] == to)) || to == use->vertex)
            FAULT("cells: edge use %d from vertex %d to %d is not edge %d", u, use->vertex, to, use->edge);
        if (radial->radial != u || radial->edge != use->edge || radial->vertex != to ||
            radial->face_use == use->face_use || pal_cells_cell_of(c, use->radial) != pal_cells_cell_of(c, u))
            FAULT("cells: edge use %d and its radial %d do not fit", u, use->radial);
        if ((mate >= 0) != (c->face_use[use->face_use].mate >= 0))
            FAULT("cells: edge use %d has a mate where its face use has none, or none where it has", u);
        if (mate >= 0 &&
            (c->edge_use[mate].mate != u || c->edge_use[mate].edge != use->edge || c->edge_use[mate].vertex != to ||
             c->edge_use[mate].face_use != c->face_use[use->face_use].mate))
            FAULT("cells: edge use %d and its mate %d do not fit", u, mate);
    }
    return PAL_ERR_OK;
}

/* n rows of n_entry entries below n_item, none empty, ascending where they should be */
static bool lists_valid(const pal_cell_rows *rows, int32_t n, int32_t n_entry, int32_t n_item, bool sorted)
{
    if (rows->start[0] != 0 || rows->start[n] != n_entry) return false;
    for (int32_t i = 0; i < n; i++)
        if (rows->start[i + 1] <= rows->start[i]) return false;
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = rows->start[i]; k < rows->start[i + 1]; k++)
            if (!within(rows->item[k], n_item) || (sorted && k > rows->start[i] && rows->item[k - 1] >= rows->item[k]))
                return false;
    return true;
}

static bool list_contains(const pal_cell_rows *rows, int32_t row, int32_t item)
{
    int32_t low = rows->start[row], high = rows->start[row + 1] - 1;
    while (low < high) {
        int32_t mid = low + (high - low) / 2;
        if (rows->item[mid] < item)
            low = mid + 1;
        else
            high = mid;
    }
    return low == high && rows->item[low] == item;
}

/* every use is in its lists, and the lists have no entries besides */
static pal_err check_rows(const checker *k)
{
    const pal_cells *c = k->c;
    int32_t n_first = 0, n_corner = 0;
    memset(k->stamp, -1, (size_t)c->n_vertex * sizeof *k->stamp);
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        int32_t v = c->edge_use[u].vertex, i = pal_cells_cell_of(c, u);
        n_first += c->face_use[c->edge_use[u].face_use].sign > 0;
        n_corner += k->stamp[v] != i;
        k->stamp[v] = i;
    }
    if (!lists_valid(&c->vertex_edge, c->n_vertex, 2 * c->n_edge, c->n_edge, true) ||
        !lists_valid(&c->vertex_face, c->n_vertex, n_first, c->n_face, true) ||
        !lists_valid(&c->vertex_cell, c->n_vertex, n_corner, c->n_cell, true) ||
        !lists_valid(&c->edge_face, c->n_edge, n_first, c->n_face, true) ||
        !lists_valid(&c->edge_cell, c->n_edge, c->n_edge_use / 2, c->n_cell, true) ||
        !lists_valid(&c->cell_vertex, c->n_cell, n_corner, c->n_vertex, false))
        FAULT("cells: a row of neighbours is empty, too long, out of range or out of order");
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        int32_t v = c->edge_use[u].vertex, e = c->edge_use[u].edge, f = pal_cells_face_of(c, u);
        int32_t i = pal_cells_cell_of(c, u);
        if (!list_contains(&c->vertex_edge, v, e) || !list_contains(&c->vertex_face, v, f) ||
            !list_contains(&c->vertex_cell, v, i) || !list_contains(&c->edge_face, e, f) ||
            !list_contains(&c->edge_cell, e, i))
            FAULT("cells: edge use %d is missing in a row of vertex %d or edge %d", u, v, e);
    }
    memset(k->stamp, -1, (size_t)c->n_vertex * sizeof *k->stamp);
    for (int32_t i = 0; i < c->n_cell; i++)
        for (int32_t n = c->cell_vertex.start[i]; n < c->cell_vertex.start[i + 1]; n++) {
            int32_t v = c->cell_vertex.item[n], u = c->corner_use[n];
            if (k->stamp[v] == i || !within(u, c->n_edge_use) || c->edge_use[u].vertex != v ||
                pal_cells_cell_of(c, u) != i)
                FAULT("cells: corner %d of cell %d does not fit vertex %d and edge use %d", n - c->cell_vertex.start[i],
                      i, v, u);
            k->stamp[v] = i;
        }
    return PAL_ERR_OK;
}

/* the corner walk of each cell at each vertex: all of its edge uses from there, so that cells are balls */
static pal_err check_corners(const checker *k)
{
    const pal_cells *c = k->c;
    int32_t n_seen = 0;
    for (int32_t n = 0; n < c->cell_vertex.start[c->n_cell]; n++) {
        int32_t u = c->corner_use[n];
        do {
            u = pal_cells_next_around(c, u), n_seen++;
        } while (u != c->corner_use[n]);
    }
    if (n_seen != c->n_edge_use)
        FAULT("cells: walks round the corners of cells meet %d edge uses of %d: a cell touches itself in a vertex",
              n_seen, c->n_edge_use);
    for (int32_t i = 0; i < c->n_cell; i++) {
        int32_t n_vertex = c->cell_vertex.start[i + 1] - c->cell_vertex.start[i];
        int32_t n_face = c->cell_use[i + 1] - c->cell_use[i];
        int32_t n_edge = (c->face_use[c->cell_use[i + 1]].first_use - c->face_use[c->cell_use[i]].first_use) / 2;
        if (n_vertex - n_edge + n_face != 2) FAULT("cells: cell %d is no ball", i);
    }
    return PAL_ERR_OK;
}

static pal_err check_marks(const checker *k)
{
    const pal_cells *c = k->c;
    int32_t n_face = 0, n_edge = 0, n_vertex = 0;
    for (int32_t f = 0; f < c->n_face; f++) n_face += pal_cells_face_boundary(c, f);
    for (int32_t e = 0; e < c->n_edge; e++) {
        int32_t n = 0;
        for (int32_t i = c->edge_face.start[e]; i < c->edge_face.start[e + 1]; i++)
            n += pal_cells_face_boundary(c, c->edge_face.item[i]);
        if (n % 2 || c->edge[e].boundary != (n > 0) || c->edge[e].pinched != (n > 2) ||
            !(c->edge[e].sharp >= 0 && c->edge[e].sharp <= PAL_SHARPNESS_MAX))
            FAULT("cells: edge %d has %d boundary faces and sharpness %g, which its marks do not say", e, n,
                  (double)c->edge[e].sharp);
        n_edge += n > 2;
    }
    for (int32_t v = 0; v < c->n_vertex; v++) {
        bool boundary = false;
        for (int32_t i = c->vertex_face.start[v]; i < c->vertex_face.start[v + 1]; i++)
            boundary |= pal_cells_face_boundary(c, c->vertex_face.item[i]);
        if (c->vertex_boundary[v] != boundary || (c->vertex_pinched[v] && !boundary) ||
            !(c->vertex_sharpness[v] >= 0 && c->vertex_sharpness[v] <= PAL_SHARPNESS_MAX))
            FAULT("cells: vertex %d has marks or a sharpness of %g that do not fit", v, (double)c->vertex_sharpness[v]);
        n_vertex += c->vertex_pinched[v];
    }
    if (n_face != c->n_boundary_face || n_edge != c->n_pinched_edge || n_vertex != c->n_pinched_vertex)
        FAULT("cells: %d boundary faces, %d pinched edges and %d vertices are said to be %d, %d and %d", n_face, n_edge,
              n_vertex, c->n_boundary_face, c->n_pinched_edge, c->n_pinched_vertex);
    return PAL_ERR_OK;
}

static pal_err check_positions(const checker *k, const double *x)
{
    pal_cells_fault fault;
    if (pal_cells_shape_valid(k->c, x, &fault)) return PAL_ERR_OK;
    if (fault.face_use < 0)
        FAULT("cells: cell %d has no positive volume (%.3g m^3, %.3g m across)", fault.cell, fault.measure,
              fault.length_scale_m);
    FAULT("cells: face %d of cell %d has no area (%.3g m^2, longest edge %.3g m)",
          fault.face_use - k->c->cell_use[fault.cell], fault.cell, fault.measure, fault.length_scale_m);
}

pal_err pal_cells_check(const pal_cells *cells, const double *x, pal_diagnostic *diag)
{
    checker checker_of = {.c = cells, .diag = diag}, *k = &checker_of;
    if (cells->n_cell < 1 || cells->n_vertex < 1) FAULT("cells: there are none");
    k->stamp = malloc((size_t)cells->n_vertex * sizeof *k->stamp);
    if (!k->stamp) return PAL_ERR_MEMORY;
    pal_err err = check_uses(k);
    if (!err) err = check_edges(k);
    if (!err) err = check_rows(k);
    if (!err) err = check_corners(k);
    if (!err) err = check_marks(k);
    if (!err) err = check_positions(k, x);
    free(k->stamp);
    return err;
}
