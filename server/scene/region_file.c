/* Material regions: boxes, labels of a volume, values on a grid. Springs: constants on a grid.
 *
 * A label volume may lie turned or mirrored in its file's frame. What the simulation gets is always a grid along the
 * body's axes: the voxels themselves where the volume's axes are those of the frame in some order and sense, else
 * samples at half the smallest voxel edge (the nearest voxel's label). */
#include "server/scene/region_file.h"

#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/scan/label_volume.h"
#include "server/scene/scene_keys.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1600 };
static const double voxels_max = 512e6;

/* of the frame of the body's file */
static const double *origin_of(const pal_body_def *def)
{
    return def->cells ? def->mesh->surface.origin_m : def->mesh->tets.origin_m;
}

/* ---- reading ---- */

static const char *const value_key[3] = {"young_Pa", "poisson", "density_kg_m3"};
static const double value_low[3] = {PAL_YOUNG_MIN_PA, PAL_POISSON_MIN, PAL_DENSITY_MIN_KG_M3},
                    value_high[3] = {PAL_YOUNG_MAX_PA, PAL_POISSON_MAX, PAL_DENSITY_MAX_KG_M3};
static const char *const spring_key[3] = {"k_distance_J", "k_area_J", "k_volume_J"};
static const double spring_low = 1e-60, spring_high = 1e60;

/* may_be_flat: along which axes */
static pal_err read_box(const pal_json *json, const cJSON *object, const char *path, const bool may_be_flat[3],
                        double low_m[3], double high_m[3])
{
    static const char *const needed[] = {"low_m", "high_m"};
    char at[PAL_JSON_PATH];
    for (int k = 0; k < 2; k++)
        if (!cJSON_GetObjectItemCaseSensitive(object, needed[k]))
            return pal_json_refuse(json, pal_json_key(at, path, needed[k]), "is missing");
    PAL_TRY(pal_json_vector(json, object, path, "low_m", low_m));
    PAL_TRY(pal_json_vector(json, object, path, "high_m", high_m));
    for (int c = 0; c < 3; c++)
        if (low_m[c] > high_m[c] || (!may_be_flat[c] && low_m[c] == high_m[c]))
            return pal_json_refuse(json, path, "low_m[%d] %g is not below high_m[%d] %g", c, low_m[c], c, high_m[c]);
    return PAL_ERR_OK;
}

/* one list of a grid; NULL when the key is absent */
static pal_err read_values(const pal_json *json, const cJSON *grid, const char *path, const char *key, double low,
                           double high, int n, double *to, const double **out)
{
    char at[PAL_JSON_PATH];
    const cJSON *list;
    PAL_TRY(pal_json_list(json, grid, path, key, PAL_GRID_NODES_MAX, &list));
    *out = list ? to : NULL;
    if (!list) return PAL_ERR_OK;
    pal_json_key(at, path, key);
    if (cJSON_GetArraySize(list) != n)
        return pal_json_refuse(json, at, "%d numbers, wanted %d (n[0] n[1] n[2])", cJSON_GetArraySize(list), n);
    int k = 0;
    for (const cJSON *child = list->child; child; child = child->next, k++) {
        if (!cJSON_IsNumber(child)) return pal_json_refuse(json, at, "entry %d is not a number", k + 1);
        to[k] = child->valuedouble;
        if (!(to[k] >= low && to[k] <= high))
            return pal_json_refuse(json, at, "number %d, %g, is outside %g .. %g", k + 1, to[k], low, high);
    }
    return PAL_ERR_OK;
}

/* nodes and extent of a grid, room for three lists of its numbers */
static pal_err read_nodes(const pal_json *json, const cJSON *grid, const char *path, int out_n[3], double low_m[3],
                          double high_m[3], double **own)
{
    char at[PAL_JSON_PATH];
    double n[3] = {0, 0, 0};
    bool flat[3];
    PAL_TRY(pal_json_vector(json, grid, path, "n", n));
    for (int c = 0; c < 3; c++) {
        if (!(n[c] >= 1 && n[c] <= PAL_GRID_NODES_MAX && n[c] == floor(n[c])))
            return pal_json_refuse(json, pal_json_key(at, path, "n"), "number %d, %g, is not a count from 1", c + 1,
                                   n[c]);
        out_n[c] = (int)n[c];
        flat[c] = n[c] == 1;
    }
    if (n[0] * n[1] * n[2] > PAL_GRID_NODES_MAX)
        return pal_json_refuse(json, pal_json_key(at, path, "n"), "%g values, more than %d", n[0] * n[1] * n[2],
                               PAL_GRID_NODES_MAX);
    PAL_TRY(read_box(json, grid, path, flat, low_m, high_m));
    *own = malloc(3 * (size_t)(out_n[0] * out_n[1] * out_n[2]) * sizeof **own);
    if (!*own) return pal_diagnostic_set(json->diag, PAL_ERR_MEMORY, "%s: no memory for its grid", path);
    return PAL_ERR_OK;
}

