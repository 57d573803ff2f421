/* JSON -> pal_problem, key by key: problem_file.h is the format. Each kind of entry has one function that first refuses
 * unknown keys and then reads its own. */
#include "server/scene/problem_file.h"

#include "server/base/vec3.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/scene/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WORDS(...) ((const char *const[]){__VA_ARGS__, NULL})

/* an object of known keys with those that it must have, both NULL-terminated; its note is a text */
static pal_err read_object(const pal_json *at, const char *const *known, const char *const *needed)
{
    char note[1024];
    PAL_TRY(pal_json_object(at, known));
    for (; needed && *needed; needed++) PAL_TRY(pal_json_need(at, *needed));
    return pal_json_text(at, "note", true, note, sizeof note);
}

/* a required vector whose numbers are at most max */
static pal_err read_vector(const pal_json *at, const char *key, double max, double out[3])
{
    PAL_TRY(pal_json_need(at, key));
    PAL_TRY(pal_json_vector(at, key, out));
    for (int c = 0; c < 3; c++)
        if (!(fabs(out[c]) <= max))
            return pal_json_refuse_key(at, key, "number %d, %g, is beyond %g", c + 1, out[c], max);
    return PAL_ERR_OK;
}

/* informative numbers: any that are finite */
static pal_err check_numbers(const pal_json *at, const char *const *keys)
{
    double number = 0;
    for (; *keys; keys++) PAL_TRY(pal_json_number(at, *keys, -1e300, 1e300, &number));
    return PAL_ERR_OK;
}

static pal_err read_word(const pal_json *at, const char *key, const char *const *words, char *out, size_t n_byte)
{
    char list[160];
    PAL_TRY(pal_json_text(at, key, false, out, n_byte));
    for (int k = 0; words[k]; k++)
        if (!strcmp(words[k], out)) return PAL_ERR_OK;
    pal_json_list_words(words, "\"", list, sizeof list);
    return pal_json_refuse_key(at, key, "\"%s\" is not known; known are %s", out, list);
}

static pal_err read_young(const pal_json *at, double *out)
{
    PAL_TRY(pal_json_number(at, "E", -INFINITY, INFINITY, out));
    if (pal_json_has(at, "E") && !(*out >= PAL_YOUNG_MIN_PA && *out <= PAL_YOUNG_MAX_PA))
        return pal_json_refuse_key(at, "E", "%g Pa is not a stiffness: wanted %s, %g to %g", *out,
                                   *out > 0 ? "less extreme" : "more than 0", PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA);
    return PAL_ERR_OK;
}

static pal_err read_poisson(const pal_json *at, double *out)
{
    PAL_TRY(pal_json_number(at, "nu", -INFINITY, INFINITY, out));
    if (pal_json_has(at, "nu") && !(*out > -1 && *out < 0.5))
        return pal_json_refuse_key(at, "nu", "%g is not a Poisson ratio: wanted more than -1 and less than 0.5", *out);
    if (pal_json_has(at, "nu") && *out < PAL_POISSON_MIN)
        return pal_json_refuse_key(at, "nu", "%g is nearer to -1 than %g", *out, PAL_POISSON_MIN);
    return PAL_ERR_OK;
}

static pal_err read_region(const pal_json *parent, pal_box *out)
{
    char type[8] = "";
    const pal_json region = pal_json_at(parent, "region"), *at = &region;
    PAL_TRY(pal_json_need(parent, "region"));
    PAL_TRY(read_object(at, WORDS("type", "min", "max", "note"), NULL));
    PAL_TRY(read_word(at, "type", WORDS("all", "box"), type, sizeof type));
    *out = (pal_box){.all = !strcmp(type, "all")};
    if (out->all) {
        const char *extra = pal_json_has(at, "min") ? "min" : pal_json_has(at, "max") ? "max" : NULL;
        if (extra) return pal_json_refuse_key(at, extra, "only goes with type \"box\"");
        for (int c = 0; c < 3; c++) out->low_m[c] = -PAL_LENGTH_MAX_M, out->high_m[c] = PAL_LENGTH_MAX_M;
        return PAL_ERR_OK;
    }
    PAL_TRY(read_vector(at, "min", PAL_LENGTH_MAX_M, out->low_m));
    PAL_TRY(read_vector(at, "max", PAL_LENGTH_MAX_M, out->high_m));
    return pal_json_box(at, "min", "max", out->low_m, out->high_m);
}

