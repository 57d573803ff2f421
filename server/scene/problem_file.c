/* JSON -> pal_problem, key by key: problem_file.h is the format. Each kind of entry has one function that first refuses
 * unknown keys and then reads its own. */
#include "server/scene/problem_file.h"

#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* what every function reads from; path is the entry's own */
typedef struct reader {
    pal_json json;
    const char *folder;
    pal_problem *out;
} reader;

static const double length_max = 1e9; /* m, of any coordinate: a body's frame is single precision on the wire */

/* ---- kinds of values ---- */

static bool has(const cJSON *object, const char *key)
{
    return cJSON_GetObjectItemCaseSensitive(object, key) != NULL;
}

/* the first key of a NULL-terminated list that is not there is refused */
static pal_err need(const reader *r, const cJSON *object, const char *path, const char *const *keys)
{
    char at[PAL_JSON_PATH];
    for (; *keys; keys++)
        if (!has(object, *keys)) return pal_json_refuse(&r->json, pal_json_key(at, path, *keys), "is missing");
    return PAL_ERR_OK;
}

/* a vector whose numbers are at most `most`, and that is there */
static pal_err read_vector(const reader *r, const cJSON *object, const char *path, const char *key, double max,
                           double out[3])
{
    char at[PAL_JSON_PATH];
    if (!has(object, key)) return pal_json_refuse(&r->json, pal_json_key(at, path, key), "is missing");
    PAL_TRY(pal_json_vector(&r->json, object, path, key, out));
    for (int c = 0; c < 3; c++)
        if (!(fabs(out[c]) <= max))
            return pal_json_refuse(&r->json, pal_json_key(at, path, key), "number %d, %g, is beyond %g", c + 1, out[c],
                                   max);
    return PAL_ERR_OK;
}

/* informative numbers: any that are finite */
static pal_err check_numbers(const reader *r, const cJSON *object, const char *path, const char *const *keys)
{
    double number = 0;
    for (; *keys; keys++) PAL_TRY(pal_json_number(&r->json, object, path, *keys, -1e300, 1e300, &number));
    return PAL_ERR_OK;
}

static pal_err check_note(const reader *r, const cJSON *object, const char *path)
{
    char text[1024];
    return pal_json_text(&r->json, object, path, "note", true, text, sizeof text);
}

/* one of a NULL-terminated list of words */
static pal_err read_word(const reader *r, const cJSON *object, const char *path, const char *key,
                         const char *const *words, char *out, size_t n_byte)
{
    char at[PAL_JSON_PATH], list[160] = "";
    size_t n = 0;
    PAL_TRY(pal_json_text(&r->json, object, path, key, false, out, n_byte));
    for (int k = 0; words[k]; k++) {
        if (!strcmp(words[k], out)) return PAL_ERR_OK;
        n += (size_t)snprintf(list + n, sizeof list - n, "%s\"%s\"", k ? ", " : "", words[k]);
    }
    return pal_json_refuse(&r->json, pal_json_key(at, path, key), "\"%s\" is not known; known are %s", out, list);
}

/* a file's name: beside the problem unless it is absolute */
static pal_err read_file(const reader *r, const cJSON *object, const char *path, const char *key, char *out,
                         size_t n_byte)
{
    char at[PAL_JSON_PATH], name[512] = "";
    PAL_TRY(pal_json_text(&r->json, object, path, key, false, name, sizeof name));
    int n = name[0] == '/' ? snprintf(out, n_byte, "%s", name) : snprintf(out, n_byte, "%s/%s", r->folder, name);
    if (n < 0 || (size_t)n >= n_byte)
        return pal_json_refuse(&r->json, pal_json_key(at, path, key), "with its folder longer than %zu bytes",
                               n_byte - 1);
    return PAL_ERR_OK;
}

static pal_err read_young(const reader *r, const cJSON *object, const char *path, double *out)
{
    char at[PAL_JSON_PATH];
    PAL_TRY(pal_json_number(&r->json, object, path, "E", -INFINITY, INFINITY, out));
    if (has(object, "E") && !(*out >= PAL_YOUNG_MIN_PA && *out <= PAL_YOUNG_MAX_PA))
        return pal_json_refuse(&r->json, pal_json_key(at, path, "E"), "%g Pa is not a stiffness: wanted %s, %g to %g",
                               *out, *out > 0 ? "less extreme" : "more than 0", PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA);
    return PAL_ERR_OK;
}

