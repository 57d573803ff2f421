/* Surfaces from files: which reader, the checks that all formats share, cleaning and units. */
#include "server/mesh/files/mesh_file.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_build.h"

#include <stdlib.h>
#include <string.h>
/* no file is read beyond this */
static const size_t max_byte = (size_t)4 << 30;
/* of the diagonal: wider gaps between triangles are openings; a hundred times what is closed */
static const double max_gap = 1e-3;

typedef pal_err reader(pal_mesh_build *build);

/* by content first, by name second; NULL: neither is known */
static reader *choose(const char *name, const uint8_t *bytes, size_t n_byte)
{
    if (n_byte >= 4 && memcmp(bytes, "ply", 3) == 0 && bytes[3] <= ' ') return pal_ply_parse;
    if (pal_stl_is(bytes, n_byte)) return pal_stl_parse;
    if (pal_off_is(bytes, n_byte)) return pal_off_parse;
    if (pal_file_ends_with(name, ".obj")) return pal_obj_parse;
    if (pal_file_ends_with(name, ".stl")) return pal_stl_parse;
    if (pal_file_ends_with(name, ".off")) return pal_off_parse;
    return pal_obj_is(bytes, n_byte) ? pal_obj_parse : NULL;
}

static pal_err parse(pal_mesh_build *build)
{
    if (build->n_byte == 0) return PAL_MESH_REFUSE(build, 0, "the file is empty");
    reader *read = choose(build->name, build->bytes, build->n_byte);
    if (!read) return PAL_MESH_REFUSE(build, 0, "neither OBJ, STL, PLY nor OFF");
    PAL_TRY(read(build));
    if (build->max_index >= (int64_t)build->n_vertex)
        return PAL_MESH_REFUSE(build, build->max_index_at,
                               "a face uses vertex index %lld (from 0) of only %zu vertices",
                               (long long)build->max_index, build->n_vertex);
    return PAL_ERR_OK;
}

/* the triangles as they stand in the file, but those that cleaning drops: with a corner that is NaN or infinite */
static pal_err take_image(pal_mesh_build *build, pal_image_map *out)
{
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, out->x, 9 * build->n_tri);
    PAL_ARRAY(&err, out->at, 9 * build->n_tri);
    if (err) return pal_diagnostic_set(build->diag, err, "%s: no memory for image coordinates", build->name);
    for (size_t t = 0; t < build->n_tri; t++) {
        const int32_t *vt = build->tri_vt + 3 * t;
        bool finite = true, whole = true;
        for (size_t k = 0; k < 3; k++) {
            const double *x = build->x + 3 * (size_t)build->tri[3 * t + k];
            whole = whole && vt[k] >= 0 && (size_t)vt[k] < build->n_vt;
            for (int a = 0; a < 3; a++) finite = finite && fabs(x[a]) < 1e30;
        }
        if (!finite) continue;
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 9 * (size_t)out->n_tri + 3 * k;
            memcpy(out->x + at, build->x + 3 * (size_t)build->tri[3 * t + k], 3 * sizeof *out->x);
            for (size_t c = 0; c < 2; c++) out->at[at + c] = whole ? (float)build->vt[2 * (size_t)vt[k] + c] : 0;
            out->at[at + 2] = whole ? (float)build->tri_material[t] : -1;
        }
        out->n_tri++;
    }
    memcpy(out->library, build->library, sizeof out->library);
    out->n_material = build->n_material, out->material = build->material;
    build->material = NULL;
    return PAL_ERR_OK;
}

/* Refuses triangles that are not connected although their corners nearly meet: more than a tenth of their sides are
 * open, and welding from farther away closes most of these. */
static pal_err check_connected(const pal_mesh_build *build, double weld, const pal_surface *s)
{
    pal_surface near = {0};
    pal_surface_report report = {0};
    pal_surface_topology open = {0}, closer = {0};
    pal_err err = pal_surface_check(s, &open);
    if (err || open.n_open_edge <= 0.1 * 3 * s->n_tri) return err;
    err = pal_surface_copy(s, &near);
    if (!err) err = pal_surface_clean(&near, max_gap, &report, NULL);
    if (!err) err = pal_surface_check(&near, &closer);
    pal_surface_free(&near);
    if (err == PAL_ERR_MEMORY) return err;
    if (err || 2 * closer.n_open_edge > open.n_open_edge) return PAL_ERR_OK;
    double low[3], high[3];
    pal_surface_box(s, low, high);
    return PAL_MESH_REFUSE(
        build, build->first_at,
        "corners of neighbouring triangles miss each other by up to %.3g in the file's unit, and gaps "
        "of at most %.3g are closed: join them in the program that wrote the file",
        report.max_weld_m, weld * pal_dist3(low, high));
}

