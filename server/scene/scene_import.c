/* Surfaces and label volumes -> prepared meshes and default scenes.
 *
 * Default resolution: about 13,000 tetrahedra, i.e. 2,600 kept voxels, whatever the shape. With V the volume, A the
 * area and h the voxel edge, the inside voxels are V/h^3 and the border layer about 1.1 A/h^2 of them; that equation
 * gives a first h, the fill then counts (it takes milliseconds at this size), and the resolution is corrected by the
 * cube root of what is missing, at most three times. For model fem the same search wants about 2,500 nodes, which
 * implicit_euler steps 60 times a second on one core, and leaves out border voxels that hold less than a tenth
 * of material: they would add unknowns and next to no stiffness. */
#include "server/scene/scene_import.h"

#include "server/base/clock.h"
#include "server/base/flags.h"
#include "server/base/utf8.h"
#include "server/base/vec3.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/geometry/organ_family.h"
#include "server/mesh/geometry/procedural.h"
#include "server/mesh/scan/dicom_series.h"
#include "server/num/sort.h"
#include "server/scene/subdivision_file.h"
#include "server/scene/tuning.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { LABELS = 64 };

static void report_progress(const pal_surface_scene *options, const char *what, double fraction)
{
    if (options->progress) options->progress(what, fraction, options->user);
}

void pal_scene_stem(const char *path, char *out, size_t n_byte)
{
    static const char *const endings[] = {".gz",  ".nii", ".inr",     ".seg.nrrd", ".nrrd", ".mha",
                                          ".obj", ".stl", ".ply",     ".off",      ".OBJ",  ".STL",
                                          ".PLY", ".OFF", ".palmesh", ".palcells"};
    /* a folder may end with a slash */
    size_t end = strlen(path);
    while (end > 1 && path[end - 1] == '/') end--;
    size_t begin = end;
    while (begin > 0 && path[begin - 1] != '/') begin--;
    snprintf(out, n_byte, "%.*s", (int)(end - begin), path + begin);
    for (size_t k = 0; k < sizeof endings / sizeof endings[0]; k++) {
        size_t n = strlen(out), m = strlen(endings[k]);
        if (n > m && !strcmp(out + n - m, endings[k])) out[n - m] = 0;
    }
}

void pal_scene_plain_name(const char *text, const char *otherwise, char out[PAL_NAME])
{
    size_t n = 0;
    for (; *text && n < PAL_NAME - 1; text++) {
        char c = (char)tolower((unsigned char)*text);
        bool fine = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
        if (fine || c == ' ' || c == '.') out[n++] = fine ? c : '_';
    }
    out[n] = 0;
    if (n == 0) snprintf(out, PAL_NAME, "%s", otherwise);
}

/* length of the word at the head of text, in which a space, '-' or nothing may stand for '_'; 0: it is not there */
static size_t match_word(const char *text, const char *word, size_t n_word)
{
    size_t n = 0;
    for (size_t k = 0; k < n_word; k++) {
        if (word[k] == '_' && !strchr("_- ", text[n])) continue;
        if (word[k] != '_' && tolower((unsigned char)text[n]) != word[k]) return 0;
        if (!text[n]) return 0;
        n++;
    }
    return isalpha((unsigned char)text[n]) ? 0 : n;
}

void pal_scene_guess_appearance(const char *name, char out[PAL_APPEARANCE_BYTES])
{
    out[0] = 0;
    for (size_t at = 0; name[at]; at++) {
        if (at > 0 && isalpha((unsigned char)name[at - 1])) continue;
        for (const char *word = PAL_APPEARANCES; *word;) {
            const size_t n = strcspn(word, "|");
            if (match_word(name + at, word, n)) {
                snprintf(out, PAL_APPEARANCE_BYTES, "%.*s", (int)n, word);
                return;
            }
            word += n + (word[n] == '|');
        }
    }
}

/* what of a file name may be shown to people */
static void shown_text(const char *from, char *out, size_t n_byte)
{
    size_t n = 0, n_from = strlen(from);
    for (size_t at = 0; at < n_from;) {
        uint32_t code;
        int size = pal_utf8_next(from + at, n_from - at, &code);
        if (size && pal_utf8_printable(code)) {
            if (n + (size_t)size >= n_byte) break;
            memcpy(out + n, from + at, (size_t)size);
            n += (size_t)size;
        }
        at += size ? (size_t)size : 1;
    }
    out[n] = 0;
}