static pal_err read_poisson(const reader *r, const cJSON *object, const char *path, double *out)
{
    char at[PAL_JSON_PATH];
    PAL_TRY(pal_json_number(&r->json, object, path, "nu", -INFINITY, INFINITY, out));
    if (has(object, "nu") && !(*out > -1 && *out < 0.5))
        return pal_json_refuse(&r->json, pal_json_key(at, path, "nu"),
                               "%g is not a Poisson ratio: wanted more than -1 and less than 0.5", *out);
    if (has(object, "nu") && *out < PAL_POISSON_MIN)
        return pal_json_refuse(&r->json, pal_json_key(at, path, "nu"), "%g is nearer to -1 than %g", *out,
                               PAL_POISSON_MIN);
    return PAL_ERR_OK;
}

static pal_err read_region(const reader *r, const cJSON *parent, const char *above, pal_box *out)
{
    static const char *const known[] = {"type", "min", "max", "note", NULL}, *const types[] = {"all", "box", NULL};
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH], type[8] = "";
    const cJSON *object = cJSON_GetObjectItemCaseSensitive(parent, "region");
    pal_json_key(path, above, "region");
    if (!object) return pal_json_refuse(&r->json, path, "is missing");
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(read_word(r, object, path, "type", types, type, sizeof type));
    *out = (pal_box){.all = !strcmp(type, "all")};
    if (out->all) {
        const char *extra = has(object, "min") ? "min" : has(object, "max") ? "max" : NULL;
        if (extra) return pal_json_refuse(&r->json, pal_json_key(at, path, extra), "only goes with type \"box\"");
        for (int c = 0; c < 3; c++) out->low_m[c] = -length_max, out->high_m[c] = length_max;
        return PAL_ERR_OK;
    }
    PAL_TRY(read_vector(r, object, path, "min", length_max, out->low_m));
    PAL_TRY(read_vector(r, object, path, "max", length_max, out->high_m));
    for (int c = 0; c < 3; c++)
        if (out->low_m[c] > out->high_m[c])
            return pal_json_refuse(&r->json, path, "min[%d] %g is above max[%d] %g", c, out->low_m[c], c,
                                   out->high_m[c]);
    return PAL_ERR_OK;
}

/* ---- entries ---- */

static pal_err read_material(const reader *r, const cJSON *object, int index)
{
    static const char *const known[] = {"id", "region", "E", "nu", "density", "note", NULL};
    static const char *const needed[] = {"id", "region", "E", "nu", NULL};
    pal_problem_material *m = &r->out->material[index];
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH];
    pal_json_entry(path, "materials", index);
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(need(r, object, path, needed));
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(pal_json_text(&r->json, object, path, "id", false, m->id, sizeof m->id));
    for (int k = 0; k < index; k++)
        if (!strcmp(r->out->material[k].id, m->id))
            return pal_json_refuse(&r->json, pal_json_key(at, path, "id"), "\"%s\" is that of materials[%d] already",
                                   m->id, k);
    PAL_TRY(read_region(r, object, path, &m->region));
    PAL_TRY(read_young(r, object, path, &m->young_Pa));
    PAL_TRY(read_poisson(r, object, path, &m->poisson));
    m->density_kg_m3 = 1000;
    return pal_json_number(&r->json, object, path, "density", PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3,
                           &m->density_kg_m3);
}

static pal_err read_support(const reader *r, const cJSON *object, int index)
{
    static const char *const known[] = {"type", "region", "move", "note", NULL};
    static const char *const types[] = {"fixed", "moved", NULL};
    pal_problem_support *s = &r->out->support[index];
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH], type[16] = "";
    pal_json_entry(path, "supports", index);
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(read_word(r, object, path, "type", types, type, sizeof type));
    PAL_TRY(read_region(r, object, path, &s->region));
    s->moved = !strcmp(type, "moved");
    if (s->moved) return read_vector(r, object, path, "move", length_max, s->move_m);
    if (has(object, "move"))
        return pal_json_refuse(&r->json, pal_json_key(at, path, "move"), "only goes with type \"moved\"");
    return PAL_ERR_OK;
}

