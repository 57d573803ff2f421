/* One implicit stage. */
#include "server/sim/implicit/implicit_solver.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/core/sums.h"
#include "server/sim/subdivision/subdivision_mass.h"

#include <limits.h>
#include <string.h>

/* of a step's loads: residuals below are not worth an iteration, so that a body at rest costs none */
static const double floor_share = 1e-7;
/* of 10 E h^2 (load_cap_N), the same for a body without loads: forces that move a node by less of an element are the
 * rounding of positions, and conjugate gradients and the watch of energy would go on over it */
static const double still_share = 1e-11;
/* most iterations of a step that began with one and gained energy */
enum { safeguard_newton = 8 };
/* a stage whose equations are solved may gain a little by its own error of time; more than this share counts */
static const double gain_share = 0.01;
/* s. Sub-steps of this much time in all may gain energy in spite of all iterations before the body has to stand still
 * in such: an inverted body needs a few of them to recover. After as much time without one they are forgotten */
static const double rise_s = 0.5;
/* columns of an embedded body's matrices found again in a step, each the work of one of conjugate gradients' */
enum { PROBES_A_STEP = 4 };

static size_t bytes3(const pal_implicit *core)
{
    return 3 * sizeof(double) * (size_t)core->system.body->n_dof;
}

/* ---- load ---- */

pal_err pal_implicit_read(pal_config_entry *item, const pal_build *build, pal_implicit_options *out)
{
    *out = (pal_implicit_options){.tolerance = 1e-2,
                                  .iterations = 60,
                                  .newton = 1,
                                  .refresh_iterations = 12,
                                  .refresh = true,
                                  .warp = true,
                                  .watch = true};
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-14, 0.5, &out->tolerance, build->diag));
    PAL_TRY(pal_entry_read_count(item, "iterations", 1, 100000, &out->iterations, build->diag));
    PAL_TRY(pal_entry_read_count(item, "newton", 1, 1000, &out->newton, build->diag));
    PAL_TRY(pal_entry_read_number(item, "substep_s", 0, 10, &out->substep_s, build->diag));
    PAL_TRY(pal_entry_read_count(item, "refresh_iterations", 1, 100000, &out->refresh_iterations, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "refresh", &out->refresh, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "warp", &out->warp, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "watch", &out->watch, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (out->substep_s == 0) out->substep_s = INFINITY;
    return PAL_ERR_OK;
}

static void multiply(void *user, const double *p, double *out)
{
    pal_system_multiply(&((pal_implicit *)user)->system, p, out);
}

static void precondition(void *user, const double *r, double *z)
{
    pal_warp_solve(&((pal_implicit *)user)->warp, r, z);
}

static pal_err make_arrays(pal_implicit *core, pal_arena *arena)
{
    const pal_body *body = core->system.body;
    size_t n3 = 3 * (size_t)body->n_dof;
    double **const array[] = {&core->x0,    &core->v0,   &core->xs,   &core->vs,   &core->start, &core->work,
                              &core->moved, &core->cg.r, &core->cg.z, &core->cg.p, &core->cg.q};
    for (size_t i = 0; i < sizeof array / sizeof array[0]; i++) {
        *array[i] = PAL_NEW(arena, double, n3);
        if (!*array[i]) return PAL_ERR_MEMORY;
    }
    core->node_displacement_m = core->moved;
    if (body->interpolation && !(core->node_displacement_m = PAL_NEW(arena, double, 3 * (size_t)body->n_node)))
        return PAL_ERR_MEMORY;
    core->cg.n = (int)n3;
    core->cg.multiply = multiply;
    core->cg.precondition = precondition;
    core->cg.user = core;
    return PAL_ERR_OK;
}

/* factors of the present linearisation: of A for stages of tau_rest_s, and of K where it is wanted */
static pal_err factor_all(pal_implicit *core)
{
    double tau = core->tau_rest_s;
    core->system.mass = 1 + tau * pal_system_drag(&core->system);
    core->system.stiff = tau * tau;
    core->system.damp = tau;
    double before = pal_clock_s();
    pal_system_assemble(&core->system, &core->blocks);
    core->report.assemble_s += pal_clock_s() - before;
    PAL_TRY(pal_warp_factor(&core->warp, &core->blocks));
    if (core->answer.door.solve) PAL_TRY(pal_compliance_solver_factor(&core->answer, &core->system, &core->blocks));
    return PAL_ERR_OK;
}

/* the matrices of an embedded body at rest, in one go */
static void probe_all(pal_implicit *core)
{
    const pal_body *body = core->system.body;
    double before = pal_clock_s();
    if (!core->system.interpolated_system) return;
    core->sampled = pal_dofs_material_revision(&body->dofs);
    core->probing = false;
    pal_interpolated_system_invalidate(core->system.interpolated_system);
    (void)pal_system_probe(&core->system, INT_MAX);
    core->report.assemble_s += pal_clock_s() - before;
}

/* at rest, wherever the body is now */
static pal_err factor_at_rest(pal_implicit *core)
{
    pal_body *body = core->system.body;
    double *x = body->x, *d = body->d;
    body->x = body->x_rest, body->d = body->node_rest;
    pal_node_rotations_reset(&core->turns);
    pal_system_linearise(&core->system);
    probe_all(core);
    pal_err err = factor_all(core);
    body->x = x, body->d = d;
    return err;
}

pal_err pal_implicit_make(const pal_implicit_options *options, pal_build *build, double share, pal_implicit **out)
{
    pal_body *body = build->body;
    pal_implicit *core = PAL_NEW(build->arena, pal_implicit, 1);
    if (!core) return PAL_ERR_MEMORY;
    /* from here on the row's destroy takes care of what was made */
    *out = core;
    core->options = *options;
    core->tau_rest_s = share * fmin(build->scene->step_s, options->substep_s);
    core->density = build->def->material.density_kg_m3;
    PAL_TRY(pal_system_make(build, &core->system));
    PAL_TRY(make_arrays(core, build->arena));
    if (core->system.n_free == 0) return PAL_ERR_OK;
    PAL_TRY(pal_system_pattern(&core->system, build->arena, &core->blocks));
    PAL_TRY(pal_node_rotations_make(&core->system, build->arena, &core->turns));
    core->turns.any &= options->warp;
    PAL_TRY(pal_warp_make(&core->blocks, body, &core->turns, true, build->arena, &core->warp));
    pal_err err = factor_at_rest(core);
    if (!err) err = pal_compliance_solver_make(&core->system, &core->turns, &core->blocks, build->arena, &core->answer);
    if (err == PAL_ERR_NUMERIC)
        return pal_diagnostic_set(
            build->diag, PAL_ERR_REFUSED,
            "body \"%s\": mass and stiffness at rest for steps of %g s make no positive definite matrix", body->name,
            core->tau_rest_s);
    return err;
}

void pal_implicit_destroy(void *self)
{
    pal_implicit *core = self;
    pal_warp_destroy(&core->warp);
    pal_compliance_solver_destroy(&core->answer);
}

/* ---- a stage ---- */

static void clear_held(const pal_body *body, double *r)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_set3(r + 3 * i, 0, 0, 0);
}