static pal_err read_material(const pal_json *at, pal_problem *out, int index)
{
    pal_problem_material *m = &out->material[index];
    PAL_TRY(read_object(at, WORDS("id", "region", "E", "nu", "density", "note"), WORDS("id", "region", "E", "nu")));
    PAL_TRY(pal_json_text(at, "id", false, m->id, sizeof m->id));
    for (int k = 0; k < index; k++)
        if (!strcmp(out->material[k].id, m->id))
            return pal_json_refuse_key(at, "id", "\"%s\" is that of materials[%d] already", m->id, k);
    PAL_TRY(read_region(at, &m->region));
    PAL_TRY(read_young(at, &m->young_Pa));
    PAL_TRY(read_poisson(at, &m->poisson));
    m->density_kg_m3 = 1000;
    return pal_json_number(at, "density", PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3, &m->density_kg_m3);
}

static pal_err read_normal(const pal_json *at, bool *has, double normal[3])
{
    *has = pal_json_has(at, "surface_normal");
    if (!*has) return PAL_ERR_OK;
    PAL_TRY(read_vector(at, "surface_normal", 1e9, normal));
    const double length = pal_norm3(normal);
    if (!(length > 1e-9)) return pal_json_refuse_key(at, "surface_normal", "has no direction: length %g", length);
    pal_scale3(normal, 1 / length, normal);
    return PAL_ERR_OK;
}

static pal_err read_support(const pal_json *at, pal_problem *out, int index)
{
    pal_problem_support *s = &out->support[index];
    char type[16] = "";
    PAL_TRY(read_object(at, WORDS("type", "region", "surface_normal", "move", "note"), NULL));
    PAL_TRY(read_word(at, "type", WORDS("fixed", "moved"), type, sizeof type));
    PAL_TRY(read_region(at, &s->region));
    PAL_TRY(read_normal(at, &s->has_normal, s->normal));
    s->moved = !strcmp(type, "moved");
    if (s->moved) return read_vector(at, "move", PAL_LENGTH_MAX_M, s->move_m);
    if (pal_json_has(at, "move")) return pal_json_refuse_key(at, "move", "only goes with type \"moved\"");
    return PAL_ERR_OK;
}

/* total force and traction times area must agree */
static pal_err check_total(const pal_json *at, const pal_problem_load *load)
{
    double area = 0, off = 0, size = 0;
    PAL_TRY(pal_json_number(at, "area", 1e-30, 1e30, &area));
    if (!area || !load->has_traction || !load->has_total) return PAL_ERR_OK;
    for (int c = 0; c < 3; c++) {
        off = fmax(off, fabs(area * load->traction_Pa[c] - load->total_N[c]));
        size = fmax(size, fabs(load->total_N[c]));
    }
    if (off > 1e-3 * size) return pal_json_refuse_key(at, "total_force", "%g N off traction times area", off);
    return PAL_ERR_OK;
}

static pal_err read_traction(const pal_json *at, pal_problem_load *load)
{
    PAL_TRY(pal_json_object(at, WORDS("type", "region", "surface_normal", "traction", "total_force", "area", "note")));
    PAL_TRY(read_region(at, &load->region));
    load->has_traction = pal_json_has(at, "traction");
    load->has_total = pal_json_has(at, "total_force");
    PAL_TRY(read_normal(at, &load->has_normal, load->normal));
    if (!load->has_traction && !load->has_total) return pal_json_refuse(at, "needs traction (Pa) or total_force (N)");
    if (load->has_traction) PAL_TRY(read_vector(at, "traction", 1e15, load->traction_Pa));
    if (load->has_total) PAL_TRY(read_vector(at, "total_force", 1e15, load->total_N));
    return check_total(at, load);
}

