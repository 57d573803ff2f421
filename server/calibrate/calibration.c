/* Makes a calibration: voxels, springs, loads, truths, parameters. */
#include "server/calibrate/calibration.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/solve/solve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct job {
    pal_calibration *c;
    const pal_surface *surface;
    pal_locate *locate;
    pal_diagnostic *diag;
} job;

void pal_calibrate_default(pal_calibrate_options *options)
{
    *options = (pal_calibrate_options){
        .voxel = {.resolution = 20, .fill = true, .align = true}, .split = 2, .decades = 3, .smooth = 0.1, .pull = 0.1};
}

static pal_err no_memory(const job *j, const char *what)
{
    return pal_diagnostic_set(j->diag, PAL_ERR_MEMORY, "no memory for %s", what);
}

/* ---- the body ---- */

/* Means over the volume, as deviations from the first material: a value common to all is kept bit by bit. */
static void take_material(pal_calibration *c)
{
    const pal_tets *t = &c->mesh.tets;
    const pal_problem_material *first = &c->problem->material[0];
    double young = 0, poisson = first->poisson, density = first->density_kg_m3;
    for (int e = 0; e < t->n_tet; e++) {
        double x[3];
        const pal_problem_material *m = pal_case_material_of(c->problem, t, e, x);
        if (!m) m = first;
        young += log(m->young_Pa / first->young_Pa) / t->n_tet;
        poisson += (m->poisson - first->poisson) / t->n_tet;
        density += (m->density_kg_m3 - first->density_kg_m3) / t->n_tet;
        c->info.clamped |= m->poisson > PAL_POISSON_CLAMP;
    }
    c->info.mean_young_Pa = first->young_Pa * exp(young);
    c->info.mean_poisson = fmin(poisson, PAL_POISSON_CLAMP);
    c->info.mean_density_kg_m3 = density;
}

static pal_err make_world(const job *j)
{
    pal_calibration *c = j->c;
    pal_scene *scene = calloc(1, sizeof *scene);
    if (!scene) return no_memory(j, "the scene");
    pal_scene_default(scene);
    pal_body_def *body = &scene->body[0];
    scene->n_tool = 0;
    scene->n_body = 1;
    pal_body_default(body, "body", &c->mesh);
    body->n_effect = 0;
    body->output.name[0] = 0;
    body->material = (pal_material){.young_Pa = 1, .poisson = 0.4, .density_kg_m3 = c->info.mean_density_kg_m3};
    body->n_support = c->problem->n_support;
    memcpy(body->support, c->support, sizeof c->support);
    /* constants of 1 J: only the weights of the components are used */
    static const char *const key[PAL_SPRING_KINDS] = {"k_distance_J", "k_area_J", "k_volume_J"};
    pal_entry_init(&body->model, "model", "tet_springs");
    pal_err err = pal_entry_put_text(&body->model, "weights", c->options.equal ? "equal" : "volume", j->diag);
    for (int k = 0; k < PAL_SPRING_KINDS && !err; k++)
        err = pal_entry_put_number(&body->model, key[k], k == PAL_SPRING_AREA && c->options.without_area ? 0 : 1,
                                   j->diag);
    scene->step_s = 1e-4; /* never used; springs of 1 J have their own limit */
    scene->max_substep = 2000;
    if (!err) err = pal_world_create(scene, j->diag, &c->world);
    free(scene);
    return err ? err : pal_lattice_make(c->world, 0, &c->lattice, j->diag);
}

/* With all fixed nodes on one line the body can rotate about it: neither truth nor springs have an equilibrium. */
static pal_err check_hold(const job *j)
{
    const pal_lattice *l = &j->c->lattice;
    double first[3] = {0}, along[3] = {0}, d[3], out[3], longest = 0, widest = 0;
    int n_fixed = 0;
    for (int i = 0; i < l->n_node; i++) {
        if (!l->fixed[i]) continue;
        if (n_fixed++ == 0) pal_copy3(first, l->x_rest + 3 * i);
        pal_sub3(d, l->x_rest + 3 * i, first);
        if (pal_norm3(d) <= longest) continue;
        longest = pal_norm3(d);
        pal_copy3(along, d);
    }
    for (int i = 0; i < l->n_node && longest > 0; i++) {
        if (!l->fixed[i]) continue;
        pal_sub3(d, l->x_rest + 3 * i, first);
        pal_cross3(out, along, d);
        widest = fmax(widest, pal_norm3(out) / longest);
    }
    if (widest > 1e-6 * l->edge_m) return PAL_ERR_OK;
    return PAL_REFUSE(j->diag, "supports: held nodes: %d, all on one line, so the body turns and comes to no rest",
                      n_fixed);
}