static int first_resolution(const pal_surface *surface)
{
    double low[3], high[3], longest = 0;
    pal_surface_box(surface, low, high);
    for (int k = 0; k < 3; k++) longest = fmax(longest, high[k] - low[k]);
    double volume = fabs(pal_surface_volume(surface)), area = pal_surface_area(surface);
    /* V n^3 + 1.1 A L n^2 = 2600 L^3 for n = L/h, rising in n: by bisection */
    double few = 1, many = 512;
    for (int k = 0; k < 60; k++) {
        double n = 0.5 * (few + many), f = n / longest;
        *(volume * f * f * f + PAL_BORDER_FACTOR * area * f * f < PAL_WANTED_VOXELS ? &few : &many) = n;
    }
    return (int)lround(few);
}

static int clamp(int n, int low, int high)
{
    return n < low ? low : n > high ? high : n;
}

static pal_voxel_options voxel_options(const pal_surface_scene *options)
{
    return (pal_voxel_options){.resolution = options->resolution,
                               .border = true,
                               .largest_only = options->largest_only,
                               .min_fill = options->fem ? PAL_FEM_MIN_FILL : 0};
}

/* corners of kept voxels, or 0 without memory to count them */
static double count_nodes(const pal_voxels *v)
{
    int64_t nx = v->n[0] + 1, ny = v->n[1] + 1, nz = v->n[2] + 1, n = 0;
    uint8_t *seen = calloc((size_t)(nx * ny * nz), 1);
    if (!seen) return 0;
    for (int64_t at = 0, k = 0; k < v->n[2]; k++)
        for (int64_t j = 0; j < v->n[1]; j++)
            for (int64_t i = 0; i < v->n[0]; i++, at++)
                for (int c = 0; c < 8 && v->kind[at]; c++)
                    seen[((k + (c >> 2)) * ny + j + (c >> 1 & 1)) * nx + i + (c & 1)] = 1;
    for (int64_t k = 0; k < nx * ny * nz; k++) n += seen[k];
    free(seen);
    return (double)n;
}

/* the resolution that comes nearest to 2,600 kept voxels, or for model fem to 2,500 nodes */
static pal_err choose_resolution(const pal_surface *surface, const pal_surface_scene *requested, int *out,
                                 pal_diagnostic *diag)
{
    int n = clamp(first_resolution(surface), 4, 400), best = 0;
    double best_miss = INFINITY;
    for (int round = 0; round < 4; round++) {
        pal_voxel_options options = voxel_options(requested);
        options.resolution = n;
        pal_voxels voxels;
        pal_voxel_report report;
        pal_err err = pal_voxels_fill(surface, &options, &voxels, &report, diag);
        /* nothing inside at a coarse grid: try a finer one before believing it */
        if (err == PAL_ERR_REFUSED && round < 3 && best == 0 && n < 100) {
            n *= 2;
            continue;
        }
        if (err && best == 0) return err;
        if (err) break;
        double kept = (double)(voxels.n_inside + voxels.n_border),
               want = requested->fem ? PAL_WANTED_NODES : PAL_WANTED_VOXELS;
        if (requested->fem) kept = fmax(1, count_nodes(&voxels));
        double miss = fabs(log(kept / want));
        pal_voxels_free(&voxels);
        if (miss < best_miss) best_miss = miss, best = n;
        int next = clamp((int)lround(n * cbrt(want / kept)), 4, 400);
        if (next == n || miss < 0.1) break;
        n = next;
    }
    *out = best;
    return PAL_ERR_OK;
}

