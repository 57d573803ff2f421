/* Edits of control cells that add or join cells (paper A section 4.1, Fig. 7): extrude, merge, bridge. */
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* rows of the old vertices, each itself */
static void add_identity_rows(pal_edit_work *w)
{
    for (int32_t v = 0; v < w->from->n_vertex; v++) {
        pal_interpolation_builder_add(&w->rows, v, 1);
        pal_interpolation_builder_end_row(&w->rows);
    }
}

static pal_err check_boundary_face(const pal_edit_work *w, int32_t face, pal_diagnostic *diag)
{
    PAL_TRY(pal_edit_check_number(w, "face", face, w->from->n_face, diag));
    if (pal_cells_face_boundary(w->from, face)) return PAL_ERR_OK;
    return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: face %d lies between cells %d and %d, not on the boundary",
                              w->what, face, w->from->face_use[w->from->face[face].use[0]].cell,
                              w->from->face_use[w->from->face[face].use[1]].cell);
}

/* A prism on n corners: base runs as the boundary face it stands on, tip [n] as the base. Its loops: base reversed,
 * tip, sides. */
static void add_prism(pal_edit_work *w, int32_t n, const int32_t *base, const int32_t *tip, int32_t cell_from)
{
    for (int32_t k = n - 1; k >= 0; k--) pal_edit_corner(w, base[k]);
    pal_edit_end_loop(w, 0);
    for (int32_t k = 0; k < n; k++) pal_edit_corner(w, tip[k]);
    pal_edit_end_loop(w, 0);
    for (int32_t k = 0; k < n; k++) {
        int32_t next = k + 1 < n ? k + 1 : 0;
        pal_edit_corner(w, base[k]);
        pal_edit_corner(w, base[next]);
        pal_edit_corner(w, tip[next]);
        pal_edit_corner(w, tip[k]);
        pal_edit_end_loop(w, 0);
    }
    pal_edit_end_cell(w, cell_from);
}

/* room for one prism of n corners and more vertices */
static pal_err reserve_prism(pal_edit_work *w, int32_t n, int32_t more, pal_diagnostic *diag)
{
    const pal_cells *c = w->from;
    return pal_edit_reserve(w, (int64_t)c->n_vertex + more, (int64_t)c->n_cell + 1, (int64_t)c->n_face_use + n + 2,
                            (int64_t)c->n_edge_use + 6 * n, diag);
}

static int32_t list_corners(const pal_cells *c, int32_t face, int32_t corner[PAL_CELL_LOOP_MAX])
{
    int32_t first, n = pal_cells_face_loop(c, face, &first);
    for (int32_t k = 0; k < n; k++) corner[k] = c->edge_use[first + k].vertex;
    return n;
}

/* ---- extrude ---- */

static void add_extruded(pal_edit_work *w, int32_t face, double distance_m, double scale)
{
    const pal_cells *c = w->from;
    int32_t base[PAL_CELL_LOOP_MAX], tip[PAL_CELL_LOOP_MAX], n = list_corners(c, face, base);
    double centre[3], along[3], out[3];
    pal_cells_face_centre(c, NULL, face, centre);
    pal_cells_face_area(c, NULL, face, along);
    pal_scale3(out, distance_m / pal_norm3(along), along);
    add_identity_rows(w);
    for (int32_t k = 0; k < n; k++) {
        tip[k] = c->n_vertex + k;
        double *to = w->offset + 3 * (size_t)tip[k];
        pal_sub3(to, c->x + 3 * (size_t)base[k], centre);
        pal_scale3(to, scale - 1, to);
        pal_add3(to, to, out);
        pal_interpolation_builder_add(&w->rows, base[k], 1);
        pal_interpolation_builder_end_row(&w->rows);
    }
    pal_edit_copy_old(w, NULL);
    w->first_new = c->n_cell, w->rotated_face = face;
    w->face_loop = c->n_face_use + 1;
    add_prism(w, n, base, tip, c->face_use[c->face[face].use[0]].cell);
}

pal_err pal_cells_extrude(const pal_cells *from, int32_t face, double distance_m, double scale, pal_cells_edit *out,
                          pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "extrude face %d", face);
    int32_t first;
    memset(out, 0, sizeof *out);
    PAL_TRY(check_boundary_face(&w, face, diag));
    if (!(distance_m > 0 && distance_m <= 1e9))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: distance is %g m, must be above 0 and at most 1e9",
                                  w.what, distance_m);
    if (!(scale > 0 && scale <= PAL_EXTRUDE_SCALE_MAX))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: scale is %g, must be above 0 and at most %g", w.what,
                                  scale, PAL_EXTRUDE_SCALE_MAX);
    int32_t n = pal_cells_face_loop(from, face, &first);
    pal_err err = reserve_prism(&w, n, n, diag);
    if (!err) add_extruded(&w, face, distance_m, scale);
    return pal_edit_finish(&w, err, out, diag);
}

/* ---- merge, bridge ---- */

