/* Cells in files: choice of the format, the palcells text format, and code that both formats share. The format is
 * specified in cell_file.h. */
#include "server/mesh/cells/cell_file.h"

#include "server/mesh/cells/cell_reader.h"
#include "server/mesh/files/file_bytes.h"

#include <stdlib.h>
#include <string.h>

#define MAX_BYTES ((size_t)256 << 20)
#define MAX_ITEMS ((size_t)1 << 29)

/* ---- growing arrays ---- */

pal_err pal_cell_reader_refuse(const pal_cell_reader *reader, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    pal_err err = pal_file_refuse(reader->diag, reader->name, "line", reader->scan.line, format, list);
    va_end(list);
    return err;
}

pal_err pal_cell_reader_grow(const pal_cell_reader *reader, void **array, size_t n, size_t *cap, size_t size)
{
    if (n < *cap) return PAL_ERR_OK;
    if (n >= MAX_ITEMS)
        return pal_diagnostic_set(reader->diag, PAL_ERR_BUDGET, "%s: line %lld: more than %zu items", reader->name,
                                  (long long)reader->scan.line, MAX_ITEMS);
    size_t more = *cap ? 2 * *cap : 16;
    void *bigger = realloc(*array, more * size);
    if (!bigger)
        return pal_diagnostic_set(reader->diag, PAL_ERR_MEMORY, "%s: no memory for %zu bytes", reader->name,
                                  more * size);
    *array = bigger, *cap = more;
    return PAL_ERR_OK;
}

#define GROW(field, n, cap) PAL_TRY(pal_cell_reader_grow(r, (void **)&r->field, (n), &r->cap, sizeof *r->field))

pal_err pal_cell_reader_vertex(pal_cell_reader *reader, const double x[3])
{
    pal_cell_reader *r = reader;
    size_t n = (size_t)r->l.n_vertex;
    PAL_TRY(pal_cell_reader_grow(r, (void **)&r->l.x, n, &r->cap_x, 3 * sizeof *r->l.x));
    GROW(l.vertex_line, n, cap_vertex_line);
    memcpy(r->l.x + 3 * n, x, 3 * sizeof *x);
    r->l.vertex_line[n] = r->scan.line;
    r->l.n_vertex++;
    return PAL_ERR_OK;
}

/* starts reserve one entry more than they use, for the end */
pal_err pal_cell_reader_cell(pal_cell_reader *reader)
{
    pal_cell_reader *r = reader;
    GROW(l.cell, (size_t)r->l.n_cell + 1, cap_cell);
    r->l.cell[r->l.n_cell++] = (int32_t)r->n_loop;
    return PAL_ERR_OK;
}

pal_err pal_cell_reader_loop(pal_cell_reader *reader, int64_t line)
{
    pal_cell_reader *r = reader;
    GROW(l.loop, r->n_loop + 1, cap_loop);
    GROW(l.line, r->n_loop, cap_line);
    r->l.line[r->n_loop] = line;
    r->l.loop[r->n_loop++] = (int32_t)r->n_corner;
    return PAL_ERR_OK;
}

pal_err pal_cell_reader_corner(pal_cell_reader *reader, int32_t vertex)
{
    pal_cell_reader *r = reader;
    GROW(l.corner, r->n_corner, cap_corner);
    r->l.corner[r->n_corner++] = vertex;
    return PAL_ERR_OK;
}

/* ---- palcells ---- */

static pal_err end_line(pal_cell_reader *r)
{
    if (!pal_text_more(&r->scan)) return PAL_ERR_OK;
    return pal_cell_reader_refuse(r, "%s at the end of the line", pal_text_excerpt_at(&r->scan).text);
}

static pal_err read_vertex(pal_cell_reader *r)
{
    double x[3];
    for (int a = 0; a < 3; a++)
        if (!pal_text_double(&r->scan, &x[a]))
            return pal_cell_reader_refuse(r, "a position needs three numbers, found %s",
                                          pal_text_excerpt_at(&r->scan).text);
    PAL_TRY(pal_cell_reader_vertex(r, x));
    return end_line(r);
}