/* the label asked for, or the most frequent one */
static pal_err read_volume(const char *path, const pal_surface_scene *options, pal_surface *out,
                           pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_label_volume volume;
    pal_label_count count[LABELS];
    PAL_TRY(pal_scan_read(path, &volume, diag));
    report_progress(options, "label", 0);
    if (options->threshold) pal_label_volume_threshold(&volume, options->low, options->high);
    int n = pal_label_volume_list(&volume, count, LABELS);
    snprintf(report->surface.place, sizeof report->surface.place, "byte %lld", (long long)volume.first_byte);
    const bool other = volume.axes[0] && options->axes[0] && strcmp(volume.axes, options->axes) != 0;
    if (!options->axes[0]) snprintf(report->axes, sizeof report->axes, "%s", volume.axes);
    /* DICOM holds images rather than labels */
    const bool image = n == LABELS && !strcmp(volume.format, "dicom") && options->label < 0;
    pal_err err =
        other   ? PAL_REFUSE(diag, "%s: the axes of the scan are %s, not %s", path, volume.axes, options->axes)
        : image ? PAL_REFUSE(diag,
                             "%s: is no segmentation, its voxels have %d values or more: --threshold LOW,HIGH "
                             "takes those of a range (CT: Hounsfield units), --label N those of one value",
                             path, LABELS)
        : n > 0 ? PAL_ERR_OK
        : options->threshold ? PAL_REFUSE(diag, "%s: no voxel is within %d to %d", path, options->low, options->high)
                             : PAL_REFUSE(diag, "%s: %s: the volume holds no label but 0", path, report->surface.place);
    if (!err) {
        int wanted = options->adaptive ? PAL_COARSE_TRI : PAL_WANTED_TRI;
        pal_label_surface_options surface = {
            .blur_m = -1, .smooth_rounds = -1, .target_tri = options->target_tri ? options->target_tri : wanted};
        pal_diagnostic reason = {""};
        report->n_label = n;
        report->label = options->label >= 0 ? options->label : count[0].label;
        err = pal_label_volume_surface(&volume, report->label, &surface, out, &reason);
        if (err) pal_diagnostic_set(diag, err, "%s: %s: %s", path, report->surface.place, reason.text);
        snprintf(report->surface.format, sizeof report->surface.format, "%s", volume.format);
        report->surface.n_vertex_read = err ? 0 : out->n_vertex;
        report->surface.n_tri_read = err ? 0 : out->n_tri;
    }
    pal_label_volume_free(&volume);
    return err;
}

static pal_err read_any(const char *path, const pal_surface_scene *options, pal_surface *out,
                        pal_surface_scene_report *report, pal_diagnostic *diag)
{
    double start = pal_clock_s();
    struct stat facts;
    report_progress(options, "read", 0);
    report->label = -1;
    snprintf(report->axes, sizeof report->axes, "%s", options->axes);
    /* a pipe or device would be waited for */
    if (stat(path, &facts)) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    const bool folder = S_ISDIR(facts.st_mode);
    if (!S_ISREG(facts.st_mode) && !folder) return PAL_REFUSE(diag, "%s: not a file", path);
    pal_err err;
    if (folder || pal_label_volume_is(path)) {
        if (options->unit_m > 0 && options->unit_m != 1e-3)
            return PAL_REFUSE(diag, "%s: a scan is in mm, no other unit can be given", path);
        report->unit_m = 1e-3;
        report->unit_name = "mm";
        err = read_volume(path, options, out, report, diag);
    } else if (options->label > 0) {
        err = PAL_REFUSE(diag, "%s: label %d is wanted, but this is not a label volume", path, options->label);
    } else if (options->threshold) {
        err = PAL_REFUSE(diag, "%s: a threshold is given, but this is not a volume", path);
    } else {
        pal_mesh_file_options file = {.unit_m = options->unit_m, .weld = PAL_MESH_WELD, .image = options->image};
        report->unit_guessed = options->unit_m == 0;
        err = pal_mesh_file_read(path, &file, out, &report->surface, &report->unit_m, &report->unit_name, diag);
    }
    report->read_s = pal_clock_s() - start;
    return err;
}

/* surface -> prepared mesh at the resolution asked for or chosen */
static pal_err make(const char *name, const pal_surface *surface, const pal_surface_scene *options, pal_prepared *out,
                    pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_diagnostic reason = {""};
    pal_voxel_options voxel = voxel_options(options);
    pal_err err = PAL_ERR_OK;
    if (options->adaptive) {
        err = pal_scene_adaptive_prepare(surface, options, out, &reason);
    } else {
        report_progress(options, "fill", 0);
        if (!options->resolution) err = choose_resolution(surface, options, &voxel.resolution, &reason);
        report_progress(options, "split and skin", 0);
        if (!err) err = pal_prepared_make(surface, &voxel, out, &report->prepare, &reason);
        report->resolution = voxel.resolution;
    }
    const char *place = report->surface.place;
    return err ? pal_diagnostic_set(diag, err, "%s: %s%s%s", name, place, *place ? ": " : "", reason.text) : PAL_ERR_OK;
}

