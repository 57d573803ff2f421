/* Equilibria on other meshes: voxels merged by eights, loads and displacements transferred by shape functions.
 *
 * A support that ends between two coarse planes would fix another part of the body, with the error of a support
 * moved by one voxel. The planes of each axis are therefore shifted so that the fixed coarse nodes match the fixed
 * fine nodes best. */
#include "server/estimate/rest_solution.h"

#include "server/base/vec3.h"
#include "server/estimate/tuning.h"
#include "server/mesh/volume/locate.h"
#include "server/mesh/volume/voxel_coarsening.h"
#include "server/num/shape_functions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NEWTON_A_STEP = 3, MAX_STEPS = 30, MIN_HEXES = 4, MORE_PRESSES = 2, MANY_NODES = 4000, MAX_GRADIENTS = 3000 };

/* ---- scene ---- */

static pal_err put_text(pal_config_entry *item, const char *key, const char *text, pal_diagnostic *diag)
{
    pal_config_value *known = (pal_config_value *)(uintptr_t)pal_entry_find(item, key);
    if (!known) return pal_entry_put_text(item, key, text, diag);
    snprintf(known->text, sizeof known->text, "%s", text);
    return PAL_ERR_OK;
}

static pal_err make_scene(const pal_scene *scene, const char *element, const char *law, pal_diagnostic *diag,
                          pal_rest_solution *out)
{
    out->scene = malloc(sizeof *out->scene);
    if (!out->scene) return PAL_ERR_MEMORY;
    *out->scene = *scene;
    out->scene->threads = 1;
    pal_body_def *def = &out->scene->body[0];
    if (strcmp(def->model.name, "fem") && (element || law)) pal_entry_init(&def->model, "model", "fem");
    if (element) PAL_TRY(put_text(&def->model, "element", element, diag));
    if (law) PAL_TRY(put_text(&def->model, "law", law, diag));
    pal_entry_init(&def->solver, "solver", "static_newton");
    PAL_TRY(pal_entry_put_number(&def->solver, "tolerance", PAL_TOLERANCE_REST, diag));
    return pal_entry_put_number(&def->solver, "newton", NEWTON_A_STEP, diag);
}

/* a factor for many nodes takes hundreds of megabytes, and as long as conjugate gradients without one; cubes have
 * multigrid */
static pal_err spare_memory(pal_scene *scene)
{
    pal_config_entry *solver = &scene->body[0].solver;
    const pal_config_value *element = pal_entry_find(&scene->body[0].model, "element");
    if (!element || !strncmp(element->text, "hex", 3)) return PAL_ERR_OK;
    PAL_TRY(pal_entry_put_text(solver, "linear", "incomplete", NULL));
    return pal_entry_put_number(solver, "iterations", MAX_GRADIENTS, NULL);
}

/* fixes the lowest part by a box if `up` is an axis, so that every mesh has the same part fixed */
static void fix_lowest(pal_scene *scene, const pal_body *body)
{
    pal_body_def *def = &scene->body[0];
    double h = body->edge_m;
    int axis = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(scene->up[c]) > fabs(scene->up[axis])) axis = c;
    for (int k = 0; k < def->n_support; k++) {
        pal_support_def *s = &def->support[k];
        if (s->lowest && fabs(scene->up[axis]) > 1 - 1e-9) {
            double low = INFINITY, high = -INFINITY, sign = scene->up[axis] > 0 ? 1 : -1;
            for (int i = 0; i < body->n_node; i++) {
                low = fmin(low, sign * body->node_rest[3 * i + axis]);
                high = fmax(high, sign * body->node_rest[3 * i + axis]);
            }
            double top = sign * (low + s->fraction * (high - low));
            *s = (pal_support_def){.lowest = false};
            for (int c = 0; c < 3; c++) s->low_m[c] = -1e9, s->high_m[c] = 1e9;
            *(sign > 0 ? &s->high_m[axis] : &s->low_m[axis]) = top;
        }
        for (int c = 0; c < 3 && !s->lowest; c++)
            s->low_m[c] -= PAL_SUPPORT_SLACK * h, s->high_m[c] += PAL_SUPPORT_SLACK * h;
    }
}

/* ---- coarse meshes ---- */

