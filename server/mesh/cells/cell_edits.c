/* Edits of control cells (A 4.1): the door, what makes and judges a result, and the edits that grow nothing. */
#include "server/mesh/cells/cell_edits.h"

#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"
#include "server/num/polar.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_ITEMS  (INT32_MAX / 4)
#define FARTHEST_M  1e9
#define LEAST_SHAPE 1e-12

/* ---- a work ---- */

pal_edit_work pal_edit_begin(const pal_cells *from, const char *format, ...)
{
    pal_edit_work w = {.from = from, .face_loop = -1, .rotated_face = -1, .first_new = INT32_MAX};
    va_list args;
    va_start(args, format);
    vsnprintf(w.what, sizeof w.what, format, args);
    va_end(args);
    return w;
}

static void end_work(pal_edit_work *w)
{
    pal_interpolation none = {0};
    if (!w->rows.err) w->rows.err = PAL_ERR_STATE;
    (void)pal_interpolation_builder_finish(&w->rows, &none);
    pal_cell_loops_free(&w->to);
    free(w->offset);
    free(w->cell_from);
    free(w->map);
}

pal_err pal_edit_reserve_rows(pal_edit_work *w, int32_t n_vertex, int32_t n_cell)
{
    const pal_cells *c = w->from;
    pal_interpolation_builder_begin(&w->rows, n_vertex, c->n_vertex, INT32_MAX);
    w->offset = calloc(3 * (size_t)n_vertex + 1, sizeof *w->offset);
    w->cell_from = calloc((size_t)n_cell + 1, sizeof *w->cell_from);
    w->map = malloc((size_t)c->n_vertex * sizeof *w->map + 1);
    return w->offset && w->cell_from && w->map ? w->rows.err : PAL_ERR_MEMORY;
}

pal_err pal_edit_reserve(pal_edit_work *w, int64_t n_vertex, int64_t n_cell, int64_t n_loop, int64_t n_corner,
                         pal_diagnostic *diag)
{
    pal_cell_loops *l = &w->to;
    if (n_vertex > MOST_ITEMS || n_cell > MOST_ITEMS || n_loop > MOST_ITEMS || n_corner > MOST_ITEMS)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: makes more than %d corners", w->what, MOST_ITEMS);
    PAL_TRY(pal_edit_reserve_rows(w, (int32_t)n_vertex, (int32_t)n_cell));
    l->n_vertex = (int32_t)n_vertex;
    l->x = malloc(3 * (size_t)n_vertex * sizeof *l->x + 1);
    l->vertex_sharpness = calloc((size_t)n_vertex + 1, sizeof *l->vertex_sharpness);
    l->cell = calloc((size_t)n_cell + 1, sizeof *l->cell);
    l->loop = calloc((size_t)n_loop + 1, sizeof *l->loop);
    l->corner = malloc((size_t)n_corner * sizeof *l->corner + 1);
    l->edge_tag = malloc(2 * (size_t)w->from->n_edge * sizeof *l->edge_tag + 1);
    l->face_tag = malloc((size_t)n_loop * sizeof *l->face_tag + 1);
    return l->x && l->vertex_sharpness && l->cell && l->loop && l->corner && l->edge_tag && l->face_tag
               ? PAL_ERR_OK
               : PAL_ERR_MEMORY;
}

void pal_edit_corner(pal_edit_work *w, int32_t vertex)
{
    w->to.corner[w->n_corner++] = vertex;
}

void pal_edit_end_loop(pal_edit_work *w, float sharp)
{
    if (sharp > 0) w->to.face_tag[w->to.n_face_tag++] = (pal_cell_tag){w->n_loop, 0, sharp};
    w->to.loop[++w->n_loop] = w->n_corner;
}

void pal_edit_end_cell(pal_edit_work *w, int32_t cell_from)
{
    w->cell_from[w->to.n_cell] = cell_from;
    w->to.cell[++w->to.n_cell] = w->n_loop;
}

void pal_edit_tag(pal_edit_work *w, int32_t a, int32_t b, float sharp)
{
    if (sharp > 0) w->to.edge_tag[w->to.n_edge_tag++] = (pal_cell_tag){a, b, sharp};
}