static pal_err read_grid(const pal_json *json, const cJSON *region, const char *above, pal_region *out, double **own)
{
    char path[PAL_JSON_PATH];
    const cJSON *grid = cJSON_GetObjectItemCaseSensitive(region, "grid");
    const double **const value[3] = {&out->grid_young_Pa, &out->grid_poisson, &out->grid_density_kg_m3};
    pal_json_key(path, above, "grid");
    PAL_TRY(pal_json_object(json, grid, path, pal_scene_keys(PAL_KEYS_REGION_GRID, NULL)));
    PAL_TRY(read_nodes(json, grid, path, out->n, out->low_m, out->high_m, own));
    int count = out->n[0] * out->n[1] * out->n[2];
    for (int k = 0; k < 3; k++)
        PAL_TRY(read_values(json, grid, path, value_key[k], value_low[k], value_high[k], count, *own + k * count,
                            value[k]));
    if (!out->grid_young_Pa && !out->grid_poisson && !out->grid_density_kg_m3)
        return pal_json_refuse(json, path, "needs young_Pa, poisson or density_kg_m3");
    return PAL_ERR_OK;
}

/* inverse of the left 3x3 of to_m, row-major; false: the voxels have no volume */
static bool invert(const double to_m[12], double out[9])
{
    double det = 0, size = 0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
            out[3 * r + c] = to_m[4 * r1 + c1] * to_m[4 * r2 + c2] - to_m[4 * r1 + c2] * to_m[4 * r2 + c1];
        }
    for (int c = 0; c < 3; c++) det += to_m[c] * out[3 * c];
    for (int k = 0; k < 9; k++) size = fmax(size, fabs(out[k]));
    if (!(fabs(det) > 0) || !isfinite(size / det)) return false;
    for (int k = 0; k < 9; k++) out[k] /= det;
    return true;
}

/* the axes' grid of a volume: its spacing, count and first point in the file's frame */
static void lay_grid(const pal_label_volume *v, pal_region *out)
{
    double high[3], min = INFINITY;
    bool aligned = true;
    for (int c = 0; c < 3; c++) {
        double across = 0, along = 0, edge = 0;
        out->low_m[c] = high[c] = v->to_m[4 * c + 3];
        for (int k = 0; k < 3; k++) {
            double reach = v->to_m[4 * c + k] * (v->n[k] - 1), size = fabs(v->to_m[4 * c + k]);
            *(reach < 0 ? &out->low_m[c] : &high[c]) += reach;
            across += size;
            along = fmax(along, size);
            edge += v->to_m[4 * k + c] * v->to_m[4 * k + c];
        }
        out->spacing_m[c] = along;
        aligned = aligned && across - along < 1e-6 * along;
        min = fmin(min, sqrt(edge));
    }
    for (int c = 0; c < 3; c++) {
        if (!aligned) out->spacing_m[c] = 0.5 * min;
        double n = floor((high[c] - out->low_m[c]) / out->spacing_m[c] + 0.5) + 1;
        out->n[c] = n < 1e9 ? (int)n : 1000000000;
    }
}

