/* Cells in legacy VTK files, ASCII, up to version 4.2 (VTK User's Guide, "VTK File Formats").
 *
 * The corner orders are those of VTK. There the first triangle of a wedge faces outward, but writers disagree, so every
 * cell with negative volume is reversed. Cells that are no tetrahedron, hexahedron, wedge or pyramid are written as
 * polyhedra. */
#include "server/base/heap.h"
#include "server/mesh/cells/cell_reader.h"

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

/* the numbers of CELLS, cell after cell, and where each cell's begin */
typedef struct lists {
    int32_t *item, *start;
    int64_t *line;
    size_t n_item, n_cell;
} lists;

static pal_err refuse_number(const pal_cell_reader *r, const char *what)
{
    if (r->scan.at == r->scan.end) return PAL_CELL_REFUSE(r, "the file ends where %s should be", what);
    return PAL_CELL_REFUSE(r, "%s must be a number, found %s", what, pal_text_excerpt_at(&r->scan).text);
}

/* a number from min to max, on this line or a later one */
static pal_err take_int(pal_cell_reader *r, const char *what, int64_t min, int64_t max, int64_t *out)
{
    if (!pal_text_seek(&r->scan) || !pal_text_int(&r->scan, out)) return refuse_number(r, what);
    if (*out < min || *out > max)
        return PAL_CELL_REFUSE(r, "%s is %lld, must be %lld to %lld", what, (long long)*out, (long long)min,
                               (long long)max);
    return PAL_ERR_OK;
}

static pal_err take_word(pal_cell_reader *r, const char *word)
{
    if (pal_text_seek(&r->scan) && pal_text_is(&r->scan, word)) return PAL_ERR_OK;
    return PAL_CELL_REFUSE(r, "%s should be here, found %s", word, pal_text_excerpt_at(&r->scan).text);
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
    if (left < n || memcmp(r->scan.at, head, n)) return PAL_CELL_REFUSE(r, "the first line must be '%sN'", head);
    r->scan.at += n;
    if (!pal_text_double(&r->scan, &version) || !(version >= 1 && version < 5))
        return PAL_CELL_REFUSE(r, "VTK version %g, versions 1 to 4.2 are read", version);
    pal_text_next_line(&r->scan);
    pal_text_next_line(&r->scan);
    if (pal_text_is(&r->scan, "BINARY"))
        return PAL_CELL_REFUSE(r, "a binary VTK file: save it as ASCII, that is what is read");
    PAL_TRY(take_word(r, "ASCII"));
    PAL_TRY(take_word(r, "DATASET"));
    return take_word(r, "UNSTRUCTURED_GRID");
}

