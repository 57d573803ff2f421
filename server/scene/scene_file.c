/* JSON -> pal_scene. Each kind of entry has one function that first refuses unknown keys and then reads its own; ranges
 * that belong to the simulation are checked by pal_scene_check at the end. */
#include "server/scene/scene_file.h"

#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/scene/region_file.h"
#include "server/scene/scene_import.h"
#include "server/scene/scene_keys.h"
#include "server/scene/subdivision_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FOLDER = 1024 };

/* other: a key that somebody else reads, may be NULL */
static pal_err read_item(const pal_json *json, const cJSON *object, const char *path, const char *other,
                         pal_config_entry *out)
{
    char at[PAL_JSON_PATH], name[PAL_ENTRY_TEXT] = "";
    pal_diagnostic reason = {""};
    PAL_TRY(pal_json_object(json, object, path, NULL));
    PAL_TRY(pal_json_text(json, object, path, "name", false, name, sizeof name));
    if (!*name) return pal_json_refuse(json, path, "has no name");
    pal_entry_init(out, path, name);
    for (const cJSON *child = object->child; child; child = child->next) {
        double number[PAL_ENTRY_NUMBERS];
        char text[PAL_ENTRY_TEXT];
        pal_err err = PAL_ERR_OK;
        if (!strcmp(child->string, "name") || (other && !strcmp(child->string, other))) continue;
        pal_json_key(at, path, child->string);
        if (cJSON_IsNumber(child)) {
            err = pal_entry_put_number(out, child->string, child->valuedouble, &reason);
        } else if (cJSON_IsBool(child)) {
            err = pal_entry_put_bool(out, child->string, cJSON_IsTrue(child), &reason);
        } else if (cJSON_IsString(child)) {
            PAL_TRY(pal_json_text(json, object, path, child->string, true, text, sizeof text));
            err = pal_entry_put_text(out, child->string, text, &reason);
        } else if (cJSON_IsArray(child)) {
            int n = 0;
            for (const cJSON *entry = child->child; entry; entry = entry->next) {
                if (n == PAL_ENTRY_NUMBERS) return pal_json_refuse(json, at, "more than %d numbers", PAL_ENTRY_NUMBERS);
                if (!cJSON_IsNumber(entry)) return pal_json_refuse(json, at, "is not a list of numbers");
                number[n++] = entry->valuedouble;
            }
            err = pal_entry_put_numbers(out, child->string, number, n, &reason);
        } else {
            return pal_json_refuse(json, at, "is not a number, text, true, false or list of numbers");
        }
        if (err) return pal_diagnostic_set(json->diag, err, "%s: %s", json->file, reason.text);
    }
    return PAL_ERR_OK;
}

static pal_err read_item_at(const pal_json *json, const cJSON *object, const char *path, const char *key,
                            pal_config_entry *out)
{
    char at[PAL_JSON_PATH];
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    return item ? read_item(json, item, pal_json_key(at, path, key), NULL, out) : PAL_ERR_OK;
}

static pal_err read_model(const pal_json *json, const cJSON *body, const char *path, pal_loaded_scene *scene, int index)
{
    char at[PAL_JSON_PATH];
    const cJSON *model = cJSON_GetObjectItemCaseSensitive(body, "model");
    if (!model) return PAL_ERR_OK;
    pal_json_key(at, path, "model");
    PAL_TRY(read_item(json, model, at, *pal_scene_keys(PAL_KEYS_MODEL, NULL), &scene->scene.body[index].model));
    return pal_spring_grid_read(json, model, at, scene, index);
}

