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
#include "server/scene/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1600 };

/* of the frame of the body's file */
static const double *origin_of(const pal_body_def *def)
{
    return def->cells ? def->mesh->surface.origin_m : def->mesh->tets.origin_m;
}

/* keys and ranges of the numbers at the nodes of a grid */
typedef struct grid_values {
    const char *key[3];
    double low[3], high[3];
} grid_values;
static const grid_values material_values = {{"young_Pa", "poisson", "density_kg_m3"},
                                            {PAL_YOUNG_MIN_PA, PAL_POISSON_MIN, PAL_DENSITY_MIN_KG_M3},
                                            {PAL_YOUNG_MAX_PA, PAL_POISSON_MAX, PAL_DENSITY_MAX_KG_M3}};
static const grid_values spring_values = {{"k_distance_J", "k_area_J", "k_volume_J"},
                                          {PAL_GRID_K_MIN_J, PAL_GRID_K_MIN_J, PAL_GRID_K_MIN_J},
                                          {PAL_GRID_K_MAX_J, PAL_GRID_K_MAX_J, PAL_GRID_K_MAX_J}};

/* nodes and extent of a grid, room for three lists of its numbers */
static pal_err read_nodes(const pal_json *at, int out_n[3], double low_m[3], double high_m[3], double **own)
{
    double n[3] = {0, 0, 0};
    PAL_TRY(pal_json_vector(at, "n", n));
    for (int c = 0; c < 3; c++) {
        if (!(n[c] >= 1 && n[c] <= PAL_GRID_NODES_MAX && n[c] == floor(n[c])))
            return pal_json_refuse_key(at, "n", "number %d, %g, is not a count from 1", c + 1, n[c]);
        out_n[c] = (int)n[c];
    }
    if (n[0] * n[1] * n[2] > PAL_GRID_NODES_MAX)
        return pal_json_refuse_key(at, "n", "%g values, more than %d", n[0] * n[1] * n[2], PAL_GRID_NODES_MAX);
    PAL_TRY(pal_json_box(at, "low_m", "high_m", low_m, high_m));
    for (int c = 0; c < 3; c++)
        if (out_n[c] > 1 && low_m[c] == high_m[c])
            return pal_json_refuse(at, "low_m[%d] %g is not below high_m[%d] %g", c, low_m[c], c, high_m[c]);
    *own = malloc(3 * (size_t)(out_n[0] * out_n[1] * out_n[2]) * sizeof **own);
    if (!*own) return pal_diagnostic_set(at->diag, PAL_ERR_MEMORY, "%s: no memory for its grid", at->path);
    return PAL_ERR_OK;
}

/* three lists of numbers at the nodes, all optional but one: out [3] into own, NULL where a key is absent */
static pal_err read_values(const pal_json *at, const grid_values *wanted, const int count[3], double *own,
                           const double **const out[3])
{
    const int n = count[0] * count[1] * count[2];
    for (int v = 0; v < 3; v++, own += n) {
        pal_json list;
        PAL_TRY(pal_json_list(at, wanted->key[v], PAL_GRID_NODES_MAX, &list));
        *out[v] = list.value ? own : NULL;
        if (!list.value) continue;
        if (cJSON_GetArraySize(list.value) != n)
            return pal_json_refuse(&list, "%d numbers, wanted %d (n[0] n[1] n[2])", cJSON_GetArraySize(list.value), n);
        int k = 0;
        PAL_JSON_EACH (child, &list) {
            if (!cJSON_IsNumber(child)) return pal_json_refuse(&list, "entry %d is not a number", k + 1);
            own[k] = child->valuedouble;
            if (!(own[k] >= wanted->low[v] && own[k] <= wanted->high[v]))
                return pal_json_refuse(&list, "number %d, %g, is outside %g .. %g", k + 1, own[k], wanted->low[v],
                                       wanted->high[v]);
            k++;
        }
    }
    if (*out[0] || *out[1] || *out[2]) return PAL_ERR_OK;
    return pal_json_refuse(at, "needs %s, %s or %s", wanted->key[0], wanted->key[1], wanted->key[2]);
}

static pal_err read_grid(const pal_json *region, pal_region *out, double **own)
{
    const pal_json at = pal_json_at(region, "grid");
    const double **const value[3] = {&out->grid_young_Pa, &out->grid_poisson, &out->grid_density_kg_m3};
    PAL_TRY(pal_json_object(&at, pal_scene_keys(PAL_KEYS_REGION_GRID, NULL)));
    PAL_TRY(read_nodes(&at, out->n, out->low_m, out->high_m, own));
    return read_values(&at, &material_values, out->n, *own, value);
}

