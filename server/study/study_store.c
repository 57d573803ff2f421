/* Studies as JSON and CSV. Every point has the same keys; a table maps them to struct members. */
#include "server/study/study_store.h"

#include "server/mesh/files/file_bytes.h"
#include "server/scene/json_reader.h"
#include "server/sim/core/effect_list.h"

#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char format[] = "palpate-study-1";

/* A member of a struct as JSON. COUNT: int; CODE: pal_err by name; the others: double. null is NaN where allowed.
 * Studies stored before an optional key existed read as 0, or NaN where null is allowed. */
typedef enum field_kind {
    TEXT,
    TEXT_OR_EMPTY,
    COUNT,
    FLAG,
    CODE,
    NUMBER,
    NUMBER_OR_NULL,
    NUMBER_OPTIONAL,
    NUMBER_OPTIONAL_OR_NULL
} field_kind;
typedef struct field {
    const char *key;
    field_kind kind;
    size_t at, n_byte;
    double low, high; /* accepted range of a number */
} field;
#define AT(type, member) offsetof(type, member), sizeof((type *)0)->member
#define POINT(member)    AT(pal_study_point, member)
#define FILE_AT(member)  AT(pal_study_file, member)
/* in the order of the table's columns */
static const field point_field[] = {
    {"model", TEXT, POINT(measured.configuration.model), 0, 0},
    {"element", TEXT_OR_EMPTY, POINT(measured.configuration.element), 0, 0},
    {"law", TEXT_OR_EMPTY, POINT(measured.configuration.law), 0, 0},
    {"solver", TEXT_OR_EMPTY, POINT(measured.configuration.solver), 0, 0},
    {"reason", TEXT_OR_EMPTY, POINT(reason), 0, 0},
    {"err", CODE, POINT(err), 0, 0},
    {"size", COUNT, POINT(measured.configuration.size), -1, 1024},
    {"nodes", COUNT, POINT(n_node), 0, 1 << 30},
    {"substeps", COUNT, POINT(n_substep), 0, 1 << 30},
    {"front", FLAG, POINT(measured.front), 0, 0},
    {"step_s", NUMBER, POINT(measured.configuration.step_s), 0, 0.1},
    {"tolerance", NUMBER, POINT(measured.configuration.tolerance), 0, 1},
    {"k_distance_J", NUMBER, POINT(measured.configuration.k_distance_J), 0, 1e300},
    {"k_area_J", NUMBER, POINT(measured.configuration.k_area_J), -1, 1e300},
    {"k_volume_J", NUMBER, POINT(measured.configuration.k_volume_J), 0, 1e300},
    {"ms", NUMBER_OR_NULL, POINT(measured.ms), 0, 1e12},
    {"error_m", NUMBER_OR_NULL, POINT(measured.error_m), 0, 1e300},
    {"ms_p95", NUMBER_OR_NULL, POINT(ms_p95), 0, 1e12},
    {"static_rms_m", NUMBER_OR_NULL, POINT(static_rms_m), 0, 1e300},
    {"static_max_m", NUMBER_OR_NULL, POINT(static_max_m), 0, 1e300},
    {"trajectory_rms_m", NUMBER_OR_NULL, POINT(trajectory_rms_m), 0, 1e300},
    {"trajectory_max_m", NUMBER_OR_NULL, POINT(trajectory_max_m), 0, 1e300},
    {"force_rms_0_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_rms_N[0]), 0, 1e300},
    {"force_rms_50_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_rms_N[1]), 0, 1e300},
    {"force_rms_200_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_rms_N[2]), 0, 1e300},
    {"force_rms_50_30Hz_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_rms_N[3]), 0, 1e300},
    {"force_max_0_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_max_N[0]), 0, 1e300},
    {"force_max_50_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_max_N[1]), 0, 1e300},
    {"force_max_200_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_max_N[2]), 0, 1e300},
    {"force_max_50_30Hz_N", NUMBER_OPTIONAL_OR_NULL, POINT(force_max_N[3]), 0, 1e300},
    {"prepare_s", NUMBER_OR_NULL, POINT(prepare_s), 0, 1e12},
    {"elements", NUMBER_OPTIONAL, POINT(n_element), 0, 1e12},
    {"read_ms", NUMBER_OPTIONAL, POINT(read_ms), 0, 1e12},
    {"predicted_ms", NUMBER_OR_NULL, POINT(predicted_ms), 0, 1e300},
    {"predicted_m", NUMBER_OR_NULL, POINT(predicted_m), 0, 1e300},
};
static const field subject_field[] = {
    {"body", TEXT_OR_EMPTY, FILE_AT(body), 0, 0},
    {"index", COUNT, FILE_AT(index), 0, PAL_BODY_MAX - 1},
    {"shape", TEXT, FILE_AT(shape), 0, 0},
    {"loads", TEXT_OR_EMPTY, FILE_AT(loads), 0, 0},
    {"digest", TEXT_OR_EMPTY, FILE_AT(digest), 0, 0},
    {"methods", TEXT_OR_EMPTY, FILE_AT(methods), 0, 0},
};
static const field file_field[] = {
    {"name", TEXT_OR_EMPTY, FILE_AT(study.name), 0, 0},
    {"machine", TEXT_OR_EMPTY, FILE_AT(study.machine), 0, 0},
    {"reference", TEXT_OR_EMPTY, FILE_AT(study.reference), 0, 0},
    {"reference_m", NUMBER_OR_NULL, FILE_AT(study.reference_m), 0, 1e300},
    {"max_m", NUMBER_OR_NULL, FILE_AT(study.max_m), 0, 1e300},
    {"max_force_N", NUMBER_OPTIONAL_OR_NULL, FILE_AT(study.max_force_N), 0, 1e300},
    {"reference_force_N", NUMBER_OPTIONAL_OR_NULL, FILE_AT(study.reference_force_N), 0, 1e300},
    {"length_scale_m", NUMBER_OR_NULL, FILE_AT(study.length_scale_m), 0, 1e300},
    {"step_s", NUMBER, FILE_AT(study.step_s), 0, 0.1},
    {"command", TEXT_OR_EMPTY, FILE_AT(command), 0, 0},
    {"n_total", COUNT, FILE_AT(n_total), 0, PAL_STUDY_POINTS},
    {"complete", FLAG, FILE_AT(whole), 0, 0},
};
enum {
    N_POINT = sizeof point_field / sizeof *point_field,
    N_SUBJECT = sizeof subject_field / sizeof *subject_field,
    N_FILE = sizeof file_field / sizeof *file_field
};

/* ---- identity of the study ---- */

uint64_t pal_study_digest_numbers(uint64_t sum, const double *value, size_t n)
{
    return value ? pal_hash_bytes(sum, value, n * sizeof *value) : pal_hash_bytes(sum, "-", 1);
}

static uint64_t add_region(uint64_t sum, const pal_region *r)
{
    const double own[] = {r->kind, r->is, r->young_Pa, r->poisson, r->density_kg_m3, r->n[0], r->n[1], r->n[2]};
    size_t n = (size_t)r->n[0] * (size_t)r->n[1] * (size_t)r->n[2];
    sum = pal_study_digest_numbers(sum, own, sizeof own / sizeof *own);
    if (r->kind != PAL_REGION_LABEL)
        sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, r->low_m, 3), r->high_m, 3);
    if (r->kind == PAL_REGION_LABEL) {
        sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, r->low_m, 3), r->spacing_m, 3);
        if (r->label) sum = pal_hash_bytes(sum, r->label, n);
    }
    if (r->kind != PAL_REGION_GRID) return sum;
    sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, r->grid_young_Pa, n), r->grid_poisson, n);
    return pal_study_digest_numbers(sum, r->grid_density_kg_m3, n);
}

uint64_t pal_study_digest_load(uint64_t sum, const pal_problem_load *l)
{
    const double kind[] = {l->kind, l->region.all, l->has_normal, l->has_traction, l->has_total};
    sum = pal_study_digest_numbers(sum, kind, sizeof kind / sizeof *kind);
    if (l->kind == PAL_LOAD_POINT)
        return pal_study_digest_numbers(pal_study_digest_numbers(sum, l->point_m, 3), l->force_N, 3);
    if (l->kind == PAL_LOAD_GRAVITY) return pal_study_digest_numbers(sum, l->gravity_m_s2, 3);
    if (!l->region.all)
        sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, l->region.low_m, 3), l->region.high_m, 3);
    if (l->has_normal) sum = pal_study_digest_numbers(sum, l->normal, 3);
    if (l->has_traction) sum = pal_study_digest_numbers(sum, l->traction_Pa, 3);
    return l->has_total ? pal_study_digest_numbers(sum, l->total_N, 3) : sum;
}