pal_err pal_scene_prepare_file(const char *path, const pal_surface_scene *options, pal_prepared *out,
                               pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_surface_scene_report own = {0};
    pal_surface surface = {0};
    if (!report) report = &own;
    PAL_TRY(read_any(path, options, &surface, report, diag));
    pal_err err = make(path, &surface, options, out, report, diag);
    pal_surface_free(&surface);
    return err;
}

/* A shape that was scanned, or drawn as it lies, is in balance with its weight: pulling it down once more would count
 * gravity twice (and let 5 kPa tissue sag by a third of its height). */
static void leave_gravity_out(pal_body_def *body)
{
    int kept = 0;
    for (int k = 0; k < body->n_effect; k++)
        if (strcmp(body->effect[k].name, "gravity")) body->effect[kept++] = body->effect[k];
    body->n_effect = kept;
}

/* model and solver as asked for */
static pal_err choose_model(pal_body_def *body, const pal_surface_scene *options,
                            const pal_surface_scene_report *report, pal_diagnostic *diag)
{
    if (options->adaptive) return pal_scene_adaptive_defaults(body, options, report, diag);
    /* edges and volumes alone have the same moduli and cost half (README, tables) */
    if (!options->fem)
        return options->area_springs ? PAL_ERR_OK : pal_entry_put_number(&body->model, "k_area_J", 0, diag);
    pal_entry_init(&body->model, "bodies[0].model", "fem");
    PAL_TRY(pal_entry_put_text(&body->model, "element", options->element ? options->element : "hex8_bbar", diag));
    PAL_TRY(pal_entry_put_text(&body->model, "law", options->law ? options->law : "corotational", diag));
    PAL_TRY(pal_entry_put_bool(&body->model, "fill", true, diag));
    pal_entry_init(&body->solver, "bodies[0].solver", options->solver ? options->solver : "implicit_euler");
    return PAL_ERR_OK;
}

/* a solid that stands on a thin part, as a kidney on its ureter, would sway on it for half a minute: what is held is
 * the part of the height that has an eighth of the control vertices */
static pal_err hold_an_eighth(const pal_cells *cells, const double up[3], double *fraction)
{
    int n = cells->n_vertex;
    double *height = malloc(sizeof(double) * (size_t)n);
    if (!height) return PAL_ERR_MEMORY;
    for (int i = 0; i < n; i++) height[i] = pal_dot3(cells->x + 3 * (size_t)i, up);
    qsort(height, (size_t)n, sizeof(double), pal_compare_double);
    double part = (height[(n - 1) / 8] - height[0]) / (height[n - 1] - height[0]);
    *fraction = fmax(*fraction, part);
    free(height);
    return PAL_ERR_OK;
}

/* on an organ the first hand grasps, the second retracts, the third palpates; clay is touched with balls */
static void lay_out_tools(pal_scene *scene, double radius_m)
{
    static const pal_instrument instrument[] = {PAL_INSTRUMENT_GRASPER, PAL_INSTRUMENT_RETRACTOR, PAL_INSTRUMENT_PROBE};
    pal_tools_default(scene, (int)(sizeof instrument / sizeof instrument[0]));
    for (int t = 0; t < scene->n_tool; t++) {
        pal_tool_def *tool = &scene->tool[t];
        tool->radius_m = radius_m;
        if (scene->body[0].cells) continue;
        tool->instrument = instrument[t];
        snprintf(tool->name, sizeof tool->name, "%s", pal_instrument_names[instrument[t]]);
    }
}

/* one body with defaults around the prepared mesh in mesh[0], or, where report is NULL, the control cells in cells[0]
 */
