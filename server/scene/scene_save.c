/* pal_scene -> DIR/scene.json and DIR/NAME.palmesh or DIR/NAME.palcells. The meshes go first and scene.json last, so
 * that a folder with a scene.json is whole; what was written is removed again when something fails. */
#include "server/scene/scene_file.h"

#include "server/mesh/cells/cell_file.h"
#include "server/mesh/files/file_bytes.h"
#include "server/scene/region_file.h"
#include "server/scene/scene_import.h"
#include "server/scene/subdivision_file.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH = 1200, MESH_NAME = PAL_NAME + 24 };

/* "liver"; a number keeps two bodies of like names apart */
static void stem_of(const pal_scene *scene, int body, char out[MESH_NAME])
{
    char plain[PAL_NAME], other[PAL_NAME];
    bool twice = false;
    pal_scene_plain_name(scene->body[body].name, "organ", plain);
    for (int k = 0; k < scene->n_body; k++) {
        pal_scene_plain_name(scene->body[k].name, "organ", other);
        twice = twice || (k != body && !strcmp(plain, other));
    }
    snprintf(out, MESH_NAME, twice ? "%s_%d" : "%s", plain, body);
}

static void mesh_name(const pal_scene *scene, int body, char out[MESH_NAME])
{
    stem_of(scene, body, out);
    size_t n = strlen(out);
    snprintf(out + n, MESH_NAME - n, scene->body[body].cells ? ".palcells" : ".palmesh");
}

/* another surface than that of the file, as control cells have, has no place for images */
static int count_images(const pal_body_def *body)
{
    return body->cells || !body->mesh->surface.image_at ? 0 : body->n_image;
}

/* "liver.png", "liver_image2.png" */
static void image_name(const pal_scene *scene, int body, int image, char out[MESH_NAME])
{
    stem_of(scene, body, out);
    size_t n = strlen(out);
    const char *ending = scene->body[body].image[image].ending;
    if (image)
        snprintf(out + n, MESH_NAME - n, "_image%d%s", image + 1, ending);
    else
        snprintf(out + n, MESH_NAME - n, "%s", ending);
}

static cJSON *entry_json(const pal_config_entry *item)
{
    cJSON *object = PAL_JSON({"name", JSON_TEXT(item->name)});
    for (int k = 0; k < item->n_value; k++) {
        const pal_config_value *v = &item->value[k];
        cJSON *value = v->kind == PAL_VALUE_NUMBER ? pal_json_exact(v->number[0])
                       : v->kind == PAL_VALUE_BOOL ? JSON_BOOL(v->flag)
                       : v->kind == PAL_VALUE_TEXT ? JSON_TEXT(v->text)
                                                   : pal_json_exact_list(v->number, v->n_number);
        cJSON_AddItemToObject(object, v->key, value);
    }
    return object;
}

static cJSON *support_json(const pal_support_def *s)
{
    if (s->rim) return PAL_JSON({"boundary", JSON_BOOL(true)});
    if (s->lowest) return PAL_JSON({"lowest", pal_json_exact(s->fraction)});
    return PAL_JSON(
        {"box", PAL_JSON({"low_m", pal_json_exact_list(s->low_m, 3)}, {"high_m", pal_json_exact_list(s->high_m, 3)})});
}

static cJSON *body_json(const pal_scene *scene, int index)
{
    const pal_body_def *body = &scene->body[index];
    const pal_material *m = &body->material;
    const bool derived = m->damping_1_s == PAL_DAMPING_DERIVED;
    char name[MESH_NAME];
    cJSON *supports = cJSON_CreateArray(), *effects = cJSON_CreateArray(), *model = entry_json(&body->model);
    for (int k = 0; k < body->n_support; k++) cJSON_AddItemToArray(supports, support_json(&body->support[k]));
    for (int k = 0; k < body->n_effect; k++) cJSON_AddItemToArray(effects, entry_json(&body->effect[k]));
    pal_spring_grid_append(model, &body->spring_grid);
    mesh_name(scene, index, name);
    cJSON *object = PAL_JSON({"name", JSON_TEXT(body->name)}, {"mesh", body->cells ? NULL : JSON_TEXT(name)});
    cJSON *images = count_images(body) ? cJSON_AddArrayToObject(object, "images") : NULL;
    for (int k = 0; k < count_images(body); k++) {
        image_name(scene, index, k, name);
        cJSON_AddItemToArray(images, JSON_TEXT(name));
    }
    mesh_name(scene, index, name);
    if (body->appearance[0]) PAL_JSON_ADD(object, {"appearance", JSON_TEXT(body->appearance)});
    if (body->colour[0]) PAL_JSON_ADD(object, {"colour", JSON_TEXT(body->colour)});
    if (body->cells) pal_subdivision_append(object, body, name);
    PAL_JSON_ADD(object, {"material",
                          PAL_JSON({"young_Pa", pal_json_exact(m->young_Pa)}, {"poisson", pal_json_exact(m->poisson)},
                                   {"density_kg_m3", pal_json_exact(m->density_kg_m3)},
                                   {"damping_1_s", derived ? NULL : pal_json_exact(m->damping_1_s)},
                                   {"damping_ratio", derived ? pal_json_exact(m->damping_ratio) : NULL})});
    stem_of(scene, index, name);
    pal_region_append(object, body, name);
    return PAL_JSON_ADD(object, {"model", model}, {"solver", body->solver.name[0] ? entry_json(&body->solver) : NULL},
                        {"output", entry_json(&body->output)}, {"supports", supports}, {"effects", effects});
}

