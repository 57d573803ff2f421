/* MacCracken-Joy subdivision (paper A section 3.1), after MacCracken, Joy, "Free-form deformations with lattices of
 * arbitrary topology" (SIGGRAPH 1996). All weights are on the old vertices; C = mean of a cell's vertices, F = mean of
 * a face's corners, M = midpoint of an edge, P = the vertex, (..) = mean over all those at the place:
 *
 *            inside                                  boundary (Catmull, Clark 1978)         sharp
 *   cell     C
 *   face     (C0 + 2 F + C1)/4                       F                                      F
 *   edge     ((C) + 2 (F) + (n-3) M)/n, n faces      (P1 + P2 + F1 + F2)/4                  M
 *   vertex   ((C) + 3 (F) + 3 (M) + P)/8             ((F) + 2 (M) + (n-3) P)/n, n faces     crease (P1 + 6 P + P2)/8,
 *                                                                                           corner P
 *
 * PAL_SUBDIVISION_AVERAGING (Bajaj, Schaefer, Warren, Xu 2002) replaces the first two columns: mean of the centroids of
 * the new cells, or of the new quads of the boundary, at the place, when the cells are cut without moving anything.
 *
 * The paper gives no rules ("in the interest of brevity") and only names "local changes to the subdivision rules".
 * Departure from DeRose, Kass, Truong (SIGGRAPH 1998): at a vertex with sharp edges of s1 >= s2 >= s3 >= ..., all cut
 * off at 1, the blend is s3 corner + (s2 - s3) crease of the two sharpest + (1 - s2) smooth instead of one by the mean
 * sharpness, so that nothing jumps when an edge begins to be sharpened. Equal sharpnesses give the same. */
#include "server/mesh/cells/maccracken_joy.h"

#include "server/mesh/geometry/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* one level in the making: the old cells, the rows, and where each new kind of vertex begins */
typedef struct level {
    const pal_cells *c;
    pal_interpolation_builder *row;
    bool averaging;
    int32_t first_edge, first_face, first_cell, n_vertex;
} level;

static level level_of(const pal_cells *c)
{
    level l = {.c = c, .first_edge = c->n_vertex};
    l.first_face = l.first_edge + c->n_edge;
    l.first_cell = l.first_face + c->n_face;
    l.n_vertex = l.first_cell + c->n_cell;
    return l;
}

/* ---- weights: s times a point, added to the open row ---- */

static void add_mid(const level *l, int32_t e, double s)
{
    for (int k = 0; k < 2; k++) pal_interpolation_builder_add(l->row, l->c->edge[e].vertex[k], s / 2);
}

static void add_face(const level *l, int32_t f, double s)
{
    int32_t first, n = pal_cells_face_loop(l->c, f, &first);
    for (int32_t k = 0; k < n; k++) pal_interpolation_builder_add(l->row, l->c->edge_use[first + k].vertex, s / n);
}

static void add_cell(const level *l, int32_t cell, double s)
{
    const pal_cell_rows *r = &l->c->cell_vertex;
    int32_t n = r->start[cell + 1] - r->start[cell];
    for (int32_t k = r->start[cell]; k < r->start[cell + 1]; k++)
        pal_interpolation_builder_add(l->row, r->item[k], s / n);
}

/* centroid of the new cell of entry k of cell_vertex before anything moves: the vertex, its edges' midpoints, its
 * faces, C */
static void add_part(const level *l, int32_t cell, int32_t k, double s)
{
    const pal_cells *c = l->c;
    int32_t first = c->corner_use[k], use = first, n = 0;
    do n++, use = pal_cells_next_around(c, use);
    while (use != first);
    s /= 2 * n + 2;
    pal_interpolation_builder_add(l->row, c->cell_vertex.item[k], s);
    add_cell(l, cell, s);
    do {
        add_mid(l, c->edge_use[use].edge, s);
        add_face(l, pal_cells_face_of(c, use), s);
        use = pal_cells_next_around(c, use);
    } while (use != first);
}

/* the same of the new quad of a face at the corner of an edge use */
static void add_quad(const level *l, int32_t use, double s)
{
    const pal_cells *c = l->c;
    pal_interpolation_builder_add(l->row, c->edge_use[use].vertex, s / 4);
    add_mid(l, c->edge_use[use].edge, s / 4);
    add_mid(l, c->edge_use[pal_cells_prev(c, use)].edge, s / 4);
    add_face(l, pal_cells_face_of(c, use), s / 4);
}

