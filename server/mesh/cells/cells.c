/* Polyhedral complexes: memory, conversion to loops, measures (paper A section 3.4.4). */
#include "server/mesh/cells/cells.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

enum { N_ARRAY = 22 };

typedef struct array {
    void **at;
    size_t n, size;
} array;

static size_t row_items(const pal_cell_rows *rows, int32_t n)
{
    return rows->start ? (size_t)rows->start[n] : 0;
}

/* every array of a complex, its length and item size */
static int list_arrays(pal_cells *c, array list[N_ARRAY])
{
    int n = 0;
    size_t n_vertex = (size_t)c->n_vertex, n_edge = (size_t)c->n_edge;
#define ARRAY(field, count) list[n++] = (array){(void **)&c->field, (count), sizeof *c->field}
#define ROWS(field, count)                                                                                             \
    ARRAY(field.item, row_items(&c->field, (int32_t)(count)));                                                         \
    ARRAY(field.start, (count) + 1)
    ARRAY(x, 3 * n_vertex);
    ARRAY(vertex_sharpness, n_vertex);
    ARRAY(vertex_boundary, n_vertex);
    ARRAY(vertex_pinched, n_vertex);
    ARRAY(edge, n_edge);
    ARRAY(face, (size_t)c->n_face);
    ARRAY(cell_use, (size_t)c->n_cell + 1);
    ARRAY(face_use, (size_t)c->n_face_use + 1);
    ARRAY(edge_use, (size_t)c->n_edge_use);
    ARRAY(corner_use, row_items(&c->cell_vertex, c->n_cell));
    ROWS(vertex_edge, n_vertex);
    ROWS(vertex_face, n_vertex);
    ROWS(vertex_cell, n_vertex);
    ROWS(edge_face, n_edge);
    ROWS(edge_cell, n_edge);
    ROWS(cell_vertex, (size_t)c->n_cell);
#undef ROWS
#undef ARRAY
    return n;
}

void pal_cells_free(pal_cells *cells)
{
    array list[N_ARRAY];
    int n = list_arrays(cells, list);
    for (int k = 0; k < n; k++) free(*list[k].at);
    memset(cells, 0, sizeof *cells);
}

pal_err pal_cells_copy(const pal_cells *from, pal_cells *to)
{
    pal_cells copy = *from;
    array list[N_ARRAY];
    pal_err err = PAL_ERR_OK;
    int n = list_arrays(&copy, list);
    for (int k = 0; k < n; k++) {
        const void *old = *list[k].at;
        *list[k].at = pal_heap_array(&err, list[k].n, list[k].size, false);
        if (!err) memcpy(*list[k].at, old, list[k].n * list[k].size);
    }
    for (int k = 0; err && k < n; k++) free(*list[k].at);
    if (!err) *to = copy;
    return err;
}

void pal_cell_loops_free(pal_cell_loops *loops)
{
    PAL_FREE(loops->x, loops->cell, loops->loop, loops->corner, loops->vertex_sharpness, loops->edge_tag,
             loops->face_tag, loops->line, loops->vertex_line, loops->tag_line);
    memset(loops, 0, sizeof *loops);
}

/* room for item n of an array of loops */
static bool room(pal_cell_loops *l, void *pointer, int32_t n, size_t size)
{
    if (!l->err && n >= CELL_MAX_ITEM) l->err = PAL_ERR_BUDGET;
    if (!l->err && !pal_heap_grow(pointer, (size_t)n, size)) l->err = PAL_ERR_MEMORY;
    return !l->err;
}
#define ROOM(l, field, n) room((l), &(l)->field, (n), sizeof *(l)->field)

int32_t pal_cell_loops_vertex(pal_cell_loops *l, const double x[3], float sharp)
{
    int32_t v = l->n_vertex;
    if (!room(l, &l->x, v, 3 * sizeof *l->x) || !ROOM(l, vertex_sharpness, v)) return 0;
    pal_copy3(l->x + 3 * (size_t)v, x);
    l->vertex_sharpness[v] = sharp;
    return l->n_vertex++;
}

/* starts have one entry more than there are cells and loops: where the last one ends so far */
void pal_cell_loops_cell(pal_cell_loops *l)
{
    if ((l->n_cell == 0 && !ROOM(l, cell, 0)) || !ROOM(l, cell, l->n_cell + 1)) return;
    l->cell[l->n_cell++] = l->n_loop;
    l->cell[l->n_cell] = l->n_loop;
}

void pal_cell_loops_face(pal_cell_loops *l, float sharp)
{
    if ((l->n_loop == 0 && !ROOM(l, loop, 0)) || !ROOM(l, loop, l->n_loop + 1)) return;
    if ((sharp > 0 || l->inside) && ROOM(l, face_tag, l->n_face_tag))
        l->face_tag[l->n_face_tag++] = (pal_cell_tag){l->n_loop, l->inside, sharp};
    l->loop[l->n_loop++] = l->n_corner;
    l->loop[l->n_loop] = l->n_corner;
    l->cell[l->n_cell] = l->n_loop;
}

