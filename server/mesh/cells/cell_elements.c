/* Choice of finite elements by walking the radial-edge structure (paper A section 3.4.4, Fig. 6).
 *
 * A hexahedron is represented by one edge use h from the origin along u; the next edge use around the origin runs along
 * w, the one after along v (counter-clockwise seen from outside; three steps return to h). A step to the cell across a
 * face transfers h, so that the axes of the 27 cells of a regular neighbourhood agree. The eight cells that touch the
 * cell in a corner only have two vertices along each axis, and together exactly the 64.
 *
 * Errata: A12, 56 other vertices, not 58. A13: a vertex is regular with 8 cells and 6 edges, and an edge of the cell
 * with 4 cells. With that the 26 neighbours are those of a lattice; that they are hexahedra is checked for the cells at
 * the eight corners. Departure: the 64 nodes must differ, which excludes three cells in a ring. */
#include "server/mesh/cells/cell_elements.h"

#include <stdlib.h>
#include <string.h>

/* ---- walks in hexahedra ---- */

enum { U, V, W };

static int32_t next_twice(const pal_cells *c, int32_t h)
{
    return pal_cells_next_around(c, pal_cells_next_around(c, h));
}

/* the same cell with the axes permuted cyclically, so that the given one comes first */
static int32_t first_axis(const pal_cells *c, int32_t h, int axis)
{
    return axis == U ? h : axis == W ? pal_cells_next_around(c, h) : next_twice(c, h);
}
static int32_t back_axis(const pal_cells *c, int32_t h, int axis)
{
    return axis == U ? h : axis == W ? next_twice(c, h) : pal_cells_next_around(c, h);
}

/* the cell across the face at the far (ahead) or near end of an axis */
static int32_t step(const pal_cells *c, int32_t h, int axis, bool ahead)
{
    h = first_axis(c, h, axis);
    if (ahead) {
        /* the far face runs from uw to u, its mate from the next origin along w */
        int32_t far = c->edge_use[pal_cells_next(c, h)].radial;
        h = next_twice(c, c->edge_use[far].mate);
    } else {
        int32_t far = c->edge_use[pal_cells_next_around(c, h)].mate;
        h = pal_cells_prev(c, c->edge_use[far].radial);
    }
    return back_axis(c, h, axis);
}

/* vertices at corner bits u = 1, v = 2, w = 4 */
static void corners(const pal_cells *c, int32_t h, int32_t out[8])
{
    int32_t use = pal_cells_next(c, h), top = pal_cells_next(c, c->edge_use[use].radial);
    out[0] = c->edge_use[h].vertex;
    out[1] = c->edge_use[use].vertex;
    out[5] = c->edge_use[use = pal_cells_next(c, use)].vertex;
    out[4] = c->edge_use[pal_cells_next(c, use)].vertex;
    /* the face at u = 1: u, uv, uvw, uw */
    out[3] = c->edge_use[top = pal_cells_next(c, top)].vertex;
    out[7] = c->edge_use[pal_cells_next(c, top)].vertex;
    /* v and vw, round the face at u = 0 */
    use = pal_cells_next(c, pal_cells_next_around(c, h));
    out[6] = c->edge_use[use = pal_cells_next(c, use)].vertex;
    out[2] = c->edge_use[pal_cells_next(c, use)].vertex;
}

/* ---- the kind of a cell ---- */

/* six quads, three at every vertex: combinatorially a cube */
static bool is_hex(const pal_cells *c, int32_t cell)
{
    if (c->cell_use[cell + 1] - c->cell_use[cell] != 6) return false;
    for (int32_t u = c->cell_use[cell]; u < c->cell_use[cell + 1]; u++)
        if (c->face_use[u + 1].first_use - c->face_use[u].first_use != 4) return false;
    for (int32_t k = c->cell_vertex.start[cell]; k < c->cell_vertex.start[cell + 1]; k++) {
        int32_t h = c->corner_use[k];
        if (pal_cells_next_around(c, next_twice(c, h)) != h) return false;
    }
    return true;
}

/* inside, 8 hexahedra and 6 edges */
static bool is_regular(const pal_cells *c, const bool *hex, int32_t v)
{
    const int32_t *cell = c->vertex_cell.start + v, *edge = c->vertex_edge.start + v;
    if (c->vertex_boundary[v] || cell[1] - cell[0] != 8 || edge[1] - edge[0] != 6) return false;
    for (int32_t k = cell[0]; k < cell[1]; k++)
        if (!hex[c->vertex_cell.item[k]]) return false;
    return true;
}