/* a number from 1 to most, as one from 0 */
static pal_err read_number(pal_cell_reader *r, const char *what, int64_t max, int32_t *out)
{
    int64_t i;
    if (!pal_text_int(&r->scan, &i))
        return pal_cell_reader_refuse(r, "%s must be a number, found %s", what, pal_text_excerpt_at(&r->scan).text);
    if (i < 1 || i > max)
        return pal_cell_reader_refuse(r, "%s %lld, there are %lld before this line", what, (long long)i,
                                      (long long)max);
    *out = (int32_t)(i - 1);
    return PAL_ERR_OK;
}

static pal_err read_loop(pal_cell_reader *r)
{
    if (r->l.n_cell == 0) return pal_cell_reader_refuse(r, "a face before the first cell");
    PAL_TRY(pal_cell_reader_loop(r, r->scan.line));
    while (pal_text_more(&r->scan)) {
        int32_t v = 0;
        PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &v));
        PAL_TRY(pal_cell_reader_corner(r, v));
    }
    return PAL_ERR_OK;
}

static pal_err read_sharp(pal_cell_reader *r, float *out)
{
    double sharp;
    if (!pal_text_double(&r->scan, &sharp))
        return pal_cell_reader_refuse(r, "a sharpness must be a number, found %s", pal_text_excerpt_at(&r->scan).text);
    if (!(sharp >= 0 && sharp <= (double)PAL_SHARPNESS_MAX))
        return pal_cell_reader_refuse(r, "sharpness %g, must be 0 to %g", sharp, (double)PAL_SHARPNESS_MAX);
    *out = (float)sharp;
    return end_line(r);
}

/* sharpnesses of vertices up to the last one named, 0 for those between */
static pal_err read_vertex_sharp(pal_cell_reader *r, size_t *cap)
{
    int32_t v = 0;
    float sharp = 0;
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &v));
    PAL_TRY(read_sharp(r, &sharp));
    while (r->n_sharp <= (size_t)v) {
        PAL_TRY(
            pal_cell_reader_grow(r, (void **)&r->l.vertex_sharpness, r->n_sharp, cap, sizeof *r->l.vertex_sharpness));
        r->l.vertex_sharpness[r->n_sharp++] = 0;
    }
    r->l.vertex_sharpness[v] = sharp;
    return PAL_ERR_OK;
}

static pal_err read_edge_sharp(pal_cell_reader *r)
{
    pal_cell_tag tag = {0};
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &tag.a));
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &tag.b));
    PAL_TRY(read_sharp(r, &tag.sharp));
    GROW(l.edge_tag, (size_t)r->l.n_edge_tag, cap_edge_tag);
    GROW(l.tag_line, (size_t)r->l.n_edge_tag, cap_tag_line);
    r->l.tag_line[r->l.n_edge_tag] = r->scan.line;
    r->l.edge_tag[r->l.n_edge_tag++] = tag;
    return PAL_ERR_OK;
}

static pal_err read_face_sharp(pal_cell_reader *r)
{
    pal_cell_tag tag = {0};
    int32_t cell = 0, face = 0;
    PAL_TRY(read_number(r, "cell", r->l.n_cell, &cell));
    int32_t first = r->l.cell[cell], end = cell + 1 < r->l.n_cell ? r->l.cell[cell + 1] : (int32_t)r->n_loop;
    PAL_TRY(read_number(r, "face", end - first, &face));
    PAL_TRY(read_sharp(r, &tag.sharp));
    tag.a = first + face;
    GROW(l.face_tag, (size_t)r->l.n_face_tag, cap_face_tag);
    r->l.face_tag[r->l.n_face_tag++] = tag;
    return PAL_ERR_OK;
}

