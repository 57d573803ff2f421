/* Edits of control cells that add or join cells (paper A section 4.1, Fig. 7): extrude, merge, bridge. */
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"
#include "server/mesh/geometry/tuning.h"

#include <stdlib.h>

static pal_err check_boundary_face(const pal_edit_work *w, int32_t face)
{
    const pal_cells *c = w->from;
    PAL_TRY(pal_edit_check_number(w, "face", face, c->n_face));
    if (pal_cells_face_boundary(c, face)) return PAL_ERR_OK;
    return pal_edit_refuse(w, "face %d lies between cells %d and %d, not on the boundary", face,
                           c->face_use[c->face[face].use[0]].cell, c->face_use[c->face[face].use[1]].cell);
}

/* The old cells and a prism on n corners: base runs as the boundary face it stands on, tip [n] as the base. Its loops:
 * base reversed, tip, sides. */
static void add_prism(pal_edit_work *w, int32_t n, const int32_t *base, const int32_t *tip, int32_t face)
{
    const pal_cells *c = w->from;
    pal_cell_loops *to = &w->to;
    pal_cell_loops_append(to, c, NULL, NULL);
    pal_cell_loops_cell(to);
    to->inside = true;
    pal_cell_loops_face(to, 0);
    for (int32_t k = n - 1; k >= 0; k--) pal_cell_loops_corners(to, &base[k], 1);
    pal_cell_loops_face(to, 0);
    pal_cell_loops_corners(to, tip, n);
    for (int32_t k = 0; k < n; k++) {
        int32_t next = k + 1 < n ? k + 1 : 0;
        pal_cell_loops_quad(to, 0, base[k], base[next], tip[next], tip[k]);
    }
    w->first_new = c->n_cell;
    w->cell_from[c->n_cell] = c->face_use[c->face[face].use[0]].cell;
}

static int32_t list_corners(const pal_cells *c, int32_t face, int32_t corner[PAL_CELL_LOOP_MAX])
{
    int32_t first, n = pal_cells_face_loop(c, face, &first);
    for (int32_t k = 0; k < n; k++) corner[k] = c->edge_use[first + k].vertex;
    return n;
}

pal_err pal_edit_extrude(pal_edit_work *w, int32_t face, double distance_m, double scale)
{
    const pal_cells *c = w->from;
    PAL_TRY(check_boundary_face(w, face));
    if (!(distance_m > 0 && distance_m <= MAX_COORDINATE_M))
        return pal_edit_refuse(w, "distance is %g m, must be above 0 and at most %g", distance_m, MAX_COORDINATE_M);
    if (!(scale > 0 && scale <= PAL_EXTRUDE_SCALE_MAX))
        return pal_edit_refuse(w, "scale is %g, must be above 0 and at most %g", scale, PAL_EXTRUDE_SCALE_MAX);
    int32_t base[PAL_CELL_LOOP_MAX], tip[PAL_CELL_LOOP_MAX], n = list_corners(c, face, base);
    double centre[3], along[3], out[3];
    PAL_TRY(pal_edit_reserve(w, c->n_vertex + n, c->n_cell + 1));
    pal_cells_face_centre(c, NULL, face, centre);
    pal_cells_face_area(c, NULL, face, along);
    pal_scale3(out, distance_m / pal_norm3(along), along);
    pal_edit_keep_vertices(w);
    for (int32_t k = 0; k < n; k++) {
        tip[k] = c->n_vertex + k;
        double *to = w->offset + 3 * (size_t)tip[k];
        pal_sub3(to, c->x + 3 * (size_t)base[k], centre);
        pal_scale3(to, scale - 1, to);
        pal_add3(to, to, out);
        pal_interpolation_builder_mean(&w->rows, &base[k], 1);
    }
    w->rotated_face = face;
    w->face_loop = c->n_face_use + 1;
    add_prism(w, n, base, tip, face);
    return PAL_ERR_OK;
}

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

static pal_err find_pairs(const pal_edit_work *w, int32_t face, int32_t other, pairs *p)
{
    const pal_cells *c = w->from;
    int32_t loop[PAL_CELL_LOOP_MAX];
    PAL_TRY(check_boundary_face(w, face));
    PAL_TRY(check_boundary_face(w, other));
    if (face == other) return pal_edit_refuse(w, "it is the same face twice");
    p->n = list_corners(c, face, p->a);
    int32_t n = list_corners(c, other, loop);
    if (n != p->n) return pal_edit_refuse(w, "they have %d and %d corners, must have equally many", p->n, n);
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = 0; k < n; k++)
            if (p->a[i] == loop[k]) return pal_edit_refuse(w, "they have vertex %d in common", loop[k]);
    pair_corners(c, loop, p);
    return PAL_ERR_OK;
}

/* no edge between a pair: merging would leave its cells without it */
static pal_err check_apart(const pal_edit_work *w, const pairs *p)
{
    const pal_cells *c = w->from;
    for (int32_t i = 0; i < p->n; i++)
        for (int32_t k = c->vertex_edge.start[p->a[i]]; k < c->vertex_edge.start[p->a[i] + 1]; k++) {
            int32_t e = c->vertex_edge.item[k];
            if (c->edge[e].vertex[0] == p->b[i] || c->edge[e].vertex[1] == p->b[i])
                return pal_edit_refuse(w, "edge %d joins their vertices %d and %d and would vanish", e, p->a[i],
                                       p->b[i]);
        }
    return PAL_ERR_OK;
}

/* each pair takes the lower number, later ones move up; map [n_vertex] */
static void add_merged(pal_edit_work *w, const pairs *p, int32_t *map)
{
    const pal_cells *c = w->from;
    for (int32_t v = 0; v < c->n_vertex; v++) map[v] = v;
    for (int32_t k = 0; k < p->n; k++) map[p->a[k]] = p->b[k], map[p->b[k]] = p->a[k];
    for (int32_t v = 0, n = 0; v < c->n_vertex; v++) {
        int32_t pair[2] = {v, map[v]};
        if (map[v] < v)
            map[v] = map[map[v]];
        else {
            pal_interpolation_builder_mean(&w->rows, pair, 1 + (map[v] > v));
            map[v] = n++;
        }
        float *sharp = &w->to.vertex_sharpness[map[v]];
        *sharp = fmaxf(*sharp, c->vertex_sharpness[v]);
    }
    pal_cell_loops_append(&w->to, c, NULL, map);
}

pal_err pal_edit_merge(pal_edit_work *w, int32_t face, int32_t other_face)
{
    pairs p;
    PAL_TRY(find_pairs(w, face, other_face, &p));
    PAL_TRY(check_apart(w, &p));
    PAL_TRY(pal_edit_reserve(w, w->from->n_vertex - p.n, w->from->n_cell));
    int32_t *map = malloc((size_t)w->from->n_vertex * sizeof *map);
    if (!map) return PAL_ERR_MEMORY;
    add_merged(w, &p, map);
    w->face_loop = w->from->face[face].use[0];
    free(map);
    return PAL_ERR_OK;
}

pal_err pal_edit_bridge(pal_edit_work *w, int32_t face, int32_t other_face)
{
    pairs p;
    PAL_TRY(find_pairs(w, face, other_face, &p));
    PAL_TRY(pal_edit_reserve(w, w->from->n_vertex, w->from->n_cell + 1));
    pal_edit_keep_vertices(w);
    add_prism(w, p.n, p.a, p.b, face);
    return PAL_ERR_OK;
}
