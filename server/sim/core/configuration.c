/* Configurations read from scenes and applied to them. */
#include "server/sim/core/configuration.h"

#include "server/mesh/volume/loose_components.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MIN_VOXELS = 2, MAX_VOXELS = 400, MAX_LEVELS = 10, MAX_CUTS = 8, MAX_KEPT_VOXELS = 4000000 };
/* subdivisions of control cells whose boundary is filled with voxels: as shown, or finer */
enum { FINE_LEVELS = 3 };

static bool is(const char *a, const char *b)
{
    return !strcmp(a, b);
}

static bool in_list(const char *word, const char *const *list)
{
    for (; *list; list++)
        if (is(word, *list)) return true;
    return false;
}

static bool is_voxels(const char *model)
{
    return is(model, "fem") || is(model, "tet_springs");
}

/* ---- keys ---- */

/* keys of an entry `of` a model, or of any solver ("solver"), that a configuration has: a text, "" where it is absent,
 * or a number */
static const struct key {
    const char *of, *key;
    size_t at;
    bool text;
    double absent;
} keys[] = {{"fem", "element", offsetof(pal_configuration, element), true, 0},
            {"fem", "law", offsetof(pal_configuration, law), true, 0},
            {"tet_springs", "k_distance_J", offsetof(pal_configuration, k_distance_J), false, 0},
            {"tet_springs", "k_area_J", offsetof(pal_configuration, k_area_J), false, -1},
            {"tet_springs", "k_volume_J", offsetof(pal_configuration, k_volume_J), false, 0},
            {"solver", "tolerance", offsetof(pal_configuration, tolerance), false, 0}};
enum { KEYS = sizeof keys / sizeof *keys };

static double number(const pal_config_entry *item, const char *key, double absent)
{
    const pal_config_value *v = pal_entry_find(item, key);
    return v && v->kind == PAL_VALUE_NUMBER ? v->number[0] : absent;
}

static void read_keys(const pal_config_entry *item, const char *of, pal_configuration *out)
{
    for (const struct key *k = keys; k < keys + KEYS; k++) {
        const pal_config_value *v = pal_entry_find(item, k->key);
        if (!is(k->of, of)) continue;
        if (k->text)
            snprintf((char *)out + k->at, PAL_NAME, "%.*s", PAL_NAME - 1,
                     v && v->kind == PAL_VALUE_TEXT ? v->text : "");
        else
            *(double *)(void *)((char *)out + k->at) = number(item, k->key, k->absent);
    }
}

static void drop_key(pal_config_entry *item, const char *key)
{
    int kept = 0;
    for (int i = 0; i < item->n_value; i++)
        if (!is(item->value[i].key, key)) item->value[kept++] = item->value[i];
    item->n_value = kept;
}

static pal_err put_keys(const pal_configuration *from, const char *of, pal_config_entry *item, pal_diagnostic *diag)
{
    for (const struct key *k = keys; k < keys + KEYS; k++) {
        const char *word = (const char *)from + k->at;
        if (!is(k->of, of)) continue;
        drop_key(item, k->key);
        if (k->text && word[0]) PAL_TRY(pal_entry_put_text(item, k->key, word, diag));
        if (k->text) continue;
        const double value = *(const double *)(const void *)word;
        if (value > k->absent) PAL_TRY(pal_entry_put_number(item, k->key, value, diag));
    }
    return PAL_ERR_OK;
}

/* ---- reading ---- */

static double longest_side(const pal_surface *surface)
{
    double low[3], high[3], longest = 0;
    if (surface->n_vertex < 1) return 0;
    pal_surface_box(surface, low, high);
    for (int c = 0; c < 3; c++) longest = fmax(longest, high[c] - low[c]);
    return longest;
}

/* voxels on the longest axis; 0: the mesh was not made of so many */
static int voxels_of(const pal_prepared *mesh)
{
    if (mesh->tets.n_node < 1 || !(mesh->tets.edge_m > 0)) return 0;
    double n = longest_side(&mesh->surface) / mesh->tets.edge_m;
    return n >= 1 && n < 1e6 && fabs(n - round(n)) < 1e-3 * n ? (int)round(n) : 0;
}

static bool is_refined(const pal_config_entry *model)
{
    const pal_config_value *refine = pal_entry_find(model, "refine");
    double levels = number(model, "levels", 2);
    return refine && refine->kind == PAL_VALUE_BOOL && !refine->flag && number(model, "start_level", 0) == levels - 1;
}