/* cleans and scales what was read */
static pal_err finish(pal_mesh_build *build, const pal_mesh_file_options *options, pal_surface *s,
                      pal_surface_report *report, double *unit_m, const char **unit_name)
{
    if (options->weld >= 0) {
        pal_diagnostic reason = {{0}};
        pal_err err = pal_surface_clean(s, options->weld, report, &reason);
        if (err == PAL_ERR_REFUSED) return PAL_MESH_REFUSE(build, build->first_at, "%s", reason.text);
        if (err) return pal_diagnostic_set(build->diag, err, "%s: %s", build->name, reason.text);
    }
    if (options->weld > 0) {
        pal_err err = check_connected(build, options->weld, s);
        if (err == PAL_ERR_MEMORY) return pal_diagnostic_set(build->diag, err, "%s: no memory to weld", build->name);
        if (err) return err;
    }
    double low[3], high[3], unit = options->unit_m;
    const char *word = "given";
    pal_surface_box(s, low, high);
    if (!(unit > 0)) unit = pal_mesh_unit_guess(pal_dist3(low, high), &word);
    for (size_t i = 0; i < 3 * (size_t)s->n_vertex; i++) s->x[i] *= unit;
    pal_scale3(s->origin_m, unit, s->origin_m);
    report->max_weld_m *= unit;
    *unit_m = unit;
    if (unit_name) *unit_name = word;
    return PAL_ERR_OK;
}

pal_err pal_mesh_file_parse(const char *name, const uint8_t *bytes, size_t n_byte, const pal_mesh_file_options *options,
                            pal_surface *out, pal_surface_report *report, double *unit_m, const char **unit_name,
                            pal_diagnostic *diag)
{
    static const pal_mesh_file_options plain = {.weld = PAL_MESH_WELD};
    char shown[128];
    pal_file_printable_name(shown, name);
    if (!options) options = &plain;
    pal_mesh_build build = {.name = shown,
                            .bytes = bytes,
                            .n_byte = n_byte,
                            .diag = diag,
                            .binary = true,
                            .takes_image = options->image != NULL,
                            .max_index = -1};
    pal_image_map image = {0};
    pal_err err = parse(&build);
    if (!err && build.n_vt > 0 && build.tri_vt) err = take_image(&build, &image);
    pal_surface s = {.n_vertex = (int)build.n_vertex, .n_tri = (int)build.n_tri, .x = build.x, .tri = build.tri};
    pal_surface_report found = {.n_vertex_read = (int64_t)build.n_vertex, .n_tri_read = (int64_t)build.n_tri};
    if (!err) {
        snprintf(found.format, sizeof found.format, "%s", build.format);
        snprintf(found.place, sizeof found.place, "%s %lld", build.binary ? "byte" : "line", (long long)build.first_at);
        double unit = 1;
        err = finish(&build, options, &s, &found, &unit, unit_name);
        if (unit_m) *unit_m = unit;
        for (size_t k = 0; k < 9 * (size_t)image.n_tri; k++) image.x[k] = image.x[k] * unit - s.origin_m[k % 3];
    }
    PAL_FREE(build.vt, build.tri_vt, build.tri_material, build.material);
    if (err) {
        pal_surface_free(&s);
        pal_image_map_free(&image);
        return err;
    }
    if (options->image) *options->image = image;
    *out = s;
    if (report) *report = found;
    return PAL_ERR_OK;
}

pal_err pal_mesh_file_read(const char *path, const pal_mesh_file_options *options, pal_surface *out,
                           pal_surface_report *report, double *unit_m, const char **unit_name, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, max_byte, &bytes, &n_byte, diag));
    pal_err err = pal_mesh_file_parse(path, bytes, n_byte, options, out, report, unit_m, unit_name, diag);
    free(bytes);
    return err;
}

double pal_mesh_unit_guess(double diagonal, const char **name)
{
    const char *word = "scaled";
    double unit = 1;
    if (diagonal >= 3 && diagonal <= 3000)
        word = "mm", unit = 1e-3;
    else if (diagonal >= 0.003 && diagonal < 3)
        word = "m";
    else if (diagonal > 0 && isfinite(diagonal))
        unit = 0.2 / diagonal;
    if (name) *name = word;
    return unit;
}

double pal_mesh_unit_named(const char *word)
{
    static const struct {
        const char *word;
        double unit_m;
    } known[] = {{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"in", 0.0254}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(word, known[i].word) == 0) return known[i].unit_m;
    return 0;
}