/* the axes' grid of a volume: its spacing, count and first point in the file's frame */
static void make_grid(const pal_label_volume *v, pal_region *out)
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
static pal_err sample(const pal_json *at, const pal_label_volume *v, int is, const double origin[3], pal_region *out,
                      uint8_t **own)
{
    double axes[9], from_m[9];
    int64_t found = 0;
    make_grid(v, out);
    for (int k = 0; k < 9; k++) axes[k] = v->to_m[4 * (k / 3) + k % 3];
    (void)pal_inverse33(from_m, axes);
    if (!pal_finite3(from_m) || !pal_finite3(from_m + 3) || !pal_finite3(from_m + 6))
        return pal_json_refuse(at, "the voxels of the volume have no size");
    double count = (double)out->n[0] * out->n[1] * out->n[2];
    for (int c = 0; c < 3; c++)
        if (out->n[c] > 32767) return pal_json_refuse(at, "%d voxels on an axis, more than 32767", out->n[c]);
    if (count > PAL_REGION_VOXELS) return pal_json_refuse(at, "%g voxels, more than %g", count, PAL_REGION_VOXELS);
    *own = calloc((size_t)count, 1);
    if (!*own) return pal_diagnostic_set(at->diag, PAL_ERR_MEMORY, "%s: no memory for its voxels", at->path);
    for (int k = 0; k < out->n[2]; k++)
        for (int j = 0; j < out->n[1]; j++)
            for (int i = 0; i < out->n[0]; i++) {
                const double ijk[3] = {i, j, k};
                double off[3], in_voxels[3];
                size_t voxel = 0, step = 1;
                bool in = true;
                for (int c = 0; c < 3; c++) off[c] = out->low_m[c] + ijk[c] * out->spacing_m[c] - v->to_m[4 * c + 3];
                pal_mul33(in_voxels, from_m, off);
                for (int c = 0; c < 3; c++) {
                    double g = floor(in_voxels[c] + 0.5);
                    in = in && g >= 0 && g < v->n[c];
                    voxel += in ? step * (size_t)g : 0;
                    step *= (size_t)v->n[c];
                }
                bool inside = in && v->label[voxel] == is;
                (*own)[((size_t)k * (size_t)out->n[1] + (size_t)j) * (size_t)out->n[0] + (size_t)i] = inside;
                found += inside;
            }
    if (found == 0) return pal_json_refuse(at, "the volume has no voxel of label %d", is);
    out->label = *own;
    out->is = 1;
    pal_sub3(out->low_m, out->low_m, origin);
    return PAL_ERR_OK;
}

static pal_err read_label(const pal_json *region, const double origin[3], pal_region *out, uint8_t **own)
{
    const pal_json at = pal_json_at(region, "label");
    char file[PATH];
    int is = 0;
    pal_label_volume volume = {0};
    pal_diagnostic reason = {""};
    PAL_TRY(pal_json_object(&at, pal_scene_keys(PAL_KEYS_LABEL, NULL)));
    PAL_TRY(pal_json_need(&at, "volume"));
    PAL_TRY(pal_json_need(&at, "value"));
    PAL_TRY(pal_json_file_name(&at, "volume", file, sizeof file));
    PAL_TRY(pal_json_count(&at, "value", 1, 1 << 30, &is));
    pal_err err = pal_json_forward(&at, "volume", pal_label_volume_read(file, &volume, &reason), &reason);
    if (!err) err = sample(&at, &volume, is, origin, out, own);
    pal_label_volume_free(&volume);
    return err;
}

static pal_err read_region(const pal_json *at, const double origin[3], pal_region *out, pal_loaded_region *own)
{
    const char *const *known = pal_scene_keys(PAL_KEYS_REGION, NULL);
    bool has[3];
    *out = (pal_region){.young_Pa = NAN, .poisson = NAN, .density_kg_m3 = NAN};
    PAL_TRY(pal_json_object(at, known));
    for (int k = 0; k < 3; k++) has[k] = pal_json_has(at, known[k]);
    if (has[0] + has[1] + has[2] != 1) return pal_json_refuse(at, "needs one of box, label and grid");
    double *const value[3] = {&out->young_Pa, &out->poisson, &out->density_kg_m3};
    bool given = has[2];
    for (int k = 0; k < 3; k++) {
        const grid_values *v = &material_values;
        PAL_TRY(pal_json_number(at, v->key[k], v->low[k], v->high[k], value[k]));
        given = given || !isnan(*value[k]);
    }
    if (!given) return pal_json_refuse(at, "needs young_Pa, poisson or density_kg_m3");
    if (has[0]) {
        const pal_json box = pal_json_at(at, "box");
        out->kind = PAL_REGION_BOX;
        PAL_TRY(pal_json_object(&box, pal_scene_keys(PAL_KEYS_REGION_BOX, NULL)));
        return pal_json_box(&box, "low_m", "high_m", out->low_m, out->high_m);
    }
    out->kind = has[1] ? PAL_REGION_LABEL : PAL_REGION_GRID;
    return has[1] ? read_label(at, origin, out, &own->label) : read_grid(at, out, &own->grid);
}