static pal_err make_body(pal_loaded_scene *loaded, const char *name, const pal_surface_scene *options,
                         const pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_scene *scene = &loaded->scene;
    pal_body_def *body = &scene->body[0];
    const pal_cells *cells = report ? NULL : &loaded->cells[0];
    char plain[PAL_NAME];
    double low[3], high[3];
    pal_scene_plain_name(name, "organ", plain);
    loaded->n_mesh = 1;
    pal_scene_default(scene);
    scene->step_s = options->fem && !cells ? PAL_FEM_STEP_S : PAL_LIVE_STEP_S;
    snprintf(scene->name, sizeof scene->name, "%s", plain);
    if (cells)
        pal_body_default_cells(body, plain, &loaded->mesh[0], cells);
    else
        pal_body_default(body, plain, &loaded->mesh[0]);
    pal_scene_guess_appearance(plain, body->appearance);
    const char *asked = options->appearance ? options->appearance : cells && !body->appearance[0] ? "plastic" : NULL;
    if (asked) snprintf(body->appearance, sizeof body->appearance, "%.15s", asked);
    if (!options->gravity) leave_gravity_out(body);
    /* as many levels as run in real time; cells that are no hexahedra need one */
    const int n_level = options->n_level                                     ? options->n_level
                        : cells && cells->n_cell <= PAL_WANTED_ELEMENTS / 64 ? 2
                                                                             : 1;
    PAL_TRY(cells ? pal_entry_put_number(&body->model, "levels", n_level, diag)
                  : choose_model(body, options, report, diag));
    /* a body at rest costs nothing until it is touched */
    pal_entry_init(&body->effect[body->n_effect++], "", "sleep");
    for (int k = 0; k < body->n_effect; k++) snprintf(body->effect[k].path, PAL_ENTRY_TEXT, "bodies[0].effects[%d]", k);
    pal_scene_show_images(loaded, 0);
    if (options->material.young_Pa > 0) body->material = options->material;
    scene->n_body = 1;
    if (pal_norm3(options->up) > 0) pal_copy3(scene->up, options->up);
    snprintf(scene->anatomical_axes, sizeof scene->anatomical_axes, "%s", report ? report->axes : options->axes);
    if (options->hold > 0)
        body->support[0].fraction = options->hold;
    else if (cells)
        PAL_TRY(hold_an_eighth(cells, scene->up, &body->support[0].fraction));
    pal_surface_box(&loaded->mesh[0].surface, low, high);
    lay_out_tools(scene, PAL_TOOL_RADIUS_S * pal_dist3(low, high));
    return pal_scene_check(scene, diag);
}

static pal_err check_shown(const char *what, const char *text, size_t n_byte, pal_diagnostic *diag)
{
    if (strlen(text) >= n_byte) return PAL_REFUSE(diag, "%s: %zu bytes, more than %zu", what, strlen(text), n_byte - 1);
    if (!pal_utf8_all_printable(text, strlen(text)))
        return PAL_REFUSE(diag, "%s: has characters that cannot be shown", what);
    return PAL_ERR_OK;
}

pal_err pal_scene_rename(pal_loaded_scene *loaded, const char *name, const char *title, const char *source,
                         pal_diagnostic *diag)
{
    pal_scene *scene = &loaded->scene;
    char plain[PAL_NAME];
    pal_scene_plain_name(name ? name : scene->name, "organ", plain);
    if (name && strcmp(plain, name))
        return PAL_REFUSE(diag, "name: wanted at most %d of the characters a-z 0-9 _ -", PAL_NAME - 1);
    if (title) PAL_TRY(check_shown("title", title, sizeof scene->title, diag));
    if (source) PAL_TRY(check_shown("source", source, sizeof scene->source, diag));
    snprintf(scene->name, sizeof scene->name, "%s", plain);
    if (name && scene->n_body == 1) snprintf(scene->body[0].name, sizeof scene->body[0].name, "%s", name);
    if (title) snprintf(scene->title, sizeof scene->title, "%s", title);
    if (source) snprintf(scene->source, sizeof scene->source, "%s", source);
    return PAL_ERR_OK;
}

