/* pal_scene -> DIR/scene.json and DIR/NAME.palmesh or DIR/NAME.palcells. The meshes go first and scene.json last, so
 * that a folder with a scene.json is whole; what was written is removed again when something fails. */
#include "server/scene/scene_file.h"

#include "server/mesh/cells/cell_file.h"
#include "server/mesh/files/file_bytes.h"
#include "server/scene/region_file.h"
#include "server/scene/scene_import.h"
#include "server/scene/subdivision_file.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH = 1200, MESH_NAME = PAL_NAME + 24 };

/* "liver"; a number keeps two bodies of like names apart */
static void stem_of(const pal_scene *scene, int body, char out[MESH_NAME])
{
    char plain[PAL_NAME], other[PAL_NAME];
    bool twice = false;
    pal_scene_plain_name(scene->body[body].name, plain);
    for (int k = 0; k < scene->n_body; k++) {
        pal_scene_plain_name(scene->body[k].name, other);
        twice = twice || (k != body && !strcmp(plain, other));
    }
    if (twice)
        snprintf(out, MESH_NAME, "%s_%d", plain, body);
    else
        snprintf(out, MESH_NAME, "%s", plain);
}

static void mesh_name(const pal_scene *scene, int body, char out[MESH_NAME])
{
    stem_of(scene, body, out);
    size_t n = strlen(out);
    snprintf(out + n, MESH_NAME - n, scene->body[body].cells ? ".palcells" : ".palmesh");
}

static void add_number(cJSON *object, const char *key, double number)
{
    cJSON_AddItemToObject(object, key, pal_json_exact(number));
}

static cJSON *add_item(cJSON *parent, const char *key, const pal_config_entry *item)
{
    cJSON *object = key ? cJSON_AddObjectToObject(parent, key) : cJSON_CreateObject();
    if (!key) cJSON_AddItemToArray(parent, object);
    cJSON_AddStringToObject(object, "name", item->name);
    for (int k = 0; k < item->n_value; k++) {
        const pal_config_value *v = &item->value[k];
        switch (v->kind) {
        case PAL_VALUE_NUMBER:
            add_number(object, v->key, v->number[0]);
            break;
        case PAL_VALUE_BOOL:
            cJSON_AddBoolToObject(object, v->key, v->flag);
            break;
        case PAL_VALUE_TEXT:
            cJSON_AddStringToObject(object, v->key, v->text);
            break;
        case PAL_VALUE_NUMBERS:
            cJSON_AddItemToObject(object, v->key, pal_json_exact_list(v->number, v->n_number));
            break;
        }
    }
    return object;
}

static void add_supports(cJSON *object, const pal_body_def *body)
{
    cJSON *list = cJSON_AddArrayToObject(object, "supports");
    for (int k = 0; k < body->n_support; k++) {
        const pal_support_def *s = &body->support[k];
        cJSON *entry = cJSON_CreateObject();
        cJSON_AddItemToArray(list, entry);
        if (s->rim) {
            cJSON_AddBoolToObject(entry, "boundary", true);
            continue;
        }
        if (s->lowest) {
            add_number(entry, "lowest", s->fraction);
            continue;
        }
        cJSON *box = cJSON_AddObjectToObject(entry, "box");
        cJSON_AddItemToObject(box, "low_m", pal_json_exact_list(s->low_m, 3));
        cJSON_AddItemToObject(box, "high_m", pal_json_exact_list(s->high_m, 3));
    }
}

static void add_body(cJSON *list, const pal_scene *scene, int index)
{
    const pal_body_def *body = &scene->body[index];
    char name[MESH_NAME];
    cJSON *object = cJSON_CreateObject();
    cJSON_AddItemToArray(list, object);
    mesh_name(scene, index, name);
    cJSON_AddStringToObject(object, "name", body->name);
    if (body->cells)
        pal_subdivision_append(object, body, name);
    else
        cJSON_AddStringToObject(object, "mesh", name);
    cJSON *material = cJSON_AddObjectToObject(object, "material");
    add_number(material, "young_Pa", body->material.young_Pa);
    add_number(material, "poisson", body->material.poisson);
    add_number(material, "density_kg_m3", body->material.density_kg_m3);
    add_number(material, "damping_1_s", body->material.damping_1_s);
    stem_of(scene, index, name);
    pal_region_append(object, body, name);
    pal_spring_grid_append(add_item(object, "model", &body->model), &body->spring_grid);
    if (body->solver.name[0]) add_item(object, "solver", &body->solver);
    add_item(object, "output", &body->output);
    add_supports(object, body);
    cJSON *effects = cJSON_AddArrayToObject(object, "effects");
    for (int k = 0; k < body->n_effect; k++) add_item(effects, NULL, &body->effect[k]);
}

/* millimetres that are read as exactly these metres, when they came from millimetres */
static double in_mm(double metres)
{
    double mm = 1000 * metres;
    for (int k = 0; k < 2 && mm / 1000 != metres; k++) mm = nextafter(mm, mm / 1000 < metres ? INFINITY : 0);
    return mm;
}

