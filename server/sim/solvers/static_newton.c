/* Solver static_newton: static equilibrium under the loads, by Newton's method with a line search on the total
 * energy.
 *
 * Each world step continues from the present shape with zero velocities and makes at most `newton` iterations, so
 * that a caller may show the progress with few per step. The linear systems K d = r (K as the components have it:
 * the corotational law omits the derivative of the rotations, which costs iterations but keeps the energy falling at
 * full steps) are solved
 *   direct: by a factor of the present K, rebuilt in every iteration (once for the linear law),
 *   pcg:    by conjugate gradients with the warped factor of K at rest (warp.h),
 *   auto:   as pcg, but after a solve that took more iterations than a factor is worth by its operation count, the
 *           present K is factored before the next; where that repeats at once, before every solve until an iteration
 *           leaves a tenth of the residual or less,
 *   incomplete: by conjugate gradients with an incomplete factor of the present K (num/incomplete_cholesky.h) in every
 *           iteration: a tenth of the memory or less, for bodies of many nodes; iterations increase strongly for
 *           nearly incompressible and for thin bodies.
 * After an iteration that left more than a tenth of the residual, the next solves for the true stiffness
 * (differences of forces along each direction, system.h) by conjugate gradients with the same factor (truncated
 * Newton; Nash 2000): half the iterations or fewer on a bent beam. If that meets a direction of non-positive
 * curvature too early, its result is discarded and K is used. Far from equilibrium a nearly incompressible body has
 * spurious pressures and an indefinite true stiffness, and truncated directions made no progress for a body of nu
 * 0.499.
 *
 * The line search requires a decrease of the energy; where the expected decrease is below the energy's rounding, it
 * tests the slope at the trial point (approximate Wolfe condition; Hager & Zhang 2005).
 *
 * Converged: the Euclidean norm of the residual force at free nodes is at most `tolerance` times the larger of the
 * sums of |load| over all nodes and of |reaction| over fixed ones. Loads (lasting, contact, gravity) are applied in
 * `load_steps` equal parts, each solved before the next.
 *
 * A body whose supports leave a rigid motion free is refused at load (free "refuse"). If it is a single part without
 * fixed nodes it can be solved by inertia relief (free "inertia_relief"): inertia_relief.h balances the loads, K +
 * eps M is solved, and rigid motion is removed from every d.
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
#include "server/num/conjugate_gradient.h"
#include "server/num/incomplete_cholesky.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/compliance.h"
#include "server/sim/implicit/inertia_relief.h"

#include <limits.h>
#include <string.h>

typedef enum linear_kind { LINEAR_AUTO, LINEAR_DIRECT, LINEAR_PCG, LINEAR_INCOMPLETE } linear_kind;

typedef struct static_newton {
    double tolerance, cg_tolerance;
    int newton, load_steps, iterations;
    linear_kind linear;
    bool relieved, constant; /* inertia relief; K never changes (linear law) */
    pal_system system;
    pal_block_matrix blocks;
    pal_node_rotations turns;
    pal_warp warp;
    pal_incomplete_cholesky incomplete; /* replaces the warp's factor */
    pal_compliance_solver answer;
    pal_conjugate_gradient cg;
    pal_inertia_relief inertia_relief;
    double *x0, *external_force; /* at the beginning of the step; external loads [n_dof][3] */
    double *force, *move;        /* residual and d of the iteration                       [n_dof][3] */
    double *now, *low;           /* work space of the true stiffness [n_dof][3] */
    double *inertia;             /* inertia forces that balance the loads; NULL: no relief [n_dof][3] */
    double *node_displacement_m; /* displacement of interpolated nodes; NULL: none [n_node][3] */
    uint64_t sampled;            /* pal_dofs_material_revision(&body->dofs) at the factor   */
    double shift_1_s2;           /* eps                                           */
    bool has_factor, stale;      /* a factor exists; its last solve took too many iterations */
    bool eager;                  /* the factor was stale at its second solve: rebuild it in every iteration */
    int age;                     /* solves with the factor */
    bool exact;                  /* the tangent converges too slowly: use the true stiffness */
    int backoff;                 /* iterations left without the true stiffness */
    int part;                    /* of the load, of load_steps                    */
    double scale_N;              /* of the tolerance                              */
    pal_solve_report report;
} static_newton;

