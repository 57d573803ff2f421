/* Solver static_newton: static equilibrium under the loads, by Newton's method with a line search on the total
 * energy.
 *
 * Each world step continues from the present shape with zero velocities and makes at most `newton` iterations. The
 * linear systems K d = r (K as the components have it: the corotational law omits the derivative of the rotations,
 * which costs iterations but keeps the energy falling at full steps) are solved
 *   direct:     by a factor of the present K, rebuilt in every iteration (once for the linear law);
 *   pcg:        by conjugate gradients with the warped factor of K at rest (preconditioner.h);
 *   multigrid:  by conjugate gradients with multigrid, for voxel hexahedra. Its levels are made of the present K before
 *               the solve after one that took more than 20 iterations;
 *   incomplete: by conjugate gradients with an incomplete factor of the present K in every iteration, in a tenth of the
 *               memory or less. Iterations increase strongly for nearly incompressible and for thin bodies;
 *   auto:       as multigrid for large bodies of voxel hexahedra, else as pcg. After a solve that took more iterations
 *               than a factor is worth by its operation count, the present K is factored before the next; where that
 *               repeats at once, before every solve until an iteration leaves a tenth of the residual or less.
 *
 * After an iteration that left more than a tenth of the residual, the next solves for the true stiffness (differences
 * of forces along each direction, system.h) by conjugate gradients with the same preconditioner (truncated Newton; Nash
 * 2000): half the iterations or fewer on a bent beam. If that meets a direction of non-positive curvature too early, as
 * far from equilibrium in a nearly incompressible body, its result is discarded and K is used.
 *
 * The line search requires a decrease of the energy; where the expected decrease is below the energy's rounding, it
 * tests the slope at the trial point (approximate Wolfe condition; Hager & Zhang 2005).
 *
 * Converged: the Euclidean norm of the residual force at free nodes is at most `tolerance` times the larger of the
 * sums of |load| over all nodes and of |reaction| over fixed ones. Loads (lasting, contact, gravity) are applied in
 * `load_steps` equal parts, each solved before the next.
 *
 * A body whose supports leave a rigid motion free is refused at load (free "refuse"). If it is a single part without
 * fixed nodes it can be solved by inertia relief (free "inertia_relief"): core/rigid_motion.h balances the
 * loads, K + eps M is solved, and rigid motion is removed from every d.
 *
 * A body whose nodes are interpolated from control points (body.h, interpolation) is solved for the control points
 * by pcg, with a factor of the matrix at rest from interpolated_system.h; `direct`, `incomplete` and inertia relief
 * are refused.
 *
 * Keys: tolerance (1e-8), newton (50), linear ("auto"), free ("refuse"), load_steps (1), cg_tolerance (1e-3:
 * residual of conjugate gradients over that of the iteration, for nonlinear laws), iterations (500, of one solve).
 * Departure from the rules of a step: `direct` and `auto` take heap memory for factors. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/rigid_motion.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/compliance.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/solvers/tuning.h"

#include <float.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

typedef enum linear_kind { LINEAR_AUTO, LINEAR_DIRECT, LINEAR_PCG, LINEAR_INCOMPLETE, LINEAR_MULTIGRID } linear_kind;

typedef struct static_newton {
    double tolerance, cg_tolerance;
    int newton, load_steps, iterations;
    linear_kind linear;
    bool relieved, constant; /* inertia relief; K never changes (linear law) */
    pal_system system;
    pal_node_rotations rotations;
    pal_preconditioner preconditioner;
    pal_compliance_solver compliance;
    pal_conjugate_gradient cg;
    double *x0, *external_force; /* at the beginning of the step; external loads [n_dof][3] */
    double *force, *move;        /* residual and d of the iteration                       [n_dof][3] */
    double *now, *low;           /* work space of the true stiffness [n_dof][3] */
    double *inertia;             /* inertia forces that balance the loads; NULL: no relief [n_dof][3] */
    double *node_displacement_m; /* displacement of nodes; `move` without interpolation [n_node][3] */
    uint64_t sampled;            /* pal_dofs_material_revision(&body->dofs) at the factor   */
    bool has_factor, stale;      /* a factor exists; its last solve took too many iterations */
    bool eager;                  /* the factor was stale at its second solve: rebuild it in every iteration */
    int age;                     /* solves with the factor */
    bool exact;                  /* the tangent converges too slowly: use the true stiffness */
    int backoff;                 /* iterations left without the true stiffness */
    int part;                    /* of the load, of load_steps                    */
    double scale_N;              /* of the tolerance                              */
    pal_solve_report report;
} static_newton;