/* millimetres that are read as exactly these metres, when they came from millimetres */
static double in_mm(double metres)
{
    double mm = 1000 * metres;
    for (int k = 0; k < 2 && mm / 1000 != metres; k++) mm = nextafter(mm, mm / 1000 < metres ? INFINITY : 0);
    return mm;
}

/* a number that acts on nothing would mislead who reads the file */
static bool gravity_acts(const pal_scene *scene)
{
    for (int b = 0; b < scene->n_body; b++)
        for (int e = 0; e < scene->body[b].n_effect; e++)
            if (!strcmp(scene->body[b].effect[e].name, "gravity")) return true;
    return false;
}

static cJSON *instrument_json(const pal_tool_def *tool)
{
    return tool->instrument ? JSON_TEXT(pal_instrument_names[tool->instrument]) : NULL;
}

/* the scene as text, or NULL; the caller frees it */
static char *scene_text(const pal_scene *scene)
{
    cJSON *accuracy = scene->accuracy[0] ? JSON_TEXT(scene->accuracy) : NULL, *budget = NULL;
    cJSON *bodies = cJSON_CreateArray(), *tools = cJSON_CreateArray();
    if (scene->max_error_m > 0)
        accuracy = PAL_JSON({"max_error_mm", pal_json_exact(in_mm(scene->max_error_m))}, {"text", accuracy});
    if (scene->budget_ms > 0) budget = PAL_JSON({"step_ms", pal_json_exact(scene->budget_ms)});
    for (int k = 0; k < scene->n_body; k++) cJSON_AddItemToArray(bodies, body_json(scene, k));
    for (int k = 0; k < scene->n_tool; k++) {
        const pal_tool_def *tool = &scene->tool[k];
        cJSON_AddItemToArray(
            tools, PAL_JSON({"name", JSON_TEXT(tool->name)}, {"radius_m", pal_json_exact(tool->radius_m)},
                            {"force_cap_N", pal_json_exact(tool->force_cap_N)}, {"instrument", instrument_json(tool)},
                            {"trocar_m", tool->has_trocar ? pal_json_exact_list(tool->trocar_m, 3) : NULL}));
    }
    cJSON *root = PAL_JSON({"name", JSON_TEXT(scene->name)}, {"title", JSON_TEXT(scene->title)},
                           {"source", JSON_TEXT(scene->source)}, {"accuracy", accuracy}, {"budget", budget},
                           {"step_s", pal_json_exact(scene->step_s)}, {"up", pal_json_exact_list(scene->up, 3)},
                           {"anatomical_axes", scene->anatomical_axes[0] ? JSON_TEXT(scene->anatomical_axes) : NULL},
                           {"gravity_m_s2", gravity_acts(scene) ? pal_json_exact(scene->gravity_m_s2) : NULL},
                           {"max_substep", pal_json_exact(scene->max_substep)},
                           {"threads", scene->threads > 0 ? pal_json_exact(scene->threads) : NULL}, {"bodies", bodies},
                           {"tools", tools});
    if (scene->keep_real_time) cJSON_AddTrueToObject(root, "keep_real_time");
    char *text = cJSON_Print(root);
    cJSON_Delete(root);
    return text;
}