/* all effects but guards and tools, which do not move an untouched body */
static uint64_t add_effect(uint64_t sum, const pal_config_entry *item)
{
    const pal_effect *effect = pal_effect_find(item->name);
    if (effect && (effect->stage == PAL_STAGE_GUARD || effect->sleep.reach_m)) return sum;
    sum = pal_hash_bytes(sum, item->name, strlen(item->name));
    for (int k = 0; k < item->n_value; k++) {
        const pal_config_value *v = &item->value[k];
        sum = pal_hash_bytes(pal_hash_bytes(sum, v->key, strlen(v->key)), v->text, strlen(v->text));
        sum = pal_study_digest_numbers(sum, v->number, (size_t)(v->kind == PAL_VALUE_NUMBER ? 1 : v->n_number));
        sum = pal_study_digest_numbers(sum, &(double){v->flag}, 1);
    }
    return sum;
}

const char *pal_study_shape(const pal_body_def *body, char out[PAL_STUDY_SHAPE])
{
    uint64_t sum = PAL_HASH_START;
    const pal_material *m = &body->material;
    /* a damping that is derived counts as its cap: it changes neither rest nor cost */
    const double own[] = {m->young_Pa,    m->poisson,      m->density_kg_m3, pal_material_damping_1_s(m, 0),
                          body->n_region, body->n_support, body->n_stroke};
    const pal_surface *s = &body->mesh->surface;
    sum = pal_study_digest_numbers(sum, own, sizeof own / sizeof *own);
    sum = pal_hash_bytes(sum, s->tri, 3 * (size_t)s->n_tri * sizeof *s->tri);
    sum = pal_hash_bytes(sum, s->x, 3 * (size_t)s->n_vertex * sizeof *s->x);
    if (body->cells) sum = pal_study_digest_numbers(sum, body->cells->x, 3 * (size_t)body->cells->n_vertex);
    for (int k = 0; k < body->n_region; k++) sum = add_region(sum, &body->region[k]);
    for (int k = 0; k < body->n_support; k++) {
        const pal_support_def *p = &body->support[k];
        const double kind[] = {p->lowest, p->rim, p->lowest ? p->fraction : 0};
        sum = pal_study_digest_numbers(sum, kind, 3);
        if (!p->lowest && !p->rim)
            sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, p->low_m, 3), p->high_m, 3);
    }
    for (int k = 0; k < body->n_stroke; k++) {
        const pal_stroke *p = &body->stroke[k];
        const double kind[] = {p->radius_m, p->softness, p->young_factor, p->density_factor};
        sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, p->at_m, 3), kind, 4);
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
        return PAL_REFUSE(diag, "%.80s...: the path is too long", folder ? folder : word);
    return PAL_ERR_OK;
}