void pal_edit_copy_old(pal_edit_work *w, const int32_t *map)
{
    const pal_cells *c = w->from;
    for (int32_t i = 0; i < c->n_cell; i++) {
        for (int32_t f = c->cell_use[i]; f < c->cell_use[i + 1]; f++) {
            for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++)
                pal_edit_corner(w, map ? map[c->edge_use[u].vertex] : c->edge_use[u].vertex);
            pal_edit_end_loop(w, c->face[c->face_use[f].face].sharp);
        }
        pal_edit_end_cell(w, i);
    }
    for (int32_t e = 0; e < c->n_edge; e++) {
        const int32_t *end = c->edge[e].vertex;
        pal_edit_tag(w, map ? map[end[0]] : end[0], map ? map[end[1]] : end[1], c->edge[e].sharp);
    }
    for (int32_t v = 0; v < c->n_vertex; v++) {
        float *sharp = &w->to.vertex_sharpness[map ? map[v] : v];
        if (c->vertex_sharpness[v] > *sharp) *sharp = c->vertex_sharpness[v];
    }
}

/* ---- folds ---- */

/* six times the volume of the tetrahedron from o to the edge's ends and its face's centre */
static double wedge(const double o[3], const double centre[3], const double *p, const double *q)
{
    double a[3], b[3], d[3], n[3];
    pal_sub3(a, p, o);
    pal_sub3(b, q, o);
    pal_sub3(d, centre, o);
    pal_cross3(n, a, b);
    return pal_dot3(n, d);
}

static void use_centre(const pal_cells *c, const double *x, int32_t face_use, double out[3])
{
    int32_t first = c->face_use[face_use].first_use, end = c->face_use[face_use + 1].first_use;
    pal_set3(out, 0, 0, 0);
    for (int32_t u = first; u < end; u++) pal_add3(out, out, x + 3 * (size_t)c->edge_use[u].vertex);
    pal_scale3(out, 1.0 / (end - first), out);
}

bool pal_edit_star_shaped(const pal_cells *c, const double *x, int32_t cell)
{
    double mean[3], o[3] = {0}, volume = 0, most = 0, centre[3];
    pal_cells_cell_centre(c, x, cell, mean);
    pal_copy3(o, mean);
    /* first from the vertices' mean, to find the centroid, then from that */
    for (int pass = 0; pass < 2; pass++) {
        double sum[3] = {0};
        for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
            use_centre(c, x, f, centre);
            for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++) {
                const double *p = x + 3 * (size_t)c->edge_use[u].vertex;
                const double *q = x + 3 * (size_t)c->edge_use[pal_cells_next(c, u)].vertex;
                double v = wedge(o, centre, p, q);
                if (pass && !(v > LEAST_SHAPE * most * most * most)) return false;
                most = fmax(most, 2 * pal_dist3(p, mean));
                volume += pass ? 0 : v;
                for (int a = 0; a < 3; a++) sum[a] += v * (p[a] + q[a] + centre[a] - 3 * o[a]) / 4;
            }
        }
        if (!(volume > 0)) return false;
        if (!pass) pal_axpy3(o, 1 / volume, sum);
    }
    return true;
}

/* a cell that is folded and new, or was not */
static pal_err check_folds(const pal_edit_work *w, const pal_cells *to, pal_diagnostic *diag)
{
    for (int32_t i = 0; i < to->n_cell; i++) {
        if (pal_edit_star_shaped(to, to->x, i)) continue;
        if (i < w->first_new && !pal_edit_star_shaped(w->from, w->from->x, w->cell_from[i])) continue;
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: cell %d folds: a face of it faces its centroid", w->what,
                                  i);
    }
    return PAL_ERR_OK;
}

/* ---- the end of a work ---- */

static pal_err make_result(pal_edit_work *w, pal_cells_edit *edit, pal_diagnostic *diag)
{
    pal_diagnostic reason = {""};
    pal_interpolation_builder rows = w->rows;
    memset(&w->rows, 0, sizeof w->rows);
    PAL_TRY(pal_interpolation_builder_finish(&rows, &edit->rows));
    pal_interpolation_apply(&edit->rows, w->from->x, w->to.x);
    for (size_t i = 0; i < 3 * (size_t)w->to.n_vertex; i++) w->to.x[i] += w->offset[i];
    pal_err err = pal_cells_make(&w->to, &edit->cells, &reason);
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", w->what, reason.text);
    PAL_TRY(check_folds(w, &edit->cells, diag));
    edit->offset = w->offset, edit->cell_from = w->cell_from;
    w->offset = NULL, w->cell_from = NULL;
    edit->face = w->face_loop < 0 ? -1 : edit->cells.face_use[w->face_loop].face;
    edit->rotated_face = w->rotated_face;
    return PAL_ERR_OK;
}

