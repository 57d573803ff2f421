/* JSON -> pal_scene. Each kind of entry has one function that first refuses unknown keys and then reads its own; ranges
 * that belong to the simulation are checked by pal_scene_check at the end. */
#include "server/scene/scene_file.h"

#include "server/base/flags.h"
#include "server/base/heap.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/scene/region_file.h"
#include "server/scene/scene_import.h"
#include "server/scene/scene_keys.h"
#include "server/scene/subdivision_file.h"
#include "server/scene/tuning.h"

#include <math.h>
#include <stdio.h>

enum { FOLDER = 1024 };

/* other: a key that another function reads, may be NULL */
static pal_err read_item(const pal_json *at, const char *other, pal_config_entry *out)
{
    char name[PAL_ENTRY_TEXT] = "";
    pal_diagnostic reason = {""};
    PAL_TRY(pal_json_object(at, NULL));
    PAL_TRY(pal_json_text(at, "name", false, name, sizeof name));
    if (!*name) return pal_json_refuse(at, "has no name");
    pal_entry_init(out, at->path, name);
    PAL_JSON_EACH (child, at) {
        const char *key = child->string;
        double number[PAL_ENTRY_NUMBERS];
        char text[PAL_ENTRY_TEXT];
        pal_err err = PAL_ERR_OK;
        if (!strcmp(key, "name") || (other && !strcmp(key, other))) continue;
        if (cJSON_IsNumber(child)) {
            err = pal_entry_put_number(out, key, child->valuedouble, &reason);
        } else if (cJSON_IsBool(child)) {
            err = pal_entry_put_bool(out, key, cJSON_IsTrue(child), &reason);
        } else if (cJSON_IsString(child)) {
            PAL_TRY(pal_json_text(at, key, true, text, sizeof text));
            err = pal_entry_put_text(out, key, text, &reason);
        } else if (cJSON_IsArray(child)) {
            int n = 0;
            for (const cJSON *entry = child->child; entry; entry = entry->next) {
                if (n == PAL_ENTRY_NUMBERS)
                    return pal_json_refuse_key(at, key, "more than %d numbers", PAL_ENTRY_NUMBERS);
                if (!cJSON_IsNumber(entry)) return pal_json_refuse_key(at, key, "is not a list of numbers");
                number[n++] = entry->valuedouble;
            }
            err = pal_entry_put_numbers(out, key, number, n, &reason);
        } else {
            return pal_json_refuse_key(at, key, "is not a number, text, true, false or list of numbers");
        }
        if (err) return pal_diagnostic_set(at->diag, err, "%s: %s", at->file, reason.text);
    }
    return PAL_ERR_OK;
}

static pal_err read_item_at(const pal_json *body, const char *key, pal_config_entry *out)
{
    const pal_json at = pal_json_at(body, key);
    return at.value ? read_item(&at, NULL, out) : PAL_ERR_OK;
}

static pal_err read_model(const pal_json *body, pal_loaded_scene *scene, int index)
{
    const pal_json at = pal_json_at(body, "model");
    if (!at.value) return PAL_ERR_OK;
    PAL_TRY(read_item(&at, *pal_scene_keys(PAL_KEYS_MODEL, NULL), &scene->scene.body[index].model));
    return pal_spring_grid_read(&at, scene, index);
}

static pal_err read_material(const pal_json *body, pal_material *m)
{
    const pal_json at = pal_json_at(body, "material");
    if (!at.value) return PAL_ERR_OK;
    PAL_TRY(pal_json_object(&at, pal_scene_keys(PAL_KEYS_MATERIAL, NULL)));
    PAL_TRY(pal_json_number(&at, "young_Pa", PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA, &m->young_Pa));
    PAL_TRY(pal_json_number(&at, "poisson", PAL_POISSON_MIN, PAL_POISSON_MAX, &m->poisson));
    PAL_TRY(pal_json_number(&at, "density_kg_m3", PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3, &m->density_kg_m3));
    PAL_TRY(pal_json_number(&at, "damping_ratio", 0, PAL_FACTOR_MAX, &m->damping_ratio));
    return pal_json_number(&at, "damping_1_s", 0, PAL_NUMBER_MAX, &m->damping_1_s);
}