/* "accuracy" and "budget" as they were asked for */
static void add_requests(cJSON *root, const pal_scene *scene)
{
    if (scene->max_error_m > 0) {
        cJSON *accuracy = cJSON_AddObjectToObject(root, "accuracy");
        add_number(accuracy, "max_error_mm", in_mm(scene->max_error_m));
        if (scene->accuracy[0]) cJSON_AddStringToObject(accuracy, "text", scene->accuracy);
    } else if (scene->accuracy[0]) {
        cJSON_AddStringToObject(root, "accuracy", scene->accuracy);
    }
    if (scene->budget_ms > 0) add_number(cJSON_AddObjectToObject(root, "budget"), "step_ms", scene->budget_ms);
}

/* the scene as text, or NULL; the caller frees it */
static char *scene_text(const pal_scene *scene)
{
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "name", scene->name);
    cJSON_AddStringToObject(root, "title", scene->title);
    cJSON_AddStringToObject(root, "source", scene->source);
    add_requests(root, scene);
    add_number(root, "step_s", scene->step_s);
    cJSON_AddItemToObject(root, "up", pal_json_exact_list(scene->up, 3));
    add_number(root, "gravity_m_s2", scene->gravity_m_s2);
    add_number(root, "max_substep", scene->max_substep);
    cJSON *bodies = cJSON_AddArrayToObject(root, "bodies");
    for (int k = 0; k < scene->n_body; k++) add_body(bodies, scene, k);
    cJSON *tools = cJSON_AddArrayToObject(root, "tools");
    for (int k = 0; k < scene->n_tool; k++) {
        cJSON *tool = cJSON_CreateObject();
        cJSON_AddItemToArray(tools, tool);
        cJSON_AddStringToObject(tool, "name", scene->tool[k].name);
        add_number(tool, "radius_m", scene->tool[k].radius_m);
        add_number(tool, "force_cap_N", scene->tool[k].force_cap_N);
    }
    char *text = cJSON_Print(root);
    cJSON_Delete(root);
    return text;
}

pal_err pal_scene_make_folder(const char *folder, pal_diagnostic *diag)
{
    char path[PATH];
    int n = snprintf(path, sizeof path, "%s", folder);
    if (n < 1 || (size_t)n >= sizeof path)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%.80s: not a folder's name", folder);
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

/* mesh and label volumes of a body; what was written is counted in *n_file */
static pal_err save_body(const pal_scene *scene, int index, const char *folder, int *n_file, pal_diagnostic *diag)
{
    const pal_body_def *body = &scene->body[index];
    const int *n = body->spring_grid.n;
    char name[MESH_NAME], volume[MESH_NAME + 32], path[PATH];
    if ((double)n[0] * n[1] * n[2] > PAL_GRID_NODES_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\" model.grid.n: %g nodes, more than %d", body->name,
                                  (double)n[0] * n[1] * n[2], PAL_GRID_NODES_MAX);
    mesh_name(scene, index, name);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (body->cells)
        PAL_TRY(pal_cell_file_save(body->cells, path, diag));
    else
        PAL_TRY(pal_prepared_save(body->mesh, path, diag));
    ++*n_file;
    stem_of(scene, index, name);
    for (int k = 0; k < body->n_region; k++) {
        if (body->region[k].kind != PAL_REGION_LABEL) continue;
        pal_region_volume(name, k, volume, sizeof volume);
        snprintf(path, sizeof path, "%s/%s", folder, volume);
        PAL_TRY(pal_region_write(body, k, path, diag));
        ++*n_file;
    }
    return PAL_ERR_OK;
}

/* takes back the first n_file files that save_body wrote */
static void remove_files(const pal_scene *scene, const char *folder, int n_file)
{
    char name[MESH_NAME], volume[MESH_NAME + 32], path[PATH];
    for (int b = 0; b < scene->n_body && n_file > 0; b++) {
        const pal_body_def *body = &scene->body[b];
        mesh_name(scene, b, name);
        snprintf(path, sizeof path, "%s/%s", folder, name);
        unlink(path);
        n_file--;
        stem_of(scene, b, name);
        for (int k = 0; k < body->n_region && n_file > 0; k++) {
            if (body->region[k].kind != PAL_REGION_LABEL) continue;
            pal_region_volume(name, k, volume, sizeof volume);
            snprintf(path, sizeof path, "%s/%s", folder, volume);
            unlink(path);
            n_file--;
        }
    }
}

/* meshes into the folder, then the scene's text to path, which lies in it */
static pal_err save_to(const pal_scene *scene, const char *folder, const char *path, pal_diagnostic *diag)
{
    int n_file = 0;
    pal_err err = PAL_ERR_OK;
    for (int b = 0; b < scene->n_body && !err; b++) err = save_body(scene, b, folder, &n_file, diag);
    char *text = err ? NULL : scene_text(scene);
    if (!err && !text) err = pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its text", path);
    if (!err && strlen(text) > PAL_JSON_MAX_BYTES)
        err = pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: would have %zu bytes, more than %d", path, strlen(text),
                                 PAL_JSON_MAX_BYTES);
    if (!err) err = pal_file_write(path, text, strlen(text), diag);
    cJSON_free(text);
    if (err) remove_files(scene, folder, n_file);
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
    int n = slash == path ? snprintf(folder, sizeof folder, "/")
            : slash       ? snprintf(folder, sizeof folder, "%.*s", (int)(slash - path), path)
                          : snprintf(folder, sizeof folder, ".");
    if (n < 0 || (size_t)n >= sizeof folder || strlen(path) >= PATH || !path[0] || (slash && !slash[1]))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%.80s: not the name of a file", path);
    return save_to(&loaded->scene, folder, path, diag);
}