/* a hexahedron in a regular neighbourhood? */
static bool is_cubic(const pal_cells *c, const bool *hex, int32_t cell)
{
    if (!hex[cell]) return false;
    for (int32_t k = c->cell_vertex.start[cell]; k < c->cell_vertex.start[cell + 1]; k++)
        if (!is_regular(c, hex, c->cell_vertex.item[k])) return false;
    for (int32_t u = c->face_use[c->cell_use[cell]].first_use; u < c->face_use[c->cell_use[cell + 1]].first_use; u++) {
        int32_t e = c->edge_use[u].edge;
        if (c->edge_cell.start[e + 1] - c->edge_cell.start[e] != 4) return false;
    }
    return true;
}

/* the 64 nodes of a cell in a regular neighbourhood; false: some coincide. stamp [n_vertex] is below mark */
static bool label_nodes(const pal_cells *c, int32_t cell, int32_t *stamp, int32_t mark, int32_t node[64])
{
    const int32_t own = c->corner_use[c->cell_vertex.start[cell]];
    for (int at = 0; at < 8; at++) {
        int32_t h = own, corner[8];
        for (int axis = U; axis <= W; axis++) h = step(c, h, axis, at >> axis & 1);
        corners(c, h, corner);
        for (int k = 0; k < 8; k++) {
            int place[3];
            for (int axis = U; axis <= W; axis++) place[axis] = 2 * (at >> axis & 1) + (k >> axis & 1);
            node[16 * place[U] + 4 * place[V] + place[W]] = corner[k];
        }
    }
    for (int m = 0; m < 64; m++) {
        if (stamp[node[m]] == mark) return false;
        stamp[node[m]] = mark;
    }
    return true;
}

/* ---- the lists ---- */

static pal_err check_quads(const pal_cells *c, int32_t cell, pal_diagnostic *diag)
{
    for (int32_t u = c->cell_use[cell]; u < c->cell_use[cell + 1]; u++) {
        int n = c->face_use[u + 1].first_use - c->face_use[u].first_use;
        if (n != 4)
            return pal_diagnostic_set(
                diag, PAL_ERR_REFUSED,
                "elements: cell %d is no hexahedron and its face %d has %d corners: subdivide once", cell,
                c->face_use[u].face, n);
    }
    return PAL_ERR_OK;
}

/* one pyramid on every quad, base seen from inside */
static void add_pyramids(const pal_cells *c, int32_t cell, pal_cell_elements *e)
{
    for (int32_t u = c->cell_use[cell]; u < c->cell_use[cell + 1]; u++) {
        int32_t at = e->n[PAL_CELL_PYRAMID]++, *node = e->node[PAL_CELL_PYRAMID] + PAL_PYRAMID_NODES * (size_t)at;
        for (int k = 0; k < 4; k++) node[k] = c->edge_use[c->face_use[u].first_use + 3 - k].vertex;
        node[4] = e->n_vertex + e->n_virtual;
        e->cell[PAL_CELL_PYRAMID][at] = cell;
    }
    e->virtual_cell[e->n_virtual++] = cell;
}

/* mean of the vertices of each cell that has a virtual node */
static pal_err add_virtual_node(const pal_cells *c, pal_cell_elements *e)
{
    const pal_cell_rows *r = &c->cell_vertex;
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, e->n_virtual, c->n_vertex, r->start[c->n_cell]);
    for (int32_t i = 0; i < e->n_virtual && !b.err; i++) {
        int32_t first = r->start[e->virtual_cell[i]], after = r->start[e->virtual_cell[i] + 1];
        for (int32_t k = first; k < after; k++) pal_interpolation_builder_add(&b, r->item[k], 1.0 / (after - first));
        pal_interpolation_builder_end_row(&b);
    }
    return pal_interpolation_builder_finish(&b, &e->virtual_rows);
}