static double norm(const pal_implicit *core, const double *r)
{
    return sqrt(pal_dot_product(core->cg.n, r, r));
}

/* what contact gives beyond its loads at V where the body is now, times -tau: onto r */
static void add_contact(pal_implicit *core, double tau, const double *velocity, double *r)
{
    const double *x = core->system.body->x;
    double *p = core->cg.p, *q = core->cg.q;
    memset(q, 0, bytes3(core));
    for (int i = 0; i < core->cg.n; i++) p[i] = x[i] - core->x0[i];
    pal_system_multiply_contact(&core->system, tau, 0, p, q);
    for (int i = 0; i < core->cg.n; i++) p[i] = velocity[i] - core->v0[i];
    pal_system_multiply_contact(&core->system, 0, tau, p, q);
    for (int i = 0; i < core->cg.n; i++) r[i] -= q[i];
}

/* r = M (v* - V) + tau (f - c M V) + contact at V, the body being at x* + tau V; returns |M v* + tau f| */
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
    if (core->system.has_contact) add_contact(core, tau, velocity, r);
    clear_held(body, b);
    clear_held(body, r);
    return norm(core, b);
}

/* of an embedded body: what is neither of rows nor of contact. Fixed points count too, with what they have in common at
 * any V of the same stage */
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

/* the incremental potential at V where the body is now: kinetic + drag + rows - loads + contact, J */
static double potential(pal_implicit *core, double tau, const double *velocity)
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
    if (!core->system.has_contact) return sum;
    double *p = core->cg.z, *q = core->cg.q;
    for (int which = 0; which < 2; which++) {
        memset(q, 0, bytes3(core));
        for (int i = 0; i < core->cg.n; i++) p[i] = which ? velocity[i] - core->v0[i] : body->x[i] - core->x0[i];
        pal_system_multiply_contact(&core->system, which ? 0 : 1, which ? tau : 0, p, q);
        sum += 0.5 * pal_dot_product(core->cg.n, p, q);
    }
    return sum;
}

