/* Edits of control cells (paper A section 4.1): delete, sharpen and move; commands; transfer of deformed positions. */
#include "server/mesh/cells/cell_edit_work.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/polar.h"

#include <stdlib.h>
#include <string.h>

/* ---- delete ---- */

static pal_err add_kept(pal_edit_work *w, int32_t cell, bool *keep, int32_t *kept)
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
    pal_err err = keep && kept ? add_kept(&w, cell, keep, kept) : PAL_ERR_MEMORY;
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

/* numbers in range, each once, positions within MAX_COORDINATE_M; seen [n_vertex] is all false */
static pal_err check_moves(const pal_edit_work *w, int32_t n, const int32_t *vertex, const double *x, bool *seen,
                           pal_diagnostic *diag)
{
    for (int32_t i = 0; i < n; i++) {
        const double *to = x + 3 * (size_t)i;
        PAL_TRY(pal_edit_check_number(w, "vertex", vertex[i], w->from->n_vertex, diag));
        if (seen[vertex[i]])
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: vertex %d is given twice", w->what, vertex[i]);
        seen[vertex[i]] = true;
        if (!(fabs(to[0]) <= MAX_COORDINATE_M && fabs(to[1]) <= MAX_COORDINATE_M && fabs(to[2]) <= MAX_COORDINATE_M))
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                      "%s: vertex %d to %g %g %g m, must be within %g m of the origin", w->what,
                                      vertex[i], to[0], to[1], to[2], MAX_COORDINATE_M);
    }
    return PAL_ERR_OK;
}

/* moves the vertices and checks faces and cells */
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
    return pal_edit_check_folds(w, c, diag);
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

/* rotation of the corners and normal of a face from rest to positions x; the identity where x has no area */
static void face_rotation(const pal_cells *from, int32_t face, const double *x, double r[9])
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
    if (edit->rotated_face >= 0) face_rotation(from, edit->rotated_face, x, r);
    for (size_t i = 0; i < 3 * (size_t)edit->cells.n_vertex; i += 3) {
        pal_copy3(d, edit->offset + i);
        if (edit->rotated_face >= 0) pal_mul33(d, r, d);
        pal_add3(to + i, to + i, d);
    }
}
