/* Label volumes from NIfTI-1 (.nii) and INRIMAGE-4 (.inr) files, plain or in gzip, and from NRRD and MetaImage (.mha)
 * files, whose voxels may be compressed behind a plain header.
 *
 * A compressed file is unpacked twice: first its beginning, to read the header, then piece by piece into labels. The
 * labels grow with the bytes that really come out, so a claimed size costs nothing, and the unpacked file is never held
 * as a whole. */
#include "server/mesh/scan/label_volume.h"

#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/scalar_bytes.h"
#include "server/mesh/files/text_scan.h"
#include "server/mesh/scan/volume_header.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

static const int64_t max_voxel = (int64_t)1 << 29;
static const size_t max_file = (size_t)4 << 30;
/* a piece holds whole voxels of any type */
enum { MAX_HEADER = 1 << 16, PIECE = 1 << 16, NIFTI_HEAD = 348 };

typedef pal_volume_header header;

typedef struct source {
    const char *name;
    pal_diagnostic *diag;
    const uint8_t *bytes; /* as stored          */
    size_t n_byte;
    bool packed;
} source;

#define REFUSE(s, unit, at, ...) pal_file_refuse((s)->diag, (s)->name, (unit), (at), __VA_ARGS__)

static pal_err no_memory(const source *s, size_t n)
{
    return pal_diagnostic_set(s->diag, PAL_ERR_MEMORY, "%s: no memory for %zu bytes", s->name, n);
}

static bool is_gzip(const uint8_t *bytes, size_t n_byte)
{
    return n_byte >= 2 && bytes[0] == 0x1F && bytes[1] == 0x8B;
}

/* unpacks a gzip or zlib stream from its beginning; a plain file is passed through */
typedef struct unpacker {
    const source *s;
    z_stream z;
    size_t n_in; /* bytes of the file that were used */
    bool ended;
} unpacker;

static pal_err unpack_begin(unpacker *u, const source *s)
{
    *u = (unpacker){.s = s};
    if (s->packed && inflateInit2(&u->z, 15 + 32) != Z_OK) return no_memory(s, sizeof u->z);
    return PAL_ERR_OK;
}

static pal_err inflate_next(unpacker *u, uint8_t *to, size_t max, size_t *n_out)
{
    const source *s = u->s;
    size_t n = 0;
    while (n < max && !u->ended) {
        size_t in = s->n_byte - u->n_in < 1u << 30 ? s->n_byte - u->n_in : 1u << 30;
        u->z.next_in = (Bytef *)(uintptr_t)(s->bytes + u->n_in);
        u->z.avail_in = (uInt)in;
        u->z.next_out = to + n;
        u->z.avail_out = (uInt)(max - n);
        int state = inflate(&u->z, Z_NO_FLUSH);
        u->n_in += in - u->z.avail_in;
        n = max - u->z.avail_out;
        if (state == Z_STREAM_END) {
            /* members may follow one another */
            u->ended = !is_gzip(s->bytes + u->n_in, s->n_byte - u->n_in);
            state = u->ended ? Z_OK : inflateReset(&u->z);
        }
        if (state == Z_BUF_ERROR) u->ended = true;
        if (state == Z_MEM_ERROR) return no_memory(s, max);
        if (state != Z_OK && state != Z_BUF_ERROR)
            return REFUSE(s, "byte", (int64_t)u->n_in, "the compressed data are damaged");
    }
    *n_out = n;
    return PAL_ERR_OK;
}

/* the next bytes, at most `max`, fewer only at the end: in the file itself or in `room` */
static pal_err unpack_next(unpacker *u, uint8_t *room, size_t max, const uint8_t **bytes, size_t *n_out)
{
    const source *s = u->s;
    *bytes = room;
    if (s->packed) return inflate_next(u, room, max, n_out);
    *bytes = s->bytes + u->n_in;
    *n_out = s->n_byte - u->n_in < max ? s->n_byte - u->n_in : max;
    u->n_in += *n_out;
    return PAL_ERR_OK;
}

/* rotation of the qform's quaternion (b c d), columns scaled by the voxel size */
static void qform(const uint8_t *b, bool big, const double size[3], double unit, double m[12])
{
    double q[4] = {0, pal_float_at(b + 256, big), pal_float_at(b + 260, big), pal_float_at(b + 264, big)};
    q[0] = sqrt(fmax(0, 1 - q[1] * q[1] - q[2] * q[2] - q[3] * q[3]));
    double sign = pal_float_at(b + 76, big) < 0 ? -1 : 1;
    for (int a = 0; a < 3; a++) {
        double e[3] = {a == 0, a == 1, a == 2}, r[3];
        pal_quat_rotate(r, q, e);
        for (int k = 0; k < 3; k++) m[4 * k + a] = unit * size[a] * (a == 2 ? sign : 1) * r[k];
        m[4 * a + 3] = unit * pal_float_at(b + 268 + 4 * a, big);
    }
}