void pal_configuration_of(const pal_scene *scene, int body, pal_configuration *out)
{
    const pal_body_def *def = &scene->body[body];
    const pal_config_entry *model = &def->model;
    int levels = (int)number(model, "levels", 2);
    memset(out, 0, sizeof *out);
    snprintf(out->model, sizeof out->model, "%.*s", PAL_NAME - 1, model->name);
    read_keys(model, model->name, out);
    if (is_voxels(model->name)) out->size = voxels_of(def->mesh);
    if (is(model->name, "adaptive_springs")) {
        out->size = levels;
        if (is_refined(model)) snprintf(out->element, sizeof out->element, "refined");
    }
    if (is(model->name, "subdivision_fem")) out->size = levels > 0 ? levels : -1;
    snprintf(out->solver, sizeof out->solver, "%.*s", PAL_NAME - 1, def->solver.name);
    read_keys(&def->solver, "solver", out);
    out->step_s = scene->step_s;
}

const char *pal_configuration_text(const pal_configuration *s, char out[PAL_CONFIGURATION_TEXT])
{
    char size[32] = "", solver[32] = "", step[32] = "", tolerance[32] = "";
    if (is_voxels(s->model) && s->size > 0) snprintf(size, sizeof size, ", %d voxels", s->size);
    if (!is_voxels(s->model) && s->size != 0)
        snprintf(size, sizeof size, ", %d level%s", s->size > 0 ? s->size : 0, s->size == 1 ? "" : "s");
    if (s->solver[0]) snprintf(solver, sizeof solver, ", %.24s", s->solver);
    if (s->step_s > 0) snprintf(step, sizeof step, ", %.3g ms", 1e3 * s->step_s);
    if (s->tolerance > 0) snprintf(tolerance, sizeof tolerance, ", tolerance %.3g", s->tolerance);
    snprintf(out, PAL_CONFIGURATION_TEXT, "%.20s%s%.12s%s%.16s%s%s%s%s%s", s->model, s->element[0] ? " " : "",
             s->element, s->law[0] ? " " : "", s->law, s->k_distance_J > 0 ? " calibrated" : "", size, solver, step,
             tolerance);
    return out;
}

static bool near(double a, double b)
{
    return a == b || fabs(a - b) <= 1e-9 * fmax(fabs(a), fabs(b));
}

bool pal_configuration_equal(const pal_configuration *a, const pal_configuration *b)
{
    return is(a->model, b->model) && is(a->element, b->element) && is(a->law, b->law) && is(a->solver, b->solver) &&
           a->size == b->size && near(a->step_s, b->step_s) && near(a->tolerance, b->tolerance) &&
           near(a->k_distance_J, b->k_distance_J) && near(a->k_area_J, b->k_area_J) &&
           near(a->k_volume_J, b->k_volume_J);
}

/* ---- models that fit ---- */

pal_err pal_configuration_check_model(const pal_body_def *body, const char *model, pal_diagnostic *diag)
{
    static const char *const known[] = {"fem", "tet_springs", "adaptive_springs", "subdivision_fem", NULL};
    static const struct {
        const char *is;
        const char *model[3];
    } shape[] = {{"control cells, which take subdivision_fem and fem", {"subdivision_fem", "fem"}},
                 {"a surface alone, which takes adaptive_springs", {"adaptive_springs"}},
                 {"full, which takes tet_springs and fem", {"tet_springs", "fem"}}};
    const int k = body->cells ? 0 : body->mesh->tets.n_node < 1 ? 1 : 2;
    if (!in_list(model, known)) return PAL_REFUSE(diag, "there is no model \"%.40s\"", model);
    if (in_list(model, shape[k].model)) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "body \"%s\" does not take model \"%s\": it is %s", body->name, model, shape[k].is);
}

static pal_err check_words(const pal_configuration *s, pal_diagnostic *diag)
{
    static const char *const element[] = {"", "hex8_bbar", "hex8", "tet4", "tet10", NULL};
    static const char *const law[] = {"", "corotational", "neo_hookean", "linear", NULL};
    static const char *const solver[] = {"",    "implicit_euler", "sdirk2",        "verlet",
                                         "rk4", "central_cg",     "static_newton", NULL};
    bool fem = is(s->model, "fem"), adaptive = is(s->model, "adaptive_springs");
    if (fem ? !in_list(s->element, element) : s->element[0] && !(adaptive && is(s->element, "refined")))
        return PAL_REFUSE(diag, "model \"%s\" has no element \"%.40s\"", s->model, s->element);
    if (fem ? !in_list(s->law, law) : s->law[0] != 0)
        return PAL_REFUSE(diag, "model \"%s\" has no law \"%.40s\"", s->model, s->law);
    if (!in_list(s->solver, solver)) return PAL_REFUSE(diag, "there is no solver \"%.40s\"", s->solver);
    return PAL_ERR_OK;
}