/* entry of a vertex among its cell's */
static int32_t corner_of(const pal_cells *c, int32_t cell, int32_t vertex)
{
    int32_t k = c->cell_vertex.start[cell];
    while (c->cell_vertex.item[k] != vertex) k++;
    return k;
}

/* the edge use of a face that starts at a vertex, from the first cell's side */
static int32_t face_corner(const pal_cells *c, int32_t face, int32_t vertex)
{
    int32_t use;
    pal_cells_face_loop(c, face, &use);
    while (c->edge_use[use].vertex != vertex) use++;
    return use;
}

/* ---- the four rules; s is the weight that the row's other rules leave ---- */

static void cell_rule(const level *l, int32_t cell)
{
    const int32_t *start = l->c->cell_vertex.start + cell;
    if (!l->averaging) add_cell(l, cell, 1);
    for (int32_t k = start[0]; k < start[1] && l->averaging; k++) add_part(l, cell, k, 1.0 / (start[1] - start[0]));
}

static void face_rule(const level *l, int32_t f)
{
    const pal_cells *c = l->c;
    double sharp = pal_cells_face_boundary(c, f) ? 1 : fmin(c->face[f].sharp, 1), s = 1 - sharp;
    if (sharp > 0) add_face(l, f, sharp);
    if (s <= 0) return;
    int32_t first, n = pal_cells_face_loop(c, f, &first);
    if (!l->averaging) add_face(l, f, s / 2);
    for (int side = 0; side < 2; side++) {
        int32_t cell = c->face_use[c->face[f].use[side]].cell;
        if (!l->averaging) add_cell(l, cell, s / 4);
        for (int32_t k = 0; k < n && l->averaging; k++)
            add_part(l, cell, corner_of(c, cell, c->edge_use[first + k].vertex), s / (2 * n));
    }
}

static void boundary_edge(const level *l, int32_t e, double s)
{
    const pal_cells *c = l->c;
    if (!l->averaging) add_mid(l, e, s / 2);
    for (int32_t k = c->edge_face.start[e]; k < c->edge_face.start[e + 1]; k++) {
        int32_t f = c->edge_face.item[k];
        if (!pal_cells_face_boundary(c, f)) continue;
        if (!l->averaging) add_face(l, f, s / 4);
        for (int end = 0; end < 2 && l->averaging; end++) add_quad(l, face_corner(c, f, c->edge[e].vertex[end]), s / 4);
    }
}

static void inner_edge(const level *l, int32_t e, double s)
{
    const pal_cells *c = l->c;
    int32_t n = c->edge_face.start[e + 1] - c->edge_face.start[e];
    int32_t n_cell = c->edge_cell.start[e + 1] - c->edge_cell.start[e];
    for (int32_t k = c->edge_cell.start[e]; k < c->edge_cell.start[e + 1]; k++) {
        int32_t cell = c->edge_cell.item[k];
        if (!l->averaging) add_cell(l, cell, s / n / n_cell);
        for (int end = 0; end < 2 && l->averaging; end++)
            add_part(l, cell, corner_of(c, cell, c->edge[e].vertex[end]), s / (2 * n_cell));
    }
    if (l->averaging) return;
    for (int32_t k = c->edge_face.start[e]; k < c->edge_face.start[e + 1]; k++)
        add_face(l, c->edge_face.item[k], 2 * s / n / n);
    add_mid(l, e, s * (n - 3) / n);
}

static void edge_rule(const level *l, int32_t e)
{
    const pal_cell_edge *edge = &l->c->edge[e];
    double sharp = edge->pinched ? 1 : fmin(edge->sharp, 1);
    if (sharp > 0) add_mid(l, e, sharp);
    if (sharp >= 1) return;
    if (edge->boundary)
        boundary_edge(l, e, 1 - sharp);
    else
        inner_edge(l, e, 1 - sharp);
}

static void boundary_vertex(const level *l, int32_t v, double s)
{
    const pal_cells *c = l->c;
    const pal_cell_rows *faces = &c->vertex_face, *edges = &c->vertex_edge;
    int32_t n = 0;
    for (int32_t k = faces->start[v]; k < faces->start[v + 1]; k++) n += pal_cells_face_boundary(c, faces->item[k]);
    for (int32_t k = faces->start[v]; k < faces->start[v + 1]; k++) {
        int32_t f = faces->item[k];
        if (!pal_cells_face_boundary(c, f)) continue;
        if (l->averaging)
            add_quad(l, face_corner(c, f, v), s / n);
        else
            add_face(l, f, s / n / n);
    }
    if (l->averaging) return;
    for (int32_t k = edges->start[v]; k < edges->start[v + 1]; k++)
        if (c->edge[edges->item[k]].boundary) add_mid(l, edges->item[k], 2 * s / n / n);
    pal_interpolation_builder_add(l->row, v, s * (n - 3) / n);
}