/* false: the file states sizes of voxels alone, and no directions */
static bool nifti_axes(const uint8_t *b, bool big, double m[12])
{
    int code = b[123] & 7;
    double unit = code == 1 ? 1 : code == 3 ? 1e-6 : 1e-3, size[3];
    for (int a = 0; a < 3; a++) size[a] = fabs(pal_float_at(b + 80 + 4 * a, big));
    if (pal_word_at(b + 254, 2, big) > 0) {
        for (int k = 0; k < 12; k++) m[k] = unit * pal_float_at(b + 280 + 4 * k, big);
    } else if (pal_word_at(b + 252, 2, big) > 0) {
        qform(b, big, size, unit, m);
    } else {
        for (int k = 0; k < 12; k++) m[k] = k % 5 == 0 ? unit * size[k / 5] : 0;
        return false;
    }
    return true;
}

/* finite, not flat, and voxels between a nanometre and a kilometre */
static bool axes_usable(const double m[12])
{
    double e[3][3], n[3], size = 1;
    for (int k = 0; k < 12; k++)
        if (!(fabs(m[k]) < 1e6)) return false;
    for (int a = 0; a < 3; a++) {
        pal_set3(e[a], m[a], m[4 + a], m[8 + a]);
        double length = pal_norm3(e[a]);
        if (!(length > 1e-9 && length < 1e3)) return false;
        size *= length;
    }
    pal_cross3(n, e[0], e[1]);
    return fabs(pal_dot3(n, e[2])) > 1e-6 * size;
}

static bool is_nifti(const uint8_t *b, size_t n)
{
    return n >= 4 && (pal_word_at(b, 4, false) == NIFTI_HEAD || pal_word_at(b, 4, true) == NIFTI_HEAD);
}

static pal_err nifti_header(const source *s, const uint8_t *b, size_t n, header *h)
{
    static const struct {
        int code;
        pal_scalar type;
    } known[] = {{2, PAL_SCALAR_U8},     {4, PAL_SCALAR_I16},   {8, PAL_SCALAR_I32},   {16, PAL_SCALAR_F32},
                 {64, PAL_SCALAR_F64},   {256, PAL_SCALAR_I8},  {512, PAL_SCALAR_U16}, {768, PAL_SCALAR_U32},
                 {1024, PAL_SCALAR_I64}, {1280, PAL_SCALAR_U64}};
    if (n < NIFTI_HEAD) return REFUSE(s, "byte", (int64_t)n, "the file ends inside the 348 byte head");
    bool big = h->big = pal_word_at(b, 4, true) == NIFTI_HEAD;
    h->format = "nifti";
    if (memcmp(b + 344, "n+1", 4)) return REFUSE(s, "byte", 344, "not a NIfTI-1 file with its voxels inside (n+1)");
    int n_axis = (int16_t)pal_word_at(b + 40, 2, big);
    if (n_axis < 3 || n_axis > 7) return REFUSE(s, "byte", 40, "%d axes, three are read", n_axis);
    for (int a = 0; a < n_axis; a++) {
        int64_t size = (int16_t)pal_word_at(b + 42 + 2 * a, 2, big);
        if (size < 1 || (a >= 3 && size > 1))
            return REFUSE(s, "byte", 42 + 2 * a, "axis %d has %lld voxels%s", a + 1, (long long)size,
                          a < 3 ? "" : ", one is read beyond the third axis");
        if (a < 3) h->n[a] = size;
    }
    int code = (int16_t)pal_word_at(b + 70, 2, big);
    size_t k = 0, n_known = sizeof known / sizeof *known;
    while (k < n_known && known[k].code != code) k++;
    if (k == n_known) return REFUSE(s, "byte", 70, "voxel type %d is not read", code);
    h->type = known[k].type;
    double offset = pal_float_at(b + 108, big);
    if (!(offset >= NIFTI_HEAD && offset < 1e9)) return REFUSE(s, "byte", 108, "voxels begin at byte %g", offset);
    h->offset = (size_t)offset;
    h->slope = pal_float_at(b + 112, big);
    h->shift = pal_float_at(b + 116, big);
    if (!isfinite(h->slope) || !isfinite(h->shift)) return REFUSE(s, "byte", 112, "the scale is not finite");
    if (h->slope == 0) h->slope = 1, h->shift = 0;
    h->axes = nifti_axes(b, big, h->to_m) ? "RAS" : "";
    return axes_usable(h->to_m) ? PAL_ERR_OK : REFUSE(s, "byte", 76, "the voxel axes are flat or not finite");
}