pal_err pal_edit_finish(pal_edit_work *w, pal_err err, pal_cells_edit *out, pal_diagnostic *diag)
{
    pal_cells_edit edit = {0};
    if (!err) err = make_result(w, &edit, diag);
    end_work(w);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "%s: no memory", w->what);
    if (err)
        pal_cells_edit_free(&edit);
    else
        *out = edit;
    return err;
}

void pal_cells_edit_free(pal_cells_edit *edit)
{
    pal_cells_free(&edit->cells);
    pal_interpolation_free(&edit->rows);
    free(edit->offset);
    free(edit->cell_from);
    memset(edit, 0, sizeof *edit);
}

pal_err pal_edit_check_number(const pal_edit_work *w, const char *what, int32_t i, int32_t n, pal_diagnostic *diag)
{
    if (i >= 0 && i < n) return PAL_ERR_OK;
    return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %s %d, there are %d", w->what, what, i, n);
}

/* ---- delete ---- */

static pal_err put_kept(pal_edit_work *w, int32_t cell, bool *keep, int32_t *kept)
{
    const pal_cells *c = w->from;
    memset(keep, 1, (size_t)c->n_cell);
    keep[cell] = false;
    PAL_TRY(pal_cells_loops(c, &w->to));
    PAL_TRY(pal_cell_loops_keep(&w->to, keep, kept));
    PAL_TRY(pal_edit_reserve_rows(w, w->to.n_vertex, w->to.n_cell));
    for (int32_t i = 0; i < w->to.n_vertex; i++) {
        pal_interpolation_builder_add(&w->rows, kept[i], 1);
        pal_interpolation_builder_end_row(&w->rows);
    }
    for (int32_t i = 0; i < w->to.n_cell; i++) w->cell_from[i] = i + (i >= cell);
    return PAL_ERR_OK;
}

pal_err pal_cells_delete(const pal_cells *from, int32_t cell, pal_cells_edit *out, pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "delete cell %d", cell);
    memset(out, 0, sizeof *out);
    PAL_TRY(pal_edit_check_number(&w, "cell", cell, from->n_cell, diag));
    if (from->n_cell == 1)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: it is the last one, a solid needs a cell", w.what);
    bool *keep = malloc((size_t)from->n_cell);
    int32_t *kept = malloc((size_t)from->n_vertex * sizeof *kept);
    pal_err err = keep && kept ? put_kept(&w, cell, keep, kept) : PAL_ERR_MEMORY;
    free(keep);
    free(kept);
    return pal_edit_finish(&w, err, out, diag);
}

/* ---- sharpen, move: the same loops ---- */

/* the complex as it is, every vertex and cell itself */
static pal_err copy_all(const pal_cells *from, pal_cells_edit *out)
{
    pal_cells_edit edit = {.face = -1, .rotated_face = -1};
    edit.offset = calloc(3 * (size_t)from->n_vertex, sizeof *edit.offset);
    edit.cell_from = malloc((size_t)from->n_cell * sizeof *edit.cell_from);
    pal_err err = edit.offset && edit.cell_from ? pal_cells_copy(from, &edit.cells) : PAL_ERR_MEMORY;
    if (!err) err = pal_interpolation_identity(from->n_vertex, &edit.rows);
    if (err) {
        pal_cells_edit_free(&edit);
        return err;
    }
    for (int32_t i = 0; i < from->n_cell; i++) edit.cell_from[i] = i;
    *out = edit;
    return PAL_ERR_OK;
}

