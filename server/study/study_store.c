/* Studies as JSON and CSV. Every point has the same keys; a table maps them to struct members. */
#include "server/study/study_store.h"

#include "server/mesh/files/file_bytes.h"
#include "server/scene/json_reader.h"

#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char format[] = "palpate-study-1";

/* numbers of a point, with their accepted range; may be null where `hole` */
typedef struct number_key {
    const char *key;
    size_t at;
    double low, high;
    bool hole;
    bool late; /* studies stored before it existed read as 0 */
} number_key;
#define AT(field) offsetof(pal_study_point, field)
static const number_key number[] = {
    {"step_s", AT(measured.setting.step_s), 0, 0.1, false, false},
    {"tolerance", AT(measured.setting.tolerance), 0, 1, false, false},
    {"k_distance_J", AT(measured.setting.k_distance_J), 0, 1e300, false, false},
    {"k_area_J", AT(measured.setting.k_area_J), -1, 1e300, false, false},
    {"k_volume_J", AT(measured.setting.k_volume_J), 0, 1e300, false, false},
    {"ms", AT(measured.ms), 0, 1e12, true, false},
    {"error_m", AT(measured.error_m), 0, 1e300, true, false},
    {"ms_p95", AT(ms_p95), 0, 1e12, true, false},
    {"static_rms_m", AT(static_rms_m), 0, 1e300, true, false},
    {"static_max_m", AT(static_max_m), 0, 1e300, true, false},
    {"trajectory_rms_m", AT(trajectory_rms_m), 0, 1e300, true, false},
    {"trajectory_max_m", AT(trajectory_max_m), 0, 1e300, true, false},
    {"prepare_s", AT(prepare_s), 0, 1e12, true, false},
    {"elements", AT(n_element), 0, 1e12, false, true},
    {"read_ms", AT(read_ms), 0, 1e12, false, true},
    {"predicted_ms", AT(predicted_ms), 0, 1e300, true, false},
    {"predicted_m", AT(predicted_m), 0, 1e300, true, false},
};
typedef struct text_key {
    const char *key;
    size_t at, n_byte;
    bool may_be_empty;
} text_key;
static const text_key text[] = {
    {"model", AT(measured.setting.model), PAL_NAME, false},
    {"element", AT(measured.setting.element), PAL_NAME, true},
    {"law", AT(measured.setting.law), PAL_NAME, true},
    {"solver", AT(measured.setting.solver), PAL_NAME, true},
    {"reason", AT(reason), sizeof((pal_study_point *)0)->reason, true},
};
enum { N_NUMBER = sizeof number / sizeof *number, N_TEXT = sizeof text / sizeof *text };

static const double *number_at(const pal_study_point *p, int k)
{
    return (const double *)(const void *)((const char *)p + number[k].at);
}

static const char *text_at(const pal_study_point *p, int k)
{
    return (const char *)p + text[k].at;
}

/* ---- identity of the study ---- */

uint64_t pal_study_digest(uint64_t before, const void *bytes, size_t n_byte)
{
    const unsigned char *at = bytes;
    uint64_t sum = before ? before : 0xcbf29ce484222325u;
    for (size_t i = 0; i < n_byte; i++) sum = (sum ^ at[i]) * 0x100000001b3u;
    return sum;
}

static uint64_t add_numbers(uint64_t sum, const double *value, size_t n)
{
    return value ? pal_study_digest(sum, value, n * sizeof *value) : pal_study_digest(sum, "-", 1);
}

static uint64_t add_region(uint64_t sum, const pal_region *r)
{
    const double own[] = {r->kind, r->is, r->young_Pa, r->poisson, r->density_kg_m3, r->n[0], r->n[1], r->n[2]};
    size_t n = (size_t)r->n[0] * (size_t)r->n[1] * (size_t)r->n[2];
    sum = add_numbers(sum, own, sizeof own / sizeof *own);
    if (r->kind != PAL_REGION_LABEL) sum = add_numbers(add_numbers(sum, r->low_m, 3), r->high_m, 3);
    if (r->kind == PAL_REGION_LABEL) {
        sum = add_numbers(add_numbers(sum, r->low_m, 3), r->spacing_m, 3);
        if (r->label) sum = pal_study_digest(sum, r->label, n);
    }
    if (r->kind != PAL_REGION_GRID) return sum;
    sum = add_numbers(add_numbers(sum, r->grid_young_Pa, n), r->grid_poisson, n);
    return add_numbers(sum, r->grid_density_kg_m3, n);
}