static bool is_inr(const uint8_t *b, size_t n)
{
    return n >= 12 && memcmp(b, "#INRIMAGE-4#{", n < 13 ? n : 13) == 0;
}

/* the header's text entries and the lines they stand in, 1 when they are missing */
typedef struct inr_words {
    double dim[3], size[3], vdim;
    int64_t bits;
    int64_t dim_line[3], size_line[3], vdim_line, type_line;
    enum { NO_TYPE, UNSIGNED, SIGNED, FLOATING } type;
} inr_words;

/* KEY=value; the scan is on the value. false: the value is not understood */
static bool inr_entry(const char *key, size_t n_key, pal_text_scan *value, inr_words *w, header *h)
{
    static const char *const axis = "XYZ";
    if (n_key == 4 && memcmp(key + 1, "DIM", 3) == 0) {
        const char *a = key[0] ? strchr(axis, key[0]) : NULL;
        if (!a && key[0] != 'V') return true;
        *(a ? &w->dim_line[a - axis] : &w->vdim_line) = value->line;
        return pal_text_double(value, a ? &w->dim[a - axis] : &w->vdim);
    }
    if (n_key == 2 && key[0] == 'V' && key[1] && strchr(axis, key[1])) {
        ptrdiff_t a = strchr(axis, key[1]) - axis;
        w->size_line[a] = value->line;
        return pal_text_double(value, &w->size[a]);
    }
    if (n_key == 7 && memcmp(key, "PIXSIZE", 7) == 0) {
        w->type_line = value->line;
        return pal_text_int(value, &w->bits);
    }
    if (n_key == 3 && memcmp(key, "CPU", 3) == 0) {
        h->big = pal_text_is(value, "sun") || pal_text_is(value, "sgi");
        return h->big || pal_text_is(value, "decm") || pal_text_is(value, "alpha") || pal_text_is(value, "pc");
    }
    if (n_key == 4 && memcmp(key, "TYPE", 4) == 0) {
        bool is_signed = pal_text_is(value, "signed"), is_unsigned = !is_signed && pal_text_is(value, "unsigned");
        w->type_line = value->line;
        w->type = is_signed ? SIGNED : is_unsigned ? UNSIGNED : pal_text_is(value, "float") ? FLOATING : NO_TYPE;
        return w->type == FLOATING || (w->type != NO_TYPE && pal_text_is(value, "fixed"));
    }
    return true;
}

static pal_err inr_check(const source *s, const inr_words *w, header *h)
{
    static const char *const axis = "XYZ";
    for (int a = 0; a < 3; a++) {
        if (!(w->dim[a] >= 1 && w->dim[a] <= 1e6) || w->dim[a] != floor(w->dim[a]))
            return REFUSE(s, "line", w->dim_line[a], "%cDIM is %g", axis[a], w->dim[a]);
        h->n[a] = (int64_t)w->dim[a];
        h->to_m[5 * a] = 1e-3 * w->size[a];
    }
    if (w->vdim != 1) return REFUSE(s, "line", w->vdim_line, "VDIM is %g, one value in a voxel is read", w->vdim);
    int odd = 0;
    while (odd < 2 && w->size[odd] > 0 && w->size[odd] < 1e5) odd++;
    if (!axes_usable(h->to_m))
        return REFUSE(s, "line", w->size_line[odd], "a voxel of %g x %g x %g mm", w->size[0], w->size[1], w->size[2]);
    bool fixed = w->type == UNSIGNED || w->type == SIGNED;
    if (w->type == FLOATING && (w->bits == 32 || w->bits == 64))
        h->type = w->bits == 32 ? PAL_SCALAR_F32 : PAL_SCALAR_F64;
    else if (fixed && (w->bits == 8 || w->bits == 16 || w->bits == 32 || w->bits == 64))
        h->type = (pal_scalar)(2 * __builtin_ctzll((uint64_t)w->bits / 8) + (w->type == SIGNED));
    else
        return REFUSE(s, "line", w->type_line, "TYPE and PIXSIZE do not name a voxel type (%lld bits)",
                      (long long)w->bits);
    return PAL_ERR_OK;
}