/* solvers that iterate to a residual */
static const char *const iterative[] = {"implicit_euler", "sdirk2", "central_cg", "static_newton", NULL};

/* the solver that a configuration means; "": the model's own, which iterates to nothing */
static const char *solver_of(const pal_configuration *s)
{
    if (s->solver[0] || !(s->tolerance > 0)) return s->solver;
    return is(s->model, "fem") ? "implicit_euler" : is(s->model, "subdivision_fem") ? "central_cg" : "";
}

static pal_err check_numbers(const pal_configuration *s, pal_diagnostic *diag)
{
    bool voxels = is_voxels(s->model), solid = is(s->model, "subdivision_fem");
    int min = voxels ? MIN_VOXELS : solid ? -1 : 1, max = voxels ? MAX_VOXELS : solid ? MAX_CUTS : MAX_LEVELS;
    if (s->size != 0 && (s->size < min || s->size > max))
        return PAL_REFUSE(diag, "size: %d %s, wanted %d to %d", s->size, voxels ? "voxels" : "levels", min, max);
    if (s->step_s != 0 && !(s->step_s >= 1e-4 && s->step_s <= 0.1))
        return PAL_REFUSE(diag, "step_s: %g is outside [1e-4, 0.1]", s->step_s);
    if (s->tolerance != 0 && !(s->tolerance >= 1e-14 && s->tolerance <= 0.5))
        return PAL_REFUSE(diag, "tolerance: %g is outside [1e-14, 0.5]", s->tolerance);
    if (s->tolerance != 0 && !in_list(solver_of(s), iterative))
        return PAL_REFUSE(diag, "tolerance: %g, but solver \"%s\" of model \"%s\" takes none", s->tolerance, s->solver,
                          s->model);
    const double k[3] = {s->k_distance_J, s->k_volume_J, s->k_area_J};
    const char *const key[3] = {"k_distance_J", "k_volume_J", "k_area_J"};
    for (int i = 0; i < 3; i++)
        if (!(k[i] == 0 || (i == 2 && k[i] == -1) || (k[i] > 0 && k[i] <= 1e60)) ||
            (!is(s->model, "tet_springs") && k[i] != 0))
            return PAL_REFUSE(diag, "%s: %g is no constant of springs of model \"%s\"", key[i], k[i], s->model);
    return PAL_ERR_OK;
}

/* ---- supports ---- */

bool pal_configuration_support_box(const pal_scene *scene, int body, int support, pal_support_def *out)
{
    const pal_body_def *def = &scene->body[body];
    const pal_support_def *from = &def->support[support];
    /* of the shape from which every mesh is made; nodes of a mesh of whole voxels are up to one voxel outside */
    const double *x = def->cells ? def->cells->x : def->mesh->surface.x;
    int n = def->cells ? def->cells->n_vertex : def->mesh->surface.n_vertex;
    int axis = 0;
    double low = INFINITY, high = -INFINITY, far = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(scene->up[c]) > fabs(scene->up[axis])) axis = c;
    if (!from->lowest || fabs(scene->up[axis]) < 0.999) return false;
    double sign = scene->up[axis] < 0 ? -1 : 1;
    for (int i = 0; i < n; i++) {
        low = fmin(low, sign * x[3 * i + axis]), high = fmax(high, sign * x[3 * i + axis]);
        for (int c = 0; c < 3; c++) far = fmax(far, fabs(x[3 * i + c]));
    }
    double top = low + (from->fraction + 1e-9) * (high - low);
    *out = (pal_support_def){.lowest = false};
    /* far enough for voxels of any size */
    for (int c = 0; c < 3; c++) out->low_m[c] = -4 * far, out->high_m[c] = 4 * far;
    if (sign > 0)
        out->high_m[axis] = top;
    else
        out->low_m[axis] = -top;
    return true;
}

static void box_supports(const pal_scene *from, int body, pal_body_def *to)
{
    for (int k = 0; k < to->n_support; k++) {
        pal_support_def box;
        if (pal_configuration_support_box(from, body, k, &box)) to->support[k] = box;
    }
}