static pal_err read_material(const pal_json *json, const cJSON *body, const char *path, pal_material *m)
{
    char at[PAL_JSON_PATH];
    const cJSON *object = cJSON_GetObjectItemCaseSensitive(body, "material");
    if (!object) return PAL_ERR_OK;
    pal_json_key(at, path, "material");
    PAL_TRY(pal_json_object(json, object, at, pal_scene_keys(PAL_KEYS_MATERIAL, NULL)));
    PAL_TRY(pal_json_number(json, object, at, "young_Pa", PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA, &m->young_Pa));
    PAL_TRY(pal_json_number(json, object, at, "poisson", PAL_POISSON_MIN, PAL_POISSON_MAX, &m->poisson));
    PAL_TRY(pal_json_number(json, object, at, "density_kg_m3", PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3,
                            &m->density_kg_m3));
    return pal_json_number(json, object, at, "damping_1_s", 0, PAL_DAMPING_MAX_1_S, &m->damping_1_s);
}

static pal_err read_support(const pal_json *json, const cJSON *object, const char *path, pal_support_def *out)
{
    char at[PAL_JSON_PATH];
    *out = (pal_support_def){.fraction = 0.05};
    PAL_TRY(pal_json_object(json, object, path, pal_scene_keys(PAL_KEYS_SUPPORT, NULL)));
    const cJSON *box = cJSON_GetObjectItemCaseSensitive(object, "box");
    out->lowest = cJSON_GetObjectItemCaseSensitive(object, "lowest") != NULL;
    out->rim = cJSON_GetObjectItemCaseSensitive(object, "boundary") != NULL;
    if (out->lowest + out->rim + (box != NULL) != 1)
        return pal_json_refuse(json, path, "needs either lowest, box or boundary");
    if (out->rim) {
        PAL_TRY(pal_json_bool(json, object, path, "boundary", &out->rim));
        return out->rim ? PAL_ERR_OK : pal_json_refuse(json, pal_json_key(at, path, "boundary"), "can only be true");
    }
    if (out->lowest) return pal_json_number(json, object, path, "lowest", 0, 1, &out->fraction);
    pal_json_key(at, path, "box");
    PAL_TRY(pal_json_object(json, box, at, pal_scene_keys(PAL_KEYS_SUPPORT_BOX, NULL)));
    if (!cJSON_GetObjectItemCaseSensitive(box, "low_m") || !cJSON_GetObjectItemCaseSensitive(box, "high_m"))
        return pal_json_refuse(json, at, "needs low_m and high_m");
    PAL_TRY(pal_json_vector(json, box, at, "low_m", out->low_m));
    PAL_TRY(pal_json_vector(json, box, at, "high_m", out->high_m));
    for (int k = 0; k < 3; k++)
        if (out->low_m[k] > out->high_m[k])
            return pal_json_refuse(json, at, "low_m[%d] %g is above high_m[%d] %g", k, out->low_m[k], k,
                                   out->high_m[k]);
    return PAL_ERR_OK;
}

/* a file name of the scene: beside the scene file unless it is absolute */
static pal_err place_of(const pal_json *json, const char *path, const char *folder, const char *name, char *out,
                        size_t n_byte)
{
    int n = name[0] == '/' ? snprintf(out, n_byte, "%s", name) : snprintf(out, n_byte, "%s/%s", folder, name);
    return n < 0 || (size_t)n >= n_byte ? pal_json_refuse(json, path, "the path is too long") : PAL_ERR_OK;
}

