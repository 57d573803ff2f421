/* CSV of sample points, read line by line. The names of the six columns are checked, so a file with another column
 * order is refused. Numbers are read by strtod in the C locale, which the commands never change. */
#include "server/solve/sample_points.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"

#include <stdio.h>

enum { COLUMNS = 6, WORD = 64 };
static const char *const column_name[COLUMNS] = {"x", "y", "z", "ux", "uy", "uz"};

typedef struct csv {
    const char *name;
    const char *at, *end; /* the current line, without its end */
    int line;
    pal_diagnostic *diag;
} csv;

static bool is_blank(char c)
{
    return c == ' ' || c == '\t';
}

/* advances to the next line; false: none */
static bool next_line(csv *c, const char **rest, const char *last)
{
    const char *from = *rest;
    if (from >= last) return false;
    const char *end = memchr(from, '\n', (size_t)(last - from));
    *rest = end ? end + 1 : last;
    c->at = from;
    c->end = end ? end : last;
    while (c->end > c->at && (c->end[-1] == '\r' || is_blank(c->end[-1]))) c->end--;
    while (c->at < c->end && is_blank(*c->at)) c->at++;
    c->line++;
    return true;
}

/* Copies a cell of the line to word, trimmed and truncated. False: no further cell. */
static bool next_cell(csv *c, char word[WORD])
{
    if (!c->at) return false;
    const char *comma = memchr(c->at, ',', (size_t)(c->end - c->at));
    const char *from = c->at, *end = comma ? comma : c->end;
    c->at = comma ? comma + 1 : NULL;
    while (from < end && is_blank(*from)) from++;
    while (end > from && is_blank(end[-1])) end--;
    size_t n = 0;
    for (; from < end && n < WORD - 1; from++) word[n++] = *from;
    word[n] = 0;
    return true;
}

/* a cell in printable form */
static const char *shown(char word[WORD])
{
    size_t n = 0;
    for (; word[n] && n < 24; n++)
        if ((unsigned char)word[n] < 0x20 || (unsigned char)word[n] > 0x7e) word[n] = '?';
    word[n] = 0;
    return word;
}

/* the names of the columns (out NULL), or their numbers */
static pal_err read_cells(csv *c, double *out)
{
    char word[WORD], *end;
    for (int k = 0; k < COLUMNS; k++) {
        if (!next_cell(c, word))
            return PAL_REFUSE(c->diag, "%s: line %d: %d columns, wanted 6: x,y,z,ux,uy,uz", c->name, c->line, k);
        if (!out && strcmp(word, column_name[k]))
            return PAL_REFUSE(c->diag, "%s: line %d: column %d is \"%s\", wanted \"%s\" (x,y,z,ux,uy,uz)", c->name,
                              c->line, k + 1, shown(word), column_name[k]);
        if (!out) continue;
        out[k] = strtod(word, &end);
        if (end == word || *end || !isfinite(out[k]))
            return PAL_REFUSE(c->diag, "%s: line %d: column %d (%s): \"%s\" is not a number", c->name, c->line, k + 1,
                              column_name[k], shown(word));
    }
    if (next_cell(c, word))
        return PAL_REFUSE(c->diag, "%s: line %d: column 7, \"%s\", is one too many", c->name, c->line, shown(word));
    return PAL_ERR_OK;
}

static pal_err read_all(csv *c, const char *text, const char *last, pal_samples *out)
{
    bool header = false;
    while (next_line(c, &text, last)) {
        double row[COLUMNS];
        if (c->at == c->end) continue;
        PAL_TRY(read_cells(c, header ? row : NULL));
        if (!header) {
            header = true;
            continue;
        }
        if (!pal_heap_grow(&out->x, (size_t)out->n, sizeof row / 2) ||
            !pal_heap_grow(&out->u, (size_t)out->n, sizeof row / 2))
            return pal_diagnostic_set(c->diag, PAL_ERR_MEMORY, "%s: no memory for its samples", c->name);
        pal_copy3(out->x + 3 * out->n, row);
        pal_copy3(out->u + 3 * out->n, row + 3);
        out->n++;
    }
    if (!header)
        return PAL_REFUSE(c->diag, "%s: line %d: empty, wanted the header x,y,z,ux,uy,uz", c->name,
                          c->line ? c->line : 1);
    if (out->n == 0) return PAL_REFUSE(c->diag, "%s: line %d: no row below the header", c->name, c->line);
    return PAL_ERR_OK;
}

pal_err pal_samples_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_samples *out, pal_diagnostic *diag)
{
    csv c = {.name = name, .diag = diag};
    pal_samples made = {0};
    const char *text = (const char *)bytes;
    /* byte order mark, written by spreadsheets */
    if (n_byte >= 3 && !memcmp(text, "\xef\xbb\xbf", 3)) text += 3;
    pal_err err = read_all(&c, text, (const char *)bytes + n_byte, &made);
    if (err)
        pal_samples_free(&made);
    else
        *out = made;
    return err;
}

pal_err pal_samples_read(const char *path, pal_samples *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, (size_t)256 << 20, &bytes, &n_byte, diag));
    pal_err err = pal_samples_parse(path, bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

pal_err pal_samples_write(const pal_samples *samples, const char *path, pal_diagnostic *diag)
{
    pal_file_out out;
    PAL_TRY(pal_file_begin(&out, path, diag));
    fprintf(out.file, "x,y,z,ux,uy,uz\n");
    for (int i = 0; i < samples->n; i++) {
        const double *x = samples->x + 3 * i, *u = samples->u + 3 * i;
        fprintf(out.file, "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", x[0], x[1], x[2], u[0], u[1], u[2]);
    }
    return pal_file_end(&out, diag);
}

void pal_samples_free(pal_samples *samples)
{
    PAL_FREE(samples->x, samples->u);
    *samples = (pal_samples){0};
}

void pal_samples_error(const pal_samples *reference, const double *u, double *rms_percent, double *max_percent)
{
    double sum = 0, max_off = 0, max = 0;
    for (int i = 0; i < reference->n; i++) {
        double off = pal_dist3(u + 3 * i, reference->u + 3 * i);
        sum += off * off;
        max_off = fmax(max_off, off);
        max = fmax(max, pal_norm3(reference->u + 3 * i));
    }
    double rms = reference->n ? sqrt(sum / reference->n) : 0;
    *rms_percent = rms == 0 ? 0 : 100 * rms / max;
    *max_percent = max_off == 0 ? 0 : 100 * max_off / max;
}