/* ---- voxels ---- */

/* Moves the grid so that its planes pass through the border of the first box that cuts the body on an axis, just within
 * the box, so that rounding does not put nodes outside. */
static double grid_shift(double low, double high, double h, double box_low, double box_high)
{
    const double hair = 1e-6, plane[2] = {(box_low - low) / h + hair, (box_high - low) / h - hair};
    for (int side = 0; side < 2; side++) {
        double t = plane[side], lattice = round(t), within = side == 0 ? lattice - t : t - lattice;
        if (!(t > 0.01 && t < (high - low) / h - 0.01)) continue;
        /* the grid stays where one of its planes is as good */
        return within > -0.5 * hair && within < 1e-4 ? 0 : ceil(t) - t;
    }
    return -1;
}

static void align(const pal_body_def *body, const pal_surface *surface, int size, double ahead[3])
{
    double low[3], high[3], h = longest_side(surface) / size;
    pal_surface_box(surface, low, high);
    for (int c = 0; c < 3; c++) {
        double at = -1;
        for (int k = 0; k < body->n_support && at < 0; k++) {
            const pal_support_def *s = &body->support[k];
            if (!s->lowest && !s->rim) at = grid_shift(low[c], high[c], h, s->low_m[c], s->high_m[c]);
        }
        for (int k = 0; k < body->n_region && at < 0; k++) {
            const pal_region *r = &body->region[k];
            if (r->kind == PAL_REGION_BOX) at = grid_shift(low[c], high[c], h, r->low_m[c], r->high_m[c]);
        }
        ahead[c] = at < 0 ? 0 : at;
    }
}

/* drops components without support in voxels of this size, as preparation does */
static pal_err drop_loose(const pal_body_def *body, const double up[3], pal_prepared *mesh, pal_diagnostic *diag)
{
    pal_loose_components parts;
    uint8_t *fixed = calloc((size_t)mesh->tets.n_node, sizeof *fixed);
    if (!fixed) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory to find the fixed nodes");
    pal_body_def_mark_fixed(body, up, mesh->tets.x, mesh->tets.n_node, fixed);
    pal_err err = pal_loose_components_drop(body->name, fixed, false, mesh, &parts, diag);
    free(fixed);
    return err;
}

pal_err pal_filled_voxels_make(const pal_surface *surface, pal_voxel_options *voxel, pal_prepared *out,
                               pal_prepare_report *report, pal_diagnostic *diag)
{
    voxel->min_fill = PAL_VOXEL_DROP_FILL;
    PAL_TRY(pal_prepared_make(surface, voxel, out, report, diag));
    if (pal_prepared_missing(out) <= PAL_VOXEL_MAX_MISSING) return PAL_ERR_OK;
    /* thin parts consist of voxels with little inside */
    pal_prepared_free(out);
    voxel->min_fill = PAL_FILL_MIN;
    return pal_prepared_make(surface, voxel, out, report, diag);
}

static pal_err fill_voxels(const pal_body_def *body, const double up[3], const pal_surface *surface, int size,
                           pal_prepared *out, pal_diagnostic *diag)
{
    pal_prepare_report report;
    pal_diagnostic reason = {{0}};
    pal_voxel_options voxel = {.resolution = size, .border = true, .fill = true, .max_voxel = MAX_KEPT_VOXELS};
    align(body, surface, size, voxel.ahead);
    pal_err err = pal_filled_voxels_make(surface, &voxel, out, &report, &reason);
    if (!err && report.voxel.n_component > 1 && (err = drop_loose(body, up, out, &reason))) pal_prepared_free(out);
    return err ? pal_diagnostic_set(diag, err, "body \"%s\" in %d voxels: %s", body->name, size, reason.text)
               : PAL_ERR_OK;
}

/* the boundary of the cells after some levels, which is smooth where the control cells' is not */
static pal_err cells_surface(const pal_body_def *body, pal_surface *out, pal_diagnostic *diag)
{
    pal_subdivision fine = {0};
    pal_subdivision_options options = {.n_level = FINE_LEVELS};
    pal_diagnostic reason = {{0}};
    int32_t *vertex = NULL, *face = NULL;
    pal_err err = pal_subdivision_make(body->cells, &options, &fine, &reason);
    /* many cells: their shown surface is fine enough */
    if (err == PAL_ERR_BUDGET) {
        options.n_level = 1;
        err = pal_subdivision_make(body->cells, &options, &fine, &reason);
    }
    if (!err) err = pal_cells_boundary(&fine.cells, out, &vertex, &face);
    if (!err) memcpy(out->origin_m, body->mesh->surface.origin_m, sizeof out->origin_m);
    free(vertex), free(face);
    pal_subdivision_free(&fine);
    return err ? pal_diagnostic_set(diag, err, "body \"%s\": the boundary of its cells: %s", body->name, reason.text)
               : PAL_ERR_OK;
}

