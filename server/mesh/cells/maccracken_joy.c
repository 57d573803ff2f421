/* MacCracken-Joy subdivision (paper A section 3.1; the table of rules is in server/mesh/README.md). All weights are on
 * the old vertices. PAL_SUBDIVISION_AVERAGING replaces the rules inside and on the boundary: mean of the centroids of
 * the new cells, or of the new quads of the boundary, at the place, when the cells are cut without moving anything.
 *
 * The paper gives no rules ("in the interest of brevity") and only names "local changes to the subdivision rules".
 * Departure from DeRose, Kass, Truong (SIGGRAPH 1998): at a vertex with sharp edges of s1 >= s2 >= s3 >= ..., all cut
 * off at 1, the blend is s3 corner + (s2 - s3) crease of the two sharpest + (1 - s2) smooth instead of one by the mean
 * sharpness, so that nothing jumps when an edge begins to be sharpened. Equal sharpnesses give the same. */
#include "server/mesh/cells/maccracken_joy.h"

#include "server/base/heap.h"
#include "server/mesh/geometry/tuning.h"

#include <math.h>

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

/* weights: s times a point, added to the open row */
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

/* the four rules; s is the weight that the row's other rules leave */
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

static int32_t row_length(const pal_cell_rows *rows, int32_t i)
{
    return rows->start[i + 1] - rows->start[i];
}

/* weight s for each item of a row */
static void add_row(const level *l, void (*add)(const level *l, int32_t item, double s), const pal_cell_rows *rows,
                    int32_t i, double s)
{
    for (int32_t k = rows->start[i]; k < rows->start[i + 1]; k++) add(l, rows->item[k], s);
}

static void inner_edge(const level *l, int32_t e, double s)
{
    const pal_cells *c = l->c;
    int32_t n = row_length(&c->edge_face, e), n_cell = row_length(&c->edge_cell, e);
    if (l->averaging) {
        for (int32_t k = 0; k < 2 * n_cell; k++) {
            int32_t cell = c->edge_cell.item[c->edge_cell.start[e] + k / 2];
            add_part(l, cell, corner_of(c, cell, c->edge[e].vertex[k % 2]), s / (2 * n_cell));
        }
        return;
    }
    add_row(l, add_cell, &c->edge_cell, e, s / n / n_cell);
    add_row(l, add_face, &c->edge_face, e, 2 * s / n / n);
    add_mid(l, e, s * (n - 3) / n);
}

