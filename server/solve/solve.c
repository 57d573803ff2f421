/* Solves a load case through the pipeline of a live scene: the same voxels, model and world, with the solver
 * static_newton.
 *
 * Moved supports: their nodes are set to rest + move in steps of at most half a voxel. Each step is solved, so that
 * no element inverts on the way. */
#include "server/solve/solve.h"

#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/files/vtk_file.h"
#include "server/sim/elements/elastic_hex.h"
#include "server/sim/world/world.h"
#include "server/solve/surface_supports.h"
#include "server/solve/tuning.h"
#include "server/solve/voxel_refinement.h"

#include <stdio.h>
#include <string.h>

enum { NEWTON_A_STEP = 4, MAX_NEWTON = 400, MAX_RAMP = 40 };
static const double step_s = 1.0 / 60; /* not used by a static solver */

struct pal_solution {
    pal_prepared mesh;
    pal_world *world;
    pal_locate *locate;
    pal_body *body;
    pal_ground ground; /* n 0: supports hold nodes */
    bool hex;
};

typedef struct job {
    const pal_problem *problem;
    const pal_problem_case *load_case;
    const pal_solve_options *options;
    pal_solution *s;
    pal_solve_result *result;
    pal_diagnostic *diag;
} job;

static bool report_progress(const job *j, const char *what, double fraction)
{
    return !j->options->progress || j->options->progress(what, fraction, j->options->user);
}

/* material `index` with the replacements of the options */
static pal_err material_of(const job *j, int index, pal_material *out)
{
    const pal_problem_material *m = &j->problem->material[index];
    const pal_solve_options *o = j->options;
    *out = (pal_material){.young_Pa = isnan(o->young_Pa) ? m->young_Pa : o->young_Pa,
                          .poisson = isnan(o->poisson) ? m->poisson : o->poisson,
                          .density_kg_m3 = m->density_kg_m3};
    pal_diagnostic reason = {""};
    double asked = out->poisson;
    if (!(asked > -1 && asked < 0.5))
        return PAL_REFUSE(j->diag,
                          "material \"%s\": nu %g is not a Poisson ratio: wanted more than -1 and less than 0.5", m->id,
                          asked);
    if (!(out->young_Pa > 0))
        return PAL_REFUSE(j->diag, "material \"%s\": E %g Pa is not a stiffness: wanted more than 0", m->id,
                          out->young_Pa);
    pal_err err = pal_material_check(out, &reason);
    j->result->clamped |= out->poisson != asked;
    return err ? pal_diagnostic_set(j->diag, err, "material \"%s\": %s", m->id, reason.text) : PAL_ERR_OK;
}

/* the first material is the body's own; all others, and the first unless it is everywhere, are regions */
static pal_err set_materials(const job *j, pal_body_def *body)
{
    const pal_problem *p = j->problem;
    const double *origin = j->s->mesh.tets.origin_m;
    if (p->n_material > 1 && (!isnan(j->options->young_Pa) || !isnan(j->options->poisson)))
        return PAL_REFUSE(j->diag, "E or nu is given, but the problem has %d materials", p->n_material);
    PAL_TRY(material_of(j, 0, &body->material));
    for (int k = 1; k < p->n_material; k++) {
        pal_material m;
        PAL_TRY(material_of(j, k, &m));
        pal_region *r = &body->region[body->n_region++];
        *r = (pal_region){
            .kind = PAL_REGION_BOX, .young_Pa = m.young_Pa, .poisson = m.poisson, .density_kg_m3 = m.density_kg_m3};
        pal_sub3(r->low_m, p->material[k].region.low_m, origin);
        pal_sub3(r->high_m, p->material[k].region.high_m, origin);
    }
    /* every voxel must have a material */
    const pal_tets *t = &j->s->mesh.tets;
    double x[3];
    for (int e = 0; e < t->n_tet && !p->material[0].region.all; e++)
        if (!pal_case_material_of(p, t, e, x))
            return PAL_REFUSE(j->diag, "materials: none of the %d regions holds (%g, %g, %g)", p->n_material, x[0],
                              x[1], x[2]);
    return PAL_ERR_OK;
}

