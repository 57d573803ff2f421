/* Edits of control cells (paper A section 4.1): an edit in the making, and the checks of its result. */
#include "server/mesh/cells/cell_edit_work.h"

#include "server/base/vec3.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_ITEMS (INT32_MAX / 4)
/* a cell counts as folded when a tetrahedron from its centroid to an edge and face has less than this share of the
 * cube of the cell's size */
#define MIN_SHAPE 1e-12

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
    if (n_vertex > MAX_ITEMS || n_cell > MAX_ITEMS || n_loop > MAX_ITEMS || n_corner > MAX_ITEMS)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: makes more than %d corners", w->what, MAX_ITEMS);
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
    double mean[3], o[3] = {0}, volume = 0, max = 0, centre[3];
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

pal_err pal_edit_check_folds(const pal_edit_work *w, const pal_cells *to, pal_diagnostic *diag)
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
    PAL_TRY(pal_edit_check_folds(w, &edit->cells, diag));
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