/* nodes of a voxel mesh by their lattice position */
typedef struct lattice {
    int n[3];
    double low[3], edge_m;
    int32_t *node; /* -1: none */
} lattice;

static size_t lattice_index(const lattice *l, const int at[3])
{
    return (size_t)at[0] + (size_t)l->n[0] * ((size_t)at[1] + (size_t)l->n[1] * (size_t)at[2]);
}

static pal_err make_lattice(const pal_tets *tets, lattice *l)
{
    double high[3];
    size_t n = 1;
    l->edge_m = tets->edge_m;
    for (int c = 0; c < 3; c++) l->low[c] = INFINITY, high[c] = -INFINITY;
    for (int i = 0; i < 3 * tets->n_node; i++)
        l->low[i % 3] = fmin(l->low[i % 3], tets->x[i]), high[i % 3] = fmax(high[i % 3], tets->x[i]);
    for (int c = 0; c < 3; c++) n *= (size_t)(l->n[c] = (int)floor((high[c] - l->low[c]) / l->edge_m + 1.5));
    l->node = malloc(n * sizeof *l->node);
    if (!l->node) return PAL_ERR_MEMORY;
    memset(l->node, 0xff, n * sizeof *l->node);
    for (int i = 0; i < tets->n_node; i++) {
        int at[3];
        for (int c = 0; c < 3; c++) at[c] = (int)floor((tets->x[3 * i + c] - l->low[c]) / l->edge_m + 0.5);
        l->node[lattice_index(l, at)] = i;
    }
    return PAL_ERR_OK;
}

/* mismatch between the fixed nodes and the planes of `shift` */
static double misheld(const lattice *l, const uint8_t *fixed, int axis, int shift)
{
    double sum = 0;
    int at[3];
    for (at[2] = 0; at[2] < l->n[2]; at[2]++)
        for (at[1] = 0; at[1] < l->n[1]; at[1]++)
            for (at[0] = 0; at[0] < l->n[0]; at[0]++) {
                int32_t i = l->node[lattice_index(l, at)];
                if (i < 0 || (at[axis] + shift) % 2 == 0) continue;
                double beside = 0;
                int n = 0;
                for (int side = -1; side <= 1; side += 2) {
                    int next[3] = {at[0], at[1], at[2]};
                    next[axis] += side;
                    if (next[axis] < 0 || next[axis] >= l->n[axis]) continue;
                    int32_t j = l->node[lattice_index(l, next)];
                    if (j >= 0) beside += fixed[j] != 0, n++;
                }
                sum += fabs((fixed[i] != 0) - (n > 0 ? beside / n : 0));
            }
    return sum;
}

/* fixed: fine nodes, by supports alone */
static pal_err choose_shift(const pal_tets *tets, const uint8_t *fixed, int shift[3])
{
    lattice l = {.node = NULL};
    PAL_TRY(make_lattice(tets, &l));
    for (int c = 0; c < 3; c++) shift[c] = misheld(&l, fixed, c, 1) < misheld(&l, fixed, c, 0);
    free(l.node);
    return PAL_ERR_OK;
}

static pal_err merge(pal_rest_solution *r, const pal_prepared *mesh, pal_diagnostic *diag)
{
    const pal_body_def *def = &r->scene->body[0];
    const pal_tets *tets = &mesh->tets;
    const pal_hexes *hexes = &mesh->hexes;
    pal_hexes own = {0};
    int shift[3];
    if (hexes->n_hex == 0) {
        PAL_TRY(pal_hexes_find(tets, &own, diag));
        hexes = &own;
    }
    uint8_t *fixed = calloc((size_t)tets->n_node, 1);
    for (int k = 0; fixed && k < def->n_support; k++)
        if (!def->support[k].lowest) pal_support_mark_fixed(&def->support[k], NULL, tets->x, tets->n_node, fixed);
    pal_err err = fixed ? choose_shift(tets, fixed, shift) : PAL_ERR_MEMORY;
    free(fixed);
    if (!err) err = pal_voxels_coarsen(tets, hexes, shift, PAL_MERGE_MIN_FILL, &r->mesh, diag);
    if (!err && r->mesh.hexes.n_hex < MIN_HEXES) {
        err = pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%d voxels are too few for a coarser mesh", hexes->n_hex);
        pal_prepared_free(&r->mesh);
    }
    pal_hexes_free(&own);
    return err;
}