static const double inertia_relief_share = 1e-8, flops_per_nonzero = 20;
/* an iteration that leaves more of the residual is slow */
static const double slow = 0.1;
/* max residual of conjugate gradients on the true stiffness where they are truncated */
static const double enough = 0.1;
/* relative energy difference that counts as equal (Hager & Zhang 2005); displacement over a voxel's edge that counts
 * as small */
static const double level_share = 1e-6, short_h = 1e-4;
/* iterations with the tangent alone after the true stiffness failed */
enum { BACKOFF = 4 };

static size_t bytes3(const static_newton *row)
{
    return 3 * sizeof(double) * (size_t)row->system.body->n_dof;
}

/* ---- load ---- */

static pal_err read_choice(pal_config_entry *item, const pal_build *build, const char *key, const char *const *names,
                           int n, int *out)
{
    const char *text = names[*out];
    PAL_TRY(pal_entry_read_text(item, key, &text, build->diag));
    for (int i = 0; i < n; i++)
        if (!strcmp(text, names[i])) {
            *out = i;
            return PAL_ERR_OK;
        }
    return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s.%s: \"%s\" is none of %s, %s%s%s%s%s", item->path, key,
                              text, names[0], names[1], n > 2 ? ", " : "", n > 2 ? names[2] : "", n > 3 ? ", " : "",
                              n > 3 ? names[3] : "");
}

static pal_err read_keys(pal_config_entry *item, const pal_build *build, static_newton *row)
{
    static const char *const linear[] = {"auto", "direct", "pcg", "incomplete"}, *const rigid[] = {"refuse",
                                                                                                   "inertia_relief"};
    int kind = 0, relieved = 0;
    row->tolerance = 1e-8, row->cg_tolerance = 1e-3;
    row->newton = 50, row->load_steps = 1, row->iterations = 500;
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-15, 0.5, &row->tolerance, build->diag));
    PAL_TRY(pal_entry_read_number(item, "cg_tolerance", 1e-14, 0.5, &row->cg_tolerance, build->diag));
    PAL_TRY(pal_entry_read_count(item, "newton", 1, 100000, &row->newton, build->diag));
    PAL_TRY(pal_entry_read_count(item, "load_steps", 1, 10000, &row->load_steps, build->diag));
    PAL_TRY(pal_entry_read_count(item, "iterations", 1, 100000, &row->iterations, build->diag));
    PAL_TRY(read_choice(item, build, "linear", linear, 4, &kind));
    PAL_TRY(read_choice(item, build, "free", rigid, 2, &relieved));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    row->linear = (linear_kind)kind;
    row->relieved = relieved;
    const char *law = "";
    pal_config_entry model = build->def->model;
    if (pal_entry_has(&model, "law")) PAL_TRY(pal_entry_read_text(&model, "law", &law, build->diag));
    row->constant = !strcmp(law, "linear");
    return PAL_ERR_OK;
}

static void multiply(void *user, const double *p, double *out)
{
    pal_system_multiply(&((static_newton *)user)->system, p, out);
}

/* the true stiffness at row->now; with contact and, for relief, eps M */
static void multiply_true(void *user, const double *p, double *out)
{
    static_newton *row = user;
    const pal_body *body = row->system.body;
    pal_system_true_stiffness(&row->system, row->now, row->low, p, out);
    if (row->system.has_contact) pal_system_multiply_contact(&row->system, 1, 0, p, out);
    for (int i = 0; i < row->cg.n; i++)
        out[i] = body->support[i / 3] ? 0 : out[i] + row->system.mass * body->mass_kg[i / 3] * p[i];
}

static void precondition(void *user, const double *r, double *z)
{
    static_newton *row = user;
    if (row->linear == LINEAR_INCOMPLETE)
        pal_incomplete_cholesky_solve(&row->incomplete, r, z);
    else
        pal_warp_solve(&row->warp, r, z);
}