static pal_err read_support(const pal_json *at, pal_support_def *out)
{
    *out = (pal_support_def){.fraction = 0.05};
    PAL_TRY(pal_json_object(at, pal_scene_keys(PAL_KEYS_SUPPORT, NULL)));
    const pal_json box = pal_json_at(at, "box");
    out->lowest = pal_json_has(at, "lowest");
    out->rim = pal_json_has(at, "boundary");
    if (out->lowest + out->rim + (box.value != NULL) != 1)
        return pal_json_refuse(at, "needs either lowest, box or boundary");
    if (out->rim) {
        PAL_TRY(pal_json_bool(at, "boundary", &out->rim));
        return out->rim ? PAL_ERR_OK : pal_json_refuse_key(at, "boundary", "can only be true");
    }
    if (out->lowest) return pal_json_number(at, "lowest", 0, 1, &out->fraction);
    PAL_TRY(pal_json_object(&box, pal_scene_keys(PAL_KEYS_SUPPORT_BOX, NULL)));
    return pal_json_box(&box, "low_m", "high_m", out->low_m, out->high_m);
}

/* axes: of the scene; "" becomes that of a scan that states it */
static pal_err read_mesh(const pal_json *at, const pal_config_entry *model, char axes[PAL_AXES_BYTES],
                         pal_prepared *out)
{
    char units[16] = "", file[FOLDER + FOLDER / 2];
    bool has_mesh = pal_json_has(at, "mesh");
    const char *key = has_mesh ? "mesh" : "surface";
    if (has_mesh == pal_json_has(at, "surface")) return pal_json_refuse(at, "needs either mesh or surface, or cells");
    PAL_TRY(pal_json_file_name(at, key, file, sizeof file));
    pal_diagnostic reason = {""};
    pal_err err;
    if (has_mesh) {
        static const char *const only_surface[] = {"units", "resolution", "label", "triangles", "largest"};
        /* loose components are searched for in every mesh of tetrahedra, but not in a surface */
        const int n = !strcmp(model->name, "adaptive_springs") ? 5 : 4;
        for (int k = 0; k < n; k++)
            if (pal_json_has(at, only_surface[k]))
                return pal_json_refuse_key(at, only_surface[k], "only goes with surface");
        err = pal_prepared_load(file, out, &reason);
    } else {
        pal_surface_scene options = {
            .label = -1, .fem = !strcmp(model->name, "fem"), .adaptive = !strcmp(model->name, "adaptive_springs")};
        if (options.adaptive && pal_json_has(at, "resolution"))
            return pal_json_refuse_key(at, "resolution",
                                       "model adaptive_springs has no voxels: it works on the surface");
        PAL_TRY(pal_json_count(at, "resolution", 0, 1024, &options.resolution));
        PAL_TRY(pal_json_count(at, "label", -1, 1 << 30, &options.label));
        PAL_TRY(pal_json_count(at, "triangles", 0, 10000000, &options.target_tri));
        PAL_TRY(pal_json_bool(at, "largest", &options.largest_only));
        PAL_TRY(pal_json_text(at, "units", false, units, sizeof units));
        options.unit_m = *units ? pal_mesh_unit_named(units) : 0;
        if (*units && options.unit_m == 0) return pal_json_refuse_key(at, "units", "is not m, cm, mm, um or in");
        pal_surface_scene_report report = {0};
        pal_image_map map = {0};
        memcpy(options.axes, axes, PAL_AXES_BYTES);
        const int n_image = cJSON_GetArraySize(pal_json_at(at, "images").value);
        if (n_image > 0) options.image = &map;
        err = pal_scene_prepare_file(file, &options, out, &report, &reason);
        /* one image is that of all materials, several are those of the materials in the order of their first use */
        int image[PAL_MATERIAL_MAX] = {0};
        for (int m = 0; m < map.n_material && n_image > 1; m++) image[m] = m;
        if (!err && map.n_tri) err = pal_image_map_take(&map, image, &out->surface);
        pal_image_map_free(&map);
        if (!err) memcpy(axes, report.axes, PAL_AXES_BYTES);
    }
    return pal_json_forward(at, key, err, &reason);
}

/* out [PAL_IMAGES_MAX] */
static pal_err read_images(const pal_json *at, const pal_surface *surface, pal_image *out)
{
    char file[FOLDER + FOLDER / 2];
    pal_diagnostic reason = {""};
    pal_json list;
    int n = 0, n_used = 0;
    PAL_TRY(pal_json_list(at, "images", PAL_IMAGES_MAX, &list));
    if (!list.value) return PAL_ERR_OK;
    if (!surface->image_at)
        return pal_json_refuse_key(at, "images", "the surface has no image coordinates, as vt of an OBJ file");
    PAL_JSON_ENTRIES (entry, &list) {
        PAL_TRY(pal_json_file_name(&entry, "", file, sizeof file));
        PAL_TRY(pal_json_forward(&entry, "", pal_image_read(file, &out[n++], &reason), &reason));
    }
    for (size_t t = 0; t < (size_t)surface->n_tri; t++)
        if (surface->image_at[9 * t + 2] >= (float)n_used) n_used = 1 + (int)surface->image_at[9 * t + 2];
    if (n_used > n) return pal_json_refuse_key(at, "images", "names %d of the %d images of the surface", n, n_used);
    return pal_json_forward(at, "images", pal_images_check(out, n, &reason), &reason);
}