static void inner_vertex(const level *l, int32_t v, double s)
{
    const pal_cells *c = l->c;
    const pal_cell_rows *cells = &c->vertex_cell, *faces = &c->vertex_face, *edges = &c->vertex_edge;
    int32_t n_cell = cells->start[v + 1] - cells->start[v], n_face = faces->start[v + 1] - faces->start[v];
    int32_t n_edge = edges->start[v + 1] - edges->start[v];
    for (int32_t k = cells->start[v]; k < cells->start[v + 1]; k++) {
        int32_t cell = cells->item[k];
        if (l->averaging)
            add_part(l, cell, corner_of(c, cell, v), s / n_cell);
        else
            add_cell(l, cell, s / 8 / n_cell);
    }
    if (l->averaging) return;
    for (int32_t k = faces->start[v]; k < faces->start[v + 1]; k++) add_face(l, faces->item[k], 3 * s / 8 / n_face);
    for (int32_t k = edges->start[v]; k < edges->start[v + 1]; k++) add_mid(l, edges->item[k], 3 * s / 8 / n_edge);
    pal_interpolation_builder_add(l->row, v, s / 8);
}

/* the sharp edges at a vertex: the sharpest two, and the sharpnesses of the sharpest three, at most 1 */
typedef struct crease {
    int32_t edge[2];
    double sharp[3];
} crease;

static crease crease_at(const pal_cells *c, int32_t v)
{
    crease at = {{-1, -1}, {0, 0, 0}};
    float best[3] = {0, 0, 0};
    int32_t edge[3] = {-1, -1, -1};
    for (int32_t k = c->vertex_edge.start[v]; k < c->vertex_edge.start[v + 1]; k++) {
        int32_t e = c->vertex_edge.item[k];
        float s = c->edge[e].sharp;
        if (c->vertex_boundary[v] && !c->edge[e].boundary) continue;
        for (int m = 0; m < 3; m++)
            if (s > best[m]) {
                for (int t = 2; t > m; t--) best[t] = best[t - 1], edge[t] = edge[t - 1];
                best[m] = s, edge[m] = e;
                break;
            }
    }
    for (int m = 0; m < 3; m++) at.sharp[m] = fmin(best[m], 1);
    at.edge[0] = edge[0], at.edge[1] = edge[1];
    return at;
}

static void vertex_rule(const level *l, int32_t v)
{
    const pal_cells *c = l->c;
    double stay = c->vertex_pinched[v] ? 1 : fmin(c->vertex_sharpness[v], 1), s = 1 - stay;
    crease at = crease_at(c, v);
    stay += s * at.sharp[2];
    if (stay > 0) pal_interpolation_builder_add(l->row, v, stay);
    double on = s * (at.sharp[1] - at.sharp[2]), smooth = s * (1 - at.sharp[1]);
    if (on > 0) {
        /* (P1 + 6 P + P2)/8 by the two midpoints */
        pal_interpolation_builder_add(l->row, v, on / 2);
        for (int k = 0; k < 2; k++) add_mid(l, at.edge[k], on / 4);
    }
    if (smooth <= 0) return;
    if (c->vertex_boundary[v])
        boundary_vertex(l, v, smooth);
    else
        inner_vertex(l, v, smooth);
}

/* the level's rows, in the order of the new vertices */
static pal_err make_rows(const pal_cells *c, bool averaging, int64_t max_entry, pal_interpolation *out)
{
    pal_interpolation_builder build;
    level l = level_of(c);
    l.row = &build, l.averaging = averaging;
    pal_interpolation_builder_begin(&build, l.n_vertex, c->n_vertex, max_entry);
    for (int32_t i = 0; i < l.n_vertex && !build.err; i++) {
        if (i < l.first_edge)
            vertex_rule(&l, i);
        else if (i < l.first_face)
            edge_rule(&l, i - l.first_edge);
        else if (i < l.first_cell)
            face_rule(&l, i - l.first_face);
        else
            cell_rule(&l, i - l.first_cell);
        pal_interpolation_builder_end_row(&build);
    }
    return pal_interpolation_builder_finish(&build, out);
}

