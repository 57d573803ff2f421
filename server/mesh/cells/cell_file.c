/* Cells in files: choice of the format, the palcells text format, and code that both formats share. The format is
 * specified in cell_file.h. */
#include "server/mesh/cells/cell_file.h"

#include "server/base/heap.h"
#include "server/mesh/cells/cell_reader.h"
#include "server/mesh/geometry/tuning.h"

static void add_line(pal_cell_reader *r, int64_t **line, int32_t n, int64_t number)
{
    if (!r->l.err && !PAL_GROW(*line, n)) r->l.err = PAL_ERR_MEMORY;
    if (!r->l.err) (*line)[n] = number;
}

void pal_cell_reader_vertex(pal_cell_reader *reader, const double x[3])
{
    add_line(reader, &reader->l.vertex_line, reader->l.n_vertex, reader->scan.line);
    pal_cell_loops_vertex(&reader->l, x, 0);
}

void pal_cell_reader_face(pal_cell_reader *reader, int64_t line)
{
    add_line(reader, &reader->l.line, reader->l.n_loop, line);
    pal_cell_loops_face(&reader->l, 0);
}

pal_err pal_cell_reader_sharp(pal_cell_reader *reader, float *out)
{
    double sharp;
    if (!pal_text_double(&reader->scan, &sharp))
        return PAL_CELL_REFUSE(reader, "a sharpness must be a number, found %s",
                               pal_text_excerpt_at(&reader->scan).text);
    if (!(sharp >= 0 && sharp <= (double)PAL_SHARPNESS_MAX))
        return PAL_CELL_REFUSE(reader, "sharpness %g, must be 0 to %g", sharp, (double)PAL_SHARPNESS_MAX);
    *out = (float)sharp;
    return PAL_ERR_OK;
}

static pal_err end_line(pal_cell_reader *r)
{
    if (!pal_text_more(&r->scan)) return PAL_ERR_OK;
    return PAL_CELL_REFUSE(r, "%s at the end of the line", pal_text_excerpt_at(&r->scan).text);
}

static pal_err read_vertex(pal_cell_reader *r)
{
    double x[3];
    for (int a = 0; a < 3; a++)
        if (!pal_text_double(&r->scan, &x[a]))
            return PAL_CELL_REFUSE(r, "a position needs three numbers, found %s", pal_text_excerpt_at(&r->scan).text);
    pal_cell_reader_vertex(r, x);
    return PAL_ERR_OK;
}

/* a number from 1 to most, as one from 0 */
static pal_err read_number(pal_cell_reader *r, const char *what, int64_t max, int32_t *out)
{
    int64_t i;
    if (!pal_text_int(&r->scan, &i))
        return PAL_CELL_REFUSE(r, "%s must be a number, found %s", what, pal_text_excerpt_at(&r->scan).text);
    if (i < 1 || i > max)
        return PAL_CELL_REFUSE(r, "%s %lld, there are %lld before this line", what, (long long)i, (long long)max);
    *out = (int32_t)(i - 1);
    return PAL_ERR_OK;
}

static pal_err read_face(pal_cell_reader *r)
{
    if (r->l.n_cell == 0) return PAL_CELL_REFUSE(r, "a face before the first cell");
    pal_cell_reader_face(r, r->scan.line);
    while (pal_text_more(&r->scan)) {
        int32_t v = 0;
        PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &v));
        pal_cell_loops_corners(&r->l, &v, 1);
    }
    return PAL_ERR_OK;
}

static pal_err read_vertex_sharp(pal_cell_reader *r)
{
    int32_t v = 0;
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &v));
    return pal_cell_reader_sharp(r, &r->l.vertex_sharpness[v]);
}

/* also one of sharpness 0, so that an edge that no cell has is refused */
static pal_err add_tag(pal_cell_tag **list, int32_t *n, pal_cell_tag tag)
{
    if (!PAL_GROW(*list, *n)) return PAL_ERR_MEMORY;
    (*list)[(*n)++] = tag;
    return PAL_ERR_OK;
}