static pal_err read_load(const pal_json *at, pal_problem_load *load)
{
    char type[24] = "";
    *load = (pal_problem_load){.kind = PAL_LOAD_TRACTION};
    PAL_TRY(read_object(at, NULL, NULL));
    PAL_TRY(read_word(at, "type", WORDS("dead_traction", "point", "gravity"), type, sizeof type));
    if (!strcmp(type, "dead_traction")) return read_traction(at, load);
    if (!strcmp(type, "point")) {
        load->kind = PAL_LOAD_POINT;
        PAL_TRY(pal_json_object(at, WORDS("type", "point", "force", "note")));
        PAL_TRY(read_vector(at, "point", PAL_LENGTH_MAX_M, load->point_m));
        return read_vector(at, "force", 1e15, load->force_N);
    }
    load->kind = PAL_LOAD_GRAVITY;
    PAL_TRY(pal_json_object(at, WORDS("type", "acceleration", "note")));
    return read_vector(at, "acceleration", 1e9, load->gravity_m_s2);
}

/* the id of a load case or reference, which none before it has */
static pal_err read_id(const pal_json *at, const pal_problem *problem, char out[PAL_NAME])
{
    char id[PAL_NAME] = "";
    PAL_TRY(pal_json_need(at, "id"));
    PAL_TRY(pal_json_text(at, "id", false, id, sizeof id));
    if (pal_problem_case_find(problem, id))
        return pal_json_refuse_key(at, "id", "\"%s\" is that of a load case already", id);
    if (pal_problem_reference_find(problem, id))
        return pal_json_refuse_key(at, "id", "\"%s\" is that of a reference already", id);
    memcpy(out, id, PAL_NAME);
    return PAL_ERR_OK;
}

static pal_err read_case(const pal_json *at, pal_problem *out, int index)
{
    pal_problem_case *c = &out->load_case[index];
    pal_json list;
    PAL_TRY(read_object(at, WORDS("id", "loads", "note"), NULL));
    PAL_TRY(read_id(at, out, c->id));
    PAL_TRY(pal_json_list(at, "loads", PAL_PROBLEM_LOADS, &list));
    if (!list.value || !list.value->child) return pal_json_refuse(&list, "a load case needs at least one load");
    PAL_JSON_ENTRIES (load, &list) PAL_TRY(read_load(&load, &c->load[c->n_load++]));
    return PAL_ERR_OK;
}

/* {"rms": .., "max": ..} */
static pal_err read_error(const pal_json *parent, const char *key, double *rms, double *max)
{
    const pal_json at = pal_json_at(parent, key);
    if (!at.value) return PAL_ERR_OK;
    PAL_TRY(pal_json_object(&at, WORDS("rms", "max")));
    PAL_TRY(pal_json_number(&at, "rms", 0, 1e9, rms));
    return pal_json_number(&at, "max", 0, 1e9, max);
}

/* the informative keys of a reference */
static pal_err check_origin(const pal_json *at)
{
    char text[64];
    double rms, max;
    const pal_json mesh = pal_json_at(at, "mesh");
    PAL_TRY(check_numbers(at, WORDS("points", "max_displacement", "work_f_dot_u", "order_used")));
    PAL_TRY(read_error(at, "difference_two_finest", &rms, &max));
    if (!mesh.value) return PAL_ERR_OK;
    PAL_TRY(read_object(&mesh, WORDS("element", "nodes", "elements", "coarser_nodes", "note"), NULL));
    PAL_TRY(pal_json_text(&mesh, "element", true, text, sizeof text));
    return check_numbers(&mesh, WORDS("nodes", "elements", "coarser_nodes"));
}