static pal_err read_mesh(const pal_json *json, const cJSON *body, const char *path, const char *folder,
                         const pal_config_entry *model, pal_prepared *out)
{
    char name[FOLDER / 2] = "", units[16] = "", at[PAL_JSON_PATH], file[FOLDER + FOLDER / 2];
    bool has_mesh = cJSON_GetObjectItemCaseSensitive(body, "mesh") != NULL;
    bool has_surface = cJSON_GetObjectItemCaseSensitive(body, "surface") != NULL;
    const char *key = has_mesh ? "mesh" : "surface";
    if (has_mesh == has_surface) return pal_json_refuse(json, path, "needs either mesh or surface, or cells");
    PAL_TRY(pal_json_text(json, body, path, key, false, name, sizeof name));
    pal_json_key(at, path, key);
    PAL_TRY(place_of(json, at, folder, name, file, sizeof file));
    pal_diagnostic reason = {""};
    pal_err err;
    if (has_mesh) {
        static const char *const only_surface[] = {"units", "resolution", "label", "triangles", "largest"};
        /* components of a mesh of tetrahedra are looked for whatever it was made from, pieces of a surface are not */
        const int n = !strcmp(model->name, "adaptive_springs") ? 5 : 4;
        for (int k = 0; k < n; k++)
            if (cJSON_GetObjectItemCaseSensitive(body, only_surface[k]))
                return pal_json_refuse(json, pal_json_key(at, path, only_surface[k]), "only goes with surface");
        err = pal_prepared_load(file, out, &reason);
    } else {
        pal_surface_scene options = {
            .label = -1, .fem = !strcmp(model->name, "fem"), .adaptive = !strcmp(model->name, "adaptive_springs")};
        if (options.adaptive && cJSON_GetObjectItemCaseSensitive(body, "resolution"))
            return pal_json_refuse(json, pal_json_key(at, path, "resolution"),
                                   "model adaptive_springs has no voxels: it works on the surface");
        PAL_TRY(pal_json_count(json, body, path, "resolution", 0, 1024, &options.resolution));
        PAL_TRY(pal_json_count(json, body, path, "label", -1, 1 << 30, &options.label));
        PAL_TRY(pal_json_count(json, body, path, "triangles", 0, 10000000, &options.target_tri));
        PAL_TRY(pal_json_bool(json, body, path, "largest", &options.largest_only));
        PAL_TRY(pal_json_text(json, body, path, "units", false, units, sizeof units));
        options.unit_m = *units ? pal_mesh_unit_named(units) : 0;
        if (*units && options.unit_m == 0)
            return pal_json_refuse(json, pal_json_key(at, path, "units"), "is not m, cm, mm, um or in");
        err = pal_scene_prepare_file(file, &options, out, NULL, &reason);
    }
    return err ? pal_diagnostic_set(json->diag, err, "%s: %s: %s", json->file, at, reason.text) : PAL_ERR_OK;
}

static pal_err read_lists(const pal_json *json, const cJSON *object, const char *path, pal_body_def *body)
{
    char at[PAL_JSON_PATH], entry[PAL_JSON_PATH];
    const cJSON *list;
    PAL_TRY(pal_json_list(json, object, path, "supports", PAL_SUPPORT_MAX, &list));
    if (list) body->n_support = 0;
    for (const cJSON *child = list ? list->child : NULL; child; child = child->next, body->n_support++)
        PAL_TRY(read_support(json, child, pal_json_entry(entry, pal_json_key(at, path, "supports"), body->n_support),
                             &body->support[body->n_support]));
    PAL_TRY(pal_json_list(json, object, path, "effects", PAL_ENTRIES_MAX, &list));
    if (list) body->n_effect = 0;
    pal_json_key(at, path, "effects");
    for (const cJSON *child = list ? list->child : NULL; child; child = child->next, body->n_effect++)
        PAL_TRY(read_item(json, child, pal_json_entry(entry, at, body->n_effect), NULL, &body->effect[body->n_effect]));
    /* default entries get their place in this scene as well */
    for (int k = 0; k < body->n_effect && !list; k++)
        snprintf(body->effect[k].path, sizeof body->effect[k].path, "%.40s", pal_json_entry(entry, at, k));
    return PAL_ERR_OK;
}

