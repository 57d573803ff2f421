/* Text headers of NRRD and MetaImage: lines of KEY: VALUE and KEY = VALUE. */
#include "server/mesh/scan/volume_header.h"

#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/text_scan.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { KEY = 40, VALUE = 400 };

/* one line, cut into key and value */
typedef struct reader {
    const char *name;
    pal_diagnostic *diag;
    const uint8_t *at, *end;
    int64_t line; /* of the entry, from 1 */
    char key[KEY], value[VALUE];
} reader;

#define REFUSE(r, ...) pal_file_refuse((r)->diag, (r)->name, "line", (r)->line, __VA_ARGS__)

/* The next line, without its end, as printable text; cut where it is too long. False: the bytes end before the line
 * does. */
static bool next_line(reader *r, char *text, size_t max)
{
    size_t n = 0;
    const uint8_t *at = r->at;
    while (at < r->end && *at != '\n') {
        if (n + 1 < max && *at != '\r') text[n++] = *at >= ' ' && *at < 0x7F ? (char)*at : *at == '\t' ? ' ' : '?';
        at++;
    }
    text[n] = 0;
    if (at == r->end) return false;
    r->at = at + 1;
    r->line++;
    return true;
}

/* copies n bytes without the blanks at both ends; cut where it is too long */
static void take(char *to, size_t max, const char *from, size_t n)
{
    while (n > 0 && *from == ' ') from++, n--;
    while (n > 0 && from[n - 1] == ' ') n--;
    if (n >= max) n = max - 1;
    memcpy(to, from, n);
    to[n] = 0;
}

/* splits at a sign; false: the line has none */
static bool split(reader *r, const char *text, char sign)
{
    const char *at = strchr(text, sign);
    if (!at) return false;
    take(r->key, KEY, text, (size_t)(at - text));
    take(r->value, VALUE, at + 1, strlen(at + 1));
    return true;
}

static bool value_is(const reader *r, const char *word)
{
    return !strcasecmp(r->value, word);
}

/* how many numbers the value has, with blanks, commas and brackets between them; -1: something else stands there */
static int numbers(const reader *r, double *out, int max)
{
    char text[VALUE];
    int n = 0;
    memcpy(text, r->value, VALUE);
    for (char *c = text; *c; c++)
        if (strchr("(),", *c)) *c = ' ';
    pal_text_scan scan = {.at = (const uint8_t *)text, .end = (const uint8_t *)text + strlen(text), .line = 1};
    while (pal_text_more(&scan))
        if (n == max || !pal_text_double(&scan, &out[n++])) return -1;
    return n;
}

static pal_err need_numbers(const reader *r, double *out, int n)
{
    if (numbers(r, out, n) == n) return PAL_ERR_OK;
    return REFUSE(r, "%s is \"%.60s\", not %d numbers", r->key, r->value, n);
}

static pal_err read_sizes(const reader *r, int64_t n[3])
{
    double size[3];
    PAL_TRY(need_numbers(r, size, 3));
    for (int a = 0; a < 3; a++) {
        if (!(size[a] >= 1 && size[a] <= 1e6) || size[a] != floor(size[a]))
            return REFUSE(r, "axis %d has %g voxels", a + 1, size[a]);
        n[a] = (int64_t)size[a];
    }
    return PAL_ERR_OK;
}

typedef struct type_word {
    const char *word;
    pal_scalar type;
} type_word;

static pal_err read_type(const reader *r, const type_word *known, pal_scalar *out)
{
    for (; known->word; known++)
        if (value_is(r, known->word)) {
            *out = known->type;
            return PAL_ERR_OK;
        }
    return REFUSE(r, "voxel type \"%.60s\" is not read", r->value);
}

static pal_err missing(const reader *r, const char *key)
{
    return REFUSE(r, "the header ends without %s", key);
}

/* ---- NRRD ---- */