/* 1 where the volume's nearest voxel has the label */
static pal_err sample(const pal_json *json, const char *path, const pal_label_volume *v, int is, const double origin[3],
                      pal_region *out, uint8_t **own)
{
    double from_m[9];
    int64_t found = 0;
    lay_grid(v, out);
    if (!invert(v->to_m, from_m)) return pal_json_refuse(json, path, "the voxels of the volume have no size");
    double count = (double)out->n[0] * out->n[1] * out->n[2];
    for (int c = 0; c < 3; c++)
        if (out->n[c] > 32767) return pal_json_refuse(json, path, "%d voxels on an axis, more than 32767", out->n[c]);
    if (count > voxels_max) return pal_json_refuse(json, path, "%g voxels, more than %g", count, voxels_max);
    *own = calloc((size_t)count, 1);
    if (!*own) return pal_diagnostic_set(json->diag, PAL_ERR_MEMORY, "%s: no memory for its voxels", path);
    for (int k = 0; k < out->n[2]; k++)
        for (int j = 0; j < out->n[1]; j++)
            for (int i = 0; i < out->n[0]; i++) {
                const double ijk[3] = {i, j, k};
                double off[3], at[3];
                size_t voxel = 0, step = 1;
                bool in = true;
                for (int c = 0; c < 3; c++) off[c] = out->low_m[c] + ijk[c] * out->spacing_m[c] - v->to_m[4 * c + 3];
                pal_mul33(at, from_m, off);
                for (int c = 0; c < 3; c++) {
                    double g = floor(at[c] + 0.5);
                    in = in && g >= 0 && g < v->n[c];
                    voxel += in ? step * (size_t)g : 0;
                    step *= (size_t)v->n[c];
                }
                bool inside = in && v->label[voxel] == is;
                (*own)[((size_t)k * (size_t)out->n[1] + (size_t)j) * (size_t)out->n[0] + (size_t)i] = inside;
                found += inside;
            }
    if (found == 0) return pal_json_refuse(json, path, "the volume has no voxel of label %d", is);
    out->label = *own;
    out->is = 1;
    pal_sub3(out->low_m, out->low_m, origin);
    return PAL_ERR_OK;
}

static pal_err read_label(const pal_json *json, const cJSON *region, const char *above, const char *folder,
                          const double origin[3], pal_region *out, uint8_t **own)
{
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH], name[512] = "", file[PATH];
    int is = 0;
    const cJSON *label = cJSON_GetObjectItemCaseSensitive(region, "label");
    pal_label_volume volume = {0};
    pal_diagnostic reason = {""};
    pal_json_key(path, above, "label");
    PAL_TRY(pal_json_object(json, label, path, pal_scene_keys(PAL_KEYS_LABEL, NULL)));
    PAL_TRY(pal_json_text(json, label, path, "volume", false, name, sizeof name));
    PAL_TRY(pal_json_count(json, label, path, "value", 1, 1 << 30, &is));
    if (!*name) return pal_json_refuse(json, pal_json_key(at, path, "volume"), "is missing");
    if (!is) return pal_json_refuse(json, pal_json_key(at, path, "value"), "is missing");
    int n =
        name[0] == '/' ? snprintf(file, sizeof file, "%s", name) : snprintf(file, sizeof file, "%s/%s", folder, name);
    if (n < 0 || (size_t)n >= sizeof file) return pal_json_refuse(json, path, "the path is too long");
    pal_err err = pal_label_volume_read(file, &volume, &reason);
    if (err)
        pal_diagnostic_set(json->diag, err, "%s: %s: %s", json->file, pal_json_key(at, path, "volume"), reason.text);
    else
        err = sample(json, path, &volume, is, origin, out, own);
    pal_label_volume_free(&volume);
    return err;
}

static pal_err read_region(const pal_json *json, const cJSON *object, const char *path, const char *folder,
                           const double origin[3], pal_region *out, pal_loaded_region *own)
{
    const char *const *known = pal_scene_keys(PAL_KEYS_REGION, NULL);
    char at[PAL_JSON_PATH];
    bool has[3];
    *out = (pal_region){.young_Pa = NAN, .poisson = NAN, .density_kg_m3 = NAN};
    PAL_TRY(pal_json_object(json, object, path, known));
    for (int k = 0; k < 3; k++) has[k] = cJSON_GetObjectItemCaseSensitive(object, known[k]) != NULL;
    if (has[0] + has[1] + has[2] != 1) return pal_json_refuse(json, path, "needs one of box, label and grid");
    double *const value[3] = {&out->young_Pa, &out->poisson, &out->density_kg_m3};
    bool given = has[2];
    for (int k = 0; k < 3; k++) {
        PAL_TRY(pal_json_number(json, object, path, value_key[k], value_low[k], value_high[k], value[k]));
        given = given || !isnan(*value[k]);
    }
    if (!given) return pal_json_refuse(json, path, "needs young_Pa, poisson or density_kg_m3");
    if (has[0]) {
        const cJSON *box = cJSON_GetObjectItemCaseSensitive(object, "box");
        out->kind = PAL_REGION_BOX;
        PAL_TRY(pal_json_object(json, box, pal_json_key(at, path, "box"), pal_scene_keys(PAL_KEYS_REGION_BOX, NULL)));
        return read_box(json, box, at, (const bool[3]){true, true, true}, out->low_m, out->high_m);
    }
    if (has[1]) {
        out->kind = PAL_REGION_LABEL;
        return read_label(json, object, path, folder, origin, out, &own->label);
    }
    out->kind = PAL_REGION_GRID;
    return read_grid(json, object, path, out, &own->grid);
}