/* ---- writing ---- */

static void put_fields(cJSON *object, const field *f, int n, const void *from)
{
    for (int k = 0; k < n; k++, f++) {
        const void *at = (const char *)from + f->at;
        if (f->kind >= NUMBER)
            cJSON_AddItemToObject(object, f->key, pal_json_exact(*(const double *)at));
        else if (f->kind == COUNT)
            cJSON_AddItemToObject(object, f->key, pal_json_exact(*(const int *)at));
        else if (f->kind == FLAG)
            cJSON_AddBoolToObject(object, f->key, *(const bool *)at);
        else
            cJSON_AddStringToObject(object, f->key, f->kind == CODE ? pal_err_name(*(const pal_err *)at) : at);
    }
}

cJSON *pal_study_file_tree(const pal_study_file *file)
{
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "format", format);
    put_fields(root, file_field, N_FILE, file);
    put_fields(cJSON_AddObjectToObject(root, "subject"), subject_field, N_SUBJECT, file);
    cJSON *points = cJSON_AddArrayToObject(root, "points");
    for (int k = 0; k < file->study.n_point; k++) {
        cJSON *point = cJSON_CreateObject();
        cJSON_AddItemToArray(points, point);
        put_fields(point, point_field, N_POINT, &file->study.point[k]);
    }
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
                      ? PAL_REFUSE(diag, "%s: would have %zu bytes, more than %d", path, n, PAL_JSON_MAX_BYTES)
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
    for (int k = 0; k < N_POINT; k++) {
        const field *f = &point_field[k];
        const void *at = (const char *)p + f->at;
        if (k > 0) fputc(',', to);
        if (f->kind == TEXT || f->kind == TEXT_OR_EMPTY)
            put_cell(to, at);
        else if (f->kind == CODE)
            fputs(pal_err_name(*(const pal_err *)at), to);
        else if (f->kind == COUNT)
            fprintf(to, "%d", *(const int *)at);
        else if (f->kind == FLAG)
            fprintf(to, "%d", *(const bool *)at);
        else if (isfinite(*(const double *)at))
            fprintf(to, "%.17g", *(const double *)at);
    }
    fputc('\n', to);
}