static const type_word nrrd_type[] = {{"uchar", PAL_SCALAR_U8},       {"unsigned char", PAL_SCALAR_U8},
                                      {"uint8", PAL_SCALAR_U8},       {"uint8_t", PAL_SCALAR_U8},
                                      {"signed char", PAL_SCALAR_I8}, {"int8", PAL_SCALAR_I8},
                                      {"int8_t", PAL_SCALAR_I8},      {"short", PAL_SCALAR_I16},
                                      {"short int", PAL_SCALAR_I16},  {"signed short", PAL_SCALAR_I16},
                                      {"int16", PAL_SCALAR_I16},      {"int16_t", PAL_SCALAR_I16},
                                      {"ushort", PAL_SCALAR_U16},     {"unsigned short", PAL_SCALAR_U16},
                                      {"uint16", PAL_SCALAR_U16},     {"uint16_t", PAL_SCALAR_U16},
                                      {"int", PAL_SCALAR_I32},        {"signed int", PAL_SCALAR_I32},
                                      {"int32", PAL_SCALAR_I32},      {"int32_t", PAL_SCALAR_I32},
                                      {"uint", PAL_SCALAR_U32},       {"unsigned int", PAL_SCALAR_U32},
                                      {"uint32", PAL_SCALAR_U32},     {"uint32_t", PAL_SCALAR_U32},
                                      {"longlong", PAL_SCALAR_I64},   {"long long", PAL_SCALAR_I64},
                                      {"int64", PAL_SCALAR_I64},      {"int64_t", PAL_SCALAR_I64},
                                      {"ulonglong", PAL_SCALAR_U64},  {"unsigned long long", PAL_SCALAR_U64},
                                      {"uint64", PAL_SCALAR_U64},     {"uint64_t", PAL_SCALAR_U64},
                                      {"float", PAL_SCALAR_F32},      {"double", PAL_SCALAR_F64},
                                      {NULL, PAL_SCALAR_U8}};

/* entries that later ones are needed for */
typedef struct entries {
    bool has_type, has_size, has_dimension, has_encoding, has_endian, has_space, has_directions, has_spacing;
    double sign[3];                             /* of the world axes against RAS */
    double direction[9], origin[3], spacing[3]; /* mm; direction [axis][3] */
} entries;