static pal_err make_arrays(static_newton *row, pal_arena *arena)
{
    const pal_body *body = row->system.body;
    size_t n3 = 3 * (size_t)body->n_dof;
    double **const array[] = {&row->x0,  &row->external_force, &row->force, &row->move, &row->now,
                              &row->low, &row->cg.r,           &row->cg.z,  &row->cg.p, &row->cg.q};
    for (size_t i = 0; i < sizeof array / sizeof array[0]; i++) {
        *array[i] = PAL_NEW(arena, double, n3);
        if (!*array[i]) return PAL_ERR_MEMORY;
    }
    if (body->interpolation && !(row->node_displacement_m = PAL_NEW(arena, double, 3 * (size_t)body->n_node)))
        return PAL_ERR_MEMORY;
    if (row->relieved && !(row->inertia = PAL_NEW(arena, double, n3))) return PAL_ERR_MEMORY;
    row->cg.n = (int)n3;
    row->cg.multiply = multiply;
    row->cg.precondition = precondition;
    row->cg.user = row;
    return PAL_ERR_OK;
}

/* of the components' present linearisation */
static void assemble(static_newton *row)
{
    double before = pal_clock_s();
    pal_system_assemble(&row->system, &row->blocks);
    row->report.assemble_s += pal_clock_s() - before;
}

/* of an interpolated body: at rest, rebuilt after a change of its samples; then restores the present linearisation */
static void probe(static_newton *row)
{
    const pal_body *body = row->system.body;
    double before = pal_clock_s();
    row->sampled = pal_dofs_material_revision(&body->dofs);
    pal_interpolated_system_invalidate(row->system.interpolated_system);
    (void)pal_system_probe(&row->system, INT_MAX);
    pal_system_linearise(&row->system);
    row->report.assemble_s += pal_clock_s() - before;
}

static pal_err factor(static_newton *row)
{
    if (row->system.interpolated_system) probe(row);
    assemble(row);
    PAL_TRY(row->linear == LINEAR_INCOMPLETE ? pal_incomplete_cholesky_factor(&row->incomplete, &row->blocks)
                                             : pal_warp_factor(&row->warp, &row->blocks));
    if (row->system.interpolated_system) pal_warp_set_rest(&row->warp);
    row->has_factor = true;
    row->stale = false;
    row->age = 0;
    return PAL_ERR_OK;
}

/* eps: a small fraction of K over mass */
static void choose_shift(static_newton *row)
{
    const pal_body *body = row->system.body;
    double stiff = 0, mass = 0;
    assemble(row);
    for (int i = 0; i < body->n_dof; i++) {
        const double *block = row->blocks.value + 9 * (size_t)row->blocks.start[i];
        stiff += (block[0] + block[4] + block[8]) / 3;
        mass += body->mass_kg[i];
    }
    row->shift_1_s2 = inertia_relief_share * stiff / mass;
    row->system.mass = row->shift_1_s2;
}

static pal_err check_supports(static_newton *row, const pal_build *build)
{
    const pal_body *body = build->body;
    pal_support_report s;
    PAL_TRY(pal_system_find_supports(&row->system, &s));
    if (s.n_unsupported == 0) {
        row->relieved = false;
        return PAL_ERR_OK;
    }
    const double *x = body->x_rest + 3 * s.unsupported_node;
    if (!row->relieved)
        return pal_diagnostic_set(
            build->diag, PAL_ERR_REFUSED,
            "body \"%s\": %d of its %d parts (the one at (%g, %g, %g) m) has fewer than three held nodes "
            "off a line, so it has no state of rest; give supports, or free \"inertia_relief\" to "
            "static_newton",
            body->name, s.n_unsupported, s.n_part, x[0], x[1], x[2]);
    if (body->interpolation)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "body \"%s\": inertia_relief is for bodies of nodes, this one has control points",
                                  body->name);
    if (s.n_part > 1 || row->system.n_free < body->n_node)
        return pal_diagnostic_set(
            build->diag, PAL_ERR_REFUSED,
            "body \"%s\": inertia_relief is for one part without held nodes, this body has %d parts and "
            "%d held nodes",
            body->name, s.n_part, body->n_node - row->system.n_free);
    return PAL_ERR_OK;
}