/* what is told twice must agree */
static pal_err check_total(const reader *r, const cJSON *object, const char *path, const pal_problem_load *load)
{
    char at[PAL_JSON_PATH];
    double area = 0, off = 0, size = 0;
    PAL_TRY(pal_json_number(&r->json, object, path, "area", 1e-30, 1e30, &area));
    if (!area || !load->has_traction || !load->has_total) return PAL_ERR_OK;
    for (int c = 0; c < 3; c++) {
        off = fmax(off, fabs(area * load->traction_Pa[c] - load->total_N[c]));
        size = fmax(size, fabs(load->total_N[c]));
    }
    if (off > 1e-3 * size)
        return pal_json_refuse(&r->json, pal_json_key(at, path, "total_force"), "%g N off traction times area", off);
    return PAL_ERR_OK;
}

static pal_err read_traction(const reader *r, const cJSON *object, const char *path, pal_problem_load *load)
{
    static const char *const known[] = {"type",        "region", "surface_normal", "traction",
                                        "total_force", "area",   "note",           NULL};
    char at[PAL_JSON_PATH];
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(read_region(r, object, path, &load->region));
    load->has_normal = has(object, "surface_normal");
    load->has_traction = has(object, "traction");
    load->has_total = has(object, "total_force");
    if (load->has_normal) {
        PAL_TRY(read_vector(r, object, path, "surface_normal", 1e9, load->normal));
        double length = pal_norm3(load->normal);
        if (!(length > 1e-9))
            return pal_json_refuse(&r->json, pal_json_key(at, path, "surface_normal"), "has no direction: length %g",
                                   length);
        pal_scale3(load->normal, 1 / length, load->normal);
    }
    if (!load->has_traction && !load->has_total)
        return pal_json_refuse(&r->json, path, "needs traction (Pa) or total_force (N)");
    if (load->has_traction) PAL_TRY(read_vector(r, object, path, "traction", 1e15, load->traction_Pa));
    if (load->has_total) PAL_TRY(read_vector(r, object, path, "total_force", 1e15, load->total_N));
    return check_total(r, object, path, load);
}

static pal_err read_load(const reader *r, const cJSON *object, const char *path, pal_problem_load *load)
{
    static const char *const point[] = {"type", "point", "force", "note", NULL};
    static const char *const gravity[] = {"type", "acceleration", "note", NULL};
    static const char *const types[] = {"dead_traction", "point", "gravity", NULL};
    char type[24] = "";
    *load = (pal_problem_load){.kind = PAL_LOAD_TRACTION};
    PAL_TRY(pal_json_object(&r->json, object, path, NULL));
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(read_word(r, object, path, "type", types, type, sizeof type));
    if (!strcmp(type, "dead_traction")) return read_traction(r, object, path, load);
    if (!strcmp(type, "point")) {
        load->kind = PAL_LOAD_POINT;
        PAL_TRY(pal_json_object(&r->json, object, path, point));
        PAL_TRY(read_vector(r, object, path, "point", length_max, load->point_m));
        return read_vector(r, object, path, "force", 1e15, load->force_N);
    }
    load->kind = PAL_LOAD_GRAVITY;
    PAL_TRY(pal_json_object(&r->json, object, path, gravity));
    return read_vector(r, object, path, "acceleration", 1e9, load->gravity_m_s2);
}

/* the id of a load case or reference, which none before it has */
static pal_err read_id(const reader *r, const cJSON *object, const char *path, char out[PAL_NAME])
{
    char at[PAL_JSON_PATH], id[PAL_NAME] = "";
    pal_json_key(at, path, "id");
    if (!has(object, "id")) return pal_json_refuse(&r->json, at, "is missing");
    PAL_TRY(pal_json_text(&r->json, object, path, "id", false, id, sizeof id));
    if (pal_problem_case_find(r->out, id))
        return pal_json_refuse(&r->json, at, "\"%s\" is that of a load case already", id);
    if (pal_problem_reference_find(r->out, id))
        return pal_json_refuse(&r->json, at, "\"%s\" is that of a reference already", id);
    memcpy(out, id, PAL_NAME);
    return PAL_ERR_OK;
}