static pal_err read_line(pal_cell_reader *r, size_t *cap_sharp)
{
    pal_text_scan *scan = &r->scan;
    if (pal_text_is(scan, "v")) return read_vertex(r);
    if (pal_text_is(scan, "f")) return read_loop(r);
    if (pal_text_is(scan, "sv")) return read_vertex_sharp(r, cap_sharp);
    if (pal_text_is(scan, "se")) return read_edge_sharp(r);
    if (pal_text_is(scan, "sf")) return read_face_sharp(r);
    if (pal_text_is(scan, "c")) {
        PAL_TRY(end_line(r));
        if (r->l.n_cell > 0 && (size_t)r->l.cell[r->l.n_cell - 1] == r->n_loop)
            return pal_cell_reader_refuse(r, "cell %d has no faces", r->l.n_cell);
        return pal_cell_reader_cell(r);
    }
    return pal_cell_reader_refuse(r, "a line begins with %s, known are v, c, f, sv, se, sf",
                                  pal_text_excerpt_at(scan).text);
}

static pal_err read_palcells(pal_cell_reader *r)
{
    size_t cap_sharp = 0;
    int64_t version;
    r->scan.hash = true;
    if (!pal_text_is(&r->scan, "palcells") || !pal_text_int(&r->scan, &version) || version != 1)
        return pal_cell_reader_refuse(r, "the first line must be 'palcells 1'");
    PAL_TRY(end_line(r));
    while (pal_text_next_line(&r->scan))
        if (pal_text_more(&r->scan)) PAL_TRY(read_line(r, &cap_sharp));
    /* room for the vertices after the last one named */
    while (r->n_sharp > 0 && r->n_sharp < (size_t)r->l.n_vertex) {
        PAL_TRY(pal_cell_reader_grow(r, (void **)&r->l.vertex_sharpness, r->n_sharp, &cap_sharp,
                                     sizeof *r->l.vertex_sharpness));
        r->l.vertex_sharpness[r->n_sharp++] = 0;
    }
    r->l.count_from = 1;
    return PAL_ERR_OK;
}

/* ---- reading ---- */

static bool starts_with(const uint8_t *bytes, size_t n_byte, const char *text)
{
    size_t n = strlen(text);
    return n_byte >= n && !memcmp(bytes, text, n);
}

/* completes the loops and builds the complex; the builder's message follows the file's name */
static pal_err finish(pal_cell_reader *r, bool vtk, pal_cells *out)
{
    if (r->l.n_vertex == 0 || r->l.n_cell == 0)
        return pal_cell_reader_refuse(r, "the file ends with %d vertices and %d cells", r->l.n_vertex, r->l.n_cell);
    if (r->n_loop == 0) return pal_cell_reader_refuse(r, "the file ends without a face");
    r->l.cell[r->l.n_cell] = (int32_t)r->n_loop;
    r->l.loop[r->n_loop] = (int32_t)r->n_corner;
    if (r->n_corner == 0) return pal_cell_reader_refuse(r, "the file ends without a corner");
    if (vtk) PAL_TRY(pal_cell_loops_keep(&r->l, NULL, NULL));
    pal_diagnostic inner = {""};
    pal_err err = pal_cells_make(&r->l, out, &inner);
    const char *text = inner.text + (starts_with((const uint8_t *)inner.text, strlen(inner.text), "cells: ") ? 7 : 0);
    return err ? pal_diagnostic_set(r->diag, err, "%s: %.360s", r->name, text) : PAL_ERR_OK;
}

pal_err pal_cell_file_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_cells *out, pal_diagnostic *diag)
{
    char shown[128];
    pal_file_printable_name(shown, name);
    pal_cell_reader r = {
        .name = shown, .diag = diag, .scan = {.at = bytes, .end = bytes + n_byte, .line = 1}, .l = {.count_from = 0}};
    bool vtk = starts_with(bytes, n_byte, "# vtk");
    pal_err err = PAL_ERR_OK;
    if (n_byte > MAX_BYTES)
        err = pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%s: %zu bytes, at most %zu are read", shown, n_byte, MAX_BYTES);
    else if (vtk)
        err = pal_cell_vtk_read(&r);
    else
        err = read_palcells(&r);
    if (!err) err = finish(&r, vtk, out);
    pal_cell_loops_free(&r.l);
    return err;
}