pal_err pal_scene_make_folder(const char *folder, pal_diagnostic *diag)
{
    char path[PATH];
    int n = snprintf(path, sizeof path, "%s", folder);
    if (n < 1 || (size_t)n >= sizeof path) return PAL_REFUSE(diag, "%.80s: not a folder's name", folder);
    for (char *at = path + 1;; at++) {
        char end = *at;
        if (end != '/' && end != 0) continue;
        *at = 0;
        if (mkdir(path, 0777) && errno != EEXIST)
            return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
        if (end == 0) break;
        *at = end;
    }
    struct stat facts;
    if (stat(path, &facts) || !S_ISDIR(facts.st_mode))
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: is there and not a folder", path);
    return PAL_ERR_OK;
}

enum { IMAGE = -2, MESH = -1 }; /* files of a body: image k is IMAGE - k, and its regions count from 0 */

static bool has_file(const pal_body_def *body, int file)
{
    return file <= MESH || body->region[file].kind == PAL_REGION_LABEL;
}

static pal_err write_file(const pal_body_def *body, int file, const char *path, pal_diagnostic *diag)
{
    if (file <= IMAGE)
        return pal_file_write(path, body->image[IMAGE - file].bytes, body->image[IMAGE - file].n_byte, diag);
    if (file >= 0) return pal_region_write(body, file, path, diag);
    return body->cells ? pal_cell_file_save(body->cells, path, diag) : pal_prepared_save(body->mesh, path, diag);
}

/* images, meshes and label volumes of all bodies, of which the first n_file are written, or removed again; *n_done: how
 * many were before an error */
static pal_err each_file(const pal_scene *scene, const char *folder, bool written, int n_file, int *n_done,
                         pal_diagnostic *diag)
{
    char name[MESH_NAME], volume[MESH_NAME + 32], path[PATH];
    *n_done = 0;
    for (int b = 0; b < scene->n_body; b++) {
        const pal_body_def *body = &scene->body[b];
        for (int k = MESH - count_images(body); k < body->n_region; k++) {
            if (!has_file(body, k)) continue;
            if (*n_done == n_file) return PAL_ERR_OK;
            stem_of(scene, b, name);
            pal_region_volume(name, k, volume, sizeof volume);
            if (k <= IMAGE) image_name(scene, b, IMAGE - k, name);
            if (k == MESH) mesh_name(scene, b, name);
            snprintf(path, sizeof path, "%s/%s", folder, k < 0 ? name : volume);
            if (written)
                PAL_TRY(write_file(body, k, path, diag));
            else
                unlink(path);
            ++*n_done;
        }
    }
    return PAL_ERR_OK;
}

static pal_err check_grids(const pal_scene *scene, pal_diagnostic *diag)
{
    for (int b = 0; b < scene->n_body; b++) {
        const int *n = scene->body[b].spring_grid.n;
        double count = (double)n[0] * n[1] * n[2];
        if (count > PAL_GRID_NODES_MAX)
            return PAL_REFUSE(diag, "body \"%s\" model.grid.n: %g nodes, more than %d", scene->body[b].name, count,
                              PAL_GRID_NODES_MAX);
    }
    return PAL_ERR_OK;
}

/* meshes into the folder, then the scene's text to path, which lies in it */
static pal_err save_to(const pal_scene *scene, const char *folder, const char *path, pal_diagnostic *diag)
{
    int n_file = 0, n_removed;
    PAL_TRY(check_grids(scene, diag));
    pal_err err = each_file(scene, folder, true, INT_MAX, &n_file, diag);
    char *text = err ? NULL : scene_text(scene);
    if (!err && !text) err = pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its text", path);
    if (!err && strlen(text) > PAL_JSON_MAX_BYTES)
        err = PAL_REFUSE(diag, "%s: would have %zu bytes, more than %d", path, strlen(text), PAL_JSON_MAX_BYTES);
    if (!err) err = pal_file_write(path, text, strlen(text), diag);
    cJSON_free(text);
    if (err) each_file(scene, folder, false, n_file, &n_removed, NULL);
    return err;
}

pal_err pal_scene_save(const pal_loaded_scene *loaded, const char *folder, pal_diagnostic *diag)
{
    char path[PATH];
    PAL_TRY(pal_scene_make_folder(folder, diag));
    snprintf(path, sizeof path, "%s/scene.json", folder);
    return save_to(&loaded->scene, folder, path, diag);
}

pal_err pal_scene_save_file(const pal_loaded_scene *loaded, const char *path, pal_diagnostic *diag)
{
    char folder[PATH];
    const char *slash = strrchr(path, '/');
    if (!pal_json_folder(path, folder, sizeof folder) || strlen(path) >= PATH || !path[0] || (slash && !slash[1]))
        return PAL_REFUSE(diag, "%.80s: not the name of a file", path);
    return save_to(&loaded->scene, folder, path, diag);
}