pal_err pal_region_read(const pal_json *json, const cJSON *body, const char *path, const char *folder,
                        pal_loaded_scene *scene, int index)
{
    char at[PAL_JSON_PATH], entry[PAL_JSON_PATH];
    const cJSON *list;
    pal_body_def *def = &scene->scene.body[index];
    PAL_TRY(pal_json_list(json, body, path, "regions", PAL_REGION_MAX, &list));
    pal_json_key(at, path, "regions");
    if (list && list->child && strcmp(def->model.name, "fem") != 0 && strcmp(def->model.name, "subdivision_fem") != 0)
        return pal_json_refuse(json, at, "model \"%s\" has one material; model \"fem\" takes regions", def->model.name);
    for (const cJSON *child = list ? list->child : NULL; child; child = child->next, def->n_region++)
        PAL_TRY(read_region(json, child, pal_json_entry(entry, at, def->n_region), folder, origin_of(def),
                            &def->region[def->n_region], &scene->region[index][def->n_region]));
    return PAL_ERR_OK;
}

void pal_region_free(pal_loaded_scene *scene, int index)
{
    for (int k = 0; k < PAL_REGION_MAX; k++) {
        free(scene->region[index][k].label);
        free(scene->region[index][k].grid);
        scene->region[index][k] = (pal_loaded_region){NULL, NULL};
    }
}

pal_err pal_spring_grid_read(const pal_json *json, const cJSON *model, const char *above, pal_loaded_scene *scene,
                             int index)
{
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH];
    pal_body_def *def = &scene->scene.body[index];
    pal_spring_grid *out = &def->spring_grid;
    const cJSON *grid = cJSON_GetObjectItemCaseSensitive(model, "grid");
    if (!grid) return PAL_ERR_OK;
    pal_json_key(path, above, "grid");
    if (strcmp(def->model.name, "tet_springs") != 0)
        return pal_json_refuse(json, path, "model \"%s\" has no springs; model \"tet_springs\" takes a grid",
                               def->model.name);
    PAL_TRY(pal_json_object(json, grid, path, pal_scene_keys(PAL_KEYS_SPRING_GRID, NULL)));
    PAL_TRY(read_nodes(json, grid, path, out->n, out->low_m, out->high_m, &scene->spring_grid[index]));
    int count = out->n[0] * out->n[1] * out->n[2];
    for (int k = 0; k < 3; k++) {
        PAL_TRY(read_values(json, grid, path, spring_key[k], spring_low, spring_high, count,
                            scene->spring_grid[index] + k * count, &out->k_J[k]));
        if (out->k_J[k] && pal_entry_has(&def->model, spring_key[k]))
            return pal_json_refuse(json, pal_json_key(at, above, spring_key[k]),
                                   "stands beside a grid that gives the same");
    }
    if (!out->k_J[0] && !out->k_J[1] && !out->k_J[2])
        return pal_json_refuse(json, path, "needs k_distance_J, k_area_J or k_volume_J");
    return PAL_ERR_OK;
}

void pal_spring_grid_free(pal_loaded_scene *scene, int index)
{
    free(scene->spring_grid[index]);
    scene->spring_grid[index] = NULL;
}

/* ---- writing ---- */

void pal_region_volume(const char *stem, int region, char *out, size_t n_byte)
{
    snprintf(out, n_byte, "%s_region%d.nii", stem, region);
}

static void add_constant(cJSON *object, const char *key, double value)
{
    if (!isnan(value)) cJSON_AddItemToObject(object, key, pal_json_exact(value));
}