/* effects that move an untouched body: gravity, inflate, penalty */
static uint64_t add_effect(uint64_t sum, const pal_config_entry *item)
{
    static const char *const quiet[] = {"tool_push", "tool_grasp", "finite_guard", "sleep"};
    for (size_t k = 0; k < sizeof quiet / sizeof *quiet; k++)
        if (!strcmp(item->name, quiet[k])) return sum;
    sum = pal_study_digest(sum, item->name, strlen(item->name));
    for (int k = 0; k < item->n_value; k++) {
        const pal_config_value *v = &item->value[k];
        sum = pal_study_digest(pal_study_digest(sum, v->key, strlen(v->key)), v->text, strlen(v->text));
        sum = add_numbers(sum, v->number, (size_t)(v->kind == PAL_VALUE_NUMBER ? 1 : v->n_number));
        sum = add_numbers(sum, &(double){v->flag}, 1);
    }
    return sum;
}

const char *pal_study_shape(const pal_body_def *body, char out[PAL_STUDY_SHAPE])
{
    uint64_t sum = 0;
    const pal_material *m = &body->material;
    const double own[] = {m->young_Pa,    m->poisson,      m->density_kg_m3, m->damping_1_s,
                          body->n_region, body->n_support, body->n_stroke};
    const pal_surface *s = &body->mesh->surface;
    sum = add_numbers(sum, own, sizeof own / sizeof *own);
    sum = pal_study_digest(sum, s->tri, 3 * (size_t)s->n_tri * sizeof *s->tri);
    sum = pal_study_digest(sum, s->x, 3 * (size_t)s->n_vertex * sizeof *s->x);
    if (body->cells) sum = add_numbers(sum, body->cells->x, 3 * (size_t)body->cells->n_vertex);
    for (int k = 0; k < body->n_region; k++) sum = add_region(sum, &body->region[k]);
    for (int k = 0; k < body->n_support; k++) {
        const pal_support_def *p = &body->support[k];
        const double kind[] = {p->lowest, p->rim, p->lowest ? p->fraction : 0};
        sum = add_numbers(sum, kind, 3);
        if (!p->lowest && !p->rim) sum = add_numbers(add_numbers(sum, p->low_m, 3), p->high_m, 3);
    }
    for (int k = 0; k < body->n_stroke; k++) {
        const pal_stroke *p = &body->stroke[k];
        const double kind[] = {p->radius_m, p->soft, p->young_factor, p->density_factor};
        sum = add_numbers(add_numbers(sum, p->at_m, 3), kind, 4);
    }
    for (int k = 0; k < body->n_effect; k++) sum = add_effect(sum, &body->effect[k]);
    snprintf(out, PAL_STUDY_SHAPE, "%016" PRIx64, sum);
    return out;
}

pal_err pal_study_stem(const char *word, const char *folder, char out[PAL_STUDY_PATH], pal_diagnostic *diag)
{
    struct stat facts;
    const char *slash = strrchr(word, '/'), *name = slash ? slash + 1 : word, *dot = strchr(name, '.');
    int stem = dot && dot > name ? (int)(dot - word) : (int)strlen(word), n;
    while (!folder && stem > 1 && word[stem - 1] == '/') stem--;
    if (folder)
        n = snprintf(out, PAL_STUDY_PATH, "%s/study", folder);
    else if (stat(word, &facts) == 0 && S_ISDIR(facts.st_mode))
        n = snprintf(out, PAL_STUDY_PATH, "%s/study", word);
    else if (!strcmp(name, "scene.json"))
        n = snprintf(out, PAL_STUDY_PATH, "%.*sstudy", (int)(name - word), word);
    else
        n = snprintf(out, PAL_STUDY_PATH, "%.*s_study", stem, word);
    /* room for a file ending */
    if (n < 0 || n + 8 >= PAL_STUDY_PATH)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%.80s...: the path is too long", folder ? folder : word);
    return PAL_ERR_OK;
}

/* ---- writing ---- */

static void put_number(cJSON *object, const char *key, double value)
{
    cJSON_AddItemToObject(object, key, pal_json_exact(value));
}

static void put_point(cJSON *list, const pal_study_point *p)
{
    cJSON *o = cJSON_CreateObject();
    cJSON_AddItemToArray(list, o);
    for (int k = 0; k < N_TEXT; k++) cJSON_AddStringToObject(o, text[k].key, text_at(p, k));
    for (int k = 0; k < N_NUMBER; k++) put_number(o, number[k].key, *number_at(p, k));
    put_number(o, "size", p->measured.setting.size);
    put_number(o, "nodes", p->n_node);
    put_number(o, "substeps", p->n_substep);
    cJSON_AddBoolToObject(o, "front", p->measured.front);
    cJSON_AddStringToObject(o, "err", pal_err_name(p->err));
}