/* room for n elements of a kind */
static pal_err allocate(pal_cell_elements *e, pal_cell_kind kind, int32_t n)
{
    e->node[kind] = malloc((size_t)n * (size_t)pal_cell_kind_nodes(kind) * sizeof *e->node[kind] + 1);
    e->cell[kind] = malloc((size_t)n * sizeof *e->cell[kind] + 1);
    return e->node[kind] && e->cell[kind] ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* space for the largest possible number of each kind, a pyramid for each face of the cells that are no hexahedra */
static pal_err allocate_all(const pal_cells *c, const bool *hex, pal_cell_elements *e, pal_diagnostic *diag)
{
    int32_t n_hex = 0, n_cubic = 0, n_pyramid = 0;
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (!hex[i]) PAL_TRY(check_quads(c, i, diag));
        n_hex += hex[i], n_cubic += is_cubic(c, hex, i);
        n_pyramid += hex[i] ? 0 : c->cell_use[i + 1] - c->cell_use[i];
    }
    PAL_TRY(allocate(e, PAL_CELL_CUBIC, n_cubic));
    PAL_TRY(allocate(e, PAL_CELL_HEX, n_hex));
    PAL_TRY(allocate(e, PAL_CELL_PYRAMID, n_pyramid));
    e->virtual_cell = malloc((size_t)(c->n_cell - n_hex) * sizeof *e->virtual_cell + 1);
    return e->virtual_cell ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static void fill(const pal_cells *c, const bool *hex, int32_t *stamp, pal_cell_elements *e)
{
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (!hex[i]) {
            add_pyramids(c, i, e);
            continue;
        }
        int32_t *cubic = e->node[PAL_CELL_CUBIC] + PAL_CUBIC_NODES * (size_t)e->n[PAL_CELL_CUBIC];
        if (is_cubic(c, hex, i) && label_nodes(c, i, stamp, i + 1, cubic)) {
            e->cell[PAL_CELL_CUBIC][e->n[PAL_CELL_CUBIC]++] = i;
            continue;
        }
        int32_t at = e->n[PAL_CELL_HEX]++;
        corners(c, c->corner_use[c->cell_vertex.start[i]], e->node[PAL_CELL_HEX] + 8 * (size_t)at);
        e->cell[PAL_CELL_HEX][at] = i;
    }
}

pal_err pal_cell_elements_make(const pal_cells *cells, pal_cell_elements *out, pal_diagnostic *diag)
{
    pal_cell_elements e = {.n_vertex = cells->n_vertex};
    bool *hex = malloc((size_t)cells->n_cell + 1);
    int32_t *stamp = calloc((size_t)cells->n_vertex + 1, sizeof *stamp);
    pal_err err = hex && stamp ? PAL_ERR_OK : PAL_ERR_MEMORY;
    for (int32_t i = 0; i < cells->n_cell && !err; i++) hex[i] = is_hex(cells, i);
    if (!err) err = allocate_all(cells, hex, &e, diag);
    if (!err) {
        fill(cells, hex, stamp, &e);
        err = add_virtual_node(cells, &e);
    }
    free(hex);
    free(stamp);
    if (err)
        pal_cell_elements_free(&e);
    else
        *out = e;
    return err;
}

void pal_cell_elements_free(pal_cell_elements *e)
{
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++) {
        free(e->node[kind]);
        free(e->cell[kind]);
    }
    free(e->virtual_cell);
    pal_interpolation_free(&e->virtual_rows);
    memset(e, 0, sizeof *e);
}

/* ---- rows of all nodes ---- */

pal_err pal_cell_elements_interpolation(const pal_cell_elements *e, const pal_interpolation *vertices,
                                        pal_interpolation *out)
{
    PAL_ASSERT(vertices->n_row == e->n_vertex);
    pal_interpolation extra = {0}, all = {.n_row = e->n_vertex + e->n_virtual, .n_point = vertices->n_point};
    PAL_TRY(pal_interpolation_product(&e->virtual_rows, vertices, INT32_MAX - vertices->start[e->n_vertex], &extra));
    size_t n = (size_t)vertices->start[e->n_vertex], more = (size_t)extra.start[e->n_virtual];
    all.start = malloc(((size_t)all.n_row + 1) * sizeof *all.start);
    all.point = malloc((n + more) * sizeof *all.point);
    all.weight = malloc((n + more) * sizeof *all.weight);
    pal_err err = all.start && all.point && all.weight ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) {
        memcpy(all.point, vertices->point, n * sizeof *all.point);
        memcpy(all.point + n, extra.point, more * sizeof *all.point);
        memcpy(all.weight, vertices->weight, n * sizeof *all.weight);
        memcpy(all.weight + n, extra.weight, more * sizeof *all.weight);
        memcpy(all.start, vertices->start, (size_t)e->n_vertex * sizeof *all.start);
        for (int32_t i = 0; i <= e->n_virtual; i++) all.start[e->n_vertex + i] = (int32_t)n + extra.start[i];
        *out = all;
    } else
        pal_interpolation_free(&all);
    pal_interpolation_free(&extra);
    return err;
}