static pal_err inr_header(const source *s, const uint8_t *b, size_t n, header *h)
{
    *h = (header){.slope = 1, .format = "inr", .axes = ""};
    /* the header fills blocks of 256 bytes and ends with the last one */
    for (size_t end = 256; end <= n && h->offset == 0; end += 256)
        if (memcmp(b + end - 4, "##}\n", 4) == 0) h->offset = end;
    if (h->offset == 0) return REFUSE(s, "byte", (int64_t)n, "no end of the header (##}) at a multiple of 256 bytes");
    inr_words w = {
        .vdim = 1, .size = {1, 1, 1}, .dim_line = {1, 1, 1}, .size_line = {1, 1, 1}, .vdim_line = 1, .type_line = 1};
    pal_text_scan scan = {.at = b, .end = b + h->offset - 4, .line = 1};
    while (pal_text_next_line(&scan)) {
        if (!pal_text_more(&scan) || *scan.at == '#') continue;
        const uint8_t *key = scan.at;
        while (scan.at < scan.end && *scan.at >= ' ' && *scan.at != '=') scan.at++;
        if (scan.at == scan.end || *scan.at != '=') return REFUSE(s, "line", scan.line, "expected KEY=value");
        size_t n_key = (size_t)(scan.at++ - key);
        while (n_key > 0 && key[n_key - 1] == ' ') n_key--;
        if (!inr_entry((const char *)key, n_key, &scan, &w, h))
            return REFUSE(s, "line", scan.line, "the value of %.*s is %s", (int)(n_key < 20 ? n_key : 20),
                          (const char *)key, pal_text_excerpt_at(&scan).text);
    }
    return inr_check(s, &w, h);
}

/* voxels to whole labels; NaN becomes 0, numbers beyond an int32 its limits */
static void convert(const header *h, const uint8_t *p, int64_t n, int32_t *label)
{
    if (h->type == PAL_SCALAR_U8 && h->slope == 1 && h->shift == 0) {
        for (int64_t i = 0; i < n; i++) label[i] = p[i];
        return;
    }
    int size = pal_scalar_size(h->type);
    for (int64_t i = 0; i < n; i++, p += size) {
        double v = h->slope * pal_scalar_at(p, h->type, h->big) + h->shift;
        label[i] = v >= INT32_MAX ? INT32_MAX : v <= INT32_MIN ? INT32_MIN : v == v ? (int32_t)lrint(v) : 0;
    }
}

/* converts voxels as their bytes come; need: bytes up to the last one */
static pal_err copy_voxels(const source *s, const header *h, unpacker *u, size_t n, size_t need, int32_t **label)
{
    uint8_t room[PIECE];
    const uint8_t *bytes;
    size_t at = 0, done = 0, cap = 0, size = (size_t)pal_scalar_size(h->type);
    while (at < need) {
        size_t max = at < h->offset ? h->offset - at : need - at, got;
        PAL_TRY(unpack_next(u, room, max < PIECE ? max : PIECE, &bytes, &got));
        if (got == 0 || (at >= h->offset && got % size))
            return REFUSE(s, "byte", (int64_t)(at + got),
                          "the %sfile ends, but %lld x %lld x %lld voxels need %zu bytes", s->packed ? "unpacked " : "",
                          (long long)h->n[0], (long long)h->n[1], (long long)h->n[2], need);
        at += got;
        if (at <= h->offset) continue;
        size_t more = got / size;
        if (done + more > cap) {
            cap = 2 * (done + more) < n ? 2 * (done + more) : n;
            int32_t *moved = realloc(*label, cap * sizeof *moved);
            if (!moved) return no_memory(s, cap * sizeof *moved);
            *label = moved;
        }
        convert(h, bytes, (int64_t)more, *label + done);
        done += more;
    }
    /* one byte more makes the unpacker check the checksum if nothing else follows */
    return unpack_next(u, room, 1, &bytes, &at);
}

static pal_err read_voxels(const source *s, const header *h, pal_label_volume *out)
{
    int64_t n = h->n[0] * h->n[1] * h->n[2];
    if (h->n[0] * h->n[1] > max_voxel || n > max_voxel)
        return pal_diagnostic_set(s->diag, PAL_ERR_BUDGET,
                                  "%s: byte 0: %lld x %lld x %lld voxels, at most %lld are read", s->name,
                                  (long long)h->n[0], (long long)h->n[1], (long long)h->n[2], (long long)max_voxel);
    unpacker u;
    int32_t *label = NULL;
    PAL_TRY(unpack_begin(&u, s));
    size_t need = h->offset + (size_t)n * (size_t)pal_scalar_size(h->type);
    pal_err err = copy_voxels(s, h, &u, (size_t)n, need, &label);
    if (s->packed) inflateEnd(&u.z);
    if (err) {
        free(label);
        return err;
    }
    *out = (pal_label_volume){.n = {(int)h->n[0], (int)h->n[1], (int)h->n[2]}, .label = label};
    memcpy(out->to_m, h->to_m, sizeof out->to_m);
    out->first_byte = (int64_t)h->offset;
    snprintf(out->format, sizeof out->format, "%s", h->format);
    snprintf(out->axes, sizeof out->axes, "%s", h->axes);
    return PAL_ERR_OK;
}