static pal_err read_lists(const pal_json *at, pal_body_def *body)
{
    pal_json list;
    PAL_TRY(pal_json_list(at, "supports", PAL_SUPPORT_MAX, &list));
    if (list.value) body->n_support = 0;
    PAL_JSON_ENTRIES (entry, &list) PAL_TRY(read_support(&entry, &body->support[body->n_support++]));
    PAL_TRY(pal_json_list(at, "effects", PAL_ENTRIES_MAX, &list));
    if (list.value) body->n_effect = 0;
    PAL_JSON_ENTRIES (entry, &list) PAL_TRY(read_item(&entry, NULL, &body->effect[body->n_effect++]));
    /* default entries get their path in this scene as well */
    for (int k = 0; k < body->n_effect && !list.value; k++)
        snprintf(body->effect[k].path, sizeof body->effect[k].path, "%.40s", pal_json_entry(&list, k, NULL).path);
    return PAL_ERR_OK;
}

static pal_err read_look(const pal_json *at, pal_body_def *body)
{
    const char *digits = body->colour + 1;
    PAL_TRY(pal_json_text(at, "appearance", false, body->appearance, sizeof body->appearance));
    if (body->appearance[0] && pal_flag_word(PAL_APPEARANCES, body->appearance) < 0)
        return pal_json_refuse_key(at, "appearance", "\"%s\" is not one of %s", body->appearance, PAL_APPEARANCES);
    if (!body->appearance[0]) pal_scene_guess_appearance(body->name, body->appearance);
    PAL_TRY(pal_json_text(at, "colour", false, body->colour, sizeof body->colour));
    if (body->colour[0] && (body->colour[0] != '#' || strspn(digits, "0123456789abcdefABCDEF") != 6))
        return pal_json_refuse_key(at, "colour", "\"%s\" is not a colour as #82352b", body->colour);
    return PAL_ERR_OK;
}

static pal_err read_body(const pal_json *at, int index, pal_loaded_scene *scene)
{
    char name[PAL_NAME];
    PAL_TRY(pal_json_object(at, pal_scene_keys(PAL_KEYS_BODY, NULL)));
    snprintf(name, sizeof name, "body %d", index + 1);
    PAL_TRY(pal_json_text(at, "name", false, name, sizeof name));
    pal_body_def *body = &scene->scene.body[index];
    bool solid = pal_json_has(at, "cells"), largest_only = false;
    if (solid)
        pal_body_default_cells(body, name, &scene->mesh[index], NULL);
    else
        pal_body_default(body, name, &scene->mesh[index]);
    if (!solid && pal_json_has(at, "origin_m")) return pal_json_refuse(at, "origin_m only goes with cells");
    PAL_TRY(read_look(at, body));
    PAL_TRY(read_material(at, &body->material));
    PAL_TRY(read_model(at, scene, index));
    PAL_TRY(read_item_at(at, "solver", &body->solver));
    PAL_TRY(read_item_at(at, "output", &body->output));
    PAL_TRY(read_lists(at, body));
    PAL_TRY(pal_strokes_read(at, scene, index));
    PAL_TRY(pal_cut_read(at, body));
    if (solid)
        PAL_TRY(pal_subdivision_read(at, scene, index));
    else
        PAL_TRY(read_mesh(at, &body->model, scene->scene.anatomical_axes, &scene->mesh[index]));
    PAL_TRY(read_images(at, &scene->mesh[index].surface, scene->image[index]));
    pal_scene_show_images(scene, index);
    scene->n_mesh = index + 1;
    PAL_TRY(pal_json_bool(at, "largest", &largest_only));
    pal_diagnostic reason = {""};
    PAL_TRY(pal_json_forward(at, "", pal_scene_drop_loose(scene, index, largest_only, &reason), &reason));
    return pal_region_read(at, scene, index);
}