/* conjugate gradients from the guess body->v; core->cg.r is the residual at `start`. The velocities it ends with */
static void solve_linear(pal_implicit *core, double target)
{
    const pal_body *body = core->system.body;
    double *v = body->v, *r = core->cg.r, *q = core->cg.q, *p = core->cg.p;
    bool led = false;
    for (int i = 0; i < core->cg.n; i++) p[i] = v[i] - core->start[i];
    for (int i = 0; i < body->n_dof; i++) led = led || (body->support[i] && pal_dot3(p + 3 * i, p + 3 * i) > 0);
    double before = norm(core, r);
    pal_system_multiply(&core->system, p, q);
    for (int i = 0; i < core->cg.n; i++) r[i] -= q[i];
    /* a guess that is worse than none */
    if (!led && !(norm(core, r) <= before)) {
        memcpy(v, core->start, bytes3(core));
        for (int i = 0; i < core->cg.n; i++) r[i] += q[i];
    }
    int n = pal_conjugate_gradient_run(&core->cg, v, target, 1, core->options.iterations);
    core->report.n_cg += n;
    if (n > core->max_cg) core->max_cg = n;
}

/* of the masses and damping between points: the sum of all their entries in A, kg */
static double solid_inertia(const pal_implicit *core)
{
    const pal_mass_operator *m = core->system.body->mass_operator;
    double mass = 0, damping = 0;
    for (int k = 0; k < m->n_entry; k++) mass += m->mass_kg[k];
    for (int k = 0; k < m->n_entry && m->damping_kg_s; k++) damping += m->damping_kg_s[k];
    return core->system.mass * mass + core->system.damp * damping;
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
    double all = body->mass_operator ? solid_inertia(core) : mass * core->system.mass;
    pal_scale3(sum, 1 / all, sum);
    for (int i = 0; i < body->n_dof; i++) pal_add3(body->v + 3 * i, body->v + 3 * i, sum);
}

/* an iteration moves no node farther than 0.2 S: the whole way from `start` is shortened, because a body of which some
 * nodes stop and others go on is torn. What nothing holds may fly on as a whole: the mean way to v* does not count */
static void clamp_moves(pal_implicit *core, double tau)
{
    pal_body *body = core->system.body;
    double max = pal_guard_max_move_m(body) / tau, longest = 0, mean[3] = {0, 0, 0}, mass = 0;
    for (int i = 0; i < body->n_dof && core->system.n_free == body->n_dof; i++) {
        pal_axpy3(mean, body->mass_kg[i], core->vs + 3 * i);
        pal_axpy3(mean, -body->mass_kg[i], core->start + 3 * i);
        mass += body->mass_kg[i];
    }
    if (mass > 0) pal_scale3(mean, 1 / mass, mean);
    for (int i = 0; i < body->n_dof; i++) {
        double way[3];
        pal_sub3(way, body->v + 3 * i, core->start + 3 * i);
        double far = pal_norm3(way), own = fmin(far, pal_dist3(way, mean));
        if (body->support[i]) continue;
        longest = fmax(longest, own);
        body->safeguards.n_clamped += own > max;
    }
    if (!(longest > max)) return;
    uint64_t before = pal_clock_ns();
    for (int i = 0; i < core->cg.n; i++) {
        if (body->support[i / 3]) continue;
        double way = body->v[i] - core->start[i] - mean[i % 3];
        body->v[i] = core->start[i] + mean[i % 3] + max / longest * way;
    }
    body->safeguards.ns += pal_clock_ns() - before;
}

/* the body to where velocities lead from x* */
static void go(pal_implicit *core, double tau, const double *velocity)
{
    pal_body *body = core->system.body;
    for (int i = 0; i < core->cg.n; i++) body->x[i] = core->xs[i] + tau * velocity[i];
    pal_system_interpolate(&core->system);
}

/* halves the way from `start` to body->v until the potential falls by a little of what its slope there promises;
 * core->moved is the residual at `start` */
