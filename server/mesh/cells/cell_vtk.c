/* Cells in legacy VTK files, ASCII, up to version 4.2 (VTK User's Guide, "VTK File Formats").
 *
 * The corner orders are those of VTK. There the first triangle of a wedge faces outward, but writers disagree, so every
 * cell with negative volume is reversed. Cells that are no tetrahedron, hexahedron, wedge or pyramid are written as
 * polyhedra. */
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_reader.h"

#include <stdlib.h>
#include <string.h>

enum { TETRAHEDRON = 10, HEXAHEDRON = 12, WEDGE = 13, PYRAMID = 14, POLYHEDRON = 42 };

/* faces of VTK's corners, counter-clockwise from outside; -1 ends a face */
typedef struct kind {
    int type, n_corner, n_face;
    signed char face[6][5];
} kind;

static const kind KINDS[4] = {
    {TETRAHEDRON, 4, 4, {{0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}, {0, 2, 1, -1}}},
    {HEXAHEDRON,
     8,
     6,
     {{0, 4, 7, 3, -1}, {1, 2, 6, 5, -1}, {0, 1, 5, 4, -1}, {3, 7, 6, 2, -1}, {0, 3, 2, 1, -1}, {4, 5, 6, 7, -1}}},
    {WEDGE, 6, 5, {{0, 1, 2, -1}, {3, 5, 4, -1}, {0, 3, 4, 1, -1}, {1, 4, 5, 2, -1}, {2, 5, 3, 0, -1}}},
    {PYRAMID, 5, 5, {{0, 3, 2, 1, -1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}},
};

static const kind *find_kind(int64_t type)
{
    for (size_t k = 0; k < sizeof KINDS / sizeof *KINDS; k++)
        if (KINDS[k].type == type) return &KINDS[k];
    return NULL;
}

/* ---- reading ---- */

/* the numbers of CELLS, cell after cell, and where each cell's begin */
typedef struct lists {
    int32_t *item, *start;
    int64_t *line;
    size_t n_item, n_cell, cap_item, cap_start, cap_line;
} lists;

/* a number from least to most, on this line or a later one */
static pal_err take_int(pal_cell_reader *r, const char *what, int64_t min, int64_t max, int64_t *out)
{
    if (!pal_text_seek(&r->scan)) return pal_cell_reader_refuse(r, "the file ends where %s should be", what);
    if (!pal_text_int(&r->scan, out))
        return pal_cell_reader_refuse(r, "%s must be a number, found %s", what, pal_text_excerpt_at(&r->scan).text);
    if (*out < min || *out > max)
        return pal_cell_reader_refuse(r, "%s is %lld, must be %lld to %lld", what, (long long)*out, (long long)min,
                                      (long long)max);
    return PAL_ERR_OK;
}

static pal_err take_double(pal_cell_reader *r, const char *what, double *out)
{
    if (!pal_text_seek(&r->scan)) return pal_cell_reader_refuse(r, "the file ends where %s should be", what);
    if (!pal_text_double(&r->scan, out))
        return pal_cell_reader_refuse(r, "%s must be a number, found %s", what, pal_text_excerpt_at(&r->scan).text);
    return PAL_ERR_OK;
}

static pal_err take_word(pal_cell_reader *r, const char *word)
{
    if (pal_text_seek(&r->scan) && pal_text_is(&r->scan, word)) return PAL_ERR_OK;
    return pal_cell_reader_refuse(r, "%s should be here, found %s", word, pal_text_excerpt_at(&r->scan).text);
}

/* every number takes two bytes at least, so counts beyond that lie */
static int64_t max_numbers(const pal_cell_reader *r)
{
    return (r->scan.end - r->scan.at) / 2 + 1;
}

static pal_err read_head(pal_cell_reader *r)
{
    static const char head[] = "# vtk DataFile Version ";
    double version = 0;
    size_t n = sizeof head - 1, left = (size_t)(r->scan.end - r->scan.at);
    if (left < n || memcmp(r->scan.at, head, n)) return pal_cell_reader_refuse(r, "the first line must be '%sN'", head);
    r->scan.at += n;
    if (!pal_text_double(&r->scan, &version) || !(version >= 1 && version < 5))
        return pal_cell_reader_refuse(r, "VTK version %g, versions 1 to 4.2 are read", version);
    pal_text_next_line(&r->scan);
    pal_text_next_line(&r->scan);
    if (pal_text_is(&r->scan, "BINARY"))
        return pal_cell_reader_refuse(r, "a binary VTK file: save it as ASCII, that is what is read");
    PAL_TRY(take_word(r, "ASCII"));
    PAL_TRY(take_word(r, "DATASET"));
    return take_word(r, "UNSTRUCTURED_GRID");
}

static pal_err read_points(pal_cell_reader *r)
{
    int64_t n;
    PAL_TRY(take_word(r, "POINTS"));
    PAL_TRY(take_int(r, "the number of points", 1, max_numbers(r), &n));
    if (pal_text_word(&r->scan) == 0) return pal_cell_reader_refuse(r, "POINTS must say float or double");
    for (int64_t i = 0; i < n; i++) {
        double x[3];
        for (int a = 0; a < 3; a++) PAL_TRY(take_double(r, "a coordinate", &x[a]));
        PAL_TRY(pal_cell_reader_vertex(r, x));
    }
    return PAL_ERR_OK;
}

static pal_err read_lists(pal_cell_reader *r, lists *at)
{
    int64_t n, n_number, value, left;
    PAL_TRY(take_word(r, "CELLS"));
    PAL_TRY(take_int(r, "the number of cells", 1, max_numbers(r), &n));
    PAL_TRY(take_int(r, "the count of numbers", n, max_numbers(r), &n_number));
    for (int64_t i = 0; i < n; i++) {
        PAL_TRY(take_int(r, "the length of a cell", 1, n_number, &left));
        PAL_TRY(pal_cell_reader_grow(r, (void **)&at->start, at->n_cell + 1, &at->cap_start, sizeof *at->start));
        PAL_TRY(pal_cell_reader_grow(r, (void **)&at->line, at->n_cell, &at->cap_line, sizeof *at->line));
        at->line[at->n_cell] = r->scan.line;
        at->start[at->n_cell++] = (int32_t)at->n_item;
        n_number -= left + 1;
        if (n_number < 0) return pal_cell_reader_refuse(r, "cells have more numbers than CELLS says");
        for (; left > 0; left--) {
            PAL_TRY(take_int(r, "a corner", 0, INT32_MAX, &value));
            PAL_TRY(pal_cell_reader_grow(r, (void **)&at->item, at->n_item, &at->cap_item, sizeof *at->item));
            at->item[at->n_item++] = (int32_t)value;
        }
    }
    at->start[at->n_cell] = (int32_t)at->n_item;
    return PAL_ERR_OK;
}

/* message about cell i, at its line */
static pal_err refuse_cell(const pal_cell_reader *r, const lists *at, size_t i, const char *what, int64_t number)
{
    pal_cell_reader there = *r;
    there.scan.line = at->line[i];
    return pal_cell_reader_refuse(&there, "cell %zu: %s %lld", i, what, (long long)number);
}

static pal_err add_polyhedron(pal_cell_reader *r, const lists *at, size_t i)
{
    const int32_t *item = at->item + at->start[i], *end = at->item + at->start[i + 1];
    int32_t n_face = *item++;
    for (int32_t f = 0; f < n_face; f++) {
        if (item == end || *item > end - item - 1)
            return refuse_cell(r, at, i, "a polyhedron whose numbers end within face", f);
        int32_t n = *item++;
        PAL_TRY(pal_cell_reader_loop(r, at->line[i]));
        for (int32_t k = 0; k < n; k++) PAL_TRY(pal_cell_reader_corner(r, *item++));
    }
    if (item != end) return refuse_cell(r, at, i, "a polyhedron with numbers left after faces", n_face);
    return PAL_ERR_OK;
}

static pal_err add_cell(pal_cell_reader *r, const lists *at, size_t i, int64_t type)
{
    const int32_t *item = at->item + at->start[i];
    const int32_t n = at->start[i + 1] - at->start[i];
    const kind *k = find_kind(type);
    PAL_TRY(pal_cell_reader_cell(r));
    if (type == POLYHEDRON) return add_polyhedron(r, at, i);
    if (!k) return refuse_cell(r, at, i, "types 10, 12, 13, 14 and 42 are read, not", type);
    if (n != k->n_corner) return refuse_cell(r, at, i, "its type does not go with this number of corners:", n);
    for (int f = 0; f < k->n_face; f++) {
        PAL_TRY(pal_cell_reader_loop(r, at->line[i]));
        for (int c = 0; k->face[f][c] >= 0; c++) PAL_TRY(pal_cell_reader_corner(r, item[k->face[f][c]]));
    }
    return PAL_ERR_OK;
}

/* reverses the loops of the last cell when its volume is negative; the builder checks the range of corners */
static void reverse_cell(pal_cell_reader *r)
{
    size_t first = (size_t)r->l.cell[r->l.n_cell - 1];
    double sum = 0;
    for (size_t l = first; l < r->n_loop; l++) {
        size_t from = (size_t)r->l.loop[l], end = l + 1 < r->n_loop ? (size_t)r->l.loop[l + 1] : r->n_corner;
        for (size_t k = from; k < end; k++)
            if (r->l.corner[k] >= r->l.n_vertex) return;
    }
    if (first == r->n_loop || (size_t)r->l.loop[first] == r->n_corner) return;
    const double *o = r->l.x + 3 * (size_t)r->l.corner[r->l.loop[first]];
    for (size_t l = first; l < r->n_loop; l++) {
        size_t from = (size_t)r->l.loop[l], end = l + 1 < r->n_loop ? (size_t)r->l.loop[l + 1] : r->n_corner;
        double centre[3] = {0, 0, 0}, p[3], q[3], n[3];
        for (size_t k = from; k < end; k++) {
            pal_sub3(p, r->l.x + 3 * (size_t)r->l.corner[k], o);
            pal_axpy3(centre, 1.0 / (double)(end - from), p);
        }
        for (size_t k = from; k < end; k++) {
            pal_sub3(p, r->l.x + 3 * (size_t)r->l.corner[k], o);
            pal_sub3(q, r->l.x + 3 * (size_t)r->l.corner[k + 1 < end ? k + 1 : from], o);
            pal_cross3(n, p, q);
            sum += pal_dot3(n, centre);
        }
    }
    if (!(sum < 0)) return;
    for (size_t l = first; l < r->n_loop; l++) {
        size_t from = (size_t)r->l.loop[l], end = l + 1 < r->n_loop ? (size_t)r->l.loop[l + 1] : r->n_corner;
        for (size_t a = from, b = end; a + 1 < b; a++) {
            int32_t keep = r->l.corner[a];
            r->l.corner[a] = r->l.corner[--b], r->l.corner[b] = keep;
        }
    }
}

/* the builder checks corners too, but only after unused points are gone */
static pal_err check_corners(const pal_cell_reader *r, const lists *at, size_t i, size_t first)
{
    for (size_t k = first; k < r->n_corner; k++)
        if (r->l.corner[k] >= r->l.n_vertex) return refuse_cell(r, at, i, "there is no point", r->l.corner[k]);
    return PAL_ERR_OK;
}

static pal_err read_types(pal_cell_reader *r, const lists *at)
{
    int64_t n, type;
    PAL_TRY(take_word(r, "CELL_TYPES"));
    PAL_TRY(take_int(r, "the number of cell types", (int64_t)at->n_cell, (int64_t)at->n_cell, &n));
    for (size_t i = 0; i < at->n_cell; i++) {
        size_t first = r->n_corner;
        PAL_TRY(take_int(r, "a cell type", 0, 255, &type));
        PAL_TRY(add_cell(r, at, i, type));
        PAL_TRY(check_corners(r, at, i, first));
        reverse_cell(r);
    }
    return PAL_ERR_OK;
}

/* point data "sharp", if there is any; all other data is left out */
static pal_err read_sharp(pal_cell_reader *r)
{
    bool points = false;
    int64_t n;
    for (;;) {
        if (pal_text_is(&r->scan, "POINT_DATA"))
            points = true;
        else if (pal_text_is(&r->scan, "CELL_DATA"))
            points = false;
        else if (points && pal_text_is(&r->scan, "SCALARS") && pal_text_is(&r->scan, "sharp"))
            break;
        if (!pal_text_next_line(&r->scan)) return PAL_ERR_OK;
    }
    if (pal_text_word(&r->scan) == 0) return pal_cell_reader_refuse(r, "SCALARS sharp must say float or double");
    if (pal_text_more(&r->scan)) PAL_TRY(take_int(r, "the number of components", 1, 1, &n));
    PAL_TRY(take_word(r, "LOOKUP_TABLE"));
    pal_text_next_line(&r->scan);
    r->l.vertex_sharpness = calloc((size_t)r->l.n_vertex, sizeof *r->l.vertex_sharpness);
    if (!r->l.vertex_sharpness) return PAL_ERR_MEMORY;
    for (int32_t v = 0; v < r->l.n_vertex; v++) {
        double sharp;
        PAL_TRY(take_double(r, "a sharpness", &sharp));
        if (!(sharp >= 0 && sharp <= (double)PAL_SHARPNESS_MAX))
            return pal_cell_reader_refuse(r, "sharpness %g, must be 0 to %g", sharp, (double)PAL_SHARPNESS_MAX);
        r->l.vertex_sharpness[v] = (float)sharp;
    }
    return PAL_ERR_OK;
}

pal_err pal_cell_vtk_read(pal_cell_reader *reader)
{
    lists at = {0};
    pal_err err = read_head(reader);
    if (!err) err = read_points(reader);
    if (!err) err = read_lists(reader, &at);
    if (!err) err = read_types(reader, &at);
    free(at.item);
    free(at.start);
    free(at.line);
    return err ? err : read_sharp(reader);
}

/* ---- writing ---- */

/* VTK's corners of a cell that is one of KINDS, from the loop of its first face with as many corners as the base; the
 * vertex opposite a corner is at the third edge there. NULL: a polyhedron */
static const kind *list_corners(const pal_cells *c, int32_t cell, int32_t corner[8])
{
    int32_t base = -1, n_quad = 0, n_face = c->cell_use[cell + 1] - c->cell_use[cell];
    int32_t first = c->cell_vertex.start[cell], n_vertex = c->cell_vertex.start[cell + 1] - first, n_over = 0;
    const kind *k = NULL;
    for (size_t i = 0; i < sizeof KINDS / sizeof *KINDS; i++)
        if (KINDS[i].n_face == n_face && KINDS[i].n_corner == n_vertex) k = &KINDS[i];
    if (!k) return NULL;
    for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
        int32_t n = c->face_use[f + 1].first_use - c->face_use[f].first_use;
        if (n > 4) return NULL;
        n_quad += n == 4;
        if (base < 0 && n == (k->type == HEXAHEDRON || k->type == PYRAMID ? 4 : 3)) base = f;
    }
    if (n_quad != (k->type == HEXAHEDRON ? 6 : k->type == WEDGE ? 3 : k->type == PYRAMID) || base < 0) return NULL;
    for (int32_t i = first; i < first + n_vertex; i++) {
        int32_t u = c->corner_use[i],
                t = pal_cells_next_around(c, pal_cells_next_around(c, pal_cells_next_around(c, u)));
        n_over += t != u;
    }
    if (n_over != (k->type == PYRAMID)) return NULL;
    int32_t u = c->face_use[base].first_use, n = c->face_use[base + 1].first_use - u;
    for (int32_t i = 0; i < n; i++) {
        /* a wedge's base faces outward, the others' inward */
        int32_t to = k->type == WEDGE ? i : (n - i) % n;
        corner[to] = c->edge_use[u + i].vertex;
        if (to + n < n_vertex || to == 0)
            corner[to + n] = pal_cells_end_vertex(c, pal_cells_next_around(c, pal_cells_next_around(c, u + i)));
    }
    return k;
}