/* what is drawn for a tool: its instrument and the point that its shaft passes */
static pal_err read_instrument(const pal_json *at, pal_tool_def *tool)
{
    char word[PAL_NAME], known[128];
    int k = 0;
    snprintf(word, sizeof word, "%s", pal_instrument_names[tool->instrument]);
    PAL_TRY(pal_json_text(at, "instrument", false, word, sizeof word));
    while (k < PAL_INSTRUMENT_COUNT && strcmp(word, pal_instrument_names[k])) k++;
    if (k == PAL_INSTRUMENT_COUNT) {
        pal_json_list_words(pal_instrument_names, "", known, sizeof known);
        return pal_json_refuse_key(at, "instrument", "\"%s\" is no instrument; known are %s", word, known);
    }
    tool->instrument = (pal_instrument)k;
    PAL_TRY(pal_json_vector(at, "trocar_m", tool->trocar_m));
    tool->has_trocar = pal_json_has(at, "trocar_m");
    for (int c = 0; c < 3; c++)
        if (fabs(tool->trocar_m[c]) > PAL_TROCAR_MAX_M)
            return pal_json_refuse_key(at, "trocar_m", "%g is outside %g .. %g", tool->trocar_m[c], -PAL_TROCAR_MAX_M,
                                       PAL_TROCAR_MAX_M);
    return PAL_ERR_OK;
}

static pal_err read_tools(const pal_json *root, pal_scene *scene)
{
    pal_json list;
    PAL_TRY(pal_json_list(root, "tools", PAL_TOOL_MAX, &list));
    pal_tools_default(scene, list.value ? cJSON_GetArraySize(list.value) : 3);
    pal_tool_def *tool = scene->tool;
    PAL_JSON_ENTRIES (at, &list) {
        PAL_TRY(pal_json_object(&at, pal_scene_keys(PAL_KEYS_TOOL, NULL)));
        PAL_TRY(pal_json_text(&at, "name", false, tool->name, sizeof tool->name));
        PAL_TRY(pal_json_number(&at, "radius_m", 0, 1, &tool->radius_m));
        PAL_TRY(pal_json_number(&at, "force_cap_N", 1e-3, 1000, &tool->force_cap_N));
        PAL_TRY(read_instrument(&at, tool++));
    }
    return PAL_ERR_OK;
}

/* "x", "1 mm", "within 1 mm" describe no accuracy: a target in the wrong key */
static bool is_target(const char *text)
{
    static const char *const unit[] = {"mm", "cm", "um", "m"};
    const char *last = strrchr(text, ' ');
    size_t n = strlen(text), n_word = 0;
    for (size_t i = 0; i < n; i++) n_word += text[i] != ' ' && (i == 0 || text[i - 1] == ' ');
    if (n_word == 1) return true;
    for (int k = 0; k < 4 && last && n_word <= 3; k++)
        if (!strcmp(last + 1, unit[k])) return true;
    return false;
}

/* what the scene asks of its study: "accuracy" as text or {max_error_mm, text}, "budget" {step_ms} */
static pal_err read_target(const pal_json *root, pal_scene *scene)
{
    const pal_json accuracy = pal_json_at(root, "accuracy"), budget = pal_json_at(root, "budget");
    if (cJSON_IsObject(accuracy.value)) {
        double max_mm = 0;
        PAL_TRY(pal_json_object(&accuracy, pal_scene_keys(PAL_KEYS_ACCURACY, NULL)));
        PAL_TRY(pal_json_text(&accuracy, "text", true, scene->accuracy, sizeof scene->accuracy));
        PAL_TRY(pal_json_number(&accuracy, "max_error_mm", 1e-6, 1e6, &max_mm));
        if (max_mm == 0) return pal_json_refuse(&accuracy, "has no max_error_mm");
        /* divided: 0.1 mm is 1e-4 m and comes back as 0.1 */
        scene->max_error_m = max_mm / 1000;
    } else {
        PAL_TRY(pal_json_text(root, "accuracy", true, scene->accuracy, sizeof scene->accuracy));
        if (is_target(scene->accuracy))
            return pal_json_refuse(&accuracy,
                                   "\"%.40s\" is no sentence on how far off the body is; an accuracy is asked for by "
                                   "{\"max_error_mm\": 1}",
                                   scene->accuracy);
    }
    if (!budget.value) return PAL_ERR_OK;
    PAL_TRY(pal_json_object(&budget, pal_scene_keys(PAL_KEYS_BUDGET, NULL)));
    PAL_TRY(pal_json_number(&budget, "step_ms", 1e-6, 1e6, &scene->budget_ms));
    return scene->budget_ms > 0 ? PAL_ERR_OK : pal_json_refuse(&budget, "has no step_ms");
}