/* ---- the new cells ---- */

/* sharpness that remains a level later */
static float after(float s)
{
    return s >= PAL_SHARPNESS_MAX ? PAL_SHARPNESS_MAX : s > 1 ? s - 1 : 0;
}

/* loops, origins of the cells and of the loops (a control face, or -1); the tags come after */
static void fill_loops(const pal_cells *c, pal_cell_loops *to, const int32_t *cell_from, const int32_t *face_from,
                       int32_t *cell_origin, int32_t *loop_origin)
{
    const level l = level_of(c);
    int32_t n_loop = 0, n_corner = 0;
    for (int32_t cell = 0, k = 0; cell < c->n_cell; cell++)
        for (; k < c->cell_vertex.start[cell + 1]; k++) {
            int32_t first = c->corner_use[k], use = first, v = c->cell_vertex.item[k], *loop;
            to->cell[k] = n_loop;
            cell_origin[k] = cell_from[cell];
            /* the outer quads lie in the old faces, from the vertex along each edge */
            do {
                int32_t before = pal_cells_prev(c, use), f = pal_cells_face_of(c, use);
                loop = to->corner + n_corner;
                loop[0] = v, loop[1] = l.first_edge + c->edge_use[use].edge;
                loop[2] = l.first_face + f, loop[3] = l.first_edge + c->edge_use[before].edge;
                loop_origin[n_loop] = face_from[f];
                to->loop[n_loop++] = n_corner, n_corner += 4;
                use = pal_cells_next_around(c, use);
            } while (use != first);
            /* the inner quads cross the edges: from the face on their left to the one on their right */
            do {
                int32_t right = pal_cells_face_of(c, c->edge_use[use].radial), f = pal_cells_face_of(c, use);
                loop = to->corner + n_corner;
                loop[0] = l.first_edge + c->edge_use[use].edge, loop[1] = l.first_face + right;
                loop[2] = l.first_cell + cell, loop[3] = l.first_face + f;
                loop_origin[n_loop] = -1;
                to->loop[n_loop++] = n_corner, n_corner += 4;
                use = pal_cells_next_around(c, use);
            } while (use != first);
        }
    to->cell[to->n_cell] = n_loop;
    to->loop[n_loop] = n_corner;
}

/* both halves of sharp edges, all parts of sharp faces; returns how many of each, to may have no room yet */
static void fill_tags(const pal_cells *c, pal_cell_loops *to)
{
    const level l = level_of(c);
    to->n_edge_tag = to->n_face_tag = 0;
    for (int32_t e = 0; e < c->n_edge; e++)
        for (int end = 0; end < 2 && after(c->edge[e].sharp) > 0; end++, to->n_edge_tag++)
            if (to->edge_tag)
                to->edge_tag[to->n_edge_tag] =
                    (pal_cell_tag){c->edge[e].vertex[end], l.first_edge + e, after(c->edge[e].sharp)};
    /* the outer quad of a corner: loops of new cells stand 2 k a corner, in the order of turn */
    for (int32_t k = 0; k < c->cell_vertex.start[c->n_cell]; k++) {
        int32_t use = c->corner_use[k], n = 0;
        do {
            int32_t f = pal_cells_face_of(c, use);
            bool own = c->face[f].use[0] == c->edge_use[use].face_use;
            if (own && after(c->face[f].sharp) > 0) {
                if (to->face_tag)
                    to->face_tag[to->n_face_tag] = (pal_cell_tag){to->cell[k] + n, 0, after(c->face[f].sharp)};
                to->n_face_tag++;
            }
            n++, use = pal_cells_next_around(c, use);
        } while (use != c->corner_use[k]);
    }
    if (to->vertex_sharpness)
        for (int32_t v = 0; v < c->n_vertex; v++) to->vertex_sharpness[v] = after(c->vertex_sharpness[v]);
}