static pal_err read_case(const reader *r, const cJSON *object, int index)
{
    static const char *const known[] = {"id", "loads", "note", NULL};
    pal_problem_case *c = &r->out->load_case[index];
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH], entry[PAL_JSON_PATH];
    const cJSON *list;
    pal_json_entry(path, "load_cases", index);
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(read_id(r, object, path, c->id));
    PAL_TRY(pal_json_list(&r->json, object, path, "loads", PAL_PROBLEM_LOADS, &list));
    pal_json_key(at, path, "loads");
    if (!list || !list->child) return pal_json_refuse(&r->json, at, "a load case needs at least one load");
    for (const cJSON *child = list->child; child; child = child->next, c->n_load++)
        PAL_TRY(read_load(r, child, pal_json_entry(entry, at, c->n_load), &c->load[c->n_load]));
    return PAL_ERR_OK;
}

/* {"rms": .., "max": ..} */
static pal_err read_error(const reader *r, const cJSON *parent, const char *above, const char *key, double *rms,
                          double *max)
{
    static const char *const known[] = {"rms", "max", NULL};
    char path[PAL_JSON_PATH];
    const cJSON *object = cJSON_GetObjectItemCaseSensitive(parent, key);
    if (!object) return PAL_ERR_OK;
    pal_json_key(path, above, key);
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(pal_json_number(&r->json, object, path, "rms", 0, 1e9, rms));
    return pal_json_number(&r->json, object, path, "max", 0, 1e9, max);
}

/* what a reference says of itself and nobody computes with */
static pal_err check_origin(const reader *r, const cJSON *object, const char *path)
{
    static const char *const known[] = {"element", "nodes", "elements", "coarser_nodes", "note", NULL};
    static const char *const plain[] = {"points", "max_displacement", "work_f_dot_u", "order_used", NULL};
    char at[PAL_JSON_PATH], text[64];
    double rms, max;
    const cJSON *mesh = cJSON_GetObjectItemCaseSensitive(object, "mesh");
    PAL_TRY(check_note(r, object, path));
    PAL_TRY(check_numbers(r, object, path, plain));
    PAL_TRY(read_error(r, object, path, "difference_two_finest", &rms, &max));
    if (!mesh) return PAL_ERR_OK;
    pal_json_key(at, path, "mesh");
    PAL_TRY(pal_json_object(&r->json, mesh, at, known));
    PAL_TRY(pal_json_text(&r->json, mesh, at, "element", true, text, sizeof text));
    PAL_TRY(check_note(r, mesh, at));
    return check_numbers(r, mesh, at, (const char *const[]){"nodes", "elements", "coarser_nodes", NULL});
}