static void add_box(cJSON *object, const double low_m[3], const double high_m[3])
{
    cJSON_AddItemToObject(object, "low_m", pal_json_exact_list(low_m, 3));
    cJSON_AddItemToObject(object, "high_m", pal_json_exact_list(high_m, 3));
}

static void add_grid(cJSON *object, const int n[3], const double low_m[3], const double high_m[3],
                     const char *const key[3], const double *const value[3])
{
    cJSON *grid = cJSON_AddObjectToObject(object, "grid");
    cJSON_AddItemToObject(grid, "n", cJSON_CreateIntArray(n, 3));
    add_box(grid, low_m, high_m);
    for (int k = 0; k < 3; k++)
        if (value[k]) cJSON_AddItemToObject(grid, key[k], pal_json_exact_list(value[k], n[0] * n[1] * n[2]));
}

void pal_spring_grid_append(cJSON *model, const pal_spring_grid *g)
{
    if (g->n[0] > 0) add_grid(model, g->n, g->low_m, g->high_m, spring_key, g->k_J);
}

void pal_region_append(cJSON *object, const pal_body_def *body, const char *stem)
{
    char name[128];
    if (body->n_region == 0) return;
    cJSON *list = cJSON_AddArrayToObject(object, "regions");
    for (int k = 0; k < body->n_region; k++) {
        const pal_region *r = &body->region[k];
        cJSON *entry = cJSON_CreateObject();
        cJSON_AddItemToArray(list, entry);
        if (r->kind == PAL_REGION_BOX) {
            cJSON *box = cJSON_AddObjectToObject(entry, "box");
            add_box(box, r->low_m, r->high_m);
        } else if (r->kind == PAL_REGION_LABEL) {
            cJSON *label = cJSON_AddObjectToObject(entry, "label");
            pal_region_volume(stem, k, name, sizeof name);
            cJSON_AddStringToObject(label, "volume", name);
            cJSON_AddNumberToObject(label, "value", 1);
        } else {
            const double *const value[3] = {r->grid_young_Pa, r->grid_poisson, r->grid_density_kg_m3};
            add_grid(entry, r->n, r->low_m, r->high_m, value_key, value);
        }
        add_constant(entry, "young_Pa", r->young_Pa);
        add_constant(entry, "poisson", r->poisson);
        add_constant(entry, "density_kg_m3", r->density_kg_m3);
    }
}

static void put_short(uint8_t *to, int value)
{
    to[0] = (uint8_t)(value & 0xff);
    to[1] = (uint8_t)(value >> 8 & 0xff);
}

static void put_float(uint8_t *to, double value)
{
    float f = (float)value;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    for (int k = 0; k < 4; k++) to[k] = (uint8_t)(bits >> (8 * k));
}

pal_err pal_region_write(const pal_body_def *body, int region, const char *path, pal_diagnostic *diag)
{
    enum { HEADER = 352 };
    const pal_region *r = &body->region[region];
    size_t count = (size_t)r->n[0] * (size_t)r->n[1] * (size_t)r->n[2];
    uint8_t *file = calloc(HEADER + count, 1);
    if (!file) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its voxels", path);
    put_short(file, 348);    /* sizeof_hdr                                */
    put_short(file + 40, 3); /* dim                                       */
    put_short(file + 70, 2); /* datatype: one byte                        */
    put_short(file + 72, 8); /* bitpix                                    */
    put_float(file + 76, 1); /* pixdim[0]                                 */
    put_float(file + 108, HEADER);
    put_float(file + 112, 1); /* scl_slope                                */
    file[123] = 2;            /* mm                                       */
    put_short(file + 254, 1); /* sform_code: scanner                      */
    for (int c = 0; c < 3; c++) {
        put_short(file + 42 + 2 * c, r->n[c]);
        put_short(file + 48 + 2 * c, 1);
        put_float(file + 80 + 4 * c, 1e3 * r->spacing_m[c]);
        put_float(file + 280 + 16 * c + 4 * c, 1e3 * r->spacing_m[c]);
        put_float(file + 280 + 16 * c + 12, 1e3 * (r->low_m[c] + origin_of(body)[c]));
    }
    memcpy(file + 344, "n+1", 4);
    for (size_t k = 0; k < count; k++) file[HEADER + k] = r->label[k] == r->is;
    pal_err err = pal_file_write(path, file, HEADER + count, diag);
    free(file);
    return err;
}