cJSON *pal_study_file_tree(const pal_study_file *file)
{
    const pal_study *s = &file->study;
    cJSON *root = cJSON_CreateObject(), *of;
    cJSON_AddStringToObject(root, "format", format);
    cJSON_AddStringToObject(root, "name", s->name);
    cJSON_AddStringToObject(root, "machine", s->machine);
    cJSON_AddStringToObject(root, "reference", s->reference);
    put_number(root, "reference_m", s->reference_m);
    put_number(root, "max_m", s->max_m);
    put_number(root, "length_scale_m", s->length_scale_m);
    put_number(root, "step_s", s->step_s);
    of = cJSON_AddObjectToObject(root, "subject");
    cJSON_AddStringToObject(of, "body", file->body);
    put_number(of, "index", file->index);
    cJSON_AddStringToObject(of, "shape", file->shape);
    cJSON_AddStringToObject(of, "loads", file->loads);
    cJSON_AddStringToObject(of, "digest", file->digest);
    cJSON_AddStringToObject(of, "methods", file->methods);
    cJSON_AddStringToObject(root, "command", file->command);
    put_number(root, "n_finest", file->n_finest);
    cJSON_AddBoolToObject(root, "complete", file->whole);
    cJSON *points = cJSON_AddArrayToObject(root, "points");
    for (int k = 0; k < s->n_point; k++) put_point(points, &s->point[k]);
    return root;
}

pal_err pal_study_file_write(const pal_study_file *file, const char *path, pal_diagnostic *diag)
{
    cJSON *root = pal_study_file_tree(file);
    char *json = root ? cJSON_Print(root) : NULL;
    cJSON_Delete(root);
    if (!json) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its text", path);
    size_t n = strlen(json);
    pal_err err = n > PAL_JSON_MAX_BYTES
                      ? pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: would have %zu bytes, more than %d", path, n,
                                           PAL_JSON_MAX_BYTES)
                      : pal_file_write(path, json, n, diag);
    cJSON_free(json);
    return err;
}

/* "a ""word""" */
static void put_cell(FILE *to, const char *word)
{
    fputc('"', to);
    for (; *word; word++) {
        if (*word == '"') fputc('"', to);
        fputc(*word, to);
    }
    fputc('"', to);
}

static void put_row(FILE *to, const pal_study_point *p)
{
    for (int k = 0; k < N_TEXT; k++) {
        put_cell(to, text_at(p, k));
        fputc(',', to);
    }
    fprintf(to, "%s,%d,%d,%d,%d", pal_err_name(p->err), p->measured.setting.size, p->n_node, p->n_substep,
            p->measured.front);
    for (int k = 0; k < N_NUMBER; k++) {
        double value = *number_at(p, k);
        if (isfinite(value))
            fprintf(to, ",%.17g", value);
        else
            fputc(',', to);
    }
    fputc('\n', to);
}

pal_err pal_study_file_csv(const pal_study_file *file, const char *path, pal_diagnostic *diag)
{
    char *bytes = NULL;
    size_t n_byte = 0;
    int order[PAL_STUDY_POINTS];
    FILE *to = open_memstream(&bytes, &n_byte);
    if (!to) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a table", path);
    for (int k = 0; k < N_TEXT; k++) fprintf(to, "%s,", text[k].key);
    fputs("err,size,nodes,substeps,front", to);
    for (int k = 0; k < N_NUMBER; k++) fprintf(to, ",%s", number[k].key);
    fputc('\n', to);
    pal_study_order(&file->study, order);
    for (int k = 0; k < file->study.n_point; k++) put_row(to, &file->study.point[order[k]]);
    bool whole = !ferror(to);
    whole = fclose(to) == 0 && whole;
    pal_err err = whole ? pal_file_write(path, bytes, n_byte, diag)
                        : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a table", path);
    free(bytes);
    return err;
}

/* ---- reading ---- */

static pal_err need(const pal_json *json, const cJSON *object, const char *path, const char *key)
{
    char at[PAL_JSON_PATH];
    if (cJSON_GetObjectItemCaseSensitive(object, key)) return PAL_ERR_OK;
    return pal_json_refuse(json, pal_json_key(at, path, key), "is not there");
}