static pal_err read_axes(const pal_json *at, char axes[PAL_AXES_BYTES])
{
    char text[16] = "";
    PAL_TRY(pal_json_text(at, "anatomical_axes", false, text, sizeof text));
    const char *fault = pal_anatomical_axes_fault(text);
    if (fault) return pal_json_refuse_key(at, "anatomical_axes", "%s %s", text, fault);
    snprintf(axes, PAL_AXES_BYTES, "%.3s", text);
    return PAL_ERR_OK;
}

static pal_err read_scene(const pal_json *at, pal_loaded_scene *loaded)
{
    pal_scene *scene = &loaded->scene;
    char plain[PAL_NAME];
    pal_json list;
    pal_scene_default(scene);
    PAL_TRY(pal_json_object(at, pal_scene_keys(PAL_KEYS_SCENE, NULL)));
    PAL_TRY(pal_json_text(at, "name", false, scene->name, sizeof scene->name));
    pal_scene_plain_name(scene->name, "organ", plain);
    if (strcmp(plain, scene->name)) return pal_json_refuse_key(at, "name", "has other characters than a-z 0-9 _ -");
    PAL_TRY(pal_json_text(at, "title", true, scene->title, sizeof scene->title));
    PAL_TRY(pal_json_text(at, "source", true, scene->source, sizeof scene->source));
    PAL_TRY(read_target(at, scene));
    PAL_TRY(pal_json_number(at, "step_s", 1e-4, 0.1, &scene->step_s));
    PAL_TRY(pal_json_number(at, "gravity_m_s2", -1e4, 1e4, &scene->gravity_m_s2));
    PAL_TRY(pal_json_bool(at, "keep_real_time", &scene->keep_real_time));
    PAL_TRY(pal_json_count(at, "max_substep", 1, 1000000, &scene->max_substep));
    PAL_TRY(pal_json_count(at, "threads", 1, PAL_THREADS_MAX, &scene->threads));
    PAL_TRY(pal_json_vector(at, "up", scene->up));
    PAL_TRY(read_axes(at, scene->anatomical_axes));
    PAL_TRY(read_tools(at, scene));
    PAL_TRY(pal_json_list(at, "bodies", PAL_BODY_MAX, &list));
    if (!list.value || !list.value->child) return pal_json_refuse(&list, "a scene needs at least one body");
    PAL_JSON_ENTRIES (body, &list) PAL_TRY(read_body(&body, scene->n_body++, loaded));
    pal_diagnostic reason = {""};
    pal_err err = pal_scene_check(scene, &reason);
    return err ? pal_diagnostic_set(at->diag, err, "%s: %s", at->file, reason.text) : PAL_ERR_OK;
}

pal_err pal_scene_parse(const char *name, const char *text, size_t n_byte, const char *folder, pal_loaded_scene **out,
                        pal_diagnostic *diag)
{
    pal_json json = {.file = name, .diag = diag, .folder = folder};
    cJSON *root;
    PAL_TRY(pal_json_parse(&json, text, n_byte, &root));
    pal_loaded_scene *loaded = calloc(1, sizeof *loaded);
    pal_err err = loaded ? read_scene(&json, loaded) : PAL_ERR_MEMORY;
    cJSON_Delete(root);
    if (!loaded) return pal_diagnostic_set(diag, err, "%s: no memory for a scene", name);
    if (err) {
        pal_scene_free(loaded);
        return err;
    }
    *out = loaded;
    return PAL_ERR_OK;
}

pal_err pal_scene_load(const char *path, pal_loaded_scene **out, pal_diagnostic *diag)
{
    char folder[FOLDER];
    char *text;
    size_t n_byte;
    PAL_TRY(pal_json_read(path, folder, sizeof folder, &text, &n_byte, diag));
    pal_err err = pal_scene_parse(path, text, n_byte, folder, out, diag);
    free(text);
    return err;
}

void pal_scene_show_images(pal_loaded_scene *loaded, int index)
{
    pal_body_def *body = &loaded->scene.body[index];
    body->image = loaded->image[index];
    while (body->n_image < PAL_IMAGES_MAX && body->image[body->n_image].bytes) body->n_image++;
}

void pal_scene_free(pal_loaded_scene *loaded)
{
    if (!loaded) return;
    for (int k = 0; k < PAL_BODY_MAX; k++) {
        for (int r = 0; r < PAL_REGION_MAX; r++) PAL_FREE(loaded->region[k][r].label, loaded->region[k][r].grid);
        PAL_FREE(loaded->spring_grid[k], loaded->stroke[k]);
        pal_cells_free(&loaded->cells[k]);
        for (int i = 0; i < PAL_IMAGES_MAX; i++) pal_image_free(&loaded->image[k][i]);
        pal_prepared_free(&loaded->mesh[k]);
    }
    free(loaded);
}