static pal_err make_body(const job *j)
{
    pal_calibration *c = j->c;
    if (c->problem->n_support == 0)
        return PAL_REFUSE(j->diag,
                          "supports: none, so nothing holds the body against its loads and it comes to no rest");
    PAL_TRY(pal_case_voxels(c->problem, j->surface, &c->options.voxel, &c->mesh, j->diag));
    PAL_TRY(pal_case_supports(c->problem, &c->mesh.tets, c->support, j->diag));
    take_material(c);
    PAL_TRY(make_world(j));
    return check_hold(j);
}

/* ---- loads ---- */

/* sums of |f| over all nodes and over the fixed ones */
static void sum_up(const pal_calibration *c, const double *f, double *all, double *fixed)
{
    *all = *fixed = 0;
    for (int i = 0; i < c->lattice.n_node; i++) {
        double size = pal_norm3(f + 3 * i);
        *all += size;
        if (c->lattice.fixed[i]) *fixed += size;
    }
}

static pal_err make_loads(const job *j, int index)
{
    pal_calibration *c = j->c;
    pal_fit_case *fit = &c->fit[index];
    const pal_problem_case *load_case = c->cases[index].load_case;
    const pal_body *body = pal_world_body(c->world, 0);
    size_t n = 3 * (size_t)body->n_node;
    double sum = 0, *one = PAL_NEW(c->arena, double, n);
    fit->force_N = PAL_NEW(c->arena, double, n);
    if (!one || !fit->force_N) return no_memory(j, "the loads");
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < load_case->n_load && !err; k++) {
        double all, fixed;
        memset(one, 0, n * sizeof *one);
        err = pal_case_forces(c->problem, load_case, k, body, j->locate, &c->mesh.surface, one, NULL, j->diag);
        if (err) break;
        sum_up(c, one, &all, &fixed);
        sum += all;
        if (load_case->load[k].kind != PAL_LOAD_GRAVITY && fixed > 0.5 * all)
            err = PAL_REFUSE(j->diag, "load_cases[%d].loads[%d]: %.0f %% of it stands on nodes that a support holds",
                             (int)(load_case - c->problem->load_case), k, 100 * fixed / all);
        for (size_t i = 0; i < n; i++) fit->force_N[i] += one[i];
    }
    if (err) return err;
    double left, fixed;
    sum_up(c, fit->force_N, &left, &fixed);
    if (!(sum > 0))
        return PAL_REFUSE(j->diag, "load case \"%s\": has no load, so there is nothing to fit", load_case->id);
    if (left <= 1e-9 * sum)
        return PAL_REFUSE(j->diag,
                          "load case \"%s\": its loads cancel each other at every node, so there is nothing to fit",
                          load_case->id);
    return PAL_ERR_OK;
}

/* ---- truths ---- */

static pal_err truth_by_elements(const job *j, int index)
{
    pal_calibration *c = j->c;
    pal_fit_case *fit = &c->fit[index];
    const pal_tets *t = &c->mesh.tets;
    pal_solve_options o = {.element = "hex8_bbar",
                           .hold_nodes = true, /* as the springs that are fitted */
                           .shares = true,
                           .twist = 1,
                           .law = fit->linear ? "linear" : "neo_hookean",
                           .voxel = c->options.voxel,
                           .split = c->options.split,
                           .young_Pa = NAN,
                           .poisson = NAN,
                           .progress = c->options.progress,
                           .user = c->options.user};
    pal_solution *solution = NULL;
    pal_solve_result result;
    pal_diagnostic reason = {""};
    pal_err err = pal_solve(c->problem, c->cases[index].load_case, j->surface, &o, &solution, &result, &reason);
    if (err) return pal_diagnostic_set(j->diag, err, "truth of \"%s\": %s", c->cases[index].load_case->id, reason.text);
    c->info.clamped |= result.clamped;
    fit->n_point = t->n_node;
    fit->u = PAL_NEW(c->arena, double, 3 * t->n_node);
    for (int i = 0; i < t->n_node && fit->u; i++) {
        double x[3];
        pal_add3(x, t->x + 3 * i, t->origin_m);
        pal_solution_at(solution, x, fit->u + 3 * i);
    }
    pal_solution_free(solution);
    return fit->u ? PAL_ERR_OK : no_memory(j, "the truth");
}