static pal_err set_entries(const job *j, pal_body_def *body)
{
    const pal_solve_options *o = j->options;
    pal_entry_init(&body->model, "model", "fem");
    PAL_TRY(pal_entry_put_text(&body->model, "element", o->element, j->diag));
    PAL_TRY(pal_entry_put_text(&body->model, "law", o->law, j->diag));
    PAL_TRY(pal_entry_put_bool(&body->model, "fill", o->voxel.fill, j->diag));
    const bool softens = !strcmp(o->element, "hex8_bbar") && strcmp(o->law, "neo_hookean") != 0;
    if (softens)
        PAL_TRY(pal_entry_put_number(&body->model, "twist", o->twist > 0 ? o->twist : PAL_SOLVE_TWIST, j->diag));
    else if (o->twist > 0 && o->twist < 1)
        return PAL_REFUSE(j->diag, "twist %g: it is for hex8_bbar of linear or corotational law, not for %s of law %s",
                          o->twist, o->element, o->law);
    if (j->s->hex && !o->shares) PAL_TRY(pal_entry_put_bool(&body->model, "moment_fitting", true, j->diag));
    pal_entry_init(&body->solver, "solver", "static_newton");
    PAL_TRY(pal_entry_put_number(&body->solver, "tolerance", o->tolerance > 0 ? o->tolerance : 1e-8, j->diag));
    PAL_TRY(pal_entry_put_number(&body->solver, "newton", NEWTON_A_STEP, j->diag));
    if (o->linear) PAL_TRY(pal_entry_put_text(&body->solver, "linear", o->linear, j->diag));
    if (o->inertia_relief && j->problem->n_support == 0)
        PAL_TRY(pal_entry_put_text(&body->solver, "free", "inertia_relief", j->diag));
    return PAL_ERR_OK;
}

/* supports on their surface where the voxels' weights are known and the surface is closed */
static pal_err set_supports(const job *j, pal_body_def *body)
{
    pal_solution *s = j->s;
    pal_surface_topology topology = {.closed = false};
    bool surface =
        s->hex && !j->options->hold_nodes && !j->options->shares && j->options->voxel.fill && s->mesh.hexes.weight;
    for (int k = 0; k < j->problem->n_support; k++)
        surface = surface && (!j->problem->support[k].region.all || j->problem->support[k].has_normal);
    if (surface && pal_surface_check(&s->mesh.surface, &topology))
        return pal_diagnostic_set(j->diag, PAL_ERR_MEMORY, "no memory to look at the surface");
    if (!surface || !topology.closed) {
        body->n_support = j->problem->n_support;
        return pal_case_supports(j->problem, &s->mesh.tets, body->support, j->diag);
    }
    PAL_TRY(pal_surface_supports_make(j->problem, j->options->young_Pa, s->locate, &s->mesh, &s->ground, j->diag));
    body->n_support = pal_surface_supports_held(j->problem, &s->mesh, body->support);
    body->ground = &s->ground;
    return PAL_ERR_OK;
}

static pal_err make_world(const job *j)
{
    if (j->problem->n_support == 0 && !j->options->inertia_relief)
        return PAL_REFUSE(j->diag,
                          "supports: none, so the body is free and nothing holds it against its loads (inertia relief "
                          "balances them by its mass)");
    pal_scene *scene = calloc(1, sizeof *scene);
    if (!scene) return pal_diagnostic_set(j->diag, PAL_ERR_MEMORY, "no memory for the scene");
    pal_scene_default(scene);
    pal_body_def *body = &scene->body[0];
    scene->step_s = step_s;
    scene->n_tool = 0;
    scene->n_body = 1;
    pal_body_default(body, "body", &j->s->mesh);
    body->n_effect = 0;
    body->output.name[0] = 0;
    pal_err err = set_materials(j, body);
    body->material.damping_1_s = 0;
    if (!err) err = set_supports(j, body);
    if (!err) err = set_entries(j, body);
    if (!err) err = pal_world_create(scene, j->diag, &j->s->world);
    free(scene);
    if (err) return err;
    j->s->body = pal_world_body(j->s->world, 0);
    j->s->body->load_cap_N = INFINITY;
    return PAL_ERR_OK;
}