static pal_err read_reference(const reader *r, const cJSON *object, int index)
{
    static const char *const known[] = {"id",
                                        "file",
                                        "load_case",
                                        "kinematics",
                                        "law",
                                        "E",
                                        "nu",
                                        "estimated_error",
                                        "difference_two_finest",
                                        "mesh",
                                        "points",
                                        "max_displacement",
                                        "work_f_dot_u",
                                        "note",
                                        "order_used",
                                        NULL};
    static const char *const needed[] = {"file", "load_case", "kinematics", "law", NULL};
    static const char *const kinematics[] = {"linear", "finite", NULL};
    static const char *const laws[] = {"hooke", "neo-hookean", "st-venant-kirchhoff", "corotational", NULL};
    pal_problem_reference *ref = &r->out->reference[index];
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH], word[16] = "";
    pal_json_entry(path, "references", index);
    PAL_TRY(pal_json_object(&r->json, object, path, known));
    PAL_TRY(read_id(r, object, path, ref->id));
    PAL_TRY(need(r, object, path, needed));
    PAL_TRY(read_file(r, object, path, "file", ref->file, sizeof ref->file));
    PAL_TRY(pal_json_text(&r->json, object, path, "load_case", false, ref->load_case, sizeof ref->load_case));
    if (!pal_problem_case_find(r->out, ref->load_case))
        return pal_json_refuse(&r->json, pal_json_key(at, path, "load_case"), "there is no load case \"%s\"",
                               ref->load_case);
    PAL_TRY(read_word(r, object, path, "kinematics", kinematics, word, sizeof word));
    PAL_TRY(read_word(r, object, path, "law", laws, ref->law, sizeof ref->law));
    ref->finite = !strcmp(word, "finite");
    if (ref->finite == !strcmp(ref->law, "hooke"))
        return pal_json_refuse(&r->json, pal_json_key(at, path, "law"), "\"%s\" does not go with %s kinematics",
                               ref->law, word);
    ref->young_Pa = ref->poisson = ref->estimated_rms = ref->estimated_max = NAN;
    const char *own = has(object, "E") ? "E" : has(object, "nu") ? "nu" : NULL;
    if (own && r->out->n_material > 1)
        return pal_json_refuse(&r->json, pal_json_key(at, path, own),
                               "the problem has %d materials: which one is meant?", r->out->n_material);
    PAL_TRY(read_young(r, object, path, &ref->young_Pa));
    PAL_TRY(read_poisson(r, object, path, &ref->poisson));
    PAL_TRY(read_error(r, object, path, "estimated_error", &ref->estimated_rms, &ref->estimated_max));
    return check_origin(r, object, path);
}

/* ---- the root ---- */

static pal_err check_units(const reader *r, const cJSON *root)
{
    static const char *const known[] = {"length", "force", "stress", "density", "note", NULL};
    static const char *const unit[] = {"m", "N", "Pa", "kg/m^3"};
    char at[PAL_JSON_PATH], text[32];
    const cJSON *object = cJSON_GetObjectItemCaseSensitive(root, "units");
    if (!object) return PAL_ERR_OK;
    PAL_TRY(pal_json_object(&r->json, object, "units", known));
    PAL_TRY(check_note(r, object, "units"));
    for (int k = 0; k < 4; k++) {
        snprintf(text, sizeof text, "%s", unit[k]);
        PAL_TRY(pal_json_text(&r->json, object, "units", known[k], false, text, sizeof text));
        if (strcmp(text, unit[k]))
            return pal_json_refuse(&r->json, pal_json_key(at, "units", known[k]), "\"%s\": only \"%s\" is taken%s",
                                   text, unit[k], k ? "" : " (surface_unit is for the surface file alone)");
    }
    return PAL_ERR_OK;
}

static pal_err check_frequencies(const reader *r, const cJSON *root)
{
    static const char *const known[] = {"nu", "density", "E", "hz", "note", NULL};
    static const char *const plain[] = {"nu", "density", "E", NULL};
    char path[PAL_JSON_PATH], at[PAL_JSON_PATH];
    const cJSON *list, *hz;
    int index = 0;
    PAL_TRY(pal_json_list(&r->json, root, "", "undamped_natural_frequencies", 16, &list));
    for (const cJSON *child = list ? list->child : NULL; child; child = child->next, index++) {
        pal_json_entry(path, "undamped_natural_frequencies", index);
        PAL_TRY(pal_json_object(&r->json, child, path, known));
        PAL_TRY(check_note(r, child, path));
        PAL_TRY(check_numbers(r, child, path, plain));
        PAL_TRY(pal_json_list(&r->json, child, path, "hz", 256, &hz));
        for (const cJSON *f = hz ? hz->child : NULL; f; f = f->next)
            if (!cJSON_IsNumber(f) || !(f->valuedouble >= 0))
                return pal_json_refuse(&r->json, pal_json_key(at, path, "hz"), "is not a list of frequencies");
    }
    return PAL_ERR_OK;
}

/* a list of entries, each by its own function; least: how many there must be */
static pal_err read_list(const reader *r, const cJSON *root, const char *key, int min, int max, int *count,
                         pal_err (*read)(const reader *r, const cJSON *object, int index))
{
    const cJSON *list;
    PAL_TRY(pal_json_list(&r->json, root, "", key, max, &list));
    if (min >= 0 && !list) return pal_json_refuse(&r->json, key, "is missing");
    int n = list ? cJSON_GetArraySize(list) : 0;
    if (n < min) return pal_json_refuse(&r->json, key, "%d entries, wanted at least %d", n, min);
    for (const cJSON *child = list ? list->child : NULL; child; child = child->next, (*count)++)
        PAL_TRY(read(r, child, *count));
    return PAL_ERR_OK;
}

