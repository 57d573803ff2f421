/* Wavefront OBJ: positions and faces (n-gons as fans, negative indices, v/vt/vn forms, continuation lines); where an
 * image is asked for, image coordinates, the file of materials and the materials of faces too; everything else is left
 * out. */
#include "server/base/heap.h"
#include "server/mesh/files/mesh_build.h"

#include <math.h>

static const char *const keywords[] = {"v", "vt", "vn", "vp", "f", "l", "p", "g", "o", "s", "usemtl", "mtllib", "#"};

bool pal_obj_is(const uint8_t *bytes, size_t n_byte)
{
    pal_text_scan scan = {.at = bytes, .end = bytes + n_byte, .line = 1};
    do {
        if (!pal_text_more(&scan)) continue;
        if (*scan.at == '#') continue;
        for (size_t k = 0; k < sizeof keywords / sizeof *keywords; k++)
            if (pal_text_is(&scan, keywords[k])) return true;
        return false;
    } while (scan.line < 1000 && pal_text_next_line(&scan));
    return false;
}

/* digits with or without a minus; NULL: none */
static const uint8_t *read_index(const uint8_t *p, const uint8_t *end, int64_t *index)
{
    bool negative = p < end && *p == '-';
    int64_t value = 0;
    const uint8_t *first = p += negative;
    for (; p < end && *p >= '0' && *p <= '9'; p++)
        if (value < (int64_t)1 << 40) value = 10 * value + (*p - '0');
    *index = negative ? -value : value;
    return p == first ? NULL : p;
}

/* the indices of a corner v, v/vt, v//vn or v/vt/vn, of vt 0: none; false when the word is none of these */
static bool read_corner(pal_text_scan *scan, int64_t *index, int64_t *image)
{
    const uint8_t *p = read_index(scan->at, scan->end, index), *end = scan->end;
    *image = 0;
    if (!p) return false;
    if (p < end && *p == '/') (void)read_index(p + 1, end, image);
    if (p < end && *p == '/')
        while (p < end && (*p == '/' || *p == '-' || (*p >= '0' && *p <= '9'))) p++;
    if (p<end && * p> ' ' && *p != '\\') return false;
    scan->at = p;
    return true;
}

static pal_err read_face(pal_mesh_build *build, pal_text_scan *scan)
{
    if (!pal_text_more(scan)) return PAL_MESH_REFUSE(build, scan->line, "a face without corners");
    pal_mesh_fan_begin(build, scan->line);
    while (pal_text_more(scan)) {
        int64_t index, image;
        if (!read_corner(scan, &index, &image))
            return PAL_MESH_REFUSE(build, scan->line, "a face corner is %s", pal_text_excerpt_at(scan).text);
        if (index == 0) return PAL_MESH_REFUSE(build, scan->line, "a face uses vertex 0, the first is 1");
        if (index < 0 && -index > (int64_t)build->n_vertex)
            return PAL_MESH_REFUSE(build, scan->line, "a face uses vertex %lld, only %zu came before", (long long)index,
                                   build->n_vertex);
        image = image < 0 ? (int64_t)build->n_vt + image : image - 1;
        build->corner_vt = image < 0 || image > INT32_MAX - 1 ? -1 : (int32_t)image;
        PAL_TRY(pal_mesh_fan_corner(build, scan->line, index < 0 ? (int64_t)build->n_vertex + index : index - 1));
    }
    return pal_mesh_fan_end(build);
}

/* a line of another keyword: text is left out, other bytes mean that this is no OBJ file */
static pal_err skip_line(pal_mesh_build *build, pal_text_scan *scan)
{
    for (const uint8_t *p = scan->at; p < scan->end && *p != '\n' && *p != '\r'; p++)
        if (*p < 0x20 && *p != '\t' && *p != '\v' && *p != '\f')
            return PAL_MESH_REFUSE(build, scan->line, "byte 0x%02x in a text file", *p);
    return PAL_ERR_OK;
}

static pal_err read_image_point(pal_mesh_build *build, pal_text_scan *scan)
{
    double uv[2] = {0, 0};
    for (int c = 0; c < 2; c++)
        if (!pal_text_double(scan, &uv[c]) || !(fabs(uv[c]) < 1e6)) uv[c] = 0;
    return pal_mesh_image_point(build, uv);
}

/* a name: all of the line, as names may have spaces */
static void read_name(const pal_text_scan *scan, pal_material_name out)
{
    pal_text_scan at = *scan;
    size_t n = 0;
    if (pal_text_more(&at))
        for (const uint8_t *p = at.at; p < at.end && *p >= 0x20 && n < PAL_MATERIAL_NAME - 1; p++) out[n++] = (char)*p;
    while (n > 0 && out[n - 1] == ' ') n--;
    out[n] = 0;
}

/* the material of the faces that come */
static pal_err use_material(pal_mesh_build *build, const pal_text_scan *scan, const pal_material_name name)
{
    for (int k = 0; k < build->n_material; k++)
        if (!strcmp(build->material[k], name)) return build->now_material = k, PAL_ERR_OK;
    if (build->n_material == PAL_MATERIAL_MAX)
        return PAL_MESH_REFUSE(build, scan->line, "more than %d materials", PAL_MATERIAL_MAX);
    if (!pal_heap_grow(&build->material, (size_t)build->n_material, sizeof *build->material))
        return pal_diagnostic_set(build->diag, PAL_ERR_MEMORY, "%s: no memory for a material", build->name);
    memcpy(build->material[build->n_material], name, sizeof *build->material);
    build->now_material = build->n_material++;
    return PAL_ERR_OK;
}

/* faces before the first usemtl have a material without name */
static pal_err begin_face(pal_mesh_build *build, const pal_text_scan *scan)
{
    static const pal_material_name none = "";
    return build->takes_image && build->n_material == 0 ? use_material(build, scan, none) : PAL_ERR_OK;
}

/* the first file of materials counts */
static void read_library(pal_mesh_build *build, const pal_text_scan *scan)
{
    if (!build->library[0]) read_name(scan, build->library);
}

static pal_err read_material(pal_mesh_build *build, const pal_text_scan *scan)
{
    pal_material_name name = "";
    read_name(scan, name);
    return use_material(build, scan, name);
}

pal_err pal_obj_parse(pal_mesh_build *build)
{
    build->format = "obj";
    build->binary = false;
    pal_text_scan scan = {
        .at = build->bytes, .end = build->bytes + build->n_byte, .line = 1, .hash = true, .joins = true};
    do {
        if (pal_text_is(&scan, "v"))
            PAL_TRY(pal_mesh_position(build, &scan, "a position"));
        else if (pal_text_is(&scan, "f")) {
            PAL_TRY(begin_face(build, &scan));
            PAL_TRY(read_face(build, &scan));
        } else if (build->takes_image && pal_text_is(&scan, "vt"))
            PAL_TRY(read_image_point(build, &scan));
        else if (build->takes_image && pal_text_is(&scan, "mtllib"))
            read_library(build, &scan);
        else if (build->takes_image && pal_text_is(&scan, "usemtl"))
            PAL_TRY(read_material(build, &scan));
        else
            PAL_TRY(skip_line(build, &scan));
    } while (pal_text_next_line(&scan));
    if (build->n_tri == 0)
        return PAL_MESH_REFUSE(build, scan.line, "the file ends after %zu positions without a face", build->n_vertex);
    return PAL_ERR_OK;
}
