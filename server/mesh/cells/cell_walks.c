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

/* the corner from which a fan of triangles covers the face best */
static int fan_corner(const pal_cells *c, int32_t face)
{
    int32_t first, n = pal_cells_face_loop(c, face, &first);
    double area[3], part[3], best = -INFINITY;
    int corner = 0;
    if (n == 3) return 0;
    pal_cells_face_area(c, NULL, face, area);
    for (int i = 0; i < n; i++) {
        double worst = INFINITY;
        for (int k = 1; k + 1 < n; k++) {
            pal_normal3(part, c->x + 3 * (size_t)c->edge_use[first + i].vertex,
                        c->x + 3 * (size_t)c->edge_use[first + (i + k) % n].vertex,
                        c->x + 3 * (size_t)c->edge_use[first + (i + k + 1) % n].vertex);
            worst = fmin(worst, pal_dot3(part, area));
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

static void write_triangles(const pal_cells *c, const int32_t *number, pal_surface *s, int32_t *face)
{
    int32_t at = 0;
    for (int32_t f = 0; f < c->n_face; f++) {
        if (!pal_cells_face_boundary(c, f)) continue;
        int32_t first, n = pal_cells_face_loop(c, f, &first), i = fan_corner(c, f);
        for (int32_t k = 1; k + 1 < n; k++, at++) {
            int32_t *tri = s->tri + 3 * (size_t)at;
            tri[0] = number[c->edge_use[first + i].vertex];
            tri[1] = number[c->edge_use[first + (i + k) % n].vertex];
            tri[2] = number[c->edge_use[first + (i + k + 1) % n].vertex];
            face[at] = f;
        }
    }
}

pal_err pal_cells_boundary(const pal_cells *c, pal_surface *out, int32_t **vertex, int32_t **face)
{
    pal_surface s = {0};
    for (int32_t v = 0; v < c->n_vertex; v++) s.n_vertex += c->vertex_boundary[v];
    for (int32_t f = 0; f < c->n_face; f++) {
        int32_t first;
        if (pal_cells_face_boundary(c, f)) s.n_tri += pal_cells_face_loop(c, f, &first) - 2;
    }
    pal_err err = PAL_ERR_OK;
    int32_t *number, *old, *of;
    PAL_ARRAY(&err, s.x, 3 * (size_t)s.n_vertex);
    PAL_ARRAY(&err, s.tri, 3 * (size_t)s.n_tri);
    PAL_ARRAY(&err, number, c->n_vertex);
    PAL_ARRAY(&err, old, s.n_vertex);
    PAL_ARRAY(&err, of, s.n_tri);
    if (!err) {
        int32_t n = 0;
        for (int32_t v = 0; v < c->n_vertex; v++) {
            number[v] = c->vertex_boundary[v] ? n : -1;
            if (!c->vertex_boundary[v]) continue;
            pal_copy3(s.x + 3 * (size_t)n, c->x + 3 * (size_t)v);
            old[n++] = v;
        }
        write_triangles(c, number, &s, of);
        *out = s;
        if (vertex) *vertex = old, old = NULL;
        if (face) *face = of, of = NULL;
    } else {
        pal_surface_free(&s);
    }
    return PAL_FREED(err, number, old, of);
}
