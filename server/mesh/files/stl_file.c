/* STL: binary (84 bytes, then 50 a triangle) and ASCII. A binary file may begin with "solid", so the size decides
 * first: a file whose size fits its triangle count is binary. Normals are ignored; the order of corners defines the
 * orientation. */
#include "server/mesh/files/mesh_build.h"
#include "server/mesh/files/scalar_bytes.h"

enum { HEAD = 84, RECORD = 50 };

static uint32_t triangle_count(const uint8_t *bytes)
{
    return (uint32_t)pal_word_at(bytes + 80, 4, false);
}

static bool size_fits(const uint8_t *bytes, size_t n_byte)
{
    return n_byte >= HEAD && n_byte == HEAD + RECORD * (size_t)triangle_count(bytes);
}

/* begins with "solid", and the first word of a later line belongs to an ASCII file */
static bool is_ascii(const uint8_t *bytes, size_t n_byte)
{
    pal_text_scan scan = {.at = bytes, .end = bytes + n_byte, .line = 1};
    if (!pal_text_seek(&scan) || !pal_text_is(&scan, "solid")) return false;
    if (memchr(bytes, 0, n_byte < HEAD ? n_byte : HEAD)) return false;
    if (!pal_text_next_line(&scan) || !pal_text_seek(&scan)) return true;
    return pal_text_is(&scan, "facet") || pal_text_is(&scan, "endsolid") || n_byte < HEAD;
}

bool pal_stl_is(const uint8_t *bytes, size_t n_byte)
{
    return size_fits(bytes, n_byte) || is_ascii(bytes, n_byte);
}

static pal_err parse_binary(pal_mesh_build *build)
{
    build->format = "stl binary";
    build->binary = true;
    if (build->n_byte < HEAD)
        return PAL_MESH_REFUSE(build, (int64_t)build->n_byte, "the file ends inside the 84 byte head");
    size_t n_tri = triangle_count(build->bytes), room = (build->n_byte - HEAD) / RECORD;
    if (n_tri == 0) return PAL_MESH_REFUSE(build, 80, "the file has no triangle");
    if (n_tri > room)
        return PAL_MESH_REFUSE(build, 80, "claims %zu triangles, but the file ends after %zu", n_tri, room);
    for (size_t t = 0; t < n_tri; t++) {
        const uint8_t *record = build->bytes + HEAD + RECORD * t + 12;
        int64_t at = (int64_t)(HEAD + RECORD * t);
        pal_mesh_fan_begin(build, at);
        for (int k = 0; k < 3; k++) {
            double p[3];
            for (int a = 0; a < 3; a++) p[a] = pal_float_at(record + 12 * k + 4 * a, false);
            PAL_TRY(pal_mesh_vertex(build, p));
            PAL_TRY(pal_mesh_fan_corner(build, at, (int64_t)build->n_vertex - 1));
        }
    }
    return PAL_ERR_OK;
}

/* one loop: vertices up to endloop, as a fan */
static pal_err read_loop(pal_mesh_build *build, pal_text_scan *scan)
{
    pal_mesh_fan_begin(build, scan->line);
    while (pal_text_seek(scan) && pal_text_is(scan, "vertex")) {
        PAL_TRY(pal_mesh_position(build, scan, "a vertex"));
        PAL_TRY(pal_mesh_fan_corner(build, scan->line, (int64_t)build->n_vertex - 1));
    }
    if (!pal_text_is(scan, "endloop"))
        return PAL_MESH_REFUSE(build, scan->line, "expected vertex or endloop, found %s",
                               pal_text_excerpt_at(scan).text);
    return pal_mesh_fan_end(build);
}

static pal_err parse_ascii(pal_mesh_build *build)
{
    build->format = "stl ascii";
    build->binary = false;
    pal_text_scan scan = {.at = build->bytes, .end = build->bytes + build->n_byte, .line = 1};
    bool open = false;
    while (pal_text_seek(&scan)) {
        if (pal_text_is(&scan, "solid") || pal_text_is(&scan, "endsolid")) {
            pal_text_next_line(&scan);
        } else if (pal_text_is(&scan, "facet")) {
            /* the normal's numbers may be missing or nan */
            if (pal_text_is(&scan, "normal"))
                for (int k = 0; k < 3; k++) pal_text_word(&scan);
            open = true;
        } else if (pal_text_is(&scan, "outer")) {
            if (!pal_text_is(&scan, "loop"))
                return PAL_MESH_REFUSE(build, scan.line, "expected loop, found %s", pal_text_excerpt_at(&scan).text);
            PAL_TRY(read_loop(build, &scan));
        } else if (pal_text_is(&scan, "endfacet")) {
            open = false;
        } else {
            return PAL_MESH_REFUSE(build, scan.line, "expected facet or endsolid, found %s",
                                   pal_text_excerpt_at(&scan).text);
        }
    }
    if (open) return PAL_MESH_REFUSE(build, scan.line, "the file ends inside a facet");
    if (build->n_tri == 0) return PAL_MESH_REFUSE(build, scan.line, "the file has no facet");
    return PAL_ERR_OK;
}

pal_err pal_stl_parse(pal_mesh_build *build)
{
    bool ascii = !size_fits(build->bytes, build->n_byte) && is_ascii(build->bytes, build->n_byte);
    return ascii ? parse_ascii(build) : parse_binary(build);
}