/* ---- positions of the running body's nodes ---- */

/* moves outside points to the nearest inside one: extrapolation would turn a load into a pair of large opposite
 * ones */
static void take_inside(const pal_body *b, double local[4])
{
    double sum = 0;
    bool hex = b->n_corner == PAL_HEX_CORNERS;
    for (int c = 0; c < (hex ? 3 : 4); c++) {
        local[c] = hex ? fmin(fmax(local[c], -1), 1) : fmax(local[c], 0);
        sum += local[c];
    }
    for (int c = 0; c < 4 && !hex; c++) local[c] /= sum;
}

pal_err pal_rest_solution_interpolation(const pal_rest_solution *r, const double *x, int n, int stride, bool inside,
                                        pal_interpolation *out)
{
    const pal_body *own = pal_world_view_body(r->world, 0);
    const pal_prepared *mesh = r->scene->body[0].mesh;
    pal_locate *locate = NULL;
    pal_interpolation_builder rows;
    PAL_TRY(pal_locate_create(&mesh->tets, own->n_corner == PAL_HEX_CORNERS ? &mesh->hexes : NULL, &locate));
    pal_interpolation_builder_begin(&rows, n, own->n_node, INT32_MAX);
    for (int i = 0; i < n && !rows.err; i++) {
        double local[4], shape[PAL_MAX_CORNERS];
        int e = pal_locate_point(locate, x + 3 * (size_t)i * (size_t)stride, local, NULL);
        const int32_t *node = own->element + (size_t)own->n_corner * (size_t)e;
        if (inside) take_inside(own, local);
        pal_element_shape(own->n_corner, local, shape);
        for (int k = 0; k < own->n_corner; k++) pal_interpolation_builder_add(&rows, node[k], shape[k]);
        pal_interpolation_builder_end_row(&rows);
    }
    pal_locate_destroy(locate);
    return pal_interpolation_builder_finish(&rows, out);
}

void pal_rest_solution_displacement(const pal_rest_solution *r, const pal_interpolation *by, double *u)
{
    const pal_body *own = pal_world_view_body(r->world, 0);
    for (int i = 0; i < by->n_row; i++, u += 3) {
        pal_set3(u, 0, 0, 0);
        for (int k = by->start[i]; k < by->start[i + 1]; k++) {
            const size_t node = 3 * (size_t)by->point[k];
            pal_axpy3(u, by->weight[k], own->d + node);
            pal_axpy3(u, -by->weight[k], own->node_rest + node);
        }
    }
}