static pal_err make_factors(static_newton *row, pal_build *build)
{
    pal_body *body = build->body;
    if (body->interpolation && (row->linear == LINEAR_DIRECT || row->linear == LINEAR_INCOMPLETE))
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "body \"%s\": static_newton with linear \"%s\" is for bodies of nodes, this one has "
                                  "control points; take \"pcg\"",
                                  body->name, row->linear == LINEAR_DIRECT ? "direct" : "incomplete");
    if (body->interpolation) row->linear = LINEAR_PCG;
    PAL_TRY(pal_system_pattern(&row->system, build->arena, &row->blocks));
    PAL_TRY(pal_node_rotations_make(&row->system, build->arena, &row->turns));
    if (row->linear == LINEAR_INCOMPLETE)
        PAL_TRY(pal_incomplete_cholesky_make(&row->blocks, body->support, build->arena, &row->incomplete));
    else
        PAL_TRY(pal_warp_make(&row->blocks, body, &row->turns, false, build->arena, &row->warp));
    pal_system_linearise(&row->system);
    if (row->relieved) choose_shift(row);
    pal_err err = row->linear == LINEAR_DIRECT ? PAL_ERR_OK : factor(row);
    if (!err) err = pal_compliance_solver_make(&row->system, &row->turns, &row->blocks, build->arena, &row->answer);
    if (err == PAL_ERR_NUMERIC)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "body \"%s\": its stiffness at rest is not positive definite", body->name);
    return err;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    static_newton *row = PAL_NEW(build->arena, static_newton, 1);
    if (!row) return PAL_ERR_MEMORY;
    *self = row;
    PAL_TRY(read_keys(item, build, row));
    PAL_TRY(pal_system_make(build, &row->system));
    row->system.mass = 0, row->system.stiff = 1, row->system.damp = 0;
    PAL_TRY(make_arrays(row, build->arena));
    if (row->system.n_free == 0) return PAL_ERR_OK;
    PAL_TRY(check_supports(row, build));
    return make_factors(row, build);
}

static void destroy(void *self)
{
    static_newton *row = self;
    pal_warp_destroy(&row->warp);
    pal_compliance_solver_destroy(&row->answer);
}

/* ---- forces and energy ---- */

static pal_err run_rows(pal_step *step, bool internal)
{
    uint64_t before = pal_clock_ns();
    for (int i = 0; i < step->n_force; i++) {
        pal_component *force = &step->force[i];
        if (force->effect->internal != internal || force->effect->drag) continue;
        force->n_run++;
        PAL_TRY(force->effect->run(force->self, step));
        uint64_t now = pal_clock_ns();
        force->spent_ns += now - before;
        before = now;
    }
    return PAL_ERR_OK;
}

/* external loads at the beginning of the step */
static pal_err find_outer(static_newton *row, pal_step *step)
{
    pal_body *body = row->system.body;
    memcpy(body->f, body->load, 3 * sizeof(double) * (size_t)body->n_node);
    PAL_TRY(run_rows(step, false));
    if (!body->interpolation) {
        memcpy(row->external_force, body->f, bytes3(row));
        return PAL_ERR_OK;
    }
    memset(row->external_force, 0, bytes3(row));
    pal_interpolation_apply_transpose(body->interpolation, body->f, row->external_force);
    return PAL_ERR_OK;
}

static double share(const static_newton *row)
{
    return (double)row->part / row->load_steps;
}