pal_err pal_cell_file_load(const char *path, pal_cells *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, MAX_BYTES, &bytes, &n_byte, diag));
    pal_err err = pal_cell_file_parse(path, bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

/* ---- writing ---- */

void pal_cell_write_number(FILE *file, double value)
{
    char text[40];
    snprintf(text, sizeof text, "%.17g", value);
    for (char *c = text; *c; c++)
        if (*c == ',') *c = '.'; /* the decimal point of the locale */
    fputs(text, file);
}

static void write_palcells(const pal_cells *c, FILE *file)
{
    fputs("palcells 1\n", file);
    for (int32_t v = 0; v < c->n_vertex; v++) {
        fputc('v', file);
        for (int a = 0; a < 3; a++) {
            fputc(' ', file);
            pal_cell_write_number(file, c->x[3 * (size_t)v + (size_t)a]);
        }
        fputc('\n', file);
    }
    for (int32_t i = 0; i < c->n_cell; i++) {
        fputs("c\n", file);
        for (int32_t f = c->cell_use[i]; f < c->cell_use[i + 1]; f++) {
            fputc('f', file);
            for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++)
                fprintf(file, " %d", c->edge_use[u].vertex + 1);
            fputc('\n', file);
        }
    }
    for (int32_t v = 0; v < c->n_vertex; v++)
        if (c->vertex_sharpness[v] > 0)
            fprintf(file, "sv %d ", v + 1), pal_cell_write_number(file, (double)c->vertex_sharpness[v]),
                fputc('\n', file);
    for (int32_t e = 0; e < c->n_edge; e++)
        if (c->edge[e].sharp > 0) {
            fprintf(file, "se %d %d ", c->edge[e].vertex[0] + 1, c->edge[e].vertex[1] + 1);
            pal_cell_write_number(file, (double)c->edge[e].sharp);
            fputc('\n', file);
        }
    for (int32_t f = 0; f < c->n_face; f++)
        if (c->face[f].sharp > 0) {
            const pal_face_use *use = &c->face_use[c->face[f].use[0]];
            fprintf(file, "sf %d %d ", use->cell + 1, c->face[f].use[0] - c->cell_use[use->cell] + 1);
            pal_cell_write_number(file, (double)c->face[f].sharp);
            fputc('\n', file);
        }
}

pal_err pal_cell_file_bytes(const pal_cells *cells, bool vtk, uint8_t **bytes, size_t *n_byte)
{
    char *text = NULL;
    size_t n = 0;
    FILE *file = open_memstream(&text, &n);
    if (!file) return PAL_ERR_MEMORY;
    if (vtk)
        pal_cell_vtk_write(cells, file);
    else
        write_palcells(cells, file);
    bool bad = ferror(file) != 0;
    bad |= fclose(file) != 0;
    if (bad) {
        free(text);
        return PAL_ERR_MEMORY;
    }
    *bytes = (uint8_t *)text, *n_byte = n;
    return PAL_ERR_OK;
}

pal_err pal_cell_file_save(const pal_cells *cells, const char *path, pal_diagnostic *diag)
{
    size_t n = strlen(path), n_byte;
    bool vtk = n >= 4 && !strcmp(path + n - 4, ".vtk"), ours = n >= 9 && !strcmp(path + n - 9, ".palcells");
    char shown[128];
    uint8_t *bytes;
    pal_file_printable_name(shown, path);
    if (!vtk && !ours)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: cells are written to .palcells or .vtk files", shown);
    if (pal_cell_file_bytes(cells, vtk, &bytes, &n_byte))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for the text of %d cells", shown, cells->n_cell);
    pal_err err = pal_file_write(path, bytes, n_byte, diag);
    free(bytes);
    return err;
}
