/* Limits, weak spots, conditioning and cost of a scene at rest. K is applied by differences of the forces, so that
 * every component counts, whatever its kind. */
#include "server/solve/preflight.h"

#include "server/base/clock.h"
#include "server/num/lanczos.h"
#include "server/sim/implicit/system.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/springs/spring_constraint.h"
#include "server/solve/tuning.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_LANCZOS = 24 };

typedef struct probe {
    pal_world *world;
    pal_body *body;
    pal_component force[32];
    int n_force;
    double step_m; /* displacement of the differences */
    double *x, *low;
    bool failed;
    uint64_t spent_ns; /* in the components, in n_run evaluations of all of them */
    int n_run;
} probe;

/* ---- weak spots ---- */

static void weak(pal_weak_spot *w, int index, double value, const double at[3], const pal_body *body)
{
    if (w->n++ > 0 && !(value < w->value)) return;
    w->worst = index, w->value = value;
    pal_add3(w->at_m, at, body->offset_m);
}

static void find_centroid(const double *x, const int32_t *corner, int n, double at[3])
{
    pal_set3(at, 0, 0, 0);
    for (int c = 0; c < n; c++) pal_axpy3(at, 1.0 / n, x + 3 * (size_t)corner[c]);
}

/* edges of an element of n corners, all connected to each other */
static void check_edges(const pal_body *body, const double *x, const int32_t *corner, int n, pal_preflight_body *out,
                        double *mean2)
{
    int n_edge = 0;
    *mean2 = 0;
    for (int a = 0; a < n; a++)
        for (int b = 0; b < a; b++, n_edge++) {
            double length = pal_dist3(x + 3 * (size_t)corner[a], x + 3 * (size_t)corner[b]);
            *mean2 += length * length;
            if (length < PAL_WEAK_EDGE_S * body->length_scale_m)
                weak(&out->edge, corner[a], length, x + 3 * (size_t)corner[a], body);
            if (corner[a] == out->limit_node || corner[b] == out->limit_node)
                out->limit_edge_m = fmin(out->limit_edge_m, length);
        }
    *mean2 /= n_edge;
}

/* 1 for a regular tetrahedron or triangle, 0 for a flat one */
static double shape_of(const double *x, const int32_t *corner, int n, double mean2)
{
    double a[3], b[3], c[3], g[3];
    if (!(mean2 > 0)) return 0;
    pal_sub3(a, x + 3 * (size_t)corner[1], x + 3 * (size_t)corner[0]);
    pal_sub3(b, x + 3 * (size_t)corner[2], x + 3 * (size_t)corner[0]);
    pal_cross3(g, a, b);
    if (n == 3) return 2 / sqrt(3) * pal_norm3(g) / mean2;
    pal_sub3(c, x + 3 * (size_t)corner[3], x + 3 * (size_t)corner[0]);
    return sqrt(2) * fabs(pal_dot3(g, c)) / (mean2 * sqrt(mean2));
}

/* volumes: the body has springs that preserve the volume of tetrahedra */
static void check_elements(const pal_body *body, bool volumes, pal_preflight_body *out)
{
    const pal_tets *tets = body->interpolation ? NULL : body->tets;
    const int n = tets ? 4 : 3, n_simplex = tets ? tets->n_tet : body->active ? body->dofs.levels->first_face[1] : 0;
    const int32_t *simplex = tets ? tets->tet : body->active ? body->dofs.levels->face : NULL;
    for (int e = 0; e < n_simplex; e++) {
        const int32_t *corner = simplex + (size_t)n * (size_t)e;
        double mean2, at[3];
        check_edges(body, body->x_rest, corner, n, out, &mean2);
        double shape = shape_of(body->x_rest, corner, n, mean2);
        find_centroid(body->x_rest, corner, n, at);
        if (shape < PAL_WEAK_SHAPE) weak(&out->flat, e, shape, at, body);
        if (tets && volumes) out->n_sliver += shape < PAL_SPRING_SLIVER;
    }
    int n_corner = body->element ? body->n_corner : 4, n_fill = body->element ? body->n_element : n_simplex;
    const int32_t *element = body->element ? body->element : simplex;
    for (int e = 0; body->fill && element && !body->interpolation && e < n_fill; e++) {
        double at[3];
        find_centroid(body->x_rest, element + (size_t)e * (size_t)n_corner, n_corner, at);
        if ((double)body->fill[e] < PAL_WEAK_FILL) weak(&out->thin, e, (double)body->fill[e], at, body);
    }
    out->n_element = body->element         ? body->n_element
                     : body->dofs.n_clique ? pal_dofs_element_count(&body->dofs)
                                           : n_simplex;
}