/* body->g = all forces at body->x; cg.r = those at free nodes; returns |r|. The tolerance's scale too */
static pal_err find_residual(static_newton *row, pal_step *step, double *size)
{
    pal_body *body = row->system.body;
    double part = share(row), loads = 0, reactions = 0, *r = row->cg.r, *p = row->cg.p;
    pal_system_interpolate(&row->system);
    if (body->interpolation) memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    for (int i = 0; i < row->cg.n; i++) body->g[i] = part * row->external_force[i];
    PAL_TRY(run_rows(step, true));
    if (body->interpolation) pal_interpolation_apply_transpose(body->interpolation, body->f, body->g);
    memcpy(r, body->g, bytes3(row));
    if (row->system.has_contact) {
        for (int i = 0; i < row->cg.n; i++) p[i] = body->x[i] - row->x0[i];
        pal_system_multiply_contact(&row->system, -1, 0, p, r);
    }
    for (int i = 0; i < body->n_dof; i++) {
        loads += pal_norm3(row->external_force + 3 * i);
        if (!body->support[i]) continue;
        reactions += pal_norm3(r + 3 * i);
        pal_set3(r + 3 * i, 0, 0, 0);
    }
    if (row->relieved && pal_inertia_relief_make(body, row->constant ? body->x_rest : body->x, &row->inertia_relief)) {
        memcpy(row->inertia, r, bytes3(row));
        pal_inertia_relief_balance(&row->inertia_relief, body, r);
        for (int i = 0; i < row->cg.n; i++) row->inertia[i] = r[i] - row->inertia[i];
    }
    row->scale_N = fmax(loads, reactions);
    *size = sqrt(pal_dot_product(row->cg.n, r, r));
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
static energy potential(static_newton *row)
{
    const pal_body *body = row->system.body;
    energy all = {0};
    double *p = row->cg.p, *q = row->cg.q;
    pal_system_interpolate(&row->system);
    for (int i = 0; i < row->system.n_force; i++) {
        const pal_component *force = &row->system.force[i];
        if (force->effect->internal && force->effect->energy)
            add_energy(&all, force->effect->energy(force->self, body));
    }
    for (int i = 0; i < row->cg.n; i++) p[i] = body->x[i] - row->x0[i];
    add_energy(&all, -share(row) * pal_dot_product(row->cg.n, row->external_force, p));
    if (row->relieved) add_energy(&all, -pal_dot_product(row->cg.n, row->inertia, p));
    if (row->system.has_contact) {
        memset(q, 0, bytes3(row));
        pal_system_multiply_contact(&row->system, 1, 0, p, q);
        add_energy(&all, 0.5 * pal_dot_product(row->cg.n, p, q));
    }
    return all;
}

/* ---- an iteration ---- */

/* conjugate gradients on the true stiffness from move = 0; 0: a direction of non-positive curvature, move and cg.r
 * are unchanged */
static int run_true(static_newton *row, double target, double size)
{
    memcpy(row->now, row->system.body->x, bytes3(row));
    row->cg.multiply = multiply_true;
    int n = pal_conjugate_gradient_run(&row->cg, row->move, target, 1, row->iterations);
    row->cg.multiply = multiply;
    row->report.n_cg += n;
    if (n == row->iterations || row->cg.residual <= fmax(target, enough * size)) return n;
    memcpy(row->cg.r, row->force, bytes3(row));
    memset(row->move, 0, bytes3(row));
    row->exact = false;
    row->backoff = BACKOFF;
    return 0;
}

/* conjugate gradients on K, or on the true stiffness if that is positive */
static void run_gradients(static_newton *row, double size)
{
    double target = 0.3 * row->tolerance * row->scale_N;
    if (!row->constant) target = fmax(target, row->cg_tolerance * size);
    int n = row->exact ? run_true(row, target, size) : 0;
    if (n == 0) {
        n = pal_conjugate_gradient_run(&row->cg, row->move, target, 1, row->iterations);
        row->report.n_cg += n;
    }
    if (row->linear == LINEAR_INCOMPLETE) return;
    double worth = pal_cholesky_flops(row->warp.factor) /
                   (flops_per_nonzero * (double)(pal_cholesky_nonzeros(row->warp.factor) + 1));
    row->stale = n > fmin(fmax(worth, 10), 100);
    row->eager |= ++row->age == 2 && row->stale;
}

/* move = K^-1 r */
static pal_err solve_linear(static_newton *row, double size)
{
    bool fresh = (row->linear == LINEAR_DIRECT || row->linear == LINEAR_INCOMPLETE) && !row->constant;
    bool direct = row->linear == LINEAR_DIRECT && !row->system.has_contact && !row->exact;
    memset(row->move, 0, bytes3(row));
    if (!row->has_factor || fresh || (row->linear == LINEAR_AUTO && (row->stale || row->eager))) PAL_TRY(factor(row));
    if (row->warp.factor) pal_warp_rotate(&row->warp, &row->turns);
    double before = pal_clock_s();
    if (direct)
        pal_warp_solve(&row->warp, row->cg.r, row->move);
    else
        run_gradients(row, size);
    if (row->relieved) pal_inertia_relief_remove_rigid(&row->inertia_relief, row->system.body, row->move);
    row->report.solve_s += pal_clock_s() - before;
    return PAL_ERR_OK;
}

/* from x, along move */
typedef struct way {
    energy energy;    /* at x                          */
    double size_N;    /* |residual| there              */
    double slope_J;   /* predicted decrease of the energy along move; the decrease at full step is half of it */
    double longest_m; /* move of a node                */
} way;

/* tests the trial point x + move by forces where energies cannot decide */
static bool is_flat(static_newton *row, pal_step *step, const way *from, double rise_J)
{
    const pal_body *body = row->system.body;
    bool level = fabs(rise_J) <= level_share * from->energy.size_J;
    bool short_way = from->longest_m <= short_h * body->edge_m;
    double size;
    if (!level && !short_way) return false;
    if (row->relieved) memcpy(row->now, row->inertia, bytes3(row));
    bool found = !find_residual(row, step, &size) &&
                 fabs(pal_dot_product(row->cg.n, row->cg.r, row->move)) <= 0.8 * from->slope_J && size <= from->size_N;
    if (row->relieved && !found) memcpy(row->inertia, row->now, bytes3(row));
    return found;
}

/* x += step move with the largest step of 1, 1/2, 1/4 ... that decreases the energy sufficiently (Armijo); false:
 * none */
static bool search(static_newton *row, pal_step *at, const way *from)
{
    pal_body *body = row->system.body;
    double step = 1, done = 0, noise = 1e-12 * from->energy.size_J;
    bool found = !row->system.has_energy || row->constant;
    for (;; step *= 0.5) {
        for (int i = 0; i < row->cg.n; i++) body->x[i] += (step - done) * row->move[i];
        done = step;
        if (found) break;
        double rise = potential(row).sum_J - from->energy.sum_J;
        found = rise <= noise - 1e-4 * step * from->slope_J || (step == 1 && is_flat(row, at, from, rise));
        if (found || step < 1e-4) break;
    }
    for (int i = 0; i < row->cg.n && !found; i++) body->x[i] -= done * row->move[i];
    row->report.step_size = step;
    return found;
}

static pal_err iterate(static_newton *row, pal_step *step, double size, bool *moved)
{
    const pal_body *body = row->system.body;
    way from = {.size_N = size};
    memcpy(row->force, row->cg.r, bytes3(row));
    /* before linearising, which energies may disturb */
    if (!row->constant) from.energy = potential(row);
    pal_system_linearise(&row->system);
    pal_node_rotations_update(&row->turns, &row->system);
    PAL_TRY(solve_linear(row, size));
    from.slope_J = pal_dot_product(row->cg.n, row->force, row->move);
    for (int i = 0; i < body->n_dof; i++) from.longest_m = fmax(from.longest_m, pal_norm3(row->move + 3 * i));
    row->report.n_newton++;
    /* where the true stiffness is nearly singular, the displacement is long and unreliable */
    double max = pal_guard_max_move_m(body);
    if (row->exact && from.longest_m > max) {
        for (int i = 0; i < row->cg.n; i++) row->move[i] *= max / from.longest_m;
        from.slope_J *= max / from.longest_m;
        from.longest_m = max;
    }
    *moved = search(row, step, &from) && from.longest_m > 1e-15 * body->length_scale_m;
    return PAL_ERR_OK;
}

/* iterates to the tolerance or to the step's iteration limit */
static pal_err find_rest(static_newton *row, pal_step *step)
{
    pal_solve_report *to = &row->report;
    to->n_newton = to->n_cg = 0;
    double before = INFINITY;
    row->exact = row->eager = false;
    row->backoff = 0;
    for (bool moved = true;;) {
        double size;
        PAL_TRY(find_residual(row, step, &size));
        to->residual = row->scale_N > 0 ? size / row->scale_N : 0;
        to->converged = size <= row->tolerance * row->scale_N;
        if (to->converged && row->part < row->load_steps) {
            row->part++;
            before = INFINITY;
            continue;
        }
        if (!moved && row->exact) moved = true, row->backoff = BACKOFF;
        row->exact = !row->constant && row->backoff == 0 && size > slow * before;
        row->backoff -= row->backoff > 0;
        if (size <= slow * before) row->eager = false;
        before = size;
        if (to->converged || !moved || !isfinite(size) || to->n_newton == row->newton) return PAL_ERR_OK;
        PAL_TRY(iterate(row, step, size, &moved));
    }
}

/* true: contact has changed its loads */
static bool settle(static_newton *row, pal_step *step)
{
    bool again = false;
    const pal_body *body = row->system.body;
    double *moved = body->interpolation ? row->node_displacement_m : row->move;
    for (int i = 0; i < row->cg.n; i++) row->move[i] = body->x[i] - row->x0[i];
    if (body->interpolation) pal_interpolation_apply(body->interpolation, row->move, moved);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *contact = &step->contact[i];
        if (contact->effect->tangent && contact->effect->tangent->settle)
            again |= contact->effect->tangent->settle(contact->self, step, moved, true);
    }
    return again;
}