/* null is NaN where allowed */
static pal_err get_number(const pal_json *json, const cJSON *object, const char *path, const number_key *k, void *out)
{
    double value = k->late ? 0 : (double)NAN;
    if (!k->late) PAL_TRY(need(json, object, path, k->key));
    if (!k->hole || !cJSON_IsNull(cJSON_GetObjectItemCaseSensitive(object, k->key)))
        PAL_TRY(pal_json_number(json, object, path, k->key, k->low, k->high, &value));
    memcpy(out, &value, sizeof value);
    return PAL_ERR_OK;
}

static pal_err get_count(const pal_json *json, const cJSON *object, const char *path, const char *key, int low,
                         int high, int *out)
{
    PAL_TRY(need(json, object, path, key));
    return pal_json_count(json, object, path, key, low, high, out);
}

static pal_err get_text(const pal_json *json, const cJSON *object, const char *path, const char *key, bool may_be_empty,
                        char *out, size_t n_byte)
{
    PAL_TRY(need(json, object, path, key));
    return pal_json_text(json, object, path, key, may_be_empty, out, n_byte);
}

static pal_err get_bool(const pal_json *json, const cJSON *object, const char *path, const char *key, bool *out)
{
    PAL_TRY(need(json, object, path, key));
    return pal_json_bool(json, object, path, key, out);
}

static pal_err get_err(const pal_json *json, const cJSON *object, const char *path, pal_err *out)
{
    char at[PAL_JSON_PATH], word[32] = "";
    PAL_TRY(get_text(json, object, path, "err", false, word, sizeof word));
    for (int k = 0; k < PAL_ERR_COUNT; k++)
        if (!strcmp(word, pal_err_name((pal_err)k))) {
            *out = (pal_err)k;
            return PAL_ERR_OK;
        }
    return pal_json_refuse(json, pal_json_key(at, path, "err"), "\"%s\" is no error code", word);
}

static pal_err get_point(const pal_json *json, const cJSON *object, const char *path, pal_study_point *out)
{
    const char *known[N_TEXT + N_NUMBER + 6] = {"size", "nodes", "substeps", "front", "err"};
    char at[PAL_JSON_PATH];
    for (int k = 0; k < N_TEXT; k++) known[5 + k] = text[k].key;
    for (int k = 0; k < N_NUMBER; k++) known[5 + N_TEXT + k] = number[k].key;
    PAL_TRY(pal_json_object(json, object, path, known));
    for (int k = 0; k < N_TEXT; k++)
        PAL_TRY(
            get_text(json, object, path, text[k].key, text[k].may_be_empty, (char *)out + text[k].at, text[k].n_byte));
    for (int k = 0; k < N_NUMBER; k++) PAL_TRY(get_number(json, object, path, &number[k], (char *)out + number[k].at));
    PAL_TRY(get_count(json, object, path, "size", -1, 1024, &out->measured.setting.size));
    PAL_TRY(get_count(json, object, path, "nodes", 0, 1 << 30, &out->n_node));
    PAL_TRY(get_count(json, object, path, "substeps", 0, 1 << 30, &out->n_substep));
    PAL_TRY(get_bool(json, object, path, "front", &out->measured.front));
    PAL_TRY(get_err(json, object, path, &out->err));
    bool measured = isfinite(out->measured.ms) && isfinite(out->measured.error_m);
    if (out->measured.front && !measured)
        return pal_json_refuse(json, pal_json_key(at, path, "front"), "is true of a setting that was not measured");
    return PAL_ERR_OK;
}

static pal_err get_of(const pal_json *json, const cJSON *root, pal_study_file *file)
{
    static const char *const known[] = {"body", "index", "shape", "loads", "digest", "methods", NULL};
    PAL_TRY(need(json, root, "", "subject"));
    const cJSON *of = cJSON_GetObjectItemCaseSensitive(root, "subject");
    PAL_TRY(pal_json_object(json, of, "subject", known));
    PAL_TRY(get_text(json, of, "subject", "body", true, file->body, sizeof file->body));
    PAL_TRY(get_count(json, of, "subject", "index", 0, PAL_BODY_MAX - 1, &file->index));
    PAL_TRY(get_text(json, of, "subject", "shape", false, file->shape, sizeof file->shape));
    PAL_TRY(get_text(json, of, "subject", "loads", true, file->loads, sizeof file->loads));
    PAL_TRY(get_text(json, of, "subject", "digest", true, file->digest, sizeof file->digest));
    return get_text(json, of, "subject", "methods", true, file->methods, sizeof file->methods);
}