static void check_masses(const pal_body *body, pal_preflight_body *out)
{
    double mass = 0;
    for (int k = 0; k < body->n_active; k++) mass += body->mass_kg[pal_body_point(body, k)];
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        out->n_fixed += body->support[i] != 0;
        if (!body->support[i] && body->mass_kg[i] < PAL_WEAK_MASS * mass / body->n_active)
            weak(&out->light, i, body->mass_kg[i], body->x_rest + 3 * (size_t)i, body);
    }
}

/* ---- conditioning ---- */

/* forces of the components at rest + step_m v, assembled to the points */
static void force_at(probe *p, const double *v, double step_m, double *out)
{
    pal_body *body = p->body;
    for (int i = 0; i < 3 * body->n_dof; i++) body->x[i] = p->x[i] + step_m * v[i];
    pal_body_update_nodes(body);
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    pal_step at = {.body = body, .force = p->force, .n_force = p->n_force, .dt_s = 1e-3, .n_sub = 1};
    const uint64_t before = pal_clock_thread_ns();
    for (int i = 0; i < p->n_force; i++) p->failed |= p->force[i].effect->run(p->force[i].self, &at) != PAL_ERR_OK;
    p->spent_ns += pal_clock_thread_ns() - before;
    p->n_run++;
    pal_system_restrict(body, body->f, out);
}

/* out = K v at the free points */
static void apply(void *user, const double *v, double *out)
{
    probe *p = user;
    const pal_body *body = p->body;
    double max = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) max = fmax(max, fabs(v[i]));
    double step = max > 0 ? p->step_m / max : 0;
    force_at(p, v, -step, p->low);
    force_at(p, v, step, out);
    for (int i = 0; i < 3 * body->n_dof; i++) {
        bool moves = body->mass_kg[i / 3] > 0 && !body->support[i / 3];
        out[i] = moves && step > 0 ? (p->low[i] - out[i]) / (2 * step) : 0;
    }
}

static bool apply_lanczos(void *user, const double *v, double *out)
{
    apply(user, v, out);
    return !((probe *)user)->failed;
}

static bool over_mass(void *user, const double *b, double *out)
{
    const pal_body *body = ((const probe *)user)->body;
    for (int i = 0; i < 3 * body->n_dof; i++)
        out[i] = body->mass_kg[i / 3] > 0 && !body->support[i / 3] ? b[i] / body->mass_kg[i / 3] : 0;
    return true;
}

static double find_fastest(probe *p, double *room)
{
    const pal_body *body = p->body;
    int n = 3 * body->n_dof;
    double *basis = calloc((size_t)MAX_LANCZOS * (size_t)n, sizeof *basis);
    if (!basis) return NAN;
    pal_lanczos l = {.n = n,
                     .multiply = apply_lanczos,
                     .solve = over_mass,
                     .user = p,
                     .z = room,
                     .basis = basis,
                     .n_basis = MAX_LANCZOS,
                     .w = room + n,
                     .u = room + 2 * (size_t)n};
    uint64_t seed = 7;
    for (int i = 0; i < n; i++) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        l.z[i] = body->support[i / 3] ? 0 : body->mass_kg[i / 3] * ((double)(seed >> 11) * 0x1p-53 - 0.5);
    }
    (void)pal_lanczos_run(&l, 0.02, 4, MAX_LANCZOS);
    free(basis);
    return sqrt(l.ritz);
}