static pal_err read_points(pal_cell_reader *r)
{
    int64_t n;
    PAL_TRY(take_word(r, "POINTS"));
    PAL_TRY(take_int(r, "the number of points", 1, max_numbers(r), &n));
    if (pal_text_word(&r->scan) == 0) return PAL_CELL_REFUSE(r, "POINTS must say float or double");
    for (int64_t i = 0; i < n; i++) {
        double x[3];
        for (int a = 0; a < 3; a++)
            if (!pal_text_seek(&r->scan) || !pal_text_double(&r->scan, &x[a])) return refuse_number(r, "a coordinate");
        pal_cell_reader_vertex(r, x);
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
        if ((i == 0 && !PAL_GROW(at->start, 0)) || !PAL_GROW(at->start, i + 1) || !PAL_GROW(at->line, i))
            return PAL_ERR_MEMORY;
        at->line[at->n_cell] = r->scan.line;
        at->start[at->n_cell++] = (int32_t)at->n_item;
        n_number -= left + 1;
        if (n_number < 0) return PAL_CELL_REFUSE(r, "cells have more numbers than CELLS says");
        for (; left > 0; left--) {
            PAL_TRY(take_int(r, "a corner", 0, INT32_MAX, &value));
            if (!PAL_GROW(at->item, at->n_item)) return PAL_ERR_MEMORY;
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
    return PAL_CELL_REFUSE(&there, "cell %zu: %s %lld", i, what, (long long)number);
}

static pal_err add_polyhedron(pal_cell_reader *r, const lists *at, size_t i)
{
    const int32_t *item = at->item + at->start[i], *end = at->item + at->start[i + 1];
    int32_t n_face = *item++;
    for (int32_t f = 0; f < n_face; f++) {
        if (item == end || *item > end - item - 1)
            return refuse_cell(r, at, i, "a polyhedron whose numbers end within face", f);
        int32_t n = *item++;
        pal_cell_reader_face(r, at->line[i]);
        pal_cell_loops_corners(&r->l, item, n);
        item += n;
    }
    if (item != end) return refuse_cell(r, at, i, "a polyhedron with numbers left after faces", n_face);
    return PAL_ERR_OK;
}

static pal_err add_cell(pal_cell_reader *r, const lists *at, size_t i, int64_t type)
{
    const int32_t *item = at->item + at->start[i];
    const int32_t n = at->start[i + 1] - at->start[i];
    const kind *k = NULL;
    for (size_t m = 0; m < sizeof KINDS / sizeof *KINDS; m++)
        if (KINDS[m].type == type) k = &KINDS[m];
    pal_cell_loops_cell(&r->l);
    if (type == POLYHEDRON) return add_polyhedron(r, at, i);
    if (!k) return refuse_cell(r, at, i, "types 10, 12, 13, 14 and 42 are read, not", type);
    if (n != k->n_corner) return refuse_cell(r, at, i, "its type does not go with this number of corners:", n);
    for (int f = 0; f < k->n_face; f++) {
        pal_cell_reader_face(r, at->line[i]);
        for (int c = 0; k->face[f][c] >= 0; c++) pal_cell_loops_corners(&r->l, &item[k->face[f][c]], 1);
    }
    return PAL_ERR_OK;
}

/* reverses the loops of the last cell when its volume is negative */
static void reverse_cell(pal_cell_reader *r)
{
    const pal_cell_loops *l = &r->l;
    const int32_t *corner = l->corner;
    int32_t first = l->cell[l->n_cell - 1];
    double sum = 0;
    if (first == l->n_loop || l->loop[first] == l->n_corner) return;
    const double *o = l->x + 3 * (size_t)corner[l->loop[first]];
    for (int32_t i = first; i < l->n_loop; i++)
        sum += pal_cells_cone(l->x, corner + l->loop[i], 1, l->loop[i + 1] - l->loop[i], o);
    if (!(sum < 0)) return;
    for (int32_t i = first; i < l->n_loop; i++)
        for (int32_t a = l->loop[i], b = l->loop[i + 1]; a + 1 < b; a++) {
            int32_t kept = corner[a];
            l->corner[a] = corner[--b], l->corner[b] = kept;
        }
}

static pal_err read_types(pal_cell_reader *r, const lists *at)
{
    int64_t n, type;
    PAL_TRY(take_word(r, "CELL_TYPES"));
    PAL_TRY(take_int(r, "the number of cell types", (int64_t)at->n_cell, (int64_t)at->n_cell, &n));
    for (size_t i = 0; i < at->n_cell; i++) {
        int32_t first = r->l.n_corner;
        PAL_TRY(take_int(r, "a cell type", 0, 255, &type));
        PAL_TRY(add_cell(r, at, i, type));
        PAL_TRY(r->l.err);
        /* the builder checks corners too, but only after unused points are gone */
        for (int32_t k = first; k < r->l.n_corner; k++)
            if (r->l.corner[k] >= r->l.n_vertex) return refuse_cell(r, at, i, "there is no point", r->l.corner[k]);
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
    if (pal_text_word(&r->scan) == 0) return PAL_CELL_REFUSE(r, "SCALARS sharp must say float or double");
    if (pal_text_more(&r->scan)) PAL_TRY(take_int(r, "the number of components", 1, 1, &n));
    PAL_TRY(take_word(r, "LOOKUP_TABLE"));
    pal_text_next_line(&r->scan);
    for (int32_t v = 0; v < r->l.n_vertex; v++) {
        if (!pal_text_seek(&r->scan)) return PAL_CELL_REFUSE(r, "the file ends where a sharpness should be");
        PAL_TRY(pal_cell_reader_sharp(r, &r->l.vertex_sharpness[v]));
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
    PAL_FREE(at.item, at.start, at.line);
    return err ? err : read_sharp(reader);
}

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

void pal_cell_vtk_write(const pal_cells *c, FILE *file)
{
    int64_t n_number = 0;
    int32_t corner[8];
    bool sharp = false;
    fprintf(file, "# vtk DataFile Version 3.0\ncells\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %d double\n",
            c->n_vertex);
    for (size_t i = 0; i < (size_t)c->n_vertex; i++) pal_file_put_line(file, c->x + 3 * i, 3);
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
    for (int32_t v = 0; v < c->n_vertex; v++) pal_file_put_line(file, (const double[]){c->vertex_sharpness[v]}, 1);
}