static int32_t polyhedron_numbers(const pal_cells *c, int32_t cell)
{
    return 1 + c->cell_use[cell + 1] - c->cell_use[cell] + c->face_use[c->cell_use[cell + 1]].first_use -
           c->face_use[c->cell_use[cell]].first_use;
}

static void write_polyhedron(const pal_cells *c, int32_t cell, FILE *file)
{
    fprintf(file, "%d %d", polyhedron_numbers(c, cell), c->cell_use[cell + 1] - c->cell_use[cell]);
    for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
        fprintf(file, " %d", c->face_use[f + 1].first_use - c->face_use[f].first_use);
        for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++)
            fprintf(file, " %d", c->edge_use[u].vertex);
    }
}

void pal_cell_vtk_write(const pal_cells *cells, FILE *file)
{
    const pal_cells *c = cells;
    int64_t n_number = 0;
    int32_t corner[8];
    bool sharp = false;
    fprintf(file, "# vtk DataFile Version 3.0\ncells\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %d double\n",
            c->n_vertex);
    for (size_t i = 0; i < 3 * (size_t)c->n_vertex; i++) {
        pal_cell_write_number(file, c->x[i]);
        fputc(i % 3 < 2 ? ' ' : '\n', file);
    }
    for (int32_t i = 0; i < c->n_cell; i++) {
        const kind *k = list_corners(c, i, corner);
        n_number += 1 + (k ? k->n_corner : polyhedron_numbers(c, i));
    }
    fprintf(file, "CELLS %d %lld\n", c->n_cell, (long long)n_number);
    for (int32_t i = 0; i < c->n_cell; i++) {
        const kind *k = list_corners(c, i, corner);
        if (k) {
            fprintf(file, "%d", k->n_corner);
            for (int n = 0; n < k->n_corner; n++) fprintf(file, " %d", corner[n]);
        } else {
            write_polyhedron(c, i, file);
        }
        fputc('\n', file);
    }
    fprintf(file, "CELL_TYPES %d\n", c->n_cell);
    for (int32_t i = 0; i < c->n_cell; i++) {
        const kind *k = list_corners(c, i, corner);
        fprintf(file, "%d\n", k ? k->type : POLYHEDRON);
    }
    for (int32_t v = 0; v < c->n_vertex; v++) sharp |= c->vertex_sharpness[v] > 0;
    if (!sharp) return;
    fprintf(file, "POINT_DATA %d\nSCALARS sharp double 1\nLOOKUP_TABLE default\n", c->n_vertex);
    for (int32_t v = 0; v < c->n_vertex; v++) {
        pal_cell_write_number(file, (double)c->vertex_sharpness[v]);
        fputc('\n', file);
    }
}