/* arrays of the level's loops, filled but for positions; loop_origin [4 n_face_use .. all loops], cell_origin */
static pal_err make_loops(const pal_cells *c, const pal_subdivision *from, pal_cell_loops *to, int32_t **cell_origin,
                          int32_t **loop_origin)
{
    size_t n_corner = 8 * (size_t)c->n_edge_use, n_loop = 2 * (size_t)c->n_edge_use;
    memset(to, 0, sizeof *to);
    to->n_vertex = level_of(c).n_vertex, to->n_cell = c->cell_vertex.start[c->n_cell];
    to->x = malloc(3 * (size_t)to->n_vertex * sizeof *to->x);
    to->cell = malloc(((size_t)to->n_cell + 1) * sizeof *to->cell);
    to->loop = malloc((n_loop + 1) * sizeof *to->loop);
    to->corner = malloc(n_corner * sizeof *to->corner);
    to->vertex_sharpness = calloc((size_t)to->n_vertex, sizeof *to->vertex_sharpness);
    *cell_origin = malloc((size_t)to->n_cell * sizeof **cell_origin);
    *loop_origin = malloc(n_loop * sizeof **loop_origin);
    if (!to->x || !to->cell || !to->loop || !to->corner || !to->vertex_sharpness || !*cell_origin || !*loop_origin)
        return PAL_ERR_MEMORY;
    fill_loops(c, to, from->cell_origin, from->face_origin, *cell_origin, *loop_origin);
    fill_tags(c, to);
    to->edge_tag = malloc((size_t)to->n_edge_tag * sizeof *to->edge_tag + 1);
    to->face_tag = malloc((size_t)to->n_face_tag * sizeof *to->face_tag + 1);
    if (!to->edge_tag || !to->face_tag) return PAL_ERR_MEMORY;
    fill_tags(c, to);
    return PAL_ERR_OK;
}

/* ---- level after level ---- */

/* sizes of a complex; corner: of all faces, each once */
typedef struct sizes {
    double vertex, edge, face, cell, face_use, edge_use, corner, cell_vertex;
} sizes;

static sizes sizes_of(const pal_cells *c)
{
    return (sizes){c->n_vertex,
                   c->n_edge,
                   c->n_face,
                   c->n_cell,
                   c->n_face_use,
                   c->n_edge_use,
                   c->vertex_face.start[c->n_vertex],
                   c->cell_vertex.start[c->n_cell]};
}

static sizes sizes_after(const sizes *s)
{
    sizes n = {.vertex = s->vertex + s->edge + s->face + s->cell, .cell = s->cell_vertex};
    n.edge = 2 * s->edge + s->corner + s->face_use;
    n.face = s->corner + s->edge_use / 2;
    n.face_use = 2 * s->edge_use, n.edge_use = 8 * s->edge_use;
    n.corner = 4 * n.face;
    /* a part with 2 k quads has 2 k + 2 vertices, and the k sum to the edge uses */
    n.cell_vertex = 2 * s->edge_use + 2 * n.cell;
    return n;
}

/* memory of a complex of these sizes */
static double bytes_of(const sizes *s)
{
    double edge_use = sizeof(pal_edge_use) + sizeof(int32_t);
    double incidence = 2 * s->edge + 2 * s->corner + 2 * s->cell_vertex + s->edge_use / 2 + 2 * s->vertex;
    return s->vertex * (6 * sizeof(double) + 16) + s->edge * (sizeof(pal_cell_edge) + 8) +
           s->face * (sizeof(pal_cell_face) + 4) + s->face_use * (sizeof(pal_face_use) + 8) + s->edge_use * edge_use +
           s->cell * 16 + incidence * sizeof(int32_t);
}

/* and while it is made: loops, origins, tables */
static double making_bytes_of(const sizes *s)
{
    return bytes_of(s) + 40 * s->edge_use + 8 * s->face_use + 24 * s->vertex;
}

static double rows_bytes(double entries)
{
    return entries * (sizeof(int32_t) + sizeof(double));
}

static pal_err refuse(double byte, double budget, int at, const pal_subdivision_options *o, pal_diagnostic *diag)
{
    return pal_diagnostic_set(
        diag, PAL_ERR_BUDGET,
        "subdivision: level %d of %d needs %.4g MiB, the budget is %.4g MiB: ask for fewer levels", at, o->n_level,
        byte / 1048576, budget / 1048576);
}

/* control face of each face of the new complex, whose loops' are known */
static pal_err name_faces(const pal_cells *c, const int32_t *loop_origin, int32_t **out)
{
    int32_t *origin = malloc((size_t)c->n_face * sizeof *origin);
    if (!origin) return PAL_ERR_MEMORY;
    for (int32_t u = 0; u < c->n_face_use; u++) origin[c->face_use[u].face] = loop_origin[u];
    *out = origin;
    return PAL_ERR_OK;
}