pal_err pal_study_file_csv(const pal_study_file *file, const char *path, pal_diagnostic *diag)
{
    int order[PAL_STUDY_POINTS];
    pal_file_out out;
    PAL_TRY(pal_file_begin(&out, path, diag));
    for (int k = 0; k < N_POINT; k++) fprintf(out.file, "%s%s", k ? "," : "", point_field[k].key);
    fputc('\n', out.file);
    pal_study_order(&file->study, order);
    for (int k = 0; k < file->study.n_point; k++) put_row(out.file, &file->study.point[order[k]]);
    return pal_file_end(&out, diag);
}

/* ---- reading ---- */

static pal_err need(const pal_json *object, const char *key)
{
    return pal_json_has(object, key) ? PAL_ERR_OK : pal_json_refuse_key(object, key, "is not there");
}

static pal_err get_code(const pal_json *object, const char *key, pal_err *out)
{
    char word[32] = "";
    PAL_TRY(pal_json_text(object, key, false, word, sizeof word));
    for (int k = 0; k < PAL_ERR_COUNT; k++)
        if (!strcmp(word, pal_err_name((pal_err)k))) {
            *out = (pal_err)k;
            return PAL_ERR_OK;
        }
    return pal_json_refuse_key(object, key, "\"%s\" is no error code", word);
}

static pal_err get_field(const pal_json *object, const field *f, void *at)
{
    const bool optional = f->kind == NUMBER_OPTIONAL || f->kind == NUMBER_OPTIONAL_OR_NULL;
    const bool null = f->kind == NUMBER_OR_NULL || f->kind == NUMBER_OPTIONAL_OR_NULL;
    if (!optional) PAL_TRY(need(object, f->key));
    switch (f->kind) {
    case CODE:
        return get_code(object, f->key, at);
    case COUNT:
        return pal_json_count(object, f->key, (int)f->low, (int)f->high, at);
    case FLAG:
        return pal_json_bool(object, f->key, at);
    case TEXT:
    case TEXT_OR_EMPTY:
        return pal_json_text(object, f->key, f->kind == TEXT_OR_EMPTY, at, f->n_byte);
    default:
        if (!null || (pal_json_has(object, f->key) && !cJSON_IsNull(pal_json_at(object, f->key).value)))
            return pal_json_number(object, f->key, f->low, f->high, at);
        *(double *)at = NAN;
        return PAL_ERR_OK;
    }
}