pal_err pal_scene_drop_loose(pal_loaded_scene *loaded, int index, bool largest_only, pal_diagnostic *diag)
{
    const pal_body_def *def = &loaded->scene.body[index];
    pal_prepared *mesh = &loaded->mesh[index];
    pal_cells *cells = &loaded->cells[index];
    pal_loose_components *parts = &loaded->loose[index];
    pal_diagnostic reason = {""};
    *parts = (pal_loose_components){0};
    /* anchors of the surface hold every piece of it */
    if (!strcmp(def->model.name, "adaptive_springs")) return PAL_ERR_OK;
    const int n = def->cells ? cells->n_vertex : mesh->tets.n_node;
    uint8_t *fixed = calloc((size_t)n + 1, sizeof *fixed);
    if (!fixed)
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "body \"%s\": no memory to find what is held", def->name);
    pal_body_def_mark_fixed(def, loaded->scene.up, def->cells ? cells->x : mesh->tets.x, n, fixed);
    pal_err err = def->cells ? pal_loose_cells_drop(def->name, fixed, largest_only, cells, parts, &reason)
                             : pal_loose_components_drop(def->name, fixed, largest_only, mesh, parts, &reason);
    free(fixed);
    if (err == PAL_ERR_REFUSED)
        pal_diagnostic_set(diag, err, "%s, or keep only the largest one (--largest, \"largest\": true in a scene)",
                           reason.text);
    else if (err)
        pal_diagnostic_set(diag, err, "%s", reason.text);
    if (!err && def->cells && parts->n_dropped > 0) err = pal_subdivision_update_surface(loaded, index, diag);
    return err;
}

/* title and source from a file's name; or, after an error, nothing is left of the scene */
static pal_err finish(pal_loaded_scene *loaded, const char *path, const char *stem, int label, pal_err err,
                      pal_loaded_scene **out)
{
    pal_scene *scene = &loaded->scene;
    char shown[100];
    const char *slash = strrchr(path, '/');
    if (err) {
        pal_scene_free(loaded);
        return err;
    }
    shown_text(stem, shown, sizeof shown);
    snprintf(scene->title, sizeof scene->title, label >= 0 ? "%s, label %d" : "%s", shown, label);
    shown_text(slash ? slash + 1 : path, scene->source, sizeof scene->source);
    *out = loaded;
    return PAL_ERR_OK;
}

/* drops components without a support, and corrects the report of the mesh */
static pal_err drop_loose(pal_loaded_scene *loaded, const pal_surface_scene *options, pal_surface_scene_report *report,
                          pal_diagnostic *diag)
{
    pal_prepare_report *reported = &report->prepare;
    const pal_prepared *mesh = &loaded->mesh[0];
    pal_diagnostic reason = {""};
    if (reported->voxel.n_component == 1) return PAL_ERR_OK;
    pal_err err = pal_scene_drop_loose(loaded, 0, options->largest_only, &reason);
    if (err == PAL_ERR_REFUSED)
        return pal_diagnostic_set(diag, err, "%s; finer voxels may join them (--resolution, now %d)", reason.text,
                                  report->resolution);
    if (err) return pal_diagnostic_set(diag, err, "%s", reason.text);
    if (loaded->loose[0].n_dropped == 0) return PAL_ERR_OK;
    reported->voxel.n_component -= loaded->loose[0].n_dropped;
    reported->n_voxel = mesh->hexes.n_hex;
    reported->volume_m3 = pal_tets_volume(&mesh->tets);
    return PAL_ERR_OK;
}

/* an empty scene and report; NULL: out of memory */
static pal_loaded_scene *begin(pal_surface_scene_report *report, const char *name, pal_diagnostic *diag)
{
    *report = (pal_surface_scene_report){.unit_name = "", .label = -1};
    pal_loaded_scene *loaded = calloc(1, sizeof *loaded);
    if (!loaded) pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a scene", name);
    return loaded;
}

pal_err pal_scene_from_surface(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                               pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_surface_scene_report own;
    if (!report) report = &own;
    pal_loaded_scene *loaded = begin(report, path, diag);
    if (!loaded) return PAL_ERR_MEMORY;
    char stem[256];
    pal_scene_stem(path, stem, sizeof stem);
    pal_image_map map = {0};
    pal_surface_scene all = *options;
    if (!options->no_image) all.image = &map;
    pal_err err = pal_scene_prepare_file(path, &all, &loaded->mesh[0], report, diag);
    if (!err && map.n_tri) err = pal_scene_take_images(path, &map, loaded, report, diag);
    pal_image_map_free(&map);
    pal_diagnostic reason = {""};
    report_progress(options, "levels", 0);
    if (!err && options->adaptive) err = pal_scene_adaptive_inspect(&loaded->mesh[0].surface, options, report, &reason);
    if (!err) err = make_body(loaded, stem, options, report, &reason);
    if (!err) err = drop_loose(loaded, options, report, &reason);
    if (err && reason.text[0]) pal_diagnostic_set(diag, err, "%s: %s: %s", path, report->surface.place, reason.text);
    return finish(loaded, path, stem, report->label, err, out);
}