static pal_err read_space(const reader *r, entries *e)
{
    static const struct {
        const char *word, *abbreviation;
        double sign[3];
    } known[] = {{"right-anterior-superior", "RAS", {1, 1, 1}},
                 {"left-anterior-superior", "LAS", {-1, 1, 1}},
                 {"left-posterior-superior", "LPS", {-1, -1, 1}}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (value_is(r, known[k].word) || value_is(r, known[k].abbreviation)) {
            memcpy(e->sign, known[k].sign, sizeof e->sign);
            e->has_space = true;
            return PAL_ERR_OK;
        }
    /* three axes that point nowhere in a patient */
    if (value_is(r, "3D-right-handed") || value_is(r, "3DRH") || value_is(r, "scanner-xyz")) return PAL_ERR_OK;
    return REFUSE(r, "space \"%.60s\" is not RAS, LAS, LPS, scanner-xyz or 3D-right-handed", r->value);
}

static pal_err nrrd_encoding(const reader *r, pal_volume_header *h)
{
    h->packed = value_is(r, "gzip") || value_is(r, "gz");
    if (h->packed || value_is(r, "raw")) return PAL_ERR_OK;
    return REFUSE(r, "encoding \"%.60s\" is not raw or gzip", r->value);
}

static pal_err nrrd_entry(const reader *r, entries *e, pal_volume_header *h)
{
    const char *key = r->key;
    double number = 0;
    if (!strcasecmp(key, "type")) return e->has_type = true, read_type(r, nrrd_type, &h->type);
    if (!strcasecmp(key, "encoding")) return e->has_encoding = true, nrrd_encoding(r, h);
    if (!strcasecmp(key, "space")) return read_space(r, e);
    if (!strcasecmp(key, "space directions")) return e->has_directions = true, need_numbers(r, e->direction, 9);
    if (!strcasecmp(key, "space origin")) return need_numbers(r, e->origin, 3);
    if (!strcasecmp(key, "spacings")) return e->has_spacing = true, need_numbers(r, e->spacing, 3);
    if (!strcasecmp(key, "dimension")) {
        PAL_TRY(need_numbers(r, &number, 1));
        e->has_dimension = true;
        return number == 3 ? PAL_ERR_OK
                           : REFUSE(r,
                                    "%g axes, three are read; a segmentation with overlapping segments has a "
                                    "fourth: export its labels as a label map",
                                    number);
    }
    if (!strcasecmp(key, "sizes")) {
        if (!e->has_dimension) return REFUSE(r, "sizes stand before dimension");
        return e->has_size = true, read_sizes(r, h->n);
    }
    if (!strcasecmp(key, "endian")) {
        h->big = value_is(r, "big");
        e->has_endian = h->big || value_is(r, "little");
        return e->has_endian ? PAL_ERR_OK : REFUSE(r, "endian \"%.60s\" is not little or big", r->value);
    }
    if (!strcasecmp(key, "data file") || !strcasecmp(key, "datafile"))
        return REFUSE(r, "the voxels are in another file, %.60s: one file with both is read, .nrrd", r->value);
    bool skips = !strcasecmp(key, "line skip") || !strcasecmp(key, "lineskip") || !strcasecmp(key, "byte skip") ||
                 !strcasecmp(key, "byteskip");
    if (skips) PAL_TRY(need_numbers(r, &number, 1));
    return number == 0 ? PAL_ERR_OK : REFUSE(r, "%s %g is not read, 0 is", key, number);
}

/* directions, or spacings alone -> to_m */
static void nrrd_axes(const entries *e, pal_volume_header *h)
{
    for (int a = 0; a < 3; a++) {
        for (int k = 0; k < 3; k++)
            h->to_m[4 * k + a] = 1e-3 * e->sign[k] *
                                 (e->has_directions ? e->direction[3 * a + k]
                                  : a != k          ? 0
                                  : e->has_spacing  ? e->spacing[a]
                                                    : 1);
        h->to_m[4 * a + 3] = 1e-3 * e->sign[a] * e->origin[a];
    }
    h->axes = e->has_space && e->has_directions ? "RAS" : "";
}

bool pal_is_nrrd(const uint8_t *bytes, size_t n_byte)
{
    return n_byte >= 8 && !memcmp(bytes, "NRRD000", 7);
}

pal_err pal_nrrd_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_volume_header *h,
                        pal_diagnostic *diag)
{
    reader r = {.name = name, .diag = diag, .at = bytes, .end = bytes + n_byte};
    entries e = {.sign = {1, 1, 1}};
    char text[VALUE];
    *h = (pal_volume_header){.slope = 1, .format = "nrrd", .axes = ""};
    for (;;) {
        if (!next_line(&r, text, sizeof text)) return REFUSE(&r, "the file ends inside the header");
        if (!text[0]) break;
        if (r.line == 1 || text[0] == '#') continue;
        if (!split(&r, text, ':')) return REFUSE(&r, "\"%.40s\" is not KEY: VALUE", text);
        /* KEY:=VALUE is free text of the writer */
        if (r.value[0] != '=') PAL_TRY(nrrd_entry(&r, &e, h));
    }
    if (!e.has_type) return missing(&r, "type");
    if (!e.has_size) return missing(&r, "sizes");
    if (!e.has_encoding) return missing(&r, "encoding");
    if (!e.has_endian && pal_scalar_size(h->type) > 1) return missing(&r, "endian");
    nrrd_axes(&e, h);
    h->offset = (size_t)(r.at - bytes);
    return PAL_ERR_OK;
}

/* ---- MetaImage ---- */

static const type_word meta_type[] = {{"MET_UCHAR", PAL_SCALAR_U8},
                                      {"MET_CHAR", PAL_SCALAR_I8},
                                      {"MET_USHORT", PAL_SCALAR_U16},
                                      {"MET_SHORT", PAL_SCALAR_I16},
                                      {"MET_UINT", PAL_SCALAR_U32},
                                      {"MET_INT", PAL_SCALAR_I32},
                                      {"MET_ULONG", PAL_SCALAR_U32},
                                      {"MET_LONG", PAL_SCALAR_I32},
                                      {"MET_ULONG_LONG", PAL_SCALAR_U64},
                                      {"MET_LONG_LONG", PAL_SCALAR_I64},
                                      {"MET_FLOAT", PAL_SCALAR_F32},
                                      {"MET_DOUBLE", PAL_SCALAR_F64},
                                      {NULL, PAL_SCALAR_U8}};