/* iterations with the tangent alone after the true stiffness failed; solves of a step in which elements act again that
 * were inverted */
enum { BACKOFF = 4, RECOVERIES_MAX = 8 };

/* ---- load ---- */

static pal_err read_keys(pal_config_entry *item, const pal_build *build, static_newton *solver)
{
    static const char *const linear[] = {"auto", "direct", "pcg", "incomplete", "multigrid"};
    static const char *const rigid[] = {"refuse", "inertia_relief"};
    int kind = 0, relieved = 0;
    solver->tolerance = 1e-8, solver->cg_tolerance = 1e-3;
    solver->newton = 50, solver->load_steps = 1, solver->iterations = 500;
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-15, 0.5, &solver->tolerance, build->diag));
    PAL_TRY(pal_entry_read_number(item, "cg_tolerance", 1e-14, 0.5, &solver->cg_tolerance, build->diag));
    PAL_TRY(pal_entry_read_count(item, "newton", 1, 100000, &solver->newton, build->diag));
    PAL_TRY(pal_entry_read_count(item, "load_steps", 1, 10000, &solver->load_steps, build->diag));
    PAL_TRY(pal_entry_read_count(item, "iterations", 1, 100000, &solver->iterations, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "linear", linear, 5, &kind, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "free", rigid, 2, &relieved, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    solver->linear = (linear_kind)kind;
    solver->relieved = relieved;
    const char *law = "";
    pal_config_entry model = build->def->model;
    if (pal_entry_has(&model, "law")) PAL_TRY(pal_entry_read_text(&model, "law", &law, build->diag));
    solver->constant = !strcmp(law, "linear");
    return PAL_ERR_OK;
}

static void multiply(void *user, const double *p, double *out)
{
    pal_system_multiply(&((static_newton *)user)->system, p, out);
}

/* the true stiffness at solver->now; with contact and, for relief, eps M */
static void multiply_true(void *user, const double *p, double *out)
{
    static_newton *solver = user;
    const pal_body *body = solver->system.body;
    pal_system_true_stiffness(&solver->system, solver->now, solver->low, p, out);
    if (solver->system.has_contact) pal_system_multiply_contact(&solver->system, 1, p, out);
    for (int i = 0; i < solver->cg.n; i++)
        out[i] = body->support[i / 3] ? 0 : out[i] + solver->system.mass * body->mass_kg[i / 3] * p[i];
}

static void precondition(void *user, const double *r, double *z)
{
    static_newton *solver = user;
    const pal_cycle cycle = pal_preconditioner_cycle(&solver->system, &solver->cg);
    pal_preconditioner_solve(&solver->preconditioner, cycle, r, z);
}

static pal_err make_arrays(static_newton *solver, pal_arena *arena)
{
    const pal_body *body = solver->system.body;
    pal_conjugate_gradient *cg = &solver->cg;
    size_t n3 = 3 * (size_t)body->n_dof;
    bool made = PAL_NEW_DOUBLES(arena, n3, &solver->x0, &solver->external_force, &solver->force, &solver->move,
                                &solver->now, &solver->low, &cg->r, &cg->z, &cg->p, &cg->q);
    solver->node_displacement_m = solver->move;
    if (made && body->interpolation)
        made = PAL_NEW_DOUBLES(arena, 3 * (size_t)body->n_node, &solver->node_displacement_m);
    if (made && solver->relieved) made = PAL_NEW_DOUBLES(arena, n3, &solver->inertia);
    cg->n = (int)n3;
    cg->multiply = multiply, cg->precondition = precondition, cg->user = solver;
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* of an interpolated body: finds its matrix at rest, whatever its present linearisation, which is restored */
static void probe(static_newton *solver)
{
    solver->sampled = pal_dofs_material_revision(&solver->system.body->dofs);
    pal_interpolated_system_invalidate(solver->system.interpolated_system);
    (void)pal_system_probe(&solver->system, INT_MAX);
    pal_system_linearise(&solver->system);
}

static pal_err factor(static_newton *solver)
{
    if (solver->system.interpolated_system) probe(solver);
    PAL_TRY(pal_preconditioner_update(&solver->preconditioner));
    if (solver->system.interpolated_system) pal_preconditioner_set_rest(&solver->preconditioner);
    solver->has_factor = true;
    solver->stale = false;
    solver->age = 0;
    return PAL_ERR_OK;
}

/* eps: the square root of rounding, times K over mass */
static pal_err choose_shift(static_newton *solver)
{
    const pal_system *system = &solver->system;
    const pal_body *body = system->body;
    double stiff = 0, mass = 0, *bound = calloc((size_t)body->n_node, sizeof *bound);
    if (!bound) return PAL_ERR_MEMORY;
    for (int i = 0; i < system->n_force; i++)
        if (system->force[i].effect->bounds.stiffness)
            system->force[i].effect->bounds.stiffness(system->force[i].self, body, bound);
    for (int i = 0; i < body->n_dof; i++) stiff += bound[i], mass += body->mass_kg[i];
    free(bound);
    solver->system.mass = sqrt(DBL_EPSILON) * stiff / mass;
    return PAL_ERR_OK;
}

static pal_err check_supports(static_newton *solver, const pal_build *build)
{
    const pal_body *body = build->body;
    pal_support_report s;
    PAL_TRY(pal_system_find_supports(&solver->system, &s));
    if (s.n_unsupported == 0) {
        solver->relieved = false;
        return PAL_ERR_OK;
    }
    const double *x = body->x_rest + 3 * s.unsupported_node;
    if (!solver->relieved)
        return PAL_REFUSE(build->diag,
                          "body \"%s\": %d of its %d parts (the one at (%g, %g, %g) m) has fewer than three held nodes "
                          "off a line, so it has no state of rest; give supports, or free \"inertia_relief\" to "
                          "static_newton",
                          body->name, s.n_unsupported, s.n_part, x[0], x[1], x[2]);
    if (body->interpolation)
        return PAL_REFUSE(
            build->diag, "body \"%s\": inertia_relief is for bodies of nodes, this one has control points", body->name);
    if (s.n_part > 1 || solver->system.n_free < body->n_node)
        return PAL_REFUSE(build->diag,
                          "body \"%s\": inertia_relief is for one part without held nodes, this body has %d parts and "
                          "%d held nodes",
                          body->name, s.n_part, body->n_node - solver->system.n_free);
    return PAL_ERR_OK;
}

static pal_err make_factors(static_newton *solver, pal_build *build)
{
    pal_body *body = build->body;
    if (body->interpolation && (solver->linear == LINEAR_DIRECT || solver->linear == LINEAR_INCOMPLETE))
        return PAL_REFUSE(build->diag,
                          "body \"%s\": static_newton with linear \"%s\" is for bodies of nodes, this one has "
                          "control points; take \"pcg\"",
                          body->name, solver->linear == LINEAR_DIRECT ? "direct" : "incomplete");
    if (body->interpolation) solver->linear = LINEAR_PCG;
    PAL_TRY(pal_node_rotations_make(&solver->system, NULL, build->arena, &solver->rotations));
    static const pal_precondition kind[] = {
        [LINEAR_AUTO] = PAL_PRECONDITION_AUTO,           [LINEAR_DIRECT] = PAL_PRECONDITION_FACTOR,
        [LINEAR_PCG] = PAL_PRECONDITION_FACTOR,          [LINEAR_INCOMPLETE] = PAL_PRECONDITION_INCOMPLETE,
        [LINEAR_MULTIGRID] = PAL_PRECONDITION_MULTIGRID,
    };
    const pal_preconditioner_options options = {.kind = kind[solver->linear]};
    PAL_TRY(pal_preconditioner_make(&options, &solver->system, &solver->rotations, build->arena, build->diag,
                                    &solver->preconditioner));
    pal_system_linearise(&solver->system);
    if (solver->relieved) PAL_TRY(choose_shift(solver));
    pal_err err = solver->linear == LINEAR_DIRECT ? PAL_ERR_OK : factor(solver);
    if (!err)
        err = pal_compliance_solver_make(&solver->preconditioner, &solver->cg, NULL, build->arena, &solver->compliance);
    if (err == PAL_ERR_NUMERIC)
        return PAL_REFUSE(build->diag, "body \"%s\": its stiffness at rest is not positive definite", body->name);
    return err;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    static_newton *solver = PAL_NEW(build->arena, static_newton, 1);
    if (!solver) return PAL_ERR_MEMORY;
    *self = solver;
    PAL_TRY(read_keys(item, build, solver));
    PAL_TRY(pal_system_make(build, &solver->system));
    solver->system.mass = 0, solver->system.stiff = 1, solver->system.damp = 0;
    PAL_TRY(make_arrays(solver, build->arena));
    if (solver->system.n_free == 0) return PAL_ERR_OK;
    PAL_TRY(check_supports(solver, build));
    return make_factors(solver, build);
}

static void destroy(void *self)
{
    static_newton *solver = self;
    pal_preconditioner_destroy(&solver->preconditioner);
    pal_compliance_solver_destroy(&solver->compliance);
}

/* ---- forces and energy ---- */

/* external loads at the beginning of the step */
static pal_err find_external_force(static_newton *solver, pal_step *step)
{
    pal_body *body = solver->system.body;
    memcpy(body->f, body->load, 3 * sizeof(double) * (size_t)body->n_node);
    PAL_TRY(pal_run_forces(step, PAL_FORCES_EXTERNAL));
    pal_system_restrict(body, body->f, solver->external_force);
    return PAL_ERR_OK;
}

/* positions about which internal forces have no moment */
static const double *moment_positions(const static_newton *solver)
{
    return solver->constant ? solver->system.body->x_rest : solver->system.body->x;
}

/* body->g = all forces at body->x; cg.r = those at free nodes; returns |r|. The tolerance's scale too */
static pal_err find_residual(static_newton *solver, pal_step *step, double *size)
{
    pal_body *body = solver->system.body;
    double part = (double)solver->part / solver->load_steps, loads = 0, reactions = 0, *r = solver->cg.r,
           *p = solver->cg.p;
    pal_system_interpolate(&solver->system);
    if (body->interpolation) memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    for (int i = 0; i < solver->cg.n; i++) body->g[i] = part * solver->external_force[i];
    PAL_TRY(pal_run_forces(step, PAL_FORCES_INTERNAL));
    if (body->interpolation) pal_interpolation_apply_transpose(body->interpolation, body->f, body->g);
    memcpy(r, body->g, pal_body_bytes3(solver->system.body));
    if (solver->system.has_contact) {
        for (int i = 0; i < solver->cg.n; i++) p[i] = body->x[i] - solver->x0[i];
        pal_system_multiply_contact(&solver->system, -1, p, r);
    }
    for (int i = 0; i < body->n_dof; i++) {
        loads += pal_norm3(solver->external_force + 3 * i);
        if (!body->support[i]) continue;
        reactions += pal_norm3(r + 3 * i);
        pal_set3(r + 3 * i, 0, 0, 0);
    }
    if (solver->relieved) {
        memcpy(solver->inertia, r, pal_body_bytes3(solver->system.body));
        pal_rigid_motion_remove(body->n_dof, body->mass_kg, moment_positions(solver), true, r);
        for (int i = 0; i < solver->cg.n; i++) solver->inertia[i] = r[i] - solver->inertia[i];
    }
    solver->scale_N = fmax(loads, reactions);
    *size = sqrt(pal_dot_product(solver->cg.n, r, r));
    return PAL_ERR_OK;
}

/* its sum, and the sum of absolute values, which bounds its rounding error */
typedef struct energy {
    double sum_J, size_J;
} energy;

static void add_energy(energy *to, double part_J)
{
    to->sum_J += part_J;
    to->size_J += fabs(part_J);
}

/* energy of the components less the work of loads since x0; inertia relief as of the last residual */
static energy potential(static_newton *solver)
{
    const pal_body *body = solver->system.body;
    energy all = {0};
    double *p = solver->cg.p, *q = solver->cg.q;
    pal_system_interpolate(&solver->system);
    for (int i = 0; i < solver->system.n_force; i++) {
        const pal_component *force = &solver->system.force[i];
        if (force->effect->internal && force->effect->energy)
            add_energy(&all, force->effect->energy(force->self, body));
    }
    for (int i = 0; i < solver->cg.n; i++) p[i] = body->x[i] - solver->x0[i];
    const double part = (double)solver->part / solver->load_steps;
    add_energy(&all, -part * pal_dot_product(solver->cg.n, solver->external_force, p));
    if (solver->relieved) add_energy(&all, -pal_dot_product(solver->cg.n, solver->inertia, p));
    if (solver->system.has_contact) {
        memset(q, 0, pal_body_bytes3(solver->system.body));
        pal_system_multiply_contact(&solver->system, 1, p, q);
        add_energy(&all, 0.5 * pal_dot_product(solver->cg.n, p, q));
    }
    return all;
}

/* ---- an iteration ---- */

/* conjugate gradients on the true stiffness from move = 0; 0: a direction of non-positive curvature, move and cg.r
 * are unchanged */
static int run_true(static_newton *solver, double target, double size)
{
    memcpy(solver->now, solver->system.body->x, pal_body_bytes3(solver->system.body));
    solver->cg.multiply = multiply_true;
    int n = pal_conjugate_gradient_run(&solver->cg, solver->move, target, 1, solver->iterations);
    solver->cg.multiply = multiply;
    solver->report.n_cg += n;
    if (n == solver->iterations || solver->cg.residual <= fmax(target, PAL_NEWTON_SLOW * size)) return n;
    memcpy(solver->cg.r, solver->force, pal_body_bytes3(solver->system.body));
    memset(solver->move, 0, pal_body_bytes3(solver->system.body));
    solver->exact = false;
    solver->backoff = BACKOFF;
    return 0;
}

/* iterations of a solve that are worth a preconditioner of the present K */
static double iterations_worth(const static_newton *solver)
{
    const pal_cholesky *factor = solver->preconditioner.factor;
    if (!factor) return PAL_MULTIGRID_ITERATIONS;
    const double worth =
        pal_cholesky_flops(factor) / (PAL_FACTOR_FLOPS_PER_ENTRY * (double)(pal_cholesky_nonzeros(factor) + 1));
    return fmin(fmax(worth, 10), 100);
}

/* conjugate gradients on K, or on the true stiffness if that is positive */
static void run_gradients(static_newton *solver, double size)
{
    double target = 0.3 * solver->tolerance * solver->scale_N;
    if (!solver->constant) target = fmax(target, solver->cg_tolerance * size);
    int n = solver->exact ? run_true(solver, target, size) : 0;
    if (n == 0) {
        n = pal_conjugate_gradient_run(&solver->cg, solver->move, target, 1, solver->iterations);
        solver->report.n_cg += n;
    }
    if (solver->preconditioner.kind == PAL_PRECONDITION_INCOMPLETE) return;
    solver->stale = n > iterations_worth(solver);
    solver->eager |= ++solver->age == 2 && solver->stale;
}

/* move = K^-1 r */
static pal_err solve_linear(static_newton *solver, double size)
{
    bool fresh = (solver->linear == LINEAR_DIRECT || solver->linear == LINEAR_INCOMPLETE) && !solver->constant;
    bool direct = solver->linear == LINEAR_DIRECT && !solver->system.has_contact && !solver->exact;
    memset(solver->move, 0, pal_body_bytes3(solver->system.body));
    const bool renews = solver->linear == LINEAR_AUTO || solver->linear == LINEAR_MULTIGRID;
    if (!solver->has_factor || fresh || (renews && (solver->stale || solver->eager))) PAL_TRY(factor(solver));
    (void)pal_preconditioner_follow(&solver->preconditioner);
    pal_preconditioner_rotate(&solver->preconditioner);
    double before = pal_clock_s();
    if (direct)
        pal_preconditioner_solve(&solver->preconditioner, PAL_CYCLE_V, solver->cg.r, solver->move);
    else
        run_gradients(solver, size);
    if (solver->relieved) {
        const pal_body *body = solver->system.body;
        pal_rigid_motion_remove(body->n_dof, body->mass_kg, moment_positions(solver), false, solver->move);
    }
    solver->report.solve_s += pal_clock_s() - before;
    return PAL_ERR_OK;
}

/* from x, along move */
typedef struct direction {
    energy energy;    /* at x                          */
    double size_N;    /* |residual| there              */
    double slope_J;   /* predicted decrease of the energy along move; the decrease at full step is half of it */
    double longest_m; /* move of a node                */
} direction;

/* tests the trial point x + move by forces where energies cannot decide */
static bool is_flat(static_newton *solver, pal_step *step, const direction *from, double rise_J)
{
    const pal_body *body = solver->system.body;
    double size;
    if (fabs(rise_J) > PAL_SOLVER_FLOOR * from->energy.size_J && from->longest_m > 10 * PAL_DIFFERENCE_H * body->edge_m)
        return false;
    if (solver->relieved) memcpy(solver->now, solver->inertia, pal_body_bytes3(solver->system.body));
    bool found = !find_residual(solver, step, &size) &&
                 fabs(pal_dot_product(solver->cg.n, solver->cg.r, solver->move)) <= 0.8 * from->slope_J &&
                 size <= from->size_N;
    if (solver->relieved && !found) memcpy(solver->inertia, solver->now, pal_body_bytes3(solver->system.body));
    return found;
}

/* x += step move with the largest step of 1, 1/2, 1/4 ... that decreases the energy sufficiently (Armijo); false:
 * none */
static bool search(static_newton *solver, pal_step *at, const direction *from)
{
    pal_body *body = solver->system.body;
    double step = 1, done = 0, noise = 1e-12 * from->energy.size_J;
    bool found = !solver->system.has_energy || solver->constant;
    for (;; step *= 0.5) {
        for (int i = 0; i < solver->cg.n; i++) body->x[i] += (step - done) * solver->move[i];
        done = step;
        if (found) break;
        double rise = potential(solver).sum_J - from->energy.sum_J;
        found = rise <= noise - 1e-4 * step * from->slope_J || (step == 1 && is_flat(solver, at, from, rise));
        if (found || step < 1e-4) break;
    }
    for (int i = 0; i < solver->cg.n && !found; i++) body->x[i] -= done * solver->move[i];
    solver->report.step_size = step;
    return found;
}

static pal_err iterate(static_newton *solver, pal_step *step, double size, bool *moved)
{
    const pal_body *body = solver->system.body;
    direction from = {.size_N = size};
    memcpy(solver->force, solver->cg.r, pal_body_bytes3(solver->system.body));
    /* before linearising, which energies may disturb */
    if (!solver->constant) from.energy = potential(solver);
    pal_system_linearise(&solver->system);
    pal_node_rotations_update(&solver->rotations, &solver->system);
    PAL_TRY(solve_linear(solver, size));
    from.slope_J = pal_dot_product(solver->cg.n, solver->force, solver->move);
    for (int i = 0; i < body->n_dof; i++) from.longest_m = fmax(from.longest_m, pal_norm3(solver->move + 3 * i));
    solver->report.n_newton++;
    /* where the true stiffness is nearly singular, the displacement is long and unreliable */
    double max = pal_guard_max_move_m(body);
    if (solver->exact && from.longest_m > max) {
        for (int i = 0; i < solver->cg.n; i++) solver->move[i] *= max / from.longest_m;
        from.slope_J *= max / from.longest_m;
        from.longest_m = max;
    }
    *moved = search(solver, step, &from) && from.longest_m > 1e-15 * body->length_scale_m;
    return PAL_ERR_OK;
}

/* iterates to the tolerance or to the step's iteration limit */
static pal_err find_rest(static_newton *solver, pal_step *step)
{
    pal_solve_report *to = &solver->report;
    double before = INFINITY;
    const int max = to->n_newton + solver->newton;
    solver->exact = solver->eager = false;
    solver->backoff = 0;
    for (bool moved = true;;) {
        double size;
        PAL_TRY(find_residual(solver, step, &size));
        to->residual = solver->scale_N > 0 ? size / solver->scale_N : 0;
        to->converged = size <= solver->tolerance * solver->scale_N;
        if (to->converged && solver->part < solver->load_steps) {
            solver->part++;
            before = INFINITY;
            continue;
        }
        if (!moved && solver->exact) moved = true, solver->backoff = BACKOFF;
        solver->exact = !solver->constant && solver->backoff == 0 && size > PAL_NEWTON_SLOW * before;
        solver->backoff -= solver->backoff > 0;
        if (size <= PAL_NEWTON_SLOW * before) solver->eager = false;
        before = size;
        if (to->converged || !moved || !isfinite(size) || to->n_newton == max) return PAL_ERR_OK;
        PAL_TRY(iterate(solver, step, size, &moved));
    }
}

/* solves for equilibrium under the present loads; *bad: not finite, the initial state was restored */
static pal_err solve(static_newton *solver, pal_step *step, bool *bad)
{
    pal_body *body = solver->system.body;
    PAL_TRY(find_external_force(solver, step));
    if (solver->system.n_free == 0) {
        pal_body_update_nodes(body);
        solver->report.converged = true;
        return PAL_ERR_OK;
    }
    if (solver->sampled != pal_dofs_material_revision(&body->dofs)) solver->has_factor = false;
    if (solver->part == 0) solver->part = 1;
    PAL_TRY(find_rest(solver, step));
    *bad = !pal_guard_check_finite(body);
    if (*bad) memcpy(body->x, solver->x0, pal_body_bytes3(solver->system.body));
    pal_body_update_nodes(body);
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    static_newton *solver = self;
    pal_body *body = solver->system.body;
    if (!pal_guard_check_finite(body)) return PAL_ERR_OK;
    solver->cg.team = body->team;
    if (step->sub == 0) solver->report.n_newton = solver->report.n_cg = 0;
    memcpy(solver->x0, body->x, pal_body_bytes3(solver->system.body));
    for (int i = 0; i < body->n_dof; i++) {
        if (body->support[i])
            pal_axpy3(body->x + 3 * i, step->dt_s, body->v + 3 * i);
        else
            pal_set3(body->v + 3 * i, 0, 0, 0);
    }
    pal_body_update_nodes(body);
    step->finds_balance = true;
    pal_system_linearise_contact(&solver->system, step);
    bool bad = false, again = pal_guard_recover(step) & PAL_INVERTED;
    do PAL_TRY(solve(solver, step, &bad));
    while (
        solver->system.n_free > 0 && !bad &&
        pal_system_settle_contact(&solver->system, step, solver->x0, solver->move, solver->node_displacement_m, true));
    /* elements that are no longer inverted act again, and the balance is another one */
    for (int k = 0; k < RECOVERIES_MAX && again && solver->system.n_free > 0 && !bad; k++) {
        again = pal_guard_recover(step) & PAL_INVERSION_CHANGED;
        if (again) PAL_TRY(solve(solver, step, &bad));
    }
    return PAL_ERR_OK;
}

/* ---- hooks ---- */

static double limit(void *self, pal_step *step)
{
    (void)self;
    return pal_body_finite(step->body) ? (double)INFINITY : (double)NAN;
}

static void reset(void *self, const pal_body *body)
{
    static_newton *solver = self;
    (void)body;
    solver->part = 0;
    if (solver->system.n_free == 0) return;
    pal_node_rotations_reset(&solver->rotations);
    pal_compliance_solver_reset(&solver->compliance);
    /* the factor is of another state: rebuild it when it is needed */
    if (solver->linear != LINEAR_PCG && solver->preconditioner.n_update > 1) solver->has_factor = false;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    static_newton *solver = self;
    (void)to;
    solver->has_factor = false;
    if (!solver->compliance.hook.solve) return PAL_ERR_OK;
    if (solver->system.interpolated_system) probe(solver);
    pal_node_rotations_reset(&solver->rotations);
    pal_system_linearise_rest(&solver->system);
    pal_err err = pal_compliance_solver_update(&solver->compliance, false);
    if (err == PAL_ERR_NUMERIC)
        return PAL_REFUSE(diag, "body \"%s\": its stiffness at rest is not positive definite", body->name);
    return err;
}

static void report(const void *self, pal_solve_report *out)
{
    const static_newton *solver = self;
    *out = solver->report;
    pal_compliance_solver_report(&solver->compliance, &solver->preconditioner, out);
}

const pal_effect pal_effect_static_newton = {PAL_EFFECT("static_newton", SOLVE),
                                             .bounds.limit = limit,
                                             .material = material,
                                             .reset = reset,
                                             .implicit = true,
                                             .inspect.report = report,
                                             .keeps_components = true,
                                             .destroy = destroy};