static bool find_modes(probe *p, pal_preflight_body *out)
{
    pal_body *body = p->body;
    size_t n = 3 * (size_t)body->n_dof;
    double *room = calloc(5 * n + 1, sizeof *room);
    if (!room) return false;
    p->x = room + 3 * n, p->low = room + 4 * n;
    p->step_m = PAL_DIFFERENCE_H * body->edge_m;
    memcpy(p->x, body->x, n * sizeof(double));
    out->omega_max_1_s = out->n_fixed < body->n_active ? find_fastest(p, room) : (double)NAN;
    out->omega_min_1_s = body->lowest_1_s > 0 ? body->lowest_1_s : (double)NAN;
    out->omega_min_error = body->lowest_error;
    out->condition = out->omega_max_1_s * out->omega_max_1_s / (out->omega_min_1_s * out->omega_min_1_s);
    out->slowest_period_s = 2 * M_PI / out->omega_min_1_s;
    memcpy(body->x, p->x, n * sizeof(double));
    pal_body_update_nodes(body);
    free(room);
    return true;
}

/* ---- cost ---- */

/* A step under load. The forces cost what they took on average in the evaluations for the modes, whatever components
 * they are; the rest is counted, with ns measured by `palpate bench` on the machine of README's tables. Explicit:
 * forces and one pass over the points for every sub-step, four of each with rk4, the conjugate gradients of the mass
 * matrix with central_cg. Implicit: four iterations, each with one application of the components and two passes through
 * the factor, plus forces, stiffness and energy. */
static double predict_ms(const probe *p, const pal_body *body, int n_sub, int b)
{
    const double forces = (double)p->spent_ns / p->n_run;
    pal_solve_report report;
    if (p->n_run == 0 || pal_world_find_component(p->world, b, "static_newton") >= 0) return NAN;
    (void)pal_world_solve_report(p->world, b, &report);
    double shown = (body->display.skin ? 11.6 : 1.0) * body->display.n_shown, min = 1500;
    if (body->implicit) {
        const double iterations = 4, factor = 0.9 * (double)report.factor_nonzeros;
        return 1e-6 * (forces * (5 + iterations) + iterations * (factor + 30.0 * body->n_dof) + shown);
    }
    const int evaluations = pal_world_find_component(p->world, b, "rk4") >= 0 ? 4 : 1;
    const double solve = (pal_world_find_component(p->world, b, "central_cg") >= 0 ? 200.0 : 12.0) * body->n_active;
    return 1e-6 * (n_sub * (evaluations * (forces + solve) + min) + shown + 2 * min);
}

/* ---- elements that lock ---- */

static void find_locking(const pal_body_def *def, pal_preflight_body *out)
{
    if (strcmp(def->model.name, "fem")) return;
    const char *element = def->mesh->hexes.n_hex > 0 ? "hex8_bbar" : "tet4";
    for (int i = 0; i < def->model.n_value; i++)
        if (!strcmp(def->model.value[i].key, "element")) element = def->model.value[i].text;
    out->poisson = def->material.poisson;
    for (int r = 0; r < def->n_region; r++) {
        const pal_region *region = &def->region[r];
        const int n =
            region->kind == PAL_REGION_GRID && region->grid_poisson ? region->n[0] * region->n[1] * region->n[2] : 0;
        out->poisson = fmax(out->poisson, region->poisson);
        for (int i = 0; i < n; i++) out->poisson = fmax(out->poisson, region->grid_poisson[i]);
    }
    const bool hex = !strcmp(element, "hex8"), tet = !strcmp(element, "tet4");
    if ((!hex && !tet) || !(out->poisson > PAL_LOCKING_POISSON)) return;
    out->locks = hex ? "hex8" : "tet4";
    out->instead = def->mesh->hexes.n_hex > 0 ? "hex8_bbar" : "tet10";
}

/* ---- whole scene ---- */