/* prepares voxels of that size */
static pal_err make_mesh(const pal_body_def *body, const double up[3], int size, pal_prepared *out,
                         pal_diagnostic *diag)
{
    if (size < 1)
        return PAL_REFUSE(diag,
                          "body \"%s\": as many voxels as it has are wanted, and it was not made of voxels: say how "
                          "many",
                          body->name);
    if (!body->cells) return fill_voxels(body, up, &body->mesh->surface, size, out, diag);
    pal_surface surface = {0};
    PAL_TRY(cells_surface(body, &surface, diag));
    pal_err err = fill_voxels(body, up, &surface, size, out, diag);
    pal_surface_free(&surface);
    return err;
}

/* ---- making ---- */

static pal_err put_springs(const pal_configuration *now, const pal_configuration *to, pal_config_entry *item,
                           pal_diagnostic *diag)
{
    bool same =
        is(now->model, to->model) && near(now->k_distance_J, to->k_distance_J) && near(now->k_volume_J, to->k_volume_J);
    if (!same) drop_key(item, "weights");
    if (!same && to->k_distance_J > 0) PAL_TRY(pal_entry_put_text(item, "weights", "volume", diag));
    return put_keys(to, "tet_springs", item, diag);
}

static pal_err put_levels(const pal_configuration *now, const pal_configuration *to, pal_config_entry *item,
                          pal_diagnostic *diag)
{
    bool refined = is(to->element, "refined"), same = is(to->model, now->model);
    int size = to->size != 0 ? to->size : same ? now->size : 0, n = size > 0 ? size : 0;
    if (same && size == now->size && is(to->element, now->element)) return PAL_ERR_OK;
    if (to->size != 0) {
        drop_key(item, "levels");
        PAL_TRY(pal_entry_put_number(item, "levels", n, diag));
    }
    if (is(to->model, "subdivision_fem")) return PAL_ERR_OK;
    drop_key(item, "start_level"), drop_key(item, "refine");
    if (!refined) return PAL_ERR_OK;
    PAL_TRY(pal_entry_put_number(item, "start_level", n - 1, diag));
    return pal_entry_put_bool(item, "refine", false, diag);
}

static pal_err put_model(const pal_configuration *now, const pal_configuration *to, pal_config_entry *item,
                         pal_diagnostic *diag)
{
    if (!is(now->model, to->model)) {
        char path[PAL_ENTRY_TEXT];
        memcpy(path, item->path, sizeof path);
        pal_entry_init(item, path, to->model);
        if (is(to->model, "fem")) PAL_TRY(pal_entry_put_bool(item, "fill", true, diag));
    }
    if (is(to->model, "tet_springs")) return put_springs(now, to, item, diag);
    if (!is(to->model, "fem")) return put_levels(now, to, item, diag);
    return put_keys(to, "fem", item, diag);
}

static pal_err put_solver(const pal_configuration *now, const pal_configuration *to, pal_config_entry *item,
                          pal_diagnostic *diag)
{
    const char *name = solver_of(to);
    if (!is(name, now->solver) || !is(now->model, to->model)) {
        char path[PAL_ENTRY_TEXT];
        snprintf(path, sizeof path, "%s", item->path[0] ? item->path : "solver");
        pal_entry_init(item, path, name);
    }
    if (near(to->tolerance, now->tolerance) && is(item->name, now->solver)) return PAL_ERR_OK;
    return put_keys(to, "solver", item, diag);
}

/* can the present voxels be used? */
static bool keeps_mesh(const pal_body_def *body, const pal_configuration *now, const pal_configuration *to)
{
    if (!is_voxels(to->model)) return true;
    if (body->cells || body->mesh->tets.n_node < 1) return false;
    if (to->size == 0 || pal_configuration_equal(now, to)) return true;
    bool by_fill = is(to->model, "fem") || to->k_distance_J > 0,
         may_continue = is(now->model, "fem") && is(to->model, "fem");
    return to->size == voxels_of(body->mesh) && (!by_fill || may_continue || body->mesh->hexes.measured);
}