static pal_err read_problem(const reader *r, const cJSON *root)
{
    static const char *const known[] = {
        "format",   "name",       "units",      "surface",  "surface_unit", "materials",
        "supports", "load_cases", "references", "geometry", "note",         "undamped_natural_frequencies",
        NULL};
    static const char *const formats[] = {"palpate-reference-1", NULL};
    pal_problem *p = r->out;
    char word[32] = "", unit[16] = "m";
    PAL_TRY(pal_json_object(&r->json, root, "", known));
    PAL_TRY(need(r, root, "", (const char *const[]){"format", "surface", NULL}));
    PAL_TRY(read_word(r, root, "", "format", formats, word, sizeof word));
    PAL_TRY(check_note(r, root, ""));
    PAL_TRY(pal_json_text(&r->json, root, "", "name", false, p->name, sizeof p->name));
    PAL_TRY(check_units(r, root));
    PAL_TRY(read_file(r, root, "", "surface", p->surface, sizeof p->surface));
    PAL_TRY(pal_json_text(&r->json, root, "", "surface_unit", false, unit, sizeof unit));
    if (!(p->unit_m = pal_mesh_unit_named(unit)))
        return pal_json_refuse(&r->json, "surface_unit", "\"%s\" is not m, cm, mm, um or in", unit);
    const cJSON *geometry = cJSON_GetObjectItemCaseSensitive(root, "geometry");
    if (geometry) PAL_TRY(pal_json_object(&r->json, geometry, "geometry", NULL));
    PAL_TRY(check_frequencies(r, root));
    PAL_TRY(read_list(r, root, "materials", 1, PAL_PROBLEM_REGIONS, &p->n_material, read_material));
    PAL_TRY(read_list(r, root, "supports", 0, PAL_PROBLEM_REGIONS, &p->n_support, read_support));
    PAL_TRY(read_list(r, root, "load_cases", 1, PAL_PROBLEM_CASES, &p->n_case, read_case));
    return read_list(r, root, "references", -1, PAL_PROBLEM_REFERENCES, &p->n_reference, read_reference);
}

/* ---- doors ---- */

pal_err pal_problem_parse(const char *name, const char *text, size_t n_byte, const char *folder, pal_problem **out,
                          pal_diagnostic *diag)
{
    reader r = {.json = {name, diag}, .folder = folder};
    cJSON *root;
    PAL_TRY(pal_json_parse(&r.json, text, n_byte, &root));
    r.out = calloc(1, sizeof *r.out);
    if (r.out) {
        const char *slash = strrchr(name, '/');
        snprintf(r.out->path, sizeof r.out->path, "%s", name);
        snprintf(r.out->name, sizeof r.out->name, "%s", slash ? slash + 1 : name);
    }
    pal_err err =
        r.out ? read_problem(&r, root) : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a problem", name);
    cJSON_Delete(root);
    if (err) {
        free(r.out);
        return err;
    }
    *out = r.out;
    return PAL_ERR_OK;
}

pal_err pal_problem_read(const char *path, pal_problem **out, pal_diagnostic *diag)
{
    char folder[512];
    char *text;
    size_t n_byte;
    PAL_TRY(pal_json_read(path, folder, sizeof folder, &text, &n_byte, diag));
    pal_err err = pal_problem_parse(path, text, n_byte, folder, out, diag);
    free(text);
    return err;
}

const pal_problem_case *pal_problem_case_find(const pal_problem *problem, const char *id)
{
    for (int k = 0; k < problem->n_case; k++)
        if (!strcmp(problem->load_case[k].id, id)) return &problem->load_case[k];
    return NULL;
}

const pal_problem_reference *pal_problem_reference_find(const pal_problem *problem, const char *id)
{
    for (int k = 0; k < problem->n_reference; k++)
        if (!strcmp(problem->reference[k].id, id)) return &problem->reference[k];
    return NULL;
}
