/* Choice of finite elements by walking the radial-edge structure (paper A section 3.4.4, Fig. 6).
 *
 * A hexahedron is represented by one edge use h from the origin along u; the next edge use around the origin runs along
 * w, the one after along v (counter-clockwise seen from outside; three steps return to h). A step to the cell across a
 * face transfers h, so that the axes of the 27 cells of a regular neighbourhood agree. The eight cells that touch the
 * cell in a corner only have two vertices along each axis, and together exactly the 64.
 *
 * Errata A12 and A13. In a regular neighbourhood the 26 neighbours are those of a lattice; that they are hexahedra is
 * checked for the cells at the eight corners. Departure: the 64 nodes must differ, which excludes three cells in a
 * ring. */
#include "server/mesh/cells/cell_elements.h"

#include "server/base/heap.h"

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
    return first_axis(c, h, (3 - axis) % 3); /* back */
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

static pal_err check_quads(const pal_cells *c, int32_t cell, pal_diagnostic *diag)
{
    for (int32_t u = c->cell_use[cell]; u < c->cell_use[cell + 1]; u++) {
        int n = c->face_use[u + 1].first_use - c->face_use[u].first_use;
        if (n != 4)
            return PAL_REFUSE(diag, "elements: cell %d is no hexahedron and its face %d has %d corners: subdivide once",
                              cell, c->face_use[u].face, n);
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
    for (int32_t i = 0; i < e->n_virtual; i++) {
        int32_t first = r->start[e->virtual_cell[i]], after = r->start[e->virtual_cell[i] + 1];
        pal_interpolation_builder_mean(&b, r->item + first, after - first);
    }
    return pal_interpolation_builder_finish(&b, &e->virtual_rows);
}

/* space for the largest possible number of each kind, a pyramid for each face of the cells that are no hexahedra */
static pal_err allocate_all(const pal_cells *c, const bool *hex, pal_cell_elements *e, pal_diagnostic *diag)
{
    int32_t n[PAL_CELL_KINDS] = {0};
    pal_err err = PAL_ERR_OK;
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (!hex[i]) PAL_TRY(check_quads(c, i, diag));
        n[PAL_CELL_HEX] += hex[i], n[PAL_CELL_CUBIC] += is_cubic(c, hex, i);
        n[PAL_CELL_PYRAMID] += hex[i] ? 0 : c->cell_use[i + 1] - c->cell_use[i];
    }
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++) {
        PAL_ARRAY(&err, e->node[kind], (size_t)n[kind] * (size_t)pal_cell_kind_nodes((pal_cell_kind)kind));
        PAL_ARRAY(&err, e->cell[kind], n[kind]);
    }
    PAL_ARRAY(&err, e->virtual_cell, c->n_cell - n[PAL_CELL_HEX]);
    return err;
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
    pal_err err = PAL_ERR_OK;
    bool *hex;
    int32_t *stamp;
    PAL_ARRAY(&err, hex, cells->n_cell);
    PAL_ZEROED(&err, stamp, cells->n_vertex);
    for (int32_t i = 0; i < cells->n_cell && !err; i++) hex[i] = is_hex(cells, i);
    if (!err) err = allocate_all(cells, hex, &e, diag);
    if (!err) {
        fill(cells, hex, stamp, &e);
        err = add_virtual_node(cells, &e);
    }
    PAL_FREE(hex, stamp);
    if (err)
        pal_cell_elements_free(&e);
    else
        *out = e;
    return err;
}

void pal_cell_elements_free(pal_cell_elements *e)
{
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++) {
        PAL_FREE(e->node[kind], e->cell[kind]);
    }
    free(e->virtual_cell);
    pal_interpolation_free(&e->virtual_rows);
    memset(e, 0, sizeof *e);
}

pal_err pal_cell_elements_interpolation(const pal_cell_elements *e, const pal_interpolation *vertices,
                                        pal_interpolation *out)
{
    PAL_ASSERT(vertices->n_row == e->n_vertex);
    pal_interpolation_builder b;
    pal_interpolation_builder_begin(&b, e->n_vertex + e->n_virtual, vertices->n_point, INT32_MAX);
    pal_interpolation_builder_product(&b, NULL, vertices);
    pal_interpolation_builder_product(&b, &e->virtual_rows, vertices);
    return pal_interpolation_builder_finish(&b, out);
}