static pal_err read_body(const pal_json *json, const cJSON *object, int index, const char *folder,
                         pal_loaded_scene *scene)
{
    char path[PAL_JSON_PATH], name[PAL_NAME];
    pal_json_entry(path, "bodies", index);
    PAL_TRY(pal_json_object(json, object, path, pal_scene_keys(PAL_KEYS_BODY, NULL)));
    snprintf(name, sizeof name, "body %d", index + 1);
    PAL_TRY(pal_json_text(json, object, path, "name", false, name, sizeof name));
    pal_body_def *body = &scene->scene.body[index];
    bool solid = cJSON_GetObjectItemCaseSensitive(object, "cells") != NULL, largest_only = false;
    if (solid)
        pal_body_default_cells(body, name, &scene->mesh[index], NULL);
    else
        pal_body_default(body, name, &scene->mesh[index]);
    if (!solid && cJSON_GetObjectItemCaseSensitive(object, "origin_m"))
        return pal_json_refuse(json, path, "origin_m only goes with cells");
    PAL_TRY(read_material(json, object, path, &body->material));
    PAL_TRY(read_model(json, object, path, scene, index));
    PAL_TRY(read_item_at(json, object, path, "solver", &body->solver));
    PAL_TRY(read_item_at(json, object, path, "output", &body->output));
    PAL_TRY(read_lists(json, object, path, body));
    PAL_TRY(pal_strokes_read(json, object, path, scene, index));
    PAL_TRY(pal_cut_read(json, object, path, body));
    if (solid)
        PAL_TRY(pal_subdivision_read(json, object, path, folder, scene, index));
    else
        PAL_TRY(read_mesh(json, object, path, folder, &body->model, &scene->mesh[index]));
    scene->n_mesh = index + 1;
    PAL_TRY(pal_json_bool(json, object, path, "largest", &largest_only));
    pal_diagnostic reason = {""};
    pal_err err = pal_scene_drop_loose(scene, index, largest_only, &reason);
    if (err) return pal_diagnostic_set(json->diag, err, "%s: %s: %s", json->file, path, reason.text);
    return pal_region_read(json, object, path, folder, scene, index);
}

static pal_err read_tools(const pal_json *json, const cJSON *root, pal_scene *scene)
{
    char path[PAL_JSON_PATH];
    const cJSON *list;
    PAL_TRY(pal_json_list(json, root, "", "tools", PAL_TOOL_MAX, &list));
    if (!list) {
        pal_tools_default(scene, 3);
        return PAL_ERR_OK;
    }
    pal_tools_default(scene, cJSON_GetArraySize(list));
    int t = 0;
    for (const cJSON *child = list->child; child; child = child->next, t++) {
        pal_tool_def *tool = &scene->tool[t];
        pal_json_entry(path, "tools", t);
        PAL_TRY(pal_json_object(json, child, path, pal_scene_keys(PAL_KEYS_TOOL, NULL)));
        PAL_TRY(pal_json_text(json, child, path, "name", false, tool->name, sizeof tool->name));
        PAL_TRY(pal_json_number(json, child, path, "radius_m", 0, 1, &tool->radius_m));
        PAL_TRY(pal_json_number(json, child, path, "force_cap_N", 1e-3, 1000, &tool->force_cap_N));
    }
    return PAL_ERR_OK;
}

/* "x", "1 mm", "within 1 mm" tell people nothing: a target in the wrong place */
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
static pal_err read_target(const pal_json *json, const cJSON *root, pal_scene *scene)
{
    const cJSON *accuracy = cJSON_GetObjectItemCaseSensitive(root, "accuracy");
    const cJSON *budget = cJSON_GetObjectItemCaseSensitive(root, "budget");
    if (cJSON_IsObject(accuracy)) {
        double max_mm = 0;
        PAL_TRY(pal_json_object(json, accuracy, "accuracy", pal_scene_keys(PAL_KEYS_ACCURACY, NULL)));
        PAL_TRY(pal_json_text(json, accuracy, "accuracy", "text", true, scene->accuracy, sizeof scene->accuracy));
        PAL_TRY(pal_json_number(json, accuracy, "accuracy", "max_error_mm", 1e-6, 1e6, &max_mm));
        if (max_mm == 0) return pal_json_refuse(json, "accuracy", "has no max_error_mm");
        /* divided: 0.1 mm is 1e-4 m and comes back as 0.1 */
        scene->max_error_m = max_mm / 1000;
    } else {
        PAL_TRY(pal_json_text(json, root, "", "accuracy", true, scene->accuracy, sizeof scene->accuracy));
        if (is_target(scene->accuracy))
            return pal_json_refuse(json, "accuracy",
                                   "\"%.40s\" is no sentence on how far off the body is; an accuracy is asked for by "
                                   "{\"max_error_mm\": 1}",
                                   scene->accuracy);
    }
    if (!budget) return PAL_ERR_OK;
    PAL_TRY(pal_json_object(json, budget, "budget", pal_scene_keys(PAL_KEYS_BUDGET, NULL)));
    PAL_TRY(pal_json_number(json, budget, "budget", "step_ms", 1e-6, 1e6, &scene->budget_ms));
    return scene->budget_ms > 0 ? PAL_ERR_OK : pal_json_refuse(json, "budget", "has no step_ms");
}

