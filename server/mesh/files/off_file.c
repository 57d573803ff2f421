/* Object File Format: OFF, with optional ST, C, N prefixes whose extra numbers are left out. Binary OFF and the four-
 * and n-dimensional kinds are refused. */
#include "server/mesh/files/mesh_build.h"

#include <stdio.h>
#include <string.h>

/* takes the header word; 1: a kind we read, -1: one we do not, 0: no OFF header */
static int take_header(pal_text_scan *scan)
{
    if (!pal_text_seek(scan)) return 0;
    pal_text_scan start = *scan;
    size_t n = pal_text_word(scan);
    const char *word = (const char *)start.at;
    bool off = n >= 3 && n <= 8 && memcmp(word + n - 3, "OFF", 3) == 0;
    for (size_t k = 0; off && k + 3 < n; k++) off = strchr("STCN4n", word[k]) != NULL && word[k] != 0;
    if (!off) {
        *scan = start;
        return 0;
    }
    bool flat = memchr(word, '4', n) == NULL && memchr(word, 'n', n) == NULL;
    return flat && !pal_text_is(scan, "BINARY") ? 1 : -1;
}

bool pal_off_is(const uint8_t *bytes, size_t n_byte)
{
    pal_text_scan scan = {.at = bytes, .end = bytes + n_byte, .line = 1, .hash = true};
    return take_header(&scan) != 0;
}

static pal_err read_counts(pal_mesh_build *build, pal_text_scan *scan, int64_t n[2])
{
    static const char *const what[2] = {"vertices", "faces"};
    for (int k = 0; k < 2; k++) {
        if (!pal_text_seek(scan) || !pal_text_int(scan, &n[k]) || n[k] < 0)
            return PAL_MESH_REFUSE(build, scan->line, "the number of %s is %s", what[k],
                                   pal_text_excerpt_at(scan).text);
        /* a vertex takes at least six bytes, a face at least two */
        int64_t max = (scan->end - scan->at) / (k == 0 ? 6 : 2) + 1;
        if (n[k] > max)
            return PAL_MESH_REFUSE(build, scan->line, "claims %lld %s, but only %lld bytes follow", (long long)n[k],
                                   what[k], (long long)(scan->end - scan->at));
    }
    return PAL_ERR_OK;
}

static pal_err read_vertices(pal_mesh_build *build, pal_text_scan *scan, int64_t n)
{
    for (int64_t i = 0; i < n; i++) {
        char what[40];
        snprintf(what, sizeof what, "vertex %lld", (long long)i);
        pal_text_next_line(scan);
        if (!pal_text_seek(scan))
            return PAL_MESH_REFUSE(build, scan->line, "the file ends after %lld of %lld vertices", (long long)i,
                                   (long long)n);
        PAL_TRY(pal_mesh_position(build, scan, what));
    }
    return PAL_ERR_OK;
}

static pal_err read_face(pal_mesh_build *build, pal_text_scan *scan, int64_t face)
{
    int64_t n, index;
    if (!pal_text_int(scan, &n) || n < 0)
        return PAL_MESH_REFUSE(build, scan->line, "face %lld begins with %s, not its number of corners",
                               (long long)face, pal_text_excerpt_at(scan).text);
    pal_mesh_fan_begin(build, scan->line);
    for (int64_t k = 0; k < n; k++) {
        if (!pal_text_int(scan, &index))
            return PAL_MESH_REFUSE(build, scan->line, "corner %lld of %lld of face %lld is %s", (long long)k + 1,
                                   (long long)n, (long long)face, pal_text_excerpt_at(scan).text);
        PAL_TRY(pal_mesh_fan_corner(build, scan->line, index));
    }
    return pal_mesh_fan_end(build);
}

pal_err pal_off_parse(pal_mesh_build *build)
{
    build->format = "off";
    build->binary = false;
    pal_text_scan scan = {.at = build->bytes, .end = build->bytes + build->n_byte, .line = 1, .hash = true};
    if (take_header(&scan) < 0) return PAL_MESH_REFUSE(build, scan.line, "only three-dimensional text OFF is read");
    int64_t n[2];
    PAL_TRY(read_counts(build, &scan, n));
    PAL_TRY(read_vertices(build, &scan, n[0]));
    for (int64_t face = 0; face < n[1]; face++) {
        pal_text_next_line(&scan);
        if (!pal_text_seek(&scan))
            return PAL_MESH_REFUSE(build, scan.line, "the file ends after %lld of %lld faces", (long long)face,
                                   (long long)n[1]);
        PAL_TRY(read_face(build, &scan, face));
    }
    if (build->n_tri == 0) return PAL_MESH_REFUSE(build, scan.line, "the file has no face");
    return PAL_ERR_OK;
}
