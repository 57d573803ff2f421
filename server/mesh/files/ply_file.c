/* PLY 1.0: ascii, binary little- and big-endian; vertex x y z of any scalar type, faces as lists and triangle strips;
 * any other element or property is skipped. Elements may come in any order. */
#include "server/mesh/files/mesh_build.h"
#include "server/mesh/files/scalar_bytes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_ELEMENT = 32, MAX_PROPERTY = 128 };

/* role of a property */
typedef enum role { OTHER, X, Y, Z, INDICES } role;

typedef struct property {
    pal_scalar type, count_type;
    bool list;
    role use;
} property;

typedef struct element {
    enum { UNKNOWN, VERTEX, FACE, STRIP } what;
    int64_t n_row, line; /* line: where it is declared                  */
    int first, n;        /* its properties                              */
    int64_t min;         /* bytes that a row takes at least, in binary  */
} element;

typedef struct ply {
    pal_mesh_build *build;
    pal_text_scan scan; /* header and ascii body                        */
    bool ascii, big;
    int n_element, n_property;
    element elements[MAX_ELEMENT];
    property properties[MAX_PROPERTY];
    const uint8_t *at; /* binary body                                   */
} ply;

static bool take_type(pal_text_scan *scan, pal_scalar *out)
{
    static const struct {
        const char *word[2];
        pal_scalar type;
    } known[] = {{{"char", "int8"}, PAL_SCALAR_I8},      {{"uchar", "uint8"}, PAL_SCALAR_U8},
                 {{"short", "int16"}, PAL_SCALAR_I16},   {{"ushort", "uint16"}, PAL_SCALAR_U16},
                 {{"int", "int32"}, PAL_SCALAR_I32},     {{"uint", "uint32"}, PAL_SCALAR_U32},
                 {{"float", "float32"}, PAL_SCALAR_F32}, {{"double", "float64"}, PAL_SCALAR_F64}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (pal_text_is(scan, known[k].word[0]) || pal_text_is(scan, known[k].word[1])) {
            *out = known[k].type;
            return true;
        }
    return false;
}

/* a refusal inside the header, which is text in every PLY */
static pal_err refuse_header(ply *p, const char *what)
{
    p->build->binary = false;
    return PAL_MESH_REFUSE(p->build, p->scan.line, "%s, found %s", what, pal_text_excerpt_at(&p->scan).text);
}

static pal_err read_format(ply *p)
{
    p->ascii = pal_text_is(&p->scan, "ascii");
    if (!p->ascii) {
        p->big = pal_text_is(&p->scan, "binary_big_endian");
        if (!p->big && !pal_text_is(&p->scan, "binary_little_endian"))
            return refuse_header(p, "the format must be ascii, binary_little_endian or binary_big_endian");
    }
    if (!pal_text_is(&p->scan, "1.0")) return refuse_header(p, "only version 1.0 is read");
    return PAL_ERR_OK;
}

static pal_err read_element(ply *p)
{
    if (p->n_element == MAX_ELEMENT) return refuse_header(p, "more than 32 elements");
    element *e = &p->elements[p->n_element++];
    *e = (element){.what = UNKNOWN, .first = p->n_property, .line = p->scan.line};
    static const char *const name[] = {"vertex", "face", "tristrips"};
    for (int k = 0; k < 3 && e->what == UNKNOWN; k++)
        if (pal_text_is(&p->scan, name[k])) e->what = VERTEX + (unsigned)k;
    if (e->what == UNKNOWN && pal_text_word(&p->scan) == 0) return refuse_header(p, "an element needs a name");
    if (!pal_text_int(&p->scan, &e->n_row) || e->n_row < 0)
        return refuse_header(p, "an element needs its number of rows");
    return PAL_ERR_OK;
}

static pal_err read_property(ply *p)
{
    if (p->n_element == 0) return refuse_header(p, "a property before any element");
    if (p->n_property == MAX_PROPERTY) return refuse_header(p, "more than 128 properties");
    element *e = &p->elements[p->n_element - 1];
    property *q = &p->properties[p->n_property++];
    *q = (property){.list = pal_text_is(&p->scan, "list"), .use = OTHER};
    if (q->list && (!take_type(&p->scan, &q->count_type) || q->count_type >= PAL_SCALAR_F32))
        return refuse_header(p, "a list needs a whole-number type for its length");
    if (!take_type(&p->scan, &q->type)) return refuse_header(p, "a property needs a known type");
    static const char *const axis[] = {"x", "y", "z"};
    for (int k = 0; k < 3 && e->what == VERTEX && !q->list; k++)
        if (pal_text_is(&p->scan, axis[k])) q->use = X + (unsigned)k;
    bool face = e->what == FACE || e->what == STRIP;
    if (face && q->list && (pal_text_is(&p->scan, "vertex_indices") || pal_text_is(&p->scan, "vertex_index")))
        q->use = INDICES;
    e->min += pal_scalar_size(q->list ? q->count_type : q->type);
    e->n++;
    return PAL_ERR_OK;
}

static pal_err read_header(ply *p)
{
    bool format = false;
    pal_text_word(&p->scan);
    for (;;) {
        if (!pal_text_next_line(&p->scan)) return refuse_header(p, "the file ends inside the header");
        if (!pal_text_more(&p->scan) || pal_text_is(&p->scan, "comment") || pal_text_is(&p->scan, "obj_info")) continue;
        if (pal_text_is(&p->scan, "end_header")) break;
        if (pal_text_is(&p->scan, "format")) {
            PAL_TRY(read_format(p));
            format = true;
        } else if (pal_text_is(&p->scan, "element")) {
            PAL_TRY(read_element(p));
        } else if (pal_text_is(&p->scan, "property")) {
            PAL_TRY(read_property(p));
        } else {
            return refuse_header(p, "expected element, property, comment or end_header");
        }
    }
    if (!format) return refuse_header(p, "the header has no format line");
    /* where lines end with CR alone, a LF after the last one is the body's first byte */
    while (p->scan.at < p->scan.end && *p->scan.at != '\n' && *p->scan.at != '\r') p->scan.at++;
    bool lone =
        p->scan.at < p->scan.end && *p->scan.at == '\r' && p->build->bytes[3] == '\r' && p->build->bytes[4] != '\n';
    if (lone)
        p->scan.at++;
    else
        pal_text_next_line(&p->scan);
    p->at = p->scan.at;
    return PAL_ERR_OK;
}

/* place of the next value for messages */
static int64_t place(const ply *p)
{
    return p->ascii ? p->scan.line : p->at - p->build->bytes;
}

/* takes one value of either body */
static pal_err take_value(ply *p, pal_scalar type, double *out)
{
    if (p->ascii) {
        if (pal_text_seek(&p->scan) && pal_text_double(&p->scan, out)) return PAL_ERR_OK;
        if (p->scan.at == p->scan.end) return PAL_MESH_REFUSE(p->build, p->scan.line, "the file ends inside the body");
        return PAL_MESH_REFUSE(p->build, p->scan.line, "expected a number, found %s",
                               pal_text_excerpt_at(&p->scan).text);
    }
    const uint8_t *end = p->build->bytes + p->build->n_byte;
    if (end - p->at < pal_scalar_size(type))
        return PAL_MESH_REFUSE(p->build, place(p), "the file ends inside the body");
    *out = pal_scalar_at(p->at, type, p->big);
    p->at += pal_scalar_size(type);
    return PAL_ERR_OK;
}

/* a triangle strip; -1 begins a new one; every second triangle is reversed */
static pal_err strip_corner(ply *p, int64_t at, double value, double last[2], int *n)
{
    if (value == -1) {
        *n = 0;
        return PAL_ERR_OK;
    }
    if (*n >= 2) {
        bool turn = *n & 1;
        pal_mesh_fan_begin(p->build, at);
        PAL_TRY(pal_mesh_fan_corner(p->build, at, (int64_t)last[turn]));
        PAL_TRY(pal_mesh_fan_corner(p->build, at, (int64_t)last[!turn]));
        PAL_TRY(pal_mesh_fan_corner(p->build, at, (int64_t)value));
    }
    last[0] = last[1];
    last[1] = value;
    ++*n;
    return PAL_ERR_OK;
}

/* the corners of one face or strip row */
static pal_err read_indices(ply *p, const element *e, const property *q, int64_t n)
{
    double last[2] = {0, 0};
    int n_strip = 0;
    pal_mesh_fan_begin(p->build, place(p));
    for (int64_t k = 0; k < n; k++) {
        double value;
        PAL_TRY(take_value(p, q->type, &value));
        int64_t at = p->ascii ? p->scan.line : place(p) - pal_scalar_size(q->type);
        if (!(fabs(value) < 4294967296.0) || value != floor(value))
            return PAL_MESH_REFUSE(p->build, at, "vertex index %g is no whole number in range", value);
        if (e->what == STRIP)
            PAL_TRY(strip_corner(p, at, value, last, &n_strip));
        else
            PAL_TRY(pal_mesh_fan_corner(p->build, at, (int64_t)value));
    }
    return e->what == STRIP ? PAL_ERR_OK : pal_mesh_fan_end(p->build);
}

static pal_err read_list(ply *p, const element *e, const property *q)
{
    double count;
    int64_t at = place(p);
    PAL_TRY(take_value(p, q->count_type, &count));
    if (!(count >= 0 && count < 4294967296.0) || count != floor(count))
        return PAL_MESH_REFUSE(p->build, at, "a list of %g entries", count);
    int64_t n = (int64_t)count,
            left = (p->ascii ? p->scan.end : p->build->bytes + p->build->n_byte) - (p->ascii ? p->scan.at : p->at);
    if (n > left / (p->ascii ? 2 : pal_scalar_size(q->type)))
        return PAL_MESH_REFUSE(p->build, at, "a list of %lld entries, but only %lld bytes follow", (long long)n,
                               (long long)left);
    if (q->use == INDICES) return read_indices(p, e, q, n);
    if (!p->ascii) {
        p->at += n * pal_scalar_size(q->type);
        return PAL_ERR_OK;
    }
    for (double unused; n > 0; n--) PAL_TRY(take_value(p, q->type, &unused));
    return PAL_ERR_OK;
}

static pal_err read_row(ply *p, const element *e)
{
    double position[3] = {0, 0, 0};
    for (int k = 0; k < e->n; k++) {
        const property *q = &p->properties[e->first + k];
        if (q->list) {
            PAL_TRY(read_list(p, e, q));
            continue;
        }
        double value;
        PAL_TRY(take_value(p, q->type, &value));
        if (q->use != OTHER) position[q->use - X] = value;
    }
    return e->what == VERTEX ? pal_mesh_vertex(p->build, position) : PAL_ERR_OK;
}

static pal_err read_rows(ply *p, const element *e)
{
    if (e->n == 0) return PAL_ERR_OK;
    const uint8_t *end = p->build->bytes + p->build->n_byte, *at = p->ascii ? p->scan.at : p->at;
    /* in text a value takes at least two bytes, its blank included (the very last one may lack it) */
    int64_t max = p->ascii ? (end - at + 1) / 2 / e->n : (end - at) / e->min;
    if (e->n_row > max)
        return PAL_MESH_REFUSE(p->build, place(p), "the header claims %lld rows, but at most %lld fit in the rest",
                               (long long)e->n_row, (long long)max);
    for (int64_t row = 0; row < e->n_row; row++) PAL_TRY(read_row(p, e));
    return PAL_ERR_OK;
}

/* vertices with all of x y z, at most once, and something that gives triangles */
static pal_err check_header(ply *p)
{
    int n_vertex = 0, n_face = 0;
    for (int i = 0; i < p->n_element; i++) {
        const element *e = &p->elements[i];
        int use[INDICES + 1] = {0};
        for (int k = 0; k < e->n; k++) use[p->properties[e->first + k].use]++;
        p->scan.line = e->line;
        n_vertex += e->what == VERTEX;
        n_face += use[INDICES];
        if (e->what == VERTEX && (use[X] != 1 || use[Y] != 1 || use[Z] != 1))
            return PAL_MESH_REFUSE(p->build, e->line, "the vertex element needs x, y and z once each");
    }
    if (n_vertex != 1) return PAL_MESH_REFUSE(p->build, 1, "the header declares %d vertex elements", n_vertex);
    if (n_face == 0) return PAL_MESH_REFUSE(p->build, 1, "the header declares no faces");
    return PAL_ERR_OK;
}

static pal_err read_ply(ply *p)
{
    PAL_TRY(read_header(p));
    int64_t line = p->scan.line;
    PAL_TRY(check_header(p));
    p->scan.line = line;
    p->build->binary = !p->ascii;
    for (int i = 0; i < p->n_element; i++) PAL_TRY(read_rows(p, &p->elements[i]));
    if (p->build->n_tri == 0) return PAL_MESH_REFUSE(p->build, place(p), "the file has no face");
    return PAL_ERR_OK;
}

pal_err pal_ply_parse(pal_mesh_build *build)
{
    build->format = "ply";
    build->binary = false;
    ply *p = calloc(1, sizeof *p);
    if (!p) return pal_diagnostic_set(build->diag, PAL_ERR_MEMORY, "%s: no memory for the header", build->name);
    p->build = build;
    p->scan = (pal_text_scan){.at = build->bytes, .end = build->bytes + build->n_byte, .line = 1};
    pal_err err = read_ply(p);
    free(p);
    return err;
}