/* Corners of two faces: b[k] is paired with a[k]. The loops run opposite ways; of the n cyclic shifts the nearest is
 * taken. */
typedef struct pairs {
    int32_t n, a[PAL_CELL_LOOP_MAX], b[PAL_CELL_LOOP_MAX];
} pairs;

static void pair_corners(const pal_cells *c, const int32_t *loop, pairs *p)
{
    double best = INFINITY;
    int32_t turn = 0, n = p->n;
    for (int32_t t = 0; t < n; t++) {
        double sum = 0;
        for (int32_t k = 0; k < n; k++) {
            double d = pal_dist3(c->x + 3 * (size_t)p->a[k], c->x + 3 * (size_t)loop[(t + n - k) % n]);
            sum += d * d;
        }
        if (sum < best) best = sum, turn = t;
    }
    for (int32_t k = 0; k < n; k++) p->b[k] = loop[(turn + n - k) % n];
}

static pal_err find_pairs(const pal_edit_work *w, int32_t face, int32_t other, pairs *p, pal_diagnostic *diag)
{
    const pal_cells *c = w->from;
    int32_t loop[PAL_CELL_LOOP_MAX];
    PAL_TRY(check_boundary_face(w, face, diag));
    PAL_TRY(check_boundary_face(w, other, diag));
    if (face == other) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: it is the same face twice", w->what);
    p->n = list_corners(c, face, p->a);
    int32_t n = list_corners(c, other, loop);
    if (n != p->n)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: they have %d and %d corners, must have equally many",
                                  w->what, p->n, n);
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = 0; k < n; k++)
            if (p->a[i] == loop[k])
                return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: they have vertex %d in common", w->what, loop[k]);
    pair_corners(c, loop, p);
    return PAL_ERR_OK;
}

/* no edge between a pair: merging would leave its cells without it */
static pal_err check_apart(const pal_edit_work *w, const pairs *p, pal_diagnostic *diag)
{
    const pal_cells *c = w->from;
    for (int32_t i = 0; i < p->n; i++)
        for (int32_t k = c->vertex_edge.start[p->a[i]]; k < c->vertex_edge.start[p->a[i] + 1]; k++) {
            int32_t e = c->vertex_edge.item[k];
            if (c->edge[e].vertex[0] == p->b[i] || c->edge[e].vertex[1] == p->b[i])
                return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                          "%s: edge %d joins their vertices %d and %d and would vanish", w->what, e,
                                          p->a[i], p->b[i]);
        }
    return PAL_ERR_OK;
}

/* each pair takes the lower number, later ones move up */
static void add_merged(pal_edit_work *w, const pairs *p)
{
    const pal_cells *c = w->from;
    int32_t *map = w->map, n = 0;
    for (int32_t v = 0; v < c->n_vertex; v++) map[v] = -1;
    for (int32_t k = 0; k < p->n; k++) {
        int32_t low = p->a[k] < p->b[k] ? p->a[k] : p->b[k];
        map[p->a[k] + p->b[k] - low] = -2 - low;
        map[low] = -2 - (p->a[k] + p->b[k] - low);
    }
    for (int32_t v = 0; v < c->n_vertex; v++) {
        int32_t mate = map[v] < -1 ? -2 - map[v] : v;
        if (mate < v) {
            map[v] = map[mate];
            continue;
        }
        pal_interpolation_builder_add(&w->rows, v, mate == v ? 1 : 0.5);
        if (mate != v) pal_interpolation_builder_add(&w->rows, mate, 0.5);
        pal_interpolation_builder_end_row(&w->rows);
        map[v] = n++;
    }
    pal_edit_copy_old(w, map);
}

pal_err pal_cells_merge(const pal_cells *from, int32_t face, int32_t other_face, pal_cells_edit *out,
                        pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "merge faces %d and %d", face, other_face);
    pairs p;
    memset(out, 0, sizeof *out);
    PAL_TRY(find_pairs(&w, face, other_face, &p, diag));
    PAL_TRY(check_apart(&w, &p, diag));
    pal_err err = pal_edit_reserve(&w, from->n_vertex - p.n, from->n_cell, from->n_face_use, from->n_edge_use, diag);
    if (!err) {
        add_merged(&w, &p);
        w.face_loop = from->face[face].use[0];
    }
    return pal_edit_finish(&w, err, out, diag);
}

pal_err pal_cells_bridge(const pal_cells *from, int32_t face, int32_t other_face, pal_cells_edit *out,
                         pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "bridge faces %d and %d", face, other_face);
    pairs p;
    memset(out, 0, sizeof *out);
    PAL_TRY(find_pairs(&w, face, other_face, &p, diag));
    pal_err err = reserve_prism(&w, p.n, 0, diag);
    if (!err) {
        add_identity_rows(&w);
        pal_edit_copy_old(&w, NULL);
        w.first_new = from->n_cell;
        add_prism(&w, p.n, p.a, p.b, from->face_use[from->face[face].use[0]].cell);
    }
    return pal_edit_finish(&w, err, out, diag);
}