static void search(pal_implicit *core, double tau)
{
    const pal_body *body = core->system.body;
    double *v = body->v, *way = core->work, slope = 0, step = 1;
    for (int i = 0; i < body->n_dof; i++) {
        pal_sub3(way + 3 * i, v + 3 * i, core->start + 3 * i);
        slope -= pal_dot3(core->moved + 3 * i, way + 3 * i);
        /* where prescribed nodes move on, the potential before and after are not of one problem */
        if (body->support[i] && pal_dot3(way + 3 * i, way + 3 * i) > 0) return;
    }
    if (!(slope < 0)) return;
    go(core, tau, core->start);
    double at_start = potential(core, tau, core->start), noise = 1e-13 * fabs(at_start);
    for (;; step *= 0.5) {
        for (int i = 0; i < core->cg.n; i++) v[i] = core->start[i] + step * way[i];
        go(core, tau, v);
        if (step < 1e-3 || potential(core, tau, v) <= at_start + 1e-4 * step * slope + noise) break;
    }
    core->report.step_size = step;
}

/* one Newton iteration with the residual at `start` in cg.r */
static void iterate(pal_implicit *core, double tau, double target)
{
    pal_system_linearise(&core->system);
    pal_node_rotations_update(&core->turns, &core->system);
    pal_warp_rotate(&core->warp, &core->turns);
    memcpy(core->moved, core->cg.r, bytes3(core));
    solve_linear(core, target);
    keep_momentum(core);
    clamp_moves(core, tau);
    go(core, tau, core->system.body->v);
    core->report.n_newton++;
    core->report.step_size = 1;
}

/* a force on a node that is nothing; a body without a cap has none */
static double still_N(const pal_body *body)
{
    return isfinite(body->load_cap_N) ? still_share * body->load_cap_N : 0;
}

/* what loads on nodes and contact have put in since the sub-step's begin, J */
static double work_done(pal_implicit *core)
{
    const pal_body *body = core->system.body;
    double *p = core->cg.z, *q = core->cg.q;
    if (!body->interpolation && !core->system.has_contact)
        return pal_sum_work(core->cg.n, body->load, body->x, core->x0);
    for (int i = 0; i < core->cg.n; i++) p[i] = body->x[i] - core->x0[i];
    double work = pal_system_work(&core->system, p);
    if (!core->system.has_contact) return work;
    memset(q, 0, bytes3(core));
    pal_system_multiply_contact(&core->system, 1, 0, p, q);
    return work - 0.5 * pal_dot_product(core->cg.n, p, q);
}

/* energy of the body as it is: kinetic, of the rows, less the work of loads and contact since the sub-step's begin,
 * when it has moved; *slack: what of it is not worth an iteration */
static double total_energy(pal_implicit *core, bool moved, double *slack)
{
    const pal_body *body = core->system.body;
    double rows = pal_system_energy(&core->system), work = moved ? work_done(core) : 0;
    double kinetic = 0.5 * (body->mass_operator ? pal_system_inertia_norm2(&core->system, 1, 0, body->v)
                                                : pal_sum_mv2(body->n_dof, body->mass_kg, body->v));
    *slack = 1e-7 * (kinetic + fabs(work)) + 1e-14 * fabs(rows) + still_share * still_N(body) * body->edge_m;
    return kinetic + rows - work;
}

/* prescribed nodes put in work that nobody counts */
static bool is_led(const pal_body *body)
{
    for (int i = 0; i < body->n_dof; i++) {
        uint64_t next = 0;
        /* most nodes are free: eight at a glance */
        if (i + 8 <= body->n_dof) memcpy(&next, body->support + i, 8);
        if (i + 8 <= body->n_dof && next == 0)
            i += 7;
        else if (body->support[i] && pal_dot3(body->v + 3 * i, body->v + 3 * i) > 0)
            return true;
    }
    return false;
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
    double *at = core->work;
    if (!body->interpolation) return sqrt(pal_dot_product(core->cg.n, body->load, body->load));
    memset(at, 0, bytes3(core));
    pal_interpolation_apply_transpose(body->interpolation, body->load, at);
    return norm(core, at);
}

static void open_stage(pal_implicit *core, double tau)
{
    core->system.mass = 1 + tau * pal_system_drag(&core->system);
    core->system.stiff = tau * tau;
    core->system.damp = tau;
    core->sound = false;
    const double *x = core->system.body->x;
    for (int i = 0; i < core->cg.n; i++) core->start[i] = (x[i] - core->xs[i]) / tau;
}

