/* Walks over a polyhedral complex: its pieces, boundary sheets and holes, and its boundary as triangles. */
#include "server/mesh/cells/cells.h"

#include "server/base/vec3.h"
#include "server/num/union_find.h"

#include <stdlib.h>
#include <string.h>

/* ---- pieces and holes ---- */

static int32_t count_roots(const int32_t *parent, int32_t n)
{
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++) count += parent[i] == i;
    return count;
}

/* sheets of the boundary, and V - E + F summed over them; parent [n_face], seen [n_edge_use] are scratch */
static void walk_sheets(const pal_cells *c, int32_t *parent, bool *seen, pal_cells_topology *out)
{
    int64_t n_vertex = 0, n_half = 0;
    for (int32_t f = 0; f < c->n_face; f++) parent[f] = pal_cells_face_boundary(c, f) ? f : -1;
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        if (c->edge_use[u].mate >= 0) continue;
        n_half++;
        pal_union_find_join(parent, pal_cells_face_of(c, u), pal_cells_face_of(c, pal_cells_across_edge(c, u)));
        if (seen[u]) continue;
        n_vertex++;
        int32_t at = u;
        do {
            seen[at] = true;
            at = pal_cells_across_edge(c, pal_cells_prev(c, at));
        } while (at != u);
    }
    out->n_sheet = count_roots(parent, c->n_face);
    out->sheet_euler = n_vertex - n_half / 2 + c->n_boundary_face;
}

pal_err pal_cells_find_topology(const pal_cells *cells, pal_cells_topology *out)
{
    const pal_cells *c = cells;
    pal_cells_topology t = {.euler = (int64_t)c->n_vertex - c->n_edge + c->n_face - c->n_cell};
    size_t n = (size_t)(c->n_face > c->n_cell ? c->n_face : c->n_cell);
    int32_t *parent = malloc((n + 1) * sizeof *parent);
    bool *seen = calloc((size_t)c->n_edge_use + 1, sizeof *seen);
    if (!parent || !seen) {
        free(parent);
        free(seen);
        return PAL_ERR_MEMORY;
    }
    pal_union_find_init(parent, c->n_cell);
    for (int32_t f = 0; f < c->n_face; f++)
        if (!pal_cells_face_boundary(c, f))
            pal_union_find_join(parent, c->face_use[c->face[f].use[0]].cell, c->face_use[c->face[f].use[1]].cell);
    t.n_piece = count_roots(parent, c->n_cell);
    walk_sheets(c, parent, seen, &t);
    t.n_cavity = t.n_sheet - t.n_piece;
    t.genus = (int32_t)(t.n_sheet - t.sheet_euler / 2);
    free(parent);
    free(seen);
    *out = t;
    return PAL_ERR_OK;
}

/* ---- the boundary as triangles ---- */

/* area of the triangle of three corners of a loop along the direction of the face's area */
static double next_boundary_edge(const pal_cells *c, int32_t first, int i, int j, int k, const double area[3])
{
    const double *a = c->x + 3 * (size_t)c->edge_use[first + i].vertex;
    double p[3], q[3], n[3];
    pal_sub3(p, c->x + 3 * (size_t)c->edge_use[first + j].vertex, a);
    pal_sub3(q, c->x + 3 * (size_t)c->edge_use[first + k].vertex, a);
    pal_cross3(n, p, q);
    return pal_dot3(n, area);
}

/* the corner from which a fan of triangles covers the face best */
static int fan_corner(const pal_cells *c, int32_t face)
{
    int32_t first, n = pal_cells_face_loop(c, face, &first);
    double area[3], best = -INFINITY;
    int corner = 0;
    if (n == 3) return 0;
    pal_cells_face_area(c, NULL, face, area);
    for (int i = 0; i < n; i++) {
        double worst = INFINITY;
        for (int k = 1; k + 1 < n; k++)
            worst = fmin(worst, next_boundary_edge(c, first, i, (i + k) % n, (i + k + 1) % n, area));
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

pal_err pal_cells_boundary(const pal_cells *cells, pal_surface *out, int32_t **vertex, int32_t **face)
{
    const pal_cells *c = cells;
    pal_surface s = {0};
    for (int32_t v = 0; v < c->n_vertex; v++) s.n_vertex += c->vertex_boundary[v];
    for (int32_t f = 0; f < c->n_face; f++) {
        int32_t first;
        if (pal_cells_face_boundary(c, f)) s.n_tri += pal_cells_face_loop(c, f, &first) - 2;
    }
    s.x = malloc(((size_t)s.n_vertex + 1) * 3 * sizeof *s.x);
    s.tri = malloc(((size_t)s.n_tri + 1) * 3 * sizeof *s.tri);
    int32_t *number = malloc(((size_t)c->n_vertex + 1) * sizeof *number);
    int32_t *old = malloc(((size_t)s.n_vertex + 1) * sizeof *old), *of = malloc(((size_t)s.n_tri + 1) * sizeof *of);
    bool ok = s.x && s.tri && number && old && of;
    if (ok) {
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
    free(number);
    free(old);
    free(of);
    return ok ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