pal_err pal_cells_sharpen(const pal_cells *from, pal_cells_command_kind kind, int32_t item, float sharp,
                          pal_cells_edit *out, pal_diagnostic *diag)
{
    const char *name = pal_cells_command_name(kind);
    pal_edit_work w = pal_edit_begin(from, "%s %d", name ? name : "sharpen", item);
    memset(out, 0, sizeof *out);
    if (kind == PAL_CELLS_SHARPEN_VERTEX)
        PAL_TRY(pal_edit_check_number(&w, "vertex", item, from->n_vertex, diag));
    else if (kind == PAL_CELLS_SHARPEN_EDGE)
        PAL_TRY(pal_edit_check_number(&w, "edge", item, from->n_edge, diag));
    else if (kind == PAL_CELLS_SHARPEN_FACE)
        PAL_TRY(pal_edit_check_number(&w, "face", item, from->n_face, diag));
    else
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: kind %d sets no sharpness", w.what, (int)kind);
    if (!(sharp >= 0 && sharp <= PAL_SHARPNESS_MAX))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: sharpness is %g, must be 0 to %g", w.what, (double)sharp,
                                  (double)PAL_SHARPNESS_MAX);
    pal_err err = copy_all(from, out);
    if (err) return pal_diagnostic_set(diag, err, "%s: no memory", w.what);
    if (kind == PAL_CELLS_SHARPEN_VERTEX)
        out->cells.vertex_sharpness[item] = sharp;
    else if (kind == PAL_CELLS_SHARPEN_EDGE)
        out->cells.edge[item].sharp = sharp;
    else
        out->cells.face[item].sharp = sharp;
    return PAL_ERR_OK;
}

/* numbers in range, each once, positions within reach; seen [n_vertex] is all false */
static pal_err check_moves(const pal_edit_work *w, int32_t n, const int32_t *vertex, const double *x, bool *seen,
                           pal_diagnostic *diag)
{
    for (int32_t i = 0; i < n; i++) {
        const double *to = x + 3 * (size_t)i;
        PAL_TRY(pal_edit_check_number(w, "vertex", vertex[i], w->from->n_vertex, diag));
        if (seen[vertex[i]])
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: vertex %d is given twice", w->what, vertex[i]);
        seen[vertex[i]] = true;
        if (!(fabs(to[0]) <= FARTHEST_M && fabs(to[1]) <= FARTHEST_M && fabs(to[2]) <= FARTHEST_M))
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                      "%s: vertex %d to %g %g %g m, must be within %g m of the origin", w->what,
                                      vertex[i], to[0], to[1], to[2], FARTHEST_M);
    }
    return PAL_ERR_OK;
}

/* moves them, and judges faces and cells */
static pal_err move_all(pal_edit_work *w, int32_t n, const int32_t *vertex, const double *x, pal_cells_edit *edit,
                        pal_diagnostic *diag)
{
    pal_cells *c = &edit->cells;
    pal_cells_fault fault;
    for (int32_t i = 0; i < n; i++) {
        size_t at = 3 * (size_t)vertex[i];
        pal_sub3(edit->offset + at, x + 3 * (size_t)i, c->x + at);
        pal_copy3(c->x + at, x + 3 * (size_t)i);
    }
    if (!pal_cells_shape_valid(c, NULL, &fault)) {
        if (fault.face_use >= 0)
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: face %d has no area (%.3g m^2, longest edge %.3g m)",
                                      w->what, c->face_use[fault.face_use].face, fault.measure, fault.length_scale_m);
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: cell %d has no positive volume (%.3g m^3, %.3g m across)",
                                  w->what, fault.cell, fault.measure, fault.length_scale_m);
    }
    w->cell_from = edit->cell_from;
    return check_folds(w, c, diag);
}

pal_err pal_cells_move(const pal_cells *from, int32_t n, const int32_t *vertex, const double *x, pal_cells_edit *out,
                       pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "move");
    pal_cells_edit edit = {0};
    memset(out, 0, sizeof *out);
    if (n < 0 || n > from->n_vertex)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %d vertices, there are %d", w.what, n, from->n_vertex);
    bool *seen = calloc((size_t)from->n_vertex + 1, sizeof *seen);
    pal_err err = seen ? check_moves(&w, n, vertex, x, seen, diag) : PAL_ERR_MEMORY;
    free(seen);
    if (!err) err = copy_all(from, &edit);
    if (!err) err = move_all(&w, n, vertex, x, &edit, diag);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "%s: no memory", w.what);
    if (err)
        pal_cells_edit_free(&edit);
    else
        *out = edit;
    return err;
}