/* locates the points of the samples in the tetrahedra around them */
static pal_err truth_by_samples(const job *j, int index)
{
    pal_calibration *c = j->c;
    pal_fit_case *fit = &c->fit[index];
    const pal_samples *s = c->cases[index].samples;
    size_t n = (size_t)s->n;
    fit->n_point = s->n;
    fit->start = PAL_NEW(c->arena, int32_t, n + 1);
    fit->node = PAL_NEW(c->arena, int32_t, 4 * n);
    fit->weight = PAL_NEW(c->arena, double, 4 * n);
    fit->u = PAL_NEW(c->arena, double, 3 * n);
    if (!fit->start || !fit->node || !fit->weight || !fit->u) return no_memory(j, "the truth");
    memcpy(fit->u, s->u, 3 * n * sizeof *fit->u);
    for (int i = 0; i <= s->n; i++) fit->start[i] = 4 * i;
    for (int i = 0; i < s->n; i++) {
        double x[3], local[4];
        pal_sub3(x, s->x + 3 * i, c->mesh.tets.origin_m);
        int tet = pal_locate_point(j->locate, x, local, NULL);
        memcpy(fit->node + 4 * i, c->mesh.tets.tet + 4 * tet, 4 * sizeof *fit->node);
        memcpy(fit->weight + 4 * i, local, 4 * sizeof *fit->weight);
    }
    return PAL_ERR_OK;
}

static pal_err make_truth(const job *j, int index)
{
    pal_calibration *c = j->c;
    pal_fit_case *fit = &c->fit[index];
    const pal_calibrate_case *k = &c->cases[index];
    fit->linear = k->linear;
    if (c->options.progress && !c->options.progress("truth", (double)index / c->n_case, c->options.user))
        return pal_diagnostic_set(j->diag, PAL_ERR_STATE, "stopped before the truth of \"%s\"", k->load_case->id);
    PAL_TRY(k->samples ? truth_by_samples(j, index) : truth_by_elements(j, index));
    fit->max_m = pal_max_norm3(fit->u, fit->n_point);
    if (fit->max_m > 0) return PAL_ERR_OK;
    return PAL_REFUSE(j->diag, "load case \"%s\": its truth (%s) moves nothing", k->load_case->id,
                      k->truth_name ? k->truth_name : "finite elements");
}

/* ---- parameters ---- */

/* pairs of used nodes that are neighbours on the grid */
static pal_err make_edges(const job *j)
{
    pal_calibration *c = j->c;
    const int *n = c->grid.n;
    int64_t total = (int64_t)n[0] * n[1] * n[2], step[3] = {1, n[0], (int64_t)n[0] * n[1]};
    int32_t *number = PAL_NEW(c->arena, int32_t, total);
    c->edge = PAL_NEW(c->arena, int32_t, 6 * (size_t)c->weights.n_used);
    if (!number || !c->edge) return no_memory(j, "the grid");
    for (int64_t i = 0; i < total; i++) number[i] = -1;
    for (int i = 0; i < c->weights.n_used; i++) number[c->weights.used[i]] = i;
    for (int i = 0; i < c->weights.n_used; i++)
        for (int a = 0; a < 3; a++) {
            int64_t at = c->weights.used[i], along = at / step[a] % n[a];
            if (along + 1 >= n[a] || number[at + step[a]] < 0) continue;
            c->edge[2 * c->n_edge] = i;
            c->edge[2 * c->n_edge++ + 1] = number[at + step[a]];
        }
    return PAL_ERR_OK;
}