/* the components of a body that make forces */
static void find_forces(pal_world *world, probe *p)
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        const pal_component *component = pal_world_component(world, i);
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        if (info.body != p->body->name || component->effect->stage != PAL_STAGE_FORCE || p->n_force == 32) continue;
        p->force[p->n_force++] = *component;
    }
}

static int count_substeps(const pal_body *body, double step_s)
{
    return isfinite(body->dt_limit_s) ? (int)ceil(step_s / body->dt_limit_s * (1 - 1e-12)) : 1;
}

static pal_err check_body(pal_world *world, const pal_scene *scene, int b, pal_preflight_body *out)
{
    pal_body *body = pal_world_body(world, b);
    probe p = {.world = world, .body = body};
    if (!(body->lowest_1_s > 0)) PAL_TRY(pal_world_find_lowest(world, b, NULL));
    find_forces(world, &p);
    *out = (pal_preflight_body){.name = scene->body[b].name,
                                .n_point = body->n_dof,
                                .n_node = body->n_node,
                                .limit_s = body->dt_limit_s,
                                .limit_edge_m = INFINITY};
    out->n_sub = count_substeps(body, scene->step_s);
    double omega2;
    out->limit_node = pal_world_limit_node(world, b, &omega2);
    if (out->limit_node >= 0) {
        out->limit_mass_kg = body->mass_kg[out->limit_node];
        pal_add3(out->limit_at_m, body->x_rest + 3 * (size_t)out->limit_node, body->offset_m);
    }
    check_elements(body, pal_world_find_component(world, b, "tet_volume") >= 0, out);
    check_masses(body, out);
    find_locking(&scene->body[b], out);
    if (!find_modes(&p, out)) return PAL_ERR_MEMORY;
    out->return_s = body->lowest_1_s > 0 ? pal_body_return_s(body) : (double)NAN;
    (void)pal_preflight_slow(body, out->slow);
    out->predicted_ms = predict_ms(&p, body, out->n_sub, b);
    return PAL_ERR_OK;
}

pal_err pal_preflight_run(const pal_scene *scene, pal_preflight *out, pal_diagnostic *diag)
{
    pal_world *world = NULL;
    *out = (pal_preflight){.n_body = scene->n_body};
    PAL_TRY(pal_world_create(scene, diag, &world));
    out->n_byte = pal_world_bytes(world);
    pal_err err = PAL_ERR_OK;
    for (int b = 0; b < scene->n_body && !err; b++) {
        err = check_body(world, scene, b, &out->body[b]);
        out->predicted_ms += out->body[b].predicted_ms;
    }
    pal_world_destroy(world);
    return err;
}

/* of one body, from the fastest of a few evaluations: others may keep the processor busy */
static double cost_of_body(pal_world *world, double step_s, int b)
{
    pal_body *body = pal_world_body(world, b);
    const size_t n = 3 * (size_t)body->n_dof;
    double best = INFINITY, *room = calloc(3 * n + 1, sizeof *room);
    probe p = {.world = world, .body = body};
    if (!room) return NAN;
    find_forces(world, &p);
    p.x = room;
    memcpy(p.x, body->x, n * sizeof(double));
    for (int k = 0; k < PAL_COST_EVALUATIONS; k++) {
        p.spent_ns = 0, p.n_run = 0;
        force_at(&p, room + n, 0, room + 2 * n);
        best = fmin(best, predict_ms(&p, body, count_substeps(body, step_s), b));
    }
    memcpy(body->x, p.x, n * sizeof(double));
    pal_body_update_nodes(body);
    free(room);
    return isfinite(best) ? best : NAN;
}

double pal_step_cost_ms(const pal_scene *scene, pal_world *world)
{
    uint64_t n_output[PAL_BODY_MAX];
    double ms = 0;
    for (int b = 0; b < scene->n_body; b++) {
        n_output[b] = pal_world_body(world, b)->display.n_output;
        ms += cost_of_body(world, scene->step_s, b);
    }
    /* forces leave traces in what components keep between steps; what is shown is as before */
    pal_world_reset(world);
    for (int b = 0; b < scene->n_body; b++) pal_world_body(world, b)->display.n_output = n_output[b];
    return ms;
}