static pal_err read_edge_sharp(pal_cell_reader *r)
{
    pal_cell_tag tag = {0};
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &tag.a));
    PAL_TRY(read_number(r, "vertex", r->l.n_vertex, &tag.b));
    PAL_TRY(pal_cell_reader_sharp(r, &tag.sharp));
    add_line(r, &r->l.tag_line, r->l.n_edge_tag, r->scan.line);
    return add_tag(&r->l.edge_tag, &r->l.n_edge_tag, tag);
}

static pal_err read_face_sharp(pal_cell_reader *r)
{
    pal_cell_tag tag = {0};
    int32_t cell = 0, face = 0;
    PAL_TRY(read_number(r, "cell", r->l.n_cell, &cell));
    PAL_TRY(read_number(r, "face", r->l.cell[cell + 1] - r->l.cell[cell], &face));
    PAL_TRY(pal_cell_reader_sharp(r, &tag.sharp));
    tag.a = r->l.cell[cell] + face;
    return add_tag(&r->l.face_tag, &r->l.n_face_tag, tag);
}

static pal_err read_cell(pal_cell_reader *r)
{
    PAL_TRY(end_line(r));
    if (r->l.n_cell > 0 && r->l.cell[r->l.n_cell - 1] == r->l.n_loop)
        return PAL_CELL_REFUSE(r, "cell %d has no faces", r->l.n_cell);
    pal_cell_loops_cell(&r->l);
    return PAL_ERR_OK;
}

static pal_err read_line(pal_cell_reader *r)
{
    static const struct {
        const char *word;
        pal_err (*read)(pal_cell_reader *r);
    } known[] = {{"v", read_vertex},        {"c", read_cell},        {"f", read_face},
                 {"sv", read_vertex_sharp}, {"se", read_edge_sharp}, {"sf", read_face_sharp}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        if (!pal_text_is(&r->scan, known[k].word)) continue;
        PAL_TRY(known[k].read(r));
        return end_line(r);
    }
    return PAL_CELL_REFUSE(r, "a line begins with %s, known are v, c, f, sv, se, sf",
                           pal_text_excerpt_at(&r->scan).text);
}

static pal_err read_palcells(pal_cell_reader *r)
{
    int64_t version;
    r->scan.hash = true;
    if (!pal_text_is(&r->scan, "palcells") || !pal_text_int(&r->scan, &version) || version != 1)
        return PAL_CELL_REFUSE(r, "the first line must be 'palcells 1'");
    PAL_TRY(end_line(r));
    while (!r->l.err && pal_text_next_line(&r->scan))
        if (pal_text_more(&r->scan)) PAL_TRY(read_line(r));
    r->l.count_from = 1;
    return PAL_ERR_OK;
}

/* builds the complex from the loops; the builder's message follows the file's name */
static pal_err finish(pal_cell_reader *r, bool vtk, pal_cells *out)
{
    pal_err err = r->l.err;
    if (err) return pal_diagnostic_set(r->diag, err, "%s: no memory for its %d cells", r->name, r->l.n_cell);
    if (r->l.n_vertex == 0 || r->l.n_cell == 0)
        return PAL_CELL_REFUSE(r, "the file ends with %d vertices and %d cells", r->l.n_vertex, r->l.n_cell);
    if (r->l.n_loop == 0) return PAL_CELL_REFUSE(r, "the file ends without a face");
    if (r->l.n_corner == 0) return PAL_CELL_REFUSE(r, "the file ends without a corner");
    if (vtk) PAL_TRY(pal_cell_loops_drop_unused(&r->l, NULL));
    pal_diagnostic inner = {""};
    err = pal_cells_make(&r->l, out, &inner);
    const char *text = inner.text + (strncmp(inner.text, "cells: ", 7) ? 0 : 7);
    return err ? pal_diagnostic_set(r->diag, err, "%s: %.360s", r->name, text) : PAL_ERR_OK;
}