/* the beginning of the volume, at most max bytes, in the file itself or in room */
static pal_err view_head(const source *s, uint8_t *room, size_t max, const uint8_t **head, size_t *n_head)
{
    unpacker u;
    PAL_TRY(unpack_begin(&u, s));
    pal_err err = unpack_next(&u, room, max, head, n_head);
    if (s->packed) inflateEnd(&u.z);
    return err;
}

/* a header of text. Compressed voxels become the source themselves: positions in messages then count from their first
 * byte */
static pal_err
text_header(source *s, pal_err (*read)(const char *, const uint8_t *, size_t, pal_volume_header *, pal_diagnostic *),
            const uint8_t *head, size_t n_head, header *h)
{
    PAL_TRY(read(s->name, head, n_head, h, s->diag));
    if (!axes_usable(h->to_m)) return REFUSE(s, "byte", 0, "the voxel axes are flat or not finite");
    if (!h->packed) return PAL_ERR_OK;
    if (s->packed) return REFUSE(s, "byte", 0, "the file is compressed twice");
    s->bytes += h->offset, s->n_byte -= h->offset, s->packed = true;
    h->offset = 0;
    return PAL_ERR_OK;
}

pal_err pal_label_volume_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_label_volume *out,
                               pal_diagnostic *diag)
{
    char shown[128];
    pal_file_printable_name(shown, name);
    source s = {.name = shown, .diag = diag, .bytes = bytes, .n_byte = n_byte, .packed = is_gzip(bytes, n_byte)};
    if (n_byte == 0) return REFUSE(&s, "byte", 0, "the file is empty");
    uint8_t room[MAX_HEADER];
    const uint8_t *head;
    size_t n_head;
    header h = {.slope = 1};
    pal_err err = view_head(&s, room, sizeof room, &head, &n_head);
    if (!err && is_nifti(head, n_head))
        err = nifti_header(&s, head, n_head, &h);
    else if (!err && is_inr(head, n_head))
        err = inr_header(&s, head, n_head, &h);
    else if (!err && pal_is_nrrd(head, n_head))
        err = text_header(&s, pal_nrrd_header, head, n_head, &h);
    else if (!err && pal_is_metaimage(head, n_head))
        err = text_header(&s, pal_metaimage_header, head, n_head, &h);
    else if (!err)
        err = REFUSE(&s, "byte", 0, "neither NIfTI-1, NRRD, MetaImage nor INRIMAGE-4");
    return err ? err : read_voxels(&s, &h, out);
}

pal_err pal_label_volume_read(const char *path, pal_label_volume *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, max_file, &bytes, &n_byte, diag));
    pal_err err = pal_label_volume_parse(path, bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

void pal_label_volume_free(pal_label_volume *volume)
{
    free(volume->label);
    memset(volume, 0, sizeof *volume);
}

void pal_label_volume_threshold(pal_label_volume *volume, int32_t low, int32_t high)
{
    const int64_t n = (int64_t)volume->n[0] * volume->n[1] * volume->n[2];
    for (int64_t i = 0; i < n; i++) volume->label[i] = volume->label[i] >= low && volume->label[i] <= high;
}

bool pal_label_volume_is(const char *path)
{
    static const char *const tail[] = {".nii", ".nii.gz", ".inr", ".inr.gz", ".nrrd", ".mha"};
    for (size_t k = 0; k < sizeof tail / sizeof *tail; k++)
        if (pal_file_ends_with(path, tail[k])) return true;
    uint8_t bytes[4096], room[512];
    const uint8_t *head;
    FILE *file = fopen(path, "rb");
    if (!file) return false;
    size_t n_head = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    source s = {.name = path, .bytes = bytes, .n_byte = n_head, .packed = is_gzip(bytes, n_head)};
    return !view_head(&s, room, sizeof room, &head, &n_head) &&
           (is_nifti(head, n_head) || is_inr(head, n_head) || pal_is_nrrd(head, n_head) ||
            pal_is_metaimage(head, n_head));
}