/* ---- sentences ---- */

bool pal_preflight_slow(const pal_body *body, char line[PAL_PREFLIGHT_LINE])
{
    const double return_s = pal_body_return_s(body);
    line[0] = 0;
    if (!(return_s > PAL_SLOW_RETURN_S)) return false;
    snprintf(line, PAL_PREFLIGHT_LINE,
             "it returns to rest slowly: a displacement falls to about a third in %.3g s (lowest frequency %.3g 1/s, "
             "drag %.3g "
             "1/s); stiffer material or more support is faster",
             return_s, body->lowest_1_s, body->damping_1_s);
    return true;
}

static void report_weak(const pal_weak_spot *w, const char *what, double scale, const char *unit, int *n,
                        char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE])
{
    if (w->n == 0) return;
    snprintf(line[(*n)++], PAL_PREFLIGHT_LINE, "%d %s: the worst is %d at (%.4g, %.4g, %.4g) mm, %.2g%s", w->n, what,
             w->worst, 1e3 * w->at_m[0], 1e3 * w->at_m[1], 1e3 * w->at_m[2], scale * w->value, unit);
}

int pal_preflight_describe(const pal_preflight_body *b, char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE])
{
    int n = 0;
    if (b->locks)
        snprintf(line[n++], PAL_PREFLIGHT_LINE,
                 "element %s locks at Poisson's ratio %.4g: it rests stiffer than the material is; element %s does not",
                 b->locks, b->poisson, b->instead);
    if (isfinite(b->limit_s) && b->limit_node >= 0) {
        int used = snprintf(line[n], PAL_PREFLIGHT_LINE, "node %d at (%.4g, %.4g, %.4g) mm sets the limit of %.3g ms",
                            b->limit_node, 1e3 * b->limit_at_m[0], 1e3 * b->limit_at_m[1], 1e3 * b->limit_at_m[2],
                            1e3 * b->limit_s);
        if (isfinite(b->limit_edge_m))
            snprintf(line[n] + used, PAL_PREFLIGHT_LINE - (size_t)used, ": an edge of %.3g mm, %.2g g",
                     1e3 * b->limit_edge_m, 1e3 * b->limit_mass_kg);
        n++;
    }
    report_weak(&b->edge, "edges have next to no length", 1e3, " mm", &n, line);
    report_weak(&b->flat, "elements are badly shaped", 1, " of a regular one", &n, line);
    if (b->n_sliver > 0)
        snprintf(line[n++], PAL_PREFLIGHT_LINE, "%d of them %s: springs leave the volume out", b->n_sliver,
                 b->n_sliver == 1 ? "is a sliver" : "are slivers");
    report_weak(&b->thin, "elements are hardly filled", 100, " %", &n, line);
    report_weak(&b->light, "nodes are very light", 1e3, " g", &n, line);
    if (isfinite(b->condition))
        snprintf(
            line[n++], PAL_PREFLIGHT_LINE,
            "condition %.2g: its slowest motion takes %.3g s (to %.1g %%), its fastest %.3g ms; a displacement falls "
            "to about a third in %.3g s",
            b->condition, b->slowest_period_s, fmax(100 * b->omega_min_error, 0.1), 2e3 * M_PI / b->omega_max_1_s,
            b->return_s);
    else if (isfinite(b->omega_max_1_s) && b->n_fixed == 0)
        snprintf(line[n++], PAL_PREFLIGHT_LINE, "no support holds it; its fastest motion takes %.3g ms",
                 2e3 * M_PI / b->omega_max_1_s);
    else if (isfinite(b->omega_max_1_s) && b->n_fixed > 0)
        snprintf(
            line[n++], PAL_PREFLIGHT_LINE,
            "its slowest motion is not known: part of it is not held, or it is too large; its fastest takes %.3g ms",
            2e3 * M_PI / b->omega_max_1_s);
    if (b->slow[0]) snprintf(line[n++], PAL_PREFLIGHT_LINE, "%s", b->slow);
    return n;
}