static pal_err set_loads(const job *j)
{
    pal_solution *s = j->s;
    const pal_body *b = s->body;
    double *f = calloc(3 * (size_t)b->n_node, sizeof *f);
    if (!f) return pal_diagnostic_set(j->diag, PAL_ERR_MEMORY, "no memory for the loads");
    pal_err err =
        pal_case_forces(j->problem, j->load_case, -1, b, s->locate, &s->mesh.surface, f, j->result->area_m2, j->diag);
    for (int i = 0; i < b->n_node && !err; i++) {
        pal_add3(j->result->load_N, j->result->load_N, f + 3 * i);
        err = pal_world_load(s->world, 0, i, f + 3 * i);
        if (err) pal_diagnostic_set(j->diag, err, "loads: node %d takes no load of %g N", i, pal_norm3(f + 3 * i));
    }
    free(f);
    return err;
}

/* moves the nodes of moved supports to rest + share * move; later supports win */
static void move_supports(const job *j, double share)
{
    pal_body *b = j->s->body;
    pal_surface_supports_move(&j->s->ground, j->problem, share);
    for (int i = 0; i < b->n_node; i++) {
        double x[3];
        if (!b->support[i]) continue;
        pal_add3(x, b->x_rest + 3 * i, j->s->mesh.tets.origin_m);
        for (int k = 0; k < j->problem->n_support; k++)
            if (pal_box_contains(&j->problem->support[k].region, x, pal_case_tolerance_m(&j->s->mesh.tets))) {
                pal_copy3(b->x + 3 * i, b->x_rest + 3 * i);
                pal_axpy3(b->x + 3 * i, share, j->problem->support[k].move_m);
            }
    }
    pal_world_invalidate_limits(j->s->world, 0);
}

/* steps the world until its solver meets the tolerance */
static pal_err converge(const job *j, double fraction)
{
    int max = j->options->max_newton > 0 ? j->options->max_newton : MAX_NEWTON;
    for (;;) {
        char what[80];
        pal_solve_report report;
        pal_err err = pal_world_step(j->s->world, step_s);
        pal_world_solve_report(j->s->world, 0, &report);
        j->result->n_newton += report.n_newton;
        j->result->n_cg += report.n_cg;
        j->result->residual = report.residual;
        if (err || j->s->body->frozen)
            return pal_diagnostic_set(j->diag, PAL_ERR_NUMERIC,
                                      "no solution: the body froze after %d iterations at a residual of %g",
                                      j->result->n_newton, report.residual);
        if (report.converged) return PAL_ERR_OK;
        if (j->result->n_newton >= max || report.n_newton == 0)
            return pal_diagnostic_set(j->diag, PAL_ERR_NUMERIC,
                                      "no solution after %d iterations: residual %g, step size %g", j->result->n_newton,
                                      report.residual, report.step_size);
        snprintf(what, sizeof what, "solve: iteration %d, residual %.2g", j->result->n_newton, report.residual);
        if (!report_progress(j, what, fraction))
            return pal_diagnostic_set(j->diag, PAL_ERR_STATE, "stopped after %d iterations", j->result->n_newton);
    }
}

static pal_err solve(const job *j)
{
    double max_m = 0;
    for (int k = 0; k < j->problem->n_support; k++) max_m = fmax(max_m, pal_norm3(j->problem->support[k].move_m));
    const int ramp = (int)fmin(MAX_RAMP, ceil(max_m / (0.5 * j->s->body->edge_m)));
    if (ramp == 0) return converge(j, 0);
    for (int k = 1; k <= ramp; k++) {
        move_supports(j, (double)k / ramp);
        PAL_TRY(converge(j, (double)k / ramp));
    }
    return PAL_ERR_OK;
}

/* Writes the solver's time for assembly and factorisation since loading to the result; returns the sum. */
static double factored(const job *j)
{
    pal_solve_report report;
    if (!j->s->world || !pal_world_solve_report(j->s->world, 0, &report)) return 0;
    j->result->assemble_s = report.assemble_s;
    j->result->factor_s = report.analyse_s + report.factor_s;
    return j->result->assemble_s + j->result->factor_s;
}