void pal_cell_loops_corners(pal_cell_loops *l, const int32_t *vertex, int n)
{
    for (int k = 0; k < n && ROOM(l, corner, l->n_corner); k++) {
        l->corner[l->n_corner++] = vertex[k];
        l->loop[l->n_loop] = l->n_corner;
    }
}

void pal_cell_loops_quad(pal_cell_loops *l, float sharp, int32_t a, int32_t b, int32_t c, int32_t d)
{
    pal_cell_loops_face(l, sharp);
    pal_cell_loops_corners(l, (const int32_t[]){a, b, c, d}, 4);
}

void pal_cell_loops_edge(pal_cell_loops *l, int32_t a, int32_t b, float sharp)
{
    if (sharp > 0 && ROOM(l, edge_tag, l->n_edge_tag)) l->edge_tag[l->n_edge_tag++] = (pal_cell_tag){a, b, sharp};
}

const int32_t pal_cell_hex_loop[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

void pal_cell_loops_hex(pal_cell_loops *l, const int32_t vertex[8])
{
    pal_cell_loops_cell(l);
    for (int f = 0; f < 6; f++) {
        pal_cell_loops_face(l, 0);
        for (int k = 0; k < 4; k++) pal_cell_loops_corners(l, &vertex[pal_cell_hex_loop[f][k]], 1);
    }
}

static bool is_edge_kept(const pal_cells *c, const bool *keep, int32_t e)
{
    int32_t k = c->edge_cell.start[e], after = c->edge_cell.start[e + 1];
    while (k < after && !keep[c->edge_cell.item[k]]) k++;
    return k < after;
}

void pal_cell_loops_append(pal_cell_loops *l, const pal_cells *c, const bool *keep, const int32_t *map)
{
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (keep && !keep[i]) continue;
        pal_cell_loops_cell(l);
        for (int32_t f = c->cell_use[i]; f < c->cell_use[i + 1]; f++) {
            l->inside = c->face[c->face_use[f].face].inside;
            pal_cell_loops_face(l, c->face[c->face_use[f].face].sharp);
            l->inside = false;
            for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++)
                pal_cell_loops_corners(l, map ? &map[c->edge_use[u].vertex] : &c->edge_use[u].vertex, 1);
        }
    }
    for (int32_t e = 0; e < c->n_edge; e++) {
        const int32_t *end = c->edge[e].vertex;
        if (keep && !is_edge_kept(c, keep, e)) continue;
        pal_cell_loops_edge(l, map ? map[end[0]] : end[0], map ? map[end[1]] : end[1], c->edge[e].sharp);
    }
}

pal_err pal_cell_loops_finish(pal_cell_loops *l, pal_cells *out, pal_diagnostic *diag)
{
    pal_err err = l->err ? pal_diagnostic_set(diag, l->err, "cells: no memory for %d cells", l->n_cell)
                         : pal_cells_make(l, out, diag);
    pal_cell_loops_free(l);
    return err;
}

pal_err pal_cells_loops(const pal_cells *cells, const bool *keep, pal_cell_loops *out, int32_t *kept)
{
    pal_cell_loops l = {0};
    for (int32_t v = 0; v < cells->n_vertex; v++)
        pal_cell_loops_vertex(&l, cells->x + 3 * (size_t)v, cells->vertex_sharpness[v]);
    pal_cell_loops_append(&l, cells, keep, NULL);
    pal_err err = l.err;
    if (!err && keep) err = pal_cell_loops_drop_unused(&l, kept);
    if (err)
        pal_cell_loops_free(&l);
    else
        *out = l;
    return err;
}

pal_err pal_cell_loops_drop_unused(pal_cell_loops *l, int32_t *kept)
{
    pal_err err = PAL_ERR_OK;
    int32_t *number, n = 0;
    PAL_ZEROED(&err, number, l->n_vertex);
    if (err) return err;
    for (int32_t k = 0; k < l->n_corner; k++) number[l->corner[k]] = 1;
    for (int32_t v = 0; v < l->n_vertex; v++) {
        if (!number[v]) continue;
        pal_copy3(l->x + 3 * (size_t)n, l->x + 3 * (size_t)v);
        l->vertex_sharpness[n] = l->vertex_sharpness[v];
        if (l->vertex_line) l->vertex_line[n] = l->vertex_line[v];
        if (kept) kept[n] = v;
        number[v] = n++;
    }
    for (int32_t k = 0; k < l->n_corner; k++) l->corner[k] = number[l->corner[k]];
    for (int32_t t = 0; t < l->n_edge_tag; t++)
        l->edge_tag[t].a = number[l->edge_tag[t].a], l->edge_tag[t].b = number[l->edge_tag[t].b];
    l->n_vertex = n;
    free(number);
    return PAL_ERR_OK;
}