/* ---- commands ---- */

static const char *const names[] = {
#define X(kind, name) name,
    PAL_CELLS_COMMAND_TABLE(X)
#undef X
};

const char *pal_cells_command_name(pal_cells_command_kind kind)
{
    return (unsigned)kind < PAL_CELLS_COMMAND_KINDS ? names[kind] : NULL;
}

pal_cells_command_kind pal_cells_command_find(const char *name)
{
    int kind = 0;
    while (kind < PAL_CELLS_COMMAND_KINDS && strcmp(names[kind], name) != 0) kind++;
    return (pal_cells_command_kind)kind;
}

pal_err pal_cells_apply(const pal_cells *from, const pal_cells_command *command, pal_cells_edit *out,
                        pal_diagnostic *diag)
{
    const pal_cells_command *k = command;
    switch (k->kind) {
    case PAL_CELLS_DELETE:
        return pal_cells_delete(from, k->cell, out, diag);
    case PAL_CELLS_EXTRUDE:
        return pal_cells_extrude(from, k->face, k->distance_m, k->scale, out, diag);
    case PAL_CELLS_MERGE:
        return pal_cells_merge(from, k->face, k->other_face, out, diag);
    case PAL_CELLS_BRIDGE:
        return pal_cells_bridge(from, k->face, k->other_face, out, diag);
    case PAL_CELLS_DIVIDE:
        return pal_cells_divide_near(from, k->cell, k->rings, out, diag);
    case PAL_CELLS_SHARPEN_VERTEX:
        return pal_cells_sharpen(from, k->kind, k->vertex, k->sharp, out, diag);
    case PAL_CELLS_SHARPEN_EDGE:
        return pal_cells_sharpen(from, k->kind, k->edge, k->sharp, out, diag);
    case PAL_CELLS_SHARPEN_FACE:
        return pal_cells_sharpen(from, k->kind, k->face, k->sharp, out, diag);
    case PAL_CELLS_MOVE:
        return pal_cells_move(from, 1, &k->vertex, k->to_m, out, diag);
    case PAL_CELLS_COMMAND_KINDS:
        break;
    }
    memset(out, 0, sizeof *out);
    return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "edit: kind %d, there are %d", (int)k->kind,
                              PAL_CELLS_COMMAND_KINDS);
}

/* ---- deformed states ---- */

/* rotation of a face from its rest to positions x, of its corners and its normal; the identity where x has no area */
static void face_turn(const pal_cells *from, int32_t face, const double *x, double r[9])
{
    double o[3], p[3], n[3], m[3], a[3], b[3], f[9] = {0}, q[4] = {1, 0, 0, 0}, size = 0;
    int32_t first, n_corner = pal_cells_face_loop(from, face, &first);
    pal_cells_face_centre(from, NULL, face, o);
    pal_cells_face_centre(from, x, face, p);
    pal_cells_face_area(from, NULL, face, n);
    pal_cells_face_area(from, x, face, m);
    if (pal_unit3(n, n, 0) && pal_unit3(m, m, 0)) {
        for (int32_t u = first; u < first + n_corner; u++) {
            pal_sub3(a, from->x + 3 * (size_t)from->edge_use[u].vertex, o);
            pal_sub3(b, x + 3 * (size_t)from->edge_use[u].vertex, p);
            size += pal_norm3(a) * pal_norm3(b);
            for (int i = 0; i < 9; i++) f[i] += b[i / 3] * a[i % 3];
        }
        for (int i = 0; i < 9; i++) f[i] += size * m[i / 3] * n[i % 3];
        pal_polar_rotation(f, q, 100);
    }
    pal_quat_matrix(q, r);
}

void pal_cells_edit_positions(const pal_cells_edit *edit, const pal_cells *from, const double *x, double *to)
{
    double r[9], d[3];
    pal_interpolation_apply(&edit->rows, x, to);
    if (edit->rotated_face >= 0) face_turn(from, edit->rotated_face, x, r);
    for (size_t i = 0; i < 3 * (size_t)edit->cells.n_vertex; i += 3) {
        pal_copy3(d, edit->offset + i);
        if (edit->rotated_face >= 0) pal_mul33(d, r, d);
        pal_add3(to + i, to + i, d);
    }
}