pal_err pal_implicit_stage(pal_implicit *core, pal_step *step, double tau)
{
    pal_body *body = core->system.body;
    pal_solve_report *to = &core->report;
    int max = core->options.newton;
    uint64_t again_ns = 0;
    open_stage(core, tau);
    for (int k = 0;; k++) {
        if (k > 0) memcpy(core->start, body->v, bytes3(core));
        PAL_TRY(pal_assemble_forces(step));
        double size = residual(core, tau, core->start, core->cg.r), left = norm(core, core->cg.r);
        if (k == 0) {
            core->reference = fmax(size, floor_share * fmax(tau * load_size(core), left));
            core->reference = fmax(core->reference, tau * still_N(body) * sqrt(body->n_dof));
        }
        double best = core->options.tolerance * core->reference;
        to->residual = core->reference > 0 ? left / core->reference : 0;
        to->converged = k > 0 && left <= best;
        if (to->converged || k == max || !isfinite(left)) {
            core->energy_rose |= k > 0 && rises(core, gain_share);
            if (again_ns) body->safeguards.ns += pal_clock_ns() - again_ns;
            return PAL_ERR_OK;
        }
        /* an iteration of several need not be solved better than the next one starts */
        iterate(core, tau, core->options.newton > 1 ? fmax(0.3 * best, 1e-2 * left) : best);
        if (core->options.newton > 1) {
            if (core->system.has_energy) search(core, tau);
            continue;
        }
        to->residual = core->reference > 0 ? core->cg.residual / core->reference : 0;
        to->converged = core->cg.residual <= best;
        /* from here on all is a rescue: the search, and the iterations that follow it */
        if (max > core->options.newton) body->safeguards.ns += pal_clock_ns() - again_ns;
        if (!rises(core, 0)) return PAL_ERR_OK;
        core->energy_rose = max == safeguard_newton;
        if (core->energy_rose) return PAL_ERR_OK;
        again_ns = pal_clock_ns();
        body->safeguards.n_search++;
        search(core, tau);
        max++;
    }
}

/* ---- a sub-step ---- */

/* rows of contact that touch nothing answer no motion, so neither this one, which none of their directions is across.
 * Where something holds the body it does not matter: what they do not add costs nothing to leave in */
static bool contact_acts(pal_implicit *core)
{
    double *p = core->cg.p, *q = core->cg.q;
    if (core->system.n_free < core->system.body->n_dof) return true;
    for (int i = 0; i < core->cg.n; i++) p[i] = (const double[]){1, M_SQRT2, M_PI}[i % 3];
    memset(q, 0, bytes3(core));
    pal_system_multiply_contact(&core->system, 1, 1, p, q);
    for (int i = 0; i < core->cg.n; i++)
        if (q[i] != 0) return true;
    return false;
}

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
    (void)pal_guard_recover(step);
    core->report.n_newton = core->report.n_cg = core->max_cg = 0;
    core->energy_rose = false;
    pal_system_linearise_contact(&core->system, step);
    if (core->system.has_contact) core->system.has_contact = contact_acts(core);
    step->drag_separate = true;
    double slack;
    core->guarded = core->options.watch && core->options.newton == 1 && core->system.has_energy && !is_led(body);
    if (core->guarded) core->start_energy_J = total_energy(core, false, &slack);
    return true;
}

bool pal_implicit_settle(pal_implicit *core, pal_step *step, bool last)
{
    const pal_body *body = core->system.body;
    bool again = false;
    for (int i = 0; i < core->cg.n; i++) core->moved[i] = body->x[i] - core->x0[i];
    if (body->interpolation) pal_interpolation_apply(body->interpolation, core->moved, core->node_displacement_m);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *row = &step->contact[i];
        if (row->effect->tangent && row->effect->tangent->settle)
            again |= row->effect->tangent->settle(row->self, step, core->node_displacement_m, last);
    }
    if (!again) return false;
    /* energy is judged by the loads of the last solve, and points that came to touch act in it */
    core->energy_rose = false;
    core->system.has_contact = true;
    core->system.has_contact = contact_acts(core);
    return true;
}

/* an embedded body has other samples since its matrices were found: they are found again a few columns a step, then
 * factors of them are made on a spare thread. The old ones serve until then, badly */