static pal_err read_scene(const pal_json *json, const cJSON *root, const char *folder, pal_loaded_scene *loaded)
{
    pal_scene *scene = &loaded->scene;
    char plain[PAL_NAME];
    const cJSON *list;
    pal_scene_default(scene);
    PAL_TRY(pal_json_object(json, root, "", pal_scene_keys(PAL_KEYS_SCENE, NULL)));
    PAL_TRY(pal_json_text(json, root, "", "name", false, scene->name, sizeof scene->name));
    pal_scene_plain_name(scene->name, plain);
    if (strcmp(plain, scene->name)) return pal_json_refuse(json, "name", "has other characters than a-z 0-9 _ -");
    PAL_TRY(pal_json_text(json, root, "", "title", true, scene->title, sizeof scene->title));
    PAL_TRY(pal_json_text(json, root, "", "source", true, scene->source, sizeof scene->source));
    PAL_TRY(read_target(json, root, scene));
    PAL_TRY(pal_json_number(json, root, "", "step_s", 1e-4, 0.1, &scene->step_s));
    PAL_TRY(pal_json_number(json, root, "", "gravity_m_s2", -1e4, 1e4, &scene->gravity_m_s2));
    PAL_TRY(pal_json_count(json, root, "", "max_substep", 1, 1000000, &scene->max_substep));
    PAL_TRY(pal_json_vector(json, root, "", "up", scene->up));
    PAL_TRY(read_tools(json, root, scene));
    PAL_TRY(pal_json_list(json, root, "", "bodies", PAL_BODY_MAX, &list));
    if (!list || !list->child) return pal_json_refuse(json, "bodies", "a scene needs at least one body");
    for (const cJSON *child = list->child; child; child = child->next, scene->n_body++)
        PAL_TRY(read_body(json, child, scene->n_body, folder, loaded));
    pal_diagnostic reason = {""};
    pal_err err = pal_scene_check(scene, &reason);
    return err ? pal_diagnostic_set(json->diag, err, "%s: %s", json->file, reason.text) : PAL_ERR_OK;
}

pal_err pal_scene_parse(const char *name, const char *text, size_t n_byte, const char *folder, pal_loaded_scene **out,
                        pal_diagnostic *diag)
{
    pal_json json = {name, diag};
    cJSON *root;
    PAL_TRY(pal_json_parse(&json, text, n_byte, &root));
    pal_loaded_scene *loaded = calloc(1, sizeof *loaded);
    pal_err err = loaded ? read_scene(&json, root, folder, loaded) : PAL_ERR_MEMORY;
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

void pal_scene_free(pal_loaded_scene *loaded)
{
    if (!loaded) return;
    for (int k = 0; k < PAL_BODY_MAX; k++) {
        pal_region_free(loaded, k);
        pal_spring_grid_free(loaded, k);
        pal_subdivision_unload(loaded, k);
        pal_prepared_free(&loaded->mesh[k]);
    }
    free(loaded);
}