pal_err pal_scene_from_cells(const char *path, const pal_surface_scene *options, pal_loaded_scene **out,
                             pal_diagnostic *diag)
{
    pal_surface_scene_report unused;
    char stem[256];
    pal_diagnostic reason = {""};
    pal_loaded_scene *loaded = begin(&unused, path, diag);
    if (!loaded) return PAL_ERR_MEMORY;
    pal_scene_stem(path, stem, sizeof stem);
    pal_err err = pal_subdivision_load(path, options->unit_m > 0 ? options->unit_m : 1, NULL, loaded, 0, diag);
    if (!err) err = make_body(loaded, stem, options, NULL, &reason);
    if (!err) err = pal_scene_drop_loose(loaded, 0, options->largest_only, &reason);
    if (err && reason.text[0]) pal_diagnostic_set(diag, err, "%s: %s", path, reason.text);
    return finish(loaded, path, stem, -1, err, out);
}

/* the shape's own supports and anchors in place of the defaults; what is asked for still wins */
static pal_err apply_shape(pal_scene *scene, const pal_scene_shape *shape, const pal_surface_scene *options,
                           pal_diagnostic *diag)
{
    pal_body_def *body = &scene->body[0];
    snprintf(scene->title, sizeof scene->title, "%s", shape->title);
    if (pal_norm3(options->up) == 0 && pal_norm3(shape->up) > 0) pal_copy3(scene->up, shape->up);
    if (!options->adaptive || options->hold > 0) return PAL_ERR_OK;
    body->n_support = shape->n_support;
    for (int k = 0; k < shape->n_support; k++) body->support[k] = shape->support[k];
    return shape->in_space ? pal_entry_put_text(&body->model, "frame", "world", diag) : PAL_ERR_OK;
}

/* the surface of a procedural scene: our organ, or a shape */
static pal_err make_procedural(const pal_surface_scene *options, pal_scene_shape *out, pal_diagnostic *diag)
{
    if (options->shape && strcmp(options->shape, "organ") != 0) return pal_scene_shape_make(options->shape, out, diag);
    *out = (pal_scene_shape){.name = "organ", .title = "Procedural organ"};
    pal_err err = pal_organ_make(options->target_tri ? options->target_tri : PAL_WANTED_TRI, &out->surface);
    if (err) pal_diagnostic_set(diag, err, "the procedural organ: %s", pal_err_text(err));
    return err;
}

pal_err pal_scene_procedural(const pal_surface_scene *options, pal_loaded_scene **out, pal_surface_scene_report *report,
                             pal_diagnostic *diag)
{
    pal_surface_scene_report own;
    if (!report) report = &own;
    pal_loaded_scene *loaded = begin(report, "procedural organ", diag);
    if (!loaded) return PAL_ERR_MEMORY;
    pal_scene_shape shape = {0};
    double start = pal_clock_s();
    report_progress(options, "organ", 0);
    pal_err err = make_procedural(options, &shape, diag);
    report->read_s = pal_clock_s() - start;
    report->unit_m = 1;
    report->unit_name = "m";
    snprintf(report->axes, sizeof report->axes, "%s", options->axes);
    snprintf(report->surface.format, sizeof report->surface.format, "procedural");
    report->surface.n_vertex_read = shape.surface.n_vertex;
    report->surface.n_tri_read = shape.surface.n_tri;
    char name[PAL_NAME];
    snprintf(name, sizeof name, "procedural %.30s", shape.name);
    if (!err) err = make(name, &shape.surface, options, &loaded->mesh[0], report, diag);
    pal_diagnostic reason = {""};
    if (!err && options->adaptive) err = pal_scene_adaptive_inspect(&loaded->mesh[0].surface, options, report, &reason);
    if (err && reason.text[0]) pal_diagnostic_set(diag, err, "%s: %s", name, reason.text);
    pal_surface_free(&shape.surface);
    if (!err) err = make_body(loaded, shape.name, options, report, diag);
    pal_body_def *body = &loaded->scene.body[0];
    if (!body->appearance[0] && !strcmp(shape.name, "organ"))
        snprintf(body->appearance, sizeof body->appearance, "liver");
    if (!err) err = apply_shape(&loaded->scene, &shape, options, diag);
    if (!err) err = drop_loose(loaded, options, report, diag);
    if (err) {
        pal_scene_free(loaded);
        return err;
    }
    snprintf(loaded->scene.source, sizeof loaded->scene.source, "computed by Palpate, not from a patient%s",
             options->shape ? "" : ": no scan was given");
    *out = loaded;
    return PAL_ERR_OK;
}

