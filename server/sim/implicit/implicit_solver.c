/* One implicit stage. */
#include "server/sim/implicit/implicit_solver.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/rigid_motion.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/core/sums.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/subdivision/subdivision_mass.h"

#include <limits.h>
#include <string.h>

/* ---- load ---- */

static pal_err read_keys(pal_config_entry *item, const pal_build *build, pal_implicit_options *out)
{
    *out = (pal_implicit_options){.tolerance = PAL_SOLVER_TOLERANCE,
                                  .iterations = 60,
                                  .newton = 1,
                                  .refresh_iterations = 12,
                                  .refresh = true,
                                  .warp = true,
                                  .watch = true};
    static const char *const kinds[] = {"auto", "jacobi", "factor", "multigrid"};
    int kind = PAL_PRECONDITION_AUTO;
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-14, 0.5, &out->tolerance, build->diag));
    PAL_TRY(pal_entry_read_count(item, "iterations", 1, 100000, &out->iterations, build->diag));
    PAL_TRY(pal_entry_read_count(item, "newton", 1, 1000, &out->newton, build->diag));
    PAL_TRY(pal_entry_read_number(item, "substep_s", 0, 10, &out->substep_s, build->diag));
    PAL_TRY(pal_entry_read_number(item, "stiffness_damping_s", 0, 10, &out->damping_s, build->diag));
    PAL_TRY(pal_entry_read_count(item, "refresh_iterations", 1, 100000, &out->refresh_iterations, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "refresh", &out->refresh, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "warp", &out->warp, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "watch", &out->watch, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "preconditioner", kinds, 4, &kind, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    out->preconditioner = (pal_precondition)kind;
    if (out->substep_s == 0) out->substep_s = INFINITY;
    return PAL_ERR_OK;
}

static void multiply(void *user, const double *p, double *out)
{
    pal_system_multiply(&((pal_implicit *)user)->system, p, out);
}

static void precondition(void *user, const double *r, double *z)
{
    pal_implicit *core = user;
    const pal_cycle cycle = pal_preconditioner_cycle(&core->system, &core->cg);
    if (core->system.has_contact)
        pal_woodbury_solve(&core->woodbury, &core->preconditioner, cycle, r, z);
    else
        pal_preconditioner_solve(&core->preconditioner, cycle, r, z);
}

static pal_err make_arrays(pal_implicit *core, bool alone, pal_arena *arena)
{
    const pal_body *body = core->system.body;
    pal_conjugate_gradient *cg = &core->cg;
    size_t n3 = 3 * (size_t)body->n_dof;
    bool made = PAL_NEW_DOUBLES(arena, n3, &core->x0, &core->v0, &core->start, &core->work, &core->moved, &cg->r) &&
                (alone || PAL_NEW_DOUBLES(arena, n3, &core->xs, &core->vs)) &&
                PAL_NEW_DOUBLES(arena, 3 * n3, &cg->z); /* one array, in which rotations are summed */
    if (made) cg->p = cg->z + n3, cg->q = cg->p + n3;
    if (alone) core->xs = core->x0, core->vs = core->v0;
    core->node_displacement_m = core->moved;
    if (made && body->interpolation)
        made = PAL_NEW_DOUBLES(arena, 3 * (size_t)body->n_node, &core->node_displacement_m);
    cg->n = (int)n3;
    cg->multiply = multiply, cg->precondition = precondition, cg->user = core;
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* factors of A = (1 + tau c) M + (tau^2 + tau beta) K + tau D */
static void set_factors(pal_implicit *core, double tau)
{
    core->system.mass = 1 + tau * pal_guard_drag_1_s(core->system.force, core->system.n_force);
    core->system.stiff = tau * tau;
    core->system.viscous = tau * core->options.damping_s;
    core->system.damp = tau;
}

/* factors at rest, wherever the body is now: of A for stages of tau_rest_s, and of K where it is wanted */
static pal_err factor_at_rest(pal_implicit *core)
{
    pal_node_rotations_reset(&core->rotations);
    pal_system_linearise_rest(&core->system);
    if (core->system.interpolated_system) {
        core->sampled = pal_dofs_material_revision(&core->system.body->dofs);
        core->probing = false;
        pal_interpolated_system_invalidate(core->system.interpolated_system);
        (void)pal_system_probe(&core->system, INT_MAX);
    }
    set_factors(core, core->tau_rest_s);
    PAL_TRY(pal_preconditioner_update(&core->preconditioner));
    return core->compliance.hook.solve ? pal_compliance_solver_update(&core->compliance, false) : PAL_ERR_OK;
}

pal_err pal_implicit_make(pal_config_entry *item, pal_build *build, double share, void **self)
{
    pal_body *body = build->body;
    pal_implicit *core = *self = PAL_NEW(build->arena, pal_implicit, 1);
    if (!core) return PAL_ERR_MEMORY;
    PAL_TRY(read_keys(item, build, &core->options));
    core->tau_rest_s = share * fmin(build->scene->step_s, core->options.substep_s);
    core->density = build->def->material.density_kg_m3;
    PAL_TRY(pal_system_make(build, &core->system));
    PAL_TRY(make_arrays(core, share == 1, build->arena));
    if (core->system.n_free == 0) return PAL_ERR_OK;
    PAL_TRY(pal_node_rotations_make(&core->system, core->cg.z, build->arena, &core->rotations));
    core->rotations.any &= core->options.warp;
    const pal_preconditioner_options options = {.kind = core->options.preconditioner, .single = true};
    PAL_TRY(pal_preconditioner_make(&options, &core->system, &core->rotations, build->arena, build->diag,
                                    &core->preconditioner));
    PAL_TRY(pal_woodbury_make(&core->system, build->made, build->n_made, build->arena, &core->woodbury));
    pal_err err = factor_at_rest(core);
    if (!err)
        err = pal_compliance_solver_make(&core->preconditioner, &core->cg, core->work, build->arena, &core->compliance);
    if (err == PAL_ERR_NUMERIC)
        return PAL_REFUSE(build->diag,
                          "body \"%s\": mass and stiffness at rest for steps of %g s make no positive definite matrix",
                          body->name, core->tau_rest_s);
    return err;
}

void pal_implicit_destroy(void *self)
{
    pal_implicit *core = self;
    pal_preconditioner_destroy(&core->preconditioner);
    pal_compliance_solver_destroy(&core->compliance);
}

/* ---- a stage ---- */

static double norm(const pal_implicit *core, const double *r)
{
    return sqrt(pal_dot_product(core->cg.n, r, r));
}

/* q += k K (a - b) of contact; cg.z is the difference */
static void add_contact(pal_implicit *core, double k, const double *a, const double *b, double *q)
{
    for (int i = 0; i < core->cg.n; i++) core->cg.z[i] = a[i] - b[i];
    pal_system_multiply_contact(&core->system, k, core->cg.z, q);
}

/* half the work of the stiffness of contact since the sub-step's begin */
static double contact_energy(pal_implicit *core)
{
    double *q = core->cg.q;
    memset(q, 0, pal_body_bytes3(core->system.body));
    add_contact(core, 1, core->system.body->x, core->x0, q);
    return 0.5 * pal_dot_product(core->cg.n, core->cg.z, q);
}

/* r = M (v* - V) + tau (f - c M V - beta K V) + contact at V, the body being at x* + tau V; returns |M v* + tau f| */
static double residual(pal_implicit *core, double tau, const double *velocity, double *r)
{
    const pal_body *body = core->system.body;
    double keep = core->system.mass, *b = core->work;
    if (body->mass_operator) {
        pal_system_multiply_inertia(&core->system, 1, 0, core->vs, b);
        pal_system_multiply_inertia(&core->system, keep, core->system.damp, velocity, r);
    }
    for (int i = 0; i < body->n_dof; i++) {
        double m = body->mass_kg[i];
        for (int c = 3 * i; c < 3 * i + 3; c++) {
            b[c] = (body->mass_operator ? b[c] : m * core->vs[c]) + tau * body->g[c];
            r[c] = b[c] - (body->mass_operator ? r[c] : m * keep * velocity[c]);
        }
    }
    if (core->system.has_contact) {
        double *q = core->cg.q;
        memset(q, 0, pal_body_bytes3(core->system.body));
        add_contact(core, tau, body->x, core->x0, q);
        for (int i = 0; i < core->cg.n; i++) r[i] -= q[i];
    }
    if (core->system.viscous > 0) pal_system_multiply_stiffness(&core->system, -core->system.viscous, velocity, r);
    pal_system_clear_supported(body, b);
    pal_system_clear_supported(body, r);
    return norm(core, b);
}

/* of an interpolated body: what is neither of rows nor of contact. Fixed points count too, with what they have in
 * common at any V of the same stage */
static double interpolated_potential(pal_implicit *core, const double *velocity)
{
    const pal_system *system = &core->system;
    double *p = core->cg.z;
    for (int i = 0; i < core->cg.n; i++) p[i] = velocity[i] - core->vs[i];
    double sum = pal_system_inertia_norm2(system, 1, 0, p) +
                 pal_system_inertia_norm2(system, system->mass - 1, system->damp, velocity);
    for (int i = 0; i < core->cg.n; i++) p[i] = system->body->x[i] - core->x0[i];
    return 0.5 * sum - pal_system_work(system, p);
}

/* the incremental potential at V where the body is now: kinetic + drag + damping + rows - loads + contact, J */
static double potential(pal_implicit *core, const double *velocity)
{
    const pal_body *body = core->system.body;
    double sum = pal_system_energy(&core->system), keep = core->system.mass - 1;
    if (body->interpolation) sum += interpolated_potential(core, velocity);
    for (int i = 0; i < body->n_dof && !body->interpolation; i++) {
        double m = 0.5 * body->mass_kg[i];
        if (body->support[i]) continue;
        for (int c = 3 * i; c < 3 * i + 3; c++) {
            double slip = velocity[c] - core->vs[c];
            sum += m * (slip * slip + keep * velocity[c] * velocity[c]) - body->load[c] * (body->x[c] - core->x0[c]);
        }
    }
    if (core->system.viscous > 0) {
        double *q = core->cg.q;
        memset(q, 0, pal_body_bytes3(body));
        pal_system_multiply_stiffness(&core->system, 0.5 * core->system.viscous, velocity, q);
        sum += pal_dot_product(core->cg.n, velocity, q);
    }
    return core->system.has_contact ? sum + contact_energy(core) : sum;
}

/* conjugate gradients from the guess body->v; core->cg.r is the residual at `start`. The velocities it ends with */
static void solve_linear(pal_implicit *core, double target)
{
    const pal_body *body = core->system.body;
    double *v = body->v, *r = core->cg.r, *q = core->cg.q, *p = core->cg.p, began = pal_clock_s();
    bool prescribed_moves = false;
    for (int i = 0; i < core->cg.n; i++) p[i] = v[i] - core->start[i];
    for (int i = 0; i < body->n_dof; i++)
        prescribed_moves = prescribed_moves || (body->support[i] && pal_dot3(p + 3 * i, p + 3 * i) > 0);
    double before = norm(core, r);
    if (before <= target && !prescribed_moves) { /* where it is linearised it is in balance */
        memcpy(v, core->start, pal_body_bytes3(body));
        core->cg.residual = before;
        return;
    }
    if (core->system.has_contact) {
        pal_woodbury_guess(&core->woodbury, r, p);
        for (int i = 0; i < core->cg.n; i++) v[i] = core->start[i] + p[i];
    }
    pal_system_multiply(&core->system, p, q);
    for (int i = 0; i < core->cg.n; i++) r[i] -= q[i];
    /* a guess that is worse than none */
    if (!prescribed_moves && !(norm(core, r) <= before)) {
        memcpy(v, core->start, pal_body_bytes3(core->system.body));
        for (int i = 0; i < core->cg.n; i++) r[i] += q[i];
    }
    int n = pal_conjugate_gradient_run(&core->cg, v, target, 1, core->options.iterations);
    core->report.n_cg += n;
    if (n > core->max_cg) core->max_cg = n;
    core->report.solve_s += pal_clock_s() - began;
}

/* A of a uniform velocity V is (1 + tau c) M V (and tau D V) where nothing holds the body: V takes up the mean of the
 * residual */
static void keep_momentum(pal_implicit *core)
{
    const pal_body *body = core->system.body;
    double sum[3] = {0, 0, 0}, mass = 0;
    if (core->system.n_free < body->n_dof || core->system.has_contact) return;
    for (int i = 0; i < body->n_dof; i++) {
        pal_add3(sum, sum, core->cg.r + 3 * i);
        mass += body->mass_kg[i];
    }
    const pal_mass_operator *m = body->mass_operator;
    double all = mass * core->system.mass;
    if (m) { /* the sum of all entries of masses and damping between points in A */
        double damping = 0;
        mass = 0;
        for (int k = 0; k < m->n_entry; k++) mass += m->mass_kg[k];
        for (int k = 0; k < m->n_entry && m->damping_kg_s; k++) damping += m->damping_kg_s[k];
        all = core->system.mass * mass + core->system.damp * damping;
    }
    pal_scale3(sum, 1 / all, sum);
    for (int i = 0; i < body->n_dof; i++) pal_add3(body->v + 3 * i, body->v + 3 * i, sum);
}

/* mass-weighted mean of a - b (b NULL: of a) over a body without supports; else 0 */
static void free_mean(const pal_implicit *core, const double *a, const double *b, double mean[3])
{
    const pal_body *body = core->system.body;
    double less[3] = {0};
    pal_set3(mean, 0, 0, 0);
    if (core->system.n_free < body->n_dof) return;
    pal_rigid_centre(body->n_dof, body->mass_kg, a, mean);
    if (b) pal_rigid_centre(body->n_dof, body->mass_kg, b, less);
    pal_sub3(mean, mean, less);
}

/* The longest of n moves without the mean motion, m/s; *n_long: how many are longer than max */
static double longest_move(int n, const double *move, const double mean[3], double max, int *n_long)
{
    double longest = 0;
    *n_long = 0;
    for (int i = 0; i < n; i++) {
        double own = fmin(pal_norm3(move + 3 * i), pal_dist3(move + 3 * i, mean));
        longest = fmax(longest, own);
        *n_long += own > max;
    }
    return longest;
}

/* an iteration moves no node farther than 0.2 S: the whole move from `start` is shortened, because single nodes that
 * stop would tear the body. The mean motion of a body without supports does not count. Nodes of an interpolated body
 * are means of its points, so they are asked only where a point is too fast: an isolated cell has a motion of its
 * points that moves no node and that nothing resists */
static void clamp_moves(pal_implicit *core, double tau)
{
    pal_body *body = core->system.body;
    double max = pal_guard_max_move_m(body) / tau, mean[3], *move = core->work;
    int n_long;
    free_mean(core, core->vs, core->start, mean);
    for (int i = 0; i < core->cg.n; i++) move[i] = body->support[i / 3] ? 0 : body->v[i] - core->start[i];
    double longest = longest_move(body->n_dof, move, mean, max, &n_long);
    if (longest > max && body->interpolation) {
        /* set_positions computes d anew */
        pal_interpolation_apply(body->interpolation, move, body->d);
        longest = longest_move(body->n_node, body->d, mean, max, &n_long);
    }
    if (!(longest > max)) return;
    uint64_t before = pal_clock_ns();
    body->safeguards.n_clamped += (uint64_t)n_long;
    for (int i = 0; i < core->cg.n; i++)
        if (!body->support[i / 3]) body->v[i] = core->start[i] + mean[i % 3] + max / longest * (move[i] - mean[i % 3]);
    body->safeguards.ns += pal_clock_ns() - before;
}

static void set_positions(pal_implicit *core, double tau, const double *velocity)
{
    pal_body *body = core->system.body;
    for (int i = 0; i < core->cg.n; i++) body->x[i] = core->xs[i] + tau * velocity[i];
    pal_system_interpolate(&core->system);
}

/* halves the move from `start` to body->v until the potential falls by a little of what its slope there promises;
 * core->moved is the residual at `start` */
static void line_search(pal_implicit *core, double tau)
{
    const pal_body *body = core->system.body;
    double *v = body->v, *move = core->work, slope = 0, step = 1;
    for (int i = 0; i < body->n_dof; i++) {
        pal_sub3(move + 3 * i, v + 3 * i, core->start + 3 * i);
        slope -= pal_dot3(core->moved + 3 * i, move + 3 * i);
        /* where prescribed nodes move on, the potential before and after are not of one problem */
        if (body->support[i] && pal_dot3(move + 3 * i, move + 3 * i) > 0) return;
    }
    if (!(slope < 0)) return;
    set_positions(core, tau, core->start);
    double at_start = potential(core, core->start), noise = 1e-13 * fabs(at_start);
    for (;; step *= 0.5) {
        for (int i = 0; i < core->cg.n; i++) v[i] = core->start[i] + step * move[i];
        set_positions(core, tau, v);
        if (step < 1e-3 || potential(core, v) <= at_start + 1e-4 * step * slope + noise) break;
    }
    core->report.step_size = step;
}

/* the preconditioner to the state that the forces are linearised at */
static void turn(pal_implicit *core)
{
    if (!pal_preconditioner_follow(&core->preconditioner)) return;
    pal_node_rotations_update(&core->rotations, &core->system);
    pal_preconditioner_rotate(&core->preconditioner);
}

/* one Newton iteration from `start`, where the forces are linearised and cg.r is the residual */
static void iterate(pal_implicit *core, double tau, double target)
{
    if (core->system.has_contact) pal_woodbury_update(&core->woodbury, &core->preconditioner, core->cg.z);
    memcpy(core->moved, core->cg.r, pal_body_bytes3(core->system.body));
    solve_linear(core, target);
    keep_momentum(core);
    clamp_moves(core, tau);
    set_positions(core, tau, core->system.body->v);
    core->report.n_newton++;
    core->report.step_size = 1;
}

/* a negligible force on a node; 0 for a body without a cap */
static double negligible_N(const pal_body *body)
{
    return isfinite(body->load_cap_N) ? PAL_UNLOADED_FLOOR * body->load_cap_N : 0;
}

/* what loads on nodes and contact have put in since the sub-step's begin, J */
static double work_done(pal_implicit *core)
{
    const pal_body *body = core->system.body;
    double *p = core->cg.z;
    if (!body->interpolation && !core->system.has_contact)
        return pal_sum_work(core->cg.n, body->load, body->x, core->x0);
    for (int i = 0; i < core->cg.n; i++) p[i] = body->x[i] - core->x0[i];
    double work = pal_system_work(&core->system, p);
    return core->system.has_contact ? work - contact_energy(core) : work;
}

/* energy of the body as it is: kinetic, of the rows, less the work of loads and contact since the sub-step's begin,
 * when it has moved; *slack: what of it is not worth an iteration */
static double total_energy(pal_implicit *core, bool moved, double *slack)
{
    const pal_body *body = core->system.body;
    double rows = pal_system_energy(&core->system), work = moved ? work_done(core) : 0;
    double kinetic = 0.5 * (body->mass_operator ? pal_system_inertia_norm2(&core->system, 1, 0, body->v)
                                                : pal_sum_mv2(body->n_dof, body->mass_kg, body->v));
    *slack = PAL_SOLVER_FLOOR * (kinetic + fabs(work)) + 1e-14 * fabs(rows) +
             PAL_UNLOADED_FLOOR * negligible_N(body) * body->edge_m;
    return kinetic + rows - work;
}

/* was one iteration not enough? share: of the energy that may be gained */
static bool rises(pal_implicit *core, double share)
{
    double slack;
    if (!core->guarded) return false;
    double now = total_energy(core, true, &slack);
    /* its sums take in every number of x and v, but for points that carry no node */
    core->sound = isfinite(now) && !core->system.body->interpolation;
    return now > core->start_energy_J + share * fabs(core->start_energy_J) + slack;
}

/* of all loads on points, Euclidean, N */
static double load_size(pal_implicit *core)
{
    const pal_body *body = core->system.body;
    if (!body->interpolation) return norm(core, body->load);
    pal_system_restrict(body, body->load, core->work);
    return norm(core, core->work);
}

/* the residual at `start`, and what the tolerance scales in the first iteration of a stage; returns its norm */
static double begin_iteration(pal_implicit *core, double tau, bool first)
{
    const pal_body *body = core->system.body;
    const double size = residual(core, tau, core->start, core->cg.r), left = norm(core, core->cg.r);
    if (!first) return left;
    core->reference = fmax(size, PAL_SOLVER_FLOOR * fmax(tau * load_size(core), left));
    core->reference = fmax(core->reference, tau * negligible_N(body) * sqrt(body->n_dof));
    return left;
}

/* true: contact has changed its loads after the last solve */
static bool settle_contact(pal_implicit *core, pal_step *step, bool last)
{
    if (!pal_system_settle_contact(&core->system, step, core->x0, core->moved, core->node_displacement_m, last))
        return false;
    /* energy is judged by the loads of the last solve, and points that came to touch act in it */
    core->energy_rose = false;
    pal_system_find_contact(&core->system, core->cg.p, core->cg.q);
    return true;
}

/* one iteration, repeated from the same linearisation while contact changes its loads by it: roughly until it is found
 * which points touch */
static pal_err iterate_contact(pal_implicit *core, pal_step *step, double tau, double tolerance, double left)
{
    for (bool rough = core->system.chooses;;) {
        const double best = tolerance * core->reference;
        iterate(core, tau, rough ? fmax(best, PAL_ROUGH_TOLERANCE * left) : best);
        const bool changed = settle_contact(core, step, true);
        if (!changed && (!rough || core->cg.residual <= best)) break;
        rough = changed && core->system.chooses;
        set_positions(core, tau, core->start);
        PAL_TRY(pal_assemble_forces(step));
        left = begin_iteration(core, tau, true);
    }
    core->settled = true;
    return PAL_ERR_OK;
}

/* core->moved after contact was settled, which took it: the residual at `start` again */
static pal_err restore_residual(pal_implicit *core, pal_step *step, double tau)
{
    core->settled = false;
    set_positions(core, tau, core->start);
    PAL_TRY(pal_assemble_forces(step));
    (void)residual(core, tau, core->start, core->moved);
    return PAL_ERR_OK;
}

pal_err pal_implicit_stage(pal_implicit *core, pal_step *step, double tau, bool alone)
{
    pal_body *body = core->system.body;
    pal_solve_report *to = &core->report;
    int max = core->options.newton;
    uint64_t again_ns = 0;
    core->cg.team = body->team;
    set_factors(core, tau);
    core->sound = false;
    for (int i = 0; i < core->cg.n; i++) core->start[i] = (body->x[i] - core->xs[i]) / tau;
    for (int k = 0;; k++) {
        if (k > 0) memcpy(core->start, body->v, pal_body_bytes3(core->system.body));
        PAL_TRY(pal_assemble_forces(step));
        if (k < max) pal_system_linearise(&core->system);
        const double left = begin_iteration(core, tau, k == 0);
        /* while inverted elements move the state is far from any that is asked for, and conjugate gradients lower the
         * energy of the stage in every iteration. While the preconditioner knew nothing of recovery, as its coarse
         * levels still do, a drag of 14,119 nodes took 5 iterations with 0.1, two or three with 0.3. A body that
         * nothing touches has to come to rest, for which 0.2 is too much */
        const double exponent = !core->turns_back ? 1 : core->system.has_contact ? 0.25 : 0.5;
        const double tolerance = pow(core->options.tolerance, exponent);
        double best = tolerance * core->reference;
        to->residual = core->reference > 0 ? left / core->reference : 0;
        to->converged = k > 0 && left <= best;
        if (to->converged || k == max || !isfinite(left)) {
            core->energy_rose |= k > 0 && rises(core, PAL_SOLVER_TOLERANCE);
            if (again_ns) body->safeguards.ns += pal_clock_ns() - again_ns;
            return PAL_ERR_OK;
        }
        turn(core);
        core->settled = false;
        /* an iteration of several need not be solved better than the next one starts */
        if (k == 0 && alone && core->options.newton == 1 && step->n_contact > 0)
            PAL_TRY(iterate_contact(core, step, tau, tolerance, left));
        else
            iterate(core, tau, core->options.newton > 1 ? fmax(0.3 * best, 1e-2 * left) : best);
        if (core->options.newton > 1) {
            if (core->system.has_energy) line_search(core, tau);
            continue;
        }
        to->residual = core->reference > 0 ? core->cg.residual / core->reference : 0;
        to->converged = core->cg.residual <= tolerance * core->reference;
        /* from here on all is a safeguard: the search, and the iterations that follow it */
        if (max > core->options.newton) body->safeguards.ns += pal_clock_ns() - again_ns;
        if (!rises(core, 0)) return PAL_ERR_OK;
        core->energy_rose = max == PAL_SAFEGUARD_NEWTON;
        /* the last iteration too ends where a search does, unless it hardly gains */
        if (core->energy_rose && !rises(core, PAL_SOLVER_TOLERANCE)) return PAL_ERR_OK;
        again_ns = pal_clock_ns();
        body->safeguards.n_search++;
        if (core->settled) PAL_TRY(restore_residual(core, step, tau));
        line_search(core, tau);
        if (max++ < PAL_SAFEGUARD_NEWTON) continue;
        core->energy_rose = rises(core, 0);
        body->safeguards.ns += pal_clock_ns() - again_ns;
        return PAL_ERR_OK;
    }
}

/* ---- a sub-step ---- */

bool pal_implicit_begin(pal_implicit *core, pal_step *step)
{
    pal_body *body = core->system.body;
    const bool finite = pal_copy_finite(core->cg.n, body->x, core->x0);
    if (!pal_copy_finite(core->cg.n, body->v, core->v0) || !finite) {
        pal_body_stop_bad(body, "");
        return false;
    }
    if (core->system.n_free == 0) {
        for (int i = 0; i < core->cg.n; i++) body->x[i] += step->dt_s * body->v[i];
        pal_body_update_nodes(body);
        return false;
    }
    pal_system_interpolate(&core->system);
    const unsigned seen = pal_guard_recover(step);
    core->turns_back = (seen & PAL_INVERTED) && !(seen & PAL_INVERSION_AT_REST);
    if (step->sub == 0) core->report.n_newton = core->report.n_cg = 0;
    core->max_cg = 0;
    core->energy_rose = false;
    pal_system_linearise_contact(&core->system, step);
    pal_system_find_contact(&core->system, core->cg.p, core->cg.q);
    step->drag_separate = true;
    double slack;
    core->guarded = core->options.watch && core->options.newton == 1 && core->system.has_energy;
    /* moving prescribed nodes do work that the check of the energy does not know */
    for (int i = 0; i < body->n_dof && core->guarded; i++)
        core->guarded = !body->support[i] || !(pal_dot3(body->v + 3 * i, body->v + 3 * i) > 0);
    if (core->guarded) core->start_energy_J = total_energy(core, false, &slack);
    return true;
}

bool pal_implicit_settle(pal_implicit *core, pal_step *step, bool last)
{
    const bool settled = core->settled;
    core->settled = false;
    return !settled && settle_contact(core, step, last);
}

/* an interpolated body has other samples since its matrices were found: they are found again a few columns a step, then
 * factors of them are made on a spare thread. Until then the old ones precondition */
static void update_probed(pal_implicit *core, pal_step *step)
{
    pal_system *system = &core->system;
    const pal_body *body = system->body;
    uint64_t sampled = pal_dofs_material_revision(&body->dofs);
    if (sampled != core->sampled) {
        core->sampled = sampled;
        core->probing = true;
        pal_interpolated_system_invalidate(system->interpolated_system);
    }
    if (!core->probing) return;
    core->probes += PAL_PROBES_1_S * step->dt_s;
    int n = (int)core->probes;
    core->probes -= n;
    if (!pal_system_probe(system, n) || !pal_preconditioner_ready(&core->preconditioner) ||
        !pal_preconditioner_ready(&core->compliance.preconditioner))
        return;
    set_factors(core, core->tau_rest_s);
    core->probing = !pal_preconditioner_refresh(&core->preconditioner, true);
    if (!core->probing && core->compliance.hook.solve) (void)pal_compliance_solver_update(&core->compliance, true);
}

void pal_implicit_end(pal_implicit *core, pal_step *step)
{
    pal_body *body = core->system.body;
    if (!core->sound && !pal_guard_check_finite(body)) {
        memcpy(body->x, core->x0, pal_body_bytes3(core->system.body));
        memset(body->v, 0, pal_body_bytes3(core->system.body));
        pal_body_update_nodes(body);
        return;
    }
    core->rose_s = core->energy_rose ? PAL_PAUSE_S : fmax(0, core->rose_s - step->dt_s);
    pal_body_update_nodes(body);
    pal_preconditioner_step(&core->preconditioner, step->dt_s);
    pal_woodbury_step(&core->woodbury, step->dt_s);
    if (core->compliance.hook.solve) pal_preconditioner_step(&core->compliance.preconditioner, step->dt_s);
    if (core->system.interpolated_system) {
        update_probed(core, step);
        return;
    }
    if (!core->options.refresh || core->max_cg <= core->options.refresh_iterations) return;
    if (!pal_preconditioner_ready(&core->preconditioner)) return;
    pal_node_rotations_update(&core->rotations, &core->system); /* those of the elements, which it takes */
    (void)pal_preconditioner_refresh(&core->preconditioner, false);
}

/* ---- hooks ---- */

double pal_implicit_limit(void *self, pal_step *step)
{
    const pal_implicit *core = self;
    return pal_body_finite(step->body) ? core->options.substep_s : (double)NAN;
}

pal_err pal_implicit_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag)
{
    pal_implicit *core = self;
    if (core->system.n_free == 0) return PAL_ERR_OK;
    if (core->system.interpolated_system) {
        /* no pause of half a second: as after painting */
        core->probing = true;
        pal_interpolated_system_invalidate(core->system.interpolated_system);
        core->density = material->density_kg_m3;
        return PAL_ERR_OK;
    }
    /* the world scales the masses after its rows have heard of the edit */
    double ratio = material->density_kg_m3 / core->density;
    for (int i = 0; i < body->n_node; i++) body->mass_kg[i] *= ratio;
    pal_err err = factor_at_rest(core);
    for (int i = 0; i < body->n_node; i++) body->mass_kg[i] /= ratio;
    if (!err) core->density = material->density_kg_m3;
    if (err == PAL_ERR_NUMERIC)
        return PAL_REFUSE(diag,
                          "body \"%s\": with E %g Pa, nu %g and %g kg/m^3 its matrix at rest is "
                          "not positive definite",
                          body->name, material->young_Pa, material->poisson, material->density_kg_m3);
    return err;
}

void pal_implicit_reset(void *self, const pal_body *body)
{
    pal_implicit *core = self;
    (void)body;
    core->rose_s = 0;
    if (core->system.n_free == 0) return;
    pal_node_rotations_reset(&core->rotations);
    core->preconditioner.turn_rad = INFINITY;
    pal_woodbury_reset(&core->woodbury);
    pal_compliance_solver_reset(&core->compliance);
    /* the same factor as at load, so that a run repeats; without memory for it the present one still serves */
    if (core->preconditioner.refreshed || core->preconditioner.pending || core->probing) (void)factor_at_rest(core);
}

void pal_implicit_report(const void *self, pal_solve_report *out)
{
    const pal_implicit *core = self;
    *out = core->report;
    pal_compliance_solver_report(&core->compliance, &core->preconditioner, out);
}

void pal_implicit_accuracy(void *self, pal_solve_accuracy *accuracy)
{
    pal_implicit_options *own = &((pal_implicit *)self)->options;
    const pal_solve_accuracy before = {own->tolerance, own->iterations, own->refresh};
    own->tolerance = accuracy->tolerance, own->iterations = accuracy->iterations, own->refresh = accuracy->refresh;
    *accuracy = before;
}