static void edge_rule(const level *l, int32_t e)
{
    const pal_cell_edge *edge = &l->c->edge[e];
    double sharp = edge->pinched ? 1 : fmin(edge->sharp, 1);
    if (sharp > 0) add_mid(l, e, sharp);
    if (sharp >= 1) return;
    (edge->boundary ? boundary_edge : inner_edge)(l, e, 1 - sharp);
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
    int32_t first = c->vertex_cell.start[v], n_cell = row_length(&c->vertex_cell, v);
    for (int32_t k = first; l->averaging && k < first + n_cell; k++)
        add_part(l, c->vertex_cell.item[k], corner_of(c, c->vertex_cell.item[k], v), s / n_cell);
    if (l->averaging) return;
    add_row(l, add_cell, &c->vertex_cell, v, s / 8 / n_cell);
    add_row(l, add_face, &c->vertex_face, v, 3 * s / 8 / row_length(&c->vertex_face, v));
    add_row(l, add_mid, &c->vertex_edge, v, 3 * s / 8 / row_length(&c->vertex_edge, v));
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
    (c->vertex_boundary[v] ? boundary_vertex : inner_vertex)(l, v, smooth);
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

/* sharpness that remains a level later */
static float after(float s)
{
    return s >= PAL_SHARPNESS_MAX ? PAL_SHARPNESS_MAX : s > 1 ? s - 1 : 0;
}

/* The level's loops but for positions, with both halves of sharp edges and all parts of sharp faces, and the origins of
 * the cells and of the loops (a control face, or -1) */
static void add_loops(const pal_subdivision *from, pal_cell_loops *to, int32_t *cell_origin, int32_t *loop_origin)
{
    const pal_cells *c = &from->cells;
    const level l = level_of(c);
    for (int32_t cell = 0, k = 0; cell < c->n_cell; cell++)
        for (; k < c->cell_vertex.start[cell + 1]; k++) {
            int32_t first = c->corner_use[k], use = first, v = c->cell_vertex.item[k];
            pal_cell_loops_cell(to);
            cell_origin[k] = from->cell_origin[cell];
            /* the outer quads lie in the old faces, from the vertex along each edge */
            do {
                int32_t before = pal_cells_prev(c, use), f = pal_cells_face_of(c, use);
                loop_origin[to->n_loop] = from->face_origin[f];
                pal_cell_loops_quad(to, after(c->face[f].sharp), v, l.first_edge + c->edge_use[use].edge,
                                    l.first_face + f, l.first_edge + c->edge_use[before].edge);
                use = pal_cells_next_around(c, use);
            } while (use != first);
            /* the inner quads cross the edges: from the face on their left to the one on their right */
            do {
                int32_t right = pal_cells_face_of(c, c->edge_use[use].radial), f = pal_cells_face_of(c, use);
                loop_origin[to->n_loop] = -1;
                pal_cell_loops_quad(to, 0, l.first_edge + c->edge_use[use].edge, l.first_face + right,
                                    l.first_cell + cell, l.first_face + f);
                use = pal_cells_next_around(c, use);
            } while (use != first);
        }
    for (int32_t e = 0; e < c->n_edge; e++)
        for (int end = 0; end < 2; end++)
            pal_cell_loops_edge(to, c->edge[e].vertex[end], l.first_edge + e, after(c->edge[e].sharp));
    for (int32_t v = 0; v < c->n_vertex; v++) to->vertex_sharpness[v] = after(c->vertex_sharpness[v]);
}

/* memory of a complex of so many edge uses, about: that of bricks inside a solid, and half as much more for loops,
 * origins and tables while it is made */
static double bytes_of(double n_edge_use, bool made)
{
    return n_edge_use * (made ? 52 : 96);
}

static double rows_bytes(double entries)
{
    return entries * (sizeof(int32_t) + sizeof(double));
}

static pal_err refuse(double byte, double budget, int at, const pal_subdivision_options *o, pal_diagnostic *diag)
{
    static const char format[] =
        "subdivision: level %d of %d needs %.4g MiB, the budget is %.4g MiB: ask for fewer levels";
    return pal_diagnostic_set(diag, PAL_ERR_BUDGET, format, at, o->n_level, byte / 1048576, budget / 1048576);
}

/* the next level from its vertices' rows */
static pal_err make_level(const pal_subdivision *s, const pal_interpolation *step, pal_subdivision *next,
                          pal_diagnostic *diag)
{
    const pal_cells *c = &s->cells;
    pal_cell_loops loops = {.n_vertex = step->n_row};
    pal_diagnostic reason = {""};
    int32_t *loop_origin;
    PAL_ARRAY(&loops.err, loops.x, 3 * (size_t)loops.n_vertex);
    PAL_ZEROED(&loops.err, loops.vertex_sharpness, loops.n_vertex);
    PAL_ARRAY(&loops.err, next->cell_origin, c->cell_vertex.start[c->n_cell]);
    PAL_ARRAY(&loops.err, loop_origin, 2 * (size_t)c->n_edge_use);
    if (!loops.err) {
        add_loops(s, &loops, next->cell_origin, loop_origin);
        pal_interpolation_apply(step, c->x, loops.x);
    }
    pal_err err = pal_cell_loops_finish(&loops, &next->cells, &reason);
    if (err) pal_diagnostic_set(diag, err, "subdivision: level %d: %s", next->n_level, reason.text);
    PAL_ARRAY(&err, next->face_origin, next->cells.n_face);
    for (int32_t u = 0; !err && u < next->cells.n_face_use; u++)
        next->face_origin[next->cells.face_use[u].face] = loop_origin[u];
    return PAL_FREED(err, loop_origin);
}

/* replaces s by its next level; s is unchanged on failure */
static pal_err refine(pal_subdivision *s, const pal_subdivision_options *o, double budget, pal_diagnostic *diag)
{
    pal_subdivision next = {.n_level = s->n_level + 1};
    pal_interpolation step = {0};
    /* a lower bound: the rows of a level have at least one entry each; the rest is counted as they are made */
    double n_use = 8.0 * s->cells.n_edge_use, rows = rows_bytes(s->rows.start[s->rows.n_row]);
    double byte = bytes_of(s->cells.n_edge_use, true) + bytes_of(n_use, false) + rows;
    double min_bytes = byte + 2 * rows_bytes(level_of(&s->cells).n_vertex);
    if (min_bytes > budget || n_use > CELL_MAX_ITEM) return refuse(min_bytes, budget, next.n_level, o, diag);
    double room = (budget - byte) / rows_bytes(1);
    pal_err err = make_rows(&s->cells, o->rule == PAL_SUBDIVISION_AVERAGING, (int64_t)room, &step);
    if (!err) {
        room -= step.start[step.n_row];
        err = pal_interpolation_product(&step, &s->rows, (int64_t)room, &next.rows);
    }
    if (err == PAL_ERR_BUDGET)
        pal_diagnostic_set(diag, err, "subdivision: level %d of %d needs more than %.4g MiB", next.n_level, o->n_level,
                           budget / 1048576);
    if (!err) err = make_level(s, &step, &next, diag);
    pal_interpolation_free(&step);
    if (err) {
        pal_subdivision_free(&next);
        return err;
    }
    pal_subdivision_free(s);
    *s = next;
    s->n_byte = (size_t)bytes_of(n_use, true) + pal_interpolation_bytes(&s->rows);
    return PAL_ERR_OK;
}

/* level 0: the control cells, each its own origin */
static pal_err begin(const pal_cells *control, pal_subdivision *s)
{
    pal_err err = pal_cells_copy(control, &s->cells);
    if (!err) err = pal_interpolation_identity(control->n_vertex, &s->rows);
    PAL_ARRAY(&err, s->cell_origin, control->n_cell);
    PAL_ARRAY(&err, s->face_origin, control->n_face);
    if (err) return err;
    for (int32_t c = 0; c < control->n_cell; c++) s->cell_origin[c] = c;
    for (int32_t f = 0; f < control->n_face; f++) s->face_origin[f] = f;
    s->n_byte = (size_t)bytes_of(control->n_edge_use, true) + pal_interpolation_bytes(&s->rows);
    return PAL_ERR_OK;
}

pal_err pal_subdivision_make(const pal_cells *control, const pal_subdivision_options *options, pal_subdivision *out,
                             pal_diagnostic *diag)
{
    pal_subdivision s = {0};
    double budget = (double)(options->budget_byte ? options->budget_byte : HIERARCHY_BUDGET_BYTE);
    if (options->n_level < 0 || options->n_level > PAL_SUBDIVISION_MAX)
        return PAL_REFUSE(diag, "subdivision: %d levels asked for, 0 to %d are made", options->n_level,
                          PAL_SUBDIVISION_MAX);
    if (control->n_cell < 1) return PAL_REFUSE(diag, "subdivision: there is no cell");
    double byte = bytes_of(control->n_edge_use, true);
    if (byte > budget) return refuse(byte, budget, 0, options, diag);
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
    PAL_FREE(s->cell_origin, s->face_origin);
    memset(s, 0, sizeof *s);
}