/* reads the fields of an object, whose other keys, NULL-terminated, are read elsewhere */
static pal_err get_fields(const pal_json *object, const char *const *other, const field *f, int n, void *out)
{
    const char *known[PAL_JSON_KEYS] = {0};
    int n_known = 0;
    for (; *other; other++) known[n_known++] = *other;
    for (int k = 0; k < n; k++) known[n_known++] = f[k].key;
    PAL_TRY(pal_json_object(object, known));
    for (int k = 0; k < n; k++) PAL_TRY(get_field(object, &f[k], (char *)out + f[k].at));
    return PAL_ERR_OK;
}

static pal_err get_points(const pal_json *root, pal_study *s)
{
    static const char *const none[] = {NULL};
    pal_json list;
    PAL_TRY(need(root, "points"));
    PAL_TRY(pal_json_list(root, "points", PAL_STUDY_POINTS, &list));
    PAL_JSON_EACH (child, &list) {
        pal_study_point *p = &s->point[s->n_point];
        const pal_json at = pal_json_entry(&list, s->n_point, child);
        PAL_TRY(get_fields(&at, none, point_field, N_POINT, p));
        if (p->measured.front && !(isfinite(p->measured.ms) && isfinite(p->measured.error_m)))
            return pal_json_refuse_key(&at, "front", "is true of a configuration that was not measured");
        s->n_point++;
    }
    return PAL_ERR_OK;
}

static pal_err get_file(const pal_json *root, pal_study_file *file)
{
    static const char *const other[] = {"format", "subject", "points", NULL}, *const none[] = {NULL};
    const pal_json subject = pal_json_at(root, "subject");
    char word[32] = "";
    PAL_TRY(get_fields(root, other, file_field, N_FILE, file));
    PAL_TRY(need(root, "format"));
    PAL_TRY(pal_json_text(root, "format", false, word, sizeof word));
    if (strcmp(word, format) != 0) return pal_json_refuse_key(root, "format", "is \"%s\", wanted \"%s\"", word, format);
    PAL_TRY(need(root, "subject"));
    PAL_TRY(get_fields(&subject, none, subject_field, N_SUBJECT, file));
    return get_points(root, &file->study);
}

pal_err pal_study_file_parse(const char *name, const char *bytes, size_t n_byte, pal_study_file **out,
                             pal_diagnostic *diag)
{
    pal_json json = {.file = name, .diag = diag};
    cJSON *root;
    PAL_TRY(pal_json_parse(&json, bytes, n_byte, &root));
    pal_study_file *file = calloc(1, sizeof *file);
    pal_err err = file ? get_file(&json, file) : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", name);
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

void pal_study_order(const pal_study *study, int *out)
{
    /* insertion sort: equal elements keep their order */
    for (int k = 0; k < study->n_point; k++) {
        int at = k;
        double ms = study->point[k].measured.ms;
        for (; at > 0; out[at] = out[at - 1], at--) {
            double before = study->point[out[at - 1]].measured.ms;
            if (isnan(before) ? isnan(ms) : !(ms < before)) break;
        }
        out[at] = k;
    }
}

int pal_study_configurations(const pal_study *study, pal_measured_configuration *out)
{
    int order[PAL_STUDY_POINTS], n = 0;
    pal_study_order(study, order);
    for (int k = 0; k < study->n_point; k++) {
        const pal_study_point *p = &study->point[order[k]];
        if (!pal_study_measured(p)) continue;
        out[n] = p->measured;
        const double force = 100 * p->force_rms_N[1] / study->max_force_N;
        out[n].force_percent = isfinite(force) ? force : 0;
        if (out[n].configuration.step_s == 0) out[n].configuration.step_s = study->step_s;
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
