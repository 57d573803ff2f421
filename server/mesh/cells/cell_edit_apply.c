/* Edits of control cells (paper A section 4.1): delete, sharpen and move; commands; transfer of deformed positions. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/polar.h"

static pal_err delete_cell(pal_edit_work *w, int32_t cell)
{
    const pal_cells *c = w->from;
    pal_err err = pal_edit_check_number(w, "cell", cell, c->n_cell);
    bool *keep;
    int32_t *kept;
    if (!err && c->n_cell == 1) err = pal_edit_refuse(w, "it is the last one, a solid needs a cell");
    PAL_ARRAY(&err, keep, c->n_cell);
    PAL_ARRAY(&err, kept, c->n_vertex);
    for (int32_t i = 0; !err && i < c->n_cell; i++) keep[i] = i != cell;
    if (!err) err = pal_cells_loops(c, keep, &w->to, kept);
    if (!err) err = pal_edit_reserve(w, w->to.n_vertex, w->to.n_cell);
    for (int32_t i = 0; !err && i < w->to.n_vertex; i++) pal_interpolation_builder_mean(&w->rows, &kept[i], 1);
    for (int32_t i = cell; !err && i < w->to.n_cell; i++) w->cell_from[i]++;
    return PAL_FREED(err, keep, kept);
}

/* the complex as it is, every vertex and cell itself */
static pal_err copy_all(const pal_edit_work *w, pal_cells_edit *out)
{
    const pal_cells *c = w->from;
    *out = (pal_cells_edit){.face = -1, .rotated_face = -1};
    pal_err err = pal_cells_copy(c, &out->cells);
    PAL_ZEROED(&err, out->offset, 3 * (size_t)c->n_vertex);
    PAL_ARRAY(&err, out->cell_from, c->n_cell);
    if (!err) err = pal_interpolation_identity(c->n_vertex, &out->rows);
    for (int32_t i = 0; i < c->n_cell && !err; i++) out->cell_from[i] = i;
    return err ? pal_diagnostic_set(w->diag, err, "%s: no memory", w->what) : PAL_ERR_OK;
}

/* element: 0 a vertex, 1 an edge, 2 a face */
static pal_err sharpen(const pal_edit_work *w, int element, int32_t item, float sharp, pal_cells_edit *out)
{
    static const char *const what[] = {"vertex", "edge", "face"};
    const int32_t n[] = {w->from->n_vertex, w->from->n_edge, w->from->n_face};
    PAL_TRY(pal_edit_check_number(w, what[element], item, n[element]));
    if (!(sharp >= 0 && sharp <= PAL_SHARPNESS_MAX))
        return pal_edit_refuse(w, "sharpness is %g, must be 0 to %g", (double)sharp, (double)PAL_SHARPNESS_MAX);
    PAL_TRY(copy_all(w, out));
    pal_cells *c = &out->cells;
    *(element == 0 ? &c->vertex_sharpness[item] : element == 1 ? &c->edge[item].sharp : &c->face[item].sharp) = sharp;
    return PAL_ERR_OK;
}

static pal_err move(pal_edit_work *w, int32_t vertex, const double to_m[3], pal_cells_edit *out)
{
    pal_cells *c = &out->cells;
    pal_cells_fault fault;
    PAL_TRY(pal_edit_check_number(w, "vertex", vertex, w->from->n_vertex));
    for (int k = 0; k < 3; k++)
        if (!(fabs(to_m[k]) <= MAX_COORDINATE_M))
            return pal_edit_refuse(w, "vertex %d to %g %g %g m, must be within %g m of the origin", vertex, to_m[0],
                                   to_m[1], to_m[2], MAX_COORDINATE_M);
    PAL_TRY(copy_all(w, out));
    pal_sub3(out->offset + 3 * (size_t)vertex, to_m, c->x + 3 * (size_t)vertex);
    pal_copy3(c->x + 3 * (size_t)vertex, to_m);
    if (pal_cells_shape_valid(c, NULL, &fault)) {
        w->cell_from = out->cell_from;
        return pal_edit_check_folds(w, c);
    }
    if (fault.face_use >= 0)
        return pal_edit_refuse(w, "face %d has no area (%.3g m^2, longest edge %.3g m)",
                               c->face_use[fault.face_use].face, fault.measure, fault.length_scale_m);
    return pal_edit_refuse(w, "cell %d has no positive volume (%.3g m^3, %.3g m across)", fault.cell, fault.measure,
                           fault.length_scale_m);
}

static const char *const names[] = {
#define X(kind, name) name,
    PAL_CELLS_COMMAND_TABLE(X)
#undef X
};

const char *pal_cells_command_name(pal_cells_command_kind kind)
{
    return (unsigned)kind < PAL_CELLS_COMMAND_KINDS ? names[kind] : NULL;
}

pal_err pal_cells_apply(const pal_cells *from, const pal_cells_command *k, pal_cells_edit *out, pal_diagnostic *diag)
{
    const char *name = pal_cells_command_name(k->kind);
    const int32_t item[] = {k->vertex, k->edge, k->face};
    int element = (int)k->kind - PAL_CELLS_SHARPEN_VERTEX;
    pal_err err = PAL_ERR_OK;
    pal_edit_work w;
    memset(out, 0, sizeof *out);
    if (!name) return PAL_REFUSE(diag, "edit: kind %d, there are %d", (int)k->kind, PAL_CELLS_COMMAND_KINDS);
    switch (k->kind) {
    case PAL_CELLS_DELETE:
        w = pal_edit_begin(from, diag, "delete cell %d", k->cell);
        return pal_edit_finish(&w, delete_cell(&w, k->cell), out);
    case PAL_CELLS_EXTRUDE:
        w = pal_edit_begin(from, diag, "extrude face %d", k->face);
        return pal_edit_finish(&w, pal_edit_extrude(&w, k->face, k->distance_m, k->scale), out);
    case PAL_CELLS_MERGE:
        w = pal_edit_begin(from, diag, "merge faces %d and %d", k->face, k->other_face);
        return pal_edit_finish(&w, pal_edit_merge(&w, k->face, k->other_face), out);
    case PAL_CELLS_BRIDGE:
        w = pal_edit_begin(from, diag, "bridge faces %d and %d", k->face, k->other_face);
        return pal_edit_finish(&w, pal_edit_bridge(&w, k->face, k->other_face), out);
    case PAL_CELLS_DIVIDE:
        w = pal_edit_begin(from, diag, "divide cell %d", k->cell);
        return pal_edit_divide_near(&w, k->cell, k->rings, out);
    case PAL_CELLS_MOVE:
        w = pal_edit_begin(from, diag, "move");
        err = move(&w, k->vertex, k->to_m, out);
        break;
    default:
        w = pal_edit_begin(from, diag, "%s %d", name, item[element]);
        err = sharpen(&w, element, item[element], k->sharp, out);
    }
    if (err) pal_cells_edit_free(out);
    return err;
}

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