/* replaces s by its next level; s is unchanged on failure */
static pal_err refine(pal_subdivision *s, const pal_subdivision_options *o, double budget, pal_diagnostic *diag)
{
    pal_subdivision next = {.n_level = s->n_level + 1};
    pal_cell_loops loops = {0};
    pal_interpolation step = {0};
    int32_t *loop_origin = NULL;
    pal_diagnostic reason = {""};
    sizes now = sizes_of(&s->cells), then = sizes_after(&now);
    /* a lower bound: the rows of a level have at least one entry each; the rest is counted as they are made */
    double byte = bytes_of(&now) + making_bytes_of(&then), rows = rows_bytes(s->rows.start[s->rows.n_row]);
    if (byte + rows + 2 * rows_bytes(then.vertex) > budget || then.edge_use > INT32_MAX || then.edge > INT32_MAX / 4)
        return refuse(byte + rows + 2 * rows_bytes(then.vertex), budget, next.n_level, o, diag);
    double room = (budget - byte - rows) / rows_bytes(1);
    pal_err err = make_rows(&s->cells, o->rule == PAL_SUBDIVISION_AVERAGING, (int64_t)room, &step);
    if (!err) {
        room -= step.start[step.n_row];
        err = pal_interpolation_product(&step, &s->rows, (int64_t)room, &next.rows);
    }
    if (err == PAL_ERR_BUDGET)
        pal_diagnostic_set(diag, err, "subdivision: level %d of %d needs more than %.4g MiB", next.n_level, o->n_level,
                           budget / 1048576);
    if (!err) err = make_loops(&s->cells, s, &loops, &next.cell_origin, &loop_origin);
    if (!err) {
        pal_interpolation_apply(&step, s->cells.x, loops.x);
        err = pal_cells_make(&loops, &next.cells, &reason);
        if (err && reason.text[0])
            pal_diagnostic_set(diag, err, "subdivision: level %d: %s", next.n_level, reason.text);
    }
    if (!err) err = name_faces(&next.cells, loop_origin, &next.face_origin);
    pal_interpolation_free(&step);
    pal_cell_loops_free(&loops);
    free(loop_origin);
    if (err) {
        pal_subdivision_free(&next);
        return err;
    }
    pal_subdivision_free(s);
    *s = next;
    s->n_byte = (size_t)bytes_of(&then) + pal_interpolation_bytes(&s->rows);
    return PAL_ERR_OK;
}

/* level 0: the control cells, each its own origin */
static pal_err begin(const pal_cells *control, pal_subdivision *s)
{
    PAL_TRY(pal_cells_copy(control, &s->cells));
    PAL_TRY(pal_interpolation_identity(control->n_vertex, &s->rows));
    s->cell_origin = malloc((size_t)control->n_cell * sizeof *s->cell_origin);
    s->face_origin = malloc((size_t)control->n_face * sizeof *s->face_origin);
    if (!s->cell_origin || !s->face_origin) return PAL_ERR_MEMORY;
    for (int32_t c = 0; c < control->n_cell; c++) s->cell_origin[c] = c;
    for (int32_t f = 0; f < control->n_face; f++) s->face_origin[f] = f;
    sizes size = sizes_of(control);
    s->n_byte = (size_t)bytes_of(&size) + pal_interpolation_bytes(&s->rows);
    return PAL_ERR_OK;
}

pal_err pal_subdivision_make(const pal_cells *control, const pal_subdivision_options *options, pal_subdivision *out,
                             pal_diagnostic *diag)
{
    pal_subdivision s = {0};
    double budget = (double)(options->budget_byte ? options->budget_byte : HIERARCHY_BUDGET_BYTE);
    if (options->n_level < 0 || options->n_level > PAL_SUBDIVISION_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "subdivision: %d levels asked for, 0 to %d are made",
                                  options->n_level, PAL_SUBDIVISION_MAX);
    if (control->n_cell < 1) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "subdivision: there is no cell");
    sizes size = sizes_of(control);
    if (bytes_of(&size) > budget) return refuse(bytes_of(&size), budget, 0, options, diag);
    pal_err err = begin(control, &s);
    while (!err && s.n_level < options->n_level) err = refine(&s, options, budget, diag);
    if (!err) pal_interpolation_apply(&s.rows, control->x, s.cells.x);
    if (err)
        pal_subdivision_free(&s);
    else
        *out = s;
    return err;
}

void pal_subdivision_free(pal_subdivision *s)
{
    pal_cells_free(&s->cells);
    pal_interpolation_free(&s->rows);
    free(s->cell_origin);
    free(s->face_origin);
    memset(s, 0, sizeof *s);
}