pal_err pal_cell_file_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_cells *out, pal_diagnostic *diag)
{
    char shown[128];
    pal_file_printable_name(shown, name);
    pal_cell_reader r = {.name = shown, .diag = diag, .scan = {.at = bytes, .end = bytes + n_byte, .line = 1}};
    bool vtk = n_byte >= 5 && !memcmp(bytes, "# vtk", 5);
    if (n_byte > CELL_MAX_BYTE)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%s: %zu bytes, at most %zu are read", shown, n_byte,
                                  CELL_MAX_BYTE);
    pal_err err = (vtk ? pal_cell_vtk_read : read_palcells)(&r);
    if (!err) err = finish(&r, vtk, out);
    pal_cell_loops_free(&r.l);
    return err;
}

pal_err pal_cell_file_load(const char *path, pal_cells *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, CELL_MAX_BYTE, &bytes, &n_byte, diag));
    pal_err err = pal_cell_file_parse(path, bytes, n_byte, out, diag);
    return PAL_FREED(err, bytes);
}

static void write_palcells(const pal_cells *c, FILE *file)
{
    fputs("palcells 1\n", file);
    for (int32_t v = 0; v < c->n_vertex; v++) {
        fputs("v ", file);
        pal_file_put_line(file, c->x + 3 * (size_t)v, 3);
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
    double sharp;
    for (int32_t v = 0; v < c->n_vertex; v++)
        if ((sharp = (double)c->vertex_sharpness[v]) > 0) {
            fprintf(file, "sv %d ", v + 1);
            pal_file_put_line(file, &sharp, 1);
        }
    for (int32_t e = 0; e < c->n_edge; e++)
        if ((sharp = (double)c->edge[e].sharp) > 0) {
            fprintf(file, "se %d %d ", c->edge[e].vertex[0] + 1, c->edge[e].vertex[1] + 1);
            pal_file_put_line(file, &sharp, 1);
        }
    for (int32_t f = 0; f < c->n_face; f++)
        if ((sharp = (double)c->face[f].sharp) > 0) {
            const pal_face_use *use = &c->face_use[c->face[f].use[0]];
            fprintf(file, "sf %d %d ", use->cell + 1, c->face[f].use[0] - c->cell_use[use->cell] + 1);
            pal_file_put_line(file, &sharp, 1);
        }
}

pal_err pal_cell_file_bytes(const pal_cells *cells, bool vtk, uint8_t **bytes, size_t *n_byte)
{
    char *text = NULL;
    size_t n = 0;
    FILE *file = open_memstream(&text, &n);
    if (!file) return PAL_ERR_MEMORY;
    (vtk ? pal_cell_vtk_write : write_palcells)(cells, file);
    bool bad = ferror(file) != 0;
    bad |= fclose(file) != 0;
    if (bad) return PAL_FREED(PAL_ERR_MEMORY, text);
    *bytes = (uint8_t *)text, *n_byte = n;
    return PAL_ERR_OK;
}

pal_err pal_cell_file_save(const pal_cells *cells, const char *path, pal_diagnostic *diag)
{
    size_t n_byte;
    bool vtk = pal_file_ends_with(path, ".vtk"), ours = pal_file_ends_with(path, ".palcells");
    char shown[128];
    uint8_t *bytes;
    pal_file_printable_name(shown, path);
    if (!vtk && !ours) return PAL_REFUSE(diag, "%s: cells are written to .palcells or .vtk files", shown);
    if (pal_cell_file_bytes(cells, vtk, &bytes, &n_byte))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for the text of %d cells", shown, cells->n_cell);
    pal_err err = pal_file_write(path, bytes, n_byte, diag);
    return PAL_FREED(err, bytes);
}