/* the penalty's forces sum over the shape functions, which are 1 together */
static void add_ground_reaction(const pal_solution *s, double sum_N[3])
{
    const pal_body *b = s->body;
    for (int i = 0; i < s->ground.n; i++) {
        const pal_ground_item *item = &s->ground.item[i];
        for (int p = 0; p < 64; p++) {
            const int c = p / 8, d = p % 8;
            const double k = item->k_N_m[c <= d ? pal_hex_pair(c, d) : pal_hex_pair(d, c)];
            const int32_t node = b->hexes->node[8 * item->element + d];
            for (int a = 0; a < 3; a++)
                sum_N[a] -= k * (b->x[3 * node + a] - b->x_rest[3 * node + a] - item->move_m[a]);
        }
    }
}

static void sum_up(const job *j)
{
    const pal_body *b = j->s->body;
    pal_solve_result *r = j->result;
    for (int i = 0; i < b->n_node; i++) {
        double u[3];
        pal_sub3(u, b->x + 3 * i, b->x_rest + 3 * i);
        r->max_m = fmax(r->max_m, pal_norm3(u));
        r->work_J += b->external_force ? pal_dot3(b->external_force + 3 * i, u) : 0;
        if (b->support[i]) pal_axpy3(r->reaction_N, -1, b->f + 3 * i);
    }
    add_ground_reaction(j->s, r->reaction_N);
    r->energy_J = pal_world_energy_J(j->s->world);
}

/* volume of the material: each element by its filled share */
static double volume_of(const pal_solution *s)
{
    const pal_body *b = s->body;
    double sum = 0, cube = b->edge_m * b->edge_m * b->edge_m;
    for (int e = 0; e < b->n_element; e++) {
        const int32_t *node = b->element + (size_t)b->n_corner * (size_t)e;
        sum += (b->fill ? (double)b->fill[e] : 1) * (s->hex ? cube : pal_tet_volume(b->x_rest, node));
    }
    return sum;
}

static pal_err prepare(const job *j, const pal_surface *surface)
{
    const pal_solve_options *o = j->options;
    pal_solution *s = j->s;
    pal_case_voxel_options voxel = o->voxel;
    s->hex = !strncmp(o->element, "hex8", 4);
    if (s->hex && voxel.fill && !o->shares && !(voxel.min_fill > 0)) voxel.min_fill = PAL_FILL_MIN;
    PAL_TRY(pal_case_voxels(j->problem, surface, &voxel, &s->mesh, j->diag));
    if (o->shares) {
        free(s->mesh.hexes.weight);
        s->mesh.hexes.weight = NULL;
    }
    if (o->split > 1) PAL_TRY(pal_refine_voxels(&s->mesh, o->split, j->diag));
    pal_err err = pal_locate_create(&s->mesh.tets, s->hex ? &s->mesh.hexes : NULL, &s->locate);
    if (err) return pal_diagnostic_set(j->diag, err, "no memory to find points in the mesh");
    PAL_TRY(make_world(j));
    const pal_body *b = s->body;
    j->result->n_node = b->n_node;
    j->result->n_element = b->n_element;
    j->result->edge_m = b->edge_m;
    j->result->volume_m3 = volume_of(s);
    for (int i = 0; i < b->n_node; i++) j->result->n_fixed += b->support[i] != 0;
    j->result->n_dof = 3 * (b->n_node - j->result->n_fixed);
    return PAL_ERR_OK;
}

pal_err pal_solve(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                  const pal_solve_options *options, pal_solution **out, pal_solve_result *result, pal_diagnostic *diag)
{
    pal_diagnostic own = {""};
    double start = pal_clock_s();
    *result = (pal_solve_result){0};
    job j = {.problem = problem,
             .load_case = load_case,
             .options = options,
             .s = calloc(1, sizeof *j.s),
             .result = result,
             .diag = diag ? diag : &own};
    if (!j.s) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a solution");
    report_progress(&j, "prepare", 0);
    pal_err err = prepare(&j, surface);
    if (!err) err = set_loads(&j);
    double ready = pal_clock_s(), early_s = factored(&j);
    result->prepare_s = ready - start - early_s;
    if (!err && !report_progress(&j, "solve", 0))
        err = pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped before the first iteration");
    if (!err) err = solve(&j);
    if (!err) sum_up(&j);
    double end = pal_clock_s();
    result->total_s = end - start;
    result->solve_s = fmax(0, end - ready + early_s - factored(&j));
    if (err)
        pal_solution_free(j.s);
    else
        *out = j.s;
    return err;
}