static pal_err get_points(const pal_json *json, const cJSON *root, pal_study *s)
{
    char path[PAL_JSON_PATH];
    const cJSON *list;
    PAL_TRY(need(json, root, "", "points"));
    PAL_TRY(pal_json_list(json, root, "", "points", PAL_STUDY_POINTS, &list));
    for (const cJSON *child = list->child; child; child = child->next, s->n_point++)
        PAL_TRY(get_point(json, child, pal_json_entry(path, "points", s->n_point), &s->point[s->n_point]));
    return PAL_ERR_OK;
}

static pal_err get_file(const pal_json *json, const cJSON *root, pal_study_file *file)
{
    static const char *const known[] = {"format",   "name",           "machine", "reference", "reference_m",
                                        "max_m",    "length_scale_m", "step_s",  "subject",   "command",
                                        "n_finest", "complete",       "points",  NULL};
    static const number_key own[] = {{"reference_m", offsetof(pal_study, reference_m), 0, 1e300, true, false},
                                     {"max_m", offsetof(pal_study, max_m), 0, 1e300, true, false},
                                     {"length_scale_m", offsetof(pal_study, length_scale_m), 0, 1e300, true, false},
                                     {"step_s", offsetof(pal_study, step_s), 0, 0.1, false, false}};
    pal_study *s = &file->study;
    char word[32] = "";
    PAL_TRY(pal_json_object(json, root, "", known));
    PAL_TRY(get_text(json, root, "", "format", false, word, sizeof word));
    if (strcmp(word, format) != 0) return pal_json_refuse(json, "format", "is \"%s\", wanted \"%s\"", word, format);
    PAL_TRY(get_text(json, root, "", "name", true, s->name, sizeof s->name));
    PAL_TRY(get_text(json, root, "", "machine", true, s->machine, sizeof s->machine));
    PAL_TRY(get_text(json, root, "", "reference", true, s->reference, sizeof s->reference));
    for (size_t k = 0; k < sizeof own / sizeof *own; k++)
        PAL_TRY(get_number(json, root, "", &own[k], (char *)s + own[k].at));
    PAL_TRY(get_of(json, root, file));
    PAL_TRY(get_text(json, root, "", "command", true, file->command, sizeof file->command));
    PAL_TRY(get_count(json, root, "", "n_finest", 0, PAL_STUDY_POINTS, &file->n_finest));
    PAL_TRY(get_bool(json, root, "", "complete", &file->whole));
    return get_points(json, root, s);
}

pal_err pal_study_file_parse(const char *name, const char *bytes, size_t n_byte, pal_study_file **out,
                             pal_diagnostic *diag)
{
    pal_json json = {name, diag};
    cJSON *root;
    PAL_TRY(pal_json_parse(&json, bytes, n_byte, &root));
    pal_study_file *file = calloc(1, sizeof *file);
    pal_err err = file ? get_file(&json, root, file) : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", name);
    cJSON_Delete(root);
    if (err)
        free(file);
    else
        *out = file;
    return err;
}

pal_err pal_study_file_read(const char *path, pal_study_file **out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, PAL_JSON_MAX_BYTES, &bytes, &n_byte, diag));
    pal_err err = pal_study_file_parse(path, (const char *)bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

/* ---- lists ---- */

static bool is_before(const pal_study_point *a, const pal_study_point *b)
{
    if (isnan(a->measured.ms) || isnan(b->measured.ms)) return !isnan(a->measured.ms) && isnan(b->measured.ms);
    return a->measured.ms < b->measured.ms;
}

void pal_study_order(const pal_study *study, int *out)
{
    /* insertion sort: equal elements keep their order */
    for (int k = 0; k < study->n_point; k++) {
        int at = k;
        for (; at > 0 && is_before(&study->point[k], &study->point[out[at - 1]]); at--) out[at] = out[at - 1];
        out[at] = k;
    }
}

int pal_study_configurations(const pal_study *study, pal_measured_configuration *out)
{
    int order[PAL_STUDY_POINTS], n = 0;
    pal_study_order(study, order);
    for (int k = 0; k < study->n_point; k++) {
        const pal_study_point *p = &study->point[order[k]];
        if (p->err || !isfinite(p->measured.ms) || !isfinite(p->measured.error_m)) continue;
        out[n] = p->measured;
        if (out[n].setting.step_s == 0) out[n].setting.step_s = study->step_s;
        n++;
    }
    return n;
}

bool pal_study_method_in(const char *methods, const char *model)
{
    size_t n = strlen(model);
    for (const char *at = methods; *at;) {
        size_t length = strcspn(at, ",");
        if (length == n && !strncmp(at, model, n)) return true;
        at += length + (at[length] == ',');
    }
    return methods[0] == 0;
}