static pal_err change(const pal_scene *from, const pal_configuration *now, const pal_configuration *to,
                      pal_configured_scene *set, pal_diagnostic *diag)
{
    pal_body_def *body = &set->scene.body[set->body];
    if (!keeps_mesh(body, now, to)) {
        box_supports(from, set->body, body);
        PAL_TRY(make_mesh(body, set->scene.up, to->size, &set->mesh, diag));
        body->mesh = &set->mesh;
        body->spring_grid = (pal_spring_grid){.n = {0}};
        snprintf(body->output.name, sizeof body->output.name, "skin_output");
    }
    if (!is(to->model, "tet_springs") || to->k_distance_J > 0) body->spring_grid = (pal_spring_grid){.n = {0}};
    PAL_TRY(put_model(now, to, &body->model, diag));
    PAL_TRY(put_solver(now, to, &body->solver, diag));
    /* voxels have no cut; painted cells are refused before */
    if (is_voxels(to->model)) body->cells = NULL, body->cut = false;
    if (to->step_s > 0) set->scene.step_s = to->step_s;
    return pal_scene_check(&set->scene, diag);
}

static pal_err check(const pal_scene *from, int body, const pal_configuration *to, pal_diagnostic *diag)
{
    if (body < 0 || body >= from->n_body) return PAL_REFUSE(diag, "body %d: the scene has %d", body, from->n_body);
    const pal_body_def *def = &from->body[body];
    PAL_TRY(pal_configuration_check_model(def, to->model, diag));
    PAL_TRY(check_words(to, diag));
    PAL_TRY(check_numbers(to, diag));
    if (def->n_stroke > 0 && !is(to->model, "subdivision_fem"))
        return PAL_REFUSE(diag, "body \"%s\" is painted (%d strokes), and model \"%s\" cannot be painted", def->name,
                          def->n_stroke, to->model);
    return PAL_ERR_OK;
}

pal_err pal_configuration_make(const pal_scene *from, int body, const pal_configuration *to, pal_diagnostic *diag,
                               pal_configured_scene **out)
{
    pal_configuration now;
    *out = NULL;
    PAL_TRY(check(from, body, to, diag));
    pal_configured_scene *set = calloc(1, sizeof *set);
    if (!set) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a scene");
    set->scene = *from;
    set->body = body;
    pal_configuration_of(from, body, &now);
    pal_err err = change(from, &now, to, set, diag);
    if (err) {
        pal_configured_scene_free(set);
        return err;
    }
    *out = set;
    return PAL_ERR_OK;
}

double pal_configuration_estimate_nodes(const pal_scene *from, int body, const pal_configuration *to)
{
    const pal_body_def *def = &from->body[body];
    const pal_surface *surface = &def->mesh->surface;
    pal_configuration now;
    pal_configuration_of(from, body, &now);
    if (is(to->model, "adaptive_springs") && to->size > 0 && to->size != now.size)
        return ldexp(surface->n_vertex, 2 * (to->size - 1));
    if (!is_voxels(to->model) || keeps_mesh(def, &now, to) || to->size < 1 || surface->n_vertex < 1) return 0;
    double low[3], high[3], box = 1, h = longest_side(surface) / to->size;
    pal_surface_box(surface, low, high);
    for (int c = 0; c < 3; c++) box *= high[c] - low[c];
    /* half of the skin are nodes beside those of one to a voxel, half of it voxels that the surface cuts and that are
     * kept. Of an open surface the volume is not known */
    double volume = fabs(pal_surface_volume(surface)), skin = pal_surface_area(surface) / (h * h);
    double n = (volume > 0 && volume <= box ? volume : box) / (h * h * h) + skin + 3.0 * to->size + 1;
    return is(to->element, "tet10") ? 7 * n : n;
}

void pal_configured_scene_free(pal_configured_scene *set)
{
    if (!set) return;
    pal_prepared_free(&set->mesh);
    free(set);
}

pal_err pal_configuration_check_live(const pal_scene *scene, int body, const pal_configuration *to,
                                     pal_diagnostic *diag)
{
    PAL_TRY(check(scene, body, to, diag));
    double n_node = pal_configuration_estimate_nodes(scene, body, to);
    if (n_node <= PAL_CONFIGURATION_LIVE_NODES) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "size: %d makes about %.2g nodes, a live switch takes %d at most", to->size, n_node,
                      PAL_CONFIGURATION_LIVE_NODES);
}