static void keep_probed(pal_implicit *core, pal_step *step)
{
    pal_system *system = &core->system;
    const pal_body *body = system->body;
    uint64_t sampled = pal_dofs_material_revision(&body->dofs);
    if (sampled != core->sampled) {
        core->sampled = sampled;
        core->probing = true;
        pal_interpolated_system_invalidate(system->interpolated_system);
    }
    if (!core->probing || !pal_system_probe(system, PROBES_A_STEP)) return;
    if (core->warp.wait + core->warp.pause + core->answer.warp.wait + core->answer.warp.pause > 0) return;
    double tau = core->tau_rest_s;
    system->mass = 1 + tau * pal_system_drag(system), system->stiff = tau * tau, system->damp = tau;
    pal_system_assemble(system, &core->blocks);
    core->probing = !pal_warp_refresh(&core->warp, &core->blocks, true, step->dt_s);
    if (core->probing) return;
    pal_compliance_solver_reset(&core->answer);
    if (!core->answer.door.solve) return;
    system->mass = 0, system->stiff = 1, system->damp = 0;
    pal_system_assemble(system, &core->blocks);
    (void)pal_warp_refresh(&core->answer.warp, &core->blocks, true, step->dt_s);
}

/* Is it time to stand still? Forces that no energy has, as those of elements inverted, which borrow rotations, may
 * lead in a circle: there is more energy than at the sub-step's begin after all iterations, now and then for ever. A
 * tangled body needs such steps to get out, no more than a few. */
static bool circles(pal_implicit *core, double dt_s)
{
    const double limit_s = rise_s * (1 + 1e-9);
    core->steady_s = core->energy_rose ? 0 : core->steady_s + dt_s;
    if (core->energy_rose) core->energy_rise_s += dt_s;
    if (core->steady_s > limit_s) core->energy_rise_s = 0;
    return core->energy_rose && core->energy_rise_s > limit_s;
}

/* the body goes back and stands there; what nothing holds goes on as a whole, with its momentum */
static void stand_still(pal_implicit *core, double dt_s)
{
    pal_body *body = core->system.body;
    double mean[3] = {0, 0, 0}, mass = 0;
    for (int i = 0; i < body->n_dof && core->system.n_free == body->n_dof; i++) {
        pal_axpy3(mean, body->mass_kg[i], body->v + 3 * i);
        mass += body->mass_kg[i];
    }
    if (mass > 0) pal_scale3(mean, 1 / mass, mean);
    for (int i = 0; i < body->n_dof; i++) {
        for (int c = 0; c < 3; c++) body->x[3 * i + c] = core->x0[3 * i + c] + dt_s * mean[c];
        pal_copy3(body->v + 3 * i, mean);
    }
}

void pal_implicit_end(pal_implicit *core, pal_step *step)
{
    pal_body *body = core->system.body;
    if (!core->sound && !pal_guard_check_finite(body)) {
        memcpy(body->x, core->x0, bytes3(core));
        memset(body->v, 0, bytes3(core));
        pal_body_update_nodes(body);
        return;
    }
    if (!body->mass_operator && circles(core, step->dt_s)) stand_still(core, step->dt_s);
    pal_body_update_nodes(body);
    pal_warp_step(&core->warp);
    pal_warp_step(&core->answer.warp);
    if (core->answer.door.solve) pal_warp_rotate(&core->answer.warp, &core->turns);
    if (core->system.interpolated_system) {
        keep_probed(core, step);
        return;
    }
    if (!core->options.refresh || core->max_cg <= core->options.refresh_iterations) return;
    if (core->warp.wait > 0 || core->warp.pause > 0) return;
    pal_system_assemble(&core->system, &core->blocks);
    (void)pal_warp_refresh(&core->warp, &core->blocks, false, step->dt_s);
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
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "body \"%s\": with E %g Pa, nu %g and %g kg/m^3 its matrix at rest is "
                                  "not positive definite",
                                  body->name, material->young_Pa, material->poisson, material->density_kg_m3);
    return err;
}

void pal_implicit_reset(void *self, const pal_body *body)
{
    pal_implicit *core = self;
    (void)body;
    core->energy_rise_s = core->steady_s = 0;
    if (core->system.n_free == 0) return;
    pal_node_rotations_reset(&core->turns);
    pal_compliance_solver_reset(&core->answer);
    if (core->answer.door.solve) pal_warp_rotate(&core->answer.warp, &core->turns);
    /* the same factor as at load, so that a run repeats; without memory for it the present one still serves */
    if (core->warp.refreshed || core->warp.wait > 0 || core->probing) (void)factor_at_rest(core);
}

void pal_implicit_report(const void *self, pal_solve_report *out)
{
    const pal_implicit *core = self;
    *out = core->report;
    if (core->system.n_free == 0) return;
    out->factor_nonzeros = pal_cholesky_nonzeros(core->warp.factor);
    out->n_factor = core->warp.n_factor;
    out->analyse_s = core->warp.analyse_s;
    out->factor_s = core->warp.factor_s;
}