static pal_err make_grid(const job *j)
{
    pal_calibration *c = j->c;
    const pal_tets *t = &c->mesh.tets;
    const int *n = c->options.grid;
    c->info.n_used = 1;
    if (n[0] <= 0) return PAL_ERR_OK;
    for (int a = 0; a < 3; a++) {
        if (n[a] < 1 || n[a] > 1024)
            return PAL_REFUSE(j->diag, "grid: %d nodes along axis %d, wanted 1 to 1024", n[a], a);
        c->grid.n[a] = n[a];
    }
    pal_box3_empty(c->grid.low, c->grid.high);
    for (int i = 0; i < t->n_node; i++) pal_box3_add(c->grid.low, c->grid.high, t->x + 3 * i);
    if ((int64_t)n[0] * n[1] * n[2] * PAL_SPRING_KINDS > PAL_CALIBRATE_PARAMETERS)
        return PAL_REFUSE(j->diag, "grid: %d x %d x %d nodes are more than %d parameters", n[0], n[1], n[2],
                          PAL_CALIBRATE_PARAMETERS);
    c->has_grid = true;
    if (pal_grid_weights_make(&c->grid, t->x, t->n_node, &c->weights)) return no_memory(j, "the grid's weights");
    c->info.n_used = c->weights.n_used;
    return make_edges(j);
}

static pal_err make_parameters(const job *j)
{
    static const double hand[PAL_SPRING_KINDS] = {0.2, 0.4, 1};
    pal_calibration *c = j->c;
    double factor[PAL_SPRING_KINDS], scale = c->info.mean_young_Pa * pow(c->lattice.edge_m, 3),
                                     range = c->options.decades;
    pal_spring_factors(c->info.mean_poisson, c->options.without_area, factor);
    for (int k = 0; k < PAL_SPRING_KINDS; k++)
        if (c->lattice.kind[k].n_item > 0) c->info.kind[c->info.n_kind++] = k;
    c->info.n_parameter = c->info.n_kind * c->info.n_used;
    c->theta = PAL_NEW(c->arena, double, 3 * (size_t)c->info.n_parameter);
    if (!c->theta) return no_memory(j, "the parameters");
    c->low = c->theta + c->info.n_parameter, c->high = c->low + c->info.n_parameter;
    for (int k = 0; k < c->info.n_kind; k++) {
        const pal_springs *s = &c->lattice.kind[c->info.kind[k]];
        /* the derived law weights springs by volume: the total energy is the same when all springs are alike */
        double f = factor[c->info.kind[k]], by_hand = hand[c->info.kind[k]], sum = 0;
        double start = log(scale * (c->options.equal ? by_hand : f)), low = start - range * log(10);
        if (c->info.kind[k] == PAL_SPRING_VOLUME && c->options.min_volume_ratio > 0)
            low = fmax(low, start + log(c->options.min_volume_ratio));
        for (int i = 0; i < s->n_item; i++) sum += s->q[i];
        c->manual_theta[k] = log(scale * (by_hand / (sum / s->n_item)));
        for (int i = k * c->info.n_used; i < (k + 1) * c->info.n_used; i++)
            c->theta[i] = start, c->low[i] = low, c->high[i] = start + range * log(10);
    }
    return PAL_ERR_OK;
}

/* equilibria at the start's constants, where evaluations begin */
static pal_err make_starts(const job *j)
{
    pal_calibration *c = j->c;
    pal_calibration_workspace *workspace;
    pal_calibration_value value;
    size_t n = 3 * (size_t)c->lattice.n_node;
    for (int i = 0; i < c->n_case; i++) {
        c->fit[i].x_start = PAL_NEW(c->arena, double, n);
        if (!c->fit[i].x_start) return no_memory(j, "the start");
        memcpy(c->fit[i].x_start, c->lattice.x_rest, n * sizeof(double));
    }
    if (pal_calibration_workspace_create(c, &workspace)) return no_memory(j, "the start");
    pal_err err = pal_calibration_evaluate(c, workspace, c->theta, PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY, &value,
                                           NULL, j->diag);
    for (int i = 0; i < c->n_case && !err; i++)
        if (workspace->rests[i]) memcpy(c->fit[i].x_start, workspace->x[i], n * sizeof(double));
    pal_calibration_workspace_destroy(workspace);
    return err;
}