void pal_cells_use_centre(const pal_cells *c, const double *x, int32_t face_use, double out[3])
{
    int32_t first = c->face_use[face_use].first_use, end = c->face_use[face_use + 1].first_use;
    pal_set3(out, 0, 0, 0);
    for (int32_t u = first; u < end; u++) pal_add3(out, out, x + 3 * (size_t)c->edge_use[u].vertex);
    pal_scale3(out, 1.0 / (end - first), out);
}

void pal_cells_face_centre(const pal_cells *cells, const double *x, int32_t face, double out[3])
{
    pal_cells_use_centre(cells, x ? x : cells->x, cells->face[face].use[0], out);
}

void pal_cells_cell_centre(const pal_cells *cells, const double *x, int32_t cell, double out[3])
{
    const double *p = x ? x : cells->x;
    int32_t first = cells->cell_vertex.start[cell], end = cells->cell_vertex.start[cell + 1];
    pal_set3(out, 0, 0, 0);
    for (int32_t k = first; k < end; k++) pal_add3(out, out, p + 3 * (size_t)cells->cell_vertex.item[k]);
    pal_scale3(out, 1.0 / (end - first), out);
}

/* vector area and longest edge squared of a face use */
static double use_area(const pal_cells *c, const double *x, int32_t face_use, double out[3])
{
    int32_t first = c->face_use[face_use].first_use, end = c->face_use[face_use + 1].first_use;
    const double *o = x + 3 * (size_t)c->edge_use[first].vertex;
    double longest = 0, d[3], a[3];
    pal_set3(out, 0, 0, 0);
    for (int32_t u = first; u < end; u++) {
        const double *v = x + 3 * (size_t)c->edge_use[u].vertex;
        const double *w = x + 3 * (size_t)c->edge_use[u + 1 < end ? u + 1 : first].vertex;
        pal_sub3(d, w, v);
        pal_normal3(a, o, v, w);
        pal_axpy3(out, 0.5, a);
        longest = fmax(longest, pal_dot3(d, d));
    }
    return longest;
}

void pal_cells_face_area(const pal_cells *cells, const double *x, int32_t face, double out[3])
{
    use_area(cells, x ? x : cells->x, cells->face[face].use[0], out);
}

double pal_cells_cone(const double *x, const int32_t *corner, int stride, int n, const double o[3])
{
    double centre[3] = {0}, normal[3], sum = 0;
    for (int k = 0; k < n; k++) pal_add3(centre, centre, x + 3 * (size_t)corner[k * stride]);
    pal_scale3(centre, 1.0 / n, centre);
    pal_sub3(centre, centre, o);
    for (int k = 0; k < n; k++) {
        pal_normal3(normal, o, x + 3 * (size_t)corner[k * stride],
                    x + 3 * (size_t)corner[(k + 1 < n ? k + 1 : 0) * stride]);
        sum += pal_dot3(normal, centre);
    }
    return sum;
}

double pal_cells_cell_volume(const pal_cells *c, const double *x, int32_t cell)
{
    const double *p = x ? x : c->x;
    double o[3], sum = 0;
    const int stride = sizeof *c->edge_use / sizeof c->edge_use->vertex;
    pal_cells_cell_centre(c, p, cell, o);
    for (const pal_face_use *f = c->face_use + c->cell_use[cell]; f < c->face_use + c->cell_use[cell + 1]; f++)
        sum += pal_cells_cone(p, &c->edge_use[f->first_use].vertex, stride, f[1].first_use - f->first_use, o);
    return sum / 6;
}

double pal_cells_volume(const pal_cells *cells, const double *x)
{
    double sum = 0;
    for (int32_t i = 0; i < cells->n_cell; i++) sum += pal_cells_cell_volume(cells, x, i);
    return sum;
}

bool pal_cells_shape_valid(const pal_cells *c, const double *x, pal_cells_fault *fault)
{
    const double *p = x ? x : c->x;
    pal_cells_fault f = {.cell = -1, .face_use = -1};
    for (int32_t k = 0; k < c->n_face && f.cell < 0; k++) {
        int32_t use = c->face[k].use[0];
        double area[3], longest = use_area(c, p, use, area);
        if (pal_norm3(area) > MIN_SHAPE * longest) continue; /* NaN does not pass */
        f = (pal_cells_fault){c->face_use[use].cell, use, pal_norm3(area), sqrt(longest)};
    }
    for (int32_t i = 0; i < c->n_cell && f.cell < 0; i++) {
        double volume = pal_cells_cell_volume(c, p, i), low[3], high[3];
        pal_box3_empty(low, high);
        for (int32_t k = c->cell_vertex.start[i]; k < c->cell_vertex.start[i + 1]; k++)
            pal_box3_add(low, high, p + 3 * (size_t)c->cell_vertex.item[k]);
        double d = pal_dist3(low, high);
        if (volume > MIN_SHAPE * d * d * d) continue;
        f = (pal_cells_fault){i, -1, volume, d};
    }
    if (fault) *fault = f;
    return f.cell < 0;
}
