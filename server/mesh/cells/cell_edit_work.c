/* Edits of control cells (paper A section 4.1): an edit in the making, and the checks of its result. */
#include "server/mesh/cells/cell_edit_work.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

#include <stdarg.h>
#include <stdio.h>

pal_edit_work pal_edit_begin(const pal_cells *from, pal_diagnostic *diag, const char *format, ...)
{
    pal_edit_work w = {.from = from, .diag = diag, .face_loop = -1, .rotated_face = -1, .first_new = INT32_MAX};
    va_list args;
    va_start(args, format);
    vsnprintf(w.what, sizeof w.what, format, args);
    va_end(args);
    return w;
}

pal_err pal_edit_reserve(pal_edit_work *w, int32_t n_vertex, int32_t n_cell)
{
    pal_err err = pal_interpolation_builder_begin(&w->rows, n_vertex, w->from->n_vertex, INT32_MAX);
    PAL_ZEROED(&err, w->offset, 3 * (size_t)n_vertex);
    PAL_ARRAY(&err, w->cell_from, n_cell);
    if (!w->to.x) {
        PAL_ARRAY(&err, w->to.x, 3 * (size_t)n_vertex);
        PAL_ZEROED(&err, w->to.vertex_sharpness, n_vertex);
    }
    for (int32_t i = 0; !err && i < n_cell; i++) w->cell_from[i] = i;
    return err;
}

void pal_edit_keep_vertices(pal_edit_work *w)
{
    const pal_cells *c = w->from;
    for (int32_t v = 0; v < c->n_vertex; v++) pal_interpolation_builder_mean(&w->rows, &v, 1);
    memcpy(w->to.vertex_sharpness, c->vertex_sharpness, (size_t)c->n_vertex * sizeof *c->vertex_sharpness);
}

pal_err pal_edit_refuse(const pal_edit_work *w, const char *format, ...)
{
    char sentence[320];
    va_list args;
    va_start(args, format);
    vsnprintf(sentence, sizeof sentence, format, args);
    va_end(args);
    return PAL_REFUSE(w->diag, "%s: %s", w->what, sentence);
}

pal_err pal_edit_check_number(const pal_edit_work *w, const char *what, int32_t i, int32_t n)
{
    return i >= 0 && i < n ? PAL_ERR_OK : pal_edit_refuse(w, "%s %d, there are %d", what, i, n);
}

/* can all faces of a cell be seen from its centroid? positions x [n_vertex][3] */
static bool is_star_shaped(const pal_cells *c, const double *x, int32_t cell)
{
    double mean[3], o[3] = {0}, volume = 0, max = 0, centre[3], d[3], n[3];
    pal_cells_cell_centre(c, x, cell, mean);
    pal_copy3(o, mean);
    /* first from the vertices' mean, to find the centroid, then from that */
    for (int pass = 0; pass < 2; pass++) {
        double sum[3] = {0};
        for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
            pal_cells_use_centre(c, x, f, centre);
            pal_sub3(d, centre, o);
            for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++) {
                const double *p = x + 3 * (size_t)c->edge_use[u].vertex;
                const double *q = x + 3 * (size_t)c->edge_use[pal_cells_next(c, u)].vertex;
                /* six times the volume of the tetrahedron from o to the edge and the face's centre */
                pal_normal3(n, o, p, q);
                double v = pal_dot3(n, d);
                if (pass && !(v > MIN_SHAPE * max * max * max)) return false;
                max = fmax(max, 2 * pal_dist3(p, mean));
                volume += pass ? 0 : v;
                for (int a = 0; a < 3; a++) sum[a] += v * (p[a] + q[a] + centre[a] - 3 * o[a]) / 4;
            }
        }
        if (!(volume > 0)) return false;
        if (!pass) pal_axpy3(o, 1 / volume, sum);
    }
    return true;
}

pal_err pal_edit_check_folds(const pal_edit_work *w, const pal_cells *to)
{
    for (int32_t i = 0; i < to->n_cell; i++) {
        if (is_star_shaped(to, to->x, i)) continue;
        if (i < w->first_new && !is_star_shaped(w->from, w->from->x, w->cell_from[i])) continue;
        return pal_edit_refuse(w, "cell %d folds: a face of it faces its centroid", i);
    }
    return PAL_ERR_OK;
}

static pal_err make_result(pal_edit_work *w, pal_cells_edit *edit)
{
    pal_diagnostic reason = {""};
    PAL_TRY(w->to.err);
    PAL_TRY(pal_interpolation_builder_finish(&w->rows, &edit->rows));
    w->to.n_vertex = edit->rows.n_row;
    pal_interpolation_apply(&edit->rows, w->from->x, w->to.x);
    for (size_t i = 0; i < 3 * (size_t)w->to.n_vertex; i++) w->to.x[i] += w->offset[i];
    pal_err err = pal_cells_make(&w->to, &edit->cells, &reason);
    if (err) return pal_diagnostic_set(w->diag, err, "%s: %s", w->what, reason.text);
    PAL_TRY(pal_edit_check_folds(w, &edit->cells));
    edit->offset = w->offset, edit->cell_from = w->cell_from;
    w->offset = NULL, w->cell_from = NULL;
    edit->face = w->face_loop < 0 ? -1 : edit->cells.face_use[w->face_loop].face;
    edit->rotated_face = w->rotated_face;
    return PAL_ERR_OK;
}

pal_err pal_edit_finish(pal_edit_work *w, pal_err err, pal_cells_edit *out)
{
    pal_interpolation none;
    memset(out, 0, sizeof *out);
    if (!err) err = make_result(w, out);
    w->rows.err = PAL_ERR_STATE;
    (void)pal_interpolation_builder_finish(&w->rows, &none);
    pal_cell_loops_free(&w->to);
    PAL_FREE(w->offset, w->cell_from);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(w->diag, err, "%s: no memory", w->what);
    if (err) pal_cells_edit_free(out);
    return err;
}

void pal_cells_edit_free(pal_cells_edit *edit)
{
    pal_cells_free(&edit->cells);
    pal_interpolation_free(&edit->rows);
    PAL_FREE(edit->offset, edit->cell_from);
    memset(edit, 0, sizeof *edit);
}