void pal_solution_free(pal_solution *solution)
{
    if (!solution) return;
    pal_locate_destroy(solution->locate);
    pal_world_destroy(solution->world);
    free(solution->ground.item);
    pal_prepared_free(&solution->mesh);
    free(solution);
}

void pal_solution_at(const pal_solution *s, const double x[3], double u[3])
{
    double at[3], local[4], n[10];
    const pal_body *b = s->body;
    const int32_t *node;
    pal_sub3(at, x, s->mesh.tets.origin_m);
    int element = pal_locate_point(s->locate, at, local, NULL),
        n_corner = pal_case_shape_functions(b, element, local, n, &node);
    pal_set3(u, 0, 0, 0);
    for (int k = 0; k < n_corner; k++) {
        pal_axpy3(u, n[k], b->x + 3 * node[k]);
        pal_axpy3(u, -n[k], b->x_rest + 3 * node[k]);
    }
}

pal_err pal_solution_csv(const pal_solution *s, const char *path, pal_diagnostic *diag)
{
    const pal_body *b = s->body;
    pal_samples all = {.n = b->n_node};
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, all.x, 3 * (size_t)b->n_node);
    PAL_ARRAY(&err, all.u, 3 * (size_t)b->n_node);
    if (err) pal_diagnostic_set(diag, err, "%s: no memory for %d nodes", path, b->n_node);
    for (int i = 0; i < b->n_node && !err; i++) {
        pal_add3(all.x + 3 * i, b->x_rest + 3 * i, s->mesh.tets.origin_m);
        pal_sub3(all.u + 3 * i, b->x + 3 * i, b->x_rest + 3 * i);
    }
    if (!err) err = pal_samples_write(&all, path, diag);
    pal_samples_free(&all);
    return err;
}

/* von Mises stress at the nodes: volume-weighted mean over the elements around a node */
static void measure_stress(const pal_solution *s, double *stress_Pa, double *volume_m3)
{
    const pal_body *b = s->body;
    for (int r = 0; r < pal_world_component_count(s->world); r++) {
        const pal_component *c = pal_world_component(s->world, r);
        if (c->effect->inspect.measure)
            c->effect->inspect.measure(c->self, b, PAL_FIELD_VON_MISES_PA, stress_Pa, volume_m3);
    }
    for (int i = 0; i < b->n_node; i++) stress_Pa[i] = volume_m3[i] > 0 ? stress_Pa[i] / volume_m3[i] : 0;
}

static pal_err write_vtk(const pal_solution *s, const char *path, const double *moved, const double *stress,
                         pal_diagnostic *diag)
{
    const pal_body *b = s->body;
    const pal_vtk_field field[2] = {{"displacement_m", 3, moved}, {"von_mises_Pa", 1, stress}};
    const pal_vtk_grid grid = {.title = "palpate solve",
                               .n_node = b->n_node,
                               .n_element = b->n_element,
                               .n_corner = b->n_corner,
                               .x = b->x_rest,
                               .origin_m = s->mesh.tets.origin_m,
                               .node = b->element,
                               .n_point = 2,
                               .point = field};
    return pal_mesh_write_vtk(path, &grid, diag);
}

pal_err pal_solution_vtk(const pal_solution *s, const char *path, pal_diagnostic *diag)
{
    const pal_body *b = s->body;
    size_t n = (size_t)b->n_node;
    double *stress, *volume, *moved;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, stress, n);
    PAL_ZEROED(&err, volume, n);
    PAL_ZEROED(&err, moved, 3 * n);
    if (err) pal_diagnostic_set(diag, err, "%s: no memory for %d nodes", path, b->n_node);
    if (!err) measure_stress(s, stress, volume);
    for (size_t k = 0; k < 3 * n && !err; k++) moved[k] = b->x[k] - b->x_rest[k];
    if (!err) err = write_vtk(s, path, moved, stress, diag);
    PAL_FREE(moved, stress, volume);
    return err;
}