/* solves for equilibrium under the present loads; *bad: not finite, the initial state was restored */
static pal_err solve(static_newton *row, pal_step *step, bool *bad)
{
    pal_body *body = row->system.body;
    PAL_TRY(find_outer(row, step));
    if (row->system.n_free == 0) {
        pal_body_update_nodes(body);
        row->report.converged = true;
        return PAL_ERR_OK;
    }
    if (row->sampled != pal_dofs_material_revision(&body->dofs)) row->has_factor = false;
    if (row->part == 0) row->part = 1;
    PAL_TRY(find_rest(row, step));
    if (row->answer.door.solve) pal_warp_rotate(&row->answer.warp, &row->turns);
    *bad = !pal_guard_check_finite(body);
    if (*bad) memcpy(body->x, row->x0, bytes3(row));
    pal_body_update_nodes(body);
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    static_newton *row = self;
    pal_body *body = row->system.body;
    if (!pal_guard_check_finite(body)) return PAL_ERR_OK;
    memcpy(row->x0, body->x, bytes3(row));
    for (int i = 0; i < body->n_dof; i++) {
        if (body->support[i])
            pal_axpy3(body->x + 3 * i, step->dt_s, body->v + 3 * i);
        else
            pal_set3(body->v + 3 * i, 0, 0, 0);
    }
    pal_system_linearise_contact(&row->system, step);
    bool bad = false;
    do PAL_TRY(solve(row, step, &bad));
    while (row->system.n_free > 0 && !bad && settle(row, step));
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
    static_newton *row = self;
    (void)body;
    row->part = 0;
    if (row->system.n_free == 0) return;
    pal_node_rotations_reset(&row->turns);
    /* the factor is of another state: rebuild it when it is needed */
    if (row->linear != LINEAR_PCG && row->warp.n_factor > 1) row->has_factor = false;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    static_newton *row = self;
    pal_body *own = row->system.body;
    (void)to;
    row->has_factor = false;
    if (!row->answer.door.solve) return PAL_ERR_OK;
    double *x = own->x, *d = own->d;
    own->x = own->x_rest, own->d = own->node_rest;
    if (own->interpolation) probe(row);
    pal_node_rotations_reset(&row->turns);
    pal_system_linearise(&row->system);
    pal_err err = pal_compliance_solver_factor(&row->answer, &row->system, &row->blocks);
    own->x = x, own->d = d;
    if (err == PAL_ERR_NUMERIC)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body \"%s\": its stiffness at rest is not positive definite",
                                  body->name);
    return err;
}

static void report(const void *self, pal_solve_report *out)
{
    const static_newton *row = self;
    *out = row->report;
    if (!row->warp.factor) return;
    out->factor_nonzeros = pal_cholesky_nonzeros(row->warp.factor);
    out->n_factor = row->warp.n_factor;
    out->analyse_s = row->warp.analyse_s;
    out->factor_s = row->warp.factor_s;
}

const pal_effect pal_effect_static_newton = {.name = "static_newton",
                                             .stage = PAL_STAGE_SOLVE,
                                             .make = make,
                                             .run = run,
                                             .limit = limit,
                                             .material = material,
                                             .reset = reset,
                                             .implicit = true,
                                             .report = report,
                                             .keeps_components = true,
                                             .destroy = destroy};