static pal_err read_reference(const pal_json *at, pal_problem *out, int index)
{
    pal_problem_reference *ref = &out->reference[index];
    char word[16] = "";
    PAL_TRY(
        read_object(at,
                    WORDS("id", "file", "load_case", "kinematics", "law", "E", "nu", "estimated_error", "mesh",
                          "points", "max_displacement", "work_f_dot_u", "note", "order_used", "difference_two_finest"),
                    NULL));
    PAL_TRY(read_id(at, out, ref->id));
    PAL_TRY(read_object(at, NULL, WORDS("file", "load_case", "kinematics", "law")));
    PAL_TRY(pal_json_file_name(at, "file", ref->file, sizeof ref->file));
    PAL_TRY(pal_json_text(at, "load_case", false, ref->load_case, sizeof ref->load_case));
    if (!pal_problem_case_find(out, ref->load_case))
        return pal_json_refuse_key(at, "load_case", "there is no load case \"%s\"", ref->load_case);
    PAL_TRY(read_word(at, "kinematics", WORDS("linear", "finite"), word, sizeof word));
    PAL_TRY(read_word(at, "law", WORDS("hooke", "neo-hookean", "st-venant-kirchhoff", "corotational"), ref->law,
                      sizeof ref->law));
    ref->finite = !strcmp(word, "finite");
    if (ref->finite == !strcmp(ref->law, "hooke"))
        return pal_json_refuse_key(at, "law", "\"%s\" does not go with %s kinematics", ref->law, word);
    ref->young_Pa = ref->poisson = ref->estimated_rms = ref->estimated_max = NAN;
    const char *own = pal_json_has(at, "E") ? "E" : pal_json_has(at, "nu") ? "nu" : NULL;
    if (own && out->n_material > 1)
        return pal_json_refuse_key(at, own, "the problem has %d materials: which one is meant?", out->n_material);
    PAL_TRY(read_young(at, &ref->young_Pa));
    PAL_TRY(read_poisson(at, &ref->poisson));
    PAL_TRY(read_error(at, "estimated_error", &ref->estimated_rms, &ref->estimated_max));
    return check_origin(at);
}

static pal_err check_units(const pal_json *root)
{
    static const char *const known[] = {"length", "force", "stress", "density", "note", NULL};
    static const char *const unit[] = {"m", "N", "Pa", "kg/m^3"};
    char text[32];
    const pal_json at = pal_json_at(root, "units");
    if (!at.value) return PAL_ERR_OK;
    PAL_TRY(read_object(&at, known, NULL));
    for (int k = 0; k < 4; k++) {
        snprintf(text, sizeof text, "%s", unit[k]);
        PAL_TRY(pal_json_text(&at, known[k], false, text, sizeof text));
        if (strcmp(text, unit[k]))
            return pal_json_refuse_key(&at, known[k], "\"%s\": only \"%s\" is taken%s", text, unit[k],
                                       k ? "" : " (surface_unit is for the surface file alone)");
    }
    return PAL_ERR_OK;
}

static pal_err check_frequencies(const pal_json *at, pal_problem *out, int index)
{
    pal_json hz;
    (void)out, (void)index;
    PAL_TRY(read_object(at, WORDS("nu", "density", "E", "hz", "note"), NULL));
    PAL_TRY(check_numbers(at, WORDS("nu", "density", "E")));
    PAL_TRY(pal_json_list(at, "hz", 256, &hz));
    PAL_JSON_EACH (f, &hz)
        if (!cJSON_IsNumber(f) || !(f->valuedouble >= 0)) return pal_json_refuse(&hz, "is not a list of frequencies");
    return PAL_ERR_OK;
}

