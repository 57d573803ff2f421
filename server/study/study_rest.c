/* The equilibrium of a body under a load: by Newton's method where its components have tangents, by the lattice
 * equilibrium for springs, otherwise by running it and zeroing its velocity at each peak of kinetic energy (kinetic
 * damping; Cundall 1976). */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/calibrate/equilibrium.h"
#include "server/sim/core/effect_list.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>

enum { MAX_NEWTON = 120, MAX_RELAX = 4000, QUIET = 3, RAMPS = 4 };

static pal_err converge(const pal_study_job *job, pal_study_world *w, pal_diagnostic *diag)
{
    int n_newton = 0;
    for (;;) {
        pal_solve_report report;
        if (!pal_study_continues(job)) return pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped");
        pal_err err = pal_world_step(w->world, PAL_STUDY_FRAME_S);
        pal_world_solve_report(w->world, 0, &report);
        n_newton += report.n_newton;
        if (err || w->body->frozen)
            return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "no rest: it froze after %d Newton iterations", n_newton);
        if (report.converged) return PAL_ERR_OK;
        if (n_newton >= MAX_NEWTON || report.n_newton == 0)
            return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "no rest after %d Newton iterations (residual %.2g)",
                                      n_newton, report.residual);
    }
}

/* applies the whole load at once, or in parts if that fails */
static pal_err newton(pal_study_job *job, const pal_configuration *configuration, const pal_problem_case *load,
                      double *u, int *n_node, pal_diagnostic *diag)
{
    pal_configuration statics = *configuration;
    pal_study_world w;
    snprintf(statics.solver, sizeof statics.solver, "static_newton");
    statics.tolerance = PAL_REST_TOLERANCE, statics.step_s = PAL_STUDY_FRAME_S;
    PAL_TRY(pal_study_open(job, &statics, true, &w, diag));
    *n_node = w.body->n_node;
    pal_err err = PAL_ERR_NUMERIC;
    for (int n_part = 1; n_part <= RAMPS && err == PAL_ERR_NUMERIC; n_part += RAMPS - 1) {
        err = PAL_ERR_OK;
        if (n_part > 1) pal_world_reset(w.world);
        for (int k = 1; k <= n_part && !err; k++) {
            err = pal_study_apply_load(job, &w, load, (double)k / n_part, diag);
            if (!err) err = converge(job, &w, diag);
        }
    }
    if (!err) err = pal_study_displacement(&w, job->probe, job->n_probe, u, diag);
    pal_study_close(&w);
    return err;
}

typedef struct springs {
    pal_lattice lattice;
    pal_equilibrium_workspace *workspace;
    double *k[PAL_SPRING_KINDS];
    double *force, *part;
} springs;

/* as in the live components: given, or from the material (spring_law.h) */
static void constants_of(const pal_configuration *configuration, const pal_body_def *def, double edge_m,
                         double out[PAL_SPRING_KINDS])
{
    pal_spring_factors(def->material.poisson, configuration->k_area_J == 0, out);
    for (int k = 0; k < PAL_SPRING_KINDS; k++) out[k] *= def->material.young_Pa * edge_m * edge_m * edge_m;
    if (configuration->k_distance_J > 0) {
        out[PAL_SPRING_DISTANCE] = configuration->k_distance_J;
        out[PAL_SPRING_VOLUME] = configuration->k_volume_J;
        if (configuration->k_area_J >= 0) out[PAL_SPRING_AREA] = configuration->k_area_J;
    }
}

/* Uses the weights of the scene. Gravity is the only other nodal force. */
static pal_err take_springs(const pal_configuration *configuration, const pal_study_world *w, springs *s,
                            pal_diagnostic *diag)
{
    double constant[PAL_SPRING_KINDS];
    PAL_TRY(pal_lattice_make(w->world, 0, &s->lattice, diag));
    constants_of(configuration, &w->set->scene.body[0], s->lattice.edge_m, constant);
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < PAL_SPRING_KINDS; k++) {
        PAL_ARRAY(&err, s->k[k], s->lattice.kind[k].n_item);
        for (int i = 0; i < s->lattice.kind[k].n_item && !err; i++) s->k[k][i] = constant[k];
    }
    PAL_ZEROED(&err, s->force, 3 * s->lattice.n_node);
    PAL_ZEROED(&err, s->part, 3 * s->lattice.n_node);
    if (!err) err = pal_equilibrium_workspace_create(&s->lattice, &s->workspace);
    return err ? pal_diagnostic_set(diag, err, "no memory for the rest of springs") : PAL_ERR_OK;
}

static void add_gravity(const pal_study_world *w, double *f)
{
    const pal_scene *scene = &w->set->scene;
    bool heavy = false;
    for (int k = 0; k < scene->body[0].n_effect; k++) heavy |= pal_study_is(scene->body[0].effect[k].name, "gravity");
    for (int i = 0; i < w->body->n_node && heavy; i++)
        pal_axpy3(f + 3 * i, -scene->gravity_m_s2 * w->body->mass_kg[i], scene->up);
}