/* outside: nodes of the running body may lie outside of this mesh */
static pal_err find_nodes(pal_rest_solution *r, const pal_body *body, bool outside)
{
    PAL_TRY(pal_rest_solution_interpolation(r, body->node_rest, r->n_node, 1, outside, &r->by));
    r->common = malloc((size_t)r->n_node * sizeof *r->common);
    for (int i = 0; i < r->n_node && r->common; i++) {
        double max = 0;
        for (int k = r->by.start[i]; k < r->by.start[i + 1]; k++) max = fmax(max, r->by.weight[k]);
        if (max > 1 - 1e-9) r->common[r->n_common++] = i;
    }
    return r->common ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* ---- public functions ---- */

static pal_err open_world(pal_rest_solution *r, pal_diagnostic *diag)
{
    PAL_TRY(pal_world_create(r->scene, diag, &r->world));
    pal_world_body(r->world, 0)->load_cap_N = INFINITY;
    r->x = malloc(3 * sizeof *r->x * (size_t)r->n_node);
    return r->x ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_rest_solution_make(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                               pal_diagnostic *diag, pal_rest_solution *out)
{
    *out = (pal_rest_solution){.n_node = body->n_node};
    pal_err err = make_scene(scene, element, law, diag, out);
    if (!err) err = open_world(out, diag);
    if (!err && pal_world_view_body(out->world, 0)->n_node != body->n_node)
        err = pal_diagnostic_set(diag, PAL_ERR_REFUSED, "the nodes of the body at rest are others");
    if (err) pal_rest_solution_free(out);
    return err;
}

pal_err pal_rest_solution_coarser(const pal_scene *scene, const pal_body *body, const char *element, const char *law,
                                  pal_diagnostic *diag, pal_rest_solution *out)
{
    *out = (pal_rest_solution){.n_node = body->n_node};
    pal_err err = make_scene(scene, element, law, diag, out);
    if (!err) fix_lowest(out->scene, body);
    if (!err) err = merge(out, scene->body[0].mesh, diag);
    if (!err) out->scene->body[0].mesh = &out->mesh;
    if (!err) err = open_world(out, diag);
    if (!err) err = find_nodes(out, body, false);
    if (err) pal_rest_solution_free(out);
    return err;
}

pal_err pal_rest_solution_sized(const pal_scene *scene, const pal_body *body, const pal_configuration *configuration,
                                int size, const char *law, pal_rest_solution *out)
{
    pal_configured_scene *set = NULL;
    pal_configuration to = *configuration;
    *out = (pal_rest_solution){.n_node = body->n_node};
    to.size = size;
    PAL_TRY(pal_configuration_make(scene, 0, &to, NULL, &set));
    pal_err err = make_scene(&set->scene, NULL, law, NULL, out);
    if (!err && set->mesh.tets.n_node == 0) err = PAL_ERR_REFUSED;
    if (!err && set->mesh.tets.n_node > MANY_NODES) err = spare_memory(out->scene);
    if (!err) {
        out->mesh = set->mesh;
        memset(&set->mesh, 0, sizeof set->mesh);
        out->scene->body[0].mesh = &out->mesh;
        err = open_world(out, NULL);
    }
    pal_configured_scene_free(set);
    if (!err) err = find_nodes(out, body, true);
    if (err) pal_rest_solution_free(out);
    return err;
}

pal_err pal_rest_solution_of_state(pal_scene *scene, pal_world *world, pal_rest_solution *out)
{
    const int n_node = pal_world_view_body(world, 0)->n_node;
    *out = (pal_rest_solution){.scene = scene, .own = true, .world = world, .n_node = n_node};
    out->x = malloc(3 * sizeof *out->x * (size_t)n_node);
    return out->x ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_rest_solution_free(pal_rest_solution *r)
{
    if (!r->own) pal_world_destroy(r->world), free(r->scene);
    pal_prepared_free(&r->mesh);
    pal_interpolation_free(&r->by);
    free(r->common), free(r->x);
    memset(r, 0, sizeof *r);
}

/* ---- rest ---- */

double pal_rest_solution_change(const pal_rest_solution *rest, const pal_rest_solution *coarser)
{
    double max = 0;
    for (int k = 0; k < coarser->n_common; k++) {
        size_t i = 3 * (size_t)coarser->common[k];
        max = fmax(max, pal_dist3(rest->x + i, coarser->x + i));
    }
    return max;
}

/* the part of the loads that is due to tools, including its share of the acceleration */
static void touch_at(const pal_estimate_state *s, int i, double out[3])
{
    pal_sub3(out, s->borne + 3 * (size_t)i, s->external_force + 3 * (size_t)i);
}

/* the loads of the state, with the tool loads scaled by `part` */
static void load_at(const pal_estimate_state *s, double part, int i, double out[3])
{
    double touch[3];
    touch_at(s, i, touch);
    pal_copy3(out, s->borne + 3 * (size_t)i);
    pal_axpy3(out, part - 1, touch);
}

static pal_err put_loads(pal_rest_solution *r, const pal_estimate_state *state, double part)
{
    const pal_body *own = pal_world_view_body(r->world, 0);
    double *load = calloc(3 * ((size_t)r->n_node + (size_t)own->n_node), sizeof *load), *f = load;
    if (!load) return PAL_ERR_MEMORY;
    for (int i = 0; i < r->n_node; i++) load_at(state, part, i, load + 3 * (size_t)i);
    if (r->by.n_row > 0) pal_interpolation_apply_transpose(&r->by, load, f += 3 * (size_t)r->n_node);
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < own->n_node && !err; i++) err = pal_world_load(r->world, 0, i, f + 3 * (size_t)i);
    free(load);
    return err;
}

static pal_err put_state(pal_rest_solution *r, const pal_estimate_state *state, const double *from, double part)
{
    pal_body *own = pal_world_body(r->world, 0);
    PAL_TRY(pal_estimate_match(state, r->world, r->scene, false));
    /* from rest after a failure, otherwise from the previous solution */
    if (!r->known) memcpy(own->x, own->x_rest, 3 * sizeof *own->x * (size_t)own->n_dof);
    for (int i = 0; i < own->n_node && r->by.n_row == 0; i++)
        if (from || own->support[i])
            pal_copy3(own->x + 3 * i, from && !own->support[i] ? from + 3 * i : state->x + 3 * i);
    memset(own->v, 0, 3 * sizeof *own->v * (size_t)own->n_dof);
    pal_world_invalidate_limits(r->world, 0);
    return put_loads(r, state, part);
}

static bool nothing_acts(const pal_rest_solution *r, double young_Pa)
{
    const pal_body *own = pal_world_view_body(r->world, 0);
    double sum = 0, max = PAL_UNLOADED_RESIDUAL * young_Pa * own->edge_m * own->edge_m;
    for (int i = 0; i < own->n_dof; i++)
        if (!own->support[i]) sum += pal_dot3(own->g + 3 * (size_t)i, own->g + 3 * (size_t)i);
    return sum <= max * max * own->n_dof;
}

static bool converge(pal_rest_solution *r, double young_Pa, const _Atomic bool *stop)
{
    for (int k = 0; k < MAX_STEPS; k++) {
        pal_solve_report report;
        if (pal_estimate_stopped(stop)) return false;
        if (pal_world_step(r->world, r->scene->step_s) || pal_world_view_body(r->world, 0)->frozen) return false;
        pal_world_solve_report(r->world, 0, &report);
        if (report.converged || nothing_acts(r, young_Pa)) return true;
        if (report.n_newton == 0) return false;
    }
    return false;
}

static void take_positions(pal_rest_solution *r, const pal_body *body)
{
    const pal_body *own = pal_world_view_body(r->world, 0);
    if (r->by.n_row == 0) memcpy(r->x, own->d, 3 * sizeof *r->x * (size_t)r->n_node);
    pal_rest_solution_displacement(r, &r->by, r->x);
    for (int i = 0; i < 3 * r->by.n_row; i++) r->x[i] += body->node_rest[i];
}

static bool find(pal_rest_solution *r, const pal_estimate_state *state, const pal_body *body, const double *from,
                 double part, const _Atomic bool *stop)
{
    bool good = r->own || (!put_state(r, state, from, part) && converge(r, state->material.young_Pa, stop));
    r->known = good;
    if (good) take_positions(r, body);
    return good;
}

/* work of the tool loads from rest to x */
static double pressed_J(const pal_estimate_state *s, const pal_body *body, const double *x)
{
    double sum = 0;
    for (int i = 0; i < s->n_node && s->touched; i++) {
        double u[3], touch[3];
        pal_sub3(u, x + 3 * (size_t)i, body->node_rest + 3 * (size_t)i);
        touch_at(s, i, touch);
        if (!body->support[i]) sum += pal_dot3(touch, u);
    }
    return sum;
}

bool pal_rest_solution_find(pal_rest_solution *r, const pal_estimate_state *state, const pal_body *body,
                            const double *from, const _Atomic bool *stop)
{
    r->press = NAN;
    if (!r->world || !find(r, state, body, from, 1, stop)) return false;
    double want_J = pressed_J(state, body, state->x), got_J = pressed_J(state, body, r->x), part = 1, last = 0,
           last_J = 0;
    for (int k = 0; k < MORE_PRESSES && want_J > 0 && got_J > 0 && fabs(got_J / want_J - 1) > PAL_SAME_PRESS; k++) {
        /* neglects the displacement by other loads: the first secant passes through zero */
        double slope = (got_J - last_J) / (part - last), next = part + (want_J - got_J) / slope;
        if (!(next > part / PAL_MAX_PRESS && next < part * PAL_MAX_PRESS)) break;
        last = part, last_J = got_J, part = next;
        if (!find(r, state, body, r->by.n_row > 0 ? NULL : r->x, part, stop))
            return find(r, state, body, from, 1, stop);
        got_J = pressed_J(state, body, r->x);
        if (!(fabs(got_J - want_J) < fabs(last_J - want_J))) return find(r, state, body, from, 1, stop);
    }
    if (want_J > 0 && fabs(got_J / want_J - 1) <= PAL_SAME_PRESS) r->press = part;
    return true;
}
