/* Walks over a polyhedral complex: its pieces, boundary sheets and holes, and its boundary as triangles. */
#include "server/base/heap.h"
#include "server/mesh/cells/cells.h"

#include "server/base/vec3.h"
#include "server/num/union_find.h"

int32_t pal_cells_label(const pal_cells *c, int32_t *label)
{
    pal_union_find_init(label, c->n_cell);
    for (int32_t f = 0; f < c->n_face; f++)
        if (!pal_cells_face_boundary(c, f))
            pal_union_find_join(label, c->face_use[c->face[f].use[0]].cell, c->face_use[c->face[f].use[1]].cell);
    return pal_union_find_label(label, c->n_cell);
}

pal_err pal_cells_find_topology(const pal_cells *c, pal_cells_topology *out)
{
    pal_cells_topology t = {.euler = (int64_t)c->n_vertex - c->n_edge + c->n_face - c->n_cell};
    pal_err err = PAL_ERR_OK;
    int32_t *label;
    int64_t n_side = 0; /* uses of edges by boundary faces: each edge of a sheet has two */
    PAL_ARRAY(&err, label, c->n_face > c->n_cell ? c->n_face : c->n_cell);
    if (err) return err;
    t.n_piece = pal_cells_label(c, label);
    pal_union_find_init(label, c->n_face);
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        if (c->edge_use[u].mate >= 0) continue;
        n_side++;
        pal_union_find_join(label, pal_cells_face_of(c, u), pal_cells_face_of(c, pal_cells_across_edge(c, u)));
    }
    for (int32_t f = 0; f < c->n_face; f++) t.n_sheet += label[f] == f && pal_cells_face_boundary(c, f);
    free(label);
    t.sheet_euler = c->n_boundary_fan - n_side / 2 + c->n_boundary_face;
    t.n_cavity = t.n_sheet - t.n_piece;
    t.genus = (int32_t)(t.n_sheet - t.sheet_euler / 2);
    *out = t;
    return PAL_ERR_OK;
}

/* the use of a face by the one cell beside it that is there, -1: none or both are; away NULL: all cells are there */
static int32_t open_use(const pal_cells *c, const bool *away, int32_t face)
{
    const int32_t *use = c->face[face].use;
    bool there[2];
    for (int k = 0; k < 2; k++) there[k] = use[k] >= 0 && !(away && away[c->face_use[use[k]].cell]);
    return there[0] == there[1] ? -1 : use[there[1]];
}

/* the corner from which a fan of triangles covers the face best, as the cell of a use of n corners sees it */
static int fan_corner(const pal_cells *c, int32_t use, int32_t first, int32_t n)
{
    const int32_t face = c->face_use[use].face;
    double area[3], part[3], best = -INFINITY, side = c->face[face].use[0] == use ? 1 : -1;
    int corner = 0;
    if (n == 3) return 0;
    pal_cells_face_area(c, NULL, face, area);
    for (int i = 0; i < n; i++) {
        double worst = INFINITY;
        for (int k = 1; k + 1 < n; k++) {
            pal_normal3(part, c->x + 3 * (size_t)c->edge_use[first + i].vertex,
                        c->x + 3 * (size_t)c->edge_use[first + (i + k) % n].vertex,
                        c->x + 3 * (size_t)c->edge_use[first + (i + k + 1) % n].vertex);
            worst = fmin(worst, side * pal_dot3(part, area));
        }
        if (n == 4 && worst > 0) {
            /* of the two best cuts of a quad, the shorter diagonal */
            const double *x = c->x;
            worst = 1 / pal_dist3(x + 3 * (size_t)c->edge_use[first + i].vertex,
                                  x + 3 * (size_t)c->edge_use[first + (i + 2) % 4].vertex);
        }
        if (worst > best) best = worst, corner = i;
    }
    return corner;
}

static void write_triangles(const pal_cells *c, const bool *away, const int32_t *number, pal_surface *s, int32_t *face)
{
    int32_t at = 0;
    for (int32_t f = 0; f < c->n_face; f++) {
        const int32_t use = open_use(c, away, f);
        if (use < 0) continue;
        const int32_t first = c->face_use[use].first_use, n = c->face_use[use + 1].first_use - first,
                      i = fan_corner(c, use, first, n);
        for (int32_t k = 1; k + 1 < n; k++, at++) {
            int32_t *tri = s->tri + 3 * (size_t)at;
            tri[0] = number[c->edge_use[first + i].vertex];
            tri[1] = number[c->edge_use[first + (i + k) % n].vertex];
            tri[2] = number[c->edge_use[first + (i + k + 1) % n].vertex];
            face[at] = f;
        }
    }
}

/* number [n_vertex] of the vertices of the boundary, ascending, -1: of none; counts vertices and triangles of s */
static void number_boundary(const pal_cells *c, const bool *away, int32_t *number, pal_surface *s)
{
    for (int32_t v = 0; v < c->n_vertex; v++) number[v] = -1;
    for (int32_t f = 0; f < c->n_face; f++) {
        const int32_t use = open_use(c, away, f);
        if (use < 0) continue;
        const int32_t first = c->face_use[use].first_use, end = c->face_use[use + 1].first_use;
        for (int32_t k = first; k < end; k++) number[c->edge_use[k].vertex] = 0;
        s->n_tri += end - first - 2;
    }
    for (int32_t v = 0; v < c->n_vertex; v++)
        if (number[v] == 0) number[v] = s->n_vertex++;
}

pal_err pal_cells_boundary_of(const pal_cells *c, const bool *away, pal_surface *out, int32_t **vertex, int32_t **face)
{
    pal_surface s = {0};
    pal_err err = PAL_ERR_OK;
    int32_t *number, *old, *of;
    PAL_ARRAY(&err, number, c->n_vertex);
    if (!err) number_boundary(c, away, number, &s);
    PAL_ARRAY(&err, s.x, 3 * (size_t)s.n_vertex);
    PAL_ARRAY(&err, s.tri, 3 * (size_t)s.n_tri);
    PAL_ARRAY(&err, old, s.n_vertex);
    PAL_ARRAY(&err, of, s.n_tri);
    if (!err) {
        for (int32_t v = 0; v < c->n_vertex; v++) {
            if (number[v] < 0) continue;
            pal_copy3(s.x + 3 * (size_t)number[v], c->x + 3 * (size_t)v);
            old[number[v]] = v;
        }
        write_triangles(c, away, number, &s, of);
        *out = s;
        if (vertex) *vertex = old, old = NULL;
        if (face) *face = of, of = NULL;
    } else {
        pal_surface_free(&s);
    }
    return PAL_FREED(err, number, old, of);
}

pal_err pal_cells_boundary(const pal_cells *cells, pal_surface *out, int32_t **vertex, int32_t **face)
{
    return pal_cells_boundary_of(cells, NULL, out, vertex, face);
}