static bool is_true(const reader *r)
{
    return r->value[0] == 'T' || r->value[0] == 't' || r->value[0] == '1';
}

/* an entry that must be this number */
static pal_err only(const reader *r, double wanted, const char *what)
{
    double number;
    PAL_TRY(need_numbers(r, &number, 1));
    return number == wanted ? PAL_ERR_OK : REFUSE(r, "%g %s, %g is read", number, what, wanted);
}

static pal_err meta_entry(const reader *r, entries *e, pal_volume_header *h)
{
    const char *key = r->key;
    if (!strcasecmp(key, "NDims")) return e->has_dimension = true, only(r, 3, "axes");
    if (!strcasecmp(key, "ElementNumberOfChannels")) return only(r, 1, "values in a voxel");
    if (!strcasecmp(key, "HeaderSize")) return only(r, 0, "bytes before the voxels (HeaderSize)");
    if (!strcasecmp(key, "DimSize")) return e->has_size = true, read_sizes(r, h->n);
    if (!strcasecmp(key, "ElementType")) return e->has_type = true, read_type(r, meta_type, &h->type);
    if (!strcasecmp(key, "ElementSpacing")) return e->has_spacing = true, need_numbers(r, e->spacing, 3);
    if (!strcasecmp(key, "ElementSize") && !e->has_spacing) return need_numbers(r, e->spacing, 3);
    if (!strcasecmp(key, "TransformMatrix") || !strcasecmp(key, "Rotation") || !strcasecmp(key, "Orientation"))
        return e->has_directions = true, need_numbers(r, e->direction, 9);
    if (!strcasecmp(key, "Offset") || !strcasecmp(key, "Origin") || !strcasecmp(key, "Position"))
        return need_numbers(r, e->origin, 3);
    if (!strcasecmp(key, "BinaryDataByteOrderMSB") || !strcasecmp(key, "ElementByteOrderMSB")) h->big = is_true(r);
    if (!strcasecmp(key, "CompressedData")) h->packed = is_true(r);
    if (!strcasecmp(key, "BinaryData") && !is_true(r)) return REFUSE(r, "the voxels are text, binary ones are read");
    if (!strcasecmp(key, "ElementDataFile") && !value_is(r, "LOCAL"))
        return REFUSE(r, "the voxels are in another file, %.60s: one file with both is read, .mha", r->value);
    return PAL_ERR_OK;
}

bool pal_is_metaimage(const uint8_t *bytes, size_t n_byte)
{
    return n_byte >= 10 && !memcmp(bytes, "ObjectType", 10);
}

pal_err pal_metaimage_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_volume_header *h,
                             pal_diagnostic *diag)
{
    reader r = {.name = name, .diag = diag, .at = bytes, .end = bytes + n_byte};
    entries e = {.sign = {-1, -1, 1}, .spacing = {1, 1, 1}, .direction = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    char text[VALUE];
    *h = (pal_volume_header){.slope = 1, .format = "metaimage", .axes = ""};
    do {
        if (!next_line(&r, text, sizeof text)) return REFUSE(&r, "the file ends inside the header");
        if (!split(&r, text, '=')) return REFUSE(&r, "\"%.40s\" is not KEY = VALUE", text);
        PAL_TRY(meta_entry(&r, &e, h));
    } while (strcasecmp(r.key, "ElementDataFile") != 0);
    if (!e.has_dimension) return missing(&r, "NDims");
    if (!e.has_size) return missing(&r, "DimSize");
    if (!e.has_type) return missing(&r, "ElementType");
    for (int k = 0; k < 9; k++) e.direction[k] *= e.spacing[k / 3];
    e.has_space = e.has_directions;
    e.has_directions = true;
    nrrd_axes(&e, h);
    h->offset = (size_t)(r.at - bytes);
    return PAL_ERR_OK;
}