static pal_err make(const job *j)
{
    pal_calibration *c = j->c;
    double begin = pal_clock_s();
    PAL_TRY(make_grid(j));
    for (int i = 0; i < c->n_case; i++) PAL_TRY(make_loads(j, i));
    double loaded = pal_clock_s();
    for (int i = 0; i < c->n_case; i++) PAL_TRY(make_truth(j, i));
    c->info.truth_s = pal_clock_s() - loaded;
    PAL_TRY(make_parameters(j));
    PAL_TRY(make_starts(j));
    pal_calibration_info *out = &c->info;
    out->prepare_s += pal_clock_s() - begin - out->truth_s;
    out->n_node = c->lattice.n_node, out->n_free = c->lattice.n_free, out->n_tet = c->mesh.tets.n_tet;
    out->edge_m = c->lattice.edge_m;
    out->mesh = &c->mesh;
    out->grid = c->has_grid ? &c->grid : NULL, out->weights = c->has_grid ? &c->weights : NULL;
    out->start = c->theta, out->low = c->low, out->high = c->high;
    for (int k = 0; k < out->n_kind; k++) out->n_spring += c->lattice.kind[out->kind[k]].n_item;
    out->n_support = c->problem->n_support, out->support = c->support;
    for (int i = 0; i < c->n_case; i++) {
        const pal_fit_case *fit = &c->fit[i];
        out->max_m[i] = fit->max_m, out->n_point[i] = fit->n_point, out->force_N[i] = fit->force_N;
    }
    return PAL_ERR_OK;
}

pal_err pal_calibration_create(const pal_problem *problem, const pal_surface *surface, const pal_calibrate_case *cases,
                               int n_case, const pal_calibrate_options *options, pal_calibration **out,
                               pal_diagnostic *diag)
{
    pal_diagnostic own = {""};
    job j = {.surface = surface, .diag = diag ? diag : &own};
    int n_fit = 0;
    for (int i = 0; i < n_case; i++) n_fit += cases[i].fit;
    if (n_case > PAL_CALIBRATE_CASES)
        return PAL_REFUSE(diag, "%d load cases: at most %d are taken", n_case, PAL_CALIBRATE_CASES);
    if (n_fit == 0) return PAL_REFUSE(diag, "no load case to fit");
    for (int i = 0; i < n_case; i++)
        if (cases[i].load_case->n_load == 0)
            return PAL_REFUSE(diag, "load case \"%s\": has no load, so there is nothing to fit",
                              cases[i].load_case->id);
    pal_calibration *c = j.c = calloc(1, sizeof *c);
    if (!c) return no_memory(&j, "a calibration");
    *c = (pal_calibration){.options = *options, .problem = problem, .cases = cases, .n_case = n_case, .n_fit = n_fit};
    c->arena = pal_arena_create(1 << 20, true);
    double begin = pal_clock_s();
    pal_err err = c->arena ? make_body(&j) : no_memory(&j, "a calibration");
    c->info.prepare_s = pal_clock_s() - begin;
    if (!err && pal_locate_create(&c->mesh.tets, NULL, &j.locate)) err = no_memory(&j, "points in the mesh");
    if (!err) err = make(&j);
    pal_locate_destroy(j.locate);
    if (err)
        pal_calibration_destroy(c);
    else
        *out = c;
    return err;
}

void pal_calibration_destroy(pal_calibration *c)
{
    if (!c) return;
    pal_grid_weights_free(&c->weights);
    pal_lattice_free(&c->lattice);
    pal_world_destroy(c->world);
    pal_prepared_free(&c->mesh);
    pal_arena_destroy(c->arena);
    free(c);
}

void pal_calibration_info_of(const pal_calibration *c, pal_calibration_info *out)
{
    *out = c->info;
}

void pal_calibration_manual_start(const pal_calibration *c, double *theta)
{
    for (int i = 0; i < c->info.n_parameter; i++) theta[i] = c->manual_theta[i / c->info.n_used];
}

bool pal_calibration_truth(const pal_calibration *c, int index, double *u)
{
    const pal_fit_case *fit = &c->fit[index];
    if (fit->start) return false;
    memcpy(u, fit->u, 3 * sizeof(double) * (size_t)fit->n_point);
    return true;
}