/* a list of entries, each by its own function; min: how many there must be, -1: the key may be absent */
static pal_err read_list(const pal_json *root, pal_problem *out, const char *key, int min, int max, int *count,
                         pal_err (*read)(const pal_json *at, pal_problem *out, int index))
{
    pal_json list;
    PAL_TRY(pal_json_list(root, key, max, &list));
    if (min >= 0) PAL_TRY(pal_json_need(root, key));
    int n = list.value ? cJSON_GetArraySize(list.value) : 0;
    if (n < min) return pal_json_refuse(&list, "%d entries, wanted at least %d", n, min);
    PAL_JSON_ENTRIES (at, &list) {
        PAL_TRY(read(&at, out, *count));
        ++*count;
    }
    return PAL_ERR_OK;
}

static pal_err read_problem(const pal_json *at, pal_problem *p)
{
    char word[32] = "", unit[16] = "m";
    PAL_TRY(read_object(at,
                        WORDS("format", "name", "units", "surface", "surface_unit", "materials", "supports",
                              "load_cases", "references", "geometry", "note", "undamped_natural_frequencies"),
                        WORDS("format", "surface")));
    PAL_TRY(read_word(at, "format", WORDS("palpate-reference-1"), word, sizeof word));
    PAL_TRY(pal_json_text(at, "name", false, p->name, sizeof p->name));
    PAL_TRY(check_units(at));
    PAL_TRY(pal_json_file_name(at, "surface", p->surface, sizeof p->surface));
    PAL_TRY(pal_json_text(at, "surface_unit", false, unit, sizeof unit));
    if (!(p->unit_m = pal_mesh_unit_named(unit)))
        return pal_json_refuse_key(at, "surface_unit", "\"%s\" is not m, cm, mm, um or in", unit);
    const pal_json geometry = pal_json_at(at, "geometry");
    if (geometry.value) PAL_TRY(pal_json_object(&geometry, NULL));
    int n_frequency = 0;
    PAL_TRY(read_list(at, p, "undamped_natural_frequencies", -1, 16, &n_frequency, check_frequencies));
    PAL_TRY(read_list(at, p, "materials", 1, PAL_PROBLEM_REGIONS, &p->n_material, read_material));
    PAL_TRY(read_list(at, p, "supports", 0, PAL_PROBLEM_REGIONS, &p->n_support, read_support));
    PAL_TRY(read_list(at, p, "load_cases", 1, PAL_PROBLEM_CASES, &p->n_case, read_case));
    return read_list(at, p, "references", -1, PAL_PROBLEM_REFERENCES, &p->n_reference, read_reference);
}

pal_err pal_problem_parse(const char *name, const char *text, size_t n_byte, const char *folder, pal_problem **out,
                          pal_diagnostic *diag)
{
    pal_json json = {.file = name, .diag = diag, .folder = folder};
    cJSON *root;
    PAL_TRY(pal_json_parse(&json, text, n_byte, &root));
    pal_problem *problem = calloc(1, sizeof *problem);
    if (problem) {
        const char *slash = strrchr(name, '/');
        snprintf(problem->path, sizeof problem->path, "%s", name);
        snprintf(problem->name, sizeof problem->name, "%s", slash ? slash + 1 : name);
    }
    pal_err err = problem ? read_problem(&json, problem)
                          : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a problem", name);
    cJSON_Delete(root);
    if (err)
        free(problem);
    else
        *out = problem;
    return err;
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

pal_err pal_problem_refuse_case(const pal_problem *p, const char *flag, const char *id, pal_diagnostic *diag)
{
    char list[320];
    const char *known[PAL_PROBLEM_CASES + PAL_PROBLEM_REFERENCES + 1] = {NULL};
    for (int k = 0; k < p->n_case; k++) known[k] = p->load_case[k].id;
    for (int k = 0; k < p->n_reference; k++) known[p->n_case + k] = p->reference[k].id;
    pal_json_list_words(known, "", list, sizeof list);
    if (!id) return PAL_REFUSE(diag, "%s: %s is missing; known are %s", p->path, flag, list);
    return PAL_REFUSE(diag, "%s: %s: there is no load case or reference \"%.40s\"; known are %s", p->path, flag, id,
                      list);
}