pal_err pal_region_read(const pal_json *body, pal_loaded_scene *scene, int index)
{
    pal_json list;
    pal_body_def *def = &scene->scene.body[index];
    PAL_TRY(pal_json_list(body, "regions", PAL_REGION_MAX, &list));
    if (list.value && list.value->child && strcmp(def->model.name, "fem") != 0 &&
        strcmp(def->model.name, "subdivision_fem") != 0)
        return pal_json_refuse(&list, "model \"%s\" has one material; model \"fem\" takes regions", def->model.name);
    PAL_JSON_ENTRIES (at, &list) {
        const int k = def->n_region++;
        PAL_TRY(read_region(&at, origin_of(def), &def->region[k], &scene->region[index][k]));
    }
    return PAL_ERR_OK;
}

pal_err pal_spring_grid_read(const pal_json *model, pal_loaded_scene *scene, int index)
{
    pal_body_def *def = &scene->scene.body[index];
    pal_spring_grid *out = &def->spring_grid;
    double **own = &scene->spring_grid[index];
    const pal_json at = pal_json_at(model, "grid");
    if (!at.value) return PAL_ERR_OK;
    if (strcmp(def->model.name, "tet_springs") != 0)
        return pal_json_refuse(&at, "model \"%s\" has no springs; model \"tet_springs\" takes a grid", def->model.name);
    PAL_TRY(pal_json_object(&at, pal_scene_keys(PAL_KEYS_SPRING_GRID, NULL)));
    PAL_TRY(read_nodes(&at, out->n, out->low_m, out->high_m, own));
    PAL_TRY(read_values(&at, &spring_values, out->n, *own,
                        (const double **const[]){&out->k_J[0], &out->k_J[1], &out->k_J[2]}));
    for (int k = 0; k < 3; k++)
        if (out->k_J[k] && pal_entry_has(&def->model, spring_values.key[k]))
            return pal_json_refuse_key(model, spring_values.key[k], "stands beside a grid that gives the same");
    return PAL_ERR_OK;
}

void pal_region_volume(const char *stem, int region, char *out, size_t n_byte)
{
    snprintf(out, n_byte, "%s_region%d.nii", stem, region);
}

static cJSON *grid_json(const int n[3], const double low_m[3], const double high_m[3], const char *const key[3],
                        const double *const value[3])
{
    cJSON *list[3] = {NULL};
    for (int k = 0; k < 3; k++)
        if (value[k]) list[k] = pal_json_exact_list(value[k], n[0] * n[1] * n[2]);
    return PAL_JSON({"n", cJSON_CreateIntArray(n, 3)}, {"low_m", pal_json_exact_list(low_m, 3)},
                    {"high_m", pal_json_exact_list(high_m, 3)}, {key[0], list[0]}, {key[1], list[1]},
                    {key[2], list[2]});
}

void pal_spring_grid_append(cJSON *model, const pal_spring_grid *g)
{
    if (g->n[0] > 0) PAL_JSON_ADD(model, {"grid", grid_json(g->n, g->low_m, g->high_m, spring_values.key, g->k_J)});
}

void pal_region_append(cJSON *object, const pal_body_def *body, const char *stem)
{
    char name[128];
    if (body->n_region == 0) return;
    cJSON *list = cJSON_AddArrayToObject(object, "regions");
    for (int k = 0; k < body->n_region; k++) {
        const pal_region *r = &body->region[k];
        const double *const grid[3] = {r->grid_young_Pa, r->grid_poisson, r->grid_density_kg_m3};
        const double constant[3] = {r->young_Pa, r->poisson, r->density_kg_m3};
        cJSON *entry = NULL;
        pal_region_volume(stem, k, name, sizeof name);
        if (r->kind == PAL_REGION_BOX)
            entry = PAL_JSON({"box", PAL_JSON({"low_m", pal_json_exact_list(r->low_m, 3)},
                                              {"high_m", pal_json_exact_list(r->high_m, 3)})});
        else if (r->kind == PAL_REGION_LABEL)
            entry = PAL_JSON({"label", PAL_JSON({"volume", JSON_TEXT(name)}, {"value", JSON_NUMBER(1)})});
        else
            entry = PAL_JSON({"grid", grid_json(r->n, r->low_m, r->high_m, material_values.key, grid)});
        for (int v = 0; v < 3; v++)
            if (!isnan(constant[v])) PAL_JSON_ADD(entry, {material_values.key[v], pal_json_exact(constant[v])});
        cJSON_AddItemToArray(list, entry);
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