/* the voxels inside the surface as control cells */
static pal_err fill_with_cells(const pal_surface *surface, int resolution, pal_loaded_scene *loaded,
                               pal_diagnostic *diag)
{
    const pal_voxel_options options = {.resolution = resolution, .largest_only = true};
    pal_voxels voxels;
    pal_voxel_report report;
    pal_cell_loops loops = {0};
    PAL_TRY(pal_voxels_fill(surface, &options, &voxels, &report, diag));
    const int *n = voxels.n;
    const size_t row = (size_t)n[0] + 1, layer = row * ((size_t)n[1] + 1), n_corner = layer * ((size_t)n[2] + 1);
    int32_t *vertex_at = malloc(n_corner * sizeof *vertex_at);
    if (!vertex_at) loops.err = PAL_ERR_MEMORY;
    if (vertex_at) memset(vertex_at, -1, n_corner * sizeof *vertex_at);
    for (int at = 0; vertex_at && at < n[0] * n[1] * n[2]; at++) {
        int32_t hex[8];
        if (!voxels.kind[at]) continue;
        for (int c = 0; c < 8; c++) {
            const int i[3] = {at % n[0] + (c & 1), at / n[0] % n[1] + (c >> 1 & 1), at / n[0] / n[1] + (c >> 2)};
            int32_t *vertex = &vertex_at[(size_t)i[2] * layer + (size_t)i[1] * row + (size_t)i[0]];
            double x[3];
            for (int a = 0; a < 3; a++) x[a] = voxels.low_m[a] + voxels.edge_m * i[a];
            if (*vertex < 0) *vertex = pal_cell_loops_vertex(&loops, x, 0);
            hex[c] = *vertex;
        }
        pal_cell_loops_hex(&loops, hex);
    }
    free(vertex_at);
    pal_voxels_free(&voxels);
    PAL_TRY(pal_cell_loops_finish(&loops, &loaded->cells[0], diag));
    loaded->scene.body[0].cells = &loaded->cells[0];
    return pal_subdivision_update_surface(loaded, 0, diag);
}

pal_err pal_scene_generated(const char *name, const pal_surface_scene *options, pal_loaded_scene **out,
                            pal_diagnostic *diag)
{
    pal_generated_organ organ;
    pal_surface_scene_report report;
    pal_surface_scene all = *options;
    PAL_TRY(pal_organ_generate(name, &organ, diag));
    pal_loaded_scene *loaded = begin(&report, name, diag);
    pal_err err = loaded ? PAL_ERR_OK : PAL_ERR_MEMORY;
    all.resolution = organ.resolution, all.hold = organ.hold, all.gravity = organ.gravity;
    if (!(all.material.density_kg_m3 > 0)) all.material = (pal_material){0, 0.45, 1000, PAL_DAMPING_DERIVED, 1};
    all.material.young_Pa = organ.young_Pa;
    all.largest_only = true;
    if (!err && all.cells) err = fill_with_cells(&organ.surface, (organ.resolution + 1) / 2, loaded, diag);
    if (!err && !all.cells) err = make(name, &organ.surface, &all, &loaded->mesh[0], &report, diag);
    if (!err && all.adaptive) err = pal_scene_adaptive_inspect(&loaded->mesh[0].surface, &all, &report, diag);
    if (!err) err = make_body(loaded, name, &all, all.cells ? NULL : &report, diag);
    if (!err && !all.cells) err = drop_loose(loaded, &all, &report, diag);
    pal_surface_free(&organ.surface);
    if (!err && organ.hangs) loaded->scene.gravity_m_s2 *= -1;
    return finish(loaded, name, name, -1, err, out);
}