/* likewise */
static pal_err balance(springs *s, double *x, pal_diagnostic *diag)
{
    const pal_equilibrium_options options = {.tolerance = PAL_REST_TOLERANCE};
    pal_equilibrium_report report;
    const double *const k[PAL_SPRING_KINDS] = {s->k[0], s->k[1], s->k[2]};
    size_t n = 3 * (size_t)s->lattice.n_node;
    pal_err err = PAL_ERR_NUMERIC;
    for (int n_part = 1; n_part <= RAMPS && err == PAL_ERR_NUMERIC; n_part += RAMPS - 1) {
        err = PAL_ERR_OK;
        memcpy(x, s->lattice.x_rest, n * sizeof *x);
        for (int part = 1; part <= n_part && !err; part++) {
            for (size_t i = 0; i < n; i++) s->part[i] = s->force[i] * part / n_part;
            err = pal_equilibrium(s->workspace, k, s->part, &options, x, &report, diag);
        }
    }
    return err;
}

static pal_err lattice(pal_study_job *job, const pal_configuration *configuration, const pal_problem_case *load,
                       double *u, int *n_node, pal_diagnostic *diag)
{
    pal_study_world w;
    springs s = {.workspace = NULL};
    pal_configuration statics = *configuration;
    /* the shortest step: stiff springs must come to rest at any cost */
    statics.step_s = 1e-4, statics.solver[0] = 0;
    PAL_TRY(pal_study_open(job, &statics, true, &w, diag));
    *n_node = w.body->n_node;
    pal_err err = take_springs(configuration, &w, &s, diag);
    if (!err) err = pal_study_forces(job, &w, load, s.force, diag);
    if (!err) add_gravity(&w, s.force);
    if (!err) err = balance(&s, w.body->x, diag);
    if (!err) err = pal_study_displacement(&w, job->probe, job->n_probe, u, diag);
    PAL_FREE(s.k[0], s.k[1], s.k[2], s.force, s.part);
    pal_equilibrium_workspace_destroy(s.workspace);
    pal_lattice_free(&s.lattice);
    pal_study_close(&w);
    return err;
}

/* steps until several successive peaks show no significant change */
static pal_err relax_world(pal_study_job *job, pal_study_world *w, int max_step, double *before, double *u,
                           pal_diagnostic *diag)
{
    double last = 0;
    int quiet = 0;
    for (int step = 1; step <= max_step; step++) {
        if (!pal_study_continues(job)) return pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped");
        pal_err err = pal_world_step(w->world, w->set->scene.step_s);
        if (err || w->body->frozen)
            return pal_diagnostic_set(diag, err ? err : PAL_ERR_FROZEN, "%s after %d steps on its way to rest",
                                      err == PAL_ERR_BUDGET ? "needs too many sub-steps" : "froze", step);
        double now = pal_body_kinetic_J(w->body);
        bool peak = now < last;
        last = now;
        if (!peak) continue;
        memset(w->body->v, 0, 3 * sizeof(double) * (size_t)w->body->n_dof);
        last = 0;
        PAL_TRY(pal_study_displacement(w, job->probe, job->n_probe, u, diag));
        double change = pal_max_dist3(before, u, job->n_probe);
        quiet = change <= PAL_REST_CHANGE * pal_max_norm3(u, job->n_probe) ? quiet + 1 : 0;
        memcpy(before, u, 3 * sizeof *u * (size_t)job->n_probe);
        if (quiet == QUIET) return PAL_ERR_OK;
    }
    return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "not at rest after %d steps", max_step);
}

/* max_work: steps times nodes; 0: unlimited */
static pal_err relax(pal_study_job *job, const pal_configuration *configuration, const pal_problem_case *load,
                     double *u, int *n_node, double max_work, pal_diagnostic *diag)
{
    pal_study_world w;
    pal_configuration statics = *configuration;
    /* with a step much shorter than a period, slow motion does not mean rest */
    statics.step_s = PAL_STUDY_FRAME_S;
    PAL_TRY(pal_study_open(job, &statics, true, &w, diag));
    *n_node = pal_body_nodes(w.body);
    double *before = calloc(3 * (size_t)job->n_probe, sizeof *before);
    pal_err err = before ? pal_study_apply_load(job, &w, load, 1, diag) : PAL_ERR_MEMORY;
    if (!err)
        err =
            relax_world(job, &w, max_work > 0 ? (int)fmin(MAX_RELAX, max_work / *n_node) : MAX_RELAX, before, u, diag);
    if (!err) *n_node = pal_body_nodes(w.body);
    free(before);
    pal_study_close(&w);
    return err;
}

/* Does anything but gravity, drag and tools act? The lattice equilibrium ignores it. */
static bool only_gravity(const pal_body_def *body)
{
    for (int k = 0; k < body->n_effect; k++) {
        const pal_effect *e = pal_effect_find(body->effect[k].name);
        bool acts =
            e && ((e->stage == PAL_STAGE_FORCE && !e->drag) || (e->stage == PAL_STAGE_CONTACT && !e->sleep.reach_m));
        if (acts && !pal_study_is(e->name, "gravity")) return false;
    }
    return true;
}

pal_err pal_study_static(pal_study_job *job, const pal_configuration *configuration, const pal_problem_case *load,
                         double *u, int *n_node, pal_diagnostic *diag)
{
    *n_node = 0;
    if (pal_study_is(configuration->model, "fem") || pal_study_is(configuration->model, "subdivision_fem")) {
        pal_err err = newton(job, configuration, load, u, n_node, diag);
        pal_diagnostic other = {{0}};
        if (err != PAL_ERR_NUMERIC || relax(job, configuration, load, u, n_node, PAL_RELAX_WORK, &other)) return err;
        return PAL_ERR_OK;
    }
    if (pal_study_is(configuration->model, "tet_springs") && only_gravity(&job->scene->body[0]))
        return lattice(job, configuration, load, u, n_node, diag);
    return relax(job, configuration, load, u, n_node, 0, diag);
}
